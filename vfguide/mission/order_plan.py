"""Orders of a mission: the first formation, speed limits of slots and the timetable."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from vfguide.formation.arrangement import MAIN_PATH, Arrangement, HoldCircle, Manoeuvre, Point
from vfguide.formation.orders import Formation, Order, arrangement_of
from vfguide.formation.transition import MotionLimits, RefusedOrderError, Transition
from vfguide.frames import LocalFrame
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.formation import Slot as GuidanceSlot
from vfguide.guidance.height import (
    SHARE,
    ClimbLimits,
    HeightMotion,
    HeightTarget,
    changed_height,
    stopping_way,
)
from vfguide.guidance.path import PathPoint
from vfguide.mission.finding import Finding
from vfguide.mission.flight_limits import (
    Conditions,
    Track,
    climb_limits,
    climbs_beyond_limits,
    conditions_of,
    hold_tracks,
    leader_in_wind,
    slots_beyond_centre,
    slots_out_of_airspeed,
    tracks,
    tracks_beyond_the_fence,
    turns_beyond_bank,
)
from vfguide.mission.flight_path import path_of
from vfguide.mission.model import Follower, Mission, Slot
from vfguide.mission.place import least_radius

RESERVE_M_S = 1.5
"""Airspeed range that the law keeps in reserve while the slot moves."""

SLOWEST_M_S, FASTEST_M_S = 0.5, 10.0
"""Bounds of the forward and backward speed of slots."""

GIVEN_WAY_M_S = 3.5
"""Minimum bound of slot speeds where the leader gives way by changing its airspeed."""

ASIDE_SHARE = 0.35
"""Sideways speed of slots as a fraction of cruise: a course 20 degrees off the leader's."""

ACCELERATION_SHARE, GREATEST_ACCELERATION = 0.4, 1.5
"""Acceleration of slots as a fraction of the aircraft's, and its maximum, m/s²."""

GREATEST_CLIMB_M_S = 2.0
"""Maximum climb and sink rate of slots."""

STEEPEST = 0.5
"""Usable fraction of the smallest lateral acceleration of the aircraft in a hold."""

RADIUS_S, WIDTHS = 10.0, 5.0
"""Minimum radius of a hold, in seconds of flight and in half-widths of the formation."""


LEAST_TURN_M = 20.0
"""Minimum turn radius onto another path, however slow the formation is."""

Check = Callable[[Mission, Conditions], Iterator[Finding]]

OF_SLOTS: tuple[Check, ...] = (slots_beyond_centre, slots_out_of_airspeed)
"""Checks of slots along a path that is already being flown."""

OF_PATHS: tuple[Check, ...] = (
    leader_in_wind,
    slots_beyond_centre,
    turns_beyond_bank,
    slots_out_of_airspeed,
    climbs_beyond_limits,
)
"""Checks of a formation along another path."""


@dataclass(frozen=True, slots=True)
class LeaderPlace:
    """Position and motion of a leader."""

    north: float
    """North of the mission's origin, m."""
    east: float
    """East of the mission's origin, m."""
    course: float
    """Course, rad."""
    height: float = math.nan
    """Height above the mission's origin, m; NaN if unknown."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up."""


def formation_of_mission(mission: Mission) -> Formation:
    """Return the formation that a mission begins with."""
    home = {one.vehicle: one.slot.point for one in mission.followers}
    may_lead = (mission.leader.vehicle, *mission.deputies) if mission.deputies else ()
    return Formation(
        leader=mission.leader.vehicle,
        home=home,
        slots=home,
        paths=mission.path_checks,
        may_lead=may_lead,
    )


def on_path(mission: Mission, name: str) -> Mission:
    """Return the mission as if it began on another of its paths; unchanged if it has none of this name."""
    shapes = mission.paths_by_name
    if name == MAIN_PATH or name not in shapes:
        return mission
    return mission.model_copy(update={"path": shapes[name], "paths": {**shapes}})


