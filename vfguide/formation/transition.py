"""Transitions between formations without close approaches: slot motions, layers, refusals.

Slots move straight, all at once and by one time law, so two slots also move straight relative to each other.
Their closest approach is exact. Where it is too near, one of the two crosses in its own layer above the
others: up, across, down. Where no layer helps, the order is refused with the pair, the time and the distance.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations

import msgspec
from msgspec.structs import replace

from vfguide.errors import InputError
from vfguide.formation.arrangement import PEAK, RAMP, Point, SlotMove, time_of

LEAST_M = 7.5
"""Smallest distance of slots, m: 5 m between aircraft plus their errors from the slots."""

JOIN_M = 15.0
"""Distance from a joining vehicle's slot to any other, m: from the side it may overshoot its slot by 5 m."""

LAYER_M = 12.0
"""Vertical distance of two layers, m: heights are held to a metre or two."""

MOST_LAYERS = 4
"""Largest number of layers: more would take longer than any other way."""

SHORTEST_S = 6.0
"""Shortest duration of a motion, s."""

RAMP_PEAK = 1.875
"""Largest slope of the polynomial for the speed's rise."""

LEADER = Point(0.0, 0.0, 0.0)
"""Fixed place of the leader."""


class RefusedOrderError(InputError):
    """Order that cannot be carried out; the text says why, in one sentence."""


class MotionLimits(msgspec.Struct, frozen=True, kw_only=True):
    """Limits of slot motion."""

    forward: float
    """Forward speed, m/s: the slowest aircraft's reserve beyond its slot's need."""
    back: float
    """Backward speed, m/s, positive."""
    aside: float
    """Speed to either side, m/s."""
    acceleration: float
    """Horizontal acceleration, m/s²."""
    climb: float = 2.0
    """Climb and descent rate, m/s."""


class Approach(msgspec.Struct, frozen=True, kw_only=True):
    """Closest approach of two vehicles in a transition."""

    first: str
    """Name of the first vehicle."""
    second: str
    """Name of the second vehicle."""
    distance: float
    """Smallest distance, m."""
    begun_s: float
    """Beginning of its part of the transition, s after the beginning of the whole."""
    share: float
    """Share of the part's way at the closest approach."""
    duration_s: float
    """Duration of that part, s."""

    @property
    def time_s(self) -> float:
        """Time after the beginning of the transition, s; computed anew each time, at some cost."""
        return self.begun_s + time_of(self.share, self.duration_s)


class Transition(msgspec.Struct, frozen=True, kw_only=True):
    """Slot motions from one formation to the next."""

    places: tuple[SlotMove, ...]
    """Slot motions, with layers where needed."""
    climb_s: float
    """Duration of the climb into layers, and of the descent, s."""
    across_s: float
    """Duration of the horizontal motion, s."""
    nearest: Approach | None
    """Closest approach of all pairs; None without followers."""


def transition(
    begin: Mapping[str, Point],
    end: Mapping[str, Point],
    limits: MotionLimits,
    *,
    leader: str = "leader",
    least: float = LEAST_M,
) -> Transition:
    """Return the motions between two formations with slots at least `least` metres apart.

    The leader stays at (0, 0, 0); `begin` and `end` have the same followers.

    Raises:
        RefusedOrderError: two would come nearer than that, in any layers.
    """
    plain = [SlotMove(vehicle=name, begin=begin[name], end=place) for name, place in end.items()]
    _check_ends(end, leader, least)
    across_s = across_time(plain, limits)
    close = [one for one in approaches(plain, 0.0, across_s, leader) if one.distance < least]
    if not close:
        return _transition(plain, 0.0, across_s, leader)
    # Vehicles that are too near already move apart as in any other transition.
    layered = in_layers(plain, close, leader)
    heights = [abs(one.layer - place.up) for one in layered if one.layer is not None
               for place in (one.begin, one.end)]  # fmt: skip
    climb_s = max(SHORTEST_S, max(heights) * PEAK / limits.climb)
    found = _transition(layered, climb_s, across_s, leader)
    nearest = found.nearest
    if nearest is not None and nearest.distance < least:
        raise RefusedOrderError(
            f"{nearest.first} and {nearest.second} would come within {nearest.distance:.1f} m of each"
            f" other {nearest.time_s:.0f} s after its beginning, less than {least:g} m: choose a"
            " greater spacing, or go by another formation"
        )
    return found


def _transition(
    places: Sequence[SlotMove], climb_s: float, across_s: float, leader: str
) -> Transition:
    found = approaches(places, climb_s, across_s, leader)
    return Transition(
        places=tuple(places),
        climb_s=climb_s,
        across_s=across_s,
        nearest=min(found, key=lambda one: one.distance, default=None),
    )


