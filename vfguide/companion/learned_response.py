"""What a flight shows of its aircraft's response: another plan where it contradicts the one that is flown.

Bank and course setpoints show the course hold, airspeeds and their setpoints the speed hold, bank and turn
rate the slip. What is learned wins over what was declared, told or guessed. The pilot hears it with the lines
for the mission.
"""

import math

import msgspec

from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan, answering, turning
from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import (
    coordinated_turn_rate,
    held_direction,
    held_speed,
    turning_speed,
)
from vfguide.guidance.bandwidth import TOLD, HoldCertainty
from vfguide.guidance.response import COURSE, SPEED, HoldLearner, HoldResponse
from vfguide.guidance.turn_efficiency import TurnEfficiency
from vfguide.state import Airframe, Setpoint, SpeedHold

STEP = 0.02
"""A turn efficiency that differs by less from the one that is flown by changes nothing."""

UNHEARD_S = 20.0
"""After so long without a bank the pilot hears that there is none."""

UNHEARD = (
    "no ATTITUDE is heard, so that slips: auto cannot find out: flown as a vehicle that slips; see that the"
    " autopilot sends it, or write slips: true or false"
)

AT_LIMIT = 0.85
"""Share of the greatest bank from which a bank says nothing of the course error."""

LEAST_EXPLAINED = 0.5
"""Share of the motion that a model explains, below which it is no model of it."""

WIDEST_SPREAD = 2.0
"""A gain that is known less well changes nothing."""

NEWS = 1.5
"""Factor by which a gain has to differ from the one that the pilot heard last."""

LEFT_RATIO, LEFT_SHARE = 2.0, 0.05
"""A declaration is contradicted where it leaves more than so many times what the best model leaves of the
motion, and such a share of it beside."""

LIKENESS: dict[SpeedHold, tuple[float, float]] = {
    "first-order": (1.15, 0.12),
    "total-energy": (2.5, 1.0),
}
"""(Factor between gains, difference of delays in s) that is none, by the kind of hold. A total-energy hold
answers by pitch at once and by throttle later: a model of first order is only roughly its own."""

RETUNED_S = 4.0
"""Least time between two changes, s: what one of them does is seen before the next."""

COORDINATED_SHARE = 1.0
"""Of the turn that its bank says, of a vehicle that does not slip."""


class FlownHold(msgspec.Struct, frozen=True, kw_only=True):
    """How one hold is taken to answer."""

    gain: float
    """1/s."""
    dead_time: float
    """s."""
    lag: float
    """s."""
    certainty: HoldCertainty
    """How well that is known."""
    likeness: float = LIKENESS["first-order"][0]
    """Factor between two gains that are the same."""
    likeness_s: float = LIKENESS["first-order"][1]
    """Difference of dead time and lag together, s, that is none."""


