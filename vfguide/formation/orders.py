"""Orders of an operator, the arrangement for each, and the assignment of followers to slots.

The assignment minimises the sum of all squared ways. Interchangeable vehicles that go straight to such slots,
by one time law, never come nearer to each other than the smallest slot distance over the square root of two
(Turpin, Michael, Kumar, "CAPT: Concurrent assignment and planning of trajectories for multiple robots",
International Journal of Robotics Research 33(1), 2014, theorem 4.3). The leader is not interchangeable: it
keeps its place.

Every order (a shape, a spacing, a swap, a departure) becomes a whole arrangement here, on the operator's
side. Companions handle arrangements only.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from random import Random
from typing import Literal

import msgspec
from msgspec.structs import replace

from vfguide.formation.arrangement import (
    MAIN_PATH,
    SAME_M,
    SHAPES,
    Arrangement,
    HoldCircle,
    Manoeuvre,
    Offset,
    Point,
    Shape,
    SlotMove,
    ends,
    shape_slots,
)
from vfguide.formation.transition import (
    JOIN_M,
    LEADER,
    LEAST_M,
    MotionLimits,
    RefusedOrderError,
    Transition,
    transition,
)

# Slots for joining vehicles: free slots of the present formation. An arrangement has places but no shape, so
# the shape is inferred: the mission's places at any spacing, whoever flies in them, or a named shape. If
# neither fits, as after an order of slots by name, a joining vehicle gets its slot in the mission.

STEP_M = 0.1
"""Resolution of slots in orders and of spacings, m."""


def joined_places(
    joining: Sequence[str], present: Mapping[str, Offset], home: Mapping[str, Offset]
) -> dict[str, Offset]:
    """Return the place of each joining vehicle, (forward, right) of the leader, m.

    `present` are the places now, `home` those of the mission, by name.
    """
    own = {name: home[name] for name in joining}
    taken = list(present.values())
    if not joining or not taken:
        return own
    scales = fitting_scales(taken, list(home.values()))
    if scales:
        scale = min(scales, key=lambda one: abs(one - 1.0))
        free = without(taken, (_times(scale, place) for place in home.values()))
        return _given({name: _times(scale, place) for name, place in own.items()}, free)
    for count in sorted({len(taken) + len(joining), len(home)}):
        for free in free_places(taken, count):
            if len(free) >= len(joining):
                return _given(own, free)
    return own


def free_places(taken: Sequence[Offset], count: int) -> Iterator[list[Offset]]:
    """Yield the free places (m) of each shape of `count` followers that contains the taken places.

    Of several possible spacings, the smallest with room to join counts.
    """
    for shape in SHAPES:
        scales = fitting_scales(taken, shape_slots(shape, count, 1.0))
        if scales:
            wide = [scale for scale in scales if scale >= JOIN_M - STEP_M]
            spacing = round(min(wide, default=max(scales)) / STEP_M) * STEP_M
            yield without(taken, shape_slots(shape, count, spacing))


def fitting_scales(taken: Sequence[Offset], places: Sequence[Offset]) -> list[float]:
    """Return the factors by which places, in any unit, contain the taken ones (m)."""
    reach = max(math.hypot(*place) for place in taken)
    sizes = {math.hypot(*place) for place in places} - {0.0}
    left = len(places) - len(taken)
    return [
        reach / size
        for size in sizes
        if reach > 0.0
        and len(without(taken, (_times(reach / size, one) for one in places))) == left
    ]


def without(taken: Iterable[Offset], places: Iterable[Offset]) -> list[Offset]:
    """Return the places not taken, in their order."""
    left = list(places)
    for place in taken:
        near = [one for one in left if math.dist(one, place) <= SAME_M]
        if near:
            left.remove(min(near, key=lambda one: math.dist(one, place)))
    return left


def _given(wanted: Mapping[str, Offset], free: Sequence[Offset]) -> dict[str, Offset]:
    """Return a free place for each vehicle: the wanted one if free, else the first left."""
    found, left = dict[str, Offset](), list(free)
    for name, place in wanted.items():
        same = [one for one in left if math.dist(one, place) <= SAME_M]
        if same:
            found[name] = same[0]
            left.remove(same[0])
    for name in wanted:
        if name not in found:
            found[name] = left.pop(0)
    return {name: found[name] for name in wanted}


def _times(scale: float, place: Offset) -> Offset:
    return scale * place[0], scale * place[1]


STACK_M = 15.0
"""Vertical distance between neighbours in a hold, m."""

FAR_BEHIND = (-300.0, 0.0)
"""Assumed position of a joining vehicle, m: far behind, so that the others choose their slots first."""


def assigned(begin: Mapping[str, Offset], places: Sequence[Offset]) -> dict[str, Offset]:
    """Return the place of each follower, by name, with the smallest sum of squared ways.

    `begin` are the present positions. All are (forward, right) of the leader, m.

    Raises:
        ValueError: there are not as many places as followers.
    """
    if len(begin) != len(places):
        raise ValueError(f"{len(places)} places for {len(begin)} followers")
    if not begin:
        return {}
    ways = [
        [(north - ahead) ** 2 + (east - right) ** 2 for ahead, right in places]
        for north, east in begin.values()
    ]
    columns = least_assignment(ways)
    return {name: places[column] for name, column in zip(begin, columns, strict=True)}


def least_assignment(costs: Sequence[Sequence[float]]) -> list[int]:
    """Return the column of each row of a square matrix, each once, with the smallest sum of costs.

    By shortest augmenting paths (Jonker, Volgenant, Computing 38, 1987): exact, in O(n³).
    """
    size = len(costs)
    by_row, by_column = [0.0] * size, [0.0] * size
    row_of = [-1] * size
    for first in range(size):
        shortest, before = [math.inf] * size, [-1] * size
        done: list[int] = []
        row, column, length = first, -1, 0.0
        while True:
            left = [one for one in range(size) if one not in done]
            for one in left:
                reached = length + costs[row][one] - by_row[row] - by_column[one]
                if reached < shortest[one]:
                    shortest[one], before[one] = reached, column
            column = min(left, key=shortest.__getitem__)
            length = shortest[column]
            if row_of[column] < 0:
                break
            done.append(column)
            row = row_of[column]
        by_row[first] += length
        for one in done:
            by_row[row_of[one]] += length - shortest[one]
            by_column[one] -= length - shortest[one]
        while column >= 0:
            column_before = before[column]
            row_of[column] = first if column_before < 0 else row_of[column_before]
            column = column_before
    found = [0] * size
    for column, row in enumerate(row_of):
        found[row] = column
    return found


EPOCH_S = 1_767_225_600.0
"""Beginning of 2026, s since 1970: order numbers count the seconds from then, so that they always rise."""

CHANCE_BITS = 3
"""Random low bits of an order number, for two operators in one second; 32 bits last until 2043."""


def new_number(newest: int, unix_s: float, chance: Random) -> int:
    """Return an order number above the newest in force, very likely different from another operator's.

    `unix_s` counts from 1970; a slow clock does no harm. `chance` gives the lowest bits.
    """
    seconds = max(int(unix_s - EPOCH_S), 0)
    return max(seconds << CHANCE_BITS, newest + 1) + chance.getrandbits(CHANCE_BITS)


Action = Literal["hold", "resume", "abort"]


class Order(msgspec.Struct, frozen=True, kw_only=True):
    """Request of an operator; absent fields keep their state."""

    shape: Shape | None = None
    """Shape to fly."""
    spacing: float | None = None
    """Distance between neighbours, m."""
    swap: tuple[str, str] | None = None
    """Two followers that exchange slots."""
    slots: Mapping[str, Point] = msgspec.field(default_factory=dict)
    """Slots by follower."""
    leave: tuple[str, ...] = ()
    """Followers that leave the formation."""
    join: tuple[str, ...] = ()
    """Followers that rejoin the formation."""
    action: Action | None = None
    """Hold, resume, or abort everything."""
    path: str | None = None
    """Name of the mission's path to follow."""
    lead: str | None = None
    """Name of the vehicle to lead."""


