"""How much a vehicle turns of what its bank says, from legs whose figures are computed by hand."""

import math

import pytest

from vfguide.identification.flown import slip_line
from vfguide.identification.slip import (
    Bank,
    Banks,
    Estimate,
    Slip,
    SlipLeg,
    legs_of,
    scale_and_lead,
    turn_efficiency,
)

PERIOD = 0.05
SPEED = 20.0

BANK = math.atan(0.1 * SPEED / 9.80665)
"""rad; its coordinated turn is 0.1 rad/s."""


def circling(
    efficiency: float,
    *,
    bank: float = BANK,
    trim: float = 0.0,
    shown: float = SPEED,
    lead_s: float = 0.0,
) -> list[Bank]:
    """Five legs of 8 s: straight, right, straight, left, right."""
    reports, heading = [], 0.0
    for step in range(800):
        leg = step // 160
        side = (0.0, 1.0, 0.0, -1.0, 1.0)[leg]
        turn_rate = efficiency * side * 9.80665 * math.tan(bank) / SPEED
        reports.append(
            Bank(
                time_s=step * PERIOD,
                leg=leg,
                heading=math.remainder(heading, math.tau),
                bank=side * bank + trim,
                airspeed=shown,
                velocity_north=SPEED * math.cos(heading - lead_s * turn_rate) + 3.0,
                velocity_east=SPEED * math.sin(heading - lead_s * turn_rate) - 4.0,
            )
        )
        heading += turn_rate * PERIOD
    return reports


def test_a_leg_is_what_was_turned_and_what_the_bank_said():
    _, right, _, left, _ = legs_of(circling(0.75), 1.0)
    # 7 s of the turn at 0.1 rad/s before its end's mean over 1 s, 0.5 s more of it in that: 0.75 rad.
    assert right.by_bank == pytest.approx(0.75, abs=0.01)
    assert right.turned == pytest.approx(0.75 * right.by_bank, abs=0.005)
    assert left.turned < -0.5


@pytest.mark.parametrize("efficiency", [1.0, 0.745, 0.5])
@pytest.mark.parametrize("trim", [0.0, math.radians(1.0)])
def test_the_share_that_is_turned_is_found_although_the_roll_is_off_by_a_degree(efficiency, trim):
    found = turn_efficiency(legs_of(circling(efficiency, trim=trim), 1.0))
    assert found.value == pytest.approx(efficiency, abs=0.01)
    assert found.half_width < 0.05


def test_a_sensor_that_shows_too_little_makes_turns_seem_tighter_and_its_scale_is_found_in_wind():
    # 18.7 m/s shown of 20: the bank's turn is 20 / 18.7 = 1.07 times as fast by what is shown.
    assert legs_of(circling(1.0), 1.07)[1].by_bank == pytest.approx(0.75 / 1.07, abs=0.01)
    # The smooth turn rate lags where turns begin and end.
    scale, lead = scale_and_lead(circling(1.0, bank=3.0 * BANK, shown=18.7, lead_s=0.3))
    assert scale.value == pytest.approx(1.0695, abs=0.005)
    assert lead.value == pytest.approx(0.3, abs=0.05)
    assert lead.half_width < 0.05


def test_by_hand_two_turns_of_other_shares_give_their_mean_and_a_wide_interval():
    turns = ((side, side * share) for side in (1.0, -1.0) for share in (0.7, 0.8))
    found = turn_efficiency([SlipLeg(turned=by, by_bank=side, lasts_s=0.0) for side, by in turns])
    assert found.value == pytest.approx(0.75)
    # Residuals 0.05 each, two of four degrees left: sqrt(4 * 0.0025 / 2 / 4) = 0.0354; Student's 95 %: 4.303.
    assert found.half_width == pytest.approx(4.303 * 0.0354, rel=0.01)


def test_who_hardly_turned_tells_nothing():
    assert turn_efficiency(legs_of(circling(0.745, bank=0.002), 1.0)) is None
    assert turn_efficiency([]) is None
    assert Banks().slip() is None


@pytest.mark.parametrize(
    ("share", "slips", "line"),
    [
        *((0.745, True, "  slips: true #"), (1.0, False, "  slips: false #")),
        *((0.88, None, "  # slips is open"), (math.nan, None, "  # slips is open")),
    ],
)
def test_slips_is_said_only_where_the_interval_leaves_no_doubt(share, slips, line):
    efficiency, lead = Estimate(value=share, half_width=0.05), Estimate(value=0.1, half_width=0.02)
    slip = Slip(efficiency=efficiency, lead=lead)
    assert slip.slips is slips
    assert slip_line(slip).startswith(line)
