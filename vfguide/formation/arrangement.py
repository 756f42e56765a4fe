"""An arrangement: who flies where from a moment on, in which shape, and how everybody gets there.

It is complete by itself: from where each slot moves, to where, and when. A companion that was started anew
needs nothing else to know where its slot is. All slots move straight, at once and by one time law.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from enum import IntEnum
from typing import Literal, get_args

import msgspec

from vfguide.guidance.formation import Slot

Shape = Literal[
    "vee",
    "echelon-left",
    "echelon-right",
    "line-abreast",
    "trail",
    "diamond",
    "finger-four",
]
"""What an order calls a shape."""

Offset = tuple[float, float]
"""(forward, right) of the leader, m."""

SHAPES: tuple[Shape, ...] = get_args(Shape)

DIAGONAL = math.sqrt(0.5)
"""How far a step of length 1 at 45 degrees goes back and aside."""


SAME_M = 0.3
"""Slots that differ by no more are the same: orders carry tenths of a metre."""


def shape_slots(shape: Shape, count: int, spacing: float) -> tuple[Offset, ...]:
    """Slots of a shape, the nearest to the leader first; the leader itself is at (0, 0).

    Args:
        shape: its name.
        count: of followers.
        spacing: between neighbours, m: no two aircraft of the shape are nearer.

    Returns:
        (forward, right) of each follower, m.

    Raises:
        ValueError: there is no such shape.
    """
    if shape not in SLOTS:
        raise ValueError(f"no shape is called {shape!r}: there are {', '.join(SHAPES)}")
    return tuple((spacing * forward, spacing * right) for forward, right in SLOTS[shape](count))


def named_shape(slots: Iterable[Offset]) -> tuple[Shape, float] | None:
    """The shape that slots are, and the distance between its neighbours (m); None where they are none.

    Args:
        slots: (forward, right) of each follower, m, in any order.
    """
    wanted = sorted(slots)
    reach = sum(math.hypot(*place) for place in wanted)
    if reach <= 0.0:
        return None
    for shape in SHAPES:
        spacing = reach / sum(math.hypot(*place) for place in shape_slots(shape, len(wanted), 1.0))
        left = list(shape_slots(shape, len(wanted), spacing))
        for place in wanted:
            near = [one for one in left if math.dist(one, place) <= SAME_M]
            if not near:
                break
            left.remove(near[0])
        else:
            return shape, spacing
    return None


def vee(count: int) -> list[Offset]:
    """Two arms at 45 degrees, right and left in turn."""
    return [_arm(number // 2 + 1, 1 if number % 2 == 0 else -1) for number in range(count)]


def echelon_left(count: int) -> list[Offset]:
    """One arm at 45 degrees to the left."""
    return [_arm(number + 1, -1) for number in range(count)]


def echelon_right(count: int) -> list[Offset]:
    """One arm at 45 degrees to the right."""
    return [_arm(number + 1, 1) for number in range(count)]


def line_abreast(count: int) -> list[Offset]:
    """Beside the leader, right and left in turn."""
    return [
        (0.0, float(number // 2 + 1) * (1 if number % 2 == 0 else -1)) for number in range(count)
    ]


def trail(count: int) -> list[Offset]:
    """One behind the other."""
    return [(-float(number + 1), 0.0) for number in range(count)]


def diamond(count: int) -> list[Offset]:
    """A square that stands on its corner, the leader at its front, filled from the front.

    Rows of 1, 2, ... m, ... 2, 1 places for the smallest m that has room; each row is filled from its middle.
    """
    side = math.isqrt(count) + 1
    places: list[Offset] = []
    for row in range(2 * side - 1):
        width = side - abs(row - side + 1)
        across = [(2.0 * place - (width - 1)) * DIAGONAL for place in range(width)]
        across.sort(key=lambda right: (abs(right), -right))
        places += [(-row * DIAGONAL, right) for right in across]
    return places[1 : count + 1]


def finger_four(count: int) -> list[Offset]:
    """Fours like the fingertips of a hand, one four behind the other."""
    four = [
        (0.0, 0.0),
        (-DIAGONAL, -DIAGONAL),
        (-DIAGONAL, DIAGONAL),
        (-2.0 * DIAGONAL, 2.0 * DIAGONAL),
    ]
    depth = 1.0 + 2.0 * DIAGONAL
    places = [
        (forward - depth * (number // 4), right)
        for number in range(count + 1)
        for forward, right in [four[number % 4]]
    ]
    return places[1:]


def _arm(steps: int, side: int) -> Offset:
    """(forward, right) after some steps back and to a side, 1 right and -1 left."""
    return -steps * DIAGONAL, side * steps * DIAGONAL


SLOTS: Mapping[str, Callable[[int], list[Offset]]] = {
    "vee": vee,
    "echelon-left": echelon_left,
    "echelon-right": echelon_right,
    "line-abreast": line_abreast,
    "trail": trail,
    "diamond": diamond,
    "finger-four": finger_four,
}
"""Slots for a spacing of 1."""


RAMP = 0.3
"""Share of the time in which a motion gains its greatest speed, and of that in which it loses it again.

