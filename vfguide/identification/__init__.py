"""How a vehicle's autopilot answers to courses and speeds: flown, fitted, written down."""
