"""Another clock by its stamps and answers: offset, rate, slips, new starts, and what is uncertain."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.guidance.other_clock import (
    CABLE,
    DRIFT,
    RADIO,
    TICK_S,
    Basis,
    OtherClock,
    Reading,
    StampSense,
    TimeQuestions,
)

BOOTED_S = 100.0
"""When the other clock showed 0, s on one's own."""

WRAP_S = 2**32 * 1e-3


def on_a_cable() -> OtherClock:
    return OtherClock(CABLE, least_way_s=0.0)


def heard(clock: OtherClock, made_s: float, way_s: float) -> Reading:
    """A report that is made at a time of one's own clock, and takes a while."""
    return clock.read(made_s - BOOTED_S, made_s + way_s)


def answered(
    clock: OtherClock, asked_s: float, there_s: float, back_s: float, behind_s: float = BOOTED_S
) -> None:
    """A question and its answer, of a clock that is behind one's own."""
    clock.answer(asked_s, asked_s + there_s - behind_s, asked_s + there_s + back_s)


def test_what_the_fastest_takes_can_be_told_and_counts_more_than_an_answer():
    clock = OtherClock(least_way_s=0.1)
    assert heard(clock, 110.0, 0.1).time_s == pytest.approx(110.0)
    answered(clock, 110.0, 0.3, 0.3)
    assert heard(clock, 111.0, 0.1).time_s == pytest.approx(111.0, abs=1e-3)


def test_differences_of_stamps_do_not_jump_when_a_faster_report_comes():
    clock = OtherClock()
    first, second = heard(clock, 110.0, 0.5), heard(clock, 111.0, 0.1)
    assert second.stamp_s - first.stamp_s == pytest.approx(1.0)
    assert second.slip_s(first) == pytest.approx(-0.4)
    assert first.slip_s(None) == 0.0


@given(
    st.sampled_from([CABLE, RADIO]),
    st.lists(st.floats(0.05, 0.25), min_size=2, max_size=60),
    st.floats(-1.0, 1.0).map(lambda share: 0.5 * share * DRIFT),
)
def test_without_answers_times_are_late_by_what_the_fastest_took(lateness, ways, drift):
    clock, before_s = OtherClock(lateness), -math.inf
    for number, way_s in enumerate(ways):
        made_s = 101.0 + number
        reading = clock.read((made_s - BOOTED_S) * (1.0 + drift), made_s + way_s)
        late_s = reading.time_s - made_s
        assert min(ways) - 1e-9 - number * DRIFT <= late_s <= way_s + 1e-9
        assert late_s <= min(ways[: number + 1]) + 2.0 * DRIFT * (number + 1)
        assert reading.time_s > before_s
        before_s = reading.time_s
    assert clock.basis is Basis.STAMPS


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drift_of_50_ppm_costs_less_than_a_millisecond_in_an_hour(drift):
    clock = on_a_cable()
    for step in range(3600 * 4):
        made_s = 500.0 + step / 4
        # One report in seven travels at once, the others take up to 60 ms.
        reading = clock.read((made_s - 480.0) * (1.0 + drift), made_s + 0.01 * (step % 7))
        assert reading.time_s == pytest.approx(made_s, abs=1e-3, rel=0.0)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    way_s=st.floats(0.001, 0.1),
    jitters=st.lists(st.floats(0.0, 0.1), min_size=100, max_size=100),
    rate=st.floats(-200e-6, 200e-6),
    slip_s=st.floats(0.0, 3.0),
    slips_at=st.integers(30, 99),
    told_s=st.sampled_from([None, 0.0]),
)
def test_times_are_monotone_and_wrong_by_no_more_than_is_stated(
    way_s, jitters, rate, slip_s, slips_at, told_s
):
    """Any offset, rate and jitter, and one slip, of which nobody can know before the next answer."""
    clock, before_s, knows = OtherClock(CABLE, least_way_s=told_s), -math.inf, False
    for step, jitter_s in enumerate(jitters):
        made_s = 200.0 + 0.5 * step

        def other(time_s: float, step: int = step) -> float:
            return (time_s - BOOTED_S) * (1.0 + rate) - (slip_s if step >= slips_at else 0.0)

        reading = clock.read(other(made_s), made_s + way_s + jitter_s)
        knows &= step != slips_at and clock.basis is Basis.ANSWERS
        if reading is not None and reading.is_newer:
            # Slip and rate may hide in the time that a question takes; for 12 s a slip may look like a rate.
            hidden_s = 2.0 * way_s if step >= slips_at or abs(rate) > DRIFT else 0.0
            hidden_s += slip_s if 0 <= step - slips_at <= 25 else 0.0
            if knows:
                stated_s = clock.uncertainty_s + hidden_s + TICK_S
                assert abs(reading.time_s - made_s) <= stated_s
            assert reading.time_s > before_s or 0 <= step - slips_at <= 6
            before_s = reading.time_s
        asked_s = made_s + 0.2
        clock.answer(asked_s, other(asked_s + way_s), asked_s + 2.0 * way_s + jitter_s)
        knows |= clock.basis is Basis.ANSWERS


