"""MAVLink frames: boundaries, signatures, texts in parts, and sequence numbers.

**Frames.** A companion uses few kinds of messages from one sender. The header alone identifies them, which
saves decoding all others: on a busy connection most of the work.

**Signing.** Only a sender with the key is heard. pymavlink signs outgoing packets with a time stamp set here.
Its own advances by 10 µs per packet, so that a restarted program would look like a recording of itself.
Incoming packets are verified here. pymavlink notes a time stamp before it verifies the signature: one forged
packet from the future would shut the true sender out.

**Introduction.** At a UDP port anybody may send. An address becomes the peer, and gets the setpoints, only
after a valid heartbeat of the right system. On a signed connection it has to be signed, too.

**Sequence numbers.** MAVLink counts the frames of each sender, with gaps where some were lost. Two senders
with one name alternate between two series, each of which advances by 1. A frame that comes twice with the
same bytes, as over two links, counts once.
"""

import hashlib
import hmac
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import islice
from struct import Struct

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink, MAVLink_message

from vfguide.errors import InputError
from vfguide.mavlink.reports import TextReport

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
HEADER_1, HEADER_2 = 6, 10
HEADER = Struct("<BBBBBBBHB")
CHECKSUM, SIGNATURE = 2, 13
SIGNED = 0x01

KEY_SIZE = 32

EPOCH_S = 1_420_070_400
"""Unix time of 1 January 2015, at which time stamps are 0, s."""

UNITS_PER_S = 100_000

PATIENCE = 60 * UNITS_PER_S
"""Greatest age of a stream's first packet against this end's time, in units of time stamps."""

LATEST = 2**48 - 1

UNSIGNED = (
    "does not sign: set up signing with the key of --signing-key-file, or leave that option out"
)

OTHER_KEY = "signs with another key than that of --signing-key-file: give both the same"
"""Reasons for which a signed connection fails."""

TIME_STAMP, DIGEST = slice(-12, -6), slice(-6, None)
"""Parts of a signature after the link's number."""

MOST_OTHERS = 64
"""Maximum number of other autopilots at a port that are told apart."""

SILENCE_S = 10.0
"""Silence of a peer after which another address may take its place, s: time for a router to restart."""

SIGNED_SILENCE_S = 1.0
"""The same for signed heartbeats, which nobody else can have sent, s."""


class Frame(msgspec.Struct, frozen=True):
    """MAVLink frame."""

    message_id: int
    system_id: int
    """MAVLink system that the sender claims."""
    component_id: int
    """Component that the sender claims."""
    content: bytes
    """Bytes of the whole frame."""


def frames_of(datagram: bytes) -> Iterator[Frame | None]:
    """Yield frames (MAVLink 1 or 2) in order, checksums unverified, and None for each stretch outside."""
    start, size = 0, len(datagram)
    while start < size:
        end = end_of_frame(datagram, start)
        if end is None or end > size:
            yield None
            start = next_magic(datagram, start + 1)
        else:
            yield frame_at(datagram, start, end)
            start = end


def holds_whole_frames(datagram: bytes) -> bool:
    """Check whether a datagram is nothing but whole frames, by their headers."""
    start, size = 0, len(datagram)
    while start < size:
        end = end_of_frame(datagram, start)
        if end is None or end > size:
            return False
        start = end
    return size > 0


def end_of_frame(datagram: bytes, start: int) -> int | None:
    """Return the end of the frame that begins here, by its header; None if none begins.

    Unknown flags could change the layout, so frames with them are dropped.
    """
    magic, size = datagram[start], len(datagram)
    if magic == MAGIC_2 and start + HEADER_2 <= size:
        flags = datagram[start + 2]
        signature = SIGNATURE if flags & SIGNED else 0
        if not flags & ~SIGNED:
            return start + HEADER_2 + datagram[start + 1] + CHECKSUM + signature
    elif magic == MAGIC_1 and start + HEADER_1 <= size:
        return start + HEADER_1 + datagram[start + 1] + CHECKSUM
    return None


