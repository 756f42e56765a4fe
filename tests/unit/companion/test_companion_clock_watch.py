"""What a pilot hears of a clock that loses time, stutters, or runs slow, at 25 reports a second."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.companion.alerts import Alerts
from vfguide.companion.timing import ClockWatch
from vfguide.guidance.other_clock import CABLE, OtherClock

BOOTED_S = 50.0
BEGINS_S = 100.0
FLIGHT_S = 340.0

Lag = Callable[[float], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hiccup:
    """The clock stands still for `depth` seconds and makes up for it within `regained` seconds."""

    at: float
    depth: float
    regained: float

    def lag(self, time_s: float) -> float:
        passed = time_s - self.at
        if passed < self.depth:
            return max(passed, 0.0)
        return self.depth * max(1.0 - (passed - self.depth) / self.regained, 0.0)


def slip(lost_s: float, at: float) -> Lag:
    """The clock stands still for `lost_s`, and never makes up for it."""
    return lambda time_s: min(max(time_s - at, 0.0), lost_s)


def heard(
    lag: Lag,
    *,
    duration_s: float = FLIGHT_S,
    ways: tuple[float, float] = (0.001, 0.02),
    rate: float = 1.0,
    answers: bool = True,
    seed: int = 1,
) -> list[tuple[float, str]]:
    """All texts and when they came, s after the first report.

    Args:
        lag: of the autopilot's clock, by s after the first report.
        duration_s: of the flight.
        ways: shortest and longest time that a message is under way, s; each has its own.
        rate: seconds of the autopilot for each second of the companion.
        answers: whether TIMESYNC is answered.
        seed: of the ways.
    """
    alerts, random = Alerts(), Random(seed)
    clock = OtherClock(CABLE, least_way_s=0.0)
    watch = ClockWatch(clock, alerts)

    def boot_time(time_s: float) -> float:
        return rate * (time_s - lag(time_s)) + BOOTED_S

    def way() -> float:
        return random.uniform(*ways)

    def reports() -> Iterator[tuple[float, float, float]]:
        for step in range(round(25 * duration_s)):
            made_s = step / 25
            # An autopilot that stands still says nothing.
            if boot_time(made_s) > boot_time(made_s - 1e-3):
                yield made_s + way(), math.nan, boot_time(made_s)

    def replies() -> Iterator[tuple[float, float, float]]:
        for step in range(round(2 * duration_s) if answers else 0):
            asked_s = step / 2 + 0.007
            there_s = asked_s + way()
            yield there_s + way(), asked_s, boot_time(there_s)

    said = []
    for time_s, asked_s, boot_time_s in sorted([*reports(), *replies()]):
        now = time_s + BEGINS_S
        if math.isnan(asked_s):
            assert clock.read(round(boot_time_s, 3), now) is not None
        else:
            clock.answer(asked_s + BEGINS_S, boot_time_s, now)
        watch.note(now)
        said += [(time_s, one.text) for one in alerts.heard(now)]
    return said


def stutters(hiccups: list[Hiccup]) -> Lag:
    return lambda time_s: max((one.lag(time_s) for one in hiccups), default=0.0)


def evenly(depths: Callable[[Random], float], *, apart_s: float, regained_s: float) -> Lag:
    """Hiccups all flight long, by their place in it: quick to look up."""
    random = Random(5)
    hiccups = [
        Hiccup(at=number * apart_s + 0.3, depth=depths(random), regained=regained_s)
        for number in range(int(FLIGHT_S / apart_s) + 1)
    ]
    return lambda time_s: hiccups[int(time_s / apart_s)].lag(time_s)


@settings(max_examples=15)
@given(
    st.lists(
        st.builds(
            Hiccup,
            at=st.floats(1.0, 110.0),
            depth=st.floats(0.02, 0.09),
            regained=st.floats(0.02, 4.0),
        ),
        max_size=60,
    ),
    st.integers(0, 1000),
)
def test_no_hiccups_that_are_regained_are_lost_time(hiccups, seed):
    said = heard(stutters(hiccups), duration_s=120.0, seed=seed)
    assert not [text for _, text in said if "lost" in text]
    assert len(said) <= 1


def test_hiccups_behind_a_slow_link_are_no_rate_of_the_clock():
    """Ways of up to 0.1 s and hiccups of 0.09 s may look like 1 % for ten seconds."""
    lag = evenly(lambda random: random.uniform(0.02, 0.09), apart_s=3.0, regained_s=2.2)
    said = heard(lag, ways=(0.001, 0.1))
    assert not [text for _, text in said if "runs" in text or "lost" in text]


def test_a_clock_that_stutters_again_and_again_is_told_once_in_a_flight():
    """By up to 0.09 s, of which an answer shows all but the question's way of at least 0.001 s."""
    said = heard(evenly(lambda _: 0.09, apart_s=1.5, regained_s=0.7))
    ((time_s, text),) = said
    assert time_s < 100.0
    assert text.startswith("the autopilot's clock stutters by up to 0.0")
    assert text.endswith("s and catches up: the computer it runs on is busy")


