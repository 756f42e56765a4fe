"""What speaks against steering: two of one name, another controller, no fixed wing, refusals."""

import math
from itertools import product
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import (
    ALTITUDE,
    HEADING,
    KINDS,
    LOITER,
    SET_MODE,
    SPEED,
    Flight,
    emulator,
    new_flight,
)
from tests.kit.missions import shipped
from tests.kit.wire import command_long, heartbeat, northbound, packed, spoken
from vfguide.companion.core import Companion
from vfguide.companion.housekeeping import Obedience
from vfguide.companion.identity import VehicleIdentity
from vfguide.companion.mission_plan import adapter_of
from vfguide.companion.supervisor import Mode
from vfguide.link.presence import LONGEST_TEXT
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.framing import frames_of
from vfguide.mavlink.reports import CommandReport, HeartbeatReport, PositionReport


def behind_one_router(begin_s: float, end_s: float = math.inf, **second: object) -> Flight:
    """Make a flight in which a second autopilot is heard for a while, and obeys what the first is told."""
    flown, other = new_flight(autopilot=emulator(uid=7)), emulator(**second)
    advance, receive = flown.autopilot.advance, flown.autopilot.receive

    def both(first: bytes, second: bytes) -> bytes:
        return first + (second if begin_s <= flown.now < end_s else b"")

    flown.autopilot.advance = lambda now: both(advance(now), other.advance(now))
    flown.autopilot.receive = lambda data: both(receive(data), other.receive(data))
    return flown


def conflict(flown: Flight) -> tuple[float, str]:
    return next((when, text) for when, text in flown.texts() if "not steered" in text)


@pytest.mark.parametrize(
    "second",
    [
        {"boot_time_s": 912.0},
        # Switched on together, and 200 m away; one that stands on the ground and sends little.
        {"boot_time_s": 0.0, "uid": 8, "latitude_deg": 47.3998},
        {"streams": (), "airborne": False, "armed": False, "altitude_amsl_m": 488.0},
    ],
)
def test_a_second_aircraft_of_its_name_ends_steering_within_three_seconds(second):
    flown = behind_one_router(10.0, **second)
    flown.run(18.0)
    when, text = conflict(flown)
    assert when <= 13.0 + 0.2
    assert "two aircraft speak as system 2: switch one off, or set its SYSID_THISMAV" in text
    assert flown.later(HEADING, 13.2) == []
    assert flown.companion.obstacle(18.0) is not None


def test_two_of_one_name_from_the_start_are_never_steered_until_one_is_switched_off():
    flown = behind_one_router(0.0, 12.0, boot_time_s=40.0)
    flown.run(12.0)
    assert flown.times(SET_MODE) == flown.times(HEADING) == []
    assert conflict(flown)[0] <= 3.0
    assert "two aircraft" in str(flown.companion.obstacle(12.0))
    flown.run(24.0)
    assert flown.companion.objection(24.0) is None
    assert flown.mode.steers


def test_one_aircraft_heard_twice_or_with_gaps_is_one():
    flown = new_flight()
    lost = [0]

    def bent(said: bytes) -> bytes:
        """Each frame twice, a third of them never."""
        out = b""
        for frame in frames_of(said):
            lost[0] += 1
            out += b"" if lost[0] % 3 == 0 else 2 * frame.content
        return out

    for step in range(120):
        flown.waiting = bent(flown.waiting)
        flown.run(0.1 * step)
    assert flown.companion.objection(12.0) is None


def test_one_aircraft_over_two_links_has_two_series_of_numbers_and_one_clock():
    first, second = mavlink.MAVLink(None, 2, 1), mavlink.MAVLink(None, 2, 1)
    second.seq = 100
    codec, identity, series = Codec(2, 1), VehicleIdentity(2), set[int]()
    for step in range(60):
        now = 0.1 * step
        said = [heartbeat(LOITER)] * (step % 10 == 0) + [northbound(now)]
        for link, one in product((first, second), said):
            for report in codec.decode(bytes(one.pack(link))):
                if isinstance(report, HeartbeatReport):
                    identity.note_heartbeat(report, now)
                    series.add(report.series)
                else:
                    assert isinstance(report, PositionReport)
                    identity.note_position(report, now)
            link.seq = (link.seq + 1) % 256
    assert len(series) == 2
    assert identity.objection(6.0) is None


