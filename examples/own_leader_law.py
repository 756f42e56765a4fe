"""A leader's law of one's own: it steers for a point of the path that lies ahead of it.

    vfguide fly survey-racetrack --plugin own_leader_law.py --set leader.law=carrot
    vfguide fly survey-racetrack --set leader.law=carrot --set leader.gains.lookahead_m=60 --plugin ...

How far ahead that point lies decides how sharply the leader comes onto its path (Park, Deyst and How, "A new
nonlinear guidance logic for trajectory tracking", AIAA 2004-4900, steer for such a point).
"""

import math

from vfguide.laws import LeaderLaw, LeaderMotion, LeaderView, Positive, Section, leader_law


class CarrotGains(Section):
    """Fields of the mission's `leader.gains` for `law: carrot`."""

    lookahead_m: Positive = 40.0
    """How far along the path the point lies ahead, m."""


@leader_law("carrot")
class Carrot(LeaderLaw):
    """The leader flies toward a point that moves ahead of it along the path."""

    Gains = CarrotGains

    def step(self, view: LeaderView, memory: None) -> tuple[LeaderMotion, None]:
        """Toward the point; the path's own turning is fed forward."""
        ahead = view.path.at(view.point.progress + self.gains.lookahead_m)
        state = view.state
        course = math.atan2(ahead.east - state.east, ahead.north - state.north)
        motion = self.follow(
            view, course=course, course_rate=view.point.curvature * state.ground_speed
        )
        return motion, memory
