"""Predict the precision of a formation by a flight of a minute from its slots, in the declared conditions.

A mission with a time table is flown until its last order has settled. Two shorter flights show the effect of
aircraft that respond half or twice as fast.
"""

import math
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vfguide.companion.strain_guard import HANDED_BACK
from vfguide.formation.arrangement import MAIN_PATH, Arrangement
from vfguide.guidance.height import change_duration
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.figures import pair_separations
from vfguide.lab.report.metrics import FollowerSummary, reject_absence, summarise
from vfguide.lab.studies.flown import beyond_when_flown
from vfguide.mission.feasibility import path_beginning
from vfguide.mission.finding import Finding
from vfguide.mission.flight_limits import climb_limits
from vfguide.mission.flight_path import height_span, path_of
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import on_path, timetable
from vfguide.mission.rehearsal import EmulatedAircraft, FollowerStart, LeaderStart, Start
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

# Flights with aircraft that respond slower or faster than the mission says.

FACTORS = {"half as fast": 0.5, "twice as fast": 2.0}
"""Factors on the true response rates, by their names in findings."""

SHORT_S = 40.0
"""Length of a flight with another response, s; learning is over before its second half, which counts."""

QUICKEST_1_S = 20.0
"""Greatest response rate of a course or speed hold in a rehearsal, 1/s."""

LEARN = "let it be learned: response: auto; or measure it: vfguide identify"
MEASURE = "measure it, and declare what is found: vfguide identify"


@dataclass(frozen=True, slots=True, kw_only=True)
class UnlikeDeclared:
    """Result of a flight with another response than the mission's."""

    how: str
    """Key of `FACTORS`."""
    error_m: float | None
    """Mean formation error over the second half, m, if measured."""
    lost: tuple[str, ...]
    """A phrase on each vehicle that did not keep its place."""


def fly_unlike_declared(
    mission: Mission, stop: Callable[[], bool]
) -> tuple[UnlikeDeclared, ...] | None:
    """Fly the first `SHORT_S` of a mission with each of `FACTORS`; return None where `stop` ended a flight.

    Raises:
        VfguideError: a process died.
    """
    found = []
    for how, factor in FACTORS.items():
        unlike = answering_by(mission, factor)
        flight = fly_rehearsal(unlike, processes=os.cpu_count() or 1, stop=stop)
        if flight.interrupted:
            return None
        error_m = summarise(flight.record).formation.mean_error_m
        found.append(UnlikeDeclared(how=how, error_m=error_m, lost=lost_of(flight)))
    return tuple(found)


def answering_by(mission: Mission, factor: float) -> Mission:
    """Return a mission for a short rehearsal whose aircraft respond faster by a factor."""
    rehearsal = mission.rehearsal
    vehicles = {name: aircraft_by(mission, name, factor) for name in mission.vehicles}
    emulator = rehearsal.emulator.model_copy(update={"vehicles": vehicles})
    duration_s = min(rehearsal.duration_s, SHORT_S)
    changed = rehearsal.model_copy(update={"emulator": emulator, "duration_s": duration_s})
    return mission.model_copy(update={"rehearsal": changed})


def aircraft_by(mission: Mission, name: str, factor: float) -> EmulatedAircraft:
    """Return a vehicle's emulated aircraft with course and speed holds faster by a factor."""
    vehicle, own = mission.vehicles[name], mission.rehearsal.emulator.of(name)
    alpha, beta = own.alpha_1_s or vehicle.alpha_1_s, own.beta_1_s or vehicle.beta_1_s
    quicker = {
        "alpha_1_s": min(factor * alpha, QUICKEST_1_S),
        "beta_1_s": min(factor * beta, QUICKEST_1_S),
        "guided_p": factor * own.guided_p,
    }
    return own.model_copy(update=quicker)


def lost_of(flight: LockstepFlight) -> tuple[str, ...]:
    """Return a phrase on each vehicle that did not keep its place, or was handed back as strained."""
    record = flight.record
    absences = (
        reject_absence(name, one.formation_error_m, record.acceptance)
        for name, one in summarise(record).vehicles.items()
        if isinstance(one, FollowerSummary)
    )
    back = (
        f"{name} was handed back to its autopilot"
        for name, events in flight.events.items()
        if any(HANDED_BACK in event.text for event in events)
    )
    return (*(one for one in absences if one is not None), *back)


def declares_any_response(mission: Mission) -> bool:
    """Check whether the mission declares the response of any vehicle."""
    return any(one.declares_response for one in mission.vehicles.values())


def losses_found(mission: Mission, flown: tuple[UnlikeDeclared, ...]) -> tuple[Finding, ...]:
    """Return a warning for each response with which vehicles do not keep their places."""
    learns = all(one.asks_response for one in mission.vehicles.values())
    return tuple(
        Finding(
            "warning",
            ("vehicles",),
            f"if it answers {one.how}: {', '.join(one.lost)}",
            MEASURE if learns else LEARN,
        )
        for one in flown
        if one.lost
    )