def test_the_second_link_is_remembered_through_bursts_of_lost_frames():
    """Each of four bursts begins a series of its own; the two links are the oldest and heard on."""
    identity = VehicleIdentity(2)
    for step in range(400):
        now, link = 0.1 * step, step % 2
        burst = 2 + step // 40 if step < 160 and step % 40 == 20 else link
        place = {"latitude_deg": 47.4, "longitude_deg": 8.5, "altitude_amsl": 588.0}
        still = {"velocity_north": 0.0, "velocity_east": 0.0, "heading": 0.0, "climb_rate": 0.0}
        position = PositionReport(boot_time_s=now, series=burst, **place, **still)
        identity.note_position(position, now)
        beat = {"autopilot": 3, "custom_mode": 0, "armed": True, "vehicle_type": 1, "status": 4}
        identity.note_heartbeat(HeartbeatReport(series=link, **beat), now)
        assert identity.objection(now) is None


def heading_of(**target: int) -> MAVLink_message:
    to = {"target_system": 2, "target_component": 1} | target
    numbers = (0, HEADING, 0, 0, 0.0, 90.0, 9.8, 0.0, 0, 0, 0.0)
    return mavlink.MAVLink_command_int_message(*to.values(), *numbers)


TARGET = mavlink.MAVLink_set_position_target_global_int_message(
    0, 2, 1, 6, 0xDF8, 473_977_420, 85_455_940, 100.0, 0, 0, 0, 0, 0, 0, 0, 0
)


@pytest.mark.parametrize(
    ("message", "sender"),
    [
        (heading_of(), (2, 191)),
        (heading_of(target_component=0), (255, 190)),
        (TARGET, (2, 195)),
        (command_long(192, -1, 1, 0, 0, 47.4, 8.5, 100, system_id=2), (255, 190)),
        # The router keeps the command itself from this companion, and not the answer.
        (mavlink.MAVLink_command_ack_message(HEADING, 0, 0, 0, 255, 190), (2, 1)),
    ],
)
def test_another_controller_is_named_and_not_steered_against(message, sender):
    data = packed(message, system_id=sender[0], component_id=sender[1])
    flown = new_flight(forge=lambda now: data if now > 10.0 else b"", until_s=15.0)
    when, text = conflict(flown)
    assert when <= 13.0
    who = (255, 190) if sender == (2, 1) else sender
    assert f"component {who[1]} of system {who[0]} steers this vehicle, too: stop it" in text
    assert flown.later(HEADING, 10.3) == flown.later(SET_MODE, 10.0) == []
    # Its last command was 10 s ago: the pilot has left it in GUIDED.
    flown.run(27.0, forge=lambda _: b"")
    assert flown.mode.steers


