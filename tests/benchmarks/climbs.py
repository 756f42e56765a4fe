"""How well slots are held in space on climbs, an eight and a route, in smooth air and in gusts.

Through MAVLink bytes in lockstep, in the article's wind and with moderate turbulence on top. Distances over
the second half of each flight: level, of the height alone and in space, from the slots in the leader's own
frame; and level, from the slots as the formation means them (the leader's true place, the course of its path
there): the mean, and in gusts also the greatest. Climbs take up all of that half, and the two missions are
flown as they are shipped.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import vfguide
from tests.benchmarks.results import Cases
from tests.kit.missions import mission_with, replaced, shipped
from vfguide.lab.report.figures import intended_leader, slot_error
from vfguide.mission import Mission

CLIMB_DEG = math.degrees(math.atan(0.15))
"""3 m/s at 20 m/s over ground."""

CIRCLE: dict[str, Any] = {
    "centre": {"north_m": 200.0, "east_m": 0.0},
    "radius_m": 200.0,
    "gain": 0.015,
}

CLIMBS: dict[str, dict[str, Any]] = {
    "line, 3 m/s up": {"type": "line", "course_deg": 0.0, "gain": 0.015, "climb_deg": CLIMB_DEG},
    "helix, 3 m/s up": {"type": "helix", **CIRCLE, "climb_deg": CLIMB_DEG, "end_height_m": 2000.0},
    "circle, level": {"type": "circle", **CIRCLE},
}
AIR = {"": {}, ", turbulence": {"wind.turbulence": "moderate"}}


@dataclass(frozen=True)
class Flown:
    """A flight of the table, and what is required of it."""

    name: str
    mission: Mission
    mean_m: float
    """Mean distance in space in smooth air, and from the slots as meant in gusts, m."""
    greatest_m: float = math.inf
    """Greatest distance, m: from the slots as they are in smooth air, as meant in gusts."""


def flights() -> list[Flown]:
    """The flights."""
    climbing = mission_with("climb-and-turn", rehearsal={"duration_s": 150})
    climbs = [
        Flown(name, replaced(climbing, path=path), mean_m=0.15) for name, path in CLIMBS.items()
    ]
    routes = [
        Flown(name, shipped(name), mean_m=0.3, greatest_m=2.0)
        for name in ("figure-eight", "survey-plan")
    ]
    return climbs + routes


def greatest_as_meant_m(flight: vfguide.Flight) -> float:
    """Greatest level distance from the slots as meant over the second half, m."""
    meant = intended_leader(flight.record.reference)
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    distances = [slot_error(meant, one).distance_m[settled] for one in flight.record.followers]
    return float(np.nanmax(distances))


def cases() -> Cases:
    """Fly all, in smooth air and in gusts."""
    for one in flights():
        for air, settings in AIR.items():
            flight = vfguide.fly(one.mission, settings=settings)
            summary, greatest_m = flight.summary, greatest_as_meant_m(flight)
            formation = summary.formation
            followers = [each for each in summary.vehicles.values() if each.role == "follower"]
            counted_m = formation.intended_error_m if settings else formation.mean_error_3d_m
            held = counted_m <= one.mean_m
            held &= (greatest_m if settings else formation.max_error_m) <= one.greatest_m
            most = "" if math.isinf(one.greatest_m) else f", {one.greatest_m:g}"
            yield (
                f"{one.name}{air}",
                {
                    "mean_m": formation.mean_error_m,
                    "max_m": formation.max_error_m,
                    "height_m": sum(each.height_error_m.mean for each in followers)
                    / len(followers),
                    "space_m": formation.mean_error_3d_m,
                    "meant_m": formation.intended_error_m,
                    "meant_max_m": greatest_m,
                    "wanted": f"{one.mean_m:g}{most}{'' if held else ': missed'}",
                },
            )
