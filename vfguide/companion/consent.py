"""The phases of one flight, and the pilot's consent in it, which outlives the process.

Consent is whether a vehicle may still be engaged by itself, and who steers it.
"""

import json
import math
import os
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

import msgspec
from msgspec.structs import asdict
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.reports import HeartbeatReport, LandedReport, PositionReport
from vfguide.regular_file import open_regular, replace_file
from vfguide.state import VehicleState

FRESH_S = 3.0
"""Reports older than this show nothing."""

LEAST_SPEED_SHARE = 0.5
"""Slower than this share of its lowest airspeed it does not fly."""

LEAST_HEIGHT_SHARE = 0.5
"""Lower than this share of the mission's height it is still taking off."""

MOST_OFF_M = 20.0
"""How far from the mission's altitude an autopilot may be engaged that cannot be told one."""

STANDING_S = 5.0
"""Disarmed, on the ground and in one place for so long: the flight is over."""

STANDING_REBOOTED_S = 60.0
"""The same once the autopilot has started anew: in the air it may show all that until it has a position."""

STANDING_M_S = 4.0
"""Faster than this nothing stands."""

STANDING_M = 15.0
"""Farther than this from where it came to a stand nothing stands: estimators wander by less."""

GROUND_M = 20.0
"""Higher than this above the mission's ground nothing stands: altitudes drift by less in a flight."""


