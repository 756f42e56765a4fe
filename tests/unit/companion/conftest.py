"""One companion with a real emulated autopilot in virtual time, and a leader on the link."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, AutopilotConfig, CalmWind, PlantParameters
from tests.unit.companion.ordered_companions import slots_of
from vfguide.companion.consent import ConsentStore, MemoryStore
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.plan import FlightPlan
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.formation.arrangement import Point
from vfguide.link.codec import LeaderMessage, encode
from vfguide.mission import load_mission
from vfguide.mission.model import Mission

MISSIONS = Path(__file__).parents[3] / "missions"

RATE_HZ = 10.0
"""Of telemetry and guidance. What is shown here does not depend on it; its cost does."""
GUIDED, LOITER, MANUAL = 15, 12, 0


@cache
def mission_of(name: str) -> Mission:
    return load_mission(MISSIONS / f"{name}.yaml")


def parse(data: bytes) -> list[MAVLink_message]:
    return mavlink.MAVLink(None).parse_buffer(data) or []


def number_of(message: MAVLink_message) -> int | str:
    """Number of a command, name of any other message."""
    if message.get_type() in {"COMMAND_INT", "COMMAND_LONG"}:
        return int(message.command)
    return str(message.get_type())


@pytest.fixture(scope="session")
def mission() -> Callable[[str], Mission]:
    """A mission that comes along, by the name of its file."""
    return mission_of


@pytest.fixture(scope="session")
def leader_bytes() -> Callable[..., bytes]:
    """A leader that flies north from the origin at 20 m/s, as it crosses the link."""
    frame = plan_of("line-calm", "f1").frame

    def make(now: float, /, **values: float) -> bytes:
        latitude, longitude = frame.to_geodetic(20.0 * now, 0.0)
        fields = {
            "sequence": 1,
            "time_s": now,
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "altitude_amsl": 588.0,
            "course": 0.0,
            "ground_speed": 20.0,
            "acceleration": 0.0,
            "turn_rate": 0.0,
            "turn_acceleration": 0.0,
        }
        return encode(LeaderMessage(**(fields | values)))

    return make


def plan_of(name: str, vehicle: str) -> FlightPlan:
    return flight_plan(mission_of(name), vehicle)


@dataclass(slots=True)
class Flight:
    """One vehicle on its way."""

    companion: Companion
    autopilot: Autopilot
    link: Callable[[float], Iterable[bytes]]
    """What arrives over the link at a time."""
    now: float = 0.0
    booted: float = 0.0
    """When the autopilot was made."""
    waiting: bytes = b""
    """What the autopilot has said and the companion has not heard yet."""
    sent: list[tuple[float, bytes]] = field(default_factory=list)
    published: list[bytes] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)
    modes: list[tuple[float, Mode]] = field(default_factory=list)
    lose: frozenset[int] = frozenset()
    """Commands that never arrive."""
    deaf: bool = False
    """Whether nothing that the autopilot says arrives."""
    forge: Callable[[float], bytes] = lambda _now: b""
    """What another says in the autopilot's name at a time."""
    make: Callable[[], Companion] | None = None
    """Makes the companion of a process that starts anew, with the state that the one before has kept."""
    late_s: float = 0.0
    """How long what the autopilot says is under way, as in the buffer of a radio."""
    _under_way: list[tuple[float, bytes]] = field(default_factory=list)
    _steps: int = 0

    def run(self, until_s: float) -> None:
        """Fly on, both sides taking turns."""
        while self._steps / RATE_HZ <= until_s:
            self.now = self._steps / RATE_HZ
            for data in self.link(self.now):
                self.companion.receive_link(data, self.now)
            said = self.waiting + self.autopilot.advance(self.now - self.booted)
            self._under_way.append((self.now + self.late_s, said))
            telemetry = b""
            while self._under_way and self._under_way[0][0] <= self.now + 1e-9:
                telemetry += self._under_way.pop(0)[1]
            telemetry = self.forge(self.now) + (b"" if self.deaf else telemetry)
            out = self.companion.receive_mavlink(telemetry, self.now)
            self.sent.append((self.now, out.to_autopilot))
            self.waiting = self.autopilot.receive(self._passed_on(out.to_autopilot))
            self.published += out.to_link
            self.events += [(event.time_s, event.text) for event in out.events]
            self.modes.append((self.now, self.companion.snapshot.mode))
            self._steps += 1

    def _passed_on(self, data: bytes) -> bytes:
        if not self.lose:
            return data
        kept = [message for message in parse(data) if number_of(message) not in self.lose]
        return b"".join(bytes(message.get_msgbuf()) for message in kept)

    def restart(self) -> None:
        """The companion is killed, and another process takes its place."""
        assert self.make is not None
        self.companion = self.make()

    def hang(self, until_s: float) -> None:
        """The companion's process stands still; what the autopilot says waits in a buffer."""
        self._steps = int(until_s * RATE_HZ) + 1
        self.waiting += self.autopilot.advance(until_s - self.booted)

    def pilot(self, main_mode: int, sub_mode: int = 0) -> None:
        """The pilot turns the mode switch."""
        self.command(176, 1, main_mode, sub_mode)

    def command(self, number: int, *parameters: float) -> None:
        """Somebody else on the network commands the autopilot."""
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        message = mavlink.MAVLink_command_long_message(0, 1, number, 0, *padded)
        station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self.waiting += self.autopilot.receive(message.pack(station))

    def times(self, number: int | str) -> list[float]:
        """When a command, or another message by its name, was sent."""
        return [
            time
            for time, data in self.sent
            for message in parse(data)
            if number_of(message) == number
        ]

    def later(self, number: int | str, from_s: float) -> list[float]:
        """When it was sent, after a time."""
        return [time for time in self.times(number) if time > from_s]

    def texts(self) -> list[tuple[float, str]]:
        """What the companion told to ground stations, as these put the parts together, and when."""
        whole: list[tuple[float, str]] = []
        for time, data in self.sent:
            for message in parse(data):
                if message.get_type() == "STATUSTEXT" and message.chunk_seq:
                    whole[-1] = (time, whole[-1][1] + message.text)
                elif message.get_type() == "STATUSTEXT":
                    whole.append((time, message.text))
        return whole

    def reboot(self) -> None:
        """The autopilot starts anew; what it was about to say is lost."""
        self.autopilot, self.booted, self.waiting = emulator(), self.now, b""

    def mode_at(self, time_s: float) -> Mode:
        """What the companion was doing."""
        return next(mode for time, mode in reversed(self.modes) if time <= time_s)


