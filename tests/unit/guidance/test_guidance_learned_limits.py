"""What is learned of an aircraft in turns: how far it banks, what a bank turns, its airspeed's scale."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.flight import fly
from tests.kit.missions import shipped
from vfguide.guidance.air_data import (
    Calibration,
    CreepingHold,
    CreepingSpeed,
    TurnEfficiency,
    calibrated,
    learned,
)
from vfguide.guidance.airframe import BankLimit, BankMoment
from vfguide.mission.load import with_overrides
from vfguide.mission.overrides import Overrides, parse_settings

PERIOD, ALPHA = 0.1, 0.8


def asked(time_s: float) -> float:
    """To one side by 45 degrees for 5 s, by 12 degrees for 5 s, then to the other side, rad."""
    turn = math.radians(45.0 if time_s % 10.0 < 5.0 else 12.0)
    return turn if time_s % 20.0 < 10.0 else -turn


def limit_of(
    flown: Callable[[float], float],
    *,
    seconds: float = 40.0,
    wanted: Callable[[float], float] = asked,
) -> BankLimit:
    """What is known after some seconds of an aircraft that banks so, by what it is asked for."""
    learner, bank = BankLimit(), 0.0
    for step in range(round(seconds / PERIOD)):
        time_s = step * PERIOD
        bank += PERIOD / (0.3 + PERIOD) * (flown(wanted(time_s)) - bank)
        error = math.tan(wanted(time_s)) / ALPHA
        learner.observe(BankMoment(time_s=time_s, bank=bank, asked=error), late=0.5)
    return learner


def within(degrees: float) -> Callable[[float], float]:
    most = math.radians(degrees)
    return lambda wanted: min(max(wanted, -most), most)


def test_a_bank_that_is_never_passed_although_more_is_asked_is_its_limit_until_it_is_passed():
    learner = limit_of(within(25.0))
    assert math.degrees(learner.value) == pytest.approx(25.0, abs=0.5)
    for step in range(60):
        moment = BankMoment(time_s=40.0 + step * PERIOD, bank=math.radians(32.0), asked=1.0)
        learner.observe(moment, late=0.5)
    assert learner.value is None


@pytest.mark.parametrize(
    ("flown", "options"),
    [
        # One plateau is none.
        (within(25.0), {"seconds": 9.0}),
        # What follows is asked for no more than it banks, in a steady turn as well.
        (lambda wanted: wanted, {}),
        (lambda wanted: wanted, {"wanted": lambda _: 0.4}),
        # One that answers a third as fast as was thought.
        (lambda wanted: wanted / 3.0, {}),
    ],
)
def test_nothing_else_is_taken_for_a_limit(flown, options):
    assert limit_of(flown, **options).value is None


def test_an_aircraft_that_banks_less_than_its_mission_says_is_flown_by_what_it_does():
    settings = ["rehearsal.emulator.max_bank_deg=22", "rehearsal.duration_s=60", "wind.type=calm"]
    mission = with_overrides(shipped("circle-wind"), Overrides(settings=parse_settings(settings)))
    heard = [text for text in fly(mission).texts() if text.startswith("it banks no further than")]
    assert heard
    assert len(heard) <= 4
    assert all("for the mission: max_bank_deg: 2" in text for text in heard)


TURN_S = 0.04
BANK = math.atan(0.1 * 20.0 / 9.80665)
"""rad; at 20 m/s its coordinated turn is 0.1 rad/s."""


def efficiency_after(
    seconds: float, share: float, *, bank: float = BANK, begin: TurnEfficiency | None = None
) -> TurnEfficiency:
    known = begin or TurnEfficiency()
    for _ in range(round(seconds / TURN_S)):
        turn_rate = share * 9.80665 * math.tan(bank) / 20.0
        known = learned(known, bank=bank, airspeed=20.0, turn_rate=turn_rate, period=TURN_S)
    return known


def test_one_report_by_hand():
    # By the bank 0.1 rad/s, turned 0.07. Variance 0.0225 + 0.005² * 0.04 = 0.022501, noise 0.0004 * 2 / 0.04
    # = 0.02: gain 0.0022501 / (0.00022501 + 0.02) = 0.111254; the surprise is 0.07 - 0.9 * 0.1 = -0.02.
    before = replace(TurnEfficiency(), by_bank=0.1, turn_rate=0.07, seen_s=5.0)
    after = learned(before, bank=BANK, airspeed=20.0, turn_rate=0.07, period=TURN_S)
    assert after.value == pytest.approx(0.9 - 0.111254 * 0.02, abs=1e-6)
    assert after.variance == pytest.approx((1.0 - 0.0111254) * 0.022501, abs=1e-8)


@pytest.mark.parametrize("bank", [BANK, -BANK, 3.0 * BANK])
@pytest.mark.parametrize("share", [1.0, 0.745, 0.6])
def test_a_minute_of_turning_tells(share, bank):
    known = efficiency_after(60.0, share, bank=bank)
    assert known.is_known
    assert known.value == pytest.approx(share, abs=0.03)


def test_it_is_slow():
    # Information of a turn of 0.1 rad/s: 0.01 / (0.0004 * 2) = 12.5 a second; the prior's is 44.
    assert not efficiency_after(20.0, 0.745).is_known
    changed = efficiency_after(8.0, 0.85, begin=efficiency_after(120.0, 0.75))
    assert changed.value == pytest.approx(0.765, abs=0.015)


def test_straight_flight_tells_nothing_and_after_a_silence_the_first_turn_rate_is_that_of_nothing():
    straight, unknown = efficiency_after(600.0, 0.5, bank=math.radians(4.0)), TurnEfficiency()
    assert (straight.value, straight.variance) == (unknown.value, unknown.variance)
    known = efficiency_after(60.0, 0.745)
    silent = learned(known, bank=BANK, airspeed=20.0, turn_rate=3.0, period=5.0)
    assert (silent.seen_s, silent.value) == (0.0, known.value)


@pytest.mark.parametrize(("share", "found"), [(0.1, 0.5), (2.0, 1.1)])
def test_what_no_vehicle_does_is_not_believed(share, found):
    assert efficiency_after(120.0, share).value == found


@pytest.mark.parametrize(
    ("value", "before", "slips"),
    [(0.80, False, True), (0.90, False, False), (0.90, True, True), (0.95, True, False)],
)
def test_between_the_bounds_a_vehicle_stays_what_it_was_taken_for(value, before, slips):
    known = TurnEfficiency(value=value, variance=0.02**2)
    assert known.slips(before=before) is slips
    assert TurnEfficiency(value=value).slips(before=before) is before


SEEN = replace(TurnEfficiency(), by_bank=0.1, turn_rate=0.08, seen_s=10.0)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@given(bank=NUMBERS, airspeed=NUMBERS, turn_rate=NUMBERS, period=NUMBERS)
def test_whatever_is_reported_it_stays_within_its_bounds(bank, airspeed, turn_rate, period):
    known = SEEN
    for _ in range(3):
        known = learned(known, bank=bank, airspeed=airspeed, turn_rate=turn_rate, period=period)
    assert 0.5 <= known.value <= 1.1
    assert 0.0 <= known.variance < 0.1


CALIBRATION_S = 0.05


def calibration_after(
    seconds: float,
    *,
    scale: float = 1.0,
    turn_rate: float = 0.13,
    noise: float = 0,
    swing: float = 0,
) -> Calibration:
    """Reports of 20 m/s from an aircraft that flies `scale` times as fast, wind 4 m/s north, 3 m/s west."""
    known = Calibration()
    for step in range(round(seconds / CALIBRATION_S)):
        heading = turn_rate * step * CALIBRATION_S
        shake = noise * math.sin(1e4 * step) + swing * math.sin(0.3 * step * CALIBRATION_S)
        known = calibrated(
            known,
            reported_airspeed=20.0,
            heading=heading,
            turn_rate=turn_rate,
            velocity_north=scale * 20.0 * math.cos(heading) + 4.0 + shake,
            velocity_east=scale * 20.0 * math.sin(heading) - 3.0 - shake,
            wind_rate=0.0,
            period=CALIBRATION_S,
        )
    return known


@pytest.mark.parametrize("scale", [0.95, 1.0, 1.05, 1.1])
def test_after_two_circles_scale_and_wind_are_known(scale):
    known = calibration_after(96.0, scale=scale, noise=0.2)
    assert known.scale == pytest.approx(scale, abs=0.01)
    assert known.estimate[1:3] == pytest.approx((4.0, -3.0), abs=0.3)
    assert known.deviation < 0.01


def test_on_a_straight_flight_a_wrong_scale_may_be_a_wind_and_what_cannot_be_is_not_used():
    known = calibration_after(120.0, scale=1.05, turn_rate=0.0)
    assert known.scale == pytest.approx(1.0, abs=0.01)
    assert known.deviation > 0.04
    for scale in (0.1, 3.0):
        known = calibration_after(200.0, scale=scale)
        assert 0.85 <= known.scale <= 1.25
        assert not known.is_settled


def test_a_wind_that_swings_by_metres_a_second_is_no_steady_one():
    # 3 m/s at 0.3 rad/s, beside circles at 0.13 rad/s: a steady wind leaves 2 m/s of it unexplained.
    assert calibration_after(96.0).is_settled
    known = calibration_after(96.0, swing=3.0)
    assert not known.is_settled
    assert known.scale == pytest.approx(1.0, abs=0.03)


HOLD = CreepingHold(share=0.5, time=40.0)


class CreepingPlant:
    """A hold that does just that, at once."""

    def __init__(self, airspeed: float) -> None:
        self.trim = self.airspeed = airspeed

    def fly(self, asked: float) -> None:
        self.airspeed = self.trim + HOLD.share * (asked - self.trim)
        self.trim += (asked - self.trim) * PERIOD / HOLD.time


@given(st.lists(st.floats(8.0, 22.0), min_size=1, max_size=60))
def test_nothing_is_asked_for_beyond_the_limits_and_what_they_leave_is_flown(wanted):
    speed, plant, limits = (
        CreepingSpeed(HOLD),
        CreepingPlant(15.0),
        {"slowest": 11.0, "fastest": 19.0},
    )
    for number, one in enumerate(wanted):
        asked = speed.asked_for(one, plant.airspeed, number * PERIOD, **limits)
        plant.fly(asked)
        assert 11.0 <= asked <= 19.0
        if 11.0 < asked < 19.0:
            assert plant.airspeed == pytest.approx(one)


@pytest.mark.parametrize(
    ("reset", "then", "asked"),
    [
        pytest.param(True, (16.0, 16.0, 50.0), 16.0, id="another has flown it"),
        # The trim comes to what was asked for, and not beyond.
        pytest.param(False, (17.0, 16.0, 1000.0), 17.0, id="a gap"),
    ],
)
def test_after_another_or_a_gap_the_airspeed_of_then_counts(reset, then, asked):
    speed, limits = CreepingSpeed(HOLD), {"slowest": 5.0, "fastest": 40.0}
    assert speed.asked_for(16.0, 15.0, 0.0, **limits) == pytest.approx(17.0)
    if reset:
        speed.reset()
    assert speed.asked_for(*then, **limits) == pytest.approx(asked)
