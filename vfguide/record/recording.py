"""Recording of one start of a companion, in a directory of its own.

    f1-20261122T061500Z/
        recording.json     vehicle, program, and its clocks at the start
        mission.yaml       the mission as it was flown
        f1.tlog            every MAVLink frame in and out
        f1.guidance.csv    every step of guidance
        f1.events.csv      modes, orders, changes of leader, warnings
        f1.response.csv    the assumed response of the vehicle, at each change

Each file is written once or only appended to, so none needs an orderly end.
"""

import json
import math
import os
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from urllib.parse import quote

import msgspec
import yaml

from vfguide.errors import InputError, described_error
from vfguide.mission.model import Mission
from vfguide.record.events import EVENTS, FlightEvent, encode_event
from vfguide.record.events import SUFFIX as EVENTS_SUFFIX
from vfguide.record.guidance_log import STEPS, SUFFIX, GuidanceStep, encode_step
from vfguide.record.response import RESPONSES, VehicleResponse
from vfguide.record.response import SUFFIX as RESPONSE_SUFFIX
from vfguide.record.tlog import stamped
from vfguide.regular_file import open_regular

# Growing files of a flight are written by a thread of their own, so that the control loop never waits for a
# disk.
#
# Every file is append-only. After a power failure or `kill -9` it is complete up to the last second. After a
# partial write the file is truncated to its previous content.

WRITE_S = 0.2
"""Interval of writes to the files, s."""

SYNC_S = 1.0
"""Interval of syncs to the disk itself, s."""

LONGEST_QUEUE = 10_000
"""Maximum entries waiting for a slow disk: two minutes of a busy connection. More are dropped and counted."""

CLOSING_S = 5.0
"""Time for writing the last entries before the program ends without them, s."""


class GrowingFile:
    """An append-only file."""

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises:
            OSError: the file exists, or cannot be created.
        """
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        self._size = 0

    def append(self, content: bytes) -> None:
        """Append all of the content, or nothing.

        Raises:
            OSError: the write fails.
        """
        rest = memoryview(content)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise
        self._size += len(content)

    def sync(self) -> None:
        """Sync the file to the disk.

        Raises:
            OSError: the sync fails.
        """
        os.fsync(self._descriptor)

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            os.close(self._descriptor)


class DiskWriter:
    """Takes entries without waiting, and writes them within a second.

    One thread puts entries; the writer's own thread encodes and writes them.
    """

    def __init__(self, *, longest_queue: int = LONGEST_QUEUE, write_s: float = WRITE_S) -> None:
        """Start the writer's thread."""
        self.dropped = 0
        """Number of entries dropped because the queue was full."""
        self.lost = 0
        """Number of entries lost in failed writes."""
        self._longest = longest_queue
        self._write_s = write_s
        self._queue: deque[tuple[GrowingFile, Callable[[], bytes]]] = deque()
        self._files: dict[GrowingFile, bool] = {}
        self._news: deque[str] = deque()
        self._trouble: str | None = None
        self._counted = 0
        self._since_sync_s = 0.0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="record", daemon=True)
        self._thread.start()

    def put(self, file: GrowingFile, encode: Callable[[], bytes]) -> None:
        """Queue an entry, which the writer's thread encodes. Never waits and never raises."""
        if len(self._queue) >= self._longest:
            self.dropped += 1
        else:
            self._queue.append((file, encode))

    def news(self) -> list[str]:
        """Return new messages for the operator since the last call, one line each."""
        found = []
        while self._news:
            found.append(self._news.popleft())
        return found

    def close(self) -> None:
        """Write waiting entries and end; give up if the disk does not respond for some seconds."""
        self._closing.set()
        self._thread.join(CLOSING_S)

    @property
    def missing(self) -> int:
        """Number of entries that are in no file now."""
        return self.dropped + self.lost + len(self._queue)

    def _run(self) -> None:
        while not self._closing.wait(self._write_s):
            self._write()
        self._since_sync_s = SYNC_S
        self._write()
        for file in self._files:
            file.close()

    def _write(self) -> None:
        """Write all waiting entries, and report when writes begin or cease to fail."""
        batches: dict[GrowingFile, list[bytes]] = {}
        trouble: str | None = None
        for _ in range(len(self._queue)):
            file, encode = self._queue.popleft()
            try:
                batches.setdefault(file, []).append(encode())
            except Exception as error:  # noqa: BLE001 - one entry's, whatever it holds
                self.lost += 1
                trouble = described_error(error)
        for file, entries in batches.items():
            self._files[file] = True
            try:
                file.append(b"".join(entries))
            except OSError as error:
                self.lost += len(entries)
                trouble = error.strerror or str(error)
        trouble = self._sync() or trouble
        gone = self.dropped + self.lost
        if trouble is None and gone > self._counted:
            trouble = "the disk is too slow"
        if trouble is not None and self._trouble is None:
            self._news.append(
                f"not recording: {trouble}; steering goes on, make room on the disk or mend it"
            )
            self._trouble = trouble
        elif trouble is None and self._trouble is not None and batches:
            self._news.append(f"recording again, {gone} entries lost: nothing to do")
            self._trouble = None
        self._counted = gone

    def _sync(self) -> str | None:
        """Sync the files once a second; return the reason of a failure, or None."""
        self._since_sync_s += self._write_s
        if self._since_sync_s < SYNC_S:
            return None
        self._since_sync_s = 0.0
        trouble = None
        for file, written in self._files.items():
            if written:
                try:
                    file.sync()
                    self._files[file] = False
                except OSError as error:
                    trouble = error.strerror or str(error)
        return trouble


