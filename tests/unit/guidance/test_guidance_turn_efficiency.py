"""How much a vehicle turns of what its bank says."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from vfguide.guidance.turn_efficiency import TurnEfficiency, learned

PERIOD = 0.04
BANK = math.atan(0.1 * 20.0 / 9.80665)
"""rad; at 20 m/s its coordinated turn is 0.1 rad/s."""


def flown(
    seconds: float, share: float, *, bank: float = BANK, begin: TurnEfficiency | None = None
) -> TurnEfficiency:
    known = begin or TurnEfficiency()
    for _ in range(round(seconds / PERIOD)):
        turn_rate = share * 9.80665 * math.tan(bank) / 20.0
        known = learned(known, bank=bank, airspeed=20.0, turn_rate=turn_rate, period=PERIOD)
    return known


def test_one_report_by_hand():
    # By the bank 0.1 rad/s, turned 0.07. Variance 0.0225 + 0.005² * 0.04 = 0.022501, noise 0.0004 * 2 / 0.04
    # = 0.02: gain 0.0022501 / (0.00022501 + 0.02) = 0.111254; the surprise is 0.07 - 0.9 * 0.1 = -0.02.
    before = replace(TurnEfficiency(), by_bank=0.1, turn_rate=0.07, seen_s=5.0)
    after = learned(before, bank=BANK, airspeed=20.0, turn_rate=0.07, period=PERIOD)
    assert after.value == pytest.approx(0.9 - 0.111254 * 0.02, abs=1e-6)
    assert after.variance == pytest.approx((1.0 - 0.0111254) * 0.022501, abs=1e-8)


@pytest.mark.parametrize("bank", [BANK, -BANK, 3.0 * BANK])
@pytest.mark.parametrize("share", [1.0, 0.745, 0.6])
def test_a_minute_of_turning_tells(share, bank):
    known = flown(60.0, share, bank=bank)
    assert known.is_known
    assert known.value == pytest.approx(share, abs=0.03)


def test_it_is_slow():
    # Information of a turn of 0.1 rad/s: 0.01 / (0.0004 * 2) = 12.5 a second; the prior's is 44.
    assert not flown(20.0, 0.745).is_known
    changed = flown(8.0, 0.85, begin=flown(120.0, 0.75))
    assert changed.value == pytest.approx(0.765, abs=0.015)


def test_straight_flight_tells_nothing():
    known = flown(600.0, 0.5, bank=math.radians(4.0))
    unknown = TurnEfficiency()
    assert (known.value, known.variance) == (unknown.value, unknown.variance)


@pytest.mark.parametrize(("share", "found"), [(0.1, 0.5), (2.0, 1.1)])
def test_what_no_vehicle_does_is_not_believed(share, found):
    assert flown(120.0, share).value == found


def test_after_a_silence_the_first_turn_rate_is_that_of_nothing():
    known = flown(60.0, 0.745)
    silent = learned(known, bank=BANK, airspeed=20.0, turn_rate=3.0, period=5.0)
    assert silent.seen_s == 0.0
    assert silent.value == known.value


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
