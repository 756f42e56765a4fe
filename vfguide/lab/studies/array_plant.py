"""The ground, the wind and the aircraft of many formations at once, as arrays.

Places are on the ellipsoid, as the emulator flies, or on a plane.

The plants are the emulator's two ideal ones. All is written apart from the emulator on purpose: that both
come to the same is a test, not an import.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import pymap3d
from pymap3d import rcurve

from vfguide.elementwise import FloatArray, wrap_angle
from vfguide.frames import WGS84, LocalFrame
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.wind_triangle import ground_speed_on_course
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import ArticleWind, CalmWind, SteadyWind
from vfguide.state import Airframe

SEMI_MAJOR_AXIS_M = 6_378_137.0
ECCENTRICITY_SQUARED = 6.694379990141316e-3
"""WGS-84."""

E7 = 1e7
"""MAVLink counts positions in steps of 1e-7 degrees: 11 mm."""

Place = tuple[FloatArray, FloatArray]
"""Two coordinates: (latitude, longitude) in rad on the ellipsoid, (north, east) in m on the plane."""

Report = tuple[FloatArray, FloatArray]
"""What a position report says: (latitude, longitude) in degrees, or (north, east) in m on the plane."""

LONGEST_STEP_S = 0.05
"""Longest step of the integration, s, as in the emulator."""

LOITER_BANK = math.radians(15.0)
"""Bank to the right before the first setpoint, rad: what an emulated autopilot does unguided."""

LEAST_GROUND_SPEED = 0.1
"""m/s."""


class Ground(Protocol):
    """What a vehicle moves over."""

    def place(self, north: FloatArray, east: FloatArray) -> Place:
        """The place at a position in the local frame, m."""

    def advance(self, place: Place, north: FloatArray, east: FloatArray) -> Place:
        """A place some metres further."""

    def report(self, place: Place, *, rounded: bool) -> Report:
        """What a position report says of a place."""

    def local(self, report: Report) -> tuple[FloatArray, FloatArray]:
        """(north, east) of a report in the local frame, m."""

    def shifted(
        self, report: Report, north: FloatArray, east: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(north, east), m, of a report moved by some metres, after it has crossed the link."""


