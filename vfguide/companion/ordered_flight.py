"""What is flown by orders: slots and heights at every moment, the path, and where the flight ends."""

import math
from dataclasses import dataclass

import msgspec
from msgspec.structs import replace

from vfguide.companion.order_limits import LATEST_S
from vfguide.companion.plan import FlightPlan, KnownPath
from vfguide.companion.timing import SharedClock
from vfguide.formation.arrangement import MAIN_PATH, Arrangement, Manoeuvre, Point
from vfguide.formation.transition import nearest_on
from vfguide.guidance.formation import Slot
from vfguide.guidance.path import END_SHARE, Path, PathPoint
from vfguide.laws.leader import LeaderTask
from vfguide.paths.circle import Circle

JUMP_S = 2.0
"""A formation's clock that steps further is another one: the computer of its leader was started anew."""

AHEAD_S = 8.0
"""How near slots come is looked at for so long ahead."""

LAYERED_M = 8.0
"""Who is meant to be this much higher or lower flies in another layer ..."""

LAYER_CLEAR_M = 7.0
"""... and is out of the way while it is so much higher or lower."""

GONE_M = 1000.0
"""In place of the spacing to a vehicle that has no slot."""

LATE_START_S = 0.5
"""Who learns of an order so long after it began, as after a start in flight, has not seen where that was."""

BESIDE_M = 30.0
"""A leader that is further away from the circle does not fly it."""


class OtherSlot(msgspec.Struct, frozen=True, kw_only=True):
    """The slot of another vehicle, as keeping clear of it needs it."""

    slot: complex
    """Forward + j right of the leader, m."""
    rate: complex
    """How it moves in the formation, m/s."""
    spacing: float
    """How near it comes to one's own soon, level, m."""
    layered: bool
    """Whether it is far enough above or below for that not to count."""


@dataclass(slots=True)
class KnownOrder:
    """An order on its way: what it is, and what is known of it."""

    arrangement: Arrangement
    """What it asks for."""
    signed: bytes
    """As it came, to be repeated."""
    check: int
    """CRC-32 of its bytes: what it is told by from another of the same number."""
    confirmed: str = ""
    """The leader that has said that it is flown."""
    confirmed_s: float = math.inf
    """When this companion has, as the leader."""
    offset_s: float = math.nan
    """The formation's clock by which it is flown, less one's own, s; infinite once its motions are over."""

    @property
    def identity(self) -> tuple[int, int]:
        """(number, check): what copies of it, and answers to it, have in common."""
        return self.arrangement.number, self.check

    def begins(self, time_s: float) -> bool:
        """Whether its time (s on the formation's clock) has come, or is one of a clock that is no more."""
        ahead_s = self.arrangement.time_s - time_s
        return ahead_s <= 0.0 or ahead_s > LATEST_S


def leader_name(plan: FlightPlan) -> str:
    """Name of the vehicle that leads by the mission; empty where that has no companion."""
    if plan.leads:
        return plan.name
    return next((one.name for one in plan.others if one.leads), "")


class RouteEnd:
    """What one companion has seen of the end of the leader's path, where all are handed back.

    Each companion finds the end by itself, from the leader's place; who hears nobody carries the leader on
    along the route and finds the same. The end counts as known once the leader has flown a quarter of the
    circle there: a leg that only crosses that circle leaves it sooner, and so does who gathers near it.
    """

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self._path: Path | None = None
        self._begin: float | None = None

    def passed(self, path: Path, point: PathPoint[float], *, steered: bool) -> bool:
        """Whether the leader has come to the end of its path.

        Args:
            path: that it follows.
            point: of the path, where it is nearest to the leader.
            steered: whether its companion steers it. Without that no flight of the circle begins: it may
                loiter there before the start. One that has begun goes on, as the leader may be handed back
                a moment before the others.
        """
        if path is not self._path:
            self._path, self._begin = path, None
        circle = path.last_circle
        if circle is None:
            return False
        run = point.progress - circle
        flown = run >= 0.0 and abs(point.cross_track_error) <= BESIDE_M
        # A place that is not known is no place on the circle.
        if not flown:
            self._begin = None
            return False
        if self._begin is None:
            self._begin = run if steered else None
        elif run < self._begin:
            self._begin = run
        if self._begin is None or not math.isfinite(run):
            return False
        return run - self._begin >= END_SHARE * (path.length - circle)