The speed rises by the minimum-jerk polynomial 10 x³ - 15 x⁴ + 6 x⁵ (Flash and Hogan, 1985), so that speed,
acceleration and jerk have no steps. One such polynomial over the whole way would need 1.875 times the mean
speed, this needs 1.43 times: the speed that an aircraft has beyond its cruise is what limits a motion.
"""

PEAK = 1.0 / (1.0 - RAMP)
"""Greatest speed of a motion in parts of its mean speed."""


MAIN_PATH = "main"
"""Name of the path that a mission begins with."""


class Manoeuvre(IntEnum):
    """What is flown by an arrangement."""

    FORMATION = 1
    """A path of the mission, each vehicle in its slot."""
    HOLD = 2
    """A circle, each vehicle in its slot and at a height of its own."""
    ABORT = 3
    """Nothing: each vehicle goes back to its autopilot, at once."""


class Point(msgspec.Struct, frozen=True):
    """A place in the formation, m from the leader."""

    forward: float
    """Ahead."""
    right: float
    """To the right."""
    up: float = 0.0
    """Above."""

    def minus(self, other: "Point") -> "Point":
        """The way from another point to this one."""
        return Point(self.forward - other.forward, self.right - other.right, self.up - other.up)

    @property
    def size(self) -> float:
        """Distance from the leader, m."""
        return math.hypot(self.forward, self.right, self.up)


class SlotMove(msgspec.Struct, frozen=True, kw_only=True):
    """One vehicle's part of an arrangement."""

    vehicle: str
    """Its name."""
    begin: Point
    """Where its slot is before."""
    end: Point
    """Where it is after."""
    layer: float | None = None
    """Height above the leader in which it crosses, m; None: it climbs or descends on its way, if at all."""


class HoldCircle(msgspec.Struct, frozen=True, kw_only=True):
    """Where the leader circles."""

    latitude_deg: float
    """Latitude of the centre."""
    longitude_deg: float
    """Longitude of the centre."""
    radius_m: float
    """Positive."""
    clockwise: bool = True
    """Seen from above."""


class Arrangement(msgspec.Struct, frozen=True, kw_only=True):
    """Who flies where from a moment on."""

    number: int
    """Rises from order to order: a newer one counts."""
    time_s: float
    """When slots begin to move, s on the formation's clock."""
    flown: Manoeuvre = Manoeuvre.FORMATION
    """What is flown."""
    climb_s: float = 0.0
    """How long it takes into the layers, and out of them again, s; 0 without layers."""
    across_s: float
    """How long the slots move in the plane, s."""
    places: tuple[SlotMove, ...]
    """Places of all followers that fly in it; a follower without one leaves the formation."""
    circle: HoldCircle | None = None
    """Circle of a hold."""
    path: str = MAIN_PATH
    """Name of the mission's path that the leader follows, after a hold where there is one."""
    path_check: int = 0
    """What tells that path from any other of its name; 0 as long as it was not changed."""
    turn_radius_m: float = 0.0
    """The leader turns no tighter onto that path; 0 as long as the path was not changed."""
    lead: str = ""
    """Name of the vehicle that leads from its time on; empty where that is not changed."""

    @property
    def duration_s(self) -> float:
        """From the first motion of a slot to the last, s."""
        return self.across_s + 2.0 * self.climb_s

    @property
    def vehicles(self) -> frozenset[str]:
        """Names of the followers that fly in it."""
        return frozenset(one.vehicle for one in self.places)

    def place_of(self, vehicle: str) -> SlotMove | None:
        """A follower's part; None for one that leaves."""
        return next((one for one in self.places if one.vehicle == vehicle), None)

    def _known_place(self, vehicle: str) -> SlotMove:
        place = self.place_of(vehicle)
        if place is None:
            raise KeyError(vehicle)
        return place

    def slot(self, vehicle: str, time_s: float) -> Slot:
        """The slot of a follower that flies in it, at a time (s on the formation's clock), and its rates.

        Raises:
            KeyError: this vehicle has no place in it.
        """
        place = self._known_place(vehicle)
        share, rate, acceleration = progress(time_s - self.time_s - self.climb_s, self.across_s)
        way = place.end.minus(place.begin)
        return Slot(
            forward=place.begin.forward + share * way.forward,
            right=place.begin.right + share * way.right,
            forward_rate=rate * way.forward,
            right_rate=rate * way.right,
            forward_acceleration=acceleration * way.forward,
            right_acceleration=acceleration * way.right,
        )

    def height(self, vehicle: str, time_s: float) -> tuple[float, float]:
        """(height of a slot above the leader in m, its rate in m/s); see `slot`."""
        place = self._known_place(vehicle)
        since, begin, end = time_s - self.time_s, place.begin.up, place.end.up
        if place.layer is None:
            share, rate, _ = progress(since - self.climb_s, self.across_s)
            return begin + share * (end - begin), rate * (end - begin)
        up, up_rate, _ = progress(since, self.climb_s)
        down, down_rate, _ = progress(since - self.climb_s - self.across_s, self.climb_s)
        height = begin + up * (place.layer - begin) + down * (end - place.layer)
        return height, up_rate * (place.layer - begin) + down_rate * (end - place.layer)