def frame_at(datagram: bytes, start: int, end: int) -> Frame:
    """Return the frame between two places of a datagram."""
    if datagram[start] == MAGIC_1:
        system_id, component_id, message_id = datagram[start + 3 : start + HEADER_1]
    else:
        system_id, component_id, low, middle, high = datagram[start + 5 : start + HEADER_2]
        message_id = low | middle << 8 | high << 16
    return Frame(message_id, system_id, component_id, datagram[start:end])


fast_crc: Callable[[bytes, int], int] | None = getattr(mavlink, "mcrf4xx", None)
"""CRC of pymavlink's C library, if it is installed."""


def checksum_of(content: bytes, kind: type[MAVLink_message]) -> bytes:
    """Return the checksum of a frame's header, without its first byte, and payload."""
    content += bytes((kind.crc_extra,))
    crc: int = mavlink.x25crc(content).crc if fast_crc is None else fast_crc(content, 0xFFFF)
    return crc.to_bytes(CHECKSUM, "little")


def message_in(frame: Frame) -> MAVLink_message | None:
    """Decode the message in a frame; None for an unknown kind or a wrong checksum.

    pymavlink's classes do it in half the time of its `decode`. Signatures are verified elsewhere.
    """
    kind, content = mavlink.mavlink_map.get(frame.message_id), frame.content
    if kind is None:
        return None
    begin, end = HEADER_2, len(content) - CHECKSUM
    if content[0] == MAGIC_1:
        begin = HEADER_1
    elif content[2] & SIGNED:
        end -= SIGNATURE
    if content[end : end + CHECKSUM] != checksum_of(content[1:end], kind):
        return None
    # Senders leave out trailing zeros; a newer one may have more fields.
    size = kind.unpacker.size
    fields = kind.unpacker.unpack(content[begin:end].ljust(size, b"\0")[:size])
    if any(kind.array_lengths):
        parts = iter(fields)
        fields = [list(islice(parts, n)) if n > 1 else next(parts) for n in kind.lengths]
        fields = [one.rstrip(b"\0") if isinstance(one, bytes) else one for one in fields]
    message: MAVLink_message = kind(*[fields[place] for place in kind.orders])
    header = message.get_header()
    header.srcSystem, header.srcComponent = frame.system_id, frame.component_id
    return message


def frame_of(message: MAVLink_message, sender: MAVLink) -> bytes:
    """Return a sender's next frame; pymavlink packs signed messages and those with more than numbers."""
    kind = type(message)
    if sender.signing.sign_outgoing or not kind.array_lengths or any(kind.array_lengths):
        return bytes(message.pack(sender))
    values = vars(message)
    fields = kind.unpacker.pack(*[values[name] for name in kind.ordered_fieldnames])
    payload = fields.rstrip(b"\0") or b"\0"
    source = sender.seq, sender.srcSystem, sender.srcComponent
    header = HEADER.pack(MAGIC_2, len(payload), 0, 0, *source, kind.id & 0xFFFF, kind.id >> 16)
    frame = header + payload
    return frame + checksum_of(frame[1:], kind)


def next_magic(datagram: bytes, start: int) -> int:
    """Return the next place where a frame could begin, or the end."""
    places = (datagram.find(bytes([magic]), start) for magic in (MAGIC_1, MAGIC_2))
    return min((place for place in places if place >= 0), default=len(datagram))


def signing_key(text: str) -> bytes:
    """Parse 64 hexadecimal digits; raise InputError, which does not repeat the text, if it is no key."""
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    if len(key) != KEY_SIZE:
        raise InputError(f"a signing key is {2 * KEY_SIZE} hexadecimal digits")
    return key


