"""Slots, heights, path and end of the flight as shaped by orders, at every moment."""

import math
from dataclasses import dataclass

import msgspec
from msgspec.structs import replace

from vfguide.companion.belief import radius_limit
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
"""Step of the formation's clock, s, beyond which it is another clock: the leader's computer has restarted."""

AHEAD_S = 8.0
"""Look-ahead for the spacing of slots, s."""

LAYERED_M = 8.0
"""Planned vertical separation from which two vehicles fly in separate layers, m."""

LAYER_CLEAR_M = 7.0
"""Actual vertical separation that keeps a vehicle of another layer out of the way, m."""

GONE_M = 1000.0
"""Spacing assumed to a vehicle without a slot, m."""

LATE_START_S = 0.5
"""Delay after an order's beginning, s, beyond which it was missed, as by a start in flight."""

BESIDE_M = 30.0
"""Cross-track error beyond which a leader does not fly the final circle, m."""


class OtherSlot(msgspec.Struct, frozen=True, kw_only=True):
    """Slot of another vehicle as needed for keeping clear of it."""

    slot: complex
    """Place as forward + j right of the leader, m."""
    rate: complex
    """Velocity in the formation's frame, m/s."""
    spacing: float
    """Smallest horizontal distance to the own slot within the look-ahead, m."""
    layered: bool
    """Whether vertical separation makes that distance irrelevant."""


@dataclass(slots=True)
class KnownOrder:
    """Order on its way, with its state of confirmation."""

    arrangement: Arrangement
    """Content of the order."""
    signed: bytes
    """Order as received, for repetition."""
    check: int
    """CRC-32 of its bytes, which distinguishes orders of the same number."""
    confirmed: str = ""
    """Name of the leader that has confirmed it; empty before."""
    confirmed_s: float = math.inf
    """Own time at which this companion confirmed it as the leader, s."""
    offset_s: float = math.nan
    """Formation's clock by which it is flown minus own clock, s; infinite once its motions are over."""

    @property
    def identity(self) -> tuple[int, int]:
        """Number and check that all copies of an order, and replies to it, share."""
        return self.arrangement.number, self.check

    def begins(self, time_s: float) -> bool:
        """Check whether its time has come at a shared time, s, or is of a clock that no longer exists."""
        ahead_s = self.arrangement.time_s - time_s
        return ahead_s <= 0.0 or ahead_s > LATEST_S


def leader_name(plan: FlightPlan) -> str:
    """Return the name of the mission's leader; empty if it has no companion."""
    if plan.leads:
        return plan.name
    return next((one.name for one in plan.others if one.leads), "")


