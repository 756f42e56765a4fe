"""One vehicle, navigated and guided: a position report in, the messages of a setpoint out."""

import math
import struct

import msgspec
from msgspec.structs import replace
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.authority import ModeAuthority
from vfguide.companion.learned_response import ResponseLearner
from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan, bandwidth_for, doubting, follower_law, response_of
from vfguide.companion.role import Outgoing, RoleStep, TargetSender
from vfguide.companion.roles import RoleMaker, role_of
from vfguide.companion.steering import Steering
from vfguide.companion.strain_guard import StrainGuard, is_other
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SharedClock
from vfguide.errors import described_error
from vfguide.formation.arrangement import Point
from vfguide.guidance.response import FIRM, TOLD
from vfguide.laws.leader import LeaderTask, PathField, steepest_gain
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.announcements import NOTICE, WARNING, named_value

# The mission's gains are upper bounds: an aircraft that does not bear them is flown with less.

WORTH = 1.05
"""Factor between a written and a flown gain from which the pilot is told."""


class LoweredGain(msgspec.Struct, frozen=True, kw_only=True):
    """Gain that is not flown as written."""

    name: str
    written: float
    """Value in the mission."""
    flown: float
    """Value for this aircraft."""

    def sentence(self, who: str = "this aircraft bears") -> str:
        """Return which value is flown, and why; `who` is the subject with its verb."""
        side = "more" if self.flown < self.written else "less"
        return (
            f"{self.name} {self.written:g} is {side} than {who} ({self.flown:.2g}):"
            f" {self.flown:.2g} is flown"
        )


def lowered_gains(plan: FlightPlan) -> list[LoweredGain]:
    """Return the gains that are not flown as written; none while the response is unknown."""
    certainty = plan.certainty
    known = max(certainty.course.spread, certainty.speed.spread) < TOLD.spread
    if not known or plan.softness != FIRM or plan.asks_response or not plan.learns:
        return []
    if isinstance(plan.task, LeaderTask):
        gains = plan.task.path_gains
        if not (gains.chosen and issubclass(plan.task.law, PathField)):
            return []
        steepest = steepest_gain(bandwidth_for(plan).course, gains, plan.task.airspeed)
        pairs = [("path.gain", gains.gain, min(gains.gain, steepest))]
    else:
        law = follower_law(plan)
        flown = law.gains if plan.airframe.is_ideal else law.for_speed().gains
        pairs = [
            (name, getattr(plan.gains, name), getattr(flown, name))
            for name in sorted(plan.gains.model_fields_set)
            if isinstance(getattr(plan.gains, name), float)
        ]
    return [
        LoweredGain(name=name, written=written, flown=less)
        for name, written, less in pairs
        if written > 0.0 and less > 0.0 and abs(math.log(less / written)) > math.log(WORTH)
    ]


INTERVAL_S = 0.5
"""Interval of one plotted value, s: enough for a ground station's curve, and cheap for a telemetry radio."""

OLD_S = 1.0
"""Age beyond which an error is not sent, s: the curve has a gap there."""

MODE_NUMBERS = {
    Mode.WAITING: 0,
    Mode.JOINING: 1,
    Mode.TRACKING: 2,
    Mode.PREDICTING: 3,
    Mode.BREAKAWAY: 4,
    Mode.LOST: 5,
    Mode.PILOT: 6,
}
"""Values of `form_mode`; users' plots depend on them, so they stay."""


