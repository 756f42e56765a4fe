"""Turns on a shared radio, counted from the leader's beat, and the framing of packets.

The leader sends at each beat, ten times a second unless configured otherwise. A cycle is some beats, with
slots of equal length between them. In a cycle every follower and an answer of the leader have one turn, and
an operator has one turn for each two beats. Follower i (from 0) has its turn after beat `i % beats`, in slot
`1 + i // beats`. The answer comes after the last follower, as if it were one more. The rest of the cycle is
the operator's, who is silent unless there is an order to give.

A follower counts its turns from when it hears a beat, less the time that the packet was on its way: clocks
are not compared. Where a beat is missed, its own clock goes on counting. Without the leader for two seconds
and three beats, it takes the beat from the lowest-numbered follower that it hears, whose turns are known,
too. A follower that hears none before itself keeps the beat for the others. Before the first beat only the
leader sends.

Nothing here reads a clock.
"""

import binascii
import math
import struct
from collections import Counter

import msgspec

from vfguide.errors import InputError

# Packets are framed by COBS with a checksum, on a stream of bytes that arrive cut and damaged.
#
# COBS (Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999) removes zeros at the cost of one byte.
# It is applied to a packet and its CRC-16 (CCITT, u16, little-endian), and the result stands between zeros. A
# zero is therefore always an end: a damaged packet, with or without its own zero, costs no other.

LEADER, OPERATOR = 0, 255
"""Numbers of the leader, and of an operator."""

OVERHEAD = 5
"""Bytes that framing adds to a packet: checksum, stuffing and two zeros."""

LARGEST_PACKET = 59
"""Maximum size of a packet, bytes: framed, it is at most 64."""

LARGEST_FRAME = LARGEST_PACKET + OVERHEAD

DAMAGED = "damaged on the air"
"""Reason for which bytes that are no packet are dropped."""

CHECKSUM = struct.Struct("<H")


def encode_frame(packet: bytes) -> bytes:
    """Frame a packet; raise ValueError if it is too long."""
    if not 0 < len(packet) <= LARGEST_PACKET:
        raise ValueError(f"{len(packet)} bytes are no packet: at most {LARGEST_PACKET}")
    content = packet + CHECKSUM.pack(binascii.crc_hqx(packet, 0xFFFF))
    return b"\0" + stuffed(content) + b"\0"


def decode_frame(frame: bytes) -> bytes | None:
    """Return the packet in the bytes between two zeros; None where it is damaged."""
    content = unstuffed(frame)
    if content is None or not CHECKSUM.size < len(content) <= LARGEST_PACKET + CHECKSUM.size:
        return None
    packet = content[: -CHECKSUM.size]
    (expected,) = CHECKSUM.unpack_from(content, len(packet))
    return packet if binascii.crc_hqx(packet, 0xFFFF) == expected else None


def stuffed(content: bytes) -> bytes:
    """Remove the zeros from less than 254 bytes: each zero becomes the distance to the next."""
    return b"".join(bytes([len(part) + 1]) + part for part in content.split(b"\0"))


def unstuffed(data: bytes) -> bytes | None:
    """Restore stuffed bytes; None where they cannot be stuffed."""
    parts, place = [], 0
    while place < len(data):
        end = place + data[place]
        if data[place] == 0 or end > len(data):
            return None
        parts.append(data[place + 1 : end])
        place = end
    return b"\0".join(parts) if parts else None


class Framer:
    """Splitter of a stream into packets."""

    def __init__(self, counters: Counter[str]) -> None:
        """Begin anywhere in the stream, and count damaged packets."""
        self._counters = counters
        self._buffer = bytearray()
        self._skips = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes, and return the packets that they complete, in order."""
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
        """Drop an incomplete packet, since the stream starts anew."""
        self._buffer.clear()
        self._skips = False

    def _keep(self, part: bytes) -> None:
        """Append to the current packet; beyond the longest packet everything is noise up to the next zero."""
        if len(self._buffer) + len(part) > LARGEST_FRAME:
            self._buffer.clear()
            self._skips = True
        if not self._skips:
            self._buffer += part


SHORTEST_FRAME, LONGEST_FRAME = 41, 56
"""Sizes of the shortest and longest framed packet, bytes: a slot must have room for either after either."""

HANDOVER_S, MISSED_BEATS = 2.0, 3
"""Silence of the keeper of the beat, s and beats, after which the beat is taken from another."""

LATE_SHARE = 0.1
"""Share of a beat's delay added to the expected time of the next: most of it is a wait in some buffer. An
early beat was expected too late and counts in full."""

ROUNDING = 1e-9
"""Rounding error of a time as a share of a cycle: turns are sums and quotients of times."""

MOST_BEATS = 255


class Channel(msgspec.Struct, frozen=True, kw_only=True):
    """Speed of the radio."""

    baud: int
    """Rate of the serial line to the radio, bits per second; ten bits carry a byte."""
    air_bytes_s: float
    """Bytes per second that all radios together can send."""

    def latency_s(self, size: int) -> float:
        """Return the time from the first byte into one radio to the last out of another, s."""
        return size * (20.0 / self.baud + 1.0 / self.air_bytes_s)

    def line_s(self) -> float:
        """Return the time that the longest packet takes on the serial line, s."""
        return LONGEST_FRAME * 10.0 / self.baud

    def slot_s(self) -> float:
        """Return the shortest slot that fits every packet, s; longer packets begin later on the air."""
        later_s = (LONGEST_FRAME - SHORTEST_FRAME) * 10.0 / self.baud
        return max(self.line_s(), LONGEST_FRAME / self.air_bytes_s + later_s)


class Turn(msgspec.Struct, frozen=True, kw_only=True):
    """Time at which a member may send one packet."""

    at_s: float
    """Begin of the turn, s on the member's clock."""
    beat: int | None = None
    """Number of the beat in its cycle; None for all other turns."""


