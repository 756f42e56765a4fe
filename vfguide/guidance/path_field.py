"""The vector field around a path: which course to fly at each point of the plane.

Nelson, Barber, McLain, Beard: Vector Field Path Following for Miniature Air Vehicles, IEEE Transactions
on Robotics 23(3), 2007; the article's chi^d_l. The article's printed line field is not the path's course
on the path and points away from it on one side; the forms here are the convergent ones.
"""

import math

from vfguide.elementwise import Number, atan, cos, greater_of, sin
from vfguide.guidance.path import PathPoint

NEAR_CENTRE = 0.05
"""Least value of 1 - curvature * error: nearer to a centre of curvature than a twentieth of the radius, the
tangent turns faster than anything could follow, so its rate stops growing there."""


PATH_TURN_SHARE = 1.2
"""A leader that joins a path may turn by so much more than the path itself, to come onto it."""


def desired_course(point: PathPoint[Number], gain: float, approach_angle: float) -> Number:
    """Course of the field, rad: chi^d = chi_p - chi_inf (2/pi) atan(k e).

    On a circle this is the article's gamma + lambda (pi/2 + atan(k (d - R))) when chi_inf is pi/2.

    Args:
        point: the nearest point of the path.
        gain: k, 1/m: how far from the path the field begins to bend.
        approach_angle: chi_inf, rad: the angle to the path far away from it.
    """
    bend = approach_angle * (2.0 / math.pi) * atan(gain * point.cross_track_error)
    return point.course - bend


def desired_course_slope(error: Number, gain: float, approach_angle: float) -> Number:
    """Change of the desired course with the cross-track error, rad/m: -chi_inf (2/pi) k / (1 + (k e)^2)."""
    scaled = gain * error
    return -approach_angle * (2.0 / math.pi) * gain / (1.0 + scaled * scaled)


def joining_turn_rate(
    point: PathPoint[Number], ground_speed: Number, least_radius: float
) -> Number:
    """Greatest turn rate (rad/s) of a leader on its way onto a path: of turns that its formation can fly.

    Args:
        point: the nearest point of the path.
        ground_speed: of the leader, m/s.
        least_radius: of its turns, m; a path that turns tighter itself is followed.
    """
    tightest = PATH_TURN_SHARE * abs(point.curvature)
    return ground_speed * greater_of(tightest, tightest * 0.0 + 1.0 / least_radius)


def tangent_rate_per_speed(point: PathPoint[Number], course: Number) -> Number:
    """Turn rate of the nearest point's tangent for each m/s of ground speed, rad/m.

    The nearest point runs along the path at V_g cos(chi - chi_p) / (1 - curvature e); on a circle this
    makes the tangent turn with the bearing, at (V_g / d) sin(chi - gamma).
    """
    shrink = greater_of(1.0 - point.curvature * point.cross_track_error, NEAR_CENTRE)
    return point.curvature * cos(course - point.course) / shrink


def desired_course_rate_per_speed(
    point: PathPoint[Number], course: Number, gain: float, approach_angle: float
) -> Number:
    """Regressor phi = d(chi^d rate)/dV_g, rad/m: the rate of the desired course is V_g phi.

    The regressor of the ground-speed observer. The article prints "d chi^d/d e . d e/d chi" for it.
    """
    slope = desired_course_slope(point.cross_track_error, gain, approach_angle)
    return tangent_rate_per_speed(point, course) + slope * sin(course - point.course)
