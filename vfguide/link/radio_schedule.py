"""Who may speak when on a radio that all share: turns that count from the leader's beat.

The leader sends at each beat, ten times a second unless it says otherwise. A cycle is some beats; between
two of them there are as many slots of equal length as it takes for every follower, and an answer of the
leader, to have one turn in a cycle, and an operator one turn for each two beats. Follower i, from 0, has slot
`1 + i // beats` after beat `i % beats`; the answer comes after the last follower, as if it were one more. All
that is left of the cycle is the operator's, who is silent unless there is an order to be given.

A follower counts its turns from when it hears a beat, less the time that the packet was on its way: clocks
are not compared. Where a beat is missed, its own clock goes on counting. After two seconds, and three beats,
without the leader it takes the beat from the follower of the least number that it hears, whose turns are
known, too; the one that hears nobody before itself keeps the beat for the others. Before the first beat only
the leader speaks.

Nothing here reads a clock.
"""

import binascii
import math
import struct
from collections import Counter

import msgspec

from vfguide.errors import InputError

# Packets on a stream of bytes that arrive cut and damaged: COBS, with a checksum.
#
# A packet and its CRC-16 (CCITT, u16, little-endian) are stuffed by COBS (Cheshire and Baker, "Consistent
# Overhead Byte Stuffing", 1999), which takes the zeros out for one byte more, and stand between zeros. A zero
# therefore always is an end: what is left of a damaged packet, with or without its own zero, costs no other.

LEADER, OPERATOR = 0, 255
"""Numbers of the leader, and of an operator."""

OVERHEAD = 5
"""Bytes that a packet takes more on the wire: checksum, stuffing and two zeros."""

LARGEST_PACKET = 59
"""Bytes: all of a packet is at most 64 on the wire."""

LARGEST_FRAME = LARGEST_PACKET + OVERHEAD

DAMAGED = "damaged on the air"
"""Why bytes are left out that are no packet."""

CHECKSUM = struct.Struct("<H")


def encode_frame(packet: bytes) -> bytes:
    """A packet as it goes onto the wire.

    Raises:
        ValueError: it is too long.
    """
    if not 0 < len(packet) <= LARGEST_PACKET:
        raise ValueError(f"{len(packet)} bytes are no packet: at most {LARGEST_PACKET}")
    content = packet + CHECKSUM.pack(binascii.crc_hqx(packet, 0xFFFF))
    return b"\0" + stuffed(content) + b"\0"


def decode_frame(frame: bytes) -> bytes | None:
    """The packet in what stood between two zeros; None where it is damaged."""
    content = unstuffed(frame)
    if content is None or not CHECKSUM.size < len(content) <= LARGEST_PACKET + CHECKSUM.size:
        return None
    packet = content[: -CHECKSUM.size]
    (expected,) = CHECKSUM.unpack_from(content, len(packet))
    return packet if binascii.crc_hqx(packet, 0xFFFF) == expected else None


def stuffed(content: bytes) -> bytes:
    """Bytes without zeros, of less than 254: each zero becomes the distance to the next."""
    return b"".join(bytes([len(part) + 1]) + part for part in content.split(b"\0"))


def unstuffed(data: bytes) -> bytes | None:
    """What was stuffed; None where it cannot have been."""
    parts, place = [], 0
    while place < len(data):
        end = place + data[place]
        if data[place] == 0 or end > len(data):
            return None
        parts.append(data[place + 1 : end])
        place = end
    return b"\0".join(parts) if parts else None


