"""Two that speak in one name, another controller, and vehicles that are no fixed wing: none is steered."""

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot
from tests.kit.companion import HEADING, LOITER, SET_MODE, Flight, emulator, new_flight
from tests.kit.wire import command_long, heartbeat, northbound, packed
from vfguide.companion.identity import VehicleIdentity
from vfguide.companion.supervisor import Mode
from vfguide.link.presence import LONGEST_TEXT
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.framing import frames_of
from vfguide.mavlink.reports import HeartbeatReport, PositionReport


@dataclass(slots=True)
class Router:
    """What two autopilots say comes together, and what is said to one reaches both."""

    autopilots: list[Autopilot]
    joins_s: float = 0.0
    """When the second begins to be heard."""
    now: float = 0.0
    sent: list[bytes] = field(default_factory=list)

    def advance(self, now: float) -> bytes:
        self.now = now
        said = [one.advance(now) for one in self.autopilots]
        return b"".join(said[: 1 + (now >= self.joins_s)])

    def receive(self, data: bytes) -> bytes:
        said = [one.receive(data) for one in self.autopilots]
        return b"".join(said[: 1 + (self.now >= self.joins_s)])

    def __getattr__(self, name: str) -> Callable[..., object]:
        return getattr(self.autopilots[0], name)


def behind_one_router(joins_s: float, **second: object) -> Flight:
    flown = new_flight()
    flown.autopilot = Router([emulator(uid=7), emulator(**second)], joins_s)  # type: ignore[assignment]
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
    flown = behind_one_router(0.0, boot_time_s=40.0)
    flown.run(12.0)
    assert flown.times(SET_MODE) == flown.times(HEADING) == []
    assert conflict(flown)[0] <= 3.0
    assert "two aircraft" in str(flown.companion.obstacle(12.0))
    flown.autopilot.autopilots.pop()  # type: ignore[attr-defined]
    flown.run(24.0)
    assert flown.companion.objection(24.0) is None
    assert flown.mode_at(24.0).steers


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
        for link in (first, second):
            said = [heartbeat(LOITER)] if step % 10 == 0 else []
            message = northbound(now)
            for one in (*said, message):
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
    flown = new_flight()
    flown.forge = lambda now: (
        packed(message, system_id=sender[0], component_id=sender[1]) if now > 10.0 else b""
    )
    flown.run(15.0)
    when, text = conflict(flown)
    assert when <= 13.0
    who = (255, 190) if sender == (2, 1) else sender
    assert f"component {who[1]} of system {who[0]} steers this vehicle, too: stop it" in text
    assert flown.later(HEADING, 10.3) == flown.later(SET_MODE, 10.0) == []
    # Its last command was 10 s ago: the pilot has left it in GUIDED.
    flown.forge = lambda _: b""
    flown.run(27.0)
    assert flown.mode_at(27.0).steers


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
    flown.forge = lambda _: flown.sent[-1][1] if flown.sent else b""
    flown.run(12.0)
    assert flown.mode_at(12.0).steers


def test_one_command_of_a_ground_station_in_a_loiter_is_its_pilots():
    flown = new_flight(engage=False)
    once = [packed(command_long(186, 120.0, 3, system_id=2))]
    flown.forge = lambda now: once.pop() if once and now > 5.0 else b""
    flown.run(8.0)
    assert flown.companion.objection(8.0) is None


def test_a_copter_whose_autotune_has_the_number_of_guided_is_not_steered():
    flown = new_flight()
    flown.autopilot = emulator(vehicle_type=2)
    flown.pilot("GUIDED", until_s=8.0)
    assert flown.times(SET_MODE) == flown.times(HEADING) == []
    assert flown.mode_at(8.0) is Mode.WAITING
    text = str(flown.companion.obstacle(8.0))
    assert text == "the vehicle is no fixed wing (MAV_TYPE 2, QUADROTOR): see --mavlink"
    assert len(text) <= LONGEST_TEXT


@pytest.mark.parametrize("kind", [1, 19, 22, 25])
def test_whatever_flies_on_wings_is_steered(kind):
    flown = new_flight(autopilot=emulator(vehicle_type=kind), until_s=5.0)
    assert flown.mode_at(5.0).steers