class FlightPhase:
    """Whether one vehicle stands, takes off or flies, by its reports."""

    def __init__(
        self,
        adapter: AutopilotAdapter,
        *,
        airspeed_min: float,
        altitude_amsl: float,
        ground_amsl: float,
    ) -> None:
        """Before anything is heard.

        Args:
            adapter: says what a heartbeat shows.
            airspeed_min: lowest airspeed that the vehicle is asked for, m/s.
            altitude_amsl: of the mission, m.
            ground_amsl: of the mission's origin, m.
        """
        self._adapter = adapter
        self._least_speed = LEAST_SPEED_SHARE * airspeed_min
        self._altitude = altitude_amsl
        self._ground = ground_amsl
        self._lowest = ground_amsl + LEAST_HEIGHT_SHARE * (altitude_amsl - ground_amsl)
        self._beat: HeartbeatReport | None = None
        self._landed: int | None = None
        self._landed_time = -math.inf
        self._speed = self._height = math.nan
        self._position_time = -math.inf
        self._stand: tuple[float, float, float] | None = None
        self._standing_s = STANDING_S

    def hear_landed(self, report: LandedReport, now: float) -> None:
        """Take what the autopilot says about ground and air."""
        self._landed, self._landed_time = report.state, now

    @property
    def is_over(self) -> bool:
        """Whether it has been seen, to the newest believed position, to stand for long enough."""
        return self._stand is not None and self._position_time - self._stand[0] >= self._standing_s

    def hear_position(self, report: PositionReport, state: VehicleState, now: float) -> None:
        """Take a position that is believed: one that is not shows neither flight nor standing.

        Args:
            report: as it came, for speed and altitude.
            state: as navigated, for the place.
            now: s.
        """
        if now - self._position_time > FRESH_S:
            self._stand = None
        self._speed = math.hypot(report.velocity_north, report.velocity_east)
        self._height = report.altitude_amsl
        self._position_time = now
        # Not "faster" or "higher": what is no number does not stand.
        low = self._height - self._ground <= GROUND_M
        if not (low and self._speed <= STANDING_M_S and self._is_grounded(now)):
            self._stand = None
        elif self._stand is None:
            self._stand = (now, state.north, state.east)
        elif not math.dist(self._stand[1:], (state.north, state.east)) <= STANDING_M:
            self._stand = None

    def doubt_position(self) -> None:
        """A position was reported that is not believed."""
        self._stand = None

    def forget(self) -> None:
        """The autopilot has started anew: what it said before shows nothing, and it may do so in the air.

        While it comes up it may well report that it stands on the ground: it has to do so for longer.
        """
        self._standing_s = STANDING_REBOOTED_S
        self._beat = self._landed = self._stand = None
        self._landed_time = self._position_time = -math.inf

    def hear(self, report: HeartbeatReport, now: float) -> bool:
        """Take a heartbeat; whether a flight has ended, as this and the positions before show."""
        self._beat = report
        if not self._is_grounded(now) or now - self._position_time > FRESH_S:
            self._stand = None
        return self.is_over

    def obstacle(self, now: float, *, holds_altitude: bool) -> str | None:
        """Why this is no time to engage, in words; None in the air and at a height to begin at."""
        if not self.flies(now):
            return "not engaged on the ground: take off, it is engaged in the air"
        if holds_altitude:
            if self._height >= self._lowest:
                return None
            return f"not engaged so low: climb above {self._lowest:.0f} m above sea level"
        if abs(self._height - self._altitude) <= MOST_OFF_M:
            return None
        return (
            f"not engaged at this altitude, which the autopilot would keep: fly within"
            f" {MOST_OFF_M:.0f} m of the mission's {self._altitude:.0f} m above sea level"
        )

    def is_on_ground(self, now: float) -> bool:
        """Whether the autopilot says that it is on the ground, armed or not; False where it is unknown."""
        state, beat = self._landed_state(now), self._beat
        if beat is None:
            return False
        shown = self._adapter.heartbeat_shows_flight
        if state is None:
            return bool(shown and beat.status == mavlink.MAV_STATE_STANDBY)
        contradicted = shown and beat.status == mavlink.MAV_STATE_ACTIVE
        return bool(state == mavlink.MAV_LANDED_STATE_ON_GROUND and not contradicted)

    def flies(self, now: float) -> bool:
        """Whether everything heard shows flight."""
        state, beat = self._landed_state(now), self._beat
        moves = now - self._position_time <= FRESH_S and self._speed >= self._least_speed
        if beat is None or not beat.armed or not moves:
            return False
        shown = self._adapter.heartbeat_shows_flight
        if state is None:
            return bool(shown and beat.status == mavlink.MAV_STATE_ACTIVE)
        if shown and beat.status == mavlink.MAV_STATE_STANDBY:
            return False
        return bool(state == mavlink.MAV_LANDED_STATE_IN_AIR)

    def _landed_state(self, now: float) -> int | None:
        return self._landed if now - self._landed_time <= FRESH_S else None

    def _is_grounded(self, now: float) -> bool:
        """Whether the autopilot says so, disarmed: one that reboots in the air does, too."""
        state, beat = self._landed_state(now), self._beat
        if beat is None or beat.armed:
            return False
        if state is not None:
            return bool(state == mavlink.MAV_LANDED_STATE_ON_GROUND)
        if not self._adapter.heartbeat_shows_flight:
            return False
        return bool(beat.status != mavlink.MAV_STATE_ACTIVE)


VERSION = 1

MOST_BYTES = 4096
"""A record is smaller than this."""


class Consent(msgspec.Struct, frozen=True, kw_only=True):
    """What is kept of one flight; a new flight, on the ground, begins with a new one of these."""

    spent: str = ""
    """Why the guided mode is not entered by itself any more, in words; empty while it may be."""
    steered: bool = False
    """Whether the vehicle flies, or is about to, by what a companion has sent: the next answers for it."""

    @property
    def is_spent(self) -> bool:
        """Whether the guided mode is left to the pilot."""
        return bool(self.spent)


class ConsentRecord(msgspec.Struct, frozen=True):
    """A consent as it is written."""

    version: int
    """Version of the record."""
    spent: str
    """As of `Consent`."""
    steered: bool = False
    """As of `Consent`."""


class ConsentStore(Protocol):
    """Where the consent of one vehicle is kept."""

    @property
    def fault(self) -> str | None:
        """Why nothing is kept, and what to do about it, in one line; None where all is well."""

    @property
    def was_missing(self) -> bool:
        """Whether nothing at all was found by `load`: a first flight, or a record that was lost."""

    def load(self) -> Consent:
        """What is known of the flight."""

    def save(self, consent: Consent) -> None:
        """Keep this from now on; returns at once."""

    def holds(self, consent: Consent) -> bool:
        """Whether this is what would be found after a crash now."""


