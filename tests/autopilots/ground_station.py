"""A ground station for one simulated aircraft: the pilot's hand, and the recorder of where it truly is."""

import math
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.autopilots.programs import FlightError
from tests.kit.wire import command_long
from vfguide.companion.clock import Clock
from vfguide.elementwise import FloatArray
from vfguide.mavlink.framing import HEADER_2, Frame, end_of_frame, frame_at, next_magic

HEARTBEAT_S = 1.0
ASK_AGAIN_S = 1.0


def message_ids(*names: str) -> frozenset[int]:
    """Numbers of messages by their names."""
    return frozenset(getattr(mavlink, f"MAVLINK_MSG_ID_{name}") for name in names)


WANTED = message_ids(
    *("HEARTBEAT", "SYSTEM_TIME", "PARAM_VALUE", "PARAM_ERROR", "COMMAND_ACK", "SIM_STATE"),
    *("HIL_STATE_QUATERNION", "STATUSTEXT", "VFR_HUD", "AUTOPILOT_VERSION"),
)
"""Most of what an autopilot tells a ground station is not looked at: it would take a third of a core."""


@dataclass(frozen=True, slots=True)
class Fix:
    """Where the simulator says that its aircraft is."""

    arrival_s: float
    """When the report came, s of the flight's clock."""
    clock_s: float
    """The simulator's clock in the report of it just before, s."""
    clock_arrival_s: float
    """When that came, s of the flight's clock."""
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    north_m_s: float
    east_m_s: float
    bank_rad: float


@dataclass(frozen=True, slots=True)
class ModeChange:
    """The autopilot has changed its mode."""

    time_s: float
    """s of the flight's clock."""
    custom_mode: int


