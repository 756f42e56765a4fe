"""What an operator orders, the one arrangement that it comes to, and who takes which slot of it.

Who goes to which slot is chosen so that the sum of the squares of all ways is least. Interchangeable
vehicles that go straight to slots assigned like that, all by one time law, never come nearer to each
other than the least distance of slots over the square root of two (Turpin, Michael, Kumar, "CAPT:
Concurrent assignment and planning of trajectories for multiple robots", International Journal of Robotics
Research 33(1), 2014, theorem 4.3). The leader is not interchangeable: it stays where it is.

Every order, be it a shape, another spacing, a swap or a vehicle that leaves, comes to a whole arrangement
here, on the operator's side. Companions know arrangements only.
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

# Which slot somebody who joins a formation is given: one that the present formation leaves free.
#
# An arrangement tells where everybody flies, not which shape that is. It is found by the places: those of the
# mission, at any spacing and whoever flies in which of them, or those of a shape by name. Where the present
# slots are neither, as after an order of slots by name, who joins is given its slot in the mission.

STEP_M = 0.1
"""Slots are ordered to this, orders carry no more; spacings are taken to it."""


def joined_places(
    joining: Sequence[str], present: Mapping[str, Offset], home: Mapping[str, Offset]
) -> dict[str, Offset]:
    """Where each vehicle that joins is to fly, (forward, right) of the leader, m.

    Args:
        joining: names of the vehicles.
        present: where those fly that are in the formation, by name.
        home: where all fly in the mission, by name.
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
    """What each shape of so many followers leaves free that the places fit into that are taken, m.

    Of several spacings that are possible the least counts that leaves room to join.
    """
    for shape in SHAPES:
        scales = fitting_scales(taken, shape_slots(shape, count, 1.0))
        if scales:
            wide = [scale for scale in scales if scale >= JOIN_M - STEP_M]
            spacing = round(min(wide, default=max(scales)) / STEP_M) * STEP_M
            yield without(taken, shape_slots(shape, count, spacing))


def fitting_scales(taken: Sequence[Offset], places: Sequence[Offset]) -> list[float]:
    """By what places may be multiplied for those that are taken to be among them.

    Args:
        taken: (forward, right) of the leader, m.
        places: (forward, right) of the leader, in any unit.
    """
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
    """Places that nobody has, in their order."""
    left = list(places)
    for place in taken:
        near = [one for one in left if math.dist(one, place) <= SAME_M]
        if near:
            left.remove(min(near, key=lambda one: math.dist(one, place)))
    return left


def _given(wanted: Mapping[str, Offset], free: Sequence[Offset]) -> dict[str, Offset]:
    """A free place for each: the one that it wants, else the first that is left."""
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
"""Between the heights of two that hold."""

FAR_BEHIND = (-300.0, 0.0)
"""From about there a vehicle comes that joins: the others have the first choice of slots."""


def assigned(begin: Mapping[str, Offset], places: Sequence[Offset]) -> dict[str, Offset]:
    """The place of each follower.

    Args:
        begin: where each follower is now, (forward, right) of the leader, m.
        places: as many, in any order.

    Returns:
        the place of each, by name.

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
    """The column of each row of a square, each once, so that the sum of all costs is least.

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
"""The year 2026, s since 1970. Orders are numbered by the seconds since then: numbers rise for ever ..."""

CHANCE_BITS = 3
"""... with so many bits of chance below, for two operators in the same second; 32 bits last until 2043."""


def new_number(newest: int, unix_s: float, chance: Random) -> int:
    """A number for an order, greater than the newest one; hardly the same as another operator's.

    Args:
        newest: number that is flown by.
        unix_s: s since 1970; a clock that is behind does no harm.
        chance: where its lowest bits come from.
    """
    seconds = max(int(unix_s - EPOCH_S), 0)
    return max(seconds << CHANCE_BITS, newest + 1) + chance.getrandbits(CHANCE_BITS)


Action = Literal["hold", "resume", "abort"]


class Order(msgspec.Struct, frozen=True, kw_only=True):
    """What an operator wants; what is not said stays as it is."""

    shape: Shape | None = None
    """To be flown."""
    spacing: float | None = None
    """Between neighbours, m."""
    swap: tuple[str, str] | None = None
    """Two followers that change places."""
    slots: Mapping[str, Point] = msgspec.field(default_factory=dict)
    """Slots by follower."""
    leave: tuple[str, ...] = ()
    """Followers that leave."""
    join: tuple[str, ...] = ()
    """Followers that come back."""
    action: Action | None = None
    """Hold, go on, or call everything off."""
    path: str | None = None
    """Name of the mission's path to be followed."""
    lead: str | None = None
    """Name of the vehicle that is to lead."""