class RouteEnd:
    """Detector of the end of the leader's path, where all vehicles are handed back.

    Each companion finds the end by itself from the leader's place; one that hears nobody predicts the leader
    along the route. The end counts once the leader has flown a quarter of the final circle. A leg that only
    crosses the circle, or a vehicle that gathers near it, leaves it sooner.
    """

    def __init__(self) -> None:
        self._path: Path | None = None
        self._begin: float | None = None

    def passed(self, path: Path, point: PathPoint[float], *, steered: bool) -> bool:
        """Check whether a leader at this point of its path has come to the path's end.

        Flight of the circle only begins while the leader's companion steers it, as it may loiter there before
        the start. It goes on without, as the leader may be handed back a moment before the others.
        """
        if path is not self._path:
            self._path, self._begin = path, None
        circle = path.last_circle
        if circle is None:
            return False
        run = point.progress - circle
        flown = run >= 0.0 and abs(point.cross_track_error) <= BESIDE_M
        # An unknown place is not on the circle.
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
    """Slots, heights and path as orders have shaped them, for one companion."""

    def __init__(self, plan: FlightPlan, clock: SharedClock) -> None:
        self._plan = plan
        self._clock = clock
        self._leader = leader_name(plan)
        self.order: KnownOrder | None = None
        """Order being flown; None for the slots of the mission."""
        self.circle: Circle | None = None
        """Circle of the leader in a hold; None on a path of the mission."""
        self.route: KnownPath | None = None
        """Path chosen by an order, also during a hold; None before the first such order."""
        self.turn_radius = 0.0
        """Radius of the last hold's circle, m; 0 before the first. A predicted leader turns no tighter onto
        that circle, and from it back to the path."""
        self._others: tuple[Arrangement, float, list[OtherSlot]] | None = None
        self._route_end = RouteEnd()
        self._ended: int | None = None
        self._left: int | None = None

    def adopt(self, plan: FlightPlan) -> None:
        """Use another plan of the same vehicle from now on."""
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
        """Arrangement being flown; None for the slots of the mission."""
        return None if self.order is None else self.order.arrangement

    @property
    def number(self) -> int:
        """Number of the order being flown; 0 before the first."""
        return 0 if self.order is None else self.order.arrangement.number

    @property
    def has_aborted(self) -> bool:
        """Whether the order being flown is an abort."""
        return self.flown is not None and self.flown.flown is Manoeuvre.ABORT

    @property
    def called_off(self) -> int | None:
        """Number of the order with which everything ended, 0 for none; None while the flight goes on."""
        if self._ended is not None:
            return self._ended
        return self.number if self.has_aborted else None

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended at the end of its route."""
        return self._ended is not None

    @property
    def has_left(self) -> bool:
        """Whether this vehicle is left to its autopilot: it has no slot, or everything was called off."""
        if self.order is None or self.called_off is not None:
            return self.called_off is not None
        return not self._plan.leads and self.order.arrangement.place_of(self._plan.name) is None

    @property
    def loiters_by(self) -> int | None:
        """Number of the order by which this vehicle loiters; None in the formation."""
        return self._left if self.called_off is None else self.called_off

    @property
    def path(self) -> str | None:
        """Name of the leader's path; None in a hold, and once everything was called off."""
        if self.circle is not None or self.called_off is not None:
            return None
        return self.chosen_path

    @property
    def chosen_path(self) -> str:
        """Name of the leader's path, or of the one that it returns to after a hold."""
        return MAIN_PATH if self.flown is None else self.flown.path

    @property
    def ceiling(self) -> float:
        """Maximum height that the fence allows now, m above the origin; infinite without a fence."""
        return self._plan.ceiling_along(self.chosen_path)

    def watch_route(self, path: Path, point: PathPoint[float], *, steered: bool) -> bool:
        """Check whether the flight ends now; for the arguments see `RouteEnd.passed`."""
        at_end = self.circle is None and self._route_end.passed(path, point, steered=steered)
        if not at_end or self.called_off is not None:
            return False
        self._ended = self.number
        return True

    def slot(self, vehicle: str, now: float) -> Slot | None:
        """Return a follower's ordered slot and its rates at an own time, s.

        None while the mission's own slots are flown, and for a vehicle that has left.
        """
        order = self.order
        if order is None or order.arrangement.place_of(vehicle) is None:
            return None
        return order.arrangement.slot(vehicle, self.time_of(order, now))

    def height(self, vehicle: str, now: float) -> tuple[float, float] | None:
        """Return (height above the leader in m, rate in m/s) of an ordered slot; None as for `slot`."""
        order = self.order
        if order is None or order.arrangement.place_of(vehicle) is None:
            return None
        return order.arrangement.height(vehicle, self.time_of(order, now))

    def point(self, vehicle: str, now: float) -> Point | None:
        """Return the place of an ordered slot at an own time, s; None as for `slot`."""
        if self.flown is None:
            return None
        if vehicle == self._leader:
            return Point(0.0, 0.0)
        slot, height = self.slot(vehicle, now), self.height(vehicle, now)
        if slot is None or height is None:
            return None
        return Point(slot.forward, slot.right, height[0])

    def own_slot(self, now: float) -> Point | None:
        """Return the place of the own slot at an own time, s; None for one that has left or leads."""
        if self.order is not None:
            return self.point(self._plan.name, now)
        if isinstance(self._plan.task, LeaderTask):
            return None
        slot = self._plan.task.slot
        return Point(slot.forward, slot.right, self._plan.up)

    def others(self, now: float) -> list[OtherSlot] | None:
        """Return the slots of all other vehicles in the plan's order; None before the first order."""
        if self.order is None:
            return None
        flown = self.order.arrangement
        if (known := self._others) and known[0] is flown and known[1] in {now, math.inf}:
            return known[2]
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
        rests = self.time_of(self.order, now) > flown.time_s + flown.duration_s
        self._others = flown, math.inf if rests else now, found
        return found

    def most_m(self, now: float) -> float:
        """Return the greatest position radius to fly by at an own time, s, of oneself or the leader, m."""
        slots = self.others(now)
        if slots is None:
            spacings = [one.spacing for one in self._plan.others]
        else:
            spacings = [one.spacing for one in slots if not one.layered]
        return radius_limit(min(spacings, default=math.inf))

    def is_late(self, now: float) -> bool:
        """Check whether the order being flown began long before an own time, s."""
        order = self.order
        return (
            order is not None and self.time_of(order, now) > order.arrangement.time_s + LATE_START_S
        )

    def left(self, now: float) -> float:
        """Return for how long slots still move by the order being flown, s; not positive at rest."""
        if self.order is None:
            return -math.inf
        flown = self.order.arrangement
        return flown.time_s + flown.duration_s - self.time_of(self.order, now)

    def time_of(self, order: KnownOrder, now: float) -> float:
        """Return a time on an order's clock, s, which does not jump with the formation's clock."""
        time_s, expected_s = self.shared_time(now), now + order.offset_s
        if math.isnan(expected_s) or abs(time_s - expected_s) <= JUMP_S:
            order.offset_s = time_s - now if math.isfinite(time_s) else order.offset_s
            return time_s
        return expected_s

    def shared_time(self, now: float) -> float:
        """Return a time on the formation's clock, s; infinite, as after all motions, while not known."""
        time_s = self._clock.from_own(now)
        return time_s if math.isfinite(time_s) else math.inf

    def circle_of(self, order: Arrangement) -> Circle | None:
        """Return the circle of a hold as a path; None for any other order."""
        found = order.circle
        if found is None:
            return None
        north, east = self._plan.frame.to_local(found.latitude_deg, found.longitude_deg)
        return Circle(
            north=north, east=east, radius=found.radius_m, direction=1 if found.clockwise else -1
        )

    def _route_of(self, order: Arrangement) -> KnownPath | None:
        """Return the path that an order has chosen, joined by turns of the order's radius."""
        known, radius = self._plan.paths.get(order.path), order.turn_radius_m
        if known is None or radius <= 0.0:
            return None
        gains = replace(known.gains, gain=min(known.gains.gain, 1.0 / radius))
        return replace(known, gains=gains, least_radius=radius)
