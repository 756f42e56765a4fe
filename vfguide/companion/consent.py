"""Phases of one flight, and the pilot's consent in it, which outlives the process.

Consent is whether a vehicle may still be engaged by itself, and whether a companion steers it.
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
"""Age after which reports are ignored, s."""

LEAST_SPEED_SHARE = 0.5
"""Share of the minimum airspeed below which a vehicle does not fly."""

LEAST_HEIGHT_SHARE = 0.5
"""Share of the mission's height below which a vehicle is still taking off."""

MOST_OFF_M = 20.0
"""Tolerance on the mission's altitude for engaging an autopilot that cannot be sent one, m."""

STANDING_S = 5.0
"""Time disarmed, on the ground and in one place after which the flight is over, s."""

STANDING_REBOOTED_S = 60.0
"""That time after a restart of the autopilot, s: in the air it may show all that until it has a position."""

STANDING_M_S = 4.0
"""Speed above which a vehicle does not stand, m/s."""

STANDING_M = 15.0
"""Distance from where a vehicle came to a stand beyond which it moves, m: estimators wander by less."""

GROUND_M = 20.0
"""Height above the mission's ground above which nothing stands, m: altitudes drift by less in a flight."""


class FlightPhase:
    """Detector of whether a vehicle stands, takes off or flies, by its reports."""

    def __init__(
        self,
        adapter: AutopilotAdapter,
        *,
        airspeed_min: float,
        altitude_amsl: float,
        ground_amsl: float,
    ) -> None:
        """Begin before the first report; airspeed in m/s, altitudes of mission and its origin in m."""
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
        """Process the autopilot's report on ground and air."""
        self._landed, self._landed_time = report.state, now

    @property
    def is_over(self) -> bool:
        """Whether the vehicle has stood for long enough, up to the newest believed position."""
        return self._stand is not None and self._position_time - self._stand[0] >= self._standing_s

    def hear_position(self, report: PositionReport, state: VehicleState, now: float) -> None:
        """Process a believed position: speed and altitude as reported, the place as navigated.

        A doubted position shows neither flight nor standing.
        """
        if now - self._position_time > FRESH_S:
            self._stand = None
        self._speed = math.hypot(report.velocity_north, report.velocity_east)
        self._height = report.altitude_amsl
        self._position_time = now
        # The comparisons are such that NaN does not count as standing.
        low = self._height - self._ground <= GROUND_M
        if not (low and self._speed <= STANDING_M_S and self._is_grounded(now)):
            self._stand = None
        elif self._stand is None:
            self._stand = (now, state.north, state.east)
        elif not math.dist(self._stand[1:], (state.north, state.east)) <= STANDING_M:
            self._stand = None

    def doubt_position(self) -> None:
        """Note a position that is not believed."""
        self._stand = None

    def forget(self) -> None:
        """Forget all reports, as the autopilot has restarted, possibly in the air.

        While it starts it may report that it stands on the ground, so it has to do so for longer.
        """
        self._standing_s = STANDING_REBOOTED_S
        self._beat = self._landed = self._stand = None
        self._landed_time = self._position_time = -math.inf

    def hear(self, report: HeartbeatReport, now: float) -> bool:
        """Process a heartbeat; return whether a flight has ended by it and the positions before."""
        self._beat = report
        if not self._is_grounded(now) or now - self._position_time > FRESH_S:
            self._stand = None
        return self.is_over

    def obstacle(self, now: float, *, holds_altitude: bool) -> str | None:
        """Return why this is no time to engage; None in the air and at a permitted height."""
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
        """Check whether the autopilot reports itself on the ground, armed or not; False if unknown."""
        state, beat = self._landed_state(now), self._beat
        if beat is None:
            return False
        shown = self._adapter.heartbeat_shows_flight
        if state is None:
            return bool(shown and beat.status == mavlink.MAV_STATE_STANDBY)
        contradicted = shown and beat.status == mavlink.MAV_STATE_ACTIVE
        return bool(state == mavlink.MAV_LANDED_STATE_ON_GROUND and not contradicted)

    def flies(self, now: float) -> bool:
        """Check whether all reports show flight."""
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
        """Check whether the autopilot reports ground, disarmed: it may also when it restarts in the air."""
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
"""Upper bound on the size of a record."""