class Formation(msgspec.Struct, frozen=True, kw_only=True):
    """A formation as an operator knows it."""

    leader: str
    """Name of the leader."""
    home: Mapping[str, Point]
    """Slots of the mission, by follower, in its order."""
    slots: Mapping[str, Point]
    """Slots of those that fly in it now, by follower."""
    number: int = 0
    """Number of the newest order."""
    flown: Manoeuvre = Manoeuvre.FORMATION
    """What is flown."""
    circle: HoldCircle | None = None
    """Circle of the hold that is flown."""
    path: str = MAIN_PATH
    """Name of the mission's path that is followed."""
    turn_radius_m: float = 0.0
    """The leader turns no tighter onto it; 0 as long as it was not changed."""
    paths: Mapping[str, int] = msgspec.field(default_factory=lambda: {MAIN_PATH: 0})
    """All paths of the mission by name, and what tells each from any other of its name."""
    may_lead: tuple[str, ...] = ()
    """Who may lead, the mission's leader first; empty without deputies."""
    holder: str = ""
    """Who leads; the mission's leader where it is not said."""

    @property
    def leads(self) -> str:
        """Name of the vehicle that leads."""
        return self.holder or self.leader

    @property
    def spacing(self) -> float | None:
        """Least distance of two slots, m, without the stack of a hold; None without followers."""
        slots = dict(self.slots)
        if self.flown is Manoeuvre.HOLD:
            slots = {name: replace(slot, up=self.home[name].up) for name, slot in slots.items()}
        places = [LEADER, *slots.values()]
        return min((one.minus(other).size for one, other in combinations(places, 2)), default=None)

    def after(self, arrangement: Arrangement) -> "Formation":
        """The formation once an arrangement is flown."""
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
        """Whether the leader circles once an order is flown: a hold lasts until the mission goes on."""
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
    """The arrangement that an order comes to, and how everybody gets there.

    Args:
        order: what is wanted.
        formation: as it is.
        limits: how fast slots may move.
        number: of the arrangement, greater than that of any before.
        time_s: when it begins, s on the formation's clock.
        circle: where to hold, for an order to hold; any other order in a hold keeps the circle that is flown.
        turn_radius_m: for an order of another path, of the turns onto it.

    Raises:
        RefusedOrderError: it cannot be carried out; one sentence says why.
    """
    if formation.flown is Manoeuvre.ABORT and order.action != "abort":
        raise RefusedOrderError(
            "everything was called off: the formation begins anew with its companions"
        )
    check_known(order, formation)
    _check_state(order, formation)
    end = _ends(order, formation)
    _check_room(order, formation, end)
    begin = {name: formation.slots.get(name, end[name]) for name in end}
    # Companions compare slots as orders tell them.
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
        # Who is to lead has to know the same path, also where it stays.
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
    """See that an order names what the mission has, whatever is flown now.

    Raises:
        RefusedOrderError: it names a vehicle or a path that there is not, or that may not do it.
    """
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


def _check_state(order: Order, formation: Formation) -> None:
    """See that each is in the formation or out of it as it has to be, and that something changes.

    Raises:
        RefusedOrderError: it is not so.
    """
    for name in (*(order.swap or ()), *order.leave):
        if name not in formation.slots:
            raise RefusedOrderError(f"{name} is not in the formation")
    for name in order.join:
        if name in formation.slots:
            raise RefusedOrderError(f"{name} is in the formation already")
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
    """See that those who join have room beside their slots.

    Raises:
        RefusedOrderError: one has not.
    """
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
    """Where everybody is to be."""
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
        # By all of the mission: who stays keeps its height, whoever else leaves or joins.
        return {
            name: replace(end[name], up=STACK_M * (rank + 1))
            for rank, name in enumerate(formation.home)
            if name in end
        }
    if formation.flown is Manoeuvre.HOLD or order.action == "resume":
        return {name: replace(point, up=formation.home[name].up) for name, point in end.items()}
    return end


def _joined(order: Order, formation: Formation, present: Mapping[str, Point]) -> dict[str, Point]:
    """The slots of those who join: what the present formation leaves free, each at its height."""
    home = {name: (point.forward, point.right) for name, point in formation.home.items()}
    flown = {name: (point.forward, point.right) for name, point in present.items()}
    return {
        name: Point(*place, formation.home[name].up)
        for name, place in joined_places(order.join, flown, home).items()
    }


def _shaped(order: Order, formation: Formation, end: Mapping[str, Point]) -> dict[str, Point]:
    """The slots of a shape, each given to the follower for which the sum of all squared ways is least."""
    shape = order.shape
    if shape is None:
        return dict(end)
    # Slots are rounded: without that a formation would shrink from order to order.
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
    """A formation with another least distance."""
    present = formation.spacing
    if not present:
        return dict(end)
    scale = spacing / present
    return {
        name: replace(point, forward=scale * point.forward, right=scale * point.right)
        for name, point in end.items()
    }
