"""An order flown in virtual time before it is given: how near anybody comes, and how long it takes."""

import math
from dataclasses import dataclass, replace

import numpy as np

from vfguide.formation.arrangement import Arrangement, Flown
from vfguide.formation.orders import Formation
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab.rehearsal.aircraft import Aircraft, step_all
from vfguide.lab.rehearsal.operator import LEAD_S, REPEAT_S, TIMES
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.figures import settling_time
from vfguide.lab.report.geometry import pair_separations, slot_error
from vfguide.link.memory import Mail
from vfguide.link.order_codec import encode_order
from vfguide.mission.model import Follower, Mission
from vfguide.mission.order_plan import LeaderPlace
from vfguide.mission.orders import Slot
from vfguide.mission.rehearsal import FollowerStart, LeaderStart, Start

BEGINS_S = 8.0
"""An order is flown after so long, when everybody has found its slot."""

AFTER_S = 15.0
"""So long after the slots have come to rest the flight is watched."""

JOINS_S = 60.0
"""The same where one joins, from far behind."""

BEHIND_M = 150.0
"""How far behind its slot one that joins is taken to be."""

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
) -> Prediction:
    """Fly an arrangement in virtual time, from the formation as it is.

    Args:
        mission: with its vehicles, its path and its wind.
        formation: as it is.
        arrangement: what is to be flown; its time and number do not count.
        leader: where it is; at the beginning of its path if absent.

    Raises:
        RefusedOrderError: two would come within the mission's least separation, or it would not be flown.
    """
    order = replace(arrangement, number=1, time_s=BEGINS_S)
    joins = order.vehicles - set(formation.slots)
    end_s = BEGINS_S + order.duration_s + (JOINS_S if joins else AFTER_S)
    copy = _at_present(mission, formation, order, leader=leader, end_s=end_s)
    data = encode_order(order)
    early_s = 0.0 if order.flown is Flown.ABORT else LEAD_S
    orders = [(BEGINS_S - early_s + REPEAT_S * number, data) for number in range(TIMES)]
    names = [copy.leader.vehicle, *copy.followers_by_name]
    flying = [Aircraft(copy, name, orders=orders) for name in names]
    rate_hz = copy.rehearsal.rate_hz
    times = [step / rate_hz for step in range(round(end_s * rate_hz) + 1)]
    mail = list[Mail]()
    for now in times:
        mail = step_all(flying, now, mail)
    for aircraft in flying:
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
    leader: LeaderPlace | None,
    end_s: float,
) -> Mission:
    """The mission as if it began with the formation as it is."""
    joins = order.vehicles - set(formation.slots)
    slots = {
        **formation.slots,
        **{name: place.begin for name in joins if (place := order.place_of(name)) is not None},
    }
    followers = tuple(
        Follower(
            vehicle=name,
            slot=Slot(forward_m=point.forward, right_m=point.right, up_m=point.up),
        )
        for name, point in slots.items()
    )
    starts = {name: FollowerStart(forward_m=-BEHIND_M if name in joins else 0.0) for name in slots}
    begin = (
        mission.rehearsal.start.leader
        if leader is None
        else LeaderStart(
            north_m=leader.north,
            east_m=leader.east,
            course_deg=math.degrees(leader.course) % 360.0,
        )
    )
    start = Start.model_validate({"leader": begin, **starts})
    rehearsal = mission.rehearsal.model_copy(update={"start": start, "duration_s": end_s})
    return mission.model_copy(update={"followers": followers, "rehearsal": rehearsal, "orders": ()})