class Formation(msgspec.Struct, frozen=True, kw_only=True):
    """Formation as an operator knows it."""

    leader: str
    """Name of the leader."""
    home: Mapping[str, Point]
    """Slots of the mission by follower, in the mission's order."""
    slots: Mapping[str, Point]
    """Present slots by follower in the formation."""
    number: int = 0
    """Number of the newest order."""
    flown: Manoeuvre = Manoeuvre.FORMATION
    """Present manoeuvre."""
    circle: HoldCircle | None = None
    """Circle of the present hold."""
    path: str = MAIN_PATH
    """Name of the present path of the mission."""
    turn_radius_m: float = 0.0
    """Smallest turn radius while joining the path, m; 0 as long as the path was not changed."""
    paths: Mapping[str, int] = msgspec.field(default_factory=lambda: {MAIN_PATH: 0})
    """Checksums of all paths of the mission, by name."""
    may_lead: tuple[str, ...] = ()
    """Names of possible leaders, the mission's leader first; empty without deputies."""
    holder: str = ""
    """Name of the leading vehicle; empty for the mission's leader."""

    @property
    def leads(self) -> str:
        """Name of the leading vehicle."""
        return self.holder or self.leader

    @property
    def spacing(self) -> float | None:
        """Smallest distance of two slots, m, without the stack of a hold; None without followers."""
        slots = dict(self.slots)
        if self.flown is Manoeuvre.HOLD:
            slots = {name: replace(slot, up=self.home[name].up) for name, slot in slots.items()}
        places = [LEADER, *slots.values()]
        return min((one.minus(other).size for one, other in combinations(places, 2)), default=None)

    def after(self, arrangement: Arrangement) -> "Formation":
        """Return the formation once an arrangement is flown."""
        return replace(
            self,
            slots=ends(arrangement.places),
            number=arrangement.number,
            flown=arrangement.flown,
            circle=arrangement.circle,
            path=arrangement.path,
            turn_radius_m=arrangement.turn_radius_m,
            holder=arrangement.lead or self.holder,
        )

    def holds_after(self, order: Order) -> bool:
        """Check whether the leader circles after an order: a hold lasts until the mission resumes."""
        return order.action == "hold" or (self.flown is Manoeuvre.HOLD and order.action is None)


