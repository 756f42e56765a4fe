"""What a mission's leader meets on its way: every course and turn of its path in every declared wind.

Arrays hold one entry for each combination. Local frame: x north, y east; radians clockwise from north.
"""

import math
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import FloatArray, hypot
from vfguide.errors import InputError
from vfguide.guidance.airframe import compose, ground_speed_on_course
from vfguide.guidance.formation import Slot, slot_velocity
from vfguide.mission.flight_path import PathShape, path_of
from vfguide.mission.rehearsal import ArticleWind, CalmWind, SteadyWind

ARTICLE_WIND_PERIOD_S = 2.0 * math.pi / 0.1
ARTICLE_WIND_SAMPLES = 64
PLACES = 97
"""Places of the path that are looked at."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Combinations of path course, path curvature and wind."""

    course: FloatArray
    """Course of the path, rad."""
    curvature: FloatArray
    """Curvature of the path, 1/m, positive clockwise."""
    wind_north: FloatArray
    """North component of the wind, m/s, toward."""
    wind_east: FloatArray
    """East component of the wind, m/s, toward."""
    height: FloatArray
    """Height of the path, m above the mission's flying height."""
    slope: FloatArray
    """Slope of the path, rise for each metre along the ground."""

    def ground_speed(self, airspeed: float | FloatArray) -> FloatArray:
        """Ground speed (m/s) of a leader on the path at an airspeed (m/s), which may be an array."""
        shape = np.broadcast_shapes(np.shape(airspeed), self.course.shape)
        speeds = np.broadcast_to(np.asarray(airspeed, dtype=float), shape)
        return ground_speed_on_course(speeds, self.course, self.wind_north, self.wind_east)

    def turn_rate(self, airspeed: float | FloatArray) -> FloatArray:
        """Turn rate (rad/s) of a leader on the path, positive clockwise: V_g times curvature."""
        return self.ground_speed(airspeed) * self.curvature

    def slot_velocity(
        self, airspeed: float | FloatArray, slot: Slot
    ) -> tuple[FloatArray, FloatArray]:
        """(along, right) of a slot's velocity in the leader's course frame, m/s."""
        ground_speed = self.ground_speed(airspeed)
        return slot_velocity(ground_speed, ground_speed * self.curvature, slot)

    def slot_airspeed(self, airspeed: float | FloatArray, slot: Slot) -> FloatArray:
        """Airspeed (m/s) that keeping a slot takes, |slot velocity - wind|."""
        along, right = self.slot_velocity(airspeed, slot)
        north, east = compose(along, right, np.broadcast_to(self.course, along.shape))
        return hypot(north - self.wind_north, east - self.wind_east)


def conditions_of(shape: PathShape, wind: CalmWind | ArticleWind | SteadyWind) -> Conditions:
    """Every course of the path with every wind."""
    path = path_of(shape)
    places = path.at(path.outline(PLACES))
    if not (np.all(np.isfinite(places.course)) and np.all(np.isfinite(places.curvature))):
        raise InputError(
            f"path {shape.type}: its course or its curvature is not finite everywhere; mend at()"
        )
    north, east = wind_samples(wind)
    return Conditions(
        np.repeat(places.course, north.size),
        np.repeat(places.curvature, north.size),
        np.tile(north, places.course.size),
        np.tile(east, places.course.size),
        np.repeat(places.height + 0.0 * places.course, north.size),
        np.repeat(places.slope + 0.0 * places.course, north.size),
    )


def wind_samples(wind: CalmWind | ArticleWind | SteadyWind) -> tuple[FloatArray, FloatArray]:
    """(north, east) components (m/s, toward) of the declared wind, over a whole period of it."""
    if isinstance(wind, SteadyWind):
        toward = math.radians(wind.toward_deg)
        return (
            np.array([wind.speed_m_s * math.cos(toward)]),
            np.array([wind.speed_m_s * math.sin(toward)]),
        )
    if isinstance(wind, CalmWind):
        return np.zeros(1), np.zeros(1)
    time = np.linspace(0.0, ARTICLE_WIND_PERIOD_S, ARTICLE_WIND_SAMPLES, endpoint=False)
    return article_wind(time)


def article_wind(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(north, east) of the article's wind at a time in s: W = 5 + 3 cos 0.1 t, psi_w = 135° + pi sin 0.1 t.

    W in m/s, psi_w the direction the air moves toward, clockwise from north.
    """
    speed = 5.0 + 3.0 * np.cos(0.1 * time)
    toward = math.radians(135.0) + math.pi * np.sin(0.1 * time)
    return speed * np.cos(toward), speed * np.sin(toward)
