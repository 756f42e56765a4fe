"""What goes over a radio: small packets, each with a short tag."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.states import GREATEST, leader_message
from vfguide.link.codec import LeaderMessage, LinkDataError, decode, encode
from vfguide.link.packed import (
    ANSWER,
    BEAT_ALONE,
    FINDING_TEXT,
    OBSTACLE_TEXT,
    PIECE,
    QUESTION,
    TAG_SIZE,
    TICK_S,
    BeatInfo,
    PackedKind,
    Packet,
    decode_packet,
    encode_beat,
    encode_motion,
    encode_packed_presence,
    encode_packet,
    formation_key,
    formation_mark,
    state_flags,
    tag_of,
    ticks_of,
)
from vfguide.link.presence import Presence
from vfguide.link.radio_schedule import LEADER, LONGEST_FRAME, OVERHEAD, SHORTEST_FRAME, Timetable

TABLE = Timetable(members=12, beats=4, period_ms=100)
BEAT = BeatInfo(3, TABLE)
TAG = bytes(TAG_SIZE)
PRESENCE = Presence(
    status="online",
    mode="predicting",
    time_s=7.0,
    version="12.34.56.dev7",
    signed=True,
    obstacle="no position",
    findings=("FS_GCS_ENABL is 0", "ROLL_LIMIT_DEG is 30"),
    figures={"links": 2.0, "links_lost": 1.0},
)

BODIES = {
    PackedKind.BEAT: encode_beat(BEAT, BEAT_ALONE),
    PackedKind.QUESTION: QUESTION.pack(2**64 - 1),
    PackedKind.ANSWER: ANSWER.pack(5, 2**63, 77, (123).to_bytes(6, "little")),
    PackedKind.PRESENCE: encode_packed_presence(PRESENCE, 2**64 - 1),
    PackedKind.ORDER: PIECE.pack(7, 2, 80, bytes(28)),
}


def packed(
    kind: PackedKind, body: bytes, *, sender: int = LEADER, ticks: int = 1, flags: int = 0
) -> bytes:
    head = encode_packet(kind, formation=4, sender=sender, ticks=ticks, body=body, flags=flags)
    return head + TAG


STATES = st.builds(
    LeaderMessage,
    sequence=st.just(0),
    time_s=st.floats(0.0, 1e9),
    term=st.integers(0, 300),
    arrangement=st.integers(0, 2**32 - 1),
    steered=st.booleans(),
    height_sense=st.integers(-1, 1),
    **{name: st.floats(-greatest, greatest) for name, greatest in GREATEST.items()},
)


@given(STATES, st.booleans())
def test_a_state_comes_out_as_it_went_in_within_the_steps_of_its_fields(state, leads):
    body = encode_motion(state)
    if leads:
        body = encode_beat(BEAT) + body
    said = {"sender": LEADER if leads else 3, "flags": state_flags(state)}
    data = packed(PackedKind.STATE, body, ticks=ticks_of(state.time_s), **said)
    assert len(data) + OVERHEAD <= LONGEST_FRAME <= 64
    packet = decode_packet(data)
    assert packet.beat == (BEAT if leads else None)
    found = packet.state
    assert (found.steered, found.height_sense) == (state.steered, state.height_sense)
    # Never later than it was true: a copy of a state must not look newer than the state itself.
    assert -1e-6 <= state.time_s - found.time_s <= TICK_S + 1e-6
    place = (state.latitude_deg, state.longitude_deg)
    assert (found.latitude_deg, found.longitude_deg) == pytest.approx(place, abs=0.51e-7)
    assert found.altitude_amsl == pytest.approx(state.altitude_amsl, abs=0.51e-2)
    assert math.remainder(found.course - state.course, math.tau) == pytest.approx(0.0, abs=5e-5)
    # A ground speed is never negative, and 500 m/s fit.
    assert found.ground_speed == pytest.approx(max(state.ground_speed, 0.0), abs=0.51e-2)
    for name, greatest, step in (
        *(("acceleration", 32.767, 1e-3), ("turn_rate", 3.2767, 1e-4)),
        *(("turn_acceleration", 32.767, 1e-3), ("climb_rate", 327.67, 1e-2)),
    ):
        clipped = min(max(getattr(state, name), -greatest), greatest)
        assert getattr(found, name) == pytest.approx(clipped, abs=0.51 * step), name
    assert found.term == min(state.term, 255)
    assert found.arrangement == state.arrangement
    # And so over the other links, and back.
    assert repr(decode(encode(found))) == repr(found)


def test_a_state_is_these_bytes():
    """Worked out by hand from the layout in the module's text."""
    message = leader_message(
        latitude_deg=1e-7,
        longitude_deg=-1e-7,
        altitude_amsl=-0.02,
        course=math.pi,
        climb_rate=-3.0,
        steered=False,
        height_sense=-1,
        term=2,
        arrangement=513,
    )
    data = packed(
        PackedKind.STATE, encode_motion(message), sender=2, ticks=258, flags=state_flags(message)
    )
    assert data[:10] == bytes([0xA1, 4, 0, 2, 2, 1, 0, 0, 0, 0])
    assert data[10:21] == bytes([1, 0, 0, 0]) + b"\xff" * 4 + b"\xfe\xff\xff"
    # pi is half a turn; 22 m/s; -0.25 m/s², 0.125 rad/s, 0.0625 rad/s², 3 m/s down.
    fields = [32768, 2200, -250, 1250, 62, -300]
    assert data[21:33] == b"".join((one % 65536).to_bytes(2, "little") for one in fields)
    assert data[33:38] == bytes([2, 1, 2, 0, 0])