def resolve(
    mission: Mission,
    order: Order,
    formation: Formation,
    *,
    number: int,
    time_s: float,
    leader: LeaderPlace | None = None,
) -> tuple[Arrangement, Transition]:
    """Return the arrangement that results from an order, given the mission's vehicles, path and wind.

    The manoeuvre begins at `time_s` on the formation's clock, with the leader at the position `leader`, by
    default the planned one.

    Raises:
        RefusedOrderError: the order cannot be carried out; one sentence says why.
    """
    if mission.leader.is_foreign and (
        order.action in {"hold", "resume"} or order.path or order.lead
    ):
        raise RefusedOrderError(
            "the leader has no companion: it flies no circle or path that is ordered, and nobody succeeds it"
        )
    leader = leader or planned_place(on_path(mission, formation.path), time_s)
    mission = on_path(mission, order.path or formation.path)
    circle = None
    if order.action == "hold":
        circle = circle_at(mission, formation, leader)
    conditions = conditions_of(mission.path, mission.wind)
    radius = 0.0

    def attempt(limits: MotionLimits) -> tuple[Arrangement, Transition]:
        return arrangement_of(
            order,
            formation,
            limits,
            number=number,
            time_s=time_s,
            circle=circle,
            turn_radius_m=radius,
        )

    slow = MotionLimits(forward=2.0, back=2.0, aside=2.0, acceleration=0.5)
    found, way = attempt(slow)
    if found.flown is Manoeuvre.ABORT:
        return found, way
    after = {place.vehicle: place.end for place in found.places}
    ordered = with_slots(mission, after)
    checks = OF_SLOTS if order.path is None else OF_PATHS
    findings = [one for check in checks for one in check(ordered, conditions)]
    findings += _outside(ordered, found.circle, hold_height(mission, leader))
    for finding in findings:
        if finding.severity == "error":
            raise RefusedOrderError(
                f"{_whose(finding, ordered)}{finding.message}; {finding.remedy}"
            )
    if order.path is not None:
        radius = max(least_radius(ordered.model_dump()), LEAST_TURN_M)
    slots = {name: [point] for name, point in after.items()}
    for place in found.places:
        slots[place.vehicle].append(place.begin)
    share = 1.0 if order.path is None else 1.0 - SHARE
    return attempt(motion_limits(mission, slots, conditions, climb_share=share))


def motion_limits(
    mission: Mission,
    slots: Mapping[str, Iterable[Point]],
    conditions: Conditions,
    *,
    climb_share: float = 1.0,
) -> MotionLimits:
    """Return how fast slots may move, from the margins of each aircraft in every wind and turn.

    `slots` holds the slots of each follower before and after. `climb_share` is the usable fraction of the
    vehicles' climb and sink limits; the path may need the rest.
    """
    cruise = mission.leader.airspeed_m_s
    forward = back = FASTEST_M_S
    acceleration, climb = GREATEST_ACCELERATION, GREATEST_CLIMB_M_S
    for name, points in slots.items():
        vehicle = mission.vehicles[name]
        lowest, highest = vehicle.airspeed_range_m_s
        sink, rise = vehicle.climb_range_m_s
        climb = min(climb, climb_share * rise, -climb_share * sink)
        acceleration = min(acceleration, ACCELERATION_SHARE * vehicle.max_acceleration_m_s2)
        for point in points:
            needed = conditions.slot_airspeed(
                cruise, GuidanceSlot(forward=point.forward, right=point.right)
            )
            forward = min(forward, highest - RESERVE_M_S - float(needed.max()))
            back = min(back, float(needed.min()) - RESERVE_M_S - lowest)
    slowest = GIVEN_WAY_M_S if mission.controller.give_way else SLOWEST_M_S
    return MotionLimits(
        forward=max(forward, slowest),
        back=max(back, slowest),
        aside=ASIDE_SHARE * cruise,
        acceleration=acceleration,
        climb=climb,
    )


def planned_place(mission: Mission, time_s: float, *, progress: float = 0.0) -> LeaderPlace:
    """Return the leader's approximate position `time_s` after `progress` (m) on its path, at its airspeed."""
    airspeed = mission.leader.airspeed_m_s
    place = path_of(mission.path).at(progress + airspeed * max(time_s, 0.0))
    return LeaderPlace(
        float(place.north),
        float(place.east),
        float(place.course),
        height=mission.height_above_origin_m + float(place.height),
        climb_rate=airspeed * float(place.slope),
    )


def point_beside(mission: Mission, leader: LeaderPlace) -> PathPoint[float]:
    """Return the path's point closest to a leader; the leader's height selects the turn or branch."""
    above = leader.height - mission.height_above_origin_m
    return path_of(mission.path).nearest_in_space(leader.north, leader.east, leader.course, above)


def height_of(mission: Mission, leader: LeaderPlace) -> float:
    """Return a leader's height above the origin, m; that of its path if unknown."""
    if math.isfinite(leader.height):
        return leader.height
    return mission.height_above_origin_m + float(point_beside(mission, leader).height)


def hold_height(mission: Mission, leader: LeaderPlace) -> float:
    """Return a leader's height above the origin in a hold, m: where its climb ends."""
    return height_of(mission, leader) + stopping_way(leader.climb_rate)


def circle_at(mission: Mission, formation: Formation, leader: LeaderPlace) -> HoldCircle:
    """Return a circle to the right that begins at the leader and is wide enough for every slot."""
    widest = max((abs(point.right) for point in formation.slots.values()), default=0.0)
    speed = mission.leader.airspeed_m_s
    names = [mission.leader.vehicle, *formation.slots]
    bank = math.radians(min(mission.vehicles[name].max_bank_deg for name in names))
    tightest = speed**2 / (STEEPEST * GRAVITY * math.tan(bank))
    radius = max(RADIUS_S * speed, WIDTHS * widest, tightest)
    origin = mission.origin
    frame = LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)
    latitude, longitude = frame.to_geodetic(
        leader.north - radius * math.sin(leader.course),
        leader.east + radius * math.cos(leader.course),
    )
    return HoldCircle(latitude_deg=latitude, longitude_deg=longitude, radius_m=radius)