class MemoryStore:
    """Keeps it as long as this object lives: for rehearsals."""

    fault = None
    was_missing = False

    def __init__(self) -> None:
        self._consent = Consent()

    def load(self) -> Consent:
        """What was saved last."""
        return self._consent

    def save(self, consent: Consent) -> None:
        """Keep it."""
        self._consent = consent

    def holds(self, consent: Consent) -> bool:
        """Whether it was saved last."""
        return consent == self._consent


class FileStore:
    """Keeps it in a file, written by a thread of its own: a slow disk delays no setpoint."""

    def __init__(self, directory: Path, vehicle: str) -> None:
        """Name the file.

        Args:
            directory: made if it is missing.
            vehicle: whose consent it is.
        """
        self._file = directory / f"{vehicle}.consent.json"
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="consent")
        self._written: Future[str | None] | None = None
        self._wanted: Consent | None = None
        self._fault: str | None = None
        self.was_missing = False
        """Whether `load` found no file."""

    @property
    def fault(self) -> str | None:
        """Why it is not kept."""
        self._collect()
        return self._fault

    def load(self) -> Consent:
        """What the file says; with a damaged one consent is spent.

        Without a file this is a first flight, unless the vehicle is in the air already.
        """
        try:
            with open_regular(self._file) as stream:
                consent = parse(stream.read(MOST_BYTES))
        except FileNotFoundError:
            consent, self.was_missing = Consent(), True
        except (OSError, ValueError) as error:
            self._fault = self._complaint("cannot be read", error)
            return Consent(spent="what was agreed for it cannot be read")
        # Written back at once: a directory that cannot be written to shows now and not in the air.
        self.save(consent)
        return consent

    def save(self, consent: Consent) -> None:
        """Have it written."""
        self._wanted = consent
        self._written = self._writer.submit(self._write, consent)

    def holds(self, consent: Consent) -> bool:
        """Whether it is on the disk."""
        self._collect()
        return self._written is None and self._fault is None and consent == self._wanted

    def close(self) -> None:
        """Wait for what is being written."""
        self._writer.shutdown(wait=True)

    def _collect(self) -> None:
        if self._written is not None and self._written.done():
            self._fault, self._written = self._written.result(), None

    def _write(self, consent: Consent) -> str | None:
        """Replace the file whole; what went wrong, or None."""
        content = json.dumps({"version": VERSION, **asdict(consent)}) + "\n"
        directory = self._file.parent
        try:
            directory.mkdir(parents=True, exist_ok=True)
            replace_file(self._file, content.encode())
            flush_directory(directory)
        except OSError as error:
            return self._complaint("cannot be written", error)
        return None

    def _complaint(self, what: str, error: Exception) -> str:
        reason = (isinstance(error, OSError) and error.strerror) or "damaged"
        return (
            f"not engaged by itself: {self._file} {what} ({reason});"
            " mend it or name another with --state, or engage by hand"
        )


def begin_flight(directory: Path, vehicle: str) -> None:
    """Keep the record of a new flight, as of a vehicle that begins it in the air."""
    store = FileStore(directory, vehicle)
    store.save(Consent())
    store.close()


def parse(content: bytes) -> Consent:
    """A consent as it was written; records of former versions do not say who steers.

    Raises:
        ValueError: it is none.
    """
    try:
        record = msgspec.json.decode(content, type=ConsentRecord)
    except RecursionError as error:
        raise ValueError("no record of consent") from error
    if record.version != VERSION:
        raise ValueError("no record of consent")
    return Consent(spent=record.spent, steered=record.steered)


def flush_directory(directory: Path) -> None:
    """Make the names in a directory last."""
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def default_directory() -> Path:
    """STATE_DIRECTORY where systemd gives one, else vfguide's own below XDG_STATE_HOME."""
    given = os.environ.get("STATE_DIRECTORY", "").split(":")[0]
    if given:
        return Path(given)
    home = os.environ.get("XDG_STATE_HOME", "")
    return (Path(home) if home else Path("~/.local/state").expanduser()) / "vfguide"
