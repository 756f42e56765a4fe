"""Who may speak when on a radio that all share."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.errors import InputError
from vfguide.link.packed import LEADER, OPERATOR, BeatInfo
from vfguide.link.radio_schedule import (
    HANDOVER_S,
    Beat,
    Channel,
    Timetable,
    Turn,
    make_timetable,
    timetable_of,
)

CHANNEL = Channel(baud=57_600, air_bytes_s=4000.0)
TWELVE = Timetable(members=12, beats=4, period_s=0.1)


def beat(number: int, *, period_ms: int = 100) -> BeatInfo:
    return BeatInfo(beat=number, beats=4, members=12, period_ms=period_ms)


def turns(one: Beat, begins_s: float, count: int) -> list[Turn]:
    """Turns, one after the other, each taken."""
    found, now = [], begins_s
    for _ in range(count):
        turn = one.next_turn(now)
        assert turn is not None
        one.spoken(turn)
        found.append(turn)
        now = turn.at_s
    return found


def test_twelve_at_10_and_2_5_hz_have_slots_of_20_ms():
    """11 followers, an answer and 2 turns of an operator in 4 beats: 4 after each; 100 ms / 5."""
    table = make_timetable(12, leader_hz=10.0, followers_hz=2.5, channel=CHANNEL)
    assert table == TWELVE
    assert (table.slots, table.slot_s, table.cycle_s) == (5, 0.02, 0.4)
    offsets = [table.offset_s(number) for number in (1, 2, 4, 5, 11, 12)]
    assert offsets == pytest.approx([0.02, 0.12, 0.32, 0.04, 0.26, 0.36])


def test_the_way_of_a_packet_is_two_lines_and_the_air():
    """50 bytes: twice 500 bits at 57600, and 50 / 4000 s."""
    assert CHANNEL.latency_s(50) == pytest.approx(2 * 500 / 57_600 + 0.0125)


@pytest.mark.parametrize(
    ("members", "leader_hz", "followers_hz"), [(17, 20.0, 2.5), (40, 10.0, 2.5), (4, 50.0, 50.0)]
)
def test_what_does_not_fit_is_one_line(members, leader_hz, followers_hz):
    with pytest.raises(InputError, match="do not fit 4000 bytes a second at 57600 baud; write"):
        make_timetable(members, leader_hz=leader_hz, followers_hz=followers_hz, channel=CHANNEL)


@given(st.integers(1, 60), st.floats(0.5, 30.0), st.floats(0.1, 30.0))
def test_no_two_turns_of_a_timetable_meet(members, leader_hz, followers_hz):
    try:
        table = make_timetable(
            members, leader_hz=leader_hz, followers_hz=followers_hz, channel=CHANNEL
        )
    except InputError:
        return
    places = [number * table.period_s for number in range(table.beats)]
    places += [table.offset_s(number) for number in range(1, members + 1)]
    places += [table.offset_s(number) for number in table.operator_turns]
    assert len(table.operator_turns) >= table.beats / 2
    ordered = sorted(places)
    ends = [*ordered[1:], table.cycle_s]
    assert all(b - a >= table.slot_s - 1e-9 for a, b in zip(ordered, ends, strict=True))
    assert timetable_of(table.info(0)).beats == table.beats


def test_nobody_but_the_leader_speaks_before_the_first_beat():
    assert Beat(3).next_turn(5.0) is None
    assert Beat(None).next_turn(5.0) is None


def test_the_leader_has_each_beat_and_one_turn_more_in_a_cycle():
    one = Beat(LEADER)
    one.begin(TWELVE, 7.0)
    found = turns(one, 7.0, 6)
    assert [turn.at_s for turn in found] == pytest.approx([7.0, 7.1, 7.2, 7.3, 7.36, 7.4])
    assert [turn.beat for turn in found] == [0, 1, 2, 3, None, 0]


def test_an_operator_has_what_is_left_of_a_cycle():
    """16 places behind the beats, of which 11 followers and the answer have 12: the last of each beat."""
    one = Beat(OPERATOR)
    one.hear_leader(beat(0), 7.0)
    assert [turn.at_s for turn in turns(one, 7.0, 5)] == pytest.approx(
        [7.08, 7.18, 7.28, 7.38, 7.48]
    )


def test_a_follower_counts_its_turn_from_the_beat_that_it_heard():
    """Beat 2 began at 7.2 on its clock: the cycle at 7.0, and follower 5 has its second slot."""
    one = Beat(5)
    one.hear_leader(beat(2), 7.2)
    assert [turn.at_s for turn in turns(one, 7.2, 3)] == pytest.approx([7.44, 7.84, 8.24])


def test_a_missed_beat_moves_no_turn():
    one = Beat(5)
    one.hear_leader(beat(2), 7.2)
    assert turns(one, 100.0, 1)[0].at_s == pytest.approx(100.24)


def test_a_beat_that_comes_late_moves_turns_by_a_tenth_and_one_that_comes_early_wholly():
    one = Beat(5)
    one.hear_leader(beat(0), 7.0)
    one.hear_leader(beat(0), 7.408)
    assert turns(one, 7.408, 1)[0].at_s == pytest.approx(7.4408)
    one.hear_leader(beat(0), 7.79)
    assert turns(one, 7.79, 1)[0].at_s == pytest.approx(7.83)


def test_a_turn_that_a_later_beat_moves_is_not_taken_twice():
    one = Beat(1)
    one.hear_leader(beat(0), 7.0)
    assert turns(one, 7.0, 1)[0].at_s == pytest.approx(7.02)
    one.hear_leader(beat(0), 7.01)
    assert turns(one, 7.021, 1)[0].at_s == pytest.approx(7.421)


def test_a_leader_that_starts_anew_is_followed_at_once():
    one = Beat(5)
    one.hear_leader(beat(0), 7.0)
    one.hear_leader(beat(0), 7.2)
    assert turns(one, 7.2, 1)[0].at_s == pytest.approx(7.24)
    one.hear_leader(beat(0, period_ms=200), 8.0)
    # Five slots of 40 ms in each beat of 200 ms.
    assert turns(one, 8.0, 1)[0].at_s == pytest.approx(8.08)


def test_without_the_leader_the_follower_of_the_least_number_keeps_the_beat():
    third, fifth = Beat(3), Beat(5)
    for one in (third, fifth):
        one.hear_leader(beat(0), 0.0)
    late_s = HANDOVER_S + 0.8
    # The third is heard 8 ms after its turn by the fifth, which follows it; not the other way round.
    fifth.hear_follower(3, late_s + 0.220 + 0.008)
    third.hear_follower(5, late_s + 0.040 + 0.008)
    assert turns(fifth, late_s, 1)[0].at_s == pytest.approx(late_s + 0.048)
    assert turns(third, late_s, 1)[0].at_s == pytest.approx(late_s + 0.22)


def test_a_slow_leader_is_not_silent_between_its_beats():
    one = Beat(5)
    one.hear_leader(beat(0, period_ms=2000), 0.0)
    assert not one.is_silent(5.9)
    assert one.is_silent(6.1)


def test_while_the_leader_is_heard_no_follower_keeps_the_beat():
    one = Beat(5)
    one.hear_leader(beat(0), 7.0)
    one.hear_follower(3, 7.3)
    assert turns(one, 7.3, 1)[0].at_s == pytest.approx(7.44)
