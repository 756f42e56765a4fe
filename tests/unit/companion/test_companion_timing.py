"""When messages were true that carry the time of a clock which nobody can read."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.companion.timing import LeaderClock, Moment

BOOTED_S = 1000.0
"""What the sender's clock shows at time 0 of the reader's."""


def read(clock: LeaderClock, sent_s: float, delay_s: float) -> Moment | None:
    """A message that is sent at a time of the reader's clock, and takes a while."""
    return clock.read(sent_s + BOOTED_S, sent_s + delay_s)


def read_for_sure(clock: LeaderClock, sent_s: float, delay_s: float) -> Moment:
    moment = read(clock, sent_s, delay_s)
    assert moment is not None
    return moment


def test_messages_that_all_take_as_long_are_taken_for_immediate():
    clock = LeaderClock()
    assert read_for_sure(clock, 10.0, 0.2).time_s == pytest.approx(10.2)
    assert read_for_sure(clock, 11.0, 0.2).time_s == pytest.approx(11.2, abs=1e-3)


def test_what_the_fastest_takes_can_be_told():
    clock = LeaderClock(least_delay_s=0.2)
    assert read_for_sure(clock, 10.0, 0.2).time_s == pytest.approx(10.0)


def test_a_later_message_is_late_by_what_it_took_longer_than_the_fastest():
    clock = LeaderClock(least_delay_s=0.05)
    read(clock, 10.0, 0.05)
    moment = read_for_sure(clock, 11.0, 0.5)
    assert moment.time_s == pytest.approx(11.0, abs=1e-3)
    assert moment.late_s == pytest.approx(0.45, abs=1e-3)


@given(st.lists(st.floats(0.05, 0.5), min_size=2, max_size=40))
def test_times_are_wrong_by_no_more_than_what_the_fastest_took(delays):
    clock, arrived_s = LeaderClock(), -math.inf
    for number, delay_s in enumerate(delays):
        sent_s = float(number)
        arrived_s = max(arrived_s, sent_s + delay_s)
        moment = clock.read(sent_s + BOOTED_S, arrived_s)
        assert moment is not None
        fastest_s = min(delays[: number + 1])
        # The clocks may drift apart by 100 ppm.
        assert sent_s + fastest_s <= moment.time_s + 1e-9
        assert moment.time_s <= sent_s + fastest_s + 1e-4 * (number + 1) + 1e-9


def test_differences_of_time_do_not_jump_when_a_faster_message_comes():
    clock = LeaderClock()
    first, second = read_for_sure(clock, 10.0, 0.5), read_for_sure(clock, 11.0, 0.1)
    assert second.even_s - first.even_s == pytest.approx(1.0)
    assert second.time_s - first.time_s == pytest.approx(0.6)


def test_an_answer_shows_how_long_the_fastest_takes():
    clock = LeaderClock()
    read(clock, 10.0, 0.2)
    # Asked at 10.0 on the reader's clock, 0.2 s there, 0.2 s back.
    clock.answer(10.0, 10.2 + BOOTED_S, 10.4)
    assert clock.least_delay_s == pytest.approx(0.2)
    assert read_for_sure(clock, 11.0, 0.2).time_s == pytest.approx(11.0, abs=1e-3)


def test_what_was_told_counts_more_than_an_answer():
    clock = LeaderClock(least_delay_s=0.1)
    read(clock, 10.0, 0.2)
    clock.answer(10.0, 10.2 + BOOTED_S, 10.4)
    assert clock.least_delay_s == 0.1


def test_the_quickest_question_counts():
    clock = LeaderClock()
    read(clock, 10.0, 0.2)
    clock.answer(10.0, 10.2 + BOOTED_S, 10.4)
    # The way there took a second.
    clock.answer(11.0, 12.0 + BOOTED_S, 12.2)
    assert clock.least_delay_s == pytest.approx(0.2, abs=1e-3)


@given(st.lists(st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5)), min_size=1, max_size=40))
def test_answers_are_wrong_by_half_of_what_the_fastest_ways_differ(ways):
    clock = LeaderClock()
    for number, (there_s, back_s) in enumerate(ways):
        asked_s = float(number)
        read(clock, asked_s + there_s, back_s)
        clock.answer(asked_s, asked_s + there_s + BOOTED_S, asked_s + there_s + back_s)
    fastest_there_s, fastest_back_s = (min(one) for one in zip(*ways, strict=True))
    expected_s = 0.5 * (fastest_there_s + fastest_back_s)
    # The clocks may drift apart by 100 ppm each way.
    assert clock.least_delay_s == pytest.approx(expected_s, abs=2e-4 * (len(ways) + 1))


def test_an_answer_of_another_clock_says_nothing():
    clock = LeaderClock()
    read(clock, 10.0, 0.2)
    clock.answer(10.0, 77_000.0, 10.4)
    assert clock.least_delay_s == 0.0


def test_a_message_that_comes_twice_or_overtaken_is_not_newer():
    clock = LeaderClock()
    read(clock, 10.0, 0.1)
    assert read(clock, 10.0, 0.2) is None
    assert read(clock, 9.9, 0.3) is None


def test_one_stamp_from_elsewhere_is_not_believed():
    clock = LeaderClock()
    read(clock, 10.0, 0.1)
    assert clock.read(1e6, 10.5) is None
    assert clock.read(0.0, 10.6) is None
    assert read_for_sure(clock, 11.0, 0.1).time_s == pytest.approx(11.1, abs=1e-3)


def test_a_restart_is_believed_after_a_second():
    clock = LeaderClock()
    read(clock, 10.0, 0.1)
    moments = [clock.read(0.25 * step, 12.0 + 0.25 * step) for step in range(6)]
    assert moments[:4] == [None] * 4
    assert moments[4] is not None
    assert moments[4].restarted
    assert moments[5] is not None
    assert moments[5].time_s == pytest.approx(13.25, abs=1e-3)


def test_a_radio_that_becomes_slow_is_no_new_clock_for_ten_seconds():
    clock = LeaderClock()
    read(clock, 10.0, 0.1)
    late = [read(clock, 11.0 + step, 6.0) for step in range(9)]
    assert late == [None] * 9


def test_forged_stamps_between_true_ones_move_nothing():
    clock = LeaderClock()
    read(clock, 9.0, 0.1)
    for step in range(40):
        sent_s = 10.0 + 0.25 * step
        clock.read(5000.0 + sent_s, sent_s + 0.1)
        moment = read_for_sure(clock, sent_s, 0.1)
        assert moment.time_s == pytest.approx(sent_s + 0.1, abs=2e-3)
        assert not moment.restarted
