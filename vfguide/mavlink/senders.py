"""Who speaks in one name: MAVLink counts the frames of each sender, so two of them show by their numbers.

Numbers of one sender go on by 1, with gaps where frames were lost. Those of two that share a name jump to
and fro between two places, each of which goes on by itself. A frame that comes twice, as over two links, is
one frame: its bytes are the same.
"""

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.framing import MAGIC_1, SIGNED, Frame
from vfguide.mavlink.reports import TextReport

# STATUSTEXT: long texts come in parts of 50 bytes, which are one text again here.

PART_BYTES = 50
"""Of a text that goes on; a shorter part is the last."""

MOST_PARTS = 20
"""Of one text: autopilots send a few."""

PATIENCE = 2
"""Heartbeats of the sender without another part of a text, after which the rest of it is lost."""

GAP = "[...]"
"""In the place of parts that are lost."""


class TextParts(msgspec.Struct):
    """A text of which some parts have come."""

    number: int
    """By which its parts are known."""
    severity: int
    """MAV_SEVERITY."""
    parts: dict[int, bytes] = msgspec.field(default_factory=dict)
    """By their place."""
    count: int | None = None
    """How many there are; None until the last has come."""
    beats: int = 0
    """Heartbeats since the newest."""

    def report(self) -> TextReport:
        """The text as far as it has come."""
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
    """Joins the texts of one sender, one at a time."""

    def __init__(self) -> None:
        self._open: TextParts | None = None

    def take(self, message: MAVLink_message) -> list[TextReport]:
        """Take a STATUSTEXT; the texts that are whole with it, or that end here."""
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
        """Note a heartbeat of the sender: a text whose rest is lost ends here."""
        if self._open is None:
            return []
        self._open.beats += 1
        return self._give_up() if self._open.beats >= PATIENCE else []

    def _give_up(self) -> list[TextReport]:
        one, self._open = self._open, None
        return [] if one is None or not one.parts else [one.report()]


def printable(raw: bytes) -> str:
    r"""Text of bytes, for a terminal and a log.

    Bytes that are no text, and characters that command a terminal, are shown by their numbers: `\xb0`.
    """
    text = raw.decode("utf-8", "backslashreplace")
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text
    )


NEAR = 24
"""Numbers that are farther on than this, of 256, are no gap of a few lost frames."""

APART = 48
"""Two places that are nearer to each other than this may be one, with frames lost and late."""

MOST_PLACES = 4
"""Places that are remembered: bursts of lost frames leave one each."""

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
"""Commands that say where, how high or how fast to fly."""

COMMANDS = frozenset({mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG})

ITEMS = frozenset({mavlink.MAVLINK_MSG_ID_MISSION_ITEM, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT})
"""Waypoints, which are flown to at once where `current` says so."""

AT_ONCE = frozenset({2, 3})
"""`current` of a waypoint or an altitude that is flown to at once."""

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
    """Whether one of `STEERING_MESSAGES` says where, how high or how fast to fly."""
    number = message.get_msgId()
    if number in COMMANDS:
        return message.command in STEERING_COMMANDS
    return number not in ITEMS or message.current in AT_ONCE


def sequence_of(content: bytes) -> int:
    """Number of a frame, 0 to 255."""
    return content[2] if content[0] == MAGIC_1 else content[4]


def checksum_of(content: bytes) -> bytes:
    """Checksum of a frame."""
    end = len(content) - (13 if content[0] != MAGIC_1 and content[2] & SIGNED else 0)
    return content[end - 2 : end]


class SequencePlaces:
    """Places in which the numbers of one name go on."""

    def __init__(self) -> None:
        self._places: list[int] = []
        self._series: list[int] = []
        self._made = 0
        self._seen: list[bytes] = [b""] * 256

    def note(self, frame: Frame) -> int:
        """Take a frame; returns the number of the series that it is one of, from 0 on."""
        number, checksum = sequence_of(frame.content), checksum_of(frame.content)
        if self._places and self._seen[number] == checksum:
            return self._series[0]
        self._seen[number] = checksum
        if self._places and 0 < (number - self._places[0]) % 256 <= NEAR:
            # By far the most frequent.
            self._places[0] = number
            return self._series[0]
        return self._other_place(number)

    def _other_place(self, number: int) -> int:
        """The series that a number goes on with which does not go on with the newest."""
        places, series = self._places, self._series
        for rank, place in enumerate(places):
            ahead = (number - place) % 256
            if NEAR < ahead < 256 - NEAR:
                continue
            apart = min((place - places[0]) % 256, (places[0] - place) % 256) > APART
            went_on = series[rank] if apart else series[0]
            del places[rank], series[rank]
            # A late frame leaves its place where it was.
            places.insert(0, number if ahead <= NEAR else place)
            series.insert(0, went_on)
            return went_on
        places.insert(0, number)
        series.insert(0, self._made)
        self._made += 1
        del places[MOST_PLACES:], series[MOST_PLACES:]
        return series[0]