def test_answers_show_how_long_the_fastest_takes():
    clock = OtherClock()
    heard(clock, 110.0, 0.2)
    assert clock.uncertainty_s > 0.2
    answered(clock, 110.0, 0.2, 0.2)
    # The way there took a second: of two answers the quicker one counts.
    answered(clock, 111.0, 1.0, 0.2)
    assert clock.least_way_s == pytest.approx(0.2, abs=1e-3)
    assert heard(clock, 111.5, 0.2).time_s == pytest.approx(111.5, abs=1e-3)
    assert clock.uncertainty_s == pytest.approx(0.2, abs=1e-3)


@given(st.lists(st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5)), min_size=1, max_size=40))
def test_answers_are_wrong_by_half_of_what_the_fastest_ways_differ(ways):
    clock = OtherClock()
    for number, (there_s, back_s) in enumerate(ways):
        asked_s = 101.0 + number
        heard(clock, asked_s + there_s, back_s)
        answered(clock, asked_s, there_s, back_s)
    fastest_there_s, fastest_back_s = (min(one) for one in zip(*ways, strict=True))
    expected_s = 0.5 * (fastest_there_s + fastest_back_s)
    # The clocks may drift apart by 100 ppm each way.
    assert clock.least_way_s == pytest.approx(expected_s, abs=2e-4 * (len(ways) + 1))


@pytest.mark.parametrize("behind_s", [77_000.0, -77_000.0, 145.0])
def test_an_answer_of_another_clock_says_nothing(behind_s):
    clock = OtherClock()
    heard(clock, 110.0, 0.2)
    answered(clock, 110.0, 0.2, 0.2, behind_s)
    assert clock.basis is Basis.STAMPS
    assert heard(clock, 111.0, 0.2).time_s == pytest.approx(111.2, abs=1e-3)


def test_answers_come_once_to_questions_that_were_asked():
    questions, never = (TimeQuestions(every_s=0.5, most_open=3) for _ in range(2))
    assert questions.greatest_age(10.0) == math.inf
    stamps = [stamp for step in range(12) if (stamp := questions.ask(10.0 + 0.25 * step))]
    assert stamps == [round((10.0 + 0.5 * number) * 1e9) for number in range(6)]
    assert [questions.answered(stamp) for stamp in (17, stamps[0], stamps[3])] == [None, None, 11.5]
    assert questions.answered(stamps[3]) is None
    assert questions.greatest_age(13.0) == 1.5
    never.ask(10.0)
    assert [never.greatest_age(now) for now in (14.0, 16.0)] == [math.inf, 0.0]


@pytest.mark.parametrize("slower_s", [lambda s: 0.4 * (s > 5.0), lambda s: 0.02 * s])
def test_a_link_that_becomes_slower_is_no_slip_and_no_rate_where_the_other_answers(slower_s):
    clock = on_a_cable()
    for step in range(20 * 30):
        made_s, way_s = 100.0 + step / 20, 0.005 + slower_s(step / 20)
        if step % 10 == 0:
            answered(clock, made_s - way_s, way_s, way_s)
        late_s = heard(clock, made_s, way_s).time_s - made_s
        assert 0.0 <= late_s <= 0.006 + DRIFT * step / 20
        assert clock.skew == 0.0