class Caller:
    """Speaks with one aircraft from a thread of its own, until it is closed, and keeps what it says."""

    HEARTBEAT: MAVLink_message

    def __init__(self, system_id: int, connected: socket.socket) -> None:
        """Begin to listen at a connected socket."""
        self.system_id = system_id
        self.results: dict[int, int] = {}
        """Of commands, by number."""
        self.texts: list[tuple[int, str]] = []
        """Component and text of each STATUSTEXT."""
        self.parameters: dict[str, MAVLink_message] = {}
        """The newest PARAM_VALUE of each."""
        self.modes: list[ModeChange] = []
        self.newest: dict[str, MAVLink_message] = {}
        """The newest message of each kind that the autopilot itself has sent."""
        self._lock, self._ends = threading.Lock(), threading.Event()
        self._writer = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._socket = connected
        self._socket.settimeout(0.2)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Hang up."""
        self._ends.set()
        self._thread.join(2.0)
        self._socket.close()

    def send(self, message: MAVLink_message) -> None:
        """Send a message."""
        with self._lock, suppress(OSError):
            self._socket.sendall(message.pack(self._writer))

    def command(self, number: int, *parameters: float) -> None:
        """Send COMMAND_LONG; parameters that are not given are 0."""
        self.results.pop(number, None)
        self.send(command_long(number, *parameters, system_id=self.system_id))

    def wait(
        self,
        condition: Callable[[], object],
        what: str,
        patience_s: float = 60.0,
        ask: Callable[[], None] | None = None,
    ) -> None:
        """Wait for a condition, and ask for it every second."""
        gives_up, asks = time.monotonic() + patience_s, -math.inf
        while not condition():
            now = time.monotonic()
            if now > gives_up:
                last = self.texts[-1][1] if self.texts else "without a word"
                raise FlightError(
                    f"vehicle {self.system_id}: {what} not within {patience_s:g} s ({last})"
                )
            if ask is not None and now - asks >= ASK_AGAIN_S:
                asks = now
                ask()
            time.sleep(0.05)

    @property
    def mode(self) -> int | None:
        """The newest mode; None before the first heartbeat."""
        return self.modes[-1].custom_mode if self.modes else None

    def now(self) -> float:
        """Time by which arrivals are noted, s."""
        return time.monotonic()

    def _hear(self, data: bytes) -> None:
        """Take in what has come."""
        raise NotImplementedError

    def _take(self, message: MAVLink_message, arrival_s: float) -> None:
        kind, component = message.get_type(), message.get_srcComponent()
        if kind == "HEARTBEAT" and component == mavlink.MAV_COMP_ID_AUTOPILOT1:
            if message.custom_mode != self.mode:
                self.modes.append(ModeChange(arrival_s, message.custom_mode))
        elif kind == "STATUSTEXT":
            self.texts.append((component, message.text))
        elif kind == "COMMAND_ACK":
            self.results[message.command] = message.result
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = message
        if component == mavlink.MAV_COMP_ID_AUTOPILOT1:
            self.newest[kind] = message

    def _listen(self) -> None:
        spoke_s = -math.inf
        while not self._ends.is_set():
            if self.now() - spoke_s >= HEARTBEAT_S:
                spoke_s = self.now()
                self.send(self.HEARTBEAT)
            try:
                data = self._socket.recv(65_536)
            except TimeoutError:
                continue
            except OSError:
                # Nobody at the port yet, or not any more.
                time.sleep(0.1)
                continue
            if not data:
                return
            self._hear(data)


class GroundStation(Caller):
    """The pilot's hand, and the recorder of where an aircraft truly is."""

    HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)

    def __init__(
        self,
        system_id: int,
        connect: Callable[[], socket.socket],
        truth: Callable[[MAVLink_message], tuple[float, ...] | None],
        clock: Clock,
    ) -> None:
        """Connect, and begin to listen, by the clock of the flight.

        The truth of a message is (latitude in degrees, longitude, altitude, velocity north, east, bank) if it
        holds the true state; None of any other.
        """
        self.fixes: list[Fix] = []
        self.unknown_parameters: set[str] = set()
        self._truth = truth
        self._flight_clock = clock
        self._clock: tuple[float, float] | None = None
        self._waiting = b""
        super().__init__(system_id, connect())

    def now(self) -> float:
        return self._flight_clock.now()

    @property
    def armed(self) -> bool:
        """Whether the newest heartbeat says so."""
        beat = self.newest.get("HEARTBEAT")
        return beat is not None and bool(beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def altitude_amsl_m(self) -> float:
        """The newest true altitude; no number before the first."""
        return self.fixes[-1].altitude_amsl_m if self.fixes else math.nan

    def ask_for(self, message_id: int, rate_hz: float) -> None:
        """Ask for a message at a rate; for none at a negative one."""
        period_us = 1e6 / rate_hz if rate_hz > 0.0 else -1
        self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, period_us)

    def set_mode(self, main: int, sub: int = 0) -> None:
        """Ask for a mode by its numbers."""
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, main, sub)

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, a real number."""
        self.parameters.pop(name, None)
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        self.send(mavlink.MAVLink_param_set_message(self.system_id, 1, name.encode(), value, kind))

    def track(self) -> dict[str, FloatArray]:
        """All fixes as arrays by field, in the order of arrival."""
        rows = list(self.fixes)
        return {
            name: np.array([getattr(row, name) for row in rows])
            for name in Fix.__dataclass_fields__
        }

    def _hear(self, data: bytes) -> None:
        arrival_s = self.now()
        frames, self._waiting = wanted_frames(self._waiting + data)
        for frame in frames:
            if frame.system_id == self.system_id:
                self._take(self._parser.decode(bytearray(frame.content)), arrival_s)

    def _take(self, message: MAVLink_message, arrival_s: float) -> None:
        super()._take(message, arrival_s)
        kind = message.get_type()
        if kind == "SYSTEM_TIME":
            self._clock = message.time_boot_ms * 1e-3, arrival_s
        elif kind == "PARAM_ERROR":
            if message.error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST:
                self.unknown_parameters.add(message.param_id)
        elif self._clock is not None and (state := self._truth(message)) is not None:
            self.fixes.append(Fix(arrival_s, *self._clock, *state))


def wanted_frames(data: bytes) -> tuple[list[Frame], bytes]:
    """(frames of wanted messages, what is left of one that is not whole) of bytes of which none is lost."""
    found, start = [], 0
    while start < len(data):
        end = end_of_frame(data, start)
        if end is None and len(data) - start >= HEADER_2:
            start = next_magic(data, start + 1)
            continue
        if end is None or end > len(data):
            break
        frame = frame_at(data, start, end)
        if frame.message_id in WANTED:
            found.append(frame)
        start = end
    return found, data[start:]
