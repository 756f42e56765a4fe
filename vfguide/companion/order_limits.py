"""What one aircraft can do of an order: how fast its slot moves, and on what circle it holds."""

import math
from collections.abc import Iterable

from vfguide.formation.arrangement import PEAK, Arrangement, Place
from vfguide.guidance.limits import GRAVITY
from vfguide.paths.circle import Circle
from vfguide.state import Airframe

LEAST_S = 0.1
"""A motion takes at least this long, for its speed."""

FAR_M = 5000.0
"""A circle that is further away than this from all vehicles is another place's."""

ROUNDED = 1.02
"""Limits are passed by this factor at most: slots and times are rounded on their way."""


def motion_objection(order: Arrangement, place: Place, airframe: Airframe) -> str | None:
    """Why an aircraft cannot keep up with its slot, in words; None if it can.

    Args:
        order: by which the slot moves.
        place: the aircraft's part of it.
        airframe: its limits.
    """
    way, name = place.end.minus(place.begin), place.vehicle
    ahead = _rate(way.forward, order.across_s)
    fastest = airframe.cruise + ahead
    if fastest > airframe.airspeed_max or fastest < airframe.airspeed_min:
        limit = airframe.airspeed_max if ahead > 0.0 else airframe.airspeed_min
        return f"{name} would have to fly {fastest:.1f} m/s, and its limit is {limit:g} m/s"
    aside = abs(_rate(way.right, order.across_s))
    if aside > airframe.cruise:
        return f"{name} would have to fly {aside:.1f} m/s aside, and its limit is {airframe.cruise:g} m/s"
    for rate in _climbs(order, place):
        limit = airframe.climb_max if rate > 0.0 else airframe.sink_max
        if abs(rate) > ROUNDED * limit:
            verb = "climb" if rate > 0.0 else "sink"
            return f"{name} would have to {verb} at {abs(rate):.1f} m/s, and its limit is {limit:g} m/s"
    return None


def circle_objection(
    circle: Circle, airframe: Airframe, vehicles: Iterable[tuple[float, float]]
) -> str | None:
    """Why nobody can hold on a circle, in words; None if an aircraft of these limits can.

    Args:
        circle: where to hold.
        airframe: limits of an aircraft.
        vehicles: (north, east) of those that are heard, m; none to look at the radius alone.
    """
    least = airframe.cruise**2 / (GRAVITY * math.tan(airframe.max_bank))
    if circle.radius < least:
        return f"a circle of {circle.radius:.0f} m is too small: at least {least:.0f} m are needed"
    ways = [
        abs(math.hypot(circle.north - north, circle.east - east) - circle.radius)
        for north, east in vehicles
    ]
    if ways and min(ways) > FAR_M:
        return f"the circle is {min(ways) / 1000.0:.0f} km away, more than {FAR_M / 1000.0:g} km"
    return None


def _rate(way: float, duration_s: float) -> float:
    """Greatest speed of a motion, m/s."""
    return way * PEAK / max(duration_s, LEAST_S)


def _climbs(order: Arrangement, place: Place) -> tuple[float, ...]:
    """Greatest climb rates on the way, m/s."""
    if place.layer is None:
        return (_rate(place.end.up - place.begin.up, order.across_s),)
    return (
        _rate(place.layer - place.begin.up, order.climb_s),
        _rate(place.end.up - place.layer, order.climb_s),
    )