@pytest.mark.parametrize(
    "message",
    [
        heading_of(target_system=3),
        command_long(SET_MODE, 1, 15, system_id=2),
        command_long(512, 148, system_id=2),
        mavlink.MAVLink_mission_item_int_message(2, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_manual_control_message(2, 0, 0, 500, 0, 0),
    ],
)
def test_what_steers_nothing_or_somebody_else_is_no_controller(message):
    flown = new_flight(forge=lambda _: packed(message), until_s=8.0)
    assert flown.companion.objection(8.0) is None


def test_its_own_setpoints_that_a_router_sends_back_are_no_other_controller():
    flown = new_flight()
    flown.run(12.0, forge=lambda _: flown.sent[-1][1] if flown.sent else b"")
    assert flown.mode.steers


def test_one_command_of_a_ground_station_in_a_loiter_is_its_pilots():
    once = [packed(command_long(186, 120.0, 3, system_id=2))]
    flown = new_flight(engage=False)
    flown.run(8.0, forge=lambda now: once.pop() if once and now > 5.0 else b"")
    assert flown.companion.objection(8.0) is None


def test_a_copter_whose_autotune_has_the_number_of_guided_is_not_steered():
    flown = new_flight(autopilot=emulator(vehicle_type=2))
    flown.pilot("GUIDED", until_s=8.0)
    assert flown.times(SET_MODE) == flown.times(HEADING) == []
    assert flown.mode is Mode.WAITING
    text = str(flown.companion.obstacle(8.0))
    assert text == "the vehicle is no fixed wing (MAV_TYPE 2, QUADROTOR): see --mavlink"
    assert len(text) <= LONGEST_TEXT


@pytest.mark.parametrize("kind", [1, 19, 22, 25])
def test_whatever_flies_on_wings_is_steered(kind):
    assert new_flight(autopilot=emulator(vehicle_type=kind), until_s=5.0).mode.steers


STEERING = frozenset({HEADING, SPEED, ALTITUDE})
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4


def reason(companion: Companion, now: float = 15.0) -> str | None:
    found = companion.objection(now)
    return None if found is None else found.text


def flown_by(
    result: int, *, commands: frozenset[int] = STEERING, until_s: float = 15.0, **options: Any
) -> Flight:
    return new_flight(**options, answers=dict.fromkeys(commands, result), until_s=until_s)


@pytest.mark.parametrize(
    ("kind", "commands", "refused"),
    [
        ("ardupilot", STEERING, ""),
        ("ardupilot", frozenset({HEADING}), " GUIDED_CHANGE_HEADING (UNSUPPORTED)"),
        ("ardupilot", frozenset({SPEED}), " GUIDED_CHANGE_SPEED (UNSUPPORTED)"),
        ("px4", frozenset({HEADING}), " GUIDED_CHANGE_HEADING (UNSUPPORTED)"),
    ],
)
def test_an_autopilot_without_a_steering_command_is_handed_back_at_once(kind, commands, refused):
    flown = flown_by(UNSUPPORTED, commands=commands, kind=kind)
    engaged = flown.times(SET_MODE)[0]
    words = f"not steered: the autopilot refuses{refused}"
    told = next(time for time, text in flown.texts() if words in text)
    assert told <= engaged + 3.0
    assert flown.autopilot_mode == "LOITER"
    assert len(flown.times(SET_MODE)) == 2
    # Nothing is asked of it again, however long it flies.
    assert flown.later(HEADING, engaged + 3.0) == []
    assert flown.companion.obstacle(15.0) == reason(flown.companion)


@pytest.mark.parametrize("result", [DENIED, FAILED])
def test_an_autopilot_that_refuses_courses_in_its_guided_mode_is_handed_back(result):
    flown = flown_by(result)
    assert flown.autopilot_mode == "LOITER"
    assert flown.told("refuses GUIDED_CHANGE_")
    # Whoever selects GUIDED again lets it try again.
    assert reason(flown.companion) is None


@pytest.mark.parametrize("kind", KINDS)
def test_an_autopilot_that_accepts_courses_and_flies_none_is_told_of_and_handed_back(kind):
    flown = flown_by(ACCEPTED, until_s=25.0, kind=kind)
    engaged = flown.times(SET_MODE)[0]
    (complained,) = [time for time, text in flown.events if "follow the setpoints: asked" in text]
    assert complained <= engaged + (8.0 if kind == "ardupilot" else 8.2)
    (gave_up,) = [time for time, text in flown.events if "flies none: handed back" in text]
    assert gave_up <= complained + 6.0
    assert flown.autopilot_mode == "LOITER"


def on_the_ground(answers: dict[int, int]) -> Flight:
    """A companion whose vehicle stands disarmed for 10 s."""
    stands = {"altitude_amsl_m": 488.0, "airborne": False, "armed": False}
    autopilot = emulator(north=0.0, east=0.0, **stands)
    return new_flight(link=lambda _: [], autopilot=autopilot, answers=answers, until_s=10.0)


def test_on_the_ground_a_firmware_without_guided_commands_is_no_go():
    flown = on_the_ground(dict.fromkeys(STEERING, UNSUPPORTED))
    objection = reason(flown.companion)
    assert flown.companion.obstacle(10.0) == objection
    assert objection == (
        "the autopilot refuses GUIDED_CHANGE_HEADING (UNSUPPORTED): use firmware built with guided commands"
    )
    assert len(objection) <= LONGEST_TEXT
    assert flown.told("refuses") == [f"not steered: {objection}"]


def test_on_the_ground_a_usual_firmware_is_asked_once_and_nobody_hears_of_it():
    flown = on_the_ground({})
    assert reason(flown.companion) is None
    assert flown.told("GUIDED_CHANGE") == []


def test_after_a_reboot_it_is_asked_anew():
    flown = flown_by(UNSUPPORTED, until_s=8.0)
    assert reason(flown.companion) is not None
    flown.reboot()
    flown.run(12.0, answers={})
    assert reason(flown.companion) is None


def test_a_single_answer_in_anothers_name_ends_nothing():
    flown = new_flight(until_s=10.0)
    stray = spoken(mavlink.MAVLink_command_ack_message(HEADING, UNSUPPORTED))
    flown.companion.receive_mavlink(stray, 10.05)
    flown.run(15.0)
    assert flown.mode.steers


ANSWER = st.tuples(st.integers(0, 65_535), st.integers(0, 255), st.floats(0.0, 3.0), st.booleans())


@given(st.lists(ANSWER, max_size=40))
def test_answers_of_other_commands_never_speak_against_it(answers):
    obedience = Obedience(adapter_of(shipped("line-calm").vehicles["f1"]))
    now = 0.0
    for command, result, passed, guided in answers:
        now += passed
        if command not in STEERING:
            obedience.hear(CommandReport(command=command, result=result), now, guided=guided)
    assert obedience.refusal is None
