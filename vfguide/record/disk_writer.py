"""Files that grow while an aircraft flies, written by a thread of its own: a control loop waits for no disk.

Every file is append-only. What a power failure or `kill -9` leaves is whole up to the last second. A file
that could take only a part of what was to be written is cut back to what was whole before.
"""

import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

WRITE_S = 0.2
"""s between two writes to the files."""

SYNC_S = 1.0
"""s between two requests that the disk itself has everything."""

LONGEST_QUEUE = 10_000
"""Entries that wait for a slow disk: two minutes of a busy connection. More are dropped, and counted."""

CLOSING_S = 5.0
"""s that a disk gets for the last entries before the program ends without them."""


class GrowingFile:
    """One file that is only ever appended to."""

    def __init__(self, path: Path) -> None:
        """Create it.

        Raises:
            OSError: it exists, or cannot be created.
        """
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        self._size = 0

    def append(self, content: bytes) -> None:
        """Write all of it, or nothing.

        Raises:
            OSError: the disk does not take it.
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
        """Have the disk itself keep what was written.

        Raises:
            OSError: it does not.
        """
        os.fsync(self._descriptor)

    def close(self) -> None:
        """No more will come."""
        with suppress(OSError):
            os.close(self._descriptor)


class DiskWriter:
    """Takes entries without waiting, and writes them within a second.

    One thread puts, the writer's own thread takes. Encoding is left to the writer.
    """

    def __init__(self, *, longest_queue: int = LONGEST_QUEUE, write_s: float = WRITE_S) -> None:
        """Begin to write what will be put.

        Args:
            longest_queue: entries that may wait.
            write_s: between two writes, s.
        """
        self.dropped = 0
        """Entries that found the queue full."""
        self.lost = 0
        """Entries that the disk did not take."""
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
        """Have an entry written. Never waits and never raises.

        Args:
            file: where it goes.
            encode: makes its bytes, in the writer's thread.
        """
        if len(self._queue) >= self._longest:
            self.dropped += 1
        else:
            self._queue.append((file, encode))

    def news(self) -> list[str]:
        """What has happened since the last call that an operator should know; one line each."""
        found = []
        while self._news:
            found.append(self._news.popleft())
        return found

    def close(self) -> None:
        """Write what waits and end; without it if the disk does not answer for some seconds."""
        self._closing.set()
        self._thread.join(CLOSING_S)

    @property
    def missing(self) -> int:
        """Entries that are in no file, and will not be."""
        return self.dropped + self.lost + len(self._queue)

    def _run(self) -> None:
        while not self._closing.wait(self._write_s):
            self._write()
        self._since_sync_s = SYNC_S
        self._write()
        for file in self._files:
            file.close()

    def _write(self) -> None:
        """Write everything that waits, and tell when that begins or ceases to fail."""
        batches: dict[GrowingFile, list[bytes]] = {}
        for _ in range(len(self._queue)):
            file, encode = self._queue.popleft()
            batches.setdefault(file, []).append(encode())
        trouble: str | None = None
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
        """Once a second have the disk keep what was written; why it does not, or None."""
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
