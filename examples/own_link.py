"""A link of one's own: Unix datagram sockets in a directory, for programs of one computer.

    vfguide fly circle-wind --live --link unix:///tmp/formation --plugin own_link.py

Each member has a socket of its own there, and sends to all others. Such a link needs no port and no network:
whom it lets in, the rights of the directory decide. Messages are signed as on every link.
"""

import asyncio
import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from urllib.parse import SplitResult

from vfguide.errors import InputError
from vfguide.link import DatagramCarrier, LinkAddress, link

LARGEST = 65536


@dataclass(frozen=True, slots=True, kw_only=True)
class UnixAddress(LinkAddress):
    """A directory with a socket for each member."""

    scheme: ClassVar[str] = "unix"

    directory: Path

    def __str__(self) -> str:
        return f"unix://{self.directory}"


@link("unix")
class UnixCarrier(DatagramCarrier):
    """Carries messages by Unix sockets."""

    address: UnixAddress

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> UnixAddress:
        """The directory that comes behind unix://."""
        del environment
        if parts.netloc or not parts.path.strip("/"):
            raise InputError("a unix link has an absolute directory; write unix:///tmp/formation")
        return UnixAddress(directory=Path(parts.path))

    def open(self) -> None:
        """Make the own socket."""
        self.address.directory.mkdir(exist_ok=True)
        self._own = self.address.directory / f"{self._member.name}-{os.getpid()}"
        self._own.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(str(self._own))
        asyncio.get_running_loop().add_reader(self._socket, self._read)

    def close(self) -> None:
        """Take it away again."""
        asyncio.get_running_loop().remove_reader(self._socket)
        self._socket.close()
        self._own.unlink(missing_ok=True)

    def transmit(self, data: bytes) -> None:
        """Send to everybody else."""
        for other in self.address.directory.iterdir():
            # One that has just left, or does not read, misses it.
            with suppress(ConnectionRefusedError, FileNotFoundError, BlockingIOError):
                if other != self._own:
                    self._socket.sendto(data, str(other))

    def _read(self) -> None:
        with suppress(BlockingIOError):
            self.arrived(self._socket.recv(LARGEST))