class ConnectionSigning:
    """One end of a signed connection."""

    def __init__(self, key: bytes, clock: Callable[[], float], *, link_id: int = 1) -> None:
        """Create the end of a connection.

        Args:
            key: 32 bytes that both ends share.
            clock: returns the Unix time, s. The other end refuses packets older than those it has heard.
            link_id: id of this end's connection; each connection of a computer has its own.
        """
        self._key = key
        self._clock = clock
        self._link_id = link_id
        self._newest = 0
        self._streams: dict[tuple[int, int, int], int] = {}

    def accepts(self, frame: Frame) -> bool:
        """Accept a frame if it is signed with the key and newer than those before it in its stream."""
        if not self.vouches_for(frame):
            return False
        stamp, stream = stamp_and_stream(frame)
        self._streams[stream] = stamp
        self._newest = max(self._newest, stamp)
        return True

    def vouches_for(self, frame: Frame) -> bool:
        """Check whether `accepts` would accept a frame, without noting it."""
        return self.fault_of(frame) is None

    def fault_of(self, frame: Frame) -> str | None:
        """Return why a frame is not accepted and what to do, for people; None if it would be."""
        content = frame.content
        if content[0] != MAGIC_2 or not content[2] & SIGNED:
            return UNSIGNED
        digest = hashlib.sha256(self._key + content[: DIGEST.start]).digest()[:6]
        if not hmac.compare_digest(digest, content[DIGEST]):
            return OTHER_KEY
        stamp, stream = stamp_and_stream(frame)
        last = self._streams.get(stream)
        if last is not None:
            return None if stamp > last else "signs frames that were heard before"
        late_s = (self._now() - stamp) / UNITS_PER_S
        if late_s < PATIENCE / UNITS_PER_S:
            return None
        return (
            f"signs by a clock that is {in_words(late_s)} behind this computer's: set the one that is wrong"
            " (the autopilot takes its time from GPS)"
        )

    def has_taken(self, frame: Frame) -> bool:
        """Check whether a frame is the last accepted one of its stream, so that signed frames count once."""
        if frame.content[0] != MAGIC_2 or not frame.content[2] & SIGNED:
            return False
        stamp, stream = stamp_and_stream(frame)
        return self._streams.get(stream) == stamp

    def prepare(self, encoder: MAVLink) -> None:
        """Let an encoder sign its next packets at this end's time."""
        signing = encoder.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._key, self._link_id, True
        # pymavlink adds one for each packet from here on; time never goes back below that.
        signing.timestamp = self._newest = max(self._now(), signing.timestamp)

    def _now(self) -> int:
        """Return the later of the clock's time and the newest packet's, in units of time stamps."""
        units = round((self._clock() - EPOCH_S) * UNITS_PER_S)
        return max(self._newest, min(max(units, 0), LATEST))


def stamp_and_stream(frame: Frame) -> tuple[int, tuple[int, int, int]]:
    """Return the time stamp of a signed frame, and the stream in which time stamps must rise."""
    content = frame.content
    stamp = int.from_bytes(content[TIME_STAMP], "little")
    return stamp, (frame.system_id, frame.component_id, content[-SIGNATURE])


def in_words(late_s: float) -> str:
    """Format a long time (s) in a suitable unit."""
    for unit, seconds in (("days", 86_400.0), ("hours", 3600.0)):
        if late_s >= seconds:
            return f"{late_s / seconds:.1f} {unit}"
    return f"{late_s / 60.0:.0f} minutes"


