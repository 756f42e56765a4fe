"""A vehicle whose nose points into its turns, and whose airspeed sensor shows too little."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of
from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.elementwise import wrap_angle
from vfguide.mavlink.reports import AirspeedReport, PositionReport

PERIOD = 0.04
WIND_NORTH, WIND_EAST = 3.0, -4.0
AIRSPEED, SHOWN = 21.3, 20.0
"""True / shown is 1.065."""

TURN_RATE, SLIP = 0.13, 0.1
"""rad/s, and rad that the nose is ahead of the air velocity."""


def after_laps(plan: FlightPlan, laps: float) -> tuple[NavigatedState, OwnVehicle, float]:
    """The last fix, and the true direction through the air."""
    own = OwnVehicle(plan)
    north = east = 0.0
    direction = 0.0
    navigated = None
    for step in range(round(laps * math.tau / TURN_RATE / PERIOD)):
        direction = TURN_RATE * step * PERIOD
        velocity = (
            AIRSPEED * math.cos(direction) + WIND_NORTH,
            AIRSPEED * math.sin(direction) + WIND_EAST,
        )
        north, east = north + PERIOD * velocity[0], east + PERIOD * velocity[1]
        latitude, longitude = plan.frame.to_geodetic(north, east)
        own.note(AirspeedReport(airspeed=SHOWN), step * PERIOD)
        report = PositionReport(
            boot_time_s=step * PERIOD,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_amsl=588.0,
            velocity_north=velocity[0],
            velocity_east=velocity[1],
            heading=direction + SLIP,
        )
        navigated = own.take(report, step * PERIOD)
    assert navigated is not None
    return navigated, own, direction


def test_wind_scale_and_direction_are_found_in_spite_of_the_slip():
    navigated, own, direction = after_laps(replace(plan_of(), slips=True, turn_efficiency=0.8), 3.0)
    assert own.air.calibration.scale == pytest.approx(AIRSPEED / SHOWN, abs=0.015)
    state = navigated.state
    assert (state.wind_north, state.wind_east) == (
        pytest.approx(WIND_NORTH, abs=0.5),
        pytest.approx(WIND_EAST, abs=0.5),
    )
    # The nose is 0.1 rad off.
    assert wrap_angle(state.heading - direction) == pytest.approx(0.0, abs=0.03)
    # No wind that turns with the aircraft is fed forward: 2 m/s of it would be 0.27 m/s².
    assert math.hypot(state.wind_rate_north, state.wind_rate_east) < 0.05


def test_a_vehicle_that_is_not_known_to_slip_is_taken_by_its_nose():
    navigated, _, direction = after_laps(plan_of(), 3.0)
    assert wrap_angle(navigated.state.heading - direction) == pytest.approx(SLIP, abs=1e-6)
