"""Rehearse an order in virtual time before it is given, for least separation and settling time."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from vfguide.elementwise import BoolArray
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import Arrangement
from vfguide.formation.orders import Formation
from vfguide.formation.transition import RefusedOrderError
from vfguide.guidance.airframe import resolve
from vfguide.guidance.height import change_duration
from vfguide.lab.rehearsal.aircraft import Aircraft, aircraft_of, mail_of, step_all
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.figures import pair_separations, settling_time, slot_error
from vfguide.lab.studies.flown import beyond_when_flown
from vfguide.link.memory import Mail
from vfguide.mission.flight_limits import climb_limits
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import (
    LeaderPlace,
    height_of,
    on_path,
    planned_place,
    point_beside,
    with_slots,
)
from vfguide.mission.rehearsal import FollowerStart, LeaderStart, Start
from vfguide.record.flight import FlightRecord

BEGINS_S = 8.0
"""Start of the order in the rehearsal, s: by then all vehicles are in their slots."""

AFTER_S = 15.0
"""Flight time after the slots have come to rest, s."""

BEHIND_M = 150.0
"""Assumed distance of a joining vehicle behind its slot, where its position is not known, m."""

CLOSING_M_S = 5.0
"""Assumed least closing speed of a joining vehicle, m/s; 45 s are added to the time that results."""

FARTHEST_M = 20e3
"""Greatest distance of a joining vehicle from the leader, m; from farther away it takes half an hour."""

LONGEST_WAY_S = 180.0
"""Longest watched way onto another path, or back into the formation, s."""

ARRIVED_M = 1.0
"""Distance from its slot within which a vehicle has arrived, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Result of an order's rehearsal; times count from the order's start."""

    least_m: float
    """Least distance of two vehicles, m."""
    pair: tuple[str, str]
    """Names of these two vehicles; empty without a pair."""
    least_s: float
    settled_s: float | None
    """Time from which all vehicles stay within `ARRIVED_M` of their slots, s; None where they do not."""
    moved_s: float
    """Duration of the slots' movement, s."""


