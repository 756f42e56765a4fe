"""MQTT broker client: address, connection with bounded opening and closing times, newest messages, echoes.

A broker that hears this vehicle returns the vehicle's own states. A broker whose access list forbids a topic
silently drops messages for it. Another vehicle may also fly under the same name by mistake. Hearing its own
states costs a vehicle as much processor time as sending, so it listens only briefly and now and then.
"""

import asyncio
import logging
import re
import selectors
import socket
import ssl
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar
from urllib.parse import SplitResult, parse_qsl, unquote

from aiomqtt import Client, Message, MqttCodeError, MqttError, Will
from aiomqtt.types import PahoSocket
from paho.mqtt.client import MQTT_ERR_SUCCESS
from paho.mqtt.client import Client as Engine

from vfguide.errors import InputError
from vfguide.link.carrier import EXAMPLE, LinkAddress
from vfguide.link.codec import LARGEST
from vfguide.system import URGENT_TCP, SocketSelector, checked_host

ENVIRONMENT_VARIABLE = "VFGUIDE_LINK_PASSWORD"
"""Environment variable of the password, which process lists do not show."""

DEFAULT_PREFIX = "vfguide"

LONGEST_PREFIX = 200
"""Maximum length of the topic prefix, characters."""

PORTS = {"mqtt": 1883, "mqtts": 8883}
"""Default ports by scheme."""

OPTIONS = ("ca", "cert", "key")
"""Options with which an mqtts:// address names files."""

SECURE_EXAMPLE = "mqtts://USER@HOST:8883/PREFIX?ca=FILE&cert=FILE&key=FILE"

MOST_TOPICS = 256
"""Maximum number of topics with unread messages: more than vehicles in any formation."""

MOST_TURNS = 256
"""Maximum number of reads before a message is used: a flood must not block everything else."""

REMEMBERED = 256
"""Number of own states remembered while they travel to the broker and back: some seconds of them."""

DEAF_CHECKS = 2
"""Consecutive checks with states sent and none heard that rule out a mere delay."""

KEEPALIVE_S = 2
"""Silence of the broker after which it is pinged, s."""

DIAL_S = 2.0
"""Timeout of the TCP connection, and again of TLS, s."""

ANSWER_S = 1.5
"""Timeout of each answer of the broker, s."""

UNTRUSTED = re.compile(r"CERTIFICATE_VERIFY_FAILED\].*?: (?P<why>.*?)( \(_ssl\.c:\d+\))?$")

NUMBERED = re.compile(r"^\[(Errno -?\d+|SSL: \w+|SSL)\] *| \(_ssl\.c:\d+\)$")

ALERT = re.compile(r"\[SSL: \w*ALERT\w*\] \w+ alert (?P<what>.*?)( \(_ssl\.c:\d+\))?$")

REMEDY = "start a broker there, or correct the address of the link"

REFUSALS = (134, 135)
"""MQTT codes "bad user name or password" and "not authorized": brokers use either for a wrong password."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MqttAddress(LinkAddress):
    """Address of a broker, and the credentials of its client."""

    scheme: ClassVar[str] = "mqtt"

    host: str
    """Host name or IP address, without brackets."""
    port: int
    """TCP port, 1 to 65535."""
    prefix: str = DEFAULT_PREFIX
    """First levels of every topic."""
    secure: bool = False
    """Whether the connection is encrypted and the broker's certificate checked."""
    user: str | None = None
    """User name, if the broker requires one."""
    password: str | None = field(default=None, repr=False)
    """Password of the user. Never shown."""
    ca: Path | None = None
    """CA certificates that vouch for the broker; None for those of this computer."""
    cert: Path | None = None
    """Client certificate, if the broker requires one."""
    key: Path | None = None
    """Private key of the client certificate."""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        scheme = "mqtts" if self.secure else "mqtt"
        return f"{scheme}://{host}:{self.port}/{self.prefix}"


def mqtt_address(parts: SplitResult, environment: Mapping[str, str]) -> MqttAddress:
    """Build a broker address from a URL such as mqtts://USER@HOST:8883/PREFIX?ca=FILE.

    Raises:
        InputError: the address is invalid.
    """
    if parts.fragment:
        raise InputError("a # is not possible here; write %23 for one in a user name or password")
    secure = parts.scheme == "mqtts"
    user, password = _credentials(parts, environment)
    files = _files(parts.query, secure=secure)
    return MqttAddress(
        host=_host(parts),
        port=_port(parts),
        prefix=_prefix(parts.path),
        secure=secure,
        user=user,
        password=password,
        ca=files.get("ca"),
        cert=files.get("cert"),
        key=files.get("key"),
    )


