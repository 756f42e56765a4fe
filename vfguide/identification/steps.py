"""What is flown to learn how an autopilot answers: steps of course on one leg, of speed on the other."""

import math
from dataclasses import dataclass
from enum import Enum

from vfguide.guidance.airframe import bank_limited_turn_rate
from vfguide.state import Airframe

COURSE_STEP = math.radians(15.0)
"""Greatest step of the course, rad."""

SPEED_STEP = 2.0
"""Greatest step of the airspeed, m/s."""

LIMIT_SHARE = 0.6
"""Part of the turn rate and of the acceleration that steps may take: at a limit nothing is learned."""

SPEED_MARGIN = 0.5
"""Kept from the ends of the airspeed range, m/s."""

COURSE_HOLDS_S = (6.0, 5.0, 7.0, 5.5)
SPEED_HOLDS_S = (10.0, 9.0, 11.0, 9.5)
"""How long each of a group of steps lasts; different, so that no period hides in them."""

SETTLE_S = 8.0
"""Straight on, before anything is measured."""

TURN_S = 14.0
"""For each half of the turn back."""


class Phase(Enum):
    """What a segment is for."""

    SETTLE = "settle"
    """Nothing is measured."""
    COURSE = "course"
    """Steps of the course."""
    SPEED = "speed"
    """Steps of the airspeed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A setpoint that is held for a while."""

    phase: Phase
    """What for."""
    course: float
    """Relative to the first course, rad."""
    speed: float
    """m/s, of the kind that the vehicle holds."""
    duration_s: float
    """How long."""


def course_step(airframe: Airframe) -> float:
    """Step of the course (rad) that stays clear of the bank limit."""
    greatest = bank_limited_turn_rate(airframe.max_bank, airframe.cruise)
    return min(COURSE_STEP, LIMIT_SHARE * greatest / airframe.alpha)


def speed_step(airframe: Airframe) -> float:
    """Step of the airspeed (m/s) that stays clear of the acceleration limit and the airspeed range."""
    room = min(airframe.airspeed_max - airframe.cruise, airframe.cruise - airframe.airspeed_min)
    by_limit = LIMIT_SHARE * airframe.max_acceleration / airframe.beta
    return max(min(SPEED_STEP, room - SPEED_MARGIN, by_limit), 0.0)


def segments(airframe: Airframe, repeats: int) -> list[Segment]:
    """Out with steps of course, a turn, and back with steps of speed.

    Args:
        airframe: what the vehicle can do; its cruise is the speed of everything.
        repeats: how often each group of steps is flown.
    """
    cruise, back = airframe.cruise, math.pi
    turn, push = course_step(airframe), speed_step(airframe)

    def straight(course: float, duration_s: float) -> Segment:
        return Segment(phase=Phase.SETTLE, course=course, speed=cruise, duration_s=duration_s)

    steps = [straight(0.0, SETTLE_S)]
    for _ in range(repeats):
        for share, hold_s in zip((1.0, 0.0, -1.0, 0.0), COURSE_HOLDS_S, strict=True):
            steps.append(
                Segment(phase=Phase.COURSE, course=share * turn, speed=cruise, duration_s=hold_s)
            )
    steps += [straight(back / 2.0, TURN_S), straight(back, TURN_S), straight(back, SETTLE_S)]
    for _ in range(repeats):
        for share, hold_s in zip((1.0, 0.0, -1.0, 0.0), SPEED_HOLDS_S, strict=True):
            speed = cruise + share * push
            steps.append(Segment(phase=Phase.SPEED, course=back, speed=speed, duration_s=hold_s))
    return steps


def described(airframe: Airframe, repeats: int) -> list[str]:
    """The plan in words, for the crew that has to clear the sky for it."""
    flown = segments(airframe, repeats)
    course_s = sum(one.duration_s for one in flown if one.phase is Phase.COURSE)
    speed_s = sum(one.duration_s for one in flown if one.phase is Phase.SPEED)
    total_s = sum(one.duration_s for one in flown)
    out_m = (SETTLE_S + course_s) * airframe.cruise
    back_m = (SETTLE_S + speed_s) * airframe.cruise
    return [
        (
            f"steps of {math.degrees(course_step(airframe)):.0f} degrees either way of the present course,"
            f" {course_s:.0f} s at {airframe.cruise:g} m/s"
        ),
        f"a turn to the right, back along the way it came, {2.0 * TURN_S:.0f} s",
        f"steps of {speed_step(airframe):.1f} m/s either way, {speed_s:.0f} s",
        (
            f"{total_s:.0f} s in all; keep {out_m:.0f} m ahead, {max(back_m - out_m, 0.0):.0f} m behind and"
            " 300 m to the right clear, and more in wind"
        ),
    ]
