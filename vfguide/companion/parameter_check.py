"""Check of the autopilot's parameters, requested once at the start and explained to the operator."""

import math
from collections.abc import Callable

import msgspec
import numpy as np
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.plan import FlightPlan, FollowerTask, flown_by
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.formation import Slot, slot_velocity
from vfguide.guidance.intended_motion import KnownLeader
from vfguide.guidance.path import Path
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds, request_parameters
from vfguide.mavlink.reports import ParameterReport
from vfguide.state import Airframe

# Autopilot limits that are tighter than the mission's, against the needs of the flight.

PLACES = 500
"""Number of points at which turns and climbs of a path are evaluated."""

LEAST = 0.05
"""Difference of limits that counts, m/s or degrees: a smaller one is due to a change of units."""


class FlightDemand(msgspec.Struct, frozen=True, kw_only=True):
    """Needs of a place in the formation, in still air with the leader at its cruise."""

    bank: float
    """Greatest bank angle, rad."""
    slowest: float
    """Minimum airspeed, m/s."""
    fastest: float
    """Maximum airspeed, m/s."""
    climb: float
    """Maximum climb rate, m/s; 0 where it never climbs."""
    sink: float
    """Maximum sink rate, m/s, positive down."""


class NarrowedLimits(msgspec.Struct, frozen=True, kw_only=True):
    """Comparison of the limits in use with the mission's."""

    sentence: str
    """Text for the pilot; empty where no limit is tighter."""
    too_tight: bool
    """Whether the place in the formation needs more than a tighter limit allows."""


def flight_demand(path: Path, airspeed: float, slot: Slot) -> FlightDemand:
    """Return the needs of a slot while its leader flies along a path at its cruise airspeed, m/s."""
    places = path.at(path.outline(PLACES))
    turn_rate = airspeed * np.asarray(places.curvature, dtype=float)
    along, right = slot_velocity(
        np.full_like(turn_rate, airspeed), turn_rate, Slot(forward=slot.forward, right=slot.right)
    )
    speed = np.hypot(along, right)
    climb = airspeed * np.asarray(places.slope, dtype=float)
    return FlightDemand(
        bank=float(np.max(np.arctan(speed * np.abs(turn_rate) / GRAVITY))),
        slowest=float(np.min(speed)),
        fastest=float(np.max(speed)),
        climb=max(float(np.max(climb)), 0.0),
        sink=max(float(-np.min(climb)), 0.0),
    )


def demand_of(plan: FlightPlan) -> FlightDemand | None:
    """Return the needs of a plan's place; None behind a leader whose path is not known."""
    task = plan.task
    if not isinstance(task, FollowerTask):
        return flight_demand(task.path, task.airspeed, Slot(forward=0.0, right=0.0))
    if not isinstance(task.leader, KnownLeader):
        return None
    return flight_demand(task.leader.path, task.leader.airspeed, task.slot)


class Limit(msgspec.Struct, frozen=True):
    """Limit of the mission, with the value in use."""

    words: str
    """Format with places for the value in use and the mission's."""
    declared: float
    """Mission's limit, in the unit of the words."""
    flown: float
    """Limit in use."""
    taken: float | None
    """Need of the flight; None where not known."""
    is_least: bool = False
    """Whether it is a minimum, of which the higher value is the tighter."""

    @property
    def is_tighter(self) -> bool:
        """Whether less is allowed than the mission allows."""
        return self._beyond(self.declared) > LEAST

    @property
    def is_too_tight(self) -> bool:
        """Whether the flight needs more than is allowed."""
        return self.is_tighter and self.taken is not None and self._beyond(self.taken) > 0.0

    def sentence(self, place: str) -> str:
        """Return text with both values and the need of the vehicle's place."""
        words = self.words.format(self.flown, self.declared)
        return f"{words} (its {place} takes {self.taken:.3g})" if self.taken else words

    def _beyond(self, value: float) -> float:
        return self.flown - value if self.is_least else value - self.flown


def limits_of(declared: FlightPlan, flown: FlightPlan) -> tuple[Limit, ...]:
    """Return every limit of a mission with the value in use."""
    before, now, demand = declared.airframe, flown.airframe, demand_of(declared)

    def taken(value: Callable[[FlightDemand], float]) -> float | None:
        return None if demand is None else value(demand)

    bank_words = "{:.0f} degrees of bank, not {:.0f}"
    if demand is None:
        radius = now.cruise**2 / (GRAVITY * math.tan(now.max_bank))
        bank_words += f", no turn tighter than {radius:.0f} m at {now.cruise:g} m/s"
    return (
        Limit(
            bank_words,
            math.degrees(before.max_bank),
            math.degrees(now.max_bank),
            taken(lambda one: math.degrees(one.bank)),
        ),
        Limit(
            "up to {:g} m/s, not {:g}",
            before.airspeed_max,
            now.airspeed_max,
            taken(lambda one: one.fastest),
        ),
        Limit(
            "down to {:g} m/s, not {:g}",
            before.airspeed_min,
            now.airspeed_min,
            taken(lambda one: one.slowest),
            is_least=True,
        ),
        Limit(
            "climbs of {:g} m/s, not {:g}",
            before.climb_max,
            now.climb_max,
            taken(lambda one: one.climb),
        ),
        Limit(
            "descents of {:g} m/s, not {:g}",
            before.sink_max,
            now.sink_max,
            taken(lambda one: one.sink),
        ),
    )