class Framer:
    """Cuts a stream into packets."""

    def __init__(self, counters: Counter[str]) -> None:
        """Begin anywhere in the stream.

        Args:
            counters: what was left out is counted here.
        """
        self._counters = counters
        self._buffer = bytearray()
        self._skips = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; the packets that they complete, in order."""
        packets = []
        *ended, rest = data.split(b"\0")
        for part in ended:
            self._keep(part)
            frame, skipped = bytes(self._buffer), self._skips
            self._buffer.clear()
            self._skips = False
            if not frame and not skipped:
                continue
            packet = None if skipped else decode_frame(frame)
            if packet is None:
                self._counters[f"refused: {DAMAGED}"] += 1
            else:
                packets.append(packet)
        self._keep(rest)
        return packets

    def clear(self) -> None:
        """Forget what has begun: the stream starts anew."""
        self._buffer.clear()
        self._skips = False

    def _keep(self, part: bytes) -> None:
        """Add to the packet that has begun; what is longer than any packet is noise up to the next zero."""
        if len(self._buffer) + len(part) > LARGEST_FRAME:
            self._buffer.clear()
            self._skips = True
        if not self._skips:
            self._buffer += part


SHORTEST_FRAME, LONGEST_FRAME = 41, 56
"""Bytes on the wire of the packets that are sent: a slot has to have room for each, before each."""

HANDOVER_S, MISSED_BEATS = 2.0, 3
"""After this long, and so many beats, without the one that has kept the beat, it is taken from another."""

LATE_SHARE = 0.1
"""Share of a beat's delay by which the next one is expected later: most of that is the wait of
this one packet in some buffer. What comes early was expected too late."""

ROUNDING = 1e-9
"""Rounding error of a time, in parts of a cycle: turns are sums and quotients of times."""

MOST_BEATS = 255


class Channel(msgspec.Struct, frozen=True, kw_only=True):
    """How fast the radio is."""

    baud: int
    """Rate of the serial line to the radio, bits per second; ten of them carry a byte."""
    air_bytes_s: float
    """What all radios together can send, bytes per second."""

    def latency_s(self, size: int) -> float:
        """From the first byte of a packet into one radio to its last byte out of another, s."""
        return size * (20.0 / self.baud + 1.0 / self.air_bytes_s)

    def line_s(self) -> float:
        """What the longest packet takes on the serial line, s."""
        return LONGEST_FRAME * 10.0 / self.baud

    def slot_s(self) -> float:
        """The shortest slot that every packet fits into, s.

        A radio sends once it has all of a packet: a long one begins later than a short one.
        """
        later_s = (LONGEST_FRAME - SHORTEST_FRAME) * 10.0 / self.baud
        return max(self.line_s(), LONGEST_FRAME / self.air_bytes_s + later_s)


class Turn(msgspec.Struct, frozen=True, kw_only=True):
    """When a member may send one packet."""

    at_s: float
    """When it begins, s on the member's clock."""
    beat: int | None = None
    """Which beat it is, if it is one; None for all other turns."""