FORMAT, VERSION = "vfguide-recording", 1

DESCRIPTION_NAME = "recording.json"
MISSION_NAME = "mission.yaml"

LONGEST_DESCRIPTION = 64 * 1024
"""Maximum size of a description, bytes."""

MOST_STARTS = 1000
"""Maximum starts of one vehicle within one second; more indicate a faulty directory."""

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
"""Linux file whose content changes with each boot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingStart:
    """Identity and clocks of a recording at its start."""

    vehicle: str
    mission: str
    system_id: int
    """MAVLink system ID of the vehicle."""
    unix_s: float
    """Time of day at the start, s since 1970."""
    clock_s: float
    """Companion's own clock at that moment, s."""
    computer: str
    """Identifies one boot of one computer; its monotonic clocks are comparable."""
    program: str
    """Version of vfguide."""

    def to_unix(self, clock_s: float) -> float:
        """Convert a time of the companion's own clock to s since 1970, using both clocks at the start."""
        return self.unix_s + (clock_s - self.clock_s)


class Recording:
    """Records a companion's frames, guidance steps and events in flight without waiting for the disk."""

    def __init__(self, directory: Path, start: RecordingStart) -> None:
        """Open the files in an empty directory.

        Raises:
            OSError: the directory cannot be written to.
        """
        self.directory = directory
        self.start = start
        tlog, guidance = files_of(directory, start.vehicle)
        self._tlog, self._guidance = GrowingFile(tlog), GrowingFile(guidance)
        self._guidance.append(STEPS.header)
        self._events = GrowingFile(part_of(directory, start.vehicle, EVENTS_SUFFIX))
        self._events.append(EVENTS.header)
        self._response = GrowingFile(part_of(directory, start.vehicle, RESPONSE_SUFFIX))
        self._response.append(RESPONSES.header)
        self._flown: VehicleResponse | None = None
        self._writer = DiskWriter()

    def add_datagram(self, now: float, datagram: bytes) -> None:
        """Record a datagram that passed at a time of the companion's clock, s."""
        self._writer.put(self._tlog, partial(stamped, self.start.to_unix(now), datagram))

    def add_step(self, step: GuidanceStep) -> None:
        """Record a guidance step."""
        self._writer.put(self._guidance, partial(encode_step, step))

    def add_event(self, event: FlightEvent, formation_time_s: float) -> None:
        """Record an event, with its time on the formation's clock, s."""
        self._writer.put(self._events, partial(encode_event, event, formation_time_s))

    def add_response(self, now: float, response: VehicleResponse | None) -> None:
        """Record the vehicle's assumed response from a time of the companion's clock on, s, if it changed."""
        if response is not None and response != self._flown:
            self._flown = response
            self._writer.put(self._response, partial(RESPONSES.encode, response, time_s=now))

    def news(self) -> list[str]:
        """Return new messages about the recording since the last call, one line each."""
        return self._writer.news()

    def close(self) -> int:
        """Write waiting entries; return the number of entries missing from the recording."""
        self._writer.close()
        return self._writer.missing


