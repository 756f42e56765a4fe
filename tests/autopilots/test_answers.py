"""Real autopilots answer and behave as was recorded, by which the emulator is tested, too."""

import math
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.autopilots.answers import Answers
from tests.autopilots.conftest import program
from tests.autopilots.programs import FlightError
from tests.autopilots.simulators import (
    CLIMB_S,
    PROGRAMS,
    Aircraft,
    Conditions,
    Simulator,
    free_instances,
)
from tests.kit.wire import result_name
from vfguide.mavlink.framing import frames_of

HEIGHT_M, PATIENCE_S = 60.0, 20.0

LISTENS_S = 4.0
"""To a link for companions that was asked for nothing."""

PLACES = {"px4": (47.397742, 8.545594, 0.0), "arduplane": (-35.363261, 149.16523, 584.0)}
"""Latitude and longitude in degrees, and the ground's altitude, m."""


class CompanionLink:
    """The port to which a PX4 sends for companions: what it says there unasked, and its texts."""

    def __init__(self, port: int) -> None:
        """Listen, and be there as a companion is: with a heartbeat a second."""
        self.heard: Counter[int] = Counter()
        """How many of each message came, by number."""
        self.texts: list[str] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.5)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._ends.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        writer = mavlink.MAVLink(None, srcSystem=200, srcComponent=191)
        present = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
        sent_s = -math.inf
        while not self._ends.is_set():
            try:
                datagram, peer = self._socket.recvfrom(65_536)
            except TimeoutError:
                continue
            if time.monotonic() - sent_s > 1.0:
                sent_s = time.monotonic()
                self._socket.sendto(present.pack(writer), peer)
            for frame in filter(None, frames_of(datagram)):
                self.heard[frame.message_id] += 1
                if frame.message_id == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
                    self.texts.append(frame.content.decode("ascii", "replace"))


class RealAutopilot:
    """One autopilot in the air, as the recorded answers are asked of it."""

    def __init__(self, name: str, simulator: Simulator, link: CompanionLink | None) -> None:
        """Take an aircraft that flies, and the link to its companion, if it has one of its own."""
        self.name = name
        self._station = simulator.station
        self._link = link

    @property
    def system_id(self) -> int:
        return self._station.system_id

    def answer(self, message: MAVLink_message) -> str:
        station, command = self._station, message.command
        station.results.pop(command, None)
        station.send(message)
        station.wait(lambda: command in station.results, f"no answer to {command}", PATIENCE_S)
        return result_name(station.results[command])

    def send(self, message: MAVLink_message) -> None:
        self._station.send(message)

    def pass_time(self, seconds: float) -> None:
        time.sleep(seconds)

    def course_deg(self) -> float:
        fix = self._station.fixes[-1]
        return math.degrees(math.atan2(fix.east_m_s, fix.north_m_s))

    def airspeed_m_s(self) -> float:
        return float(self._station.newest["VFR_HUD"].airspeed)

    def custom_mode(self) -> int:
        return self._station.mode or 0

    def texts(self) -> Sequence[str]:
        if self._link is not None:
            return self._link.texts
        return [text for _, text in self._station.texts]

    def parameter(self, name: str) -> tuple[float, int] | None:
        station = self._station
        asked = mavlink.MAVLink_param_request_read_message(self.system_id, 1, name.encode(), -1)
        try:
            station.wait(
                lambda: name in station.parameters or name in station.unknown_parameters,
                name,
                PATIENCE_S,
                lambda: station.send(asked),
            )
        except FlightError:
            # ArduPlane keeps silent of one that it does not have.
            return None
        if name in station.unknown_parameters:
            return None
        told = station.parameters[name]
        return told.param_value, told.param_type

    def version(self) -> tuple[int, int]:
        station, kind = self._station, "AUTOPILOT_VERSION"
        request, wanted = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        station.wait(
            lambda: kind in station.newest,
            "no version",
            PATIENCE_S,
            lambda: station.command(request, wanted),
        )
        return station.newest[kind].flight_sw_version, station.newest[kind].capabilities

    def rates_hz(self) -> Mapping[str, float]:
        assert self._link is not None
        before = self._link.heard.copy()
        time.sleep(LISTENS_S)
        heard = self._link.heard - before
        return {
            name: heard[number] / LISTENS_S
            for number, name in ((one, kind.msgname) for one, kind in mavlink.mavlink_map.items())
        }


def started(name: str, binary: Path, directory: Path) -> tuple[Simulator, CompanionLink | None]:
    """(a simulator that is about to start, with the parameters that it brings, its companions' link)."""
    kind = PROGRAMS[name]
    instance = free_instances(kind, 1)
    latitude_deg, longitude_deg, ground_m = PLACES[name]
    aircraft = Aircraft(
        name=name,
        system_id=instance + 1,
        instance=instance,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_amsl_m=ground_m,
        height_m=HEIGHT_M,
    )
    simulator = kind(binary, directory, aircraft, Conditions(factory=True))
    link = CompanionLink(14_540 + instance) if name == "px4" else None
    return simulator, link


@pytest.fixture(scope="module", params=PLACES)
def autopilot(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RealAutopilot]:
    """One that loiters, as it comes."""
    name: str = request.param
    simulator, link = started(name, program(name), tmp_path_factory.mktemp(name))
    simulator.program.start()
    try:
        station = simulator.station
        simulator.take_off()
        up_m = PLACES[name][2] + 0.8 * HEIGHT_M
        station.wait(lambda: station.altitude_amsl_m > up_m, "not up", CLIMB_S)
        simulator.enter("LOITER")
        yield RealAutopilot(name, simulator, link)
    finally:
        simulator.close()
        if link is not None:
            link.close()


def test_a_real_autopilot_answers_and_behaves_as_recorded(autopilot: RealAutopilot) -> None:
    assert Answers(autopilot.name).asked_of(autopilot) == []


def test_a_real_autopilot_is_the_version_of_which_it_was_recorded(autopilot: RealAutopilot) -> None:
    recorded = Answers(autopilot.name).version
    if recorded is None:
        pytest.skip("of this autopilot's version nothing is recorded")
    assert autopilot.version() == recorded


def test_a_real_autopilot_comes_with_the_recorded_parameters(autopilot: RealAutopilot) -> None:
    # What the cases have set they have set back.
    assert Answers(autopilot.name).parameters_of(autopilot) == []
