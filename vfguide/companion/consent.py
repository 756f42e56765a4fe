"""Whether a vehicle may still be engaged by itself, and who steers it: facts that outlive the process."""

import json
import os
import stat
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

import msgspec
from msgspec.structs import asdict

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
            consent = parse(content_of(self._file))
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
            new = self._file.with_suffix(".new")
            # What lies there may be of a crash, or a pipe that would block.
            new.unlink(missing_ok=True)
            with new.open("x", encoding="utf-8") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            new.replace(self._file)
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


def content_of(file: Path) -> bytes:
    """The first bytes of a file, at once: a pipe in its place would wait for a writer.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no file.
    """
    handle = os.open(file, os.O_RDONLY | os.O_NONBLOCK)
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise ValueError("no file")
        return os.read(handle, MOST_BYTES)
    finally:
        os.close(handle)


def parse(content: bytes) -> Consent:
    """A consent as it was written.

    Raises:
        ValueError: it is none.
    """
    try:
        record = json.loads(content.decode("utf-8"))
    except RecursionError as error:
        raise ValueError("no record of consent") from error
    if not isinstance(record, dict) or record.get("version") != VERSION:
        raise ValueError("no record of consent")
    # Records of former versions do not say who steers.
    spent, steered = record.get("spent"), record.get("steered", False)
    if not isinstance(spent, str) or not isinstance(steered, bool):
        raise ValueError("no record of consent")  # noqa: TRY004 - of the file, not of the program
    return Consent(spent=spent, steered=steered)


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
