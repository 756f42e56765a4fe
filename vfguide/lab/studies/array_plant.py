"""The emulator's two ideal plants, for thousands of vehicles at once.

Written apart from the emulator on purpose: that both come to the same is a test, not an import.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vfguide.angles import wrap_angle
from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.wind_triangle import ground_speed_on_course
from vfguide.lab.studies.array_ground import Ground, Place
from vfguide.lab.studies.array_wind import SwingingWind
from vfguide.state import Airframe

LONGEST_STEP_S = 0.05
"""Of the integration, as in the emulator."""

LOITER_BANK = math.radians(15.0)
"""Bank to the right before the first setpoint, rad: what an emulated autopilot does unguided."""

LEAST_GROUND_SPEED = 0.1
"""m/s."""


class Motion(NamedTuple):
    """How vehicles move at one instant."""

    turn_rate: FloatArray
    """Of the direction that the plant holds, rad/s."""
    acceleration: FloatArray
    """Of the speed that it holds, m/s²."""
    north: FloatArray
    """Ground velocity, m/s."""
    east: FloatArray
    """Ground velocity, m/s."""


@dataclass(slots=True)
class Targets:
    """What the autopilots hold."""

    course: FloatArray | None
    """rad; None: loitering."""
    speed: FloatArray
    """Airspeed, or for a course-hold plant that is guided ground speed, m/s."""


@dataclass(slots=True)
class Fleet:
    """Vehicles of one kind: leaders in row 0, then their followers; a column is a formation."""

    airframe: Airframe
    """What their holds really are."""
    ground: Ground
    """What they fly over."""
    wind: SwingingWind
    """That of each formation."""
    direction: FloatArray
    """Heading, or for a course-hold plant course, rad."""
    speed: FloatArray
    """The speed held, m/s."""
    place: Place
    """Where they are."""
    targets: Targets
    """What they hold."""

    @property
    def holds_ground_speed(self) -> bool:
        """Whether the speed held is the one over ground."""
        return self.airframe.hold == "course-hold" and self.targets.course is not None

    def guide(self, course: FloatArray, speed: FloatArray, time_s: float) -> None:
        """New setpoints; the first change what a course-hold plant's speed means, not the motion."""
        if self.airframe.hold == "course-hold" and self.targets.course is None:
            self.speed = along_course(self.direction, self.speed, self.wind.at(time_s))
        self.targets = Targets(course, speed)

    def motion(self, time_s: float) -> Motion:
        """The motion now."""
        return self._motion(self.direction, self.speed, self.wind.at(time_s))

    def advance(self, time_s: float, span_s: float) -> None:
        """Fly from this time on for so long, by midpoint steps."""
        count = math.ceil(span_s / LONGEST_STEP_S - 1e-6)
        for index in range(count):
            self._step(time_s + index * span_s / count, span_s / count)

    def _step(self, time_s: float, step_s: float) -> None:
        half = 0.5 * step_s
        begun = self._motion(self.direction, self.speed, self.wind.at(time_s))
        wind = self.wind.at(time_s + half)
        direction = self.direction + half * begun.turn_rate
        speed = self.speed + half * begun.acceleration
        if self.holds_ground_speed:
            speed = self._flyable(direction, speed, wind)
        middle = self._motion(direction, speed, wind)
        self.direction = self.direction + step_s * middle.turn_rate
        speed = self.speed + step_s * middle.acceleration
        if self.holds_ground_speed:
            self.speed = self._flyable(self.direction, speed, self.wind.at(time_s + step_s))
        else:
            self.speed = np.clip(speed, self.airframe.airspeed_min, self.airframe.airspeed_max)
        self.place = self.ground.advance(self.place, step_s * middle.north, step_s * middle.east)

    def _motion(
        self, direction: FloatArray, speed: FloatArray, wind: tuple[FloatArray, FloatArray]
    ) -> Motion:
        if self.airframe.hold == "heading-hold":
            north = speed * np.cos(direction) + wind[0]
            east = speed * np.sin(direction) + wind[1]
            course, turning_speed = np.arctan2(east, north), speed
        else:
            over_ground = (
                np.maximum(speed, LEAST_GROUND_SPEED)
                if self.holds_ground_speed
                else along_course(direction, speed, wind)
            )
            north, east = over_ground * np.cos(direction), over_ground * np.sin(direction)
            course, turning_speed = direction, over_ground
        airframe, targets = self.airframe, self.targets
        if targets.course is None:
            turn_rate = GRAVITY * math.tan(LOITER_BANK) / turning_speed
        else:
            limit = GRAVITY * math.tan(airframe.max_bank) / turning_speed
            turn_rate = np.clip(airframe.alpha * wrap_angle(targets.course - course), -limit, limit)
        acceleration = np.clip(
            airframe.beta * (targets.speed - speed),
            -airframe.max_acceleration,
            airframe.max_acceleration,
        )
        return Motion(turn_rate, acceleration, north, east)

    def _flyable(
        self, course: FloatArray, ground_speed: FloatArray, wind: tuple[FloatArray, FloatArray]
    ) -> FloatArray:
        """A ground speed kept where the airspeed range allows it."""
        still = np.zeros_like(course)
        slowest = along_course(course, still + self.airframe.airspeed_min, wind)
        fastest = along_course(course, still + self.airframe.airspeed_max, wind)
        return np.clip(ground_speed, slowest, fastest)


def along_course(
    course: FloatArray, airspeed: FloatArray, wind: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Ground speed on a course, m/s, never quite 0."""
    return np.maximum(ground_speed_on_course(airspeed, course, *wind), LEAST_GROUND_SPEED)