class Introduction:
    """Detector of one autopilot's heartbeat that also notes other autopilots."""

    def __init__(
        self, system_id: int, component_id: int, *, signing: ConnectionSigning | None = None
    ) -> None:
        """Expect an autopilot of this system and component; `signing` is None on an unsigned connection."""
        self.others: Counter[tuple[int, int]] = Counter()
        """Numbers of other autopilots' heartbeats, by system and component."""
        self._fault: str | None = None
        self._faults = 0
        self._source = (system_id, component_id)
        self._signing = signing

    @property
    def silence_s(self) -> float:
        """Silence of a peer after which another address may take its place, s."""
        return SILENCE_S if self._signing is None else SIGNED_SILENCE_S

    def is_given_by(self, datagram: bytes) -> bool:
        """Check for a heartbeat of the expected autopilot among the frames; never raises."""
        return any(
            frame is not None
            and frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
            and self._is_expected(frame)
            for frame in frames_of(datagram)
        )

    def _is_expected(self, frame: Frame) -> bool:
        message = message_in(frame)
        if message is None or message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if (frame.system_id, frame.component_id) != self._source:
            if len(self.others) < MOST_OTHERS:
                self.others[frame.system_id, frame.component_id] += 1
            return False
        if self._signing is None:
            return True
        self._fault = self._signing.fault_of(frame)
        self._faults += self._fault is not None
        return self._fault is None

    @property
    def refused(self) -> int:
        """Number of autopilots' heartbeats that introduced nobody."""
        return self.others.total() + self._faults

    def complaint(self) -> str | None:
        """Explain, with a remedy, why no heartbeat was the expected one; None where none came."""
        expected, component = self._source
        if self._fault is not None:
            return f"the autopilot of system {expected} {self._fault}"
        if not self.others:
            return None
        components = sorted(one for system_id, one in self.others if system_id == expected)
        if components:
            return (
                f"the autopilot of system {expected} is component {components[0]}, expected {component}:"
                f" set component_id to {components[0]} in the mission"
            )
        systems = sorted({system_id for system_id, _ in self.others})[:3]
        heard = " and ".join(map(str, systems))
        return (
            f"heard system {heard}, expected {expected}: set system_id in the mission, "
            f"or SYSID_THISMAV (PX4: MAV_SYS_ID) to {expected}, or choose the port of this vehicle"
        )


# STATUSTEXT: long texts come in parts of 50 bytes, which are joined here.

PART_BYTES = 50
"""Bytes of a part that is not the last; the last part is shorter."""

MOST_PARTS = 20
"""Maximum number of parts of one text; autopilots send a few."""

PART_BEATS = 2
"""Heartbeats of the sender without another part after which the rest of a text counts as lost."""

GAP = "[...]"
"""Replacement of lost parts."""


class TextParts(msgspec.Struct):
    """Text of which some parts have arrived."""

    number: int
    """Number of the text, by which its parts are identified."""
    severity: int
    """MAV_SEVERITY."""
    parts: dict[int, bytes] = msgspec.field(default_factory=dict)
    """Parts by their place."""
    count: int | None = None
    """Number of parts; None until the last has arrived."""
    beats: int = 0
    """Heartbeats since the newest part."""

    def report(self) -> TextReport:
        """Return the text as far as it has arrived."""
        last = max(self.parts)
        runs = [self.parts.get(0, b"")]
        for place in range(1, last + 1):
            if place in self.parts and place - 1 in self.parts:
                runs[-1] += self.parts[place]
            elif place in self.parts:
                runs.append(self.parts[place])
        if self.count is None:
            runs.append(b"")
        return TextReport(severity=self.severity, text=GAP.join(map(printable, runs)))


class TextJoiner:
    """Joiner of one sender's texts, one at a time."""

    def __init__(self) -> None:
        self._open: TextParts | None = None

    def take(self, message: MAVLink_message) -> list[TextReport]:
        """Take a STATUSTEXT; return the texts that it completes or ends."""
        raw = bytes(message._text_raw).split(b"\0", 1)[0]  # noqa: SLF001 - its `text` has lost bytes
        if not message.id:
            return [*self._give_up(), TextReport(severity=message.severity, text=printable(raw))]
        given_up: list[TextReport] = []
        if self._open is None or self._open.number != message.id:
            given_up = self._give_up()
            self._open = TextParts(number=message.id, severity=message.severity)
        one = self._open
        if message.chunk_seq >= MOST_PARTS:
            return given_up
        one.parts[message.chunk_seq], one.beats = raw, 0
        if len(raw) < PART_BYTES:
            one.count = message.chunk_seq + 1
        if one.count is not None and len(one.parts) >= one.count:
            return [*given_up, *self._give_up()]
        return given_up

    def beat(self) -> list[TextReport]:
        """Note a heartbeat of the sender, which ends a text whose rest is lost."""
        if self._open is None:
            return []
        self._open.beats += 1
        return self._give_up() if self._open.beats >= PART_BEATS else []

    def _give_up(self) -> list[TextReport]:
        one, self._open = self._open, None
        return [] if one is None or not one.parts else [one.report()]