def with_slots(mission: Mission, slots: Mapping[str, Point]) -> Mission:
    """Return a mission with only these followers, in these slots."""
    followers = tuple(
        Follower(
            vehicle=name, slot=Slot(forward_m=point.forward, right_m=point.right, up_m=point.up)
        )
        for name, point in slots.items()
    )
    return mission.model_copy(update={"followers": followers})


class _LeaderPlan:
    """Approximate leader of a timetable: along its path at its airspeed and planned height."""

    def __init__(self, mission: Mission) -> None:
        """Start at the beginning of the mission's path."""
        self._mission = self._flown = mission
        self._limits: ClimbLimits = climb_limits(mission)
        # The leader was at this progress (m) along its path at this time (s).
        self._progress = self._since_s = 0.0
        self._held: LeaderPlace | None = None
        self._change: HeightMotion | None = None

    def at(self, time_s: float) -> LeaderPlace:
        """Return the leader's position at a time, s."""
        place = self._held or self._beside_path(time_s)
        if self._held is not None or self._change is None:
            return place
        motion = self._change
        for step in range(math.ceil(time_s - motion.time_s) - 1, -1, -1):
            target = self._beside_path(time_s - step)
            planned = HeightTarget(
                height=target.height, climb_rate=target.climb_rate, ahead=target.height
            )
            motion = changed_height(motion, planned, time_s - step, self._limits)
            if motion.is_at(planned):
                self._change = None
                return place
        return replace(place, height=motion.height, climb_rate=motion.climb_rate)

    def hold(self, leader: LeaderPlace) -> None:
        """Stay at the leader's position: a hold ends about where it begins."""
        height = hold_height(self._mission, leader)
        self._held = replace(leader, height=height, climb_rate=0.0)

    def go_to(self, path: str, leader: LeaderPlace, time_s: float) -> None:
        """Leave a position at a time (s) for a path."""
        self._flown, self._held = on_path(self._mission, path), None
        point = point_beside(self._flown, leader)
        self._progress = float(point.progress)
        away_s = abs(point.cross_track_error) / self._mission.leader.airspeed_m_s
        self._since_s = time_s + away_s
        self._change = HeightMotion(
            time_s=time_s, height=leader.height, climb_rate=leader.climb_rate
        )

    def _beside_path(self, time_s: float) -> LeaderPlace:
        return planned_place(self._flown, time_s - self._since_s, progress=self._progress)


def timetable(mission: Mission) -> tuple[tuple[Arrangement, Transition], ...]:
    """Return the arrangements of a mission's orders, each starting from the one before.

    Raises:
        RefusedOrderError: an order cannot be carried out; one sentence says which and why.
    """
    formation = formation_of_mission(mission)
    found = []
    plan = _LeaderPlan(mission)
    for number, timed in enumerate(mission.orders, 1):
        leader = plan.at(timed.at_s)
        try:
            arrangement, way = resolve(
                mission, timed.order, formation, number=number, time_s=timed.at_s, leader=leader
            )
        except RefusedOrderError as error:
            raise RefusedOrderError(f"orders[{number - 1}], at {timed.at_s:g} s: {error}") from None
        found.append((arrangement, way))
        if arrangement.flown is Manoeuvre.HOLD:
            plan.hold(leader)
        elif timed.path is not None or timed.action == "resume":
            plan.go_to(arrangement.path, leader, timed.at_s)
        formation = formation.after(arrangement)
    for (before, _), (after, _) in pairwise(found):
        late_s = before.time_s + before.duration_s - after.time_s
        if late_s > 0.0:
            raise RefusedOrderError(
                f"orders[{after.number - 1}], at {after.time_s:g} s: the one before takes"
                f" {before.duration_s:.0f} s, give it {math.ceil(late_s)} s more"
            )
    return tuple(found)


def _whose(finding: Finding, mission: Mission) -> str:
    """Return the vehicle name as a prefix for a finding about a slot that does not name it."""
    match finding.location:
        case ("followers", int(index), *_):
            name = mission.followers[index].vehicle
            return "" if f"'{name}'" in finding.message else f"{name}: "
        case _:
            return ""


def _outside(mission: Mission, circle: HoldCircle | None, height: float) -> Iterator[Finding]:
    """Find vehicles at the fence: along the path, or on a hold's circle at a height (m)."""

    def flown(ordered: Mission) -> Iterable[Track]:
        if circle is None:
            return tracks(ordered)
        origin = ordered.origin
        frame = LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)
        north, east = frame.to_local(circle.latitude_deg, circle.longitude_deg)
        return hold_tracks(ordered, north, east, circle.radius_m, height)

    return tracks_beyond_the_fence(mission, flown)
