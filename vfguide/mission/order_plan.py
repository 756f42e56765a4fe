"""What a mission says of orders: its first formation, how fast slots may move, its time table."""

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
"""What an aircraft keeps of its airspeed range for its law, while its slot moves."""

SLOWEST_M_S, FASTEST_M_S = 0.5, 10.0
"""Bounds of how fast slots move ahead and back."""

GIVEN_WAY_M_S = 3.5
"""So fast they may always move where the leader gives way: it flies faster or slower for who lacks it."""

ASIDE_SHARE = 0.35
"""Speed at which slots move aside, in parts of the cruise: a course 20 degrees off the leader's."""

ACCELERATION_SHARE, GREATEST_ACCELERATION = 0.4, 1.5
"""Acceleration of slots, in parts of what the aircraft have, and the greatest, m/s²."""

GREATEST_CLIMB_M_S = 2.0
"""Slots climb and sink no faster than this."""

STEEPEST = 0.5
"""Share of the lateral acceleration of the aircraft that has least, for a hold."""

RADIUS_S, WIDTHS = 10.0, 5.0
"""Radius of a hold: so many seconds of flight and half-widths of the formation at least."""


LEAST_TURN_M = 20.0
"""Turns onto another path are no tighter, however slow the formation is."""

Check = Callable[[Mission, Conditions], Iterator[Finding]]

OF_SLOTS: tuple[Check, ...] = (slots_beyond_centre, slots_out_of_airspeed)
"""What is looked at of slots along a path that is flown already."""

OF_PATHS: tuple[Check, ...] = (
    leader_in_wind,
    slots_beyond_centre,
    turns_beyond_bank,
    slots_out_of_airspeed,
    climbs_beyond_limits,
)
"""What is looked at of a formation along another path."""


@dataclass(frozen=True, slots=True)
class LeaderPlace:
    """Where a leader is, and where it flies to."""

    north: float
    """m from the mission's origin."""
    east: float
    """m from the mission's origin."""
    course: float
    """rad."""
    height: float = math.nan
    """m above the mission's origin; NaN where it is not known."""
    climb_rate: float = 0.0
    """m/s, positive up."""


def formation_of_mission(mission: Mission) -> Formation:
    """The formation that a mission begins with."""
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
    """A mission as if it began on another of its paths; itself where it has none of this name."""
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
    """The arrangement that an order comes to in a mission, with its vehicles, its path and its wind.

    Args:
        mission: the mission.
        order: what is wanted.
        formation: as it is.
        number: of the arrangement.
        time_s: when it begins, s on the formation's clock.
        leader: where it will be then; as planned at that time if absent.

    Raises:
        RefusedOrderError: it cannot be carried out; one sentence says why.
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
    """How fast slots may move: by what each aircraft has beyond what its slots need, in every wind and turn.

    Args:
        mission: the mission.
        slots: those of each follower, before and after.
        conditions: every course and turn of the path in every wind.
        climb_share: of the vehicles' climb and sink limits; the rest may be needed for the path's height.
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
    """Where the leader of a rehearsal is by then, about: along its path at its airspeed.

    Args:
        mission: the mission.
        time_s: since it was at a place of its path, s.
        progress: of that place, m.
    """
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
    """The mission's path beside a leader; its height tells which turn or branch it is on."""
    above = leader.height - mission.height_above_origin_m
    return path_of(mission.path).nearest_in_space(leader.north, leader.east, leader.course, above)


def height_of(mission: Mission, leader: LeaderPlace) -> float:
    """Height of a leader above the origin, m; that of the path beside it where its own is not known."""
    if math.isfinite(leader.height):
        return leader.height
    return mission.height_above_origin_m + float(point_beside(mission, leader).height)


def hold_height(mission: Mission, leader: LeaderPlace) -> float:
    """Height of a leader above the origin in a hold, m: where its climb has come to rest."""
    return height_of(mission, leader) + stopping_way(leader.climb_rate)


def circle_at(mission: Mission, formation: Formation, leader: LeaderPlace) -> HoldCircle:
    """Where to hold: a circle to the right that begins where the leader is, wide enough for every slot."""
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
    """A mission with these followers in these slots, and no others in view."""
    followers = tuple(
        Follower(
            vehicle=name,
            slot=Slot(forward_m=point.forward, right_m=point.right, up_m=point.up),
        )
        for name, point in slots.items()
    )
    return mission.model_copy(update={"followers": followers})


class _LeaderPlan:
    """Where the leader of a time table is, about: along its path at its airspeed, at its planned height."""

    def __init__(self, mission: Mission) -> None:
        """Begin at the beginning of the mission's path."""
        self._mission = self._flown = mission
        self._limits: ClimbLimits = climb_limits(mission)
        # On its path the leader is at this progress (m) at this time (s).
        self._progress = self._since_s = 0.0
        self._held: LeaderPlace | None = None
        self._change: HeightMotion | None = None

    def at(self, time_s: float) -> LeaderPlace:
        """Where it is at a time, s."""
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
        return replace(place, height=motion.height, climb_rate=motion.climb_rate)

    def hold(self, leader: LeaderPlace) -> None:
        """Stay where it is: a hold ends about where it has begun."""
        height = hold_height(self._mission, leader)
        self._held = replace(leader, height=height, climb_rate=0.0)

    def go_to(self, path: str, leader: LeaderPlace, time_s: float) -> None:
        """Leave a place at a time (s) for a path."""
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
    """The arrangements of a mission's orders, each from where the one before leads to.

    Raises:
        RefusedOrderError: one cannot be carried out; one sentence says which and why.
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
                f" {before.duration_s:.0f} s, give it {late_s:.0f} s more"
            )
    return tuple(found)


def _whose(finding: Finding, mission: Mission) -> str:
    """Whose slot a finding is about that does not name its vehicle, for the beginning of a sentence."""
    match finding.location:
        case ("followers", int(index), *_):
            name = mission.followers[index].vehicle
            return "" if f"'{name}'" in finding.message else f"{name}: "
        case _:
            return ""


def _outside(mission: Mission, circle: HoldCircle | None, height: float) -> Iterator[Finding]:
    """Vehicles at the fence: along the path, or on the circle of a hold at a height (m)."""

    def flown(ordered: Mission) -> Iterable[Track]:
        if circle is None:
            return tracks(ordered)
        origin = ordered.origin
        frame = LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)
        north, east = frame.to_local(circle.latitude_deg, circle.longitude_deg)
        return hold_tracks(ordered, north, east, circle.radius_m, height)

    return tracks_beyond_the_fence(mission, flown)
