import cmath
import math
from typing import Any

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of
from tests.kit.states import FRAME, reported
from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.elementwise import wrap_angle
from vfguide.mavlink.reports import (
    AirspeedReport,
    AttitudeReport,
    BatteryReport,
    PositionReport,
    SensorsReport,
)
from vfguide.state import Setpoint


@pytest.fixture
def own() -> OwnVehicle:
    return OwnVehicle(plan_of())


def report(boot_time_s: float, north: float = 0.0, **changes: Any) -> PositionReport:
    """A report of 22 m/s north and 3 m/s east over ground, nose north."""
    return reported(boot_time_s, north, **{"velocity": (22.0, 3.0), **changes})


def taken(own: OwnVehicle, report: PositionReport, now: float) -> NavigatedState:
    """The fix that a report leads to, with 20 m/s of airspeed just heard."""
    own.note(AirspeedReport(airspeed=20.0), now)
    navigated = own.take(report, now)
    assert navigated is not None
    return navigated


def test_the_first_report_is_taken_as_it_is(own):
    navigated = taken(own, report(5.0, north=100.0), now=42.0)
    state = navigated.state
    assert (state.time_s, state.heading, state.airspeed) == (42.0, 0.0, 20.0)
    assert (state.north, state.east) == pytest.approx((100.0, 0.0), abs=1e-3)
    # Air velocity (20, 0), ground velocity (22, 3).
    assert (state.wind_north, state.wind_east) == pytest.approx((2.0, 3.0))
    assert (state.wind_rate_north, state.wind_rate_east) == (0.0, 0.0)
    motion = (state.course, state.ground_speed)
    assert motion == pytest.approx((math.atan2(3.0, 22.0), math.sqrt(493.0)))
    assert (navigated.interval, navigated.period) == (math.inf, pytest.approx(0.05))


def test_the_place_is_the_navigated_one(own):
    taken(own, report(5.0), now=42.0)
    # Predicted at 1.1 m, reported at 6.1 m: the filter leans 0.05 / 2.05 of the 5 m between.
    navigated = taken(own, report(5.05, north=6.1), now=42.05)
    state, place = navigated.state, navigated.place
    assert state.north == pytest.approx(1.1 + 5.0 * 0.05 / 2.05, abs=1e-3)
    place_m = FRAME.to_local(place.latitude_deg, place.longitude_deg)
    assert place_m == pytest.approx((state.north, state.east), abs=1e-3)
    assert place.altitude_amsl == 588.0


def test_intervals_are_those_of_the_autopilots_clock(own):
    taken(own, report(5.0), now=42.0)
    # Read 0.2 s late: neither the interval nor the time of the state knows.
    navigated = taken(own, report(5.15), now=42.35)
    assert navigated.interval == pytest.approx(0.15, abs=1e-4)
    assert navigated.state.time_s == pytest.approx(42.15)
    assert navigated.period == pytest.approx(0.05 + 0.1 * (0.15 - 0.05), abs=1e-5)


@pytest.mark.parametrize("boot_time_s", [6.0, 5.95, 5.1])
def test_a_duplicate_and_a_late_report_are_ignored(own, boot_time_s):
    taken(own, report(6.0), now=42.0)
    assert own.take(report(boot_time_s, north=500.0), 42.01) is None
    navigated = taken(own, report(6.05, north=1.1), now=42.05)
    assert navigated.interval == pytest.approx(0.05)
    assert navigated.state.north == pytest.approx(1.1, abs=1e-3)


def test_after_a_gap_of_more_than_a_second_the_filter_starts_anew(own):
    taken(own, report(4.0), now=41.0)
    assert taken(own, report(4.99, north=30.0), now=41.99).state.north < 28.0
    taken(own, report(5.15), now=42.15)
    # 22 m/s for 1.16 s are 25.5 m: a filter would lean on that.
    navigated = taken(own, report(6.16, north=30.0), now=43.16)
    assert navigated.state.north == pytest.approx(30.0, abs=1e-3)
    assert navigated.interval == pytest.approx(1.01)
    assert navigated.period == pytest.approx(0.05)