class Plane:
    """A plane, and reports without rounding: the fast one."""

    def place(self, north: FloatArray, east: FloatArray) -> Place:
        """The position itself."""
        return north, east

    def advance(self, place: Place, north: FloatArray, east: FloatArray) -> Place:
        """Metres are metres."""
        return place[0] + north, place[1] + east

    def report(self, place: Place, *, rounded: bool) -> Report:
        """The place itself; rounded to 11 mm where it is to be."""
        if not rounded:
            return place
        grid = math.radians(1.0 / E7) * SEMI_MAJOR_AXIS_M
        return np.rint(place[0] / grid) * grid, np.rint(place[1] / grid) * grid

    def local(self, report: Report) -> tuple[FloatArray, FloatArray]:
        """The report itself."""
        return report

    def shifted(
        self, report: Report, north: FloatArray, east: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Metres are metres."""
        return report[0] + north, report[1] + east


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipsoid:
    """WGS-84: what lockstep flies over.

    Every conversion is the one of `vfguide.frames`, in the same order of operations: what the companions of a
    lockstep flight see of their positions is seen here to the last bit.
    """

    latitude_deg: float
    """Latitude of the local frame's origin."""
    longitude_deg: float
    """Longitude of the local frame's origin."""
    origin_height_m: float
    """At which the local frame touches."""
    flying_height_m: float
    """Height that every vehicle flies at, m."""

    def place(self, north: FloatArray, east: FloatArray) -> Place:
        """Latitude and longitude of a position."""
        frame = LocalFrame(self.latitude_deg, self.longitude_deg, self.origin_height_m)
        latitude, longitude = np.vectorize(frame.to_geodetic)(north, east)
        return np.radians(latitude), np.radians(longitude)

    def advance(self, place: Place, north: FloatArray, east: FloatArray) -> Place:
        """Dlat = n / (M + h), dlon = e / ((N + h) cos lat)."""
        latitude, longitude = place
        meridian, transverse = radii(latitude)
        parallel = (transverse + self.flying_height_m) * np.cos(latitude)
        return latitude + north / (meridian + self.flying_height_m), longitude + east / parallel

    def report(self, place: Place, *, rounded: bool) -> Report:
        """Degrees; the nearest 1e-7 where they are to be rounded."""
        latitude, longitude = np.degrees(place[0]), np.degrees(place[1])
        if rounded:
            latitude, longitude = np.rint(latitude * E7) * 1e-7, np.rint(longitude * E7) * 1e-7
        return latitude, longitude

    def local(self, report: Report) -> tuple[FloatArray, FloatArray]:
        """Into the plane that touches at the origin, as if at its height."""
        height = self.origin_height_m
        x, y, z = pymap3d.geodetic2ecef(report[0], report[1], height, WGS84)
        origin = pymap3d.geodetic2ecef(self.latitude_deg, self.longitude_deg, height, WGS84)
        x, y, z = x - origin[0], y - origin[1], z - origin[2]
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        north = (
            -math.sin(latitude) * math.cos(longitude),
            -math.sin(latitude) * math.sin(longitude),
            math.cos(latitude),
        )
        east = (-math.sin(longitude), math.cos(longitude))
        return north[0] * x + north[1] * y + north[2] * z, east[0] * x + east[1] * y

    def shifted(
        self, report: Report, north: FloatArray, east: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """By the origin's radii of curvature, and back into the plane."""
        meridian = float(rcurve.meridian(self.latitude_deg)) + self.origin_height_m
        transverse = float(rcurve.transverse(self.latitude_deg)) + self.origin_height_m
        parallel = transverse * np.cos(np.radians(report[0]))
        longitude = report[1] + np.degrees(east / parallel)
        return self.local(
            (
                report[0] + np.degrees(north / meridian),
                (longitude + 180.0) % 360.0 - 180.0,
            )
        )


def radii(latitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radii of curvature at a geodetic latitude (rad), m: meridian M, prime vertical N."""
    shrink = 1.0 - ECCENTRICITY_SQUARED * np.sin(latitude) ** 2
    transverse = SEMI_MAJOR_AXIS_M / np.sqrt(shrink)
    return transverse * (1.0 - ECCENTRICITY_SQUARED) / shrink, transverse


def ellipsoid_of(mission: Mission) -> Ellipsoid:
    """The ground under a mission, flown at the leader's height."""
    origin = mission.origin
    return Ellipsoid(
        latitude_deg=origin.latitude_deg,
        longitude_deg=origin.longitude_deg,
        origin_height_m=origin.altitude_amsl_m,
        flying_height_m=origin.altitude_amsl_m + mission.height_above_origin_m,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingingWind:
    """The article's form: W = mean + swell cos(rate t + phase), toward centre + swing sin(rate t + phase)."""

    mean: FloatArray
    """m/s."""
    swell: FloatArray
    """m/s."""
    centre: FloatArray
    """rad."""
    swing: FloatArray
    """rad."""
    rate: FloatArray
    """rad/s."""
    phase: FloatArray
    """rad."""

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """(north, east) of the winds, m/s, toward."""
        angle = self.rate * time_s + self.phase
        speed = self.mean + self.swell * np.cos(angle)
        toward = self.centre + self.swing * np.sin(angle)
        return speed * np.cos(toward), speed * np.sin(toward)


def swinging_wind(wind: CalmWind | ArticleWind | SteadyWind, count: int) -> SwingingWind:
    """The wind of a mission, for so many formations."""
    still = np.zeros(count)
    mean, swell, centre, swing, rate = 0.0, 0.0, 0.0, 0.0, 0.0
    if isinstance(wind, SteadyWind):
        mean, centre = wind.speed_m_s, math.radians(wind.toward_deg)
    elif isinstance(wind, ArticleWind):
        mean, swell, centre, swing, rate = 5.0, 3.0, 0.75 * math.pi, math.pi, 0.1
    return SwingingWind(
        mean=still + mean,
        swell=still + swell,
        centre=still + centre,
        swing=still + swing,
        rate=still + rate,
        phase=still,
    )


class FleetMotion(NamedTuple):
    """How vehicles move at one instant."""

    turn_rate: FloatArray
    """Turn rate of the direction that the plant holds, rad/s."""
    acceleration: FloatArray
    """Rate of change of the speed that it holds, m/s²."""
    north: FloatArray
    """Ground velocity, m/s."""
    east: FloatArray
    """Ground velocity, m/s."""


@dataclass(slots=True)
class FleetTargets:
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
    targets: FleetTargets
    """What they hold."""

    @property
    def holds_ground_speed(self) -> bool:
        """Whether the speed held is the one over ground."""
        return self.airframe.hold == "course-hold" and self.targets.course is not None

    def guide(self, course: FloatArray, speed: FloatArray, time_s: float) -> None:
        """New setpoints; the first change what a course-hold plant's speed means, not the motion."""
        if self.airframe.hold == "course-hold" and self.targets.course is None:
            self.speed = along_course(self.direction, self.speed, self.wind.at(time_s))
        self.targets = FleetTargets(course, speed)

    def motion(self, time_s: float) -> FleetMotion:
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
    ) -> FleetMotion:
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
        return FleetMotion(turn_rate, acceleration, north, east)

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