def _check_ends(end: Mapping[str, Point], leader: str, least: float) -> None:
    """Raise RefusedOrderError if two final slots are too near to each other."""
    for (first, place), (second, other) in combinations([(leader, LEADER), *end.items()], 2):
        distance = place.minus(other).size
        if distance < least:
            raise RefusedOrderError(
                f"the slots of {first} and {second} would be {distance:.1f} m apart, less than"
                f" {least:g} m: choose a greater spacing, or other slots"
            )


def across_time(places: Sequence[SlotMove], limits: MotionLimits) -> float:
    """Return the duration (s) of the horizontal motion within all limits."""
    longest = SHORTEST_S
    for one in places:
        way = one.end.minus(one.begin)
        ahead = way.forward / (limits.forward if way.forward > 0.0 else -limits.back)
        fastest = max(ahead, abs(way.right) / limits.aside)
        hardest = math.hypot(way.forward, way.right) * PEAK * RAMP_PEAK / RAMP
        climbing = 0.0 if one.layer is not None else abs(way.up) / limits.climb
        longest = max(
            longest, fastest * PEAK, math.sqrt(hardest / limits.acceleration), climbing * PEAK
        )
    return longest


def approaches(
    places: Sequence[SlotMove], climb_s: float, across_s: float, leader: str
) -> list[Approach]:
    """Return the closest approaches of all pairs, the leader included."""
    still = SlotMove(vehicle=leader, begin=LEADER, end=LEADER)
    return [
        approach_of(one, other, climb_s, across_s)
        for one, other in combinations([still, *places], 2)
    ]


def approach_of(one: SlotMove, other: SlotMove, climb_s: float, across_s: float) -> Approach:
    """Return the exact closest approach of two slots over the straight parts of their relative motion."""
    found = []
    begun_s = 0.0
    # The time is left open here: a hundred vehicles make five thousand pairs.
    for before, after, duration_s in parts(one, other, climb_s, across_s):
        share, distance = nearest_on(before, after)
        found.append((distance, begun_s, share, duration_s))
        begun_s += duration_s
    distance, begun_s, share, duration_s = min(found)
    return Approach(
        first=one.vehicle,
        second=other.vehicle,
        distance=distance,
        begun_s=begun_s,
        share=share,
        duration_s=duration_s,
    )


def parts(
    one: SlotMove, other: SlotMove, climb_s: float, across_s: float
) -> list[tuple[Point, Point, float]]:
    """Return (vector from one to the other before, after, duration in s) of each part of a transition."""
    corners = [
        [place.begin, _at(place.begin, place), _at(place.end, place), place.end]
        for place in (one, other)
    ]
    ways = [second.minus(first) for first, second in zip(*corners, strict=True)]
    durations = (climb_s, across_s, climb_s)
    return list(zip(ways[:-1], ways[1:], durations, strict=True))


def _at(point: Point, place: SlotMove) -> Point:
    """Return a point at the height of a vehicle's layer."""
    return point if place.layer is None else replace(point, up=place.layer)


def nearest_on(before: Point, after: Point) -> tuple[float, float]:
    """Return (share of the way, distance) of a straight way's point nearest to the origin."""
    way = after.minus(before)
    square = way.forward**2 + way.right**2 + way.up**2
    share = 0.0
    if square > 0.0:
        product = before.forward * way.forward + before.right * way.right + before.up * way.up
        share = min(max(-product / square, 0.0), 1.0)
    return share, Point(
        before.forward + share * way.forward,
        before.right + share * way.right,
        before.up + share * way.up,
    ).size


def in_layers(places: Sequence[SlotMove], close: Sequence[Approach], leader: str) -> list[SlotMove]:
    """Return motions with layers for pairs too near to each other; raise if too many layers."""
    near: dict[str, set[str]] = {}
    for one in close:
        near.setdefault(one.first, set()).add(one.second)
        near.setdefault(one.second, set()).add(one.first)
    highest = max([0.0, *(point.up for one in places for point in (one.begin, one.end))])
    # Vehicles in the way of many stay below, and the others climb.
    order = sorted(near, key=lambda name: (name != leader, -len(near[name]), name))
    layers: dict[str, int] = {}
    for name in order:
        taken = {layers[other] for other in near[name] if other in layers}
        layers[name] = next(number for number in range(len(taken) + 1) if number not in taken)
    most = max(layers.values())
    if most > MOST_LAYERS:
        worst = min(close, key=lambda one: one.distance)
        raise RefusedOrderError(
            f"{worst.first} and {worst.second} would come within {worst.distance:.1f} m of each other"
            f" {worst.time_s:.0f} s after its beginning, and {most} layers to keep all apart are too"
            " many: go there by another formation"
        )
    return [
        replace(one, layer=highest + LAYER_M * number)
        if (number := layers.get(one.vehicle, 0))
        else one
        for one in places
    ]
