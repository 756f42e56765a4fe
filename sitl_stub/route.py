"""A route of waypoints that an aircraft flies by itself, as an autopilot flies its mission."""

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import msgspec

from sitl_stub.geometry import radii_m, wrap_to_pi

AHEAD_S = 2.5
"""Look-ahead time: the course leads to the point on the route that is reached after this time."""

LEAST_AHEAD_M = 20.0
"""Shortest look-ahead distance."""

SEARCHED_M = 50.0
"""Length of route beyond the last known leg that is searched for the aircraft, at least one leg. The limit
keeps a route that crosses itself unambiguous."""

SAME_PLACE_M = 0.01
"""Points nearer than this are one; a route whose ends are so near is flown round and round."""


@dataclass(frozen=True, slots=True)
class Route:
    """Waypoints of a route: a closed one is repeated, an open one continues beyond the last point."""

    points_deg: tuple[tuple[float, float], ...]
    """Latitude and longitude of each point, at least two."""

    def __post_init__(self) -> None:
        """Check the points.

        Raises:
            ValueError: there are fewer than two points, or one is no place.
        """
        if len(self.points_deg) < 2:
            raise ValueError("a route has two points or more")
        for latitude_deg, longitude_deg in self.points_deg:
            if not (abs(latitude_deg) <= 89.0 and abs(longitude_deg) <= 180.0):
                raise ValueError(f"{latitude_deg!r},{longitude_deg!r} is no place to fly to")


class RouteFollower:
    """Position of an aircraft along its route, and the course to fly."""

    def __init__(self, route: Route) -> None:
        self._zero = route.points_deg[0]
        places = [self._local(latitude, longitude) for latitude, longitude in route.points_deg]
        self._legs = legs_of(places)
        self._begins_m = [leg.begins_m for leg in self._legs]
        self._closed = abs(places[0] - places[-1]) < SAME_PLACE_M
        self._length_m = self._legs[-1].begins_m + self._legs[-1].length_m
        self._leg: int | None = None

    def course_rad(self, latitude_rad: float, longitude_rad: float, speed_m_s: float) -> float:
        """Return the course over ground toward the point on the route a little ahead."""
        here = self._local(math.degrees(latitude_rad), math.degrees(longitude_rad))
        ahead_m = max(AHEAD_S * speed_m_s, LEAST_AHEAD_M)
        aim = self._place(self._nearest(here) + ahead_m) - here
        return math.atan2(aim.imag, aim.real)

    def _local(self, latitude_deg: float, longitude_deg: float) -> complex:
        """Return a position relative to the first point, m: north + j east."""
        meridian_m, transverse_m = radii_m(math.radians(self._zero[0]))
        north_m = math.radians(latitude_deg - self._zero[0]) * meridian_m
        east_rad = wrap_to_pi(math.radians(longitude_deg - self._zero[1]))
        return complex(north_m, east_rad * transverse_m * math.cos(math.radians(self._zero[0])))

    def _nearest(self, here: complex) -> float:
        """Return the nearest point's distance along the route, m, searching from the last known leg on."""
        count, last = len(self._legs), len(self._legs) - 1
        best_m, least, leg_of_best = 0.0, math.inf, 0
        for index in self._searched():
            leg = self._legs[index % count]
            along_m = max(((here - leg.begin) * leg.ahead.conjugate()).real, 0.0)
            if self._closed or index % count != last:
                along_m = min(along_m, leg.length_m)
            off = abs(leg.begin + leg.ahead * along_m - here)
            if off < least:
                best_m, least, leg_of_best = leg.begins_m + along_m, off, index % count
        self._leg = leg_of_best
        return best_m

    def _searched(self) -> Iterator[int]:
        """Yield the indices of legs to search: all at first, then the last known one and its successors."""
        count = len(self._legs)
        if self._leg is None:
            yield from range(count)
            return
        far_m = 0.0
        for index in range(self._leg, self._leg + count if self._closed else count):
            yield index
            far_m += self._legs[index % count].length_m
            if index > self._leg and far_m > SEARCHED_M:
                return

    def _place(self, progress_m: float) -> complex:
        """Return the point at a distance along the route, m."""
        if self._closed:
            progress_m %= self._length_m
        leg = self._legs[max(bisect_right(self._begins_m, progress_m) - 1, 0)]
        return leg.begin + leg.ahead * (progress_m - leg.begins_m)


class Leg(msgspec.Struct, frozen=True):
    """Leg between two points of a route, in m."""

    begin: complex
    ahead: complex
    """Unit vector along the leg."""
    begins_m: float
    """Distance along the route at the leg's begin."""
    length_m: float


def legs_of(places: Sequence[complex]) -> tuple[Leg, ...]:
    """Return the legs between consecutive points, without legs shorter than `SAME_PLACE_M`.

    Raises:
        ValueError: all points are the same.
    """
    legs: list[Leg] = []
    begin, begins_m = places[0], 0.0
    for end in places[1:]:
        way = end - begin
        if abs(way) < SAME_PLACE_M:
            continue
        legs.append(Leg(begin, way / abs(way), begins_m, abs(way)))
        begin, begins_m = end, begins_m + abs(way)
    if not legs:
        raise ValueError("the points of the route are all the same")
    return tuple(legs)