def printable(raw: bytes) -> str:
    r"""Decode bytes for a terminal and a log.

    Invalid bytes, and characters that control a terminal, are shown by their numbers: `\xb0`.
    """
    text = raw.decode("utf-8", "backslashreplace")
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text
    )


NEAR = 24
"""Greatest step of a sequence number, of 256, that counts as a gap of a few lost frames."""

APART = 48
"""Distance up to which two places may be one, with lost and late frames."""

MOST_PLACES = 4
"""Maximum number of places remembered: each burst of lost frames leaves one."""

STEERING_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_DO_CHANGE_SPEED,
        mavlink.MAV_CMD_DO_CHANGE_ALTITUDE,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_GUIDED_CHANGE_SPEED,
        mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
        mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
    }
)
"""Commands that set where, how high or how fast to fly."""

COMMANDS = frozenset({mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG})

ITEMS = frozenset({mavlink.MAVLINK_MSG_ID_MISSION_ITEM, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT})
"""Waypoints, which are flown to at once if `current` says so."""

AT_ONCE = frozenset({2, 3})
"""Values of `current` of a waypoint or an altitude that is flown to at once."""

STEERING_MESSAGES = (
    frozenset(
        {
            mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        }
    )
    | COMMANDS
    | ITEMS
)
"""Messages that may steer."""


def steers(message: MAVLink_message) -> bool:
    """Check whether one of `STEERING_MESSAGES` sets where, how high or how fast to fly."""
    number = message.get_msgId()
    if number in COMMANDS:
        return message.command in STEERING_COMMANDS
    return number not in ITEMS or message.current in AT_ONCE


def sequence_of(content: bytes) -> int:
    """Return the sequence number of a frame, 0 to 255."""
    return content[2] if content[0] == MAGIC_1 else content[4]


class SequencePlaces:
    """Places of one name's sequence numbers, from which each series continues."""

    def __init__(self) -> None:
        self._places: list[int] = []
        self._series: list[int] = []
        self._made = 0
        self._seen: list[bytes] = [b""] * 256

    def note(self, frame: Frame) -> int:
        """Take a frame, and return the number of its series, from 0."""
        number = sequence_of(frame.content)
        if self._places and self._seen[number] == frame.content:
            return self._series[0]
        self._seen[number] = frame.content
        if self._places and 0 < (number - self._places[0]) % 256 <= NEAR:
            # By far the most frequent case.
            self._places[0] = number
            return self._series[0]
        return self._other_place(number)

    def _other_place(self, number: int) -> int:
        """Return the series of a number that does not continue the newest one."""
        places, series = self._places, self._series
        for rank, place in enumerate(places):
            ahead = (number - place) % 256
            if NEAR < ahead < 256 - NEAR:
                continue
            apart = min((place - places[0]) % 256, (places[0] - place) % 256) > APART
            went_on = series[rank] if apart else series[0]
            del places[rank], series[rank]
            # A late frame leaves its place unchanged.
            places.insert(0, number if ahead <= NEAR else place)
            series.insert(0, went_on)
            return went_on
        places.insert(0, number)
        series.insert(0, self._made)
        self._made += 1
        del places[MOST_PLACES:], series[MOST_PLACES:]
        return series[0]
