"""Serial ports without hardware: pseudo terminals."""

import os
from pathlib import Path


class Plug:
    """A serial port as the autopilot's end of a pseudo terminal, that can be pulled out and put back."""

    def __init__(self, name: Path) -> None:
        self.address = f"serial://{name}:57600"
        self._name = name
        self._near: int | None = None

    @property
    def near(self) -> int:
        assert self._near is not None
        return self._near

    def put_in(self) -> None:
        self._near, far = os.openpty()
        os.set_blocking(self._near, False)
        self._name.symlink_to(os.ttyname(far))
        os.close(far)

    def pull_out(self) -> None:
        if self._near is not None:
            # Whoever is told that the line is dead finds no port of this name any more.
            self._name.unlink()
            os.close(self._near)
            self._near = None

    def taken(self) -> bytes:
        """What has come out so far."""
        try:
            return os.read(self.near, 4096)
        except BlockingIOError:
            return b""