def test_a_reboot_starts_anew_as_soon_as_it_is_certain(own):
    taken(own, report(100.0), now=200.0)
    for number in range(20):
        assert own.take(report(0.05 * (1 + number)), 201.0 + 0.05 * number) is None
    navigated = taken(own, report(1.05, north=500.0), now=202.0)
    assert navigated.state.north == pytest.approx(500.0, abs=1e-3)
    assert navigated.state.time_s == 202.0
    assert own.reboots == 1
    assert navigated.interval == math.inf
    after = taken(own, report(1.1, north=501.1), now=202.05)
    assert after.interval == pytest.approx(0.05)


def test_without_any_airspeed_there_is_no_wind_and_none_is_less_than_1_m_s(own):
    on_the_ground = OwnVehicle(plan_of())
    on_the_ground.note(AirspeedReport(airspeed=0.0), 42.0)
    assert on_the_ground.take(report(5.0, velocity=(0.0, 0.0)), 42.0).state.airspeed == 1.0
    navigated = own.take(report(5.0, heading=math.atan2(3.0, 22.0)), 42.0)
    assert navigated.state.airspeed == pytest.approx(math.sqrt(493.0))
    wind = navigated.state.wind_north, navigated.state.wind_east
    assert wind == pytest.approx((0.0, 0.0), abs=1e-9)


def test_an_airspeed_that_is_too_old_falls_back_on_the_wind(own):
    own.note(AirspeedReport(airspeed=20.0), 42.0)
    own.take(report(5.0), 42.0)
    own.note(AirspeedReport(airspeed=17.0), 42.1)
    fresh = own.take(report(7.1, north=46.2), 44.1)
    assert fresh.state.airspeed == 17.0
    # Wind is now (22 - 17, 3) and what is left of (22, 3) is 17 m/s.
    own.note(AirspeedReport(airspeed=30.0), 44.1)
    old = own.take(report(9.2, north=92.4), 46.2)
    assert old.state.airspeed == pytest.approx(17.0)


NORTHBOUND = (22.0, 0.0)


@pytest.mark.parametrize(("heading", "airspeed"), [(None, 20.0), (0.0, 20.0), (0.0, 0.0)])
def test_the_bank_turns_the_nose_through_a_silence_and_a_blocked_airspeed_ends_nothing(
    heading, airspeed
):
    own = OwnVehicle(plan_of())
    for number in range(60):
        time_s = 0.05 * number
        said = report(5.0 + time_s, north=22.0 * time_s, velocity=NORTHBOUND)
        taken(own, said, now=42.0 + time_s)
    # Place, velocity and heading are repeated from now on, in a turn at 0.2 rad of bank: 0.1 rad/s.
    for number in range(60, 100):
        now = 42.0 + 0.05 * number
        own.note(AirspeedReport(airspeed=airspeed), now)
        own.note(AttitudeReport(bank=0.2), now)
        own.note_setpoint(Setpoint(course=0.0, speed=24.0), now)
        said = report(now - 37.0, north=64.9, velocity=NORTHBOUND, heading=heading)
        navigated = own.take(said, now)
    turned_s = 0.05 * 40
    assert navigated is not None
    assert navigated.steerable
    assert navigated.state.heading == pytest.approx(0.1 * turned_s, abs=0.06)
    # Without a sensor it is as fast as the setpoint makes it: 0.8 1/s for 2 s.
    flown = 20.0 if airspeed > 0.0 else 24.0 - 4.0 * math.exp(-0.8 * turned_s)
    assert navigated.state.airspeed == pytest.approx(flown, abs=0.5)


