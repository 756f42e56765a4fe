"""Limits by which a companion refuses an order: of its aircraft, path, place and time."""

import math
from collections.abc import Iterable

from vfguide.companion.plan import FlightPlan
from vfguide.formation.arrangement import MAIN_PATH, PEAK, Arrangement, Point, SlotMove
from vfguide.formation.transition import JOIN_M, LEADER, approach_of, approaches
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.height import SHARE
from vfguide.paths.circle import Circle
from vfguide.state import Airframe

LEAST_S = 0.1
"""Least duration of a motion for its speed, s."""

FAR_M = 5000.0
"""Distance of a circle from all vehicles beyond which it belongs to another place, m."""

SOONEST_S = 1.0
LATEST_S = 120.0
"""Bounds of an order's time ahead, s."""

ABORT_S = 30.0
"""Greatest difference of an abort's time from the present, s."""

SAME_M = 1.0
"""Tolerance between a slot and the beginning of its ordered motion, m."""

KEEP_M = 5.0
"""Least distance between slots, m, whatever an operator's program allows."""

HELD_M = 1.0
"""Tolerance of held heights, m: a vehicle at the top of its fence may be found this much above it."""

LOWEST_M = 20.0
"""Least height to which a vehicle is sent, m above the mission's origin."""

ROUNDED = 1.02
"""Factor by which limits may be exceeded: slots and times are rounded in transmission."""


def age_objection(order: Arrangement, time_s: float) -> str | None:
    """Return why an abort is not current; None if it is, or if the time is unknown (NaN)."""
    off_s = time_s - order.time_s
    if abs(off_s) > ABORT_S:
        return f"it calls everything off, and its time is {when(off_s)}: give it again"
    return None


def when(passed_s: float) -> str:
    """Return for how long a time has passed, s; it is ahead where that is negative."""
    return f"{abs(passed_s):.0f} s {'ahead' if passed_s < 0.0 else 'ago'}"


def time_objection(order: Arrangement, time_s: float) -> str | None:
    """Return why an order is too early or late at a time of the formation's clock, s; None if it is not."""
    ahead_s = order.time_s - time_s
    if not SOONEST_S <= ahead_s <= LATEST_S:
        return f"its time is {when(-ahead_s)}, not {SOONEST_S:g} to {LATEST_S:g} s ahead"
    return None


def path_objection(order: Arrangement, plan: FlightPlan) -> str | None:
    """Return why the path of an order cannot be flown; None if it can."""
    if order.path == MAIN_PATH and order.turn_radius_m <= 0.0 and order.path_check == 0:
        return None
    known = plan.paths.get(order.path)
    if known is None:
        return f"no path is called {order.path!r} in its mission: give all the same mission"
    if known.check != order.path_check:
        return f"its mission file means another curve by {order.path!r}: give all the same mission"
    return None


def lead_objection(
    order: Arrangement, plan: FlightPlan, leader: str, steered: bool | None
) -> str | None:
    """Return why the appointed leader cannot lead; None if it can, or if none is named.

    `steered` tells whether its companion steers it, None if it is unheard; `leader` is the mission's leader.
    """
    name = order.lead
    if not name:
        return None
    if name not in (() if plan.lead is None else plan.lead.order):
        return f"{name} is neither leader nor deputy of its mission"
    if name != leader and name not in order.vehicles:
        return f"{name} is to lead, and has no place in the formation"
    if name == plan.name or steered:
        return None
    if steered is None:
        return f"{name} is to lead, and is not heard"
    return f"{name} is to lead, and its companion does not steer it"


def nearness_objection(order: Arrangement, leader: str) -> str | None:
    """Return which two slots come too near to each other, and when; None if none do."""
    for one in approaches(order.places, order.climb_s, order.across_s, leader):
        if one.distance < KEEP_M:
            return (
                f"{one.first} and {one.second} would come within {one.distance:.1f} m of each other"
                f" {one.time_s:.0f} s after its beginning, less than {KEEP_M:g} m"
            )
    return None


def ceiling_objection(
    order: Arrangement,
    place: SlotMove | None,
    plan: FlightPlan,
    leader_height: float,
    ceiling: float,
) -> str | None:
    """Return why an order would take a vehicle above the fence; None if it would not.

    A vehicle above it already may be ordered down.

    Args:
        order: order to fly.
        place: the vehicle's part of it; None for the leader, and for a vehicle that leaves.
        plan: plan of the vehicle.
        leader_height: the leader's height when it begins, m above the origin.
        ceiling: ceiling of the fence on the present path, m above the origin.
    """
    allowed = plan.ceiling_along(order.path)
    up = highest = 0.0
    if place is not None:
        up = place.begin.up
        highest = max(place.end.up, up if place.layer is None else place.layer)
    elif not plan.leads:
        return None
    rises = highest > up or allowed < ceiling
    if not rises or leader_height + highest <= allowed + HELD_M:
        return None
    return (
        f"{plan.name} would fly {leader_height + highest:.0f} m above the origin, and the fence ends at"
        f" {allowed:g} m"
    )