@pytest.mark.parametrize("answers", [True, False])
@pytest.mark.parametrize("lost_s", [0.05, 0.4, 5.0])
def test_a_slip_is_found_within_a_second(lost_s, answers):
    """Reports go on every 50 ms after the clock has stood still; a link may explain 0.05 s."""
    clock = on_a_cable()
    for step in range(1200):
        made_s = 100.0 + step / 20
        if 130.0 <= made_s < 130.0 + lost_s:
            continue
        slip_s = lost_s if made_s >= 130.0 else 0.0
        if answers and step % 10 == 0:
            answered(clock, made_s - 0.005, 0.005, 0.005, BOOTED_S + slip_s)
        reading = clock.read(made_s - BOOTED_S - slip_s, made_s + 0.005)
        if made_s < 130.0 or made_s > 131.1 + lost_s:
            expected_s = lost_s if slip_s == 0.05 and not answers else 0.0
            assert reading.time_s + expected_s == pytest.approx(made_s, abs=0.012)
            assert clock.skew == 0.0


def test_a_clock_that_runs_slow_loses_no_more_time_once_that_is_known():
    """At 0.987 of the wall's rate slips of 10 ms would come every second."""
    clock, late = on_a_cable(), []
    for step in range(25 * 60):
        now = 100.0 + step / 25
        if step % 12 == 0:
            clock.answer(now - 0.001, (now - 0.0005 - 50.0) * 0.987, now)
        late.append(now - clock.read((now - 0.0005 - 50.0) * 0.987, now).time_s)
    assert max(late[25 * 5 : 25 * 8]) > 0.002
    assert max(late[25 * 15 :]) - min(late[25 * 15 :]) < 0.002
    assert clock.skew == pytest.approx(1.0 / 0.987 - 1.0, abs=1e-4)


def test_a_stamp_that_wraps_goes_on():
    clock = on_a_cable()
    before = clock.read(WRAP_S - 0.03, 100.0)
    for step in range(1, 100):
        now = 100.0 + 0.05 * step
        clock.answer(now, now + WRAP_S - 100.03, now)
        after = clock.read(round(0.05 * step - 0.03, 3) % WRAP_S, now)
        assert after.leap_s == 0.0
        assert after.time_s == pytest.approx(now, abs=1e-3)
        assert after.stamp_s - before.stamp_s == pytest.approx(0.05, abs=1e-5)
        before = after


@pytest.mark.parametrize("lateness", [CABLE, RADIO])
@pytest.mark.parametrize(("interval_s", "found_at"), [(0.05, 20), (0.25, 4), (1.0, 2)])
@pytest.mark.parametrize("leap_s", [-99.9, 3000.0])
def test_stamps_that_go_on_elsewhere_for_a_second_are_a_new_start(
    lateness, interval_s, found_at, leap_s
):
    """Of a slow stream the third report shows it."""
    clock = OtherClock(lateness)
    clock.read(100.0, 200.0)
    for later_s in (interval_s * step for step in range(found_at)):
        assert clock.read(100.0 + leap_s + later_s, 205.0 + later_s) is None
    later_s = interval_s * found_at
    started = clock.read(100.0 + leap_s + later_s, 205.0 + later_s)
    assert started.leap_s == pytest.approx(leap_s + later_s)
    later_s += interval_s
    after = clock.read(100.0 + leap_s + later_s, 205.0 + later_s)
    assert (after.leap_s, after.time_s) == pytest.approx((0.0, 205.0 + later_s), abs=1e-3)


def test_the_first_stamp_is_no_new_start():
    assert on_a_cable().read(0.0, 100.0) == Reading(time_s=100.0, stamp_s=0.0, read_s=100.0)
    assert on_a_cable().read(math.nan, 100.0) is None


EVENLY = [90.0 + 0.05 * number for number in range(100)]


@pytest.mark.parametrize(
    ("stamps", "apart_s"),
    [
        pytest.param(EVENLY, 0.0, id="repeated at once"),
        pytest.param(EVENLY[:8], 0.02, id="eight that fall"),
        pytest.param(EVENLY[:8], 0.05, id="the same evenly"),
        pytest.param([5000.0], 0.0, id="one that leaps ahead"),
        pytest.param([1e6, 0.0, 1e6, 0.0], 0.3, id="to and fro"),
    ],
)
def test_forged_and_repeated_stamps_are_not_believed_and_lock_nobody_out(stamps, apart_s):
    clock = on_a_cable()
    clock.read(100.0, 200.0)
    assert not any(clock.read(one, 200.01 + apart_s * k) for k, one in enumerate(stamps))
    now = 200.1 + apart_s * len(stamps)
    assert clock.read(now - 100.0, now).time_s == pytest.approx(now, abs=1e-3)