def begin_recording(parent: Path, mission: Mission, vehicle: str, *, clock_s: float) -> Recording:
    """Begin a recording in a new directory below `parent`, at a time of the companion's clock, s.

    Raises:
        InputError: the directory cannot be written to.
    """
    start = RecordingStart(
        vehicle=vehicle,
        mission=mission.name,
        system_id=mission.vehicles[vehicle].system_id,
        unix_s=time.time(),
        clock_s=clock_s,
        computer=run_of_computer(),
        program=version("vfguide"),
    )
    content = mission.model_dump(mode="json", exclude_unset=True)
    text = json.dumps({"format": FORMAT, "version": VERSION, **asdict(start)}, indent=2)
    directory = None
    try:
        parent.mkdir(parents=True, exist_ok=True)
        directory = new_directory(parent, start)
        write_synced(directory / MISSION_NAME, yaml.safe_dump(content, sort_keys=False))
        write_synced(directory / DESCRIPTION_NAME, text + "\n")
        return Recording(directory, start)
    except OSError as error:
        if directory is not None:
            # The directory of a failed start would be taken for a recording.
            shutil.rmtree(directory, ignore_errors=True)
        reason = "it is a file" if isinstance(error, FileExistsError) else error.strerror
        raise InputError(
            f"{parent}: cannot be recorded to ({reason}); "
            "give another directory with --record, or make room in this one"
        ) from error


def new_directory(parent: Path, start: RecordingStart) -> Path:
    """Create a directory with a unique name for the start."""
    moment = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(start.unix_s))
    name = f"{file_stem(start.vehicle)}-{moment}"
    for number in range(1, MOST_STARTS):
        directory = parent / (name if number == 1 else f"{name}-{number}")
        try:
            directory.mkdir()
        except FileExistsError:
            if parent.is_dir():
                continue
            raise
        return directory
    raise OSError(f"holds {MOST_STARTS} starts of one second")


def write_synced(path: Path, text: str) -> None:
    """Write a new file and sync it to the disk.

    Raises:
        OSError: the file exists, or the write fails.
    """
    file = GrowingFile(path)
    try:
        file.append(text.encode())
        file.sync()
    finally:
        file.close()


def file_stem(vehicle: str) -> str:
    """Return a vehicle's name in a form valid as the beginning of a file name."""
    return quote(vehicle, safe=" !'()+,;=@&") if vehicle.strip(".") else quote(vehicle + "_")


def run_of_computer() -> str:
    """Return the boot ID of this computer; empty if the system has none."""
    try:
        return BOOT_ID.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return ""


def is_recording(directory: Path) -> bool:
    """Check whether the directory holds a recording."""
    return (directory / DESCRIPTION_NAME).is_file()


def find_recordings(directories: Iterable[Path]) -> list[Path]:
    """Return the recordings in the directories and up to two levels below, in order."""
    found: dict[Path, None] = {}
    for directory in directories:
        for pattern in ("", "*/", "*/*/"):
            for path in sorted(directory.glob(pattern + DESCRIPTION_NAME)):
                found[path.parent] = None
    return list(found)


def read_start(directory: Path) -> RecordingStart:
    """Read the identity and clocks of a recording.

    Raises:
        InputError: the directory holds no recording that this program reads.
    """
    path = directory / DESCRIPTION_NAME
    try:
        with open_regular(path) as file:
            content = json.loads(file.read(LONGEST_DESCRIPTION))
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror or error}; give another recording's directory"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no recording, or a damaged one") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{path}: is no recording: its format is not {FORMAT}")
    if content.get("version") != VERSION:
        told = content.get("version")
        raise InputError(
            f"{path}: is a recording of version {told!r:.20}, this program reads {VERSION}"
        )
    try:
        start = msgspec.convert(content, RecordingStart)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: is a damaged recording: {error}") from error
    if not (math.isfinite(start.unix_s) and math.isfinite(start.clock_s)):
        raise InputError(f"{path}: is a damaged recording: a time is none")
    return start


def files_of(directory: Path, vehicle: str) -> tuple[Path, Path]:
    """Return the paths of the (telemetry log, guidance log) of a recording."""
    return part_of(directory, vehicle, ".tlog"), part_of(directory, vehicle, SUFFIX)


def part_of(directory: Path, vehicle: str, suffix: str) -> Path:
    """Return the path of a recording's file by its suffix."""
    return directory / f"{file_stem(vehicle)}{suffix}"


def parts_of(parent: Path, vehicle: str, suffix: str) -> list[Path]:
    """Return the files with a suffix of all starts of a vehicle below a directory."""
    return sorted(parent.glob(f"*/{file_stem(vehicle)}{suffix}"))