@pytest.mark.parametrize(
    ("lost_s", "answers"), [(0.2, True), *product([0.3, 1.0, 5.0], [True, False])]
)
def test_lost_time_is_told_within_3_s_with_its_figure(lost_s, answers):
    ((time_s, text),) = heard(slip(lost_s, 60.0), answers=answers)
    assert 60.0 + lost_s < time_s < 63.0 + lost_s
    assert f"has lost {lost_s:.1f} s" in text


@pytest.mark.parametrize("lag", [slip(0.17, 60.0), Hiccup(at=30.0, depth=0.5, regained=0.6).lag])
def test_less_than_a_fifth_of_a_second_and_what_is_made_up_for_within_a_second_are_not_told(lag):
    assert heard(lag) == []


def test_a_slip_among_hiccups_is_told_with_its_own_figure():
    hiccups = evenly(lambda _: 0.08, apart_s=1.4, regained_s=0.4)
    lost = slip(1.0, 60.0)
    said = heard(lambda time_s: hiccups(time_s) + lost(time_s))
    ((time_s, text),) = [one for one in said if "lost" in one[1]]
    assert 61.0 < time_s < 66.0
    assert "has lost 1.0 s" in text


def test_two_slips_add_up():
    """Neither 0.15 s is worth a text, both together are 0.3 s."""
    first, second = slip(0.15, 60.0), slip(0.15, 90.0)
    ((time_s, text),) = heard(lambda time_s: first(time_s) + second(time_s))
    assert 90.0 < time_s < 93.5
    assert "has lost 0.3 s" in text


def test_a_slip_soon_after_another_one_was_told_is_told_ten_seconds_after_that():
    first, second = slip(1.0, 60.0), slip(1.5, 66.0)
    (early, one), (late, other) = heard(lambda time_s: first(time_s) + second(time_s))
    assert "has lost 1.0 s" in one
    assert "has lost 1.5 s" in other
    assert early + 10.0 <= late < early + 11.0


@pytest.mark.parametrize("rate", [0.99, 0.9, 1.02])
def test_a_clock_that_runs_slow_or_fast_is_told_as_a_rate_and_not_as_lost(rate):
    """A second of the autopilot takes 1 / rate seconds."""
    ((_, text),) = heard(lambda _: 0.0, rate=rate, duration_s=120.0, ways=(0.001, 0.004))
    skew = 1.0 / rate - 1.0
    assert f"runs {abs(skew):.1%} {'slow' if skew > 0.0 else 'fast'}" in text


@pytest.mark.parametrize("share", [0.02, 0.05])
def test_a_clock_that_runs_slow_from_some_moment_on_is_told_as_a_rate(share):
    """Of each second from the 60th on it loses this share: a second of its own takes 1 / (1 - share)."""
    said = heard(
        lambda time_s: share * max(time_s - 60.0, 0.0), duration_s=120.0, ways=(0.001, 0.004)
    )
    assert [text for _, text in said if "lost" in text] == []
    assert any(f"runs {1.0 / (1.0 - share) - 1.0:.1%} slow" in text for _, text in said)


def test_a_clock_that_loses_time_unevenly_and_goes_on_doing_so_is_told_as_lost():
    # 0.4 s every 1.7 s, never made up for.
    def lag(time_s: float) -> float:
        return 0.4 * int(time_s / 1.7) + min(max(time_s % 1.7 - 1.3, 0.0), 0.4)

    assert any("has lost" in text for _, text in heard(lag, duration_s=60.0))


def test_two_clocks_that_drift_apart_lose_no_time():
    """200 ppm, twice what quartzes do, are 0.36 s in half an hour: a slip is told from 0.2 s on."""
    assert heard(lambda _: 0.0, rate=1.0 - 200e-6, duration_s=1800.0) == []


def test_answers_of_an_autopilot_that_reports_no_position_yet_show_no_lost_time(alerts):
    clock = OtherClock(CABLE, least_way_s=0.0)
    watch = ClockWatch(clock, alerts)
    for step in range(120):
        now = BEGINS_S + 0.5 * step
        clock.answer(now - 0.01, now - BOOTED_S, now)
        watch.note(now)
    assert alerts.heard(now) == []