@pytest.mark.parametrize("kind", BODIES)
def test_every_kind_fits_into_a_slot_and_says_what_was_said(kind):
    data = packed(kind, BODIES[kind])
    assert SHORTEST_FRAME <= len(data) + OVERHEAD <= LONGEST_FRAME
    packet = decode_packet(data)
    assert packet.kind is kind
    assert (packet.formation, packet.sender, packet.ticks) == (4, LEADER, 1)
    if kind is PackedKind.ANSWER:
        assert (packet.to, packet.number, packet.session) == (5, 2**63, 77)
        assert packet.received == 123
    if kind is PackedKind.PRESENCE:
        assert packet.session == 2**64 - 1
        # As much of the version as there is room for, the formation's time, and that something is wrong.
        assert packet.presence == replace(
            PRESENCE,
            version="12.34.56",
            time_s=TICK_S,
            obstacle=OBSTACLE_TEXT,
            findings=(FINDING_TEXT,),
            figures={"links_lost": 1.0},
        )


def test_a_question_is_as_long_as_its_answer_and_formations_have_marks_of_their_own():
    """Else the difference in time on the way would look like one of the clocks."""
    assert len(BODIES[PackedKind.QUESTION]) == len(BODIES[PackedKind.ANSWER])
    assert formation_mark("circle") != formation_mark("line")
    assert 0 <= formation_mark("circle") < 65536


def test_a_companion_that_is_ready_says_so():
    ready = replace(PRESENCE, obstacle="", findings=(), figures={"links": 2.0, "links_lost": 0.0})
    packet = decode_packet(packed(PackedKind.PRESENCE, encode_packed_presence(ready, 1)))
    said = packet.presence
    assert (said.obstacle, said.findings, said.figures) == ("", (), {})


@given(st.binary(max_size=80))
def test_whatever_comes_is_a_packet_or_refused(data):
    try:
        packet = decode_packet(data)
    except LinkDataError:
        return
    assert isinstance(packet, Packet)
    assert packet.tagged + packet.tag == data


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"", "too short"),
        (packed(PackedKind.BEAT, BODIES[PackedKind.BEAT])[:-1], "bytes where"),
        *(
            (packed(PackedKind.BEAT, encode_beat(beat, BEAT_ALONE)), "no beat")
            for beat in (replace(BEAT, beat=4), BeatInfo(3, replace(TABLE, period_ms=0)))
        ),
        (packed(PackedKind.BEAT, BODIES[PackedKind.BEAT], flags=0x20), "flags"),
        (b"\x0a" + bytes(30), "no kind"),
        (packed(PackedKind.STATE, b"\xff\xff\xff\x7f" + bytes(24), sender=1), "no place"),
        (packed(PackedKind.PRESENCE, bytes(9) + b"\xff" * 18), "no text"),
        (packed(PackedKind.ORDER, bytes([0, 0, 1, 28, 0]) + bytes(28)), "behind the end"),
        (packed(PackedKind.REPLY, bytes(33)), "behind the end"),
        (packed(PackedKind.PRESENCE, bytes(9) + b"a\nb" + bytes(15)), "printed"),
    ],
)
def test_what_is_wrong_is_refused(data, fault):
    with pytest.raises(LinkDataError, match=fault):
        decode_packet(data)


def test_a_tag_is_of_one_key_one_session_and_one_text():
    secret, names = bytes(32), ("lead", "f1")
    key = formation_key(secret, "circle", names)
    assert len(tag_of(key, 5, b"text")) == 8
    different = (
        *((secret, "line", names), (secret, "circle", ("lead", "f2"))),
        *((b"\1" + bytes(31), "circle", names), (b"", "circle", names)),
    )
    tags = [
        tag_of(formation_key(*one), 5, b"text") for one in ((secret, "circle", names), *different)
    ]
    assert tags[0] == tag_of(key, 5, b"text")
    assert len({*tags, tag_of(key, 6, b"text"), tag_of(key, 5, b"tent")}) == 7


@pytest.mark.parametrize("time_s", [math.nan, math.inf, -1.0, 3e10])
def test_a_time_that_no_packet_can_tell_is_refused(time_s):
    with pytest.raises(ValueError, match="no time"):
        ticks_of(time_s)
