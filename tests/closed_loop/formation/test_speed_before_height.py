"""Speed before height: who has no energy for both catches up first, and climbs or descends after that.

The aircraft is one whose height hold takes the energy first, as if its autopilot preferred height: what it
prefers is the companions' doing.
"""

import math
from typing import Any

import numpy as np
import pytest

from sitl_stub import AirPlant, AirRates, AirState, plant
from sitl_stub.geometry import wrap_to_pi
from sitl_stub.loops import GRAVITY_M_S2, Targets, bank_limited_turn_rate_rad_s, clamped
from tests.kit.flight import Flight
from tests.kit.formation import Formation
from tests.kit.missions import IN_PLACE, content_of
from vfguide.elementwise import FloatArray
from vfguide.mission import Mission

RATE_HZ = 10.0
AWAY_M = 60.0
CRUISE_M_S = 20.0

CLIMB_M_S, SINK_M_S = 3.5, 2.7
"""Of 4 and 3 m/s that the vehicles keep up at cruise: 0.5 and 0.3 m/s are left, or 0.25 and 0.15 m/s²."""


@plant("weak")
class Weak(AirPlant):
    """Its climb rate takes of its excess of power what it wants, and its speed gets the rest."""

    def rates(self, targets: Targets, state: AirState) -> AirRates:
        limits = self.parameters
        off = wrap_to_pi(targets.turn.angle_rad - state.course_rad)
        wanted = limits.beta_1_s * (targets.speed.speed_m_s - state.airspeed_m_s)
        share = GRAVITY_M_S2 / state.airspeed_m_s
        slowest = -share * (limits.sink_rate_max_m_s + state.climb_m_s)
        fastest = share * (limits.climb_rate_max_m_s - state.climb_m_s)
        turn = bank_limited_turn_rate_rad_s(limits.max_bank_rad, state.airspeed_m_s)
        return AirRates(
            turn_rate_rad_s=clamped(limits.alpha_1_s * off, turn),
            acceleration_m_s2=min(max(wanted, slowest), fastest),
        )


def fly(climb_m_s: float, *orders: dict[str, Any], ahead_m: float, until_s: float) -> Flight:
    """Four such aircraft on a line that climbs or descends by 250 m, f3 ahead of its slot or behind it."""
    content = content_of("shapes")
    climb_deg = math.degrees(math.atan(climb_m_s / CRUISE_M_S))
    content["path"] |= {"climb_deg": climb_deg, "end_height_m": math.copysign(250.0, climb_m_s)}
    start = {**IN_PLACE, "f3": {"forward_m": ahead_m}}
    content["rehearsal"] |= {"start": start, "rate_hz": RATE_HZ, "emulator": {"plant": "weak"}}
    content |= {"height_above_origin_m": 400, "wind": {"type": "calm"}, "orders": list(orders)}
    flight = Formation(Mission.model_validate(content))
    return flight.fly(until_s)


def away(flown: Flight) -> FloatArray:
    """How far f3 is from its slot in the plane, m."""
    return flown.errors()[-1]


def arrived_s(flown: Flight) -> float:
    """When f3 has come within 2 m of its slot, to stay."""
    return float(flown.record.time_s[np.flatnonzero(away(flown) > 2.0)[-1]])


def test_who_is_behind_in_a_climb_gets_its_speed_by_climbing_later():
    flown = fly(CLIMB_M_S, ahead_m=-AWAY_M, until_s=110.0)
    below = flown.height("f3")
    # At 0.25 m/s² it would have caught up 0.5 * 0.25 * 16² = 32 of the 60 m after 16 s, at best.
    assert away(flown)[round(16.0 * RATE_HZ)] < 5.0
    # 28 m/s instead of 20 are (28² - 20²) / 2g = 20 m of height, and 3.5 m/s of climb that it does without
    # for some 8 s are 28 m. While the path climbs at nearly all that it can, it does not get them back ...
    assert -50.0 < below.min() < -10.0
    assert arrived_s(flown) < 25.0
    # ... and after that it does, from below and without leaving its slot.
    assert below.max() < 1.0
    assert below[-1] == pytest.approx(0.0, abs=0.5)
    assert flown.nearest() >= 10.0


def test_who_is_ahead_in_a_descent_loses_its_speed_by_descending_later():
    flown = fly(-SINK_M_S, ahead_m=AWAY_M, until_s=60.0)
    above = flown.height("f3")
    # At 0.15 m/s² it would take sqrt(2 * 60 / 0.15) = 28 s to fall back 60 m, and as long to get its
    # speed again.
    assert arrived_s(flown) < 40.0
    assert above.max() > 10.0
    assert above.min() > -1.0
    assert flown.nearest() >= 10.0


def test_who_has_energy_for_both_gives_no_height_up():
    # 2.5 of 4 m/s leave 1.2 m/s², more than a slot takes that moves ahead.
    ahead = {"at_s": 30.0, "slots": {"f3": {"forward_m": -25, "right_m": 40}}}
    flown = fly(1.5, ahead, ahead_m=0.0, until_s=50.0)
    moved = flown.record.time_s >= 30.0
    assert flown.record.followers[-1].airspeed_m_s[moved].max() > CRUISE_M_S + 1.0
    assert away(flown)[moved].max() < 0.5
    assert np.abs(flown.height("f3")[moved]).max() < 0.5