def arrangement_of(
    order: Order,
    formation: Formation,
    limits: MotionLimits,
    *,
    number: int,
    time_s: float,
    circle: HoldCircle | None = None,
    turn_radius_m: float = 0.0,
) -> tuple[Arrangement, Transition]:
    """Return the arrangement for an order, and its transition.

    Args:
        order: request of the operator.
        formation: present formation.
        limits: limits of slot motion.
        number: number of the arrangement, greater than all before.
        time_s: start, s on the formation's clock.
        circle: circle for an order to hold; other orders in a hold keep the present circle.
        turn_radius_m: turn radius for an order of another path, m.

    Raises:
        RefusedOrderError: it cannot be carried out; one sentence says why.
    """
    if formation.flown is Manoeuvre.ABORT and order.action != "abort":
        raise RefusedOrderError(
            "everything was called off: the formation begins anew with its companions"
        )
    check_known(order, formation)
    _check_members(order, formation)
    _check_state(order, formation)
    end = _ends(order, formation)
    _check_room(order, formation, end)
    begin = {name: formation.slots.get(name, end[name]) for name in end}
    # Companions compare slots at the resolution of orders.
    begin = {name: _rounded(point) for name, point in begin.items()}
    end = {name: _rounded(point) for name, point in end.items()}
    flown = Manoeuvre.FORMATION
    if order.action == "abort":
        flown = Manoeuvre.ABORT
        end = begin
        found = Transition(
            places=tuple(
                SlotMove(vehicle=name, begin=begin[name], end=begin[name]) for name in begin
            ),
            climb_s=0.0,
            across_s=0.0,
            nearest=None,
        )
    else:
        found = transition(begin, end, limits, leader=formation.leader)
    if formation.holds_after(order):
        circle = circle if order.action == "hold" else formation.circle
        if circle is None:
            raise RefusedOrderError("where to hold is not known: the leader is not heard")
        flown = Manoeuvre.HOLD
    path = order.path or formation.path
    turn_radius_m = turn_radius_m if order.path else formation.turn_radius_m
    changed = path != MAIN_PATH or turn_radius_m > 0.0
    arrangement = Arrangement(
        number=number,
        time_s=time_s,
        flown=flown,
        climb_s=found.climb_s,
        across_s=found.across_s,
        places=found.places,
        circle=circle if flown is Manoeuvre.HOLD else None,
        path=path,
        # A new leader has to know the same path, even an unchanged one.
        path_check=formation.paths.get(path, 0) if changed or order.lead else 0,
        turn_radius_m=turn_radius_m,
        lead=order.lead or "",
    )
    return arrangement, found


def _rounded(point: Point) -> Point:
    return Point(
        *(
            round(round(value / STEP_M) * STEP_M, 1)
            for value in (point.forward, point.right, point.up)
        )
    )


def check_known(order: Order, formation: Formation) -> None:
    """Raise RefusedOrderError if an order names what the mission lacks, whatever is flown now."""
    for name in (*(order.swap or ()), *order.slots, *order.leave, *order.join):
        if name == formation.leader:
            role = "leads" if formation.leads == name else "flies where slots count from"
            raise RefusedOrderError(f"{name} {role}: it has no slot that could be changed")
        if name not in formation.home:
            known = ", ".join(formation.home) or "none"
            raise RefusedOrderError(f"no follower is called {name!r}: there are {known}")
    if order.swap is not None and order.swap[0] == order.swap[1]:
        raise RefusedOrderError(f"{order.swap[0]} cannot change places with itself")
    if order.path is not None and order.path not in formation.paths:
        known = ", ".join(formation.paths)
        raise RefusedOrderError(f"no path is called {order.path!r}: the mission has {known}")
    name = order.lead or ""
    if name and not formation.may_lead:
        raise RefusedOrderError(
            f"{name} cannot lead: the mission names no deputies; write them under deputies"
        )
    if name and name not in formation.may_lead:
        known = ", ".join(formation.may_lead)
        raise RefusedOrderError(f"{name} may not lead: leader and deputies are {known}")


