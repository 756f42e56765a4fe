"""One companion with a real emulated autopilot in virtual time, and a leader on the link."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot
from tests.kit.autopilot import new_autopilot
from tests.kit.missions import mission_with, shipped, with_vehicle
from tests.kit.states import FRAME
from tests.kit.wire import command_long, number_of, packed, parsed, spoken
from vfguide.companion.consent import ConsentStore, MemoryStore
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.plan import FlightPlan
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.link.codec import LeaderMessage, encode
from vfguide.mission import Mission

RATE_HZ = 10.0
"""Of telemetry and guidance. What is shown here does not depend on it; its cost does."""
GUIDED, LOITER, RTL, MANUAL = 15, 12, 11, 0
"""Modes of ArduPlane."""

SET_MODE, HEADING, SPEED, ALTITUDE, MESSAGE_INTERVAL = 176, 43_002, 43_000, 43_001, 511
"""Commands."""

KINDS = ["ardupilot", "px4"]
ARDUPLANE_MODES = {"GUIDED": 15, "LOITER": 12, "RTL": 11, "AUTO": 10, "FBWA": 5, "MANUAL": 0}
ARDUPLANE_MODES |= {"FBWB": 6, "CRUISE": 7, "CIRCLE": 1}
PX4_MODES = {"GUIDED": (4, 19), "LOITER": (4, 3), "RTL": (4, 5), "OFFBOARD": (6, 0)}
PX4_MODES |= {"ALTCTL": (2, 0), "MANUAL": (1, 0), "AUTO": (4, 4), "LAND": (4, 6), "POSCTL": (3, 0)}
MODES = {"ardupilot": {name: (one, 0) for name, one in ARDUPLANE_MODES.items()}, "px4": PX4_MODES}
"""What a pilot selects of each kind: main mode and sub mode."""

PX4_NAMES = {"AUTO.COURSE": "GUIDED", "AUTO.LOITER": "LOITER", "AUTO.RTL": "RTL"}
"""What PX4 calls the modes that both have."""

HASTY = {"prediction_s": 3.0, "breakaway_s": 2.0}
"""The patience of a mission whose leader is lost 5 s after it was heard last."""

Said = Callable[[float], Iterable[bytes]]
"""What arrives over the link at a time."""


def leader_bytes(
    now: float, /, *, north: float | None = None, east: float = 0.0, **values: float
) -> bytes:
    """Encode a leader that flies north from the origin at 20 m/s, as it crosses the link.

    Args:
        now: time of the state, s.
        north: of the origin, m, if it is elsewhere.
        east: of the origin, m.
        values: of fields that are otherwise.
    """
    latitude, longitude = FRAME.to_geodetic(20.0 * now if north is None else north, east)
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


def heard_until(silent_s: float, back_s: float = 1e9) -> Said:
    """Make a link on which the leader falls silent after some time, and speaks again after another."""
    return lambda now: [leader_bytes(now)] if now <= silent_s or now >= back_s else []


def heard_from(begin_s: float) -> Said:
    """Make a link on which the leader is not heard before some time."""
    return heard_until(-1.0, begin_s)


Edit = Callable[[MAVLink_message, float], MAVLink_message | None]
"""What becomes of a message of the autopilot at a time; None if it never arrives."""


def without(*kinds: str) -> Edit:
    """Make a wire that loses some kinds of the autopilot's messages."""
    return lambda message, _now: None if message.get_type() in kinds else message


@lru_cache(maxsize=4096)
def messages_in(data: bytes) -> tuple[MAVLink_message, ...]:
    """Parse what a companion has sent once, however often it is looked at."""
    return tuple(parsed(data))


