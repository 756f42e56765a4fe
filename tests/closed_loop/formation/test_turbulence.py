"""Followers in turbulence: they keep their slots without rolling after every wobble of their leader."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.geometry import slot_error
from vfguide.mission import Mission
from vfguide.mission.flight_path import path_of
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

MissionWith = Callable[..., Mission]

SETTLED_S = 60.0


def roll_rate(record: FlightRecord, vehicle: VehicleRecord) -> float:
    """Root mean square of how fast a vehicle rolls once all are in their slots, rad/s."""
    late = record.time_s >= SETTLED_S
    rates = np.gradient(vehicle.bank_rad[late], record.time_s[late])
    return float(np.sqrt(np.mean(rates**2)))


def test_followers_roll_no_more_than_their_leader_and_reach_no_limit(
    mission_with: MissionWith,
) -> None:
    mission = mission_with(
        "ardupilot-sitl",
        wind={"turbulence": "moderate"},
        rehearsal={"duration_s": 120.0},
    )
    record = fly_lockstep(mission).record
    leader = roll_rate(record, record.leader)
    # With slots in the measured frame it was 3 to 4 times the leader's, and half of all setpoints at a limit.
    assert max(roll_rate(record, one) for one in record.followers) < 1.4 * leader
    late = record.time_s >= SETTLED_S
    limited = [float(one.limited[late].mean()) for one in record.followers]
    assert max(limited) < 0.05


def test_followers_hold_the_slots_of_the_formation_as_it_is_meant(
    mission_with: MissionWith,
) -> None:
    mission = mission_with(
        "ardupilot-sitl", wind={"turbulence": "light"}, rehearsal={"duration_s": 120.0}
    )
    record = fly_lockstep(mission).record
    path = path_of(mission.path)
    places = zip(record.leader.north_m, record.leader.east_m, strict=True)
    course = np.array([path.nearest(float(n), float(e)).course for n, e in places])
    meant = replace(record.leader, course_rad=course)
    late = record.time_s >= SETTLED_S
    off_m = [slot_error(meant, one).distance_m[late].mean() for one in record.followers]
    # 3.9 m with slots in the measured frame.
    assert float(np.mean(off_m)) < 2.6
