"""When and where a companion engages its vehicle, what it sends from then on, and what ends that.

Which autopilot answers, what its parameters are, and what is said of both before take-off.
"""

import math
import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import (
    ALTITUDE,
    HEADING,
    KINDS,
    LOITER,
    MANUAL,
    MESSAGE_INTERVAL,
    SET_MODE,
    SPEED,
    Flight,
    assert_left_alone,
    companion_of,
    emulator,
    heard_until,
    leader_bytes,
    new_flight,
)
from tests.kit.missions import mission_with, plan_of
from tests.kit.states import FRAME, reported
from tests.kit.wire import heartbeat, northbound, of_type, packed, parsed, position_report, spoken
from vfguide.companion.identity import EngageRange
from vfguide.companion.role import Outgoing
from vfguide.companion.supervisor import NOTHING_HEARD, Mode
from vfguide.frames import way_m
from vfguide.link.presence import LONGEST_TEXT


def gaps_of(times: list[float]) -> list[float]:
    return [later - earlier for earlier, later in pairwise(times)]


def test_a_companion_that_may_engages_and_flies_to_its_slot():
    flown = new_flight(until_s=40.0)
    assert flown.state == (Mode.TRACKING, "GUIDED")
    assert flown.told("->") == ["waiting -> joining", "joining -> tracking"]
    assert len(flown.times(SET_MODE)) == 1
    # What does not change is repeated at least twice a second, altitudes every five seconds.
    for command in (HEADING, SPEED):
        late = flown.later(command, 20.0)
        assert max(gaps_of(late)) <= 0.5 + 1e-6
        assert len(late) < 190
        # While they change, each position leads to a course and a speed.
        early = [time for time in flown.times(command) if 1.6 <= time <= 3.5]
        assert early == pytest.approx([1.6 + 0.1 * k for k in range(20)])
    assert gaps_of(flown.times(ALTITUDE)) == pytest.approx([5.0] * 7)


def test_a_companion_that_may_not_engage_steers_once_the_pilot_selects_guided():
    flown = new_flight(engage=False, until_s=10.0)
    assert flown.mode is Mode.WAITING
    assert not any(flown.times(one) for one in (HEADING, SPEED, ALTITUDE, POSITION))
    flown.pilot("GUIDED", until_s=40.0)
    # The mode is heard with the next datagram, and one position report later setpoints go out.
    assert flown.times(HEADING)[0] == pytest.approx(10.1)
    assert flown.mode is Mode.TRACKING
    assert flown.times(SET_MODE) == []


@pytest.mark.parametrize("mode", ["LOITER", "MANUAL"])
def test_setpoints_stop_at_once_when_the_pilot_takes_over_and_it_is_not_taken_back(mode):
    flown = new_flight(until_s=10.0)
    flown.pilot(mode, until_s=30.0)
    for command in (HEADING, SPEED, ALTITUDE):
        assert flown.times(command)
        assert flown.later(command, 10.0) == []
    assert flown.times(POSITION) == []
    assert_left_alone(flown, mode, since_s=10.0)
    assert flown.mode_at(10.1) is flown.mode is Mode.PILOT


def test_setpoints_resume_when_guided_comes_back():
    flown = new_flight(until_s=12.0)
    assert flown.times(ALTITUDE)[-1] == pytest.approx(11.1)
    flown.pilot("LOITER", until_s=13.0)
    flown.pilot("GUIDED", until_s=85.0)
    # An altitude that the autopilot may have forgotten is told at once.
    assert flown.later(HEADING, 12.0)[0] == pytest.approx(13.1)
    assert flown.later(ALTITUDE, 12.0)[0] == pytest.approx(13.1)
    assert flown.mode is Mode.TRACKING
    # Taken again, it stays with the pilot again.
    flown.pilot("LOITER", until_s=95.0)
    assert flown.mode is Mode.PILOT
    assert len(flown.times(SET_MODE)) == 1


def test_the_pilot_keeps_what_he_took_while_telemetry_was_out():
    flown = new_flight(until_s=10.0)
    # Somebody switches the position stream off: nothing to steer by, still in GUIDED.
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.run(15.0, lose=frozenset({MESSAGE_INTERVAL}))
    assert flown.mode is Mode.WAITING
    flown.pilot("LOITER")
    flown.run(40.0, lose=frozenset())
    assert_left_alone(flown, "LOITER", since_s=10.0)


