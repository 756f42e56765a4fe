"""Arrangement: slots, shape and transition of all followers from a moment on.

An arrangement is complete: it has the start, end and time of each slot's motion. A restarted companion needs
nothing else to know its slot. All slots move straight, at once, and by one time law.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from enum import IntEnum
from typing import Literal, get_args

import msgspec

from vfguide.guidance.formation import Slot

Shape = Literal[
    "vee", "echelon-left", "echelon-right", "line-abreast", "trail", "diamond", "finger-four"
]
"""Name of a shape in orders."""

Offset = tuple[float, float]
"""Position relative to the leader, (forward, right), m."""

SHAPES: tuple[Shape, ...] = get_args(Shape)

DIAGONAL = math.sqrt(0.5)
"""Components of a step of length 1 at 45 degrees, back and aside."""


SAME_M = 0.3
"""Largest difference of equal slots, m: orders carry tenths of a metre."""


def shape_slots(shape: Shape, count: int, spacing: float) -> tuple[Offset, ...]:
    """Return the slots (forward, right) of a shape, m, the nearest to the leader first.

    `spacing` is the smallest distance between any two aircraft, m.

    Raises:
        ValueError: there is no such shape.
    """
    if shape not in SLOTS:
        raise ValueError(f"no shape is called {shape!r}: there are {', '.join(SHAPES)}")
    return tuple((spacing * forward, spacing * right) for forward, right in SLOTS[shape](count))


def named_shape(slots: Iterable[Offset]) -> tuple[Shape, float] | None:
    """Return the shape of slots in any order, and its spacing (m); None if there is none."""
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
    """Return two arms at 45 degrees, right and left in turn."""
    return [_arm(number // 2 + 1, 1 if number % 2 == 0 else -1) for number in range(count)]


def echelon_left(count: int) -> list[Offset]:
    """Return one arm at 45 degrees to the left."""
    return [_arm(number + 1, -1) for number in range(count)]


def echelon_right(count: int) -> list[Offset]:
    """Return one arm at 45 degrees to the right."""
    return [_arm(number + 1, 1) for number in range(count)]


def line_abreast(count: int) -> list[Offset]:
    """Return places beside the leader, right and left in turn."""
    return [
        (0.0, float(number // 2 + 1) * (1 if number % 2 == 0 else -1)) for number in range(count)
    ]


def trail(count: int) -> list[Offset]:
    """Return places one behind the other."""
    return [(-float(number + 1), 0.0) for number in range(count)]


def diamond(count: int) -> list[Offset]:
    """Return a square on its corner, the leader at its front, filled from the front.

    Rows have 1, 2, ... m, ... 2, 1 places for the smallest sufficient m, each filled from its middle.
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
    """Return fours like the fingertips of a hand, one four behind the other."""
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
    """Return (forward, right) after some steps back and to a side, 1 right and -1 left."""
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
"""Functions for the slots of each shape at a spacing of 1."""


RAMP = 0.3
"""Share of a motion's duration for its acceleration, and for its deceleration.

The speed rises by the minimum-jerk polynomial 10 x³ - 15 x⁴ + 6 x⁵ (Flash and Hogan, 1985), so that speed,
acceleration and jerk have no steps. One such polynomial over the whole way would need 1.875 times the mean
speed, this law 1.43 times: the reserve above cruise limits a motion."""

PEAK = 1.0 / (1.0 - RAMP)
"""Peak speed of a motion over its mean speed."""


MAIN_PATH = "main"
"""Name of a mission's initial path."""


class Manoeuvre(IntEnum):
    """Kind of manoeuvre of an arrangement."""

    FORMATION = 1
    """Path of the mission, with each vehicle in its slot."""
    HOLD = 2
    """Circle, with each vehicle in its slot and at a height of its own."""
    ABORT = 3
    """End of the formation: each vehicle returns to its autopilot at once."""


class Point(msgspec.Struct, frozen=True):
    """Place in the formation relative to the leader, m."""

    forward: float
    """Distance ahead."""
    right: float
    """Distance to the right."""
    up: float = 0.0
    """Height above."""

    def minus(self, other: "Point") -> "Point":
        """Return the vector from another point to this one."""
        return Point(self.forward - other.forward, self.right - other.right, self.up - other.up)

    @property
    def size(self) -> float:
        """Distance from the leader, m."""
        return math.hypot(self.forward, self.right, self.up)


class SlotMove(msgspec.Struct, frozen=True, kw_only=True):
    """Slot motion of one vehicle."""

    vehicle: str
    """Name of the vehicle."""
    begin: Point
    """Slot before the motion."""
    end: Point
    """Slot after the motion."""
    layer: float | None = None
    """Height of the crossing above the leader, m; None: height changes on the way, if at all."""


