"""A law of one's own: pure pursuit. Each follower flies toward a point that moves ahead of its slot.

    vfguide fly missions/circle-wind.yaml --controller pursuit --plugin examples/own_law.py
    vfguide fly missions/circle-wind.yaml --controller pursuit --set controller.lookahead_m=40 --plugin ...
    vfguide bench --law slot --law pursuit --plugin examples/own_law.py

How far ahead that point lies decides how sharply a follower turns (Coulter, "Implementation of the pure
pursuit path tracking algorithm", 1992); its speed answers the error along track in proportion.
"""

import math

from vfguide.laws import DesiredMotion, Law, Positive, Section, View, approach, law


class PursuitGains(Section):
    """Fields of the mission's `controller:` for `type: pursuit`."""

    lookahead_m: Positive = 25.0
    """How far ahead of its slot a follower aims, m."""

    speed_gain_1_s: Positive = 0.3
    """Speed for the error along track, m/s per m."""


@law("pursuit")
class Pursuit(Law):
    """Pure pursuit of a point ahead of the slot."""

    Gains = PursuitGains

    def step(self, view: View, memory: None) -> tuple[DesiredMotion, None]:
        """Toward the point; the slot's own motion is fed forward."""
        slot, error = view.motion, view.error
        turn = math.atan2(error.cross_track, self.gains.lookahead_m)
        wanted = approach(
            view,
            course=slot.course + turn,
            speed=slot.speed + self.gains.speed_gain_1_s * error.along_track,
            course_rate=slot.turn_rate,
            acceleration=slot.acceleration,
        )
        return wanted, memory
