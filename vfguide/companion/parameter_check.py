"""What the autopilot's parameters are, asked once at the start and told to the operator in words."""

import math
from collections.abc import Callable

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.narrowed_limits import narrowed_limits
from vfguide.companion.plan import FlightPlan, flown_by
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds, request_parameters
from vfguide.mavlink.reports import ParameterReport
from vfguide.state import Airframe

TRIES = 4
"""How often a parameter is asked for, once a second: autopilots do not answer for names they do not know."""

Tell = Callable[[str], None]


class ParameterCheck:
    """Asks for the parameters that matter, and finds what does not fit the flight."""

    def __init__(self, plan: FlightPlan, adapter: AutopilotAdapter) -> None:
        self.plan = plan
        """With what the autopilot said of itself, once it has and where it is asked for."""
        self._adapter = adapter
        self._known: dict[str, float] = {}
        self._tries = 0
        self._told = False
        self._too_tight: list[str] = []

    def take(self, report: ParameterReport) -> None:
        """Take a parameter, asked for by whomever."""
        if report.name in self._adapter.parameters:
            value = self._adapter.parameter_value(report)
            if math.isfinite(value):
                self._known[report.name] = value

    def faults(self) -> list[str]:
        """What of them speaks against taking off, by their newest values; nothing before all were asked."""
        if not self._told:
            return []
        faults = self._adapter.parameter_faults(self._known, flight_needs(self.plan))
        return faults + self._too_tight

    def requests(self, tell: Tell) -> list[MAVLink_message]:
        """What to ask now; to be called once a second while the autopilot is heard."""
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
    """What is flown by, and what of it costs accuracy, for the pilot.

    Args:
        response: what the autopilot's parameters tell.
        declared: with the mission's response and limits.
        flown: with those that are flown by.
    """
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
    """What is taken for how late the roll is, where the mission does not declare it."""
    words = ""
    if flown.course_lag != declared.course_lag:
        words += f", {flown.course_lag:.2f} s of roll lag"
    if flown.course_dead_time != declared.course_dead_time:
        words += f", {flown.course_dead_time:.2f} s of dead time"
    return words


def flight_needs(plan: FlightPlan) -> FlightNeeds:
    """What a plan expects of the autopilot."""
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
