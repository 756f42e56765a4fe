"""The companion's own connection: a ground station on it, by a router, and signatures."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, CalmWind, Signing
from tests.kit.companion import KINDS, MANUAL, Flight, companion_of, emulator, new_flight
from tests.kit.wire import command_long, heartbeat, packed, parsed
from vfguide.companion.supervisor import Mode
from vfguide.mavlink.framing import ConnectionSigning

REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, GET_MESSAGE_INTERVAL = 512, 511, 510


class QGroundControl:
    """What QGroundControl sends to a vehicle, in its order; everything it hears comes by the same router."""

    def __init__(self, flown: Flight, system_id: int) -> None:
        self._flown = flown
        self._vehicle = system_id

    def send(self, message: MAVLink_message) -> list[MAVLink_message]:
        """Send a message; what the autopilot answers at once reaches the companion, too."""
        answer = self._flown.autopilot.receive(packed(message))
        self._flown.waiting += answer
        return parsed(answer)

    def command(self, number: int, *parameters: float) -> list[MAVLink_message]:
        return self.send(command_long(number, *parameters, system_id=self._vehicle))

    def start(self) -> dict[str, list[MAVLink_message]]:
        """Connect to the vehicle; the answers by what was asked."""
        to = (self._vehicle, 1)
        return {
            "heartbeat": self.send(mavlink.MAVLink_heartbeat_message(6, 8, 192, 0, 4, 3)),
            "version": self.command(REQUEST_MESSAGE, 148),
            "protocol": self.command(REQUEST_MESSAGE, 300),
            "parameters": self.send(mavlink.MAVLink_param_request_list_message(*to)),
            # Older versions ask ArduPilot for streams, others for messages one by one.
            "streams": self.send(mavlink.MAVLink_request_data_stream_message(*to, 0, 4, 1)),
            "interval": self.command(SET_MESSAGE_INTERVAL, 33, 250_000),
            "mission": self.send(mavlink.MAVLink_mission_request_list_message(*to, 0)),
        }


def kinds(messages: list[MAVLink_message]) -> set[str]:
    return {message.get_type() for message in messages}


def interval_us(station: QGroundControl, message_id: int) -> int:
    answers = station.command(GET_MESSAGE_INTERVAL, message_id)
    return next(one.interval_us for one in answers if one.get_type() == "MESSAGE_INTERVAL")


@pytest.mark.parametrize("kind", KINDS)
def test_qgroundcontrol_gets_its_answers_and_the_companion_its_rate_back(kind):
    flown = new_flight(kind=kind, until_s=20.0)
    assert flown.companion.snapshot.mode.steers
    station = QGroundControl(flown, system_id=2)
    before_us = interval_us(station, 33)
    answers = station.start()
    assert "AUTOPILOT_VERSION" in kinds(answers["version"])
    assert {"COMMAND_ACK"} <= kinds(answers["interval"])
    assert "MISSION_COUNT" in kinds(answers["mission"])
    for one in answers["mission"]:
        assert (one.target_system, one.target_component) == (255, 190)
    # It has slowed the position down for everybody on this connection: the companion asks again.
    assert interval_us(station, 33) > before_us
    flown.run(24.0)
    assert interval_us(station, 33) == before_us
    flown.run(60.0)
    steered = [mode for time, mode in flown.modes if time > 20.0]
    assert all(mode.steers for mode in steered)


def test_answers_to_the_ground_station_are_none_to_the_companion():
    flown = new_flight(until_s=20.0)
    station = QGroundControl(flown, system_id=2)
    said = len(flown.events)
    # Refused: an airspeed beyond its range, a mode that it does not have.
    for _ in range(3):
        station.command(43_000, 0, 80, 0)
        station.command(176, 1, 99)
        flown.run(flown.now + 1.0)
    texts = [text for _, text in flown.events[said:]]
    assert not [text for text in texts if "43000" in text or "CHANGE_SPEED" in text], texts
    assert flown.companion.snapshot.mode.steers


def test_it_hears_what_the_companion_says_to_it():
    flown = new_flight(until_s=10.0)
    heard = parsed(b"".join(data for _, data in flown.sent))
    to_all = [one for one in heard if one.get_type() in {"STATUSTEXT", "NAMED_VALUE_FLOAT"}]
    assert kinds(to_all) == {"STATUSTEXT", "NAMED_VALUE_FLOAT"}
    # Of the vehicle's own system, by its computer on board: routers pass that on to everybody.
    assert {(one.get_srcSystem(), one.get_srcComponent()) for one in to_all} == {(2, 191)}


KEY = bytes(range(32))
NOW_S = 1_800_000_000.0
STEP_S = 0.05


class Pair:
    """A leader's companion and its autopilot on a connection that the autopilot has signed."""

    def __init__(self, key: bytes | None) -> None:
        self.now = 0.0
        config = emulator(system_id=1, north=0.0, east=0.0).config
        signed = Signing(KEY)
        self.autopilot = Autopilot(
            config, CalmWind(), signing=signed, unix_time=lambda: NOW_S + self.now
        )
        signing = None if key is None else ConnectionSigning(key, lambda: NOW_S + self.now)
        self.companion = companion_of("leader", signing=signing)

    def fly(self, seconds: float, also: bytes = b"") -> None:
        replies = b""
        for _ in range(round(seconds / STEP_S)):
            telemetry = replies + self.autopilot.advance(self.now)
            out = self.companion.receive_mavlink(telemetry + also, self.now)
            replies = self.autopilot.receive(out.to_autopilot)
            self.now += STEP_S


def test_with_the_key_the_companion_is_obeyed_and_a_forged_heartbeat_takes_nothing_from_it():
    pair = Pair(KEY)
    pair.fly(30.0)
    assert pair.autopilot.truth().mode == "GUIDED"
    assert pair.companion.snapshot.mode is Mode.TRACKING
    assert pair.autopilot.counters["not signed"] == 0
    pair.fly(5.0, packed(heartbeat(MANUAL), system_id=1, component_id=1))
    assert pair.companion.snapshot.mode is Mode.TRACKING


def test_without_it_nothing_that_is_said_is_obeyed():
    pair = Pair(None)
    pair.fly(5.0)
    assert pair.autopilot.truth().mode == "LOITER"
    assert pair.autopilot.counters["not signed"] > 0