@pytest.mark.parametrize("heard", [[], [leader_bytes(-20.0)]])
def test_a_companion_that_hears_no_leader_or_heard_it_long_ago_does_not_engage(heard):
    flown = new_flight(link=lambda now: heard if now == 0.0 else [], until_s=20.0)
    assert flown.times(SET_MODE) == flown.told("->") == []
    assert flown.mode is Mode.WAITING


def test_engaging_is_tried_again_until_it_is_obeyed():
    flown = new_flight(lose=frozenset({SET_MODE}), until_s=10.5)
    # After 1, 2, 4, ... seconds, on the next heartbeat.
    assert flown.times(SET_MODE) == [1.0, 2.0, 4.0, 8.0]
    assert len(flown.told("although it was asked")) == 1
    flown.run(17.0, lose=frozenset())
    assert flown.times(SET_MODE)[-1] == 16.0
    assert flown.autopilot_mode == "GUIDED"


def test_the_leader_engages_steers_and_publishes_with_each_position():
    flown = new_flight("leader", link=lambda _now: [], until_s=40.0)
    assert flown.state == (Mode.TRACKING, "GUIDED")
    # Two positions in the first second, then one every 100 ms; each is published.
    assert len(flown.published) == pytest.approx(40 * 10, abs=13)
    assert len(flown.times(HEADING)) >= 40 * 2


@pytest.mark.parametrize(
    ("heard_s", "joins_s"),
    # It waits for one that is heard late, and after 8 s joins without one that is never heard.
    [({"f2": 0.0, "f3": 0.0}, 1.0), ({"f2": 0.0, "f3": 5.0}, 6.0), ({"f2": 0.0}, 9.0)],
)
def test_it_waits_for_who_is_not_heard_yet_and_not_for_ever(heard_s, joins_s):
    """Heartbeats, to which modes are commanded, come once a second."""

    def others(now: float) -> dict[str, bytes]:
        return {name: leader_bytes(now) for name, from_s in heard_s.items() if now >= from_s}

    flown = new_flight(companion=companion_of(greeting_s=8.0), neighbours=others, until_s=20.0)
    steered_s = next(time for time, mode in flown.modes if mode.steers)
    assert steered_s == pytest.approx(joins_s, abs=1.1)


def commands(data: bytes) -> set[int]:
    return {one.command for one in parsed(data) if one.get_type() == "COMMAND_INT"}


def test_setpoints_are_in_the_first_half_and_heartbeats_in_the_second():
    whole, halves = new_flight(), new_flight()
    answer, settle = halves.companion.answer, halves.companion.settle
    at_once, later = [], []

    def in_halves(data: bytes, now: float) -> Outgoing:
        out = answer(data, now)
        at_once.append(out.to_autopilot)
        settle(out, now)
        later.append(out.to_autopilot)
        out.to_autopilot = at_once[-1] + later[-1]
        return out

    halves.companion.receive_mavlink = in_halves
    whole.run(10.0)
    halves.run(10.0)
    steering = {SPEED, HEADING}
    assert any(commands(data) >= steering for data in at_once)
    assert not any(commands(data) & steering for data in later)
    assert not any(one.get_type() == "HEARTBEAT" for one in parsed(b"".join(at_once)))
    # Once a second, from 0 to 10 s.
    beats = [one for one in parsed(b"".join(later)) if one.get_type() == "HEARTBEAT"]
    assert len(beats) == 11
    # And both together are what one call says.
    assert halves.sent == whole.sent
    assert halves.events == whole.events


def test_an_airspeed_leads_to_nothing_and_the_pilots_mode_to_something():
    flown = new_flight(until_s=10.0)
    companion, now = flown.companion, flown.now + 0.01
    assert companion.snapshot.mode.steers
    airspeed = mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0)
    assert companion.answer(spoken(airspeed), now).is_empty
    out = companion.answer(spoken(heartbeat(MANUAL)), now)
    assert companion.snapshot.mode is Mode.PILOT
    assert not out.is_empty


