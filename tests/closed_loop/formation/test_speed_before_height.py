"""Speed before height: who has no energy for both catches up first, and climbs or descends after that.

The aircraft is one whose height hold takes the energy first, as if its autopilot preferred height: what it
prefers is the companions' doing.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sitl_stub import AirPlant, AirRates, AirState, plant
from sitl_stub.geometry import wrap_to_pi
from sitl_stub.loops import GRAVITY_M_S2, bank_limited_turn_rate_rad_s, clamped
from sitl_stub.targets import Targets
from tests.closed_loop.formation.ordered_flights import Flown, height, nearest
from vfguide.elementwise import FloatArray
from vfguide.lab.report.geometry import slot_error
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

MissionWith = Callable[..., Mission]

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


@pytest.fixture
def fly(mission_with: MissionWith) -> Callable[..., FlightRecord]:
    """Four such aircraft on a line that climbs or descends by 250 m, f3 ahead of its slot or behind it."""

    def make(
        climb_m_s: float, *orders: dict[str, Any], ahead_m: float, until_s: float
    ) -> FlightRecord:
        content = mission_with("shapes").model_dump(exclude_unset=True)
        climb_deg = math.degrees(math.atan(climb_m_s / CRUISE_M_S))
        content["path"] |= {
            "climb_deg": climb_deg,
            "end_height_m": math.copysign(250.0, climb_m_s),
        }
        start = {
            "leader": {"north_m": 0, "east_m": 0},
            "f1": {},
            "f2": {},
            "f3": {"forward_m": ahead_m},
        }
        content["rehearsal"] |= {
            "start": start,
            "rate_hz": RATE_HZ,
            "emulator": {"plant": "weak"},
        }
        content |= {"height_above_origin_m": 400, "wind": {"type": "calm"}, "orders": list(orders)}
        flight = Flown(Mission.model_validate(content))
        flight.until(until_s)
        return flight.record()

    return make


def away(record: FlightRecord) -> FloatArray:
    """How far f3 is from its slot in the plane, m."""
    return slot_error(record.leader, record.followers[-1]).distance_m


def arrived_s(record: FlightRecord) -> float:
    """When f3 has come within 1 m of its slot, to stay."""
    return float(record.time_s[np.flatnonzero(away(record) > 1.0)[-1]])


def test_who_is_behind_in_a_climb_gets_its_speed_by_climbing_later(
    fly: Callable[..., FlightRecord],
) -> None:
    record = fly(CLIMB_M_S, ahead_m=-AWAY_M, until_s=110.0)
    below = height(record, "f3")
    # At 0.25 m/s² it would have caught up 0.5 * 0.25 * 16² = 32 of the 60 m after 16 s, at best.
    assert away(record)[round(16.0 * RATE_HZ)] < 5.0
    # 28 m/s instead of 20 are (28² - 20²) / 2g = 20 m of height, and 3.5 m/s of climb that it does without
    # for some 8 s are 28 m. While the path climbs at nearly all that it can, it does not get them back ...
    assert -50.0 < below.min() < -10.0
    assert arrived_s(record) < 25.0
    # ... and after that it does, from below and without leaving its slot.
    assert below.max() < 1.0
    assert below[-1] == pytest.approx(0.0, abs=0.5)
    assert nearest(record, 0.0) >= 10.0


def test_who_is_ahead_in_a_descent_loses_its_speed_by_descending_later(
    fly: Callable[..., FlightRecord],
) -> None:
    record = fly(-SINK_M_S, ahead_m=AWAY_M, until_s=60.0)
    above = height(record, "f3")
    # At 0.15 m/s² it would take sqrt(2 * 60 / 0.15) = 28 s to fall back 60 m, and as long to get its
    # speed again.
    assert arrived_s(record) < 40.0
    assert above.max() > 10.0
    assert above.min() > -1.0
    assert nearest(record, 0.0) >= 10.0


def test_who_has_energy_for_both_gives_no_height_up(fly: Callable[..., FlightRecord]) -> None:
    # 2.5 of 4 m/s leave 1.2 m/s², more than a slot takes that moves ahead.
    ahead = {"at_s": 30.0, "slots": {"f3": {"forward_m": -25, "right_m": 40}}}
    record = fly(1.5, ahead, ahead_m=0.0, until_s=50.0)
    moved = record.time_s >= 30.0
    assert record.followers[-1].airspeed_m_s[moved].max() > CRUISE_M_S + 1.0
    assert away(record)[moved].max() < 0.5
    assert np.abs(height(record, "f3")[moved]).max() < 0.5