def _host(parts: SplitResult) -> str:
    text = parts.hostname or ""
    if not text:
        raise InputError(f"the host is missing; write {EXAMPLE}")
    return checked_host(f"[{text}]" if ":" in text else text)


def _port(parts: SplitResult) -> int:
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port is None:
        return PORTS[parts.scheme]
    if port == 0:
        raise InputError(
            f"the port must be within 1 to 65535; write {EXAMPLE}, "
            "and %2F, %3A, %40 for / : @ in a user name or password"
        )
    return port


def _prefix(path: str) -> str:
    text = unquote(path).strip("/")
    if not text:
        return DEFAULT_PREFIX
    sound = text.isprintable() and len(text) <= LONGEST_PREFIX and not text.startswith("$")
    if not sound or any(mark in text for mark in "+#") or "//" in text:
        raise InputError("the prefix cannot begin a topic; write levels such as /team/north")
    return text


def _credentials(
    parts: SplitResult, environment: Mapping[str, str]
) -> tuple[str | None, str | None]:
    if parts.username is None:
        return None, None
    user = unquote(parts.username)
    if not user or not user.isprintable():
        raise InputError(f"the user name is missing; write {SECURE_EXAMPLE}")
    if parts.password is None:
        return user, environment.get(ENVIRONMENT_VARIABLE)
    return user, unquote(parts.password)


def _files(query: str, *, secure: bool) -> dict[str, Path]:
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=True) if query else []
    except ValueError:
        raise InputError(f"what follows the ? is not understood; write {SECURE_EXAMPLE}") from None
    names = [name for name, _ in pairs]
    if not set(names) <= set(OPTIONS) or len(set(names)) < len(names):
        raise InputError(f"after the ? come ca=, cert= and key=, once each; write {SECURE_EXAMPLE}")
    if pairs and not secure:
        raise InputError(f"certificates go with mqtts://; write {SECURE_EXAMPLE}")
    if ("cert" in names) != ("key" in names):
        raise InputError(f"cert= and key= go together; write {SECURE_EXAMPLE}")
    if not all(value and value.isprintable() for _, value in pairs):
        raise InputError(f"a file name is missing; write {SECURE_EXAMPLE}")
    return {name: Path(value) for name, value in pairs}


class NewestOnly:
    """Queue of the newest message per topic: a newer message replaces an unread one."""

    def __init__(self, replaced: Callable[[], None]) -> None:
        """Create an empty queue; `replaced` is called for a message lost to a newer one or lack of room."""
        self._newest: dict[str, bytes] = {}
        self._replaced = replaced
        self._filled = asyncio.Event()

    def __len__(self) -> int:
        return len(self._newest)

    def put(self, topic: str, payload: bytes) -> None:
        """Add a message. A topic keeps the place of its first unread message."""
        if topic in self._newest:
            self._replaced()
        elif len(self._newest) >= MOST_TOPICS:
            self._replaced()
            return
        self._newest[topic] = payload
        self._filled.set()

    def take(self) -> tuple[str, bytes] | None:
        """Take the newest message of the topic that has waited longest; None if there is none."""
        if not self._newest:
            self._filled.clear()
            return None
        topic = next(iter(self._newest))
        return topic, self._newest.pop(topic)

    def clear(self) -> None:
        """Drop all messages."""
        self._newest.clear()
        self._filled.clear()

    async def wait(self) -> None:
        """Wait until there is a message to take."""
        while not self._newest:
            self._filled.clear()
            await self._filled.wait()


class Inbox:
    """Messages that the broker has delivered and nobody has read yet."""

    def __init__(self, counters: Counter[str]) -> None:
        self._counters = counters
        self.mail = NewestOnly(lambda: counters.update(["superseded by a newer one"]))
        """Newest unread message of each topic."""

    def deliver(self, message: Message) -> None:
        """Take a message from the network."""
        if len(message.payload) > LARGEST:
            self._counters["dropped: too long"] += 1
        else:
            self.mail.put(message.topic.value, message.payload)

    async def settle(self, has_more: Callable[[], bool]) -> None:
        """Wait for a message, then until the socket has nothing more to read at this moment.

        The client reads one message per turn of the event loop. A reader slower than the sender's interval
        would otherwise fall behind for ever, with a backlog inside the kernel.

        Args:
            has_more: whether unread data have arrived.
        """
        await self.mail.wait()
        for _ in range(MOST_TURNS):
            # Asking costs less than a turn of the event loop, and nearly always there is nothing more.
            if not has_more():
                return
            # The socket is polled in the first turn and has been read by the second.
            await asyncio.sleep(0)
            await asyncio.sleep(0)

    def as_queue(self) -> type[asyncio.Queue[Message]]:
        """Return a queue class for a client whose messages all end up in this inbox."""
        deliver = self.deliver

        class Delivered(asyncio.Queue[Message]):
            def put_nowait(self, item: Message) -> None:
                deliver(item)

        return Delivered