def worst_in_words(mission: Mission, error_m: float, flown: tuple[UnlikeDeclared, ...]) -> str:
    """Describe the worst error with another response, compared with `error_m` as declared."""
    errors = [(one.error_m, one.how) for one in flown if one.error_m is not None]
    worst_m, how = max(errors, default=(error_m, ""))
    if round(worst_m, 2) <= round(error_m, 2):
        return "no more if it answers half or twice as fast"
    if declares_any_response(mission):
        return f"{worst_m:.2f} m if it answers {how}"
    return f"{worst_m:.2f} m at worst"


ORDER_FAILS = re.compile(r"order (\d+) is (refused|void)")
"""Companion's event text for an order that is not flown."""

FLOWN_S = 60.0
"""Length of the flight, s; by its second half, which counts, the leader is on its path."""


SETTLED_S = 15.0
"""Flight time after the last slot has come to rest, for a mission with a time table, s."""

LONGEST_S = 600.0
"""Longest flight of a mission with a time table, s."""


def expected_precision(
    mission: Mission, stop: Callable[[], bool] = lambda: False
) -> tuple[Finding, ...] | None:
    """Predict a mission's formation error and the fate of its orders; None where `stop` ended a flight.

    The mission must have a follower and no error by `check_mission`.

    Raises:
        VfguideError: a library of the mission's guidance law is not installed, or a process died.
    """
    rehearsed = from_the_slots(mission)
    flight = fly_rehearsal(rehearsed, processes=os.cpu_count() or 1, stop=stop)
    unlike = None if flight.interrupted else fly_unlike_declared(rehearsed, stop)
    if unlike is None:
        return None
    return (
        precision_of(mission, first_minute(flight.record), unlike),
        *orders_amiss(mission, flight),
        *fence_left(mission, flight.record),
        *losses_found(mission, unlike),
    )


def first_minute(record: FlightRecord) -> FlightRecord:
    """Return the first `FLOWN_S` of a flight, for its precision: later orders may send vehicles away."""
    count = int(np.searchsorted(record.time_s, FLOWN_S + 1e-6, side="right"))
    if count == len(record.time_s):
        return record
    vehicles = tuple(replace(one, **series_of(one, count)) for one in record.vehicles)
    return replace(record, time_s=record.time_s[:count], vehicles=vehicles, duration_s=FLOWN_S)


def series_of(vehicle: VehicleRecord, count: int) -> dict[str, Any]:
    """Return the first samples of each of a vehicle's series, by name."""
    values = {one.name: getattr(vehicle, one.name) for one in fields(vehicle)}
    return {name: one[:count] for name, one in values.items() if isinstance(one, np.ndarray)}


def orders_amiss(mission: Mission, flight: LockstepFlight) -> Iterator[Finding]:
    """Yield findings on orders that are not flown or not settled in time, and on pairs that come too near."""
    if not mission.orders:
        return
    yield from orders_not_flown(mission, flight)
    record, limit = flight.record, mission.acceptance.min_separation_m
    for pair in pair_separations(record):
        least = int(pair.distance_m.argmin())
        if pair.distance_m[least] < limit:
            message = (
                f"{pair.first} and {pair.second} come within {pair.distance_m[least]:.1f} m of each other at"
                f" {record.time_s[least]:.0f} s, less than {limit:g} m"
            )
            remedy = "order a greater spacing or other slots"
            yield Finding("error", ("orders",), message, remedy)
    unsettled = [
        found.time_s for found, _ in timetable(mission) if ends_at(found) > record.duration_s + 1.0
    ]
    if unsettled:
        message = (
            f"orders from {unsettled[0]:g} s on were not rehearsed to their end: it is flown for"
            f" {LONGEST_S:g} s at most"
        )
        yield Finding("note", ("orders",), message)


def fence_left(mission: Mission, record: FlightRecord) -> Iterator[Finding]:
    """Yield a finding for each vehicle that leaves the fence of its present path."""
    begins = [(0.0, MAIN_PATH), *((found.time_s, found.path) for found, _ in timetable(mission))]
    ends = [*(time_s for time_s, _ in begins[1:]), math.inf]
    left = set[str]()
    for (from_s, path), until_s in zip(begins, ends, strict=True):
        during = (from_s <= record.time_s) & (record.time_s < until_s)
        for finding in beyond_when_flown(on_path(mission, path), record, during):
            vehicle = finding.location[-1]
            if vehicle not in left:
                left.add(str(vehicle))
                message = f"in the rehearsal, from {from_s:.0f} s on, {finding.message}"
                place = "orders" if from_s > 0.0 else "fence"
                yield Finding("error", (place,), message, finding.remedy)