def test_an_autopilot_that_reboots_while_it_is_steered_stays_where_it_came_up():
    # A reboot gives nobody any right: what looks like one may be injected.
    flown = new_flight(until_s=40.0)
    assert flown.mode is Mode.TRACKING
    flown.reboot()
    flown.run(50.0)
    assert_left_alone(flown, "LOITER", since_s=40.0)
    assert flown.told("rebooted") == [
        "the autopilot has rebooted: it is not engaged again by itself; select GUIDED to be steered"
    ]
    flown.pilot("GUIDED", until_s=60.0)
    assert flown.times(HEADING)[-1] > 59.5
    # What it has forgotten is told at once.
    assert flown.later(ALTITUDE, 40.0)[0] <= flown.later(HEADING, 50.0)[0] + 0.1


@pytest.mark.parametrize("mode", ["LOITER", "MANUAL"])
def test_an_autopilot_that_reboots_in_a_pilots_hands_stays_there(mode):
    flown = new_flight(until_s=20.0)
    flown.pilot(mode, until_s=30.0)
    flown.reboot()
    flown.run(50.0)
    assert_left_alone(flown, "LOITER", since_s=20.0)
    assert flown.mode is Mode.PILOT


def test_what_the_operator_did_not_allow_is_not_engaged_after_a_reboot():
    flown = new_flight(engage=False, until_s=2.0)
    flown.pilot("GUIDED", until_s=20.0)
    assert flown.mode.steers
    flown.reboot()
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    assert flown.times(HEADING)[-1] < 20.1


def test_frames_that_look_like_a_reboot_give_nobody_the_guided_mode():
    flown = new_flight(until_s=30.0)
    flown.pilot("RTL")

    def position(now: float) -> bytes:
        """Eight positions whose boot time has fallen, a second after the pilot's hand."""
        place = position_report(time_boot_ms=round((now - 30.0) * 1e3), vx=2000)
        return spoken(place) if 31.0 <= now < 31.4 else b""

    flown.run(60.0, forge=position)
    assert_left_alone(flown, "RTL", since_s=30.0)


CHANGE_SPEED, REQUEST_MESSAGE = 178, 512
GROUND_STATION, COMPANION = 6, 18
POSITION = "SET_POSITION_TARGET_GLOBAL_INT"
BY_POSITIONS = (1, 16)
"""A version that is steered in offboard."""


def test_px4_hears_setpoints_before_it_is_asked_for_offboard():
    flown = new_flight(kind="px4", version=BY_POSITIONS, until_s=40.0)
    setpoints = flown.times(POSITION)
    assert setpoints[0] < flown.times(SET_MODE)[0]
    assert flown.state == (Mode.TRACKING, "OFFBOARD")
    # A speed goes with every setpoint by which it is steered, and with no other.
    steered = [time for time in setpoints if flown.mode_at(time).steers]
    assert flown.times(CHANGE_SPEED) == steered


def test_px4_hears_setpoints_from_a_companion_that_may_not_engage_and_may_be_put_into_offboard():
    flown = new_flight(kind="px4", version=BY_POSITIONS, engage=False, until_s=10.0)
    assert flown.later(POSITION, 5.0) == [pytest.approx(5.1 + 0.1 * k) for k in range(50)]
    assert flown.times(CHANGE_SPEED) == flown.times(SET_MODE) == []
    assert flown.autopilot_mode == "LOITER"
    flown.pilot("OFFBOARD")
    assert flown.autopilot_mode == "OFFBOARD"
    flown.run(50.0)
    assert flown.state == (Mode.TRACKING, "OFFBOARD")
    assert flown.times(SET_MODE) == []


@pytest.mark.parametrize("mode", ["ALTCTL", "LOITER"])
def test_px4_that_the_pilot_took_hears_the_stream_and_nothing_that_it_would_obey(mode):
    flown = new_flight(kind="px4", version=BY_POSITIONS, until_s=10.0)
    assert flown.autopilot_mode == "OFFBOARD"
    flown.pilot(mode, until_s=20.0)
    assert flown.state == (Mode.PILOT, mode)
    stream = flown.later(POSITION, 10.0)
    assert max(gaps_of(stream)) <= 0.25 + 1e-6
    assert stream[-1] > 19.75
    assert flown.later(CHANGE_SPEED, 10.0) == flown.later(SET_MODE, 10.0) == []