def _check_members(order: Order, formation: Formation) -> None:
    """Raise RefusedOrderError if a vehicle is wrongly in or out of the formation."""
    for name in (*(order.swap or ()), *order.leave):
        if name not in formation.slots:
            raise RefusedOrderError(f"{name} is not in the formation")
    for name in order.join:
        if name in formation.slots:
            raise RefusedOrderError(f"{name} is in the formation already")
    for name in (*(order.swap or ()), *order.slots):
        if name in order.leave:
            raise RefusedOrderError(f"{name} cannot leave and have a slot by one order")
        if name not in formation.slots and name not in order.join:
            raise RefusedOrderError(f"{name} is not in the formation: let it join first")


def _check_state(order: Order, formation: Formation) -> None:
    """Raise RefusedOrderError if the formation is not in a state for an order, or nothing changes."""
    if order.action == "resume" and formation.flown is not Manoeuvre.HOLD:
        raise RefusedOrderError(
            "nothing is held: the mission is flown, and nothing is to be resumed"
        )
    if order.path == formation.path:
        raise RefusedOrderError(f"the path {order.path!r} is followed already")
    if order.lead is None:
        return
    if order.lead == formation.leads:
        raise RefusedOrderError(f"{order.lead} leads already")
    staying = {formation.leader, *formation.slots, *order.join} - {*order.leave}
    if order.lead not in staying:
        raise RefusedOrderError(f"{order.lead} is not in the formation: it cannot lead")


def _check_room(order: Order, formation: Formation, end: Mapping[str, Point]) -> None:
    """Raise RefusedOrderError if a joining vehicle has no room beside its slot."""
    places = {formation.leader: LEADER, **end}
    for name in order.join:
        for other, place in places.items():
            distance = place.minus(end[name]).size
            if other != name and distance < JOIN_M - 2.0 * STEP_M:
                raise RefusedOrderError(
                    f"{name} would join {distance:.1f} m from {other}, less than {JOIN_M:g} m:"
                    " order a greater spacing, and the narrow one once it has joined"
                )


def _ends(order: Order, formation: Formation) -> dict[str, Point]:
    """Return the final slot of each follower."""
    end = {name: point for name, point in formation.slots.items() if name not in order.leave}
    end |= _joined(order, formation, end)
    if order.shape is not None:
        end = _shaped(order, formation, end)
    elif order.spacing is not None:
        end = _scaled(order.spacing, formation, end)
    if order.swap is not None:
        first, second = order.swap
        end[first], end[second] = end[second], end[first]
    end |= order.slots
    if formation.holds_after(order):
        # Ranked by the whole mission: others that leave or join change no vehicle's height.
        return {
            name: replace(end[name], up=STACK_M * (rank + 1))
            for rank, name in enumerate(formation.home)
            if name in end
        }
    if formation.flown is Manoeuvre.HOLD or order.action == "resume":
        return {name: replace(point, up=formation.home[name].up) for name, point in end.items()}
    return end


def _joined(order: Order, formation: Formation, present: Mapping[str, Point]) -> dict[str, Point]:
    """Return joining vehicles' slots: free places of the present formation, at their mission's height."""
    home = {name: (point.forward, point.right) for name, point in formation.home.items()}
    flown = {name: (point.forward, point.right) for name, point in present.items()}
    return {
        name: Point(*place, formation.home[name].up)
        for name, place in joined_places(order.join, flown, home).items()
    }


def _shaped(order: Order, formation: Formation, end: Mapping[str, Point]) -> dict[str, Point]:
    """Return the slots of a shape, assigned with the smallest sum of squared ways."""
    shape = order.shape
    if shape is None:
        return dict(end)
    # Slots are rounded: without rounding the spacing, a formation would shrink from order to order.
    spacing = order.spacing or max(round(2.0 * (formation.spacing or 0.0)) / 2.0, LEAST_M)
    places = shape_slots(shape, len(end), spacing)
    here = {
        name: (point.forward, point.right) if name not in order.join else FAR_BEHIND
        for name, point in end.items()
    }
    return {
        name: Point(forward, right, formation.home[name].up)
        for name, (forward, right) in assigned(here, places).items()
    }


def _scaled(spacing: float, formation: Formation, end: Mapping[str, Point]) -> dict[str, Point]:
    """Return the formation scaled to another smallest distance (m)."""
    present = formation.spacing
    if not present:
        return dict(end)
    scale = spacing / present
    return {
        name: replace(point, forward=scale * point.forward, right=scale * point.right)
        for name, point in end.items()
    }
