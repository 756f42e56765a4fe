"""A real PX4 behaves as the lists say, by which the emulator is tested, too."""

import math
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.autopilots.conftest import program
from tests.autopilots.px4_manners import (
    BEHAVIOURS,
    CAPABILITIES,
    LOITER,
    MANNERS,
    PARAMETERS,
    VERSION,
    whole_as_real,
)
from tests.autopilots.simulators import CLIMB_S, Conditions, Place, Px4, free_instances
from vfguide.mavlink.framing import frames_of

HEIGHT_M, PATIENCE_S = 60.0, 20.0

LISTENS_S = 4.0
"""To a link for companions that was asked for nothing."""


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


class RealPx4:
    """One PX4 in the air, as `px4_manners` asks for it."""

    def __init__(self, simulator: Px4, link: CompanionLink) -> None:
        """Take an aircraft that flies, and the link to its companion."""
        self.station = simulator.station
        self._link = link

    @property
    def system_id(self) -> int:
        return self.station.system_id

    def result(self, command: int, *parameters: float) -> int:
        station = self.station
        station.command(command, *parameters)
        station.wait(lambda: command in station.results, f"no answer to {command}", PATIENCE_S)
        return station.results[command]

    def send(self, message: MAVLink_message) -> None:
        self.station.send(message)

    def pass_time(self, seconds: float) -> None:
        time.sleep(seconds)

    def course_deg(self) -> float:
        fix = self.station.fixes[-1]
        return math.degrees(math.atan2(fix.east_m_s, fix.north_m_s))

    def mode(self) -> tuple[int, int]:
        custom_mode = self.station.mode or 0
        return custom_mode >> 16 & 0xFF, custom_mode >> 24

    def texts(self) -> list[str]:
        return self._link.texts

    def parameter(self, name: str) -> float | None:
        station = self.station
        station.wait(
            lambda: name in station.parameters or name in station.unknown_parameters,
            name,
            PATIENCE_S,
            lambda: station.ask_for_parameter(name),
        )
        return station.parameters.get(name)

    def unasked_hz(self) -> Mapping[str, float]:
        before = self._link.heard.copy()
        time.sleep(LISTENS_S)
        heard = self._link.heard - before
        return {
            name: heard[number] / LISTENS_S
            for number, name in ((one, kind.msgname) for one, kind in mavlink.mavlink_map.items())
        }


@pytest.fixture(scope="module")
def px4(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealPx4]:
    """One PX4 that loiters, as it comes."""
    instance = free_instances(Px4, 1)
    simulator = Px4(
        program("px4"),
        tmp_path_factory.mktemp("px4"),
        name="px4",
        system_id=instance + 1,
        instance=instance,
        place=Place(latitude_deg=47.397742, longitude_deg=8.545594, altitude_amsl_m=0.0),
        height_m=HEIGHT_M,
        conditions=Conditions(factory=True),
    )
    link = CompanionLink(14_540 + instance)
    simulator.program.start()
    try:
        station = simulator.station
        simulator.take_off()
        station.wait(lambda: station.altitude_amsl_m > 0.8 * HEIGHT_M, "not up", CLIMB_S)
        simulator.enter("LOITER")
        yield RealPx4(simulator, link)
    finally:
        simulator.close()
        link.close()


def test_a_real_px4_behaves_as_is_emulated(px4: RealPx4) -> None:
    seen = {behaviour.what: behaviour.seen(px4) for behaviour in BEHAVIOURS}
    assert seen == {behaviour.what: behaviour.expected for behaviour in BEHAVIOURS}


def test_a_real_px4_answers_as_is_emulated(px4: RealPx4) -> None:
    px4.result(*LOITER)
    answered = {one.what: px4.result(one.command, *one.parameters) for one in MANNERS}
    assert answered == {one.what: one.result for one in MANNERS}


def test_a_real_px4_is_the_version_that_is_emulated(px4: RealPx4) -> None:
    station = px4.station
    station.wait(lambda: station.version, "no version", PATIENCE_S, station.ask_for_version)
    assert station.version == (VERSION, CAPABILITIES)


def test_a_real_px4_comes_with_the_parameters_that_are_emulated(px4: RealPx4) -> None:
    # COM_OBL_RC_ACT was last set to what it comes with.
    found = {name: px4.parameter(name) for name in PARAMETERS}
    assert found == {
        name: pytest.approx(whole_as_real(value)) for name, value in PARAMETERS.items()
    }