@pytest.mark.parametrize("vehicle", ["f1", "leader"])
def test_the_pilot_of_px4_can_select_offboard_again(vehicle):
    flown = new_flight(vehicle, kind="px4", version=BY_POSITIONS, until_s=10.0)
    flown.pilot("LOITER", until_s=15.0)
    flown.pilot("OFFBOARD")
    assert flown.autopilot_mode == "OFFBOARD"
    flown.run(70.0)
    assert flown.state == (Mode.TRACKING, "OFFBOARD")


def test_px4_that_was_given_back_for_lack_of_a_leader_hears_no_stream():
    silent = {"link": heard_until(10.0), "patience": {"prediction_s": 2.0, "breakaway_s": 2.0}}
    flown = new_flight(kind="px4", version=BY_POSITIONS, until_s=20.0, **silent)
    assert flown.mode is Mode.LOST
    assert flown.later(POSITION, 10.0)
    assert flown.later(POSITION, 14.5) == []


def test_px4_that_has_guided_course_is_engaged_without_a_stream_once_it_has_told_its_version():
    flown = new_flight(kind="px4", until_s=60.0)
    assert flown.times(POSITION) == []
    assert flown.times(REQUEST_MESSAGE)[0] < flown.times(SET_MODE)[0]
    (text,) = flown.told("PX4 1.18")
    assert text.endswith("should it and every ground station fall silent, NAV_DLL_ACT decides")
    assert flown.state == (Mode.TRACKING, "GUIDED")
    assert flown.later(HEADING, 50.0)
    assert flown.autopilot.truth().altitude_amsl_m == pytest.approx(588.0, abs=0.5)


def test_one_whose_version_cannot_be_asked_for_is_flown_by_positions():
    flown = new_flight(kind="px4", lose=frozenset({REQUEST_MESSAGE}), until_s=60.0)
    assert flown.state == (Mode.TRACKING, "OFFBOARD")


def heartbeat_kinds(flown: Flight, from_s: float) -> set[int]:
    sent = b"".join(data for time, data in flown.sent if time > from_s)
    return {one.type for one in parsed(sent) if one.get_type() == "HEARTBEAT"}


def test_a_ground_station_beats_beside_the_companion_until_a_pilot_flies():
    flown = new_flight(kind="px4", until_s=20.0)
    assert heartbeat_kinds(flown, 10.0) == {COMPANION, GROUND_STATION}
    flown.pilot("ALTCTL", until_s=30.0)
    assert flown.mode is Mode.PILOT
    assert heartbeat_kinds(flown, 22.0) == {COMPANION}


@pytest.mark.parametrize(("kind", "version"), [("ardupilot", None), ("px4", BY_POSITIONS)])
def test_no_ground_station_beats_where_the_autopilot_has_another_fail_safe(kind, version):
    flown = new_flight(kind=kind, version=version, until_s=20.0)
    assert heartbeat_kinds(flown, 0.0) == {COMPANION}


def test_a_companion_that_dies_in_guided_course_leaves_an_aircraft_that_loiters():
    flown = new_flight(kind="px4", until_s=20.0)
    (one,) = struct.unpack("<f", struct.pack("<i", 1))
    setting = mavlink.MAVLink_param_set_message(2, 1, b"NAV_DLL_ACT", one, 6)
    flown.autopilot.receive(packed(setting))
    flown.run(40.0)
    for until_s, mode in ((40.0, "GUIDED"), (51.0, "GUIDED"), (54.0, "LOITER")):
        flown.autopilot.advance(until_s)
        assert flown.autopilot_mode == mode


def far_flight(north: float, until_s: float | None, *, leader_north: float = 0.0) -> Flight:
    """f1 so far north of the origin, and a leader that is elsewhere."""
    return new_flight(
        link=lambda now: [leader_bytes(now, north=leader_north + 20.0 * now)],
        autopilot=emulator(north=north, east=0.0),
        until_s=until_s,
    )