@dataclass(slots=True)
class Flight:
    """One vehicle on its way."""

    companion: Companion
    autopilot: Autopilot
    link: Said
    now: float = 0.0
    booted: float = 0.0
    """When the autopilot was made."""
    waiting: bytes = b""
    """What the autopilot has said and the companion has not heard yet."""
    sent: list[tuple[float, bytes]] = field(default_factory=list)
    published: list[bytes] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)
    modes: list[tuple[float, Mode]] = field(default_factory=list)
    lose: frozenset[int | str] = frozenset()
    """Commands that never arrive."""
    answers: dict[int, int] = field(default_factory=dict)
    """Commands that never arrive, and the results with which somebody answers them."""
    deaf: bool = False
    """Whether nothing that the autopilot says arrives."""
    forge: Callable[[float], bytes] = lambda _now: b""
    """What another says in the autopilot's name at a time."""
    neighbours: Callable[[float], dict[str, bytes]] = lambda _now: {}
    """What the other followers say at a time."""
    edit: Edit | None = None
    """What becomes of each message of the autopilot on its way."""
    make: Callable[[], Companion] | None = None
    """Makes the companion of a process that starts anew, with the state that the one before has kept."""
    late_s: float = 0.0
    """How long what the autopilot says is under way, as in the buffer of a radio."""
    _under_way: list[tuple[float, bytes]] = field(default_factory=list)
    _steps: int = 0

    def run(self, until_s: float, **parts: Any) -> None:
        """Fly on, both sides taking turns, with some parts otherwise from now on."""
        for name, part in parts.items():
            setattr(self, name, part)
        while self._steps / RATE_HZ <= until_s:
            self.now = self._steps / RATE_HZ
            for name, data in self.neighbours(self.now).items():
                self.companion.receive_neighbour(name, data, self.now)
            for data in self.link(self.now):
                self.companion.receive_link(data, self.now)
            said = self.waiting + self.autopilot.advance(self.now - self.booted)
            self._under_way.append((self.now + self.late_s, said))
            telemetry = b""
            while self._under_way and self._under_way[0][0] <= self.now + 1e-9:
                telemetry += self._edited(self._under_way.pop(0)[1])
            telemetry = self.forge(self.now) + (b"" if self.deaf else telemetry)
            out = self.companion.receive_mavlink(telemetry, self.now)
            self.sent.append((self.now, out.to_autopilot))
            self.waiting = self._obeyed(out.to_autopilot)
            self.published += out.to_link
            self.events += [(event.time_s, event.text) for event in out.events]
            self.modes.append((self.now, self.companion.snapshot.mode))
            self._steps += 1

    def _edited(self, data: bytes) -> bytes:
        if self.edit is None:
            return data
        edited = (self.edit(message, self.now) for message in parsed(data))
        return spoken(*(message for message in edited if message is not None))

    def _obeyed(self, data: bytes) -> bytes:
        """What is answered to bytes of the companion."""
        if not self.lose and not self.answers:
            return self.autopilot.receive(data)
        said = b""
        for message in parsed(data):
            number = number_of(message)
            if number in self.answers:
                result = self.answers[int(number)]
                said += spoken(mavlink.MAVLink_command_ack_message(number, result))
            elif number not in self.lose:
                said += self.autopilot.receive(bytes(message.get_msgbuf()))
        return said

    def restart(self) -> None:
        """The companion is killed, and another process takes its place."""
        assert self.make is not None
        self.companion = self.make()

    def hang(self, until_s: float) -> None:
        """The companion's process stands still; what the autopilot says waits in a buffer."""
        self._steps = int(until_s * RATE_HZ) + 1
        self.waiting += self.autopilot.advance(until_s - self.booted)

    def pilot(self, mode: str | int, *, until_s: float | None = None) -> None:
        """The pilot turns the mode switch; the flight goes on until a time, if one is given."""
        kind = self.autopilot.config.autopilot
        wanted = MODES[kind][mode] if isinstance(mode, str) else (mode, 0)
        self.command(SET_MODE, 1, *wanted)
        if until_s is not None:
            self.run(until_s)

    @property
    def autopilot_mode(self) -> str:
        """The mode in which the autopilot is, by the name that both kinds have for it."""
        mode = self.autopilot.truth().mode
        return PX4_NAMES.get(mode, mode)

    @property
    def mode(self) -> Mode:
        """What the companion does."""
        return self.modes[-1][1]

    @property
    def state(self) -> tuple[Mode, str]:
        """What the companion does, and the mode in which its autopilot is."""
        return self.mode, self.autopilot_mode

    def told(self, words: str = "", from_s: float = -1.0) -> list[str]:
        """What was logged with these words in it after a time."""
        return [text for time, text in self.events if words in text and time > from_s]

    def command(self, number: int, *parameters: float) -> None:
        """Somebody else on the network commands the autopilot."""
        self.waiting += self.autopilot.receive(packed(command_long(number, *parameters)))

    def times(self, number: int | str) -> list[float]:
        """When a command, or another message by its name, was sent."""
        return [
            time
            for time, data in self.sent
            for message in messages_in(data)
            if number_of(message) == number
        ]

    def later(self, number: int | str, from_s: float) -> list[float]:
        """When it was sent, after a time."""
        return [time for time in self.times(number) if time > from_s]

    def texts(self) -> list[tuple[float, str]]:
        """What the companion told to ground stations, as these put the parts together, and when."""
        whole: list[tuple[float, str]] = []
        for time, data in self.sent:
            for message in messages_in(data):
                if message.get_type() == "STATUSTEXT" and message.chunk_seq:
                    whole[-1] = (time, whole[-1][1] + message.text)
                elif message.get_type() == "STATUSTEXT":
                    whole.append((time, message.text))
        return whole

    def reboot(self) -> None:
        """The autopilot starts anew; what it was about to say is lost."""
        self.autopilot, self.booted, self.waiting = emulator(), self.now, b""

    def place(self) -> tuple[float, float]:
        """Where the vehicle is, m north and east of the origin."""
        truth = self.autopilot.truth()
        return FRAME.to_local(truth.latitude_deg, truth.longitude_deg)

    def mode_at(self, time_s: float) -> Mode:
        """What the companion was doing."""
        return next(mode for time, mode in reversed(self.modes) if time <= time_s)


