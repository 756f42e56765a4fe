"""How fast and how near formations change their shape: every ordered pair of six shapes.

Run with `.venv/bin/python -m tests.benchmarks.orders pairs [FOLLOWERS ...]`, all in the article's wind, in
lockstep through MAVLink bytes. Minutes for each. Random orders: `random_orders.py`.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tests.kit.figures import tell
from tests.kit.missions import shipped
from vfguide.formation.arrangement import Arrangement, Shape, shape_slots
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
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
PATHS = {
    "line": {"type": "line", "point": {"north_m": 0, "east_m": 0}, "course_deg": 45, "gain": 0.03},
    "circle": {
        "type": "circle",
        "centre": {"north_m": 500, "east_m": 0},
        "radius_m": 500,
        "gain": 0.015,
    },
}


@dataclass(frozen=True)
class Given:
    """An order that was given."""

    name: str
    arrangement: Arrangement


def mission_of(count: int, path: str, seed: int = 1) -> Mission:
    """A vee of some followers in the article's wind."""
    names = [f"f{number}" for number in range(1, count + 1)]
    slots = zip(names, shape_slots("vee", count, SPACING_M), strict=True)
    gains = {"k_x": 0.42, "k_y": 0.28, "integral_s": 0.65, "chi_inf_deg": 45, "v_inf_m_s": 8}
    sliding = {"kappa": 3, "epsilon": 0.01, "boundary_layer_factor": 4.8}
    return Mission.model_validate(
        {
            "name": f"orders-{path}",
            "origin": shipped("line-wind").origin.model_dump(),
            "path": PATHS[path],
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
            "rehearsal": {"link_delay_s": 0.1, "seed": seed},
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


def planned(mission: Mission, orders: Iterator[tuple[str, Order]], count: int) -> list[Given]:
    """The first orders that can be carried out, one after the other."""
    formation, time_s, given = formation_of_mission(mission), FIRST_S, list[Given]()
    for name, order in orders:
        if len(given) == count:
            break
        try:
            found, _ = resolve(mission, order, formation, number=len(given) + 1, time_s=time_s)
        except RefusedOrderError as refusal:
            tell(f"refused  {name}: {refusal}")
            continue
        given.append(Given(name, found))
        formation = formation.after(found)
        time_s += found.duration_s + BETWEEN_S
    return given


def flown(mission: Mission, given: Sequence[Given]) -> FlightRecord:
    """The flight of these orders; whatever is not flown as ordered ends it."""
    last = given[-1].arrangement
    rate_hz = mission.rehearsal.rate_hz
    end = round((last.time_s + last.duration_s + BETWEEN_S) * rate_hz)
    mail_at = sorted(
        (one.arrangement.time_s - LEAD_S + REPEAT_S * copy, encode_order(one.arrangement))
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


def settled_s(record: FlightRecord, one: Given, until_s: float) -> float:
    """After so long everybody stays within a metre of where the order sends it; infinite if not by then."""
    order = one.arrangement
    window = (record.time_s >= order.time_s) & (record.time_s < until_s)
    errors = []
    for vehicle in record.followers:
        if (place := order.place_of(vehicle.name)) is not None:
            forward, right = seen_from_leader(record.leader, vehicle)
            errors.append(np.hypot(forward - place.end.forward, right - place.end.right)[window])
    found = settling_time(record.time_s[window] - order.time_s, np.array(errors), 1.0)
    return math.inf if found is None else found


def least(record: FlightRecord, from_s: float) -> tuple[float, str]:
    """(distance in m, pair) of the nearest two from a time on."""
    window = record.time_s >= from_s
    return min(
        (float(one.distance_m[window].min()), f"{one.first} and {one.second}")
        for one in pair_separations(record)
    )


def pairs(followers: Sequence[int]) -> None:
    """Every ordered pair of six shapes."""
    for count in followers:
        for path in PATHS:
            mission = mission_of(count, path)
            walk = round_trip(SIX)
            orders = (
                (f"{one} -> {other}", Order(shape=other, spacing=SPACING_M))
                for one, other in pairwise(walk)
            )
            given = planned(mission, orders, len(walk) - 1)
            record = flown(mission, given)
            ends = [one.arrangement.time_s for one in given[1:]] + [float(record.time_s[-1])]
            took = [settled_s(record, one, end) for one, end in zip(given, ends, strict=True)]
            slowest = int(np.argmax(took))
            distance, pair = least(record, FIRST_S)
            tell(
                f"{count + 1} aircraft, {path}: {len(given)} pairs, all within 1 m after"
                f" {np.median(took):.1f} s in the middle, {took[slowest]:.1f} s at most"
                f" ({given[slowest].name}); nearest two {distance:.1f} m ({pair})"
            )


def main() -> None:
    """Fly what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["pairs"])
    parser.add_argument("followers", nargs="*", type=int, default=[3, 7])
    pairs(parser.parse_args().followers)


if __name__ == "__main__":
    main()