@pytest.mark.parametrize(("vehicle_m", "leader_m"), [(30e3, 0.0), (0.0, 30e3), (-5.2e3, 0.0)])
def test_a_slot_that_is_far_away_is_not_flown_to(vehicle_m, leader_m):
    flown = far_flight(vehicle_m, 8.0, leader_north=leader_m)
    assert flown.times(SET_MODE) == []
    (told,) = flown.told("from its slot")
    assert f"{abs(vehicle_m - leader_m) / 1e3:.1f} km from its slot"[:2] in told
    assert "engaged within 5.0 km" in told
    # A pilot's GUIDED does not make it nearer.
    flown.pilot("GUIDED", until_s=12.0)
    assert flown.times(HEADING) == []
    assert flown.mode is Mode.WAITING


def test_a_slot_within_five_kilometres_is_flown_to():
    assert far_flight(-4.8e3, 5.0).mode is Mode.JOINING


def test_it_is_taken_up_once_it_has_come_near_enough():
    flown = far_flight(-5.4e3, None)
    flown.run(4.0, link=lambda now: [leader_bytes(now, north=-20.0 * now, course=math.pi)])
    assert flown.times(SET_MODE) == []
    flown.run(30.0)
    assert flown.times(SET_MODE) != []
    assert flown.told("may be steered again") != []


def test_an_origin_with_latitude_and_longitude_exchanged_is_named():
    mission = mission_with(
        "line-calm", origin={"latitude_deg": 8.545594, "longitude_deg": 47.397742}
    )
    companion = companion_of("leader", mission=mission)
    report = position_report(time_boot_ms=1000, vx=2000)
    out = companion.receive_mavlink(packed(report, system_id=1, component_id=1), 0.1)
    (text,) = [event.text for event in out.events]
    assert text == (
        "not steered: 5,653 km from the mission's origin: exchange its latitude and longitude"
    )
    assert companion.obstacle(0.1) == text.removeprefix("not steered: ")


def test_who_has_been_there_has_another_trouble_than_the_origin():
    reach = EngageRange(plan_of())
    for latitude_deg in (47.4, 12.0):
        reach.note(replace(reported(), latitude_deg=latitude_deg))
    assert reach.objection(math.inf) is None


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0), st.floats(0.0, 2e7))
def test_whatever_is_reported_it_is_within_reach_or_told_in_few_words(
    latitude, longitude, distance
):
    reach, place = EngageRange(plan_of()), (latitude, longitude)
    reach.note(replace(reported(), latitude_deg=latitude, longitude_deg=longitude))
    found = reach.objection(distance)
    near = way_m(FRAME.origin, place) <= 200e3 or place == (0.0, 0.0)
    assert (found is None) is (near and distance <= 5000.0)
    assert found is None or len(found.text) <= LONGEST_TEXT


@pytest.mark.parametrize("kind", KINDS)
def test_an_autopilot_that_is_found_out_is_flown_like_one_that_is_named(kind):
    flown = new_flight(kind="auto", autopilot=emulator(kind, 2), until_s=60.0)
    assert flown.state == (Mode.TRACKING, "GUIDED")


@pytest.mark.parametrize(("named", "flies"), [("ardupilot", "px4"), ("px4", "ardupilot")])
def test_another_autopilot_than_the_missions_is_said_once_and_not_steered(named, flies):
    flown = new_flight(kind=named, autopilot=emulator(flies, 2), until_s=20.0)
    assert flown.told("the vehicle is") == [flown.events[0][1]]
    assert flown.times(SET_MODE) == []
    assert {mode for _, mode in flown.modes} == {Mode.WAITING}


def test_a_vehicle_that_is_not_armed_is_not_engaged():
    companion = companion_of()
    sent: dict[bool, list[int]] = {True: [], False: []}
    told = []
    for step in range(200):
        now, armed = step / 20, step >= 100
        companion.receive_link(leader_bytes(now), now)
        data = spoken(heartbeat(LOITER, armed=armed), northbound(now))
        out = companion.receive_mavlink(data, now)
        told += [event.text for event in out.events]
        sent[armed] += [getattr(one, "command", 0) for one in parsed(out.to_autopilot)]
    assert SET_MODE not in sent[False]
    assert SET_MODE in sent[True]
    assert told.count("the vehicle is not armed: engaged once it flies; arm it when ready") == 1


