"""An order flown in virtual time before it is given: how near anybody comes, and how long it takes."""

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
"""An order is flown after so long, when everybody has found its slot."""

AFTER_S = 15.0
"""So long after the slots have come to rest the flight is watched."""

BEHIND_M = 150.0
"""How far behind its slot one that joins is taken to be where that is not known."""

CLOSING_M_S = 5.0
"""As fast at least one that joins is taken to catch up; what it takes with 45 s to spare."""

FARTHEST_M = 20e3
"""From the leader: one that is to join from farther away would take half an hour."""

LONGEST_WAY_S = 180.0
"""A way onto another path, or back into the formation, is not watched for longer."""

ARRIVED_M = 1.0
"""From its slot: within this a vehicle has arrived."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What a rehearsal says of an order."""

    least_m: float
    """Least distance of two vehicles."""
    pair: tuple[str, str]
    """Which two."""
    least_s: float
    """When, s after the order's time."""
    settled_s: float | None
    """After so long everybody stays within a metre of its slot; None where that did not happen."""
    moved_s: float
    """How long the slots move, s."""


def rehearsed(
    mission: Mission,
    formation: Formation,
    arrangement: Arrangement,
    *,
    leader: LeaderPlace | None = None,
    joining: Mapping[str, LeaderPlace] | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Prediction:
    """Fly an arrangement in virtual time, from the formation as it is.

    Args:
        mission: with its vehicles, its path and its wind.
        formation: as it is.
        arrangement: what is to be flown; its time and number do not count.
        leader: where it is; at the beginning of its path if absent.
        joining: where vehicles are that are to join; 150 m behind their slots if absent.
        stop: whether to end before the rehearsal is complete; asked again and again.

    Raises:
        RefusedOrderError: two would come within the mission's least separation, or it would not be flown.
        VfguideError: it was stopped.
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
    """Where those begin that are to join, from their slots.

    Raises:
        RefusedOrderError: one is too far away.
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
    """How long those take that are to join, about, s; 0 where none is."""
    ways = [math.hypot(one.forward_m, one.right_m) / CLOSING_M_S for one in starts.values()]
    return min(max(ways) + 3.0 * AFTER_S, LONGEST_WAY_S) if ways else 0.0


def _way_onto_path_s(
    mission: Mission, formation: Formation, order: Arrangement, leader: LeaderPlace | None
) -> float:
    """How long the leader is on its way onto another path, about, s; 0 where the path stays."""
    if order.path == formation.path or leader is None:
        return 0.0
    away = abs(point_beside(on_path(mission, order.path), leader).cross_track_error)
    turns = math.pi * order.turn_radius_m
    return min((away + turns) / mission.leader.airspeed_m_s, LONGEST_WAY_S)


def _height_change_s(
    mission: Mission, formation: Formation, order: Arrangement, leader: LeaderPlace | None
) -> float:
    """How long all climb or descend to another path, about, s; 0 where the path stays."""
    if order.path == formation.path:
        return 0.0
    leader = leader or planned_place(on_path(mission, formation.path), BEGINS_S)
    after = point_beside(on_path(mission, order.path), leader).height
    change = mission.height_above_origin_m + float(after) - height_of(mission, leader)
    return min(change_duration(change, climb_limits(mission)), LONGEST_WAY_S)


def _check_fence(mission: Mission, record: FlightRecord, moved: BoolArray) -> None:
    """See that everybody stays within the fence on the way.

    Raises:
        RefusedOrderError: a vehicle leaves it.
    """
    for finding in beyond_when_flown(mission, record, moved):
        raise RefusedOrderError(f"on the way there {finding.message}; {finding.remedy}")


def _check_flown(aircraft: Aircraft, order: Arrangement) -> None:
    """See that a vehicle flies the order.

    Raises:
        RefusedOrderError: it does not; the sentence says why, as its companion says it.
    """
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
    """The mission as if it began with the formation as it is, on the path that it follows."""
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
