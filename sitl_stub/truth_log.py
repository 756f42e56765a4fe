"""True states as JSON lines, for a judge of the flight: into a file, or one datagram each."""

import json
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from sitl_stub.address import AddressError, parse_address
from sitl_stub.options import OptionError
from sitl_stub.truth import Truth

MAX_RATE_HZ = 1000.0

BEGINNING = b'{"system_id": '
"""Of every line."""

Write = Callable[[bytes], object]
"""Takes one line; each reaches its reader whole."""


class TruthLog:
    """When the next sample is due, and where it goes."""

    def __init__(self, write: Write, *, rate_hz: float, system_id: int) -> None:
        self._write = write
        self._rate_hz = rate_hz
        self._system_id = system_id
        self._samples = 0

    @property
    def next_due_s(self) -> float:
        """Simulation time of the next sample: a multiple of 1 / rate, in whole microseconds."""
        return round(self._samples * 1e6 / self._rate_hz) * 1e-6

    def sample(self, truth: Truth) -> None:
        """Write one sample down."""
        self._samples += 1
        fields = asdict(truth)
        # Whole microseconds: without the last digits of their conversion to seconds.
        fields["time_s"] = round(truth.time_s, 6)
        line = json.dumps({"system_id": self._system_id, **fields}, allow_nan=False)
        self._write(line.encode() + b"\n")


@contextmanager
def truth_target(target: str | None, *, rate_hz: float) -> Iterator[Write | None]:
    """How to write into `udpout://host:port` or a file, open as long as its context lasts.

    A file of earlier true states is overwritten, any other is not.

    Raises:
        AddressError: on entering, the target cannot be written to; the message is one line.
        OptionError: on entering, the rate is out of its range.
    """
    if target is None:
        yield None
        return
    if not 0.0 < rate_hz <= MAX_RATE_HZ:
        raise OptionError(f"truth rate {rate_hz:g} Hz is not above 0 and at most {MAX_RATE_HZ:g}")
    with datagrams(target) if "://" in target else lines(Path(target)) as write:
        yield write


@contextmanager
def lines(path: Path) -> Iterator[Write]:
    """Each line reaches the file whole and at once, so that it is readable whenever this ends."""
    try:
        if path.is_file() and not begins_like_truth(path):
            raise AddressError(
                f"{str(path)!r}: is there already, and holds no true states; remove it, or name another file"
            )
        file = path.open("wb", buffering=0)
    except OSError as error:
        raise AddressError(f"{str(path)!r}: cannot be written to ({error.strerror})") from error
    with file:
        yield file.write


def begins_like_truth(path: Path) -> bool:
    """Whether a file is empty, or begins as one that was written here, whole or cut off.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        return BEGINNING.startswith(file.read(len(BEGINNING)))


@contextmanager
def datagrams(url: str) -> Iterator[Write]:
    """One datagram for each line, whether anybody listens or not."""
    address = parse_address(url)
    if address.scheme != "udpout":
        raise AddressError(f"{url!r}: true states go to udpout://host:port or into a file")
    try:
        family, _, _, _, peer = socket.getaddrinfo(
            address.host, address.port, type=socket.SOCK_DGRAM
        )[0]
    except socket.gaierror as error:
        raise AddressError(f"{url!r}: {str(error.strerror).lower()}") from error

    def send(line: bytes) -> None:
        try:
            channel.sendto(line, peer)
        except OSError:
            # Full or unreachable now: a sample is lost, as any datagram may be.
            return

    with socket.socket(family, socket.SOCK_DGRAM) as channel:
        channel.settimeout(0.0)
        yield send