def inspected(values: dict[str, float]) -> tuple[list[float], list[str]]:
    """When parameters are asked for, and what is said of those with these values."""
    companion = companion_of(engage=False, inspect=True)
    asked, told, answers = [], [], list[MAVLink_message]()
    for step in range(200):
        now = step / 20
        out = companion.receive_mavlink(spoken(heartbeat(LOITER), northbound(now), *answers), now)
        told += [event.text for event in out.events if event.warning]
        requests = of_type(parsed(out.to_autopilot), "PARAM_REQUEST_READ")
        asked += [now] * bool(requests)
        names = [one.param_id for one in requests if one.param_id in values]
        answers = [parameter(name, values[name]) for name in names]
    return asked, told


def parameter(name: str, value: float) -> MAVLink_message:
    return mavlink.MAVLink_param_value_message(name.encode(), value, 9, 100, 1)


def test_what_does_not_fit_the_flight_is_told_at_the_start():
    values = {"FS_GCS_ENABL": 0.0, "AIRSPEED_MIN": 9.0, "AIRSPEED_MAX": 22.0}
    asked, told = inspected(values)
    # Names that nobody answers for are asked four times, once a second.
    assert asked in ([1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0, 3.0])
    said = [text.split(" is ")[0] for text in told if " is " in text]
    assert said == ["FS_GCS_ENABL", "AIRSPEED_MAX"]


def test_an_autopilot_that_answers_for_nothing_is_told_of_once():
    _, told = inspected({})
    assert [text for text in told if "parameters" in text] == [
        "the autopilot tells no parameters: limits and fail-safe are not checked; check them by hand"
    ]


ON_THE_GROUND = heartbeat(10, status=3, armed=False)
NO_FIX = mavlink.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 65_535, 65_535, 0, 0, 0)
NO_POSITION = mavlink.MAVLink_ekf_status_report_message(0x400, 0.0, 0.0, 0.0, 0.0, 0.0)
NOWHERE = "the autopilot's estimator has no position: wait, or see its ground station"
NO_FIX = mavlink.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 65_535, 65_535, 0, 0, 0)
NO_POSITION = mavlink.MAVLink_ekf_status_report_message(0x400, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("said", "places", "why"),
    [
        ((), True, "a position of 0, 0: see its GPS and its ground station"),
        ((NO_FIX,), True, "the GPS has no fix: wait, or see that its antenna has a clear sky"),
        ((NO_POSITION,), True, NOWHERE),
        # What the estimator says counts where it sends no position at all.
        ((NO_POSITION,), False, NOWHERE),
    ],
)
def test_before_the_first_position_is_believed_it_says_why_none_is(said, places, why):
    one = companion_of(inspect=True)
    assert one.obstacle(0.0) == NOTHING_HEARD
    for tenth in range(30):
        now = 0.1 * tenth
        place = position_report(time_boot_ms=int(now * 1e3), lat=0, lon=0, alt=488_000)
        one.receive_mavlink(spoken(ON_THE_GROUND, *said, *[place] * places), now)
    assert one.obstacle(2.9) == why
    assert len(why) <= LONGEST_TEXT
    # Nothing comes any more, and what was said is old.
    assert one.obstacle(20.0) == NOTHING_HEARD


def test_a_parameter_that_speaks_against_taking_off_is_found_until_it_is_mended():
    flown = new_flight(companion=companion_of(inspect=True), until_s=1.0)
    assert flown.companion.findings == []
    flown.run(10.0)
    # The emulated one has ArduPlane's own defaults.
    (first,) = flown.companion.findings
    assert first.startswith("FS_GCS_ENABL is 0: should this companion fall silent")
    mended = {"FS_GCS_ENABL": 1.0, "MAV_GCS_SYSID": 2.0, "FS_LONG_ACTN": 1.0}
    said = spoken(*(parameter(name, value) for name, value in mended.items()))
    flown.companion.receive_mavlink(said, 10.1)
    assert flown.companion.findings == []