class Echo:
    """Own states as sent, compared with those that the broker returns."""

    def __init__(self) -> None:
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)
        self._speaks = False
        self._deaf = 0
        self.heard = False
        """Whether a state has come back since listening began."""

    def listen(self) -> None:
        """Begin to listen for own states."""
        self._speaks = self.heard = False
        self._deaf = 0

    def speak(self, data: bytes) -> None:
        """Note a published state."""
        self._sent.append(data)
        self._speaks = True

    def hear(self, data: bytes) -> bool:
        """Take a state under the own name from the broker, and return whether this vehicle sent it."""
        if data not in self._sent:
            return False
        self.heard = True
        return True

    def check(self) -> bool:
        """Check whether the broker is deaf to this vehicle; call about once a second while listening."""
        self._deaf = self._deaf + 1 if self._speaks and not self.heard else 0
        self._speaks = False
        return self._deaf >= DEAF_CHECKS


class LastWords(logging.Logger):
    """Logger of one client that keeps the MQTT engine's last line, the only trace of a hang-up's reason."""

    def __init__(self) -> None:
        super().__init__("mqtt", logging.WARNING)
        self._text = ""

    def handle(self, record: logging.LogRecord) -> None:
        """Keep a log line."""
        self._text = record.getMessage()

    def reason(self) -> str:
        """Explain why the connection was closed."""
        alert = ALERT.search(self._text)
        if alert is None:
            return "the broker closed the connection without a word"
        return f"the broker does not accept this client's certificate: {alert['what']}"