class ResponseLearner:
    """Watches one vehicle's answers, and finds the plan that fits them."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._course, self._speed = HoldLearner(COURSE), HoldLearner(SPEED)
        self._retuned_s = -math.inf
        self._told: dict[str, float] = {}
        self._direction: tuple[float, float] | None = None
        self._efficiency: float | None = None
        self._slip_said: bool | None = None
        self._since = math.inf
        self._complained = False

    def note(self, setpoint: Setpoint[float] | None, now: float) -> None:
        """A setpoint has gone out; None: the vehicle is not steered."""
        if setpoint is None:
            self._course.forget_setpoints()
            self._speed.forget_setpoints()
        else:
            self._course.note(setpoint.course, now)
            self._speed.note(setpoint.speed, now)

    def observe(self, plan: FlightPlan, navigated: NavigatedState, bank: float | None) -> None:
        """Take how the vehicle moves.

        Args:
            plan: that is flown by.
            navigated: state of the vehicle.
            bank: rad, positive right; None where none is fresh.
        """
        state, airframe = navigated.state, plan.airframe
        if navigated.moved:
            self.note(None, state.time_s)
            self._direction = None
            return
        direction = held_direction(state, airframe)
        before, self._direction = self._direction, (state.time_s, direction)
        if bank is not None:
            turn_rate = coordinated_turn_rate(bank, turning_speed(state, airframe))
        elif before is not None and state.time_s > before[0]:
            turn_rate = wrap_angle(direction - before[1]) / (state.time_s - before[0])
        else:
            return
        limit = AT_LIMIT * coordinated_turn_rate(airframe.max_bank, turning_speed(state, airframe))
        limited = abs(turn_rate) > limit
        self._course.observe(state.time_s, state.course, turn_rate, limited=limited, angle=True)
        self._speed.observe(state.time_s, held_speed(state, airframe), None, limited=False)

    def step(
        self, plan: FlightPlan, slip: TurnEfficiency, now: float, *, bank_heard: bool
    ) -> tuple[list[str], FlightPlan | None]:
        """Return (sentences for the pilot, another plan or None).

        Args:
            plan: that is flown by.
            slip: what was learned of its turns.
            now: s.
            bank_heard: whether the autopilot has ever told a bank.
        """
        if plan.asks_response:
            return [], None
        words, found = self._find_slip(plan, slip, now, bank_heard=bank_heard)
        if now - self._retuned_s < RETUNED_S:
            return words, None if found == plan else found
        share = slip.value if slip.is_known or found.slips else COORDINATED_SHARE
        scaled = share if bank_heard else 1.0
        airframe, certainty = found.airframe, found.certainty
        course = speed = None
        if plan.learns:
            course = news_of(
                self._course,
                FlownHold(
                    gain=airframe.alpha / scaled,
                    dead_time=airframe.course_dead_time,
                    lag=airframe.course_lag,
                    certainty=certainty.course,
                ),
            )
            speed = news_of(
                self._speed,
                FlownHold(
                    gain=airframe.beta,
                    dead_time=airframe.speed_dead_time,
                    lag=airframe.speed_lag,
                    certainty=certainty.speed,
                    likeness=LIKENESS[airframe.speed_hold][0],
                    likeness_s=LIKENESS[airframe.speed_hold][1],
                ),
            )
        if course is not None or speed is not None:
            self._retuned_s = now
            before, found = (
                found,
                answering(found, course=None if course is None else (course, scaled), speed=speed),
            )
            words += self._sentences(before.airframe, found.airframe, course, speed)
        return words, None if found == plan else found

    def _sentences(
        self,
        before: Airframe,
        after: Airframe,
        course: HoldResponse | None,
        speed: HoldResponse | None,
    ) -> list[str]:
        """Return what the pilot hears: once for each hold, and again where that has changed much."""
        words = []
        if course is not None and self._is_news("alpha_1_s", before.alpha, after.alpha):
            words.append(
                f"it takes up courses with alpha {after.alpha:.2f} 1/s,"
                f" {after.course_dead_time + after.course_lag:.1f} s late, and is flown so; for the mission:"
                f" alpha_1_s: {after.alpha:.2f}, course_dead_time_s: {after.course_dead_time:g},"
                f" course_lag_s: {after.course_lag:g}"
            )
        if speed is not None and self._is_news("beta_1_s", before.beta, after.beta):
            words.append(
                f"it takes up speeds with beta {after.beta:.2f} 1/s,"
                f" {after.speed_dead_time + after.speed_lag:.1f} s late, and is flown so; for the mission:"
                f" beta_1_s: {after.beta:.2f}, speed_dead_time_s: {after.speed_dead_time:g},"
                f" speed_lag_s: {after.speed_lag:g}"
            )
        return words

    def _is_news(self, name: str, before: float, after: float) -> bool:
        """Whether a gain is far from the one that was told last, or declared."""
        told = self._told.get(name, before)
        if max(after / told, told / after) < NEWS:
            return False
        self._told[name] = after
        return True

    def _find_slip(
        self, plan: FlightPlan, known: TurnEfficiency, now: float, *, bank_heard: bool
    ) -> tuple[list[str], FlightPlan]:
        """Return (sentences, plan) once banks and turns have shown whether the vehicle slips."""
        if not plan.finds_slip:
            return [], plan
        if not known.is_known:
            return self._unheard(plan, now, heard=bank_heard), plan
        slips = known.slips(before=plan.slips)
        moved = self._efficiency is None or abs(known.value - self._efficiency) >= STEP
        if slips is plan.slips and not moved:
            return [], plan
        self._efficiency = known.value
        news = slips is not self._slip_said and (slips or plan.slips)
        words = [slip_sentence(known.value, slips=slips)] if news else []
        self._slip_said = slips
        return words, turning(plan, known.value, slips=slips)

    def _unheard(self, plan: FlightPlan, now: float, *, heard: bool) -> list[str]:
        """Return the sentence that nothing can be learned, once."""
        self._since = min(self._since, now)
        waits = heard or self._complained or now - self._since < UNHEARD_S
        if waits or not plan.slips:
            return []
        self._complained = True
        return [UNHEARD]


def news_of(learner: HoldLearner, flown: FlownHold) -> HoldResponse | None:
    """Return what was learned of a hold, where that is to be flown by in place of what is; else None."""
    found = learner.response()
    if found is None or found.explained < LEAST_EXPLAINED or found.spread > WIDEST_SPREAD:
        return None
    apart = max(found.gain / flown.gain, flown.gain / found.gain)
    off_s = abs(found.late - flown.dead_time - flown.lag)
    is_other = apart > flown.likeness or off_s > flown.likeness_s
    if flown.certainty.spread < TOLD.spread:
        # Declared, or learned well: only what explains the flight much worse is no longer flown by.
        left = 1.0 - learner.explained_by(flown.gain, flown.dead_time, flown.lag)
        contradicts = left > LEFT_RATIO * (1.0 - found.explained) + LEFT_SHARE
        return found if is_other and contradicts else None
    return found if is_other or found.spread * flown.likeness < flown.certainty.spread else None


def slip_sentence(efficiency: float, *, slips: bool) -> str:
    """Return what was found of the slip, for the pilot."""
    found = f"it turns {efficiency:.2f} of what its bank says"
    if slips:
        return f"{found}: flown as a vehicle that slips; nothing to do"
    return f"{found}: it does not slip, and is flown so; nothing to do"