def climb_objection(
    order: Arrangement, plan: FlightPlan, leader_height: float, path: str
) -> str | None:
    """Return why a vehicle cannot keep up with its formation to another path's height; None if it can.

    All climb at the mission's rate; the autopilot's own limits may be tighter. `path` and `leader_height` (m
    above the origin) are those when the order begins.
    """
    known = plan.paths.get(order.path)
    if known is None or order.path == path:
        return None
    lowest, highest = (plan.height - plan.up + height - leader_height for height in known.heights)
    all_, own = plan.climb_limits, plan.airframe
    for change, rate, limit, verb in (
        (highest, SHARE * all_.climb, own.climb_max, "climb"),
        (-lowest, SHARE * all_.sink, own.sink_max, "sink"),
    ):
        if change > HELD_M and rate > ROUNDED * limit:
            return (
                f"{plan.name} would have to {verb} at {rate:.1f} m/s to the height of {order.path!r}, and"
                f" its limit is {limit:g} m/s"
            )
    return None


def slot_objection(
    order: Arrangement, place: SlotMove, plan: FlightPlan, begin: Point | None, leader_height: float
) -> str | None:
    """Return why a vehicle cannot fly its own part of an order; None if it can.

    At the order's time its slot is at `begin` (None for a vehicle that has left), the leader at
    `leader_height`, m above the origin.
    """
    name = plan.name
    if begin is not None and place.begin.minus(begin).size > SAME_M:
        return (
            f"{name} is to begin {place.begin.forward:.0f} m ahead of and {place.begin.right:.0f} m"
            f" right of the leader, but its slot is at {begin.forward:.0f} m and {begin.right:.0f} m"
        )
    objection = motion_objection(order, place, plan.airframe)
    if objection is not None:
        return objection
    heights = (place.begin.up, place.end.up, place.layer)
    lowest = min(height for height in heights if height is not None)
    height = leader_height + lowest
    if height < LOWEST_M and lowest < plan.up:
        return f"{name} would fly {height:.0f} m above the origin, less than {LOWEST_M:g} m"
    return None


def joining_objection(
    order: Arrangement, place: SlotMove, joining_m: float, leader: str
) -> str | None:
    """Return why slots may not come near the slot of a vehicle still on its way to it; None if none do.

    `joining_m` is the vehicle's distance from its slot, m; 0 if it is there.
    """
    if joining_m <= 0.0:
        return None
    still = SlotMove(vehicle=leader, begin=LEADER, end=LEADER)
    for other in (still, *order.places):
        if other is place:
            continue
        before = place.begin.minus(other.begin).size
        nearest = approach_of(place, other, order.climb_s, order.across_s).distance
        if nearest < min(JOIN_M, before) - SAME_M:
            return (
                f"{place.vehicle} is still {joining_m:.0f} m from its slot, and {other.vehicle} would come"
                f" within {nearest:.1f} m of that: wait until it is there, or order it to leave"
            )
    return None


def motion_objection(order: Arrangement, place: SlotMove, airframe: Airframe) -> str | None:
    """Return why an aircraft with these limits cannot keep up with its slot; None if it can."""
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
    """Return why nobody with these limits can hold on a circle; None if an aircraft can.

    `vehicles` are the positions (north, east) heard, m; without any, the radius alone is checked.
    """
    least = airframe.cruise**2 / (GRAVITY * math.tan(airframe.max_bank))
    if circle.radius < least:
        return f"a circle of {circle.radius:.0f} m is too small: at least {math.ceil(least)} m are needed"
    ways = [
        abs(math.hypot(circle.north - north, circle.east - east) - circle.radius)
        for north, east in vehicles
    ]
    if ways and min(ways) > FAR_M:
        return f"the circle is {min(ways) / 1000.0:.0f} km away, more than {FAR_M / 1000.0:g} km"
    return None


def _rate(way: float, duration_s: float) -> float:
    """Return the greatest speed of a motion, m/s."""
    return way * PEAK / max(duration_s, LEAST_S)


def _climbs(order: Arrangement, place: SlotMove) -> tuple[float, ...]:
    """Return the greatest climb rates on the way, m/s."""
    if place.layer is None:
        return (_rate(place.end.up - place.begin.up, order.across_s),)
    return (
        _rate(place.layer - place.begin.up, order.climb_s),
        _rate(place.end.up - place.layer, order.climb_s),
    )
