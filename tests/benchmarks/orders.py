"""How fast and how near a formation changes its shape: every ordered pair of six shapes.

In the article's wind, in lockstep through MAVLink bytes. Random orders: `random_orders.py`.
"""

import math
from collections.abc import Sequence

import numpy as np

from tests.benchmarks.results import Cases
from tests.kit.missions import shipped
from vfguide.formation.arrangement import Arrangement, Shape, shape_slots
from vfguide.formation.orders import Order
from vfguide.lab.rehearsal.aircraft import LEAD_S, REPEAT_S, TIMES, Aircraft, step_all
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.figures import pair_separations, seen_from_leader, settling_time
from vfguide.link.memory import Mail
from vfguide.link.order_codec import encode_order
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import formation_of_mission, resolve
from vfguide.record.flight import FlightRecord

SIX: tuple[Shape, ...] = ("vee", "line-abreast", "echelon-left", "trail", "diamond", "finger-four")
SPACING_M = 20.0
FIRST_S = 40.0
"""Everybody has found its first slot by then."""
BETWEEN_S = 20.0
"""After the slots have come to rest, before the next order."""
FOLLOWERS = 3
LINE = {"type": "line", "point": {"north_m": 0, "east_m": 0}, "course_deg": 45, "gain": 0.03}


def mission_of(count: int) -> Mission:
    """A vee of some followers on a line in the article's wind."""
    names = [f"f{number}" for number in range(1, count + 1)]
    slots = zip(names, shape_slots("vee", count, SPACING_M), strict=True)
    gains = {"k_x": 0.42, "k_y": 0.28, "integral_s": 0.65, "chi_inf_deg": 45, "v_inf_m_s": 8}
    sliding = {"kappa": 3, "epsilon": 0.01, "boundary_layer_factor": 4.8}
    return Mission.model_validate(
        {
            "name": "orders-line",
            "origin": shipped("line-wind").origin.model_dump(),
            "path": LINE,
            "leader": {"vehicle": "leader", "airspeed_m_s": 20},
            "followers": [
                {"vehicle": name, "slot": {"forward_m": forward, "right_m": right}}
                for name, (forward, right) in slots
            ],
            "vehicles": {
                name: {"system_id": number} for number, name in enumerate(["leader", *names], 1)
            },
            "controller": {"type": "slot", **gains, **sliding},
            "wind": {"type": "article"},
            "rehearsal": {"link_delay_s": 0.1, "seed": 1},
        }
    )


def round_trip(shapes: Sequence[Shape]) -> list[Shape]:
    """A walk that takes every ordered pair of shapes once: Hierholzer's circuit of the complete graph."""
    left = {one: [other for other in shapes if other != one] for one in shapes}
    stack, circuit = [shapes[0]], []
    while stack:
        if left[stack[-1]]:
            stack.append(left[stack[-1]].pop())
        else:
            circuit.append(stack.pop())
    return circuit[::-1]


def planned(mission: Mission, walk: Sequence[Shape]) -> list[Arrangement]:
    """The orders of a walk from shape to shape, one after the other."""
    formation, time_s, given = formation_of_mission(mission), FIRST_S, list[Arrangement]()
    for shape in walk[1:]:
        order = Order(shape=shape, spacing=SPACING_M)
        found, _ = resolve(mission, order, formation, number=len(given) + 1, time_s=time_s)
        given.append(found)
        formation = formation.after(found)
        time_s += found.duration_s + BETWEEN_S
    return given


def flown(mission: Mission, given: Sequence[Arrangement]) -> FlightRecord:
    """The flight of these orders; whatever is not flown as ordered ends it."""
    last = given[-1]
    rate_hz = mission.rehearsal.rate_hz
    end = round((last.time_s + last.duration_s + BETWEEN_S) * rate_hz)
    mail_at = sorted(
        (one.time_s - LEAD_S + REPEAT_S * copy, encode_order(one))
        for one in given
        for copy in range(TIMES)
    )
    names = [mission.leader.vehicle, *mission.followers_by_name]
    flying = [Aircraft(mission, name, orders=mail_at) for name in names]
    times = [step / rate_hz for step in range(end + 1)]
    mail = list[Mail]()
    for now in times:
        mail = step_all(flying, now, mail)
    for aircraft in flying:
        arrangement = aircraft.companion.arrangement
        if arrangement is None or arrangement.number != last.number:
            raise SystemExit(f"{aircraft.name} does not fly order {last.number}")
    records = [aircraft.recorder.record() for aircraft in flying]
    return flight_record(mission, times, records, wall_s=0.0)


def settled_s(record: FlightRecord, order: Arrangement, until_s: float) -> float:
    """After so long everybody stays within a metre of where the order sends it; infinite if not by then."""
    window = (record.time_s >= order.time_s) & (record.time_s < until_s)
    errors = []
    for vehicle in record.followers:
        if (place := order.place_of(vehicle.name)) is not None:
            forward, right = seen_from_leader(record.leader, vehicle)
            errors.append(np.hypot(forward - place.end.forward, right - place.end.right)[window])
    found = settling_time(record.time_s[window] - order.time_s, np.array(errors), 1.0)
    return math.inf if found is None else found


def cases() -> Cases:
    """Fly every ordered pair of six shapes, one after the other."""
    mission = mission_of(FOLLOWERS)
    given = planned(mission, round_trip(SIX))
    record = flown(mission, given)
    ends = [*(one.time_s for one in given[1:]), float(record.time_s[-1])]
    took = [settled_s(record, one, end) for one, end in zip(given, ends, strict=True)]
    counts = record.time_s >= FIRST_S
    yield (
        "pairs of six shapes, 4 aircraft on a line",
        {
            "found": f"all within 1 m after {np.median(took):.1f} s, {max(took):.1f} s at most",
            "nearest_m": min(one.distance_m[counts].min() for one in pair_separations(record)),
        },
    )