def narrowed_limits(declared: FlightPlan, flown: FlightPlan) -> NarrowedLimits:
    """Return which limits of a mission's plan became tighter in the plan that is flown."""
    found = [limit for limit in limits_of(declared, flown) if limit.is_tighter]
    if not found:
        return NarrowedLimits(sentence="", too_tight=False)
    place = "path" if flown.leads else "slot"
    too_tight = any(limit.is_too_tight for limit in found)
    cost = (
        f"the {place} cannot be held: raise them, or fly slower and in wider turns"
        if too_tight
        else f"less is left to come back to the {place} with"
    )
    limits = ", ".join(limit.sentence(place) for limit in found)
    return NarrowedLimits(
        sentence=f"tighter than the mission's limits: {limits}; {cost}", too_tight=too_tight
    )


TRIES = 4
"""Requests for a parameter, one a second: autopilots do not answer for names that they do not know."""

Tell = Callable[[str], None]


class ParameterCheck:
    """Requests for the relevant parameters, and findings on what does not fit the flight."""

    def __init__(self, plan: FlightPlan, adapter: AutopilotAdapter) -> None:
        self.plan = plan
        """Flight plan, with the autopilot's own response once known where the plan asks for it."""
        self._adapter = adapter
        self._known: dict[str, float] = {}
        self._tries = 0
        self._told = False
        self._too_tight: list[str] = []

    def take(self, report: ParameterReport) -> None:
        """Process a parameter, whoever has asked for it."""
        if report.name in self._adapter.parameters:
            value = self._adapter.parameter_value(report)
            if math.isfinite(value):
                self._known[report.name] = value

    def faults(self) -> list[str]:
        """Return what speaks against take-off by the newest values; nothing before all were requested."""
        if not self._told:
            return []
        faults = self._adapter.parameter_faults(self._known, flight_needs(self.plan))
        return faults + self._too_tight

    def requests(self, tell: Tell) -> list[MAVLink_message]:
        """Return the requests that are due; call it once a second while the autopilot is heard."""
        wanted = self._adapter.parameters
        if self._told or not wanted:
            return []
        missing = [name for name in wanted if name not in self._known]
        if missing and self._tries < TRIES:
            self._tries += 1
            plan = self.plan
            return request_parameters(plan.system_id, plan.component_id, missing)
        self._told = True
        if not self._known:
            tell(
                "the autopilot tells no parameters: limits and fail-safe are not checked; check them by hand"
            )
        if self.plan.asks_response:
            response = self._adapter.response(self._known, flight_needs(self.plan))
            declared, self.plan = self.plan, flown_by(self.plan, response)
            tell(response_sentence(response, declared, self.plan))
            narrowed = narrowed_limits(declared, self.plan)
            self._too_tight = [narrowed.sentence] if narrowed.too_tight else []
        for warning in self._adapter.parameter_warnings(self._known, flight_needs(self.plan)):
            tell(warning)
        return []


def response_sentence(response: AutopilotResponse, declared: FlightPlan, flown: FlightPlan) -> str:
    """Return text for the pilot on the response in use, and on what in it costs accuracy."""
    airframe = flown.airframe
    alpha, beta = f"alpha {airframe.alpha:.2f}", f"beta {airframe.beta:.2f} 1/s"
    roll = roll_words(declared.airframe, airframe)
    limits = (
        f"{airframe.airspeed_min:g} to {airframe.airspeed_max:g} m/s,"
        f" {math.degrees(airframe.max_bank):.0f} degrees of bank"
    )
    narrowed = narrowed_limits(declared, flown).sentence
    tighter = f"; {narrowed}" if narrowed else ""
    if response.alpha is None and response.beta is None:
        return (
            "the autopilot's parameters do not tell how it answers: flown by what the mission declares,"
            f" {alpha} and {beta}{roll}; see that they fit, by `vfguide identify`{tighter}"
        )
    if response.alpha is None:
        return (
            f"flown by the autopilot's own parameters: {beta}{roll}, {limits}; how it takes up a course they"
            f" do not tell, {alpha} 1/s is the mission's: see that it fits, by `vfguide identify`{tighter}"
        )
    if response.beta is None:
        return (
            f"flown by the autopilot's own parameters: {alpha} 1/s{roll}, {limits}; how its speed answers"
            f" they do not tell, {beta} is the mission's: see that it fits, by `vfguide identify`{tighter}"
        )
    return (
        f"flown by the autopilot's own parameters: {alpha}, {beta}{roll}, {limits}"
        f"{tighter or '; nothing to do'}"
    )


def roll_words(declared: Airframe, flown: Airframe) -> str:
    """Return text on the roll lag and dead time in use where they are not the mission's."""
    words = ""
    if flown.course_lag != declared.course_lag:
        words += f", {flown.course_lag:.2f} s of roll lag"
    if flown.course_dead_time != declared.course_dead_time:
        words += f", {flown.course_dead_time:.2f} s of dead time"
    return words


def flight_needs(plan: FlightPlan) -> FlightNeeds:
    """Return what a plan expects of the autopilot."""
    airframe = plan.airframe
    return FlightNeeds(
        airspeed_min=airframe.airspeed_min,
        airspeed_max=airframe.airspeed_max,
        airspeed=plan.task.airspeed,
        max_bank=airframe.max_bank,
        alpha=airframe.alpha,
        rate_hz=plan.rate_hz,
        system_id=plan.system_id,
        slips=plan.slips,
        max_acceleration=airframe.max_acceleration,
    )