def rehearsed(
    mission: Mission,
    formation: Formation,
    arrangement: Arrangement,
    *,
    leader: LeaderPlace | None = None,
    joining: Mapping[str, LeaderPlace] | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Prediction:
    """Fly an arrangement in virtual time from the present formation; its time and number do not count.

    Without a position the leader begins at the mission's start. Joining vehicles whose position is not known
    begin `BEHIND_M` behind their slots. `stop` is asked before each step whether to end the rehearsal.

    Raises:
        RefusedOrderError: separation, fence or a companion speak against the order, or a vehicle is too far.
        VfguideError: the rehearsal was stopped.
    """
    order = replace(arrangement, number=1, time_s=BEGINS_S)
    starts = starts_of_joining(formation, order, leader, joining or {})
    end_s = BEGINS_S + max(
        order.duration_s + AFTER_S,
        _way_into_slots_s(starts),
        _way_onto_path_s(mission, formation, order, leader) + AFTER_S,
        _height_change_s(mission, formation, order, leader) + AFTER_S,
    )
    copy = _at_present(mission, formation, order, starts=starts, leader=leader, end_s=end_s)
    names = [copy.leader.vehicle, *copy.followers_by_name]
    flying = [aircraft_of(copy, name, orders=mail_of(order)) for name in names]
    rate_hz = copy.rehearsal.rate_hz
    times = [step / rate_hz for step in range(round(end_s * rate_hz) + 1)]
    mail = list[Mail]()
    for now in times:
        if stop():
            raise VfguideError("the rehearsal was stopped")
        mail = step_all(flying, now, mail)
    for aircraft in flying:
        if isinstance(aircraft, Aircraft):
            _check_flown(aircraft, order)
    records = [aircraft.recorder.record() for aircraft in flying]
    record = flight_record(copy, times, records, wall_s=0.0)
    moved = record.time_s >= BEGINS_S
    nearest = min(
        (
            (float(pair.distance_m[moved].min()), pair.first, pair.second,
             float(record.time_s[moved][pair.distance_m[moved].argmin()]) - BEGINS_S)
            for pair in pair_separations(record)
        ),
        default=(math.inf, "", "", 0.0),
    )  # fmt: skip
    least, first, second, least_s = nearest
    limit = mission.acceptance.min_separation_m
    if least < limit:
        raise RefusedOrderError(
            f"{first} and {second} would come within {least:.1f} m of each other {least_s:.0f} s after"
            f" its beginning, less than {limit:g} m: choose a greater spacing, or other slots"
        )
    _check_fence(on_path(mission, order.path), record, moved)
    errors = np.array(
        [
            slot_error(record.leader, one).distance_m[moved]
            for one in record.followers
            if one.name in order.vehicles
        ]
    )
    settled = settling_time(record.time_s[moved] - BEGINS_S, errors, ARRIVED_M)
    return Prediction(
        least_m=least,
        pair=(first, second),
        least_s=least_s,
        settled_s=None if settled is None else max(settled, order.duration_s),
        moved_s=order.duration_s,
    )


def starts_of_joining(
    formation: Formation,
    order: Arrangement,
    leader: LeaderPlace | None,
    joining: Mapping[str, LeaderPlace],
) -> dict[str, FollowerStart]:
    """Return the starts of joining vehicles relative to their slots.

    Raises:
        RefusedOrderError: a vehicle is too far away.
    """
    starts = {}
    for name in order.vehicles - set(formation.slots):
        slot, place = order.place_of(name), joining.get(name)
        if slot is None:
            continue
        if leader is None or place is None:
            starts[name] = FollowerStart(forward_m=-BEHIND_M)
            continue
        forward, right = resolve(
            place.north - leader.north, place.east - leader.east, leader.course
        )
        if math.hypot(forward, right) > FARTHEST_M:
            away_km = math.hypot(forward, right) / 1000.0
            raise RefusedOrderError(
                f"{name} is {away_km:.0f} km from the leader: bring it nearer first"
            )
        above = place.height - leader.height - slot.begin.up
        starts[name] = FollowerStart(
            forward_m=forward - slot.begin.forward,
            right_m=right - slot.begin.right,
            course_deg=math.degrees(place.course) % 360.0,
            up_m=above if math.isfinite(above) else 0.0,
        )
    return starts


def _way_into_slots_s(starts: Mapping[str, FollowerStart]) -> float:
    """Estimate the time until all joining vehicles are in their slots, s; 0 without any."""
    ways = [math.hypot(one.forward_m, one.right_m) / CLOSING_M_S for one in starts.values()]
    return min(max(ways) + 3.0 * AFTER_S, LONGEST_WAY_S) if ways else 0.0


def _way_onto_path_s(
    mission: Mission, formation: Formation, order: Arrangement, leader: LeaderPlace | None
) -> float:
    """Estimate the leader's time onto another path, s; 0 where the path stays."""
    if order.path == formation.path or leader is None:
        return 0.0
    away = abs(point_beside(on_path(mission, order.path), leader).cross_track_error)
    turns = math.pi * order.turn_radius_m
    return min((away + turns) / mission.leader.airspeed_m_s, LONGEST_WAY_S)


def _height_change_s(
    mission: Mission, formation: Formation, order: Arrangement, leader: LeaderPlace | None
) -> float:
    """Estimate the time of the climb or descent to another path, s; 0 where the path stays."""
    if order.path == formation.path:
        return 0.0
    leader = leader or planned_place(on_path(mission, formation.path), BEGINS_S)
    after = point_beside(on_path(mission, order.path), leader).height
    change = mission.height_above_origin_m + float(after) - height_of(mission, leader)
    return min(change_duration(change, climb_limits(mission)), LONGEST_WAY_S)


def _check_fence(mission: Mission, record: FlightRecord, moved: BoolArray) -> None:
    """Raise RefusedOrderError where a vehicle leaves the fence."""
    for finding in beyond_when_flown(mission, record, moved):
        raise RefusedOrderError(f"on the way there {finding.message}; {finding.remedy}")


def _check_flown(aircraft: Aircraft, order: Arrangement) -> None:
    """Raise RefusedOrderError, with the companion's reason, where a vehicle does not fly the order."""
    flown = aircraft.companion.arrangement
    if flown is not None and flown.number == order.number:
        return
    reasons = [
        event.text.partition(": ")[2]
        for event in aircraft.events
        if event.text.startswith(
            (f"order {order.number} is refused", f"order {order.number} is void")
        )
    ]
    raise RefusedOrderError(f"{aircraft.name} would not fly it: {(reasons or ['no word'])[0]}")


def _at_present(
    mission: Mission,
    formation: Formation,
    order: Arrangement,
    *,
    starts: Mapping[str, FollowerStart],
    leader: LeaderPlace | None,
    end_s: float,
) -> Mission:
    """Return the mission as if it began with the present formation on its present path."""
    mission = on_path(mission, formation.path)
    joins = {name: order.place_of(name) for name in starts}
    slots = {
        **formation.slots,
        **{name: place.begin for name, place in joins.items() if place is not None},
    }
    begins = {name: starts.get(name, FollowerStart()) for name in slots}
    begin = (
        mission.rehearsal.start.leader
        if leader is None
        else LeaderStart(
            north_m=leader.north,
            east_m=leader.east,
            course_deg=math.degrees(leader.course) % 360.0,
            up_m=height_of(mission, leader) - mission.height_above_origin_m,
            climb_m_s=leader.climb_rate,
        )
    )
    start = Start.model_validate({"leader": begin, **begins})
    rehearsal = mission.rehearsal.model_copy(update={"start": start, "duration_s": end_s})
    return with_slots(mission, slots).model_copy(update={"rehearsal": rehearsal, "orders": ()})