class BrokerClient(Client):
    """Client of aiomqtt for one connection that also closes what aiomqtt leaves open."""

    def __init__(
        self,
        address: MqttAddress,
        *,
        identifier: str,
        will: Will | None,
        queue: type[asyncio.Queue[Message]],
        context: ssl.SSLContext | None,
    ) -> None:
        self._last_words = LastWords()
        super().__init__(
            address.host,
            address.port,
            username=address.user,
            password=address.password,
            identifier=identifier,
            queue_type=queue,
            will=will,
            timeout=ANSWER_S,
            keepalive=KEEPALIVE_S,
            tls_context=context,
            socket_options=URGENT_TCP,
            logger=self._last_words,
        )
        # aiomqtt does not pass its timeout to the engine that dials.
        self._client.connect_timeout = DIAL_S
        self._gone = asyncio.Event()
        self._client.on_socket_close = self._noting(self._client.on_socket_close)
        self._client.on_socket_register_write = self._wait_to_write
        self._thread = threading.get_ident()

    def _wait_to_write(self, engine: Engine, _userdata: object, sock: PahoSocket) -> None:
        """Watch for room to write, one turn of the event loop later."""
        if threading.get_ident() == self._thread:
            self._loop.call_soon(self._watch, engine, sock)
        else:
            # Dialling runs in a thread of its own.
            self._loop.call_soon_threadsafe(self._watch, engine, sock)

    def _watch(self, engine: Engine, sock: PahoSocket) -> None:
        # By now all may be written or the socket closed; aiomqtt's own way fails on a closed socket.
        if sock.fileno() >= 0 and engine.want_write():
            self._loop.add_writer(sock.fileno(), self._write, engine)

    def _write(self, engine: Engine) -> None:
        try:
            engine.loop_write()
        except OSError as error:
            if not self._disconnected.done():
                self._disconnected.set_exception(error)

    def _noting(
        self, close: Callable[[Engine, object, PahoSocket], None] | None
    ) -> Callable[[Engine, object, PahoSocket], None]:
        """Wrap a socket-close callback to note afterwards that the socket is closed."""

        def closing(engine: Engine, userdata: object, sock: PahoSocket) -> None:
            if close is not None:
                close(engine, userdata, sock)
            # Dialling runs in a thread of its own.
            self._loop.call_soon_threadsafe(self._gone.set)

        return closing

    async def send(self, topic: str, payload: bytes) -> None:
        """Publish once, unacknowledged: at once, or when the socket has room.

        Raises:
            MqttError: the connection is lost, or the socket stays full.
        """
        engine = self._client
        if engine.want_write():
            await self.publish(topic, payload)
            return
        # For a waiting task the engine makes up an answer of the broker, which costs more than sending.
        waiting, engine.on_publish = engine.on_publish, None
        try:
            result = engine.publish(topic, payload).rc
            engine.loop_write()
        finally:
            engine.on_publish = waiting
        if result != MQTT_ERR_SUCCESS:
            raise MqttCodeError(result, "cannot publish")

    async def open(self) -> None:
        """Connect. Do not cancel: it ends by itself after some seconds at most.

        Raises:
            MqttError: the connection failed; everything is closed again.
        """
        entering = asyncio.ensure_future(self.__aenter__())
        gone = asyncio.ensure_future(self._gone.wait())
        await asyncio.wait({entering, gone}, return_when=asyncio.FIRST_COMPLETED)
        gone.cancel()
        # A broker that refuses says so and closes: let its reason arrive.
        await asyncio.wait({entering}, timeout=0.1)
        if not entering.done():
            entering.cancel()
            await asyncio.wait({entering})
        if entering.cancelled():
            raise MqttError(self._last_words.reason())
        if entering.exception() is not None:
            await self._hang_up()
        await entering

    def has_more(self) -> bool:
        """Check whether data have arrived that the engine has not read yet."""
        sock = self._client.socket()
        if not isinstance(sock, socket.socket) or sock.fileno() < 0:
            return False
        if isinstance(sock, ssl.SSLSocket) and sock.pending():
            return True
        with SocketSelector() as arrived:
            arrived.register(sock, selectors.EVENT_READ)
            return bool(arrived.select(0))

    async def close(self) -> None:
        """Disconnect, politely if that works at once."""
        with suppress(MqttError):
            await self.__aexit__(None, None, None)
        await self._hang_up()

    def give_up(self) -> bool:
        """Shut the connection down; return whether there was a socket."""
        sock = self._client.socket()
        if not isinstance(sock, socket.socket):
            return False
        with suppress(OSError):
            # The engine finds the end of the stream and closes; it has no call to close at once.
            sock.shutdown(socket.SHUT_RDWR)
        return True

    async def _hang_up(self) -> None:
        """Close the socket if it is still open, and wait until it is closed."""
        if not self.give_up():
            return
        with suppress(TimeoutError):
            async with asyncio.timeout(ANSWER_S):
                await self._gone.wait()


class TidySocket(ssl.SSLSocket):
    """TLS socket that closes itself when the handshake fails; the engine would leave it open."""

    def do_handshake(self, *arguments: bool) -> None:
        """Negotiate the cipher and check the certificates."""
        try:
            super().do_handshake(*arguments)
        except BaseException:
            self.close()
            raise


def security_of(address: MqttAddress) -> ssl.SSLContext | None:
    """Return the TLS context of an address; None for an unencrypted connection.

    Raises:
        InputError: a certificate cannot be read.
    """
    if not address.secure:
        return None
    name = address.ca
    try:
        context = ssl.create_default_context(cafile=address.ca)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.sslsocket_class = TidySocket
        if address.cert is not None:
            name = address.cert
            # A key with a pass phrase must not stop a daemon with a question on the terminal.
            context.load_cert_chain(address.cert, address.key, password=lambda: b"")
    except ssl.SSLError:
        what = "certificate" if name == address.ca else "certificate with its unencrypted key"
        raise InputError(f"link {address}: {name} is no {what} in PEM form") from None
    except OSError as error:
        missing = error.filename or name
        raise InputError(f"link {address}: {missing}: {error.strerror}") from None
    return context


def reason_of(error: Exception) -> str:
    """Describe in one line why there is no connection."""
    code = getattr(getattr(error, "rc", None), "value", None)
    if code in REFUSALS:
        return (
            "refused: wrong user name or password, or not allowed; give the password in "
            f"{ENVIRONMENT_VARIABLE} and the user name in the address, or have the broker allow them"
        )
    text = " ".join(str(error).split()) or type(error).__name__
    untrusted = UNTRUSTED.search(text)
    if untrusted:
        return f"the broker's certificate is not trusted: {untrusted['why']}"
    if text in {"Operation timed out", "timed out"}:
        return f"the broker does not answer; {REMEDY}"
    if text == "Disconnected during message iteration":
        return "the connection was lost"
    text = NUMBERED.sub("", text)
    return f"{text}; {REMEDY}" if text == "Connection refused" else text