class OrderedFlight:
    """Slots, heights and path as orders have made them, for one companion."""

    def __init__(self, plan: FlightPlan, clock: SharedClock) -> None:
        """Begin with the slots and the path of the mission.

        Args:
            plan: of this vehicle.
            clock: that the formation shares: orders are timed by it.
        """
        self._plan = plan
        self._clock = clock
        self._leader = leader_name(plan)
        self.order: KnownOrder | None = None
        """What is flown; None for the slots of the mission."""
        self.circle: Circle | None = None
        """Where the leader circles by a hold; None on the mission's path."""
        self.route: KnownPath | None = None
        """The path that an order has chosen, also during a hold; None before the first of them."""
        self.turn_radius = 0.0
        """Radius of the last hold's circle, m; 0 before the first. Onto that circle, and from it back to the
        path, a leader that is carried on turns no tighter."""
        self._settled: tuple[Arrangement, list[OtherSlot]] | None = None
        self._route_end = RouteEnd()
        self._ended: int | None = None
        self._left: int | None = None

    def adopt(self, plan: FlightPlan) -> None:
        """Go by another plan of the same vehicle from now on."""
        self._plan = plan

    def begin(self, order: KnownOrder) -> None:
        """Fly by an order from now on."""
        self.order = order
        if not self.has_left:
            self._left = None
        elif self._left is None:
            self._left = self.number
        self.circle = self.circle_of(order.arrangement)
        if self.circle is not None:
            self.turn_radius = self.circle.radius
        self.route = self._route_of(order.arrangement)

    @property
    def flown(self) -> Arrangement | None:
        """What is flown; None for the slots of the mission."""
        return None if self.order is None else self.order.arrangement

    @property
    def number(self) -> int:
        """Of the order that is flown; 0 before the first."""
        return 0 if self.order is None else self.order.arrangement.number

    @property
    def has_aborted(self) -> bool:
        """Whether an abort is what is flown."""
        return self.flown is not None and self.flown.flown is Manoeuvre.ABORT

    @property
    def called_off(self) -> int | None:
        """Number of the order with which everything has ended, 0 for none before; None while it goes on."""
        if self._ended is not None:
            return self._ended
        return self.number if self.has_aborted else None

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended because its route has."""
        return self._ended is not None

    @property
    def has_left(self) -> bool:
        """Whether this vehicle is to be left to its autopilot: it has no place, or all was called off."""
        if self.order is None or self.called_off is not None:
            return self.called_off is not None
        return not self._plan.leads and self.order.arrangement.place_of(self._plan.name) is None

    @property
    def loiters_by(self) -> int | None:
        """Number of the order by which this vehicle loiters; None while it is in the formation."""
        return self._left if self.called_off is None else self.called_off

    @property
    def path(self) -> str | None:
        """Name of the path that the leader follows; None in a hold, and once all was called off."""
        if self.circle is not None or self.called_off is not None:
            return None
        return self.chosen_path

    @property
    def chosen_path(self) -> str:
        """Name of the path that the leader follows, or goes back to after a hold."""
        return MAIN_PATH if self.flown is None else self.flown.path

    @property
    def ceiling(self) -> float:
        """Greatest height that the fence allows now, m above the origin; infinite without one."""
        return self._plan.ceiling_along(self.chosen_path)

    def watch_route(self, path: Path, point: PathPoint[float], *, steered: bool) -> bool:
        """Take where the leader is on its path, and say whether the flight has ended there just now.

        Args:
            path: that it follows.
            point: of the path, where it is nearest to the leader.
            steered: whether its companion steers it.
        """
        at_end = self.circle is None and self._route_end.passed(path, point, steered=steered)
        if not at_end or self.called_off is not None:
            return False
        self._ended = self.number
        return True

    def slot(self, vehicle: str, now: float) -> Slot | None:
        """The slot that an order has given to a follower, at a time (s of one's own clock), and its rates.

        None by the mission's own slots, and for a vehicle that has left.
        """
        order = self.order
        if order is None or order.arrangement.place_of(vehicle) is None:
            return None
        return order.arrangement.slot(vehicle, self.time_of(order, now))

    def height(self, vehicle: str, now: float) -> tuple[float, float] | None:
        """(height above the leader in m, its rate in m/s) of a slot that an order has given; see `slot`."""
        order = self.order
        if order is None or order.arrangement.place_of(vehicle) is None:
            return None
        return order.arrangement.height(vehicle, self.time_of(order, now))

    def point(self, vehicle: str, now: float) -> Point | None:
        """Where a slot is that was ordered; None by the mission's own, and for a vehicle that has left."""
        if self.flown is None:
            return None
        if vehicle == self._leader:
            return Point(0.0, 0.0)
        slot, height = self.slot(vehicle, now), self.height(vehicle, now)
        if slot is None or height is None:
            return None
        return Point(slot.forward, slot.right, height[0])

    def own_slot(self, now: float) -> Point | None:
        """Where the own slot is at a time (s of one's own clock); None for a vehicle that has left."""
        if self.order is not None:
            return self.point(self._plan.name, now)
        if isinstance(self._plan.task, LeaderTask):
            return None
        slot = self._plan.task.slot
        return Point(slot.forward, slot.right, self._plan.up)

    def others(self, now: float) -> list[OtherSlot] | None:
        """Slots of all other vehicles, in the plan's order; None while nothing was ordered."""
        if self.order is None:
            return None
        flown = self.order.arrangement
        if self._settled is not None and self._settled[0] is flown:
            return self._settled[1]
        own, own_later = (self.point(self._plan.name, time_s) for time_s in (now, now + AHEAD_S))
        found = []
        for other in self._plan.others:
            here, later = (self.point(other.name, time_s) for time_s in (now, now + AHEAD_S))
            moving = self.slot(other.name, now)
            rate = 0j if moving is None else complex(moving.forward_rate, moving.right_rate)
            if here is None or later is None or own is None or own_later is None:
                place = 0j if here is None else complex(here.forward, here.right)
                found.append(OtherSlot(slot=place, rate=rate, spacing=GONE_M, layered=False))
                continue
            before, after = here.minus(own), later.minus(own_later)
            _, spacing = nearest_on(
                Point(before.forward, before.right), Point(after.forward, after.right)
            )
            found.append(
                OtherSlot(
                    slot=complex(here.forward, here.right),
                    rate=rate,
                    spacing=max(spacing, 1.0),
                    layered=abs(before.up) >= LAYERED_M,
                )
            )
        if self.time_of(self.order, now) > flown.time_s + flown.duration_s:
            self._settled = flown, found
        return found

    def is_late(self, now: float) -> bool:
        """Whether the order that is flown began long before a time (s of one's own clock)."""
        order = self.order
        return (
            order is not None and self.time_of(order, now) > order.arrangement.time_s + LATE_START_S
        )

    def left(self, now: float) -> float:
        """How long the slots still move by what is flown, s; not positive once they have arrived."""
        if self.order is None:
            return -math.inf
        flown = self.order.arrangement
        return flown.time_s + flown.duration_s - self.time_of(self.order, now)

    def time_of(self, order: KnownOrder, now: float) -> float:
        """A time on the clock by which an order is flown, s: slots do not jump where the clock does."""
        time_s, expected_s = self.shared_time(now), now + order.offset_s
        if math.isnan(expected_s) or abs(time_s - expected_s) <= JUMP_S:
            order.offset_s = time_s - now if math.isfinite(time_s) else order.offset_s
            return time_s
        return expected_s

    def shared_time(self, now: float) -> float:
        """A time on the formation's clock, s; where it is not known, after all motions."""
        time_s = self._clock.from_own(now)
        return time_s if math.isfinite(time_s) else math.inf

    def circle_of(self, order: Arrangement) -> Circle | None:
        """The circle of a hold, as a path."""
        found = order.circle
        if found is None:
            return None
        north, east = self._plan.frame.to_local(found.latitude_deg, found.longitude_deg)
        return Circle(
            north=north,
            east=east,
            radius=found.radius_m,
            direction=1 if found.clockwise else -1,
        )

    def _route_of(self, order: Arrangement) -> KnownPath | None:
        """The path that an order has chosen; its field leads onto it by turns of the order's radius."""
        known, radius = self._plan.paths.get(order.path), order.turn_radius_m
        if known is None or radius <= 0.0:
            return None
        gains = replace(known.gains, gain=min(known.gains.gain, 1.0 / radius))
        return replace(known, gains=gains, least_radius=radius)