def progress(since_s: float, duration_s: float) -> tuple[float, float, float]:
    """(share of the way, its rate in 1/s, its acceleration in 1/s²) some time after a motion has begun.

    Args:
        since_s: since its beginning, s; before it nothing moves, nor after its end.
        duration_s: of the motion, s; one that takes none is a step.
    """
    if since_s >= duration_s:
        return 1.0, 0.0, 0.0
    if since_s <= 0.0:
        return 0.0, 0.0, 0.0
    ramp_s, fastest = RAMP * duration_s, PEAK / duration_s
    left_s = duration_s - since_s
    if ramp_s <= since_s <= left_s or ramp_s <= left_s <= since_s:
        return fastest * (since_s - 0.5 * ramp_s), fastest, 0.0
    x = min(since_s, left_s) / ramp_s
    share = fastest * ramp_s * x**4 * (2.5 - 3.0 * x + x * x)
    rate = fastest * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    acceleration = fastest / ramp_s * 30.0 * x * x * (1.0 - x) ** 2
    if since_s < left_s:
        return share, rate, acceleration
    return 1.0 - share, rate, -acceleration


def time_of(share: float, duration_s: float) -> float:
    """When a motion of some duration (s) has come to a share of its way, s after its beginning."""
    early, late = 0.0, duration_s
    for _ in range(50):
        middle = 0.5 * (early + late)
        if progress(middle, duration_s)[0] < share:
            early = middle
        else:
            late = middle
    return 0.5 * (early + late)


def ends(places: Iterable[SlotMove]) -> dict[str, Point]:
    """Where each follower flies once everything is done, by name."""
    return {one.vehicle: one.end for one in places}


def agreed_number(numbers: Mapping[str, int], coordinator: str, *, lone: bool = False) -> int:
    """The newest order that is flown, by what vehicles say; 0 before the first.

    The coordinator's word counts, and that of any two others. One other alone changes nothing: its companion
    may be wrong, or somebody may have its key.

    Args:
        numbers: that the vehicles carry which are heard.
        coordinator: name of the vehicle that decides on orders.
        lone: whether a single voice counts, as where there is no other in the formation.
    """
    ranked = sorted(numbers.values(), reverse=True)
    second = ranked[1] if len(ranked) > 1 else max(ranked, default=0) if lone else 0
    return max(second, numbers.get(coordinator, 0))


def missing_votes(
    order: "Arrangement",
    own: str,
    agreed: Collection[str],
    steered: Collection[str],
    *,
    closing: bool,
) -> list[str]:
    """Return the names of those whose consent an order still lacks; none once it may be flown.

    Needed are those whose slots move, and who is to lead. Of all others that fly in it a majority suffices
    once the time is closing in. Who is sent away, or relieved of the lead, is not asked.

    Args:
        order: that is to be flown.
        own: name of the vehicle that decides, and has agreed.
        agreed: names of all others that have.
        steered: names of those that are heard, and steered by their companions.
        closing: whether the time for answers is over.
    """
    moving = {one.vehicle for one in order.places if one.begin != one.end or one.layer is not None}
    needed = moving | ({order.lead} - {""})
    voters = needed | (set(steered) & order.vehicles) | {own}
    silent = voters - set(agreed) - {own}
    others = silent - needed
    enough = closing and 2 * len(silent) < len(voters)
    return sorted(silent & needed) + ([] if enough else sorted(others))


def flown_in_words(number: int, order: Arrangement | None) -> str:
    """What is flown.

    Args:
        number: of the order; 0 before the first.
        order: the order; None where it was not heard.
    """
    if number == 0:
        return "the mission's formation"
    if order is None:
        return "an order that was not heard: slots are not known"
    if order.flown is Manoeuvre.ABORT:
        return "nothing: all was called off"
    text = slots_in_words(order.places)
    if order.path != MAIN_PATH:
        text += f", on the path {order.path}"
    return f"a hold, {text}" if order.flown is Manoeuvre.HOLD else text


def arrangement_in_words(order: Arrangement) -> str:
    """What an order asks for: what is flown, and who is to lead where it says that."""
    text = flown_in_words(order.number, order)
    return f"{text}, {order.lead} leads" if order.lead else text


def slots_in_words(places: Iterable[SlotMove]) -> str:
    """What followers fly in once they have come to their slots."""
    points = ends(places)
    if not points:
        return "no followers"
    shape = named_shape((point.forward, point.right) for point in points.values())
    if shape is None:
        return "slots of their own"
    return f"{shape[0]}, {shape[1]:.0f} m apart"