class HoldCircle(msgspec.Struct, frozen=True, kw_only=True):
    """Circle of the leader in a hold."""

    latitude_deg: float
    """Latitude of the centre, degrees."""
    longitude_deg: float
    """Longitude of the centre, degrees."""
    radius_m: float
    """Radius, m, positive."""
    clockwise: bool = True
    """Sense of rotation seen from above."""


class Arrangement(msgspec.Struct, frozen=True, kw_only=True):
    """Slots and manoeuvre of all vehicles from a moment on."""

    number: int
    """Sequence number of the order: a greater one supersedes."""
    time_s: float
    """Start of the slot motions, s on the formation's clock."""
    flown: Manoeuvre = Manoeuvre.FORMATION
    """Manoeuvre to fly."""
    climb_s: float = 0.0
    """Duration of the climb into layers, and of the descent, s; 0 without layers."""
    across_s: float
    """Duration of the horizontal motion, s."""
    places: tuple[SlotMove, ...]
    """Slot motions of all followers; a follower without one leaves the formation."""
    circle: HoldCircle | None = None
    """Circle of a hold."""
    path: str = MAIN_PATH
    """Name of the mission's path for the leader, in a hold the path after it."""
    path_check: int = 0
    """Checksum of the path; 0 as long as the path was not changed."""
    turn_radius_m: float = 0.0
    """Smallest turn radius while joining the path, m; 0 as long as the path was not changed."""
    lead: str = ""
    """Name of the leading vehicle from `time_s` on; empty for no change."""

    @property
    def duration_s(self) -> float:
        """Duration of all slot motions, s."""
        return self.across_s + 2.0 * self.climb_s

    @property
    def vehicles(self) -> frozenset[str]:
        """Names of the followers in the arrangement."""
        return frozenset(one.vehicle for one in self.places)

    def place_of(self, vehicle: str) -> SlotMove | None:
        """Return a follower's slot motion; None for a follower that leaves."""
        return next((one for one in self.places if one.vehicle == vehicle), None)

    def _known_place(self, vehicle: str) -> SlotMove:
        place = self.place_of(vehicle)
        if place is None:
            raise KeyError(vehicle)
        return place

    def slot(self, vehicle: str, time_s: float) -> Slot:
        """Return a follower's slot and its rates at a time (s on the formation's clock).

        Raises:
            KeyError: the vehicle has no slot in the arrangement.
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
        """Return (height of a slot above the leader in m, its rate in m/s); see `slot`."""
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
    """Return (share of the way, rate in 1/s, acceleration in 1/s²) `since_s` seconds after a motion's start.

    The motion rests before its start and after its duration (s); a duration of 0 is a step.
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
    """Return the time (s after the beginning) at which a motion has completed a share of its way."""
    early, late = 0.0, duration_s
    for _ in range(50):
        middle = 0.5 * (early + late)
        if progress(middle, duration_s)[0] < share:
            early = middle
        else:
            late = middle
    return 0.5 * (early + late)


def ends(places: Iterable[SlotMove]) -> dict[str, Point]:
    """Return each follower's final slot, by name."""
    return {one.vehicle: one.end for one in places}


def agreed_number(numbers: Mapping[str, int], coordinator: str, *, lone: bool = False) -> int:
    """Return the number of the order in force by the votes of vehicles; 0 before the first.

    The coordinator's vote decides, or two others. A single other vehicle counts only if `lone`, as without
    others in the formation: its companion may be wrong, or its key stolen.
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
    """Return the names of vehicles whose consent an order lacks; none once it may be flown.

    Consent is required of vehicles whose slots move, and of a new leader. Of the others a majority suffices
    once the time is closing in. Vehicles sent away, or relieved of the lead, are not asked.

    Args:
        order: order to be flown.
        own: name of the deciding vehicle, which has agreed.
        agreed: names of the other vehicles that have agreed.
        steered: names of vehicles that are received, and steered by their companions.
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
    """Describe the order in force, by number (0 before the first); `order` is None if not received."""
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
    """Describe an order: its manoeuvre, and its new leader if any."""
    text = flown_in_words(order.number, order)
    return f"{text}, {order.lead} leads" if order.lead else text


def slots_in_words(places: Iterable[SlotMove]) -> str:
    """Describe the final shape of the followers."""
    points = ends(places)
    if not points:
        return "no followers"
    shape = named_shape((point.forward, point.right) for point in points.values())
    if shape is None:
        return "slots of their own"
    return f"{shape[0]}, {shape[1]:.0f} m apart"