def test_a_compass_that_is_off_makes_no_wind_where_no_airspeed_is_known(own):
    # Round a circle in calm air, the nose 40 degrees beside the course. By measured headings the airspeed,
    # which came from the wind that came from it, grew to 107 m/s in a minute: seen of a PX4 in software.
    north = east = 0.0
    own.note(AirspeedReport(airspeed=20.0), 40.0)
    for number in range(1200):
        time_s, course = 0.05 * number, 0.15 * 0.05 * number
        velocity = 20.0 * math.cos(course), 20.0 * math.sin(course)
        heading = course + (0.0 if number < 45 else 0.7)
        said = reported(5.0 + time_s, north, east, velocity=velocity, heading=heading)
        state = own.take(said, 40.0 + time_s).state
        assert state.airspeed < 25.0
        # The ground velocity is the measured one all the same, a little late.
        assert state.ground_speed == pytest.approx(20.0, abs=0.5)
        north, east = north + velocity[0] * 0.05, east + velocity[1] * 0.05


def test_an_airspeed_is_not_judged_by_a_wind_that_no_aircraft_could_fly_in(own):
    # Of (22, 3) m/s over ground a wind of (2, 3) leaves 20 m/s; of (6, 3) 4 m/s, which is no fixed wing's.
    taken(own, report(5.0), now=42.0)
    for number in range(20):
        passed_s = 0.05 + 0.1 * number
        own.take(report(5.0 + passed_s, velocity=(6.0, 3.0)), 42.0 + passed_s)
    own.note(AirspeedReport(airspeed=20.0), 44.2)
    assert own.counters["airspeed not believed"] == 0


def test_an_unknown_heading_falls_back_on_the_wind_and_one_never_known_on_the_course(own):
    navigated = taken(OwnVehicle(plan_of()), report(5.0, heading=None), now=42.0)
    assert navigated.state.heading == pytest.approx(math.atan2(3.0, 22.0))
    taken(own, report(5.0), now=42.0)
    # Ground velocity (22, 3) without the wind of (2, 3) points north.
    navigated = taken(own, report(5.05, heading=None), now=42.05)
    assert navigated.state.heading == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("vehicle", "wind_north"),
    [("leader", 0.0), ("f1", -10.0 * (1.0 - math.exp(-3.0 * 0.4 / 0.35)))],
)
def test_only_a_leader_with_the_observer_navigates_by_positions_alone(vehicle, wind_north):
    known = plan_of(vehicle=vehicle)
    own = OwnVehicle(replace(known, settings=replace(known.settings, speed_source="observer")))
    own.note(AirspeedReport(airspeed=20.0), 42.0)
    own.take(report(5.0, velocity=(20.0, 0.0)), 42.0)
    # The position says 20 m/s, the velocity 10: who believes it sees a head wind, filtered over 0.35 s.
    navigated = own.take(report(5.4, north=8.0, velocity=(10.0, 0.0)), 42.4)
    assert navigated.state.wind_north == pytest.approx(wind_north, abs=1e-3)


def drifting(own: OwnVehicle) -> NavigatedState:
    """After 5 s of 22 m/s north and 2.7 m/s east by the positions; velocities have 3 m/s to the east."""
    for step in range(101):
        time_s = 0.05 * step
        moved = reported(5.0 + time_s, 22.0 * time_s, 2.7 * time_s, velocity=(22.0, 3.0))
        navigated = taken(own, moved, now=40.0 + time_s)
    return navigated


REPORTED, TRUE = math.atan2(3.0, 22.0), math.atan2(2.7, 22.0)


def test_a_velocity_that_positions_contradict_is_put_right_and_the_autopilot_told_its_own_course():
    known = plan_of()
    filters = replace(known.settings.filters, velocity_s=0.3, position_s=0.2)
    own = OwnVehicle(replace(known, settings=replace(known.settings, filters=filters)))
    assert drifting(own).state.course == pytest.approx(TRUE, abs=0.001)
    # 0.75 degrees: its course hold acts on the course that it reports.
    assert own.course_offset == pytest.approx(REPORTED - TRUE, abs=0.001)
    # Unless the mission says so, velocities are taken as they are.
    own = OwnVehicle(known)
    assert drifting(own).state.course == pytest.approx(REPORTED, abs=0.001)
    assert own.course_offset == 0.0