class Timetable(msgspec.Struct, frozen=True, kw_only=True):
    """Turns within a cycle."""

    members: int
    """Number of vehicles in the formation."""
    beats: int
    """Number of beats in a cycle."""
    period_ms: int
    """Interval between beats, ms."""

    @property
    def period_s(self) -> float:
        """Interval between beats, s."""
        return self.period_ms * 1e-3

    @property
    def cycle_s(self) -> float:
        """Duration of a cycle, s."""
        return self.beats * self.period_s

    @property
    def slots(self) -> int:
        """Number of slots from one beat to the next, including the beat's."""
        return 1 + math.ceil((self.members + math.ceil(0.5 * self.beats)) / self.beats)

    @property
    def slot_s(self) -> float:
        """Duration of a slot, s."""
        return self.period_s / self.slots

    def offset_s(self, sender: int) -> float:
        """Return the time from a cycle's begin to a follower's turn, s.

        The number `members` stands for the leader's answer, and higher numbers for the operator.
        """
        place = sender - 1
        return (place % self.beats) * self.period_s + (1 + place // self.beats) * self.slot_s

    @property
    def operator_turns(self) -> range:
        """Numbers of an operator's turns for `offset_s`."""
        return range(self.members + 1, self.beats * (self.slots - 1) + 1)


def make_timetable(
    members: int, *, leader_hz: float, followers_hz: float, channel: Channel
) -> Timetable:
    """Make the timetable of a formation.

    Args:
        members: number of vehicles.
        leader_hz: beats per second.
        followers_hz: minimum turns per second of each follower; at most one turn a beat.
        channel: channel that has to carry it.

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
    """One member's knowledge of the beat."""

    def __init__(self, number: int | None) -> None:
        """Create it without any beat, for a member, OPERATOR, or None for one that only listens."""
        self._number = number
        self.timetable: Timetable | None = None
        """Turns within a cycle; None before the first beat."""
        self._origin_s = 0.0
        self._keeper = LEADER
        self._kept_s = -math.inf
        self._spoke_s = -math.inf

    def begin(self, timetable: Timetable, now: float) -> None:
        """Begin with the first beat now, as the leader."""
        if self.timetable is None:
            self.timetable, self._origin_s = timetable, now

    def hear_leader(self, beat: int, table: Timetable, began_s: float) -> None:
        """Count from a beat whose sending began at this time, s on the own clock."""
        fresh = self.timetable != table
        self.timetable = table
        self._adopt(LEADER, beat * table.period_s, began_s, fresh=fresh)

    def hear_follower(self, number: int, began_s: float) -> None:
        """Note a follower's turn, which counts while the leader is silent."""
        table = self.timetable
        if table is None or self._number is None or not LEADER < number < self._number:
            return
        if number <= self._keeper or self.is_silent(began_s):
            self._adopt(number, table.offset_s(number), began_s, fresh=False)

    def is_silent(self, now: float) -> bool:
        """Check whether nobody has kept the beat for a while."""
        period_s = 0.0 if self.timetable is None else self.timetable.period_s
        return now - self._kept_s > max(HANDOVER_S, MISSED_BEATS * period_s)

    def spoken(self, turn: Turn) -> None:
        """Note that a turn was used or skipped."""
        self._spoke_s = turn.at_s

    def next_turn(self, now: float) -> Turn | None:
        """Return the member's next turn at or after this time; None for one that may not send."""
        table, number = self.timetable, self._number
        if table is None or number is None:
            return None
        if number == OPERATOR:
            return self._next_of_operator(table, now)
        if number >= table.members:
            return None
        if number == LEADER:
            return self._next_of_leader(table, now)
        # A beat heard a little late moves the turn just used: one turn per cycle is enough.
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
        """Set the begin of the cycle so that a turn at this offset began when it was heard."""
        table = self.timetable
        if table is None:
            return
        origin_s = began_s - offset_s
        late_s = math.remainder(origin_s - self._origin_s, table.cycle_s)
        expected = not fresh and keeper == self._keeper and 0.0 <= late_s < 0.5 * table.slot_s
        self._origin_s = origin_s - (1.0 - LATE_SHARE) * late_s if expected else origin_s
        self._keeper, self._kept_s = keeper, began_s