def orders_not_flown(mission: Mission, flight: LockstepFlight) -> Iterator[Finding]:
    """Yield a finding for each order that is refused or void in the rehearsal, with the first reason."""
    found: dict[int, str] = {}
    away = {loss.vehicle for loss in mission.rehearsal.losses}
    said = sorted(
        (event.time_s, name, event.text)
        for name, events in flight.events.items()
        # A companion that returns from a loss refuses the present order until it has heard it again.
        if name not in away
        for event in events
    )
    for time_s, name, text in said:
        if (fails := ORDER_FAILS.match(text)) is not None:
            found.setdefault(int(fails[1]), f"{name}, at {time_s:.0f} s: {text}")
    for number, message in sorted(found.items()):
        yield Finding("error", ("orders", number - 1), message, "see it: vfguide fly")


def precision_of(
    mission: Mission, record: FlightRecord, unlike: tuple[UnlikeDeclared, ...]
) -> Finding:
    """Compare the formation error of a rehearsal with the mission's limit; `unlike` tells other responses."""
    formation = summarise(record).formation
    error, asked = formation.mean_error_m, mission.acceptance.mean_error_m
    if error is None or formation.p95_error_m is None:
        message = "the rehearsal measured no formation error"
        return Finding("warning", ("followers",), message, "see why: vfguide fly")
    learned = (
        ""
        if declares_any_response(mission)
        else "how it answers is not declared: it is learned in flight; "
    )
    message = (
        f"{learned}expect {error:.2f} m of mean formation error, 95 % of the time below"
        f" {formation.p95_error_m:.2f} m; {worst_in_words(mission, error, unlike)}: flown for"
        f" {record.duration_s:.0f} s in {conditions_in_words(mission)}"
    )
    if asked is not None and error > asked:
        message += f"; acceptance.mean_error_m is {asked:g}"
        remedy = "see where it comes from: vfguide fly"
        return Finding("warning", ("acceptance", "mean_error_m"), message, remedy)
    return Finding("note", ("followers",), message)


def from_the_slots(mission: Mission) -> Mission:
    """Return a mission of a minute, or of all its orders, in which every vehicle starts in place."""
    begin = path_beginning(mission.path)
    up_m = float(path_of(mission.path).at(0.0).height)
    places: dict[str, object] = {name: FollowerStart() for name in mission.followers_by_name}
    places["leader"] = LeaderStart(
        north_m=begin.north_m, east_m=begin.east_m, course_deg=begin.course_deg, up_m=up_m
    )
    start = Start.model_validate(places)
    rehearsal = mission.rehearsal.model_copy(
        update={"duration_s": flown_s(mission), "start": start}
    )
    return mission.model_copy(update={"rehearsal": rehearsal})


def flown_s(mission: Mission) -> float:
    """Return the flight time of a mission, s: a minute, or until its last order has settled."""
    if not mission.orders:
        return FLOWN_S
    found = [order for order, _ in timetable(mission)]
    path, ends = MAIN_PATH, [FLOWN_S, ends_at(found[-1])]
    for order in found:
        if order.path != path:
            ends.append(order.time_s + height_change_s(mission, path, order.path) + SETTLED_S)
        path = order.path
    return min(max(ends), LONGEST_S)


def height_change_s(mission: Mission, before: str, after: str) -> float:
    """Return the longest time of a climb or descent from one path to another, s."""
    (low, high), (lower, higher) = (
        height_span(path_of(on_path(mission, name).path)) for name in (before, after)
    )
    limits = climb_limits(mission)
    return max(
        change_duration(max(higher - low, 0.0), limits),
        change_duration(min(lower - high, 0.0), limits),
    )


def ends_at(order: Arrangement) -> float:
    """Return the time at which all vehicles have settled in their slots after an order, s."""
    return order.time_s + order.duration_s + SETTLED_S


def conditions_in_words(mission: Mission) -> str:
    """Describe the conditions of a mission's rehearsal."""
    rehearsal, wind = mission.rehearsal, mission.wind
    words = ["calm air" if wind.type == "calm" else f"{wind.type} wind"]
    words += [f"{wind.turbulence} turbulence"] * (wind.turbulence != "none")
    words += ["gusts"] * bool(wind.gusts)
    words.append(f"{rehearsal.sensors} sensors")
    noise = rehearsal.position_noise_m
    words += [f"{noise:g} m of position noise"] * (noise > 0.0)
    radio = rehearsal.radio
    if radio is None:
        words.append(f"leader states {rehearsal.link_delay_s:g} s old")
        words += [f"{rehearsal.link_loss:.0%} of them lost"] * (rehearsal.link_loss > 0.0)
    else:
        words.append(f"a radio with {radio.leader_hz:g} leader states a second")
        words += [f"{radio.loss:.0%} of its packets lost"] * (radio.loss > 0.0)
    words += ["with vehicles as declared"] * declares_any_response(mission)
    return ", ".join(words)