def told(own: OwnVehicle, now: float) -> tuple[float | None, float | None]:
    """What is left of a battery, and its volts."""
    newest = own.sensors.newest(now)
    return newest.battery, newest.battery_voltage


SENSORS = SensorsReport(gps=True, attitude=True)
FIRST = replace(SENSORS, battery=0.9, battery_voltage=12.3)


def test_the_emptiest_of_several_batteries_is_the_one_that_is_told(own):
    assert own.sensors.newest(0.0) is None
    own.note(FIRST, 0.0)
    for number, left, volts in [(0, 0.9, 12.3), (1, 0.4, 22.0), (2, None, 5.0)]:
        own.note(BatteryReport(number=number, remaining=left, voltage=volts), 0.0)
    assert told(own, 1.0) == (0.4, 22.0)
    # Ten seconds later the second battery is not heard of any more.
    own.note(replace(SENSORS, battery=0.85, battery_voltage=12.2), 10.5)
    assert told(own, 10.5) == (0.85, 12.2)


@pytest.mark.parametrize(
    ("sensors", "number", "remaining"),
    # Volts of another battery are not told with what is left of this one; SYS_STATUS knows no more.
    [(FIRST, 1, 0.4), (SENSORS, 0, 0.7)],
)
def test_a_battery_without_volts_is_told_without(own, sensors, number, remaining):
    own.note(sensors, 0.0)
    own.note(BatteryReport(number=number, remaining=remaining, voltage=None), 0.0)
    assert told(own, 1.0) == (remaining, None)


WIND_NORTH, WIND_EAST = 3.0, -4.0
AIRSPEED, SHOWN = 21.3, 20.0
"""True / shown is 1.065."""

TURN_RATE, SLIP = 0.13, 0.1
"""rad/s, and rad that the nose is ahead of the air velocity."""


def after_laps(plan: FlightPlan, laps: float) -> tuple[NavigatedState, OwnVehicle, float]:
    """The last fix, and the true direction through the air."""
    own, place = OwnVehicle(plan), 0j
    for step in range(round(laps * math.tau / TURN_RATE / 0.04)):
        time_s, direction = step * 0.04, TURN_RATE * step * 0.04
        velocity = cmath.rect(AIRSPEED, direction) + complex(WIND_NORTH, WIND_EAST)
        place += 0.04 * velocity
        own.note(AirspeedReport(airspeed=SHOWN), time_s)
        flown = {"velocity": (velocity.real, velocity.imag), "heading": direction + SLIP}
        navigated = own.take(reported(time_s, place.real, place.imag, **flown), time_s)
    assert navigated is not None
    return navigated, own, direction


def test_wind_scale_and_direction_are_found_in_spite_of_the_slip():
    navigated, own, direction = after_laps(replace(plan_of(), slips=True, turn_efficiency=0.8), 3.0)
    assert own.air.calibration.scale == pytest.approx(AIRSPEED / SHOWN, abs=0.015)
    state = navigated.state
    wind = state.wind_north, state.wind_east
    assert wind == pytest.approx((WIND_NORTH, WIND_EAST), abs=0.5)
    # The nose is 0.1 rad off.
    assert wrap_angle(state.heading - direction) == pytest.approx(0.0, abs=0.03)
    # No wind that turns with the aircraft is fed forward: 2 m/s of it would be 0.27 m/s².
    assert math.hypot(state.wind_rate_north, state.wind_rate_east) < 0.05


def test_a_vehicle_that_is_not_known_to_slip_is_taken_by_its_nose():
    navigated, _, direction = after_laps(plan_of(), 3.0)
    assert wrap_angle(navigated.state.heading - direction) == pytest.approx(SLIP, abs=1e-6)