class Timetable(msgspec.Struct, frozen=True, kw_only=True):
    """Turns within a cycle."""

    members: int
    """Vehicles of the formation."""
    beats: int
    """In a cycle."""
    period_ms: int
    """From one beat to the next, ms."""

    @property
    def period_s(self) -> float:
        """From one beat to the next, s."""
        return self.period_ms * 1e-3

    @property
    def cycle_s(self) -> float:
        """How long a cycle takes, s."""
        return self.beats * self.period_s

    @property
    def slots(self) -> int:
        """How many slots a beat and the time up to the next are divided into."""
        return 1 + math.ceil((self.members + math.ceil(0.5 * self.beats)) / self.beats)

    @property
    def slot_s(self) -> float:
        """How long one is, s."""
        return self.period_s / self.slots

    def offset_s(self, sender: int) -> float:
        """From the beginning of a cycle to the turn of a follower, s.

        That of `members` is the answer's, and those above it are the operator's.
        """
        place = sender - 1
        return (place % self.beats) * self.period_s + (1 + place // self.beats) * self.slot_s

    @property
    def operator_turns(self) -> range:
        """Numbers by which `offset_s` tells the turns of an operator."""
        return range(self.members + 1, self.beats * (self.slots - 1) + 1)


def make_timetable(
    members: int, *, leader_hz: float, followers_hz: float, channel: Channel
) -> Timetable:
    """The timetable of a formation.

    Args:
        members: vehicles of it.
        leader_hz: beats per second.
        followers_hz: turns per second of each follower, at least; at most one a beat.
        channel: that has to carry it.

    Raises:
        InputError: the channel is too slow for it.
    """
    beats = min(max(math.floor(leader_hz / followers_hz + 1e-6), 1), MOST_BEATS)
    made = Timetable(members=members, beats=beats, period_ms=round(1e3 / leader_hz))
    if made.slot_s < channel.slot_s():
        raise InputError(
            f"{members} vehicles, a leader at {leader_hz:g} Hz and followers at {followers_hz:g} Hz do not"
            f" fit {channel.air_bytes_s:g} bytes a second at {channel.baud} baud; write less for leader= or"
            " followers= behind the ?"
        )
    return made


class Beat:
    """What one member knows of the beat."""

    def __init__(self, number: int | None) -> None:
        """Know nothing yet.

        Args:
            number: of the member; OPERATOR for an operator, None for one who only listens.
        """
        self._number = number
        self.timetable: Timetable | None = None
        """None before the first beat."""
        self._origin_s = 0.0
        self._keeper = LEADER
        self._kept_s = -math.inf
        self._spoke_s = -math.inf

    def begin(self, timetable: Timetable, now: float) -> None:
        """Be the leader, and begin with the first beat now."""
        if self.timetable is None:
            self.timetable, self._origin_s = timetable, now

    def hear_leader(self, beat: int, table: Timetable, began_s: float) -> None:
        """Count from a beat that began to be sent at a time, s on one's own clock."""
        fresh = self.timetable != table
        self.timetable = table
        self._adopt(LEADER, beat * table.period_s, began_s, fresh=fresh)

    def hear_follower(self, number: int, began_s: float) -> None:
        """Note a turn of a follower, which counts while the leader is silent."""
        table = self.timetable
        if table is None or self._number is None or not LEADER < number < self._number:
            return
        if number <= self._keeper or self.is_silent(began_s):
            self._adopt(number, table.offset_s(number), began_s, fresh=False)

    def is_silent(self, now: float) -> bool:
        """Whether nobody has kept the beat for a while."""
        period_s = 0.0 if self.timetable is None else self.timetable.period_s
        return now - self._kept_s > max(HANDOVER_S, MISSED_BEATS * period_s)

    def spoken(self, turn: Turn) -> None:
        """Note that a turn was taken, or let go."""
        self._spoke_s = turn.at_s

    def next_turn(self, now: float) -> Turn | None:
        """The member's next turn, at or after this time; None for one that may not speak."""
        table, number = self.timetable, self._number
        if table is None or number is None:
            return None
        if number == OPERATOR:
            return self._next_of_operator(table, now)
        if number >= table.members:
            return None
        if number == LEADER:
            return self._next_of_leader(table, now)
        # A beat that was heard a little later moves the turn that was just taken: once in a cycle is enough.
        after = max(now, self._spoke_s + 0.5 * table.cycle_s)
        return Turn(at_s=self._next(table, table.offset_s(number), after))

    def _next_of_leader(self, table: Timetable, now: float) -> Turn:
        after = max(now, self._spoke_s + 0.5 * table.slot_s)
        answer = Turn(at_s=self._next(table, table.offset_s(table.members), after))
        count = math.ceil((after - self._origin_s) / table.period_s - ROUNDING)
        beat = Turn(at_s=self._origin_s + count * table.period_s, beat=count % table.beats)
        return min(beat, answer, key=lambda turn: turn.at_s)

    def _next_of_operator(self, table: Timetable, now: float) -> Turn:
        after = max(now, self._spoke_s + 0.5 * table.slot_s)
        turns = (self._next(table, table.offset_s(one), after) for one in table.operator_turns)
        return Turn(at_s=min(turns))

    def _next(self, table: Timetable, offset_s: float, after: float) -> float:
        first_s = self._origin_s + offset_s
        return first_s + math.ceil((after - first_s) / table.cycle_s - ROUNDING) * table.cycle_s

    def _adopt(self, keeper: int, offset_s: float, began_s: float, *, fresh: bool) -> None:
        """Let the cycle begin so that a turn of this offset began when it was heard."""
        table = self.timetable
        if table is None:
            return
        origin_s = began_s - offset_s
        late_s = math.remainder(origin_s - self._origin_s, table.cycle_s)
        expected = not fresh and keeper == self._keeper and 0.0 <= late_s < 0.5 * table.slot_s
        self._origin_s = origin_s - (1.0 - LATE_SHARE) * late_s if expected else origin_s
        self._keeper, self._kept_s = keeper, began_s
