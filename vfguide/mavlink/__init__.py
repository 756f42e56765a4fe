"""MAVLink, bytes in and bytes out: what autopilots report, and what they are told."""