@pytest.mark.parametrize("leap_s", [-5.0, 5000.0])
@pytest.mark.parametrize("lateness", [CABLE, RADIO])
def test_old_or_forged_stamps_among_true_ones_move_nothing(leap_s, lateness):
    clock = OtherClock(lateness)
    for now in (200.0 + 0.05 * step for step in range(100)):
        reading = clock.read(now - 100.0, now)
        assert (reading.time_s, reading.leap_s) == pytest.approx((now, 0.0))
        assert clock.read(now - 100.0 + leap_s, now) is None


def test_a_radio_that_becomes_slow_is_no_new_clock_for_ten_seconds():
    """What is more than 5 s late is of no use meanwhile."""
    clock = OtherClock(RADIO)
    heard(clock, 110.0, 0.1)
    assert [clock.read(11.0 + step, 117.0 + step) for step in range(10)] == [None] * 10
    assert clock.read(21.0, 127.0).time_s == pytest.approx(127.0, abs=0.01)


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        pytest.param(lambda _: 0.0, "stand still", id="zero"),
        pytest.param(lambda time_s: time_s * 1e3 % WRAP_S, "run 1000 times too fast", id="µs"),
        pytest.param(lambda time_s: time_s // 1.0 * 1e-3, "times too slow", id="seconds"),
        pytest.param(lambda time_s: time_s * 7919.0 % 1000.0 // 1.0, "leap about", id="leaps"),
    ],
)
def test_stamps_that_tell_no_time_are_replaced_by_arrival(stamp: Callable[[float], float], words):
    clock, readings = on_a_cable(), []
    for step in range(100):
        now = 200.0 + 0.1 * step
        reading = clock.read(stamp(now - 100.0), now, (47.0, float(step)))
        if now > 205.0:
            assert reading.time_s == pytest.approx(now)
            readings.append(reading.stamp_s)
    assert words in str(clock.fault)
    assert clock.basis is Basis.ARRIVAL
    assert clock.uncertainty_s > 1.0
    assert readings == pytest.approx([readings[0] + 0.1 * k for k in range(len(readings))])


def test_arrival_has_no_rate_although_the_clock_that_has_stopped_had_one():
    clock = on_a_cable()
    for step in range(4000):
        now = 200.0 + 0.1 * step
        # It runs 5 % fast for a minute, and stands still from then on.
        stamp_s = 1.05 * (min(now, 260.0) - 100.0)
        reading = clock.read(stamp_s, now, (47.0, float(step)))
        if now < 260.0 and step % 5 == 0:
            clock.answer(now - 0.01, stamp_s, now)
        if step == 590:
            assert clock.skew == pytest.approx(-0.0476, abs=0.01)
        if now > 265.0:
            assert reading.time_s == pytest.approx(now, abs=0.01)
    assert clock.basis is Basis.ARRIVAL


def test_stamps_that_tell_time_again_go_on_without_a_new_start():
    clock = on_a_cable()
    for step in range(300):
        now = 200.0 + 0.1 * step
        stamp_s = 20.0 if 210.0 < now < 215.0 else now - 100.0
        reading = clock.read(stamp_s, now, (47.0, float(step)))
        assert reading is None or reading.leap_s == 0.0
    assert clock.basis is Basis.STAMPS
    assert reading.time_s == pytest.approx(now)


@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 2.0)), max_size=60), st.floats(0.0, 4e6)
)
def test_stamps_of_a_clock_that_is_right_are_never_doubted_however_late_they_come(steps, start_s):
    sense, sent_s, now = StampSense(), start_s, 0.0
    for number, (passed_s, late_s) in enumerate(steps):
        sent_s += 0.05 + passed_s
        now = max(now, sent_s - start_s + late_s)
        sense.note(sent_s, (47.0, float(number)), now)
    assert sense.fault is None
