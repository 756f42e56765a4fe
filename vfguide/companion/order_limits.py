"""Why a companion does not carry out an order: its own limits, its path, its place, its time."""

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
"""A motion takes at least this long, for its speed."""

FAR_M = 5000.0
"""A circle that is further away than this from all vehicles is another place's."""

SOONEST_S = 1.0
LATEST_S = 120.0
"""An order's time is from here to there ahead."""

ABORT_S = 30.0
"""What calls everything off is of now: its time is no further from the present than this."""

SAME_M = 1.0
"""A slot that is nearer than this to where an order begins is the one that it means."""

KEEP_M = 5.0
"""Slots come no nearer than this, whatever an operator's program thinks of it."""

HELD_M = 1.0
"""Heights are held to this: a vehicle at the top of its fence may be found so much above it."""

LOWEST_M = 20.0
"""Nobody is sent lower than this above the mission's origin."""

ROUNDED = 1.02
"""Limits are passed by this factor at most: slots and times are rounded on their way."""


def age_objection(order: Arrangement, time_s: float) -> str | None:
    """Why what calls everything off is not of now, in words; None if it is, or no time is known.

    Args:
        order: that calls everything off.
        time_s: now, s of the formation's clock; NaN where it is not known.
    """
    off_s = time_s - order.time_s
    if abs(off_s) > ABORT_S:
        return f"it calls everything off, and its time is {off_s:.0f} s ago: give it again"
    return None


def time_objection(order: Arrangement, time_s: float) -> str | None:
    """Why an order comes too early or too late, in words; None if it does not.

    Args:
        order: that is to be flown.
        time_s: now, s of the formation's clock.
    """
    ahead_s = order.time_s - time_s
    if not SOONEST_S <= ahead_s <= LATEST_S:
        return f"its time is {ahead_s:.0f} s ahead, not {SOONEST_S:g} to {LATEST_S:g} s"
    return None


def path_objection(order: Arrangement, plan: FlightPlan) -> str | None:
    """Why the path of an order cannot be flown, in words; None if it can."""
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
    """Why the vehicle that is to lead by an order cannot, in words; None if it can, or if none is named.

    Args:
        order: that is to be flown.
        plan: of the own vehicle.
        leader: name of the mission's leader.
        steered: whether the companion of the vehicle that is to lead steers it; None where it is not heard.
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
    """Which two slots come too near to each other, and when, in words; None if none do.

    Args:
        order: by which the slots move.
        leader: name of the mission's leader.
    """
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
    """Why an order would take a vehicle above the fence, in words; None if it would not.

    One that is above it already may be ordered down.

    Args:
        order: that is to be flown.
        place: the vehicle's part of it; None for the leader, and for one that leaves.
        plan: of the vehicle.
        leader_height: of the leader when it begins, m above the origin.
        ceiling: that the fence allows on the path that is flown now, m above the origin.
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
    """Why a vehicle cannot keep up with its formation to the height of another path; None if it can.

    All go there at a rate that the mission tells. The autopilot's own limits may be tighter.

    Args:
        order: that is to be flown.
        plan: of the vehicle.
        leader_height: of the leader when it begins, m above the origin.
        path: name of the path that is followed until then.
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
    """Why a vehicle cannot fly its own part of an order, in words; None if it can.

    Args:
        order: by which its slot moves.
        place: its part.
        plan: of the vehicle.
        begin: where its slot is at the order's time; None for a vehicle that has left.
        leader_height: of the leader then, m above the origin.
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
    lowest = min(place.begin.up, place.end.up, place.layer or 0.0)
    height = leader_height + lowest
    if height < LOWEST_M and lowest < plan.up:
        return f"{name} would fly {height:.0f} m above the origin, less than {LOWEST_M:g} m"
    return None


def joining_objection(
    order: Arrangement, place: SlotMove, joining_m: float, leader: str
) -> str | None:
    """Why slots may not come near one whose vehicle is still on its way to it, in words; None if none do.

    Args:
        order: by which the slots move.
        place: the vehicle's part of it.
        joining_m: how far the vehicle is from its slot, m; 0 for one that is there.
        leader: name of the mission's leader.
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


def _climbs(order: Arrangement, place: SlotMove) -> tuple[float, ...]:
    """Greatest climb rates on the way, m/s."""
    if place.layer is None:
        return (_rate(place.end.up - place.begin.up, order.across_s),)
    return (
        _rate(place.layer - place.begin.up, order.climb_s),
        _rate(place.end.up - place.layer, order.climb_s),
    )