class PlottedValues:
    """Values that one companion sends to be plotted."""

    def __init__(self) -> None:
        self._errors: dict[str, float] = {}
        self._noted_s = self._sent_s = -math.inf

    def note(self, step: RoleStep, now: float) -> None:
        """Take the errors of a guidance step, m; a leader has none along its path."""
        self._noted_s = now
        if math.isnan(step.along_track):
            self._errors = {"path_cross": step.cross_track}
        else:
            self._errors = {
                "slot_along": step.along_track,
                "slot_cross": step.cross_track,
                "slot_up": step.up,
            }

    def due(self, mode: Mode, now: float) -> list[MAVLink_message]:
        """Return the values due now, twice a second; errors only while they are recent and finite."""
        if now - self._sent_s < INTERVAL_S:
            return []
        self._sent_s = now
        values = {"form_mode": float(MODE_NUMBERS[mode])}
        if now - self._noted_s <= OLD_S:
            values |= {name: value for name, value in self._errors.items() if math.isfinite(value)}
        return [named_value(name, value, now) for name, value in values.items()]


FAILURE_S = 10.0
"""Interval of texts about a guidance failure, s."""


class GuidedVehicle:
    """Navigation and guidance of one vehicle, with the results of the last step."""

    slot: Point | None
    """Ordered slot; None for the mission's, and for the leader."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        authority: ModeAuthority,
        clock: SharedClock,
        arrangements: Arrangements,
        *,
        alerts: Alerts,
        sends_target: bool,
        role: RoleMaker = role_of,
    ) -> None:
        self._make_role = role
        self._adapter = adapter
        self._authority = authority
        self._clock = clock
        self._arrangements = arrangements
        self._alerts = alerts
        self._fly_by(plan)
        self._learner = ResponseLearner()
        self._guard = StrainGuard()
        self._gains_of: FlightPlan | None = None
        self._target_sender = TargetSender(plan) if sends_target else None
        self.plotted = PlottedValues()
        """Values that ground stations plot."""
        self.telemetry_time = -math.inf
        """Time of the last guidance step, s."""
        self.interval = math.inf
        """Interval of the last two positions, s."""
        self.distance = math.inf
        """Distance from slot or path, m; infinite while unknown."""
        self.slot = None
        self.lyapunov = math.nan
        """Lyapunov function of the last step that steered, m²; NaN for the leader."""
        self.wind: tuple[float, float] | None = None
        """Wind (north, east) used for guidance, m/s; None while unknown."""
        self.altitude = math.nan
        """m above mean sea level."""
        self.is_ready = False
        """Whether a setpoint fit to fly has been computed."""
        self.has_steered = False
        """Whether a setpoint was ever flown."""

    def _fly_by(self, plan: FlightPlan) -> None:
        self.plan = plan
        """Active flight plan."""
        self.response = response_of(plan)
        """Response of the active plan, for the record."""
        self.own = OwnVehicle(plan, self._alerts)
        """Navigation of the vehicle."""
        self.role = self._make_role(plan, self._clock, self._arrangements, self._alerts)
        self.steering = Steering(plan, self._adapter, self.own, self._alerts)

    def adopt(self, plan: FlightPlan) -> None:
        """Fly by another plan from now on; knowledge of the flight is rebuilt within a second."""
        if plan is self.plan:
            return
        self._arrangements.adopt(plan)
        self._fly_by(plan)

    def learn(self, now: float) -> FlightPlan | None:
        """Return a new plan if the flight has shown another response than the one in use; tell the pilot."""
        own, softness = self.own, self._guard.softness
        flown = doubting(self.plan) if self._guard.doubted else self.plan
        words, plan = self._learner.step(
            flown, own.air.turn_efficiency, now, bank_heard=own.air.bank_heard
        )
        for sentence in words:
            self._alerts.say("response", WARNING, sentence)
        if plan is None and flown != self.plan:
            plan = flown
        if is_other(softness, self.plan.softness):
            plan = replace(plan or self.plan, softness=softness)
        if plan is None:
            return None
        self.plan, self.response = plan, response_of(plan)
        self._arrangements.adopt(plan)
        for part in (self.own, self.role, self.steering):
            part.retune(plan)
        return plan

    def is_given_up(self, now: float) -> bool:
        """Check whether to hand back: no setpoint could be flown, or they throw the vehicle about."""
        return self.steering.closed(now) or self._guard.gives_up

    def step(
        self, navigated: NavigatedState, mode: Mode, now: float, out: Outgoing
    ) -> RoleStep | None:
        """Run one guidance step and share it with the formation; return None without anything to steer by."""
        self.wind = navigated.state.wind_north, navigated.state.wind_east
        self.altitude = navigated.place.altitude_amsl
        self._learner.observe(self.plan, navigated, self.own.air.fresh_bank(now))
        try:
            step = self.role.step(navigated, mode if navigated.steerable else Mode.WAITING)
        except Exception as error:  # noqa: BLE001 - of a law or a path, of one's own or ours
            # Without a step, telemetry counts as lost: the vehicle is handed back soon.
            self._tell_of_failure(error)
            return None
        self.own.belief.most_m = self._arrangements.flight.most_m(navigated.state.time_s)
        if not navigated.steerable:
            out.share(step)
            return None
        self.telemetry_time = now
        self.interval = navigated.interval
        self.distance, self.slot = step.distance, step.slot
        # A vehicle that has left the formation has no slot error.
        if not self._arrangements.flight.has_left:
            self.plotted.note(step, now)
        out.share(step)
        self._tell_followers(step, navigated, out)
        return step

    def steer(
        self, step: RoleStep, navigated: NavigatedState, mode: Mode, now: float, out: Outgoing
    ) -> list[MAVLink_message]:
        """Return the messages that a step sends to the autopilot."""
        ceiling = self._arrangements.flight.ceiling
        setpoint = self.steering.check(step, now, ceiling=ceiling)
        steers = mode.steers and self._authority.is_current(now)
        self.own.note_setpoint(setpoint if mode.steers else None, now)
        self._learner.note(setpoint if steers else None, now)
        if not steers:
            self._guard.reset()
        elif step.keeps_clear:
            # Another vehicle determines how hard it turns.
            self._guard.pause()
        if setpoint is None:
            return []
        self.is_ready = True
        if steers and not step.keeps_clear:
            strain = self._guard.watch(
                navigated.state,
                setpoint,
                self.plan.airframe,
                self.own.air.fresh_bank(now),
                in_place=mode is Mode.TRACKING,
                confirmed=self._learner.confirmed,
            )
            if strain is not None:
                self._alerts.say("strain", WARNING, strain)
        if steers:
            self._tell_of_gains()
            self._authority.note_steering()
            self.lyapunov = step.lyapunov
            out.steered = self.has_steered = True
            return self.steering.fly(setpoint, step.climb_m, navigated, now)
        if mode is not Mode.LOST and self._authority.recognised:
            return self.steering.stay_ready(setpoint, navigated, now)
        return []

    def _tell_of_gains(self) -> None:
        """Tell the pilot once of each gain that this aircraft does not bear."""
        if self._gains_of is self.plan:
            return
        self._gains_of = self.plan
        for one in lowered_gains(self.plan):
            self._alerts.say(f"gain: {one.name}", NOTICE, one.sentence(), quiet_s=math.inf)

    def _tell_of_failure(self, error: Exception) -> None:
        """Tell the pilot, at intervals, that guidance has failed."""
        text = f"guidance fails ({described_error(error)}): take over; mend the law or the path"
        self._alerts.say("guidance", WARNING, text, quiet_s=FAILURE_S)

    def _tell_followers(self, step: RoleStep, navigated: NavigatedState, out: Outgoing) -> None:
        """Send FOLLOW_TARGET to aircraft without a companion; a failure to send ends no flight."""
        if self._target_sender is None:
            return
        try:
            out.to_others = self._target_sender.due(step.motion, navigated)
        except (ValueError, struct.error) as error:
            text = (
                f"FOLLOW_TARGET cannot be sent ({error}): aircraft that follow it are on their own"
            )
            self._alerts.say("follow target", WARNING, text)