def emulator(
    kind: str = "ardupilot",
    system_id: int = 2,
    version: tuple[int, int] | None = None,
    *,
    north: float = -50.0,
    east: float = -30.0,
    **changes: Any,
) -> Autopilot:
    """50 m behind the origin and 30 m left of it, northbound at 20 m/s, in a loiter."""
    latitude, longitude = FRAME.to_geodetic(north, east)
    fields: dict[str, Any] = {
        "system_id": system_id,
        "autopilot": kind,
        "autopilot_version": version,
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "altitude_amsl_m": 588.0,
        "home_altitude_amsl_m": 488.0,
    }
    return new_autopilot(**(fields | changes))


def new_flight(
    vehicle: str = "f1",
    *,
    engage: bool = True,
    kind: str = "ardupilot",
    version: tuple[int, int] | None = None,
    link: Said | None = None,
    patience: dict[str, float] | None = None,
    clock: SharedClock = SAME_CLOCK,
    store: ConsentStore | None = None,
    engage_from: tuple[str, ...] = ("LOITER", "HOLD"),
    until_s: float | None = None,
    **parts: Any,
) -> Flight:
    """Make a flight of f1 (slot 20 m behind, 20 m left) after a leader that is heard all the time.

    The leader's path is the line that it flies: north from the origin. The flight begins, or has gone on
    until a time; `parts` as of Flight.
    """
    northward = {"path": {"course_deg": 0.0}, "rehearsal": {"rate_hz": RATE_HZ}}
    mission = mission_with("line-calm", patience=patience or {}, **northward)
    declared = with_vehicle(mission, vehicle, autopilot=kind).vehicles[vehicle]
    kept = store or MemoryStore()

    def companion() -> Companion:
        return Companion(
            replace(flight_plan(mission, vehicle), engage_from=engage_from),
            adapter_of(declared),
            engage=engage,
            consent=kept,
            clock=clock,
        )

    fields: dict[str, Any] = {
        "companion": companion(),
        "make": companion,
        "autopilot": emulator("ardupilot" if kind == "auto" else kind, declared.system_id, version),
        "link": link or (lambda now: [leader_bytes(now)]),
    }
    flight = Flight(**(fields | parts))
    if until_s is not None:
        flight.run(until_s)
    return flight


def companion_of(
    vehicle: str = "f1",
    *,
    mission: Mission | None = None,
    plan: FlightPlan | None = None,
    engage: bool = True,
    autopilot: str | None = None,
    plant: str | None = None,
    **options: Any,
) -> Companion:
    """Make the companion of a vehicle with nothing around it.

    Args:
        vehicle: in the mission.
        mission: line-calm if absent.
        plan: another than the mission's.
        engage: whether it may.
        autopilot: another than the mission's.
        plant: another than the mission's.
        options: of the companion.
    """
    given = {"autopilot": autopilot, "plant": plant}
    changes = {name: value for name, value in given.items() if value is not None}
    mission = with_vehicle(mission or shipped("line-calm"), vehicle, **changes)
    plan = plan or flight_plan(mission, vehicle)
    return Companion(plan, adapter_of(mission.vehicles[vehicle]), engage=engage, **options)


def assert_left_alone(flown: Flight, mode: str, *, since_s: float = -1.0) -> None:
    """See that the autopilot is in a mode, and that the companion has commanded none since a time."""
    assert flown.later(SET_MODE, since_s) == []
    assert flown.autopilot_mode == mode