class Consent(msgspec.Struct, frozen=True, kw_only=True):
    """Consent in one flight; a new flight begins with a new one on the ground."""

    spent: str = ""
    """Reason why the companion no longer enters the guided mode by itself; empty while it may."""
    steered: bool = False
    """Whether the vehicle flies, or is about to, by a companion's setpoints, also for the next one."""

    @property
    def is_spent(self) -> bool:
        """Whether engaging is left to the pilot."""
        return bool(self.spent)


class ConsentRecord(msgspec.Struct, frozen=True):
    """Consent as it is written."""

    version: int
    """Version of the record."""
    spent: str
    """See `Consent.spent`."""
    steered: bool = False
    """See `Consent.steered`."""


class ConsentStore(Protocol):
    """Storage for the consent of one vehicle."""

    @property
    def fault(self) -> str | None:
        """Reason why nothing is stored, with the remedy, in one line; None if all is well."""

    @property
    def was_missing(self) -> bool:
        """Whether `load` found nothing: a first flight, or a lost record."""

    def load(self) -> Consent:
        """Return the stored consent."""

    def save(self, consent: Consent) -> None:
        """Store a consent; return at once."""

    def holds(self, consent: Consent) -> bool:
        """Check whether this consent would be found after a crash now."""


class MemoryStore:
    """Storage that lasts as long as the object, for rehearsals."""

    fault = None
    was_missing = False

    def __init__(self) -> None:
        self._consent = Consent()

    def load(self) -> Consent:
        """Return the consent saved last."""
        return self._consent

    def save(self, consent: Consent) -> None:
        """Store a consent."""
        self._consent = consent

    def holds(self, consent: Consent) -> bool:
        """Check whether this consent was saved last."""
        return consent == self._consent


class FileStore:
    """Storage in a file, written by a separate thread so that a slow disk delays no setpoint."""

    def __init__(self, directory: Path, vehicle: str) -> None:
        """Name the file; its directory is made if it is missing."""
        self._file = directory / f"{vehicle}.consent.json"
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="consent")
        self._written: Future[str | None] | None = None
        self._wanted: Consent | None = None
        self._fault: str | None = None
        self.was_missing = False
        """Whether `load` found no file."""

    @property
    def fault(self) -> str | None:
        """Reason why the consent is not stored, or None."""
        self._collect()
        return self._fault

    def load(self) -> Consent:
        """Return the consent in the file; it is spent if the file is damaged.

        A missing file means a first flight, unless the vehicle is in the air already.
        """
        try:
            with open_regular(self._file) as stream:
                consent = parse(stream.read(MOST_BYTES))
        except FileNotFoundError:
            consent, self.was_missing = Consent(), True
        except (OSError, ValueError) as error:
            self._fault = self._complaint("cannot be read", error)
            return Consent(spent="what was agreed for it cannot be read")
        # Write it back at once: an unwritable directory shows now and not in the air.
        self.save(consent)
        return consent

    def save(self, consent: Consent) -> None:
        """Queue a consent for writing."""
        self._wanted = consent
        self._written = self._writer.submit(self._write, consent)

    def holds(self, consent: Consent) -> bool:
        """Check whether a consent is on the disk."""
        self._collect()
        return self._written is None and self._fault is None and consent == self._wanted

    def close(self) -> None:
        """Wait for pending writes."""
        self._writer.shutdown(wait=True)

    def _collect(self) -> None:
        if self._written is not None and self._written.done():
            self._fault, self._written = self._written.result(), None

    def _write(self, consent: Consent) -> str | None:
        """Replace the whole file; return what went wrong, or None."""
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
    """Store the record of a new flight for a vehicle that begins it in the air."""
    store = FileStore(directory, vehicle)
    store.save(Consent())
    store.close()


def parse(content: bytes) -> Consent:
    """Decode a record; former versions do not say who steers.

    Raises:
        ValueError: the content is no record of consent.
    """
    try:
        record = msgspec.json.decode(content, type=ConsentRecord)
    except RecursionError as error:
        raise ValueError("no record of consent") from error
    if record.version != VERSION:
        raise ValueError("no record of consent")
    return Consent(spent=record.spent, steered=record.steered)


def flush_directory(directory: Path) -> None:
    """Make the entries of a directory durable."""
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def default_directory() -> Path:
    """Return STATE_DIRECTORY from systemd, else vfguide's directory below XDG_STATE_HOME."""
    given = os.environ.get("STATE_DIRECTORY", "").split(":")[0]
    if given:
        return Path(given)
    home = os.environ.get("XDG_STATE_HOME", "")
    return (Path(home) if home else Path("~/.local/state").expanduser()) / "vfguide"
