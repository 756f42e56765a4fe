"""A mission flown by aircraft that answer slower or faster than it says, and what becomes of them."""

import os
from collections.abc import Callable
from dataclasses import dataclass

from vfguide.companion.strain_guard import HANDED_BACK
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.metrics import reject_absence, summarise
from vfguide.lab.report.summary import FollowerSummary
from vfguide.mission.finding import Finding
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import EmulatedAircraft

FACTORS = {"half as fast": 0.5, "twice as fast": 2.0}
"""Factors on the true response, by how they are told."""

SHORT_S = 40.0
"""Length of such a flight, s; its second half counts: what is learned in flight is learned by then."""

QUICKEST_1_S = 20.0
"""Quickest hold that a rehearsal has, 1/s."""

LEARN = "let it be learned: response: auto; or measure it: vfguide identify"
MEASURE = "measure it, and declare what is found: vfguide identify"


@dataclass(frozen=True, slots=True, kw_only=True)
class UnlikeDeclared:
    """What became of a mission whose aircraft answered otherwise."""

    how: str
    """A key of `FACTORS`."""
    error_m: float | None
    """Mean formation error over the second half, m; None where there was none to measure."""
    lost: tuple[str, ...]
    """What became of vehicles that did not keep their places, a phrase for each."""


def fly_unlike_declared(
    mission: Mission, stop: Callable[[], bool]
) -> tuple[UnlikeDeclared, ...] | None:
    """Fly a mission once by each of `FACTORS`; None where that was stopped.

    Args:
        mission: begins where it is to be flown from; only its first `SHORT_S` are.
        stop: asked before each step whether to end here.

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
    """Return a short rehearsal of a mission whose aircraft answer so many times as fast as in its own."""
    rehearsal = mission.rehearsal
    vehicles = {name: aircraft_by(mission, name, factor) for name in mission.vehicles}
    emulator = rehearsal.emulator.model_copy(update={"vehicles": vehicles})
    duration_s = min(rehearsal.duration_s, SHORT_S)
    changed = rehearsal.model_copy(update={"emulator": emulator, "duration_s": duration_s})
    return mission.model_copy(update={"rehearsal": changed})


def aircraft_by(mission: Mission, name: str, factor: float) -> EmulatedAircraft:
    """Return what a vehicle really is, with the holds of its course and speed so many times as fast."""
    vehicle, own = mission.vehicles[name], mission.rehearsal.emulator.of(name)
    alpha, beta = own.alpha_1_s or vehicle.alpha_1_s, own.beta_1_s or vehicle.beta_1_s
    quicker = {
        "alpha_1_s": min(factor * alpha, QUICKEST_1_S),
        "beta_1_s": min(factor * beta, QUICKEST_1_S),
        "guided_p": factor * own.guided_p,
    }
    return own.model_copy(update=quicker)


def lost_of(flight: LockstepFlight) -> tuple[str, ...]:
    """Return a phrase about each vehicle that did not keep its place, or was handed back as strained."""
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
    """Whether the mission says of any vehicle how it answers."""
    return any(one.declares_response for one in mission.vehicles.values())


def losses_found(mission: Mission, flown: tuple[UnlikeDeclared, ...]) -> tuple[Finding, ...]:
    """Return a warning for each response by which vehicles do not keep their places."""
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
    """Return how much worse it gets by another response than the one that gave this error in m."""
    errors = [(one.error_m, one.how) for one in flown if one.error_m is not None]
    worst_m, how = max(errors, default=(error_m, ""))
    if round(worst_m, 2) <= round(error_m, 2):
        return "no more if it answers half or twice as fast"
    if declares_any_response(mission):
        return f"{worst_m:.2f} m if it answers {how}"
    return f"{worst_m:.2f} m at worst"
