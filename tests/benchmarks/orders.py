"""How fast and how near a formation changes its shape: every ordered pair of six shapes.

In the article's wind, in lockstep through MAVLink bytes. Random orders: `random_orders.py`.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tests.benchmarks.results import Cases, Figures
from tests.kit.missions import replaced, shipped
from vfguide.formation.arrangement import Arrangement, Shape, shape_slots
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.figures import pair_separations, seen_from_leader, settling_time
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import timetable
from vfguide.record.flight import FlightRecord

SIX: tuple[Shape, ...] = ("vee", "line-abreast", "echelon-left", "trail", "diamond", "finger-four")
SPACING_M = 20.0
FIRST_S = 40.0
"""Everybody has found its first slot by then."""
APART_S = 45.0
"""Between two orders: everybody has found its slot again by then."""
FOLLOWERS = 3
LINE = {"type": "line", "point": {"north_m": 0, "east_m": 0}, "course_deg": 45, "gain": 0.03}


DECLARED = {"alpha_1_s": 1.2, "beta_1_s": 0.8}
"""The emulated response, for which the gains are tuned."""


def mission_of(count: int, response: Mapping[str, float]) -> Mission:
    """A vee of some followers on a line in the article's wind; their missions declare this response."""
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
                name: {"system_id": number, **response}
                for number, name in enumerate(["leader", *names], 1)
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
    """Fly every ordered pair of six shapes, one after the other, with and without a declared response."""
    yield "pairs of six shapes, 4 aircraft on a line", pairs(DECLARED)
    yield "pairs of six shapes, no response declared", pairs({})


def pairs(response: Mapping[str, float]) -> Figures:
    """Fly every ordered pair of six shapes."""
    walk = round_trip(SIX)[1:]
    times_s = [FIRST_S + APART_S * number for number in range(len(walk) + 1)]
    timed = zip(times_s, walk, strict=False)
    orders = [{"at_s": at_s, "shape": shape, "spacing_m": SPACING_M} for at_s, shape in timed]
    rehearsal = {"link_delay_s": 0.1, "duration_s": times_s[-1]}
    mission = replaced(mission_of(FOLLOWERS, response), orders=orders, rehearsal=rehearsal)
    record = fly_lockstep(mission).record
    took = [
        settled_s(record, order, end_s)
        for (order, _), end_s in zip(timetable(mission), times_s[1:], strict=True)
    ]
    settled = [one for one in took if math.isfinite(one)] or [math.inf]
    counts = record.time_s >= FIRST_S
    found = (
        f"within 1 m after {np.median(settled):.1f} s, {max(settled):.1f} s at most, by "
        f"{len(settled)} of {len(took)} orders"
    )
    if len(settled) < len(took):
        found += f"; else not within {APART_S:.0f} s"
    return {
        "found": found,
        "nearest_m": min(one.distance_m[counts].min() for one in pair_separations(record)),
    }
