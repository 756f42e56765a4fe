"""A leader that is not heard, carried on along the path that everybody knows.

For a second, dV/dt and omega of its last state say best where a leader is. After that the path does: it is in
the mission, the leader's airspeed is too, and the wind is measured by every follower itself.
"""

from dataclasses import dataclass

from vfguide.angles import wrap_angle
from vfguide.elementwise import Number, clip, like
from vfguide.guidance.low_pass import low_pass
from vfguide.guidance.path import Path, PathPoint
from vfguide.guidance.path_field import (
    desired_course,
    desired_course_rate_per_speed,
    joining_turn_rate,
)
from vfguide.guidance.settings import PathGains
from vfguide.guidance.wind_triangle import ground_speed_on_course, polar
from vfguide.state import LeaderState, VehicleState


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownLeader:
    """What the mission tells about the leader."""

    path: Path
    """Its path."""
    path_gains: PathGains
    """The field around it."""
    airspeed: float
    """Its cruise, m/s."""
    rate_filter_s: float
    """Time constant of its rates, s."""
    height: float = 0.0
    """The mission's flying height, from which the path's heights count, m above the origin."""
    least_radius: float = 0.0
    """It turns no tighter onto its path, m; 0 where that is left to the field."""

    def point_beside(self, leader: LeaderState[Number]) -> PathPoint[Number]:
        """Its path, nearest to where it is."""
        return self.path.nearest_in_space(
            leader.north, leader.east, leader.course, leader.height - self.height
        )


def extrapolate_along_path(
    leader: LeaderState[Number], follower: VehicleState[Number], known: KnownLeader
) -> LeaderState[Number]:
    """The leader at the follower's time, had it kept to its field, its airspeed and the follower's wind.

    One step of at most some tenths of a second; longer silences are made of many.

    Args:
        leader: as last heard, or carried on before.
        follower: navigated state of the follower, later than that.
        known: what the mission tells.
    """
    period = follower.time_s - leader.time_s
    point = known.point_beside(leader)
    field = (known.path_gains.gain, known.path_gains.approach_angle)
    course = desired_course(point, *field)
    airspeed = like(known.airspeed, leader.north)
    wind = (follower.wind_north, follower.wind_east)
    # The speed is that of the middle of the step: taken at its beginning, it would be late all the way
    # round a circle in wind, by decimetres each half turn.
    turn_rate = ground_speed_on_course(airspeed, course, *wind) * desired_course_rate_per_speed(
        point, course, *field
    )
    if known.least_radius > 0.0:
        limit = joining_turn_rate(point, leader.ground_speed, known.least_radius)
        turn_rate = clip(turn_rate + wrap_angle(course - leader.course) / period, -limit, limit)
        course = leader.course
    middle = course + turn_rate * (period / 2.0)
    north, east = polar(ground_speed_on_course(airspeed, middle, *wind) * period, middle)
    course = course + turn_rate * period
    climb_rate = point.slope * ground_speed_on_course(airspeed, middle, *wind)
    ground_speed = ground_speed_on_course(airspeed, course, *wind)
    time_constant = known.rate_filter_s
    return LeaderState(
        time_s=follower.time_s,
        north=leader.north + north,
        east=leader.east + east,
        course=course,
        ground_speed=ground_speed,
        acceleration=low_pass(
            leader.acceleration,
            (ground_speed - leader.ground_speed) / period,
            period,
            time_constant,
        ),
        turn_rate=turn_rate,
        turn_acceleration=low_pass(
            leader.turn_acceleration,
            (turn_rate - leader.turn_rate) / period,
            period,
            time_constant,
        ),
        height=leader.height + climb_rate * period,
        climb_rate=climb_rate,
    )