def emulator(
    kind: str = "ardupilot", system_id: int = 2, version: tuple[int, int] | None = None
) -> Autopilot:
    """50 m behind the origin and 30 m left of it, northbound at 20 m/s, in a loiter."""
    latitude, longitude = plan_of("line-calm", "f1").frame.to_geodetic(-50.0, -30.0)
    config = AutopilotConfig(
        system_id=system_id,
        autopilot="px4" if kind == "px4" else "ardupilot",
        autopilot_version=version,
        plant=PlantParameters(),
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=588.0,
        home_altitude_amsl_m=488.0,
        course_rad=0.0,
        airspeed_m_s=20.0,
    )
    return Autopilot(config, CalmWind())


@pytest.fixture(scope="session")
def new_autopilot() -> Callable[..., Autopilot]:
    """Makes an autopilot that has just booted."""
    return emulator


@pytest.fixture(scope="session")
def flight(leader_bytes: Callable[..., bytes]) -> Callable[..., Flight]:
    """Makes a flight of f1 (slot 20 m behind, 20 m left) after a leader that is heard all the time.

    The leader's path is the line that it flies: north from the origin.
    """

    def make(
        vehicle: str = "f1",
        *,
        engage: bool = True,
        kind: str = "ardupilot",
        version: tuple[int, int] | None = None,
        link: Callable[[float], Iterable[bytes]] | None = None,
        patience: dict[str, float] | None = None,
        clock: SharedClock = SAME_CLOCK,
        store: ConsentStore | None = None,
        engage_from: tuple[str, ...] = ("LOITER", "HOLD"),
    ) -> Flight:
        mission = mission_of("line-calm")
        sections = {
            "path": mission.path.model_copy(update={"course_deg": 0.0}),
            "patience": mission.patience.model_copy(update=patience or {}),
            "rehearsal": mission.rehearsal.model_copy(update={"rate_hz": RATE_HZ}),
        }
        mission = mission.model_copy(update=sections)
        declared = mission.vehicles[vehicle].model_copy(update={"autopilot": kind})
        kept = store or MemoryStore()

        def companion() -> Companion:
            return Companion(
                replace(flight_plan(mission, vehicle), engage_from=engage_from),
                adapter_of(declared),
                engage=engage,
                consent=kept,
                clock=clock,
            )

        return Flight(
            companion=companion(),
            make=companion,
            autopilot=emulator(kind, declared.system_id, version),
            link=link or (lambda now: [leader_bytes(now)]),
        )

    return make


@pytest.fixture(scope="session")
def until(leader_bytes: Callable[..., bytes]) -> Callable[..., Callable[[float], list[bytes]]]:
    """A link on which the leader falls silent after some time, and speaks again after another."""

    def make(silent_s: float, back_s: float = 1e9) -> Callable[[float], list[bytes]]:
        def link(now: float) -> list[bytes]:
            return [leader_bytes(now)] if now <= silent_s or now >= back_s else []

        return link

    return make


@pytest.fixture(scope="session")
def spoken() -> Callable[..., bytes]:
    """Packs messages as the autopilot of f1 sends them."""

    def pack(*messages: MAVLink_message) -> bytes:
        sender = mavlink.MAVLink(None, srcSystem=2, srcComponent=1)
        return b"".join(message.pack(sender) for message in messages)

    return pack


@pytest.fixture(scope="session")
def parsed() -> Callable[[bytes], list[MAVLink_message]]:
    """Messages in bytes."""
    return parse


@pytest.fixture(scope="session")
def plan() -> Callable[..., FlightPlan]:
    """The part of a vehicle in a mission that comes along."""

    def make(name: str = "line-calm", vehicle: str = "f1") -> FlightPlan:
        return plan_of(name, vehicle)

    return make


@pytest.fixture
def slots(plan: Callable[..., FlightPlan]) -> dict[str, Point]:
    """The mission's slots of its three followers."""
    return slots_of(plan)
