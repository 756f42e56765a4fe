"""Link over Zenoh (https://zenoh.io): peers find each other, with or without a router in between.

Zenoh itself finds a peer that went away and came back. Signatures, freshness and clocks are handled above it,
as on every link; its own encryption is not used.
"""

import asyncio
import json
import re
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import Any, ClassVar
from urllib.parse import SplitResult, parse_qsl

from vfguide.errors import InputError, import_extra
from vfguide.link.carrier import MOST_AT_ONCE, DatagramCarrier, LinkAddress, link
from vfguide.link.codec import LARGEST, formation_number

EXAMPLE = "zenoh://10.0.0.2:7447?listen=0.0.0.0:7447, or zenoh:// where multicast finds the others"

ENDPOINT = re.compile(r"[A-Za-z0-9._-]{1,253}:([0-9]{1,5})", re.ASCII)

MOST_WAITING = 256
"""Maximum number of messages waiting for the event loop; beyond it the oldest are lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenohAddress(LinkAddress):
    """Endpoints of Zenoh peers."""

    scheme: ClassVar[str] = "zenoh"

    peers: tuple[str, ...] = ()
    """HOST:PORT of peers or routers; empty where multicast finds them."""
    listen: str = ""
    """HOST:PORT on which others can connect; empty for any free port."""

    def __str__(self) -> str:
        return "zenoh://" + ",".join(self.peers) + (f"?listen={self.listen}" if self.listen else "")


@link("zenoh")
class ZenohCarrier(DatagramCarrier):
    """Carrier over Zenoh."""

    address: ZenohAddress

    def prepare(self) -> None:
        """Load Zenoh; raise VfguideError if it is not installed."""
        super().prepare()
        self._zenoh = import_extra("zenoh")
        # A number, since a formation's name may contain characters that a key cannot.
        self._key = f"vfguide/{formation_number(self._formation):016x}"
        self._session: Any = None
        self._publisher: Any = None
        self._waiting: deque[bytes] = deque(maxlen=MOST_WAITING)
        self._passed_over = 0
        self._lock = Lock()

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> ZenohAddress:
        """Build an address such as zenoh://10.0.0.2:7447?listen=0.0.0.0:7447; multicast finds all others."""
        del environment
        options = dict(parse_qsl(parts.query, keep_blank_values=True))
        if parts.fragment or parts.path.strip("/") or not set(options) <= {"listen"}:
            raise InputError(f"a Zenoh link has peers, and after the ? listen=; write {EXAMPLE}")
        peers = tuple(filter(None, parts.netloc.split(",")))
        for endpoint in (*peers, *options.values()):
            found = ENDPOINT.fullmatch(endpoint)
            if found is None or not 0 < int(found[1]) < 2**16:
                raise InputError(f"a Zenoh peer is HOST:PORT; write {EXAMPLE}")
        return ZenohAddress(peers=peers, listen=options.get("listen", ""))

    def open(self) -> None:
        """Open a session; Zenoh keeps calling peers that are not there yet."""
        zenoh, loop = self._zenoh, asyncio.get_running_loop()
        try:
            self._session = zenoh.open(self._config())
            remote = zenoh.Locality.REMOTE
            self._session.declare_subscriber(
                self._key,
                lambda sample: self._hear(loop, bytes(sample.payload)),
                allowed_origin=remote,
            )
            self._publisher = self._session.declare_publisher(
                self._key,
                congestion_control=zenoh.CongestionControl.DROP,
                express=True,
                allowed_destination=remote,
            )
        except zenoh.ZError as error:
            self.close()
            raise OSError(str(error)) from error

    def close(self) -> None:
        """Close the session."""
        session, self._session, self._publisher = self._session, None, None
        if session is not None:
            session.close()

    def transmit(self, data: bytes) -> None:
        """Send to all peers."""
        if self._publisher is not None:
            self._publisher.put(data)

    def _config(self) -> Any:  # noqa: ANN401 - Zenoh's own
        """Return a peer's configuration, with multicast scouting if the address names no endpoint."""
        config = self._zenoh.Config()
        settings: dict[str, object] = {
            "mode": "peer",
            "scouting/multicast/enabled": not self.address.peers and not self.address.listen,
            "scouting/delay": 0,
            "connect/endpoints": [f"tcp/{peer}" for peer in self.address.peers],
            "connect/exit_on_failure": False,
            "connect/timeout_ms": 0,
        }
        if self.address.listen:
            settings["listen/endpoints"] = [f"tcp/{self.address.listen}"]
        for name, value in settings.items():
            config.insert_json5(name, json.dumps(value))
        return config

    def _hear(self, loop: asyncio.AbstractEventLoop, data: bytes) -> None:
        """Take a message in Zenoh's thread."""
        with self._lock:
            first = not self._waiting
            self._passed_over += len(self._waiting) == MOST_WAITING
            # One byte more than any message shows that it is too long.
            self._waiting.append(data[: LARGEST + 1])
        if first:
            # The loop may have ended meanwhile.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._hand_over)

    def _hand_over(self) -> None:
        """Take waiting messages in the event loop, a limited number at a time."""
        with self._lock:
            number = min(len(self._waiting), MOST_AT_ONCE)
            waiting = [self._waiting.popleft() for _ in range(number)]
            if self._waiting:
                asyncio.get_running_loop().call_soon(self._hand_over)
            passed_over, self._passed_over = self._passed_over, 0
        if passed_over:
            self.status.counters["dropped: too many at once"] += passed_over
        for data in waiting:
            self.arrived(data)
