"""In-flight identification of an aircraft's response: yields a new plan if it contradicts the old one.

Bank angles and course setpoints show the course hold, airspeeds and their setpoints the speed hold. Bank
angle and turn rate show the slip. What is learned overrides what was declared, told or guessed. The pilot
hears of it, with the lines for the mission.
"""

import math

import msgspec

from vfguide.companion.height_keeper import LEAST_CLIMB
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan, answering, banking, turning
from vfguide.elementwise import clip, wrap_angle
from vfguide.guidance.air_data import TurnEfficiency
from vfguide.guidance.airframe import (
    GRAVITY,
    BankLimit,
    BankMoment,
    coordinated_turn_rate,
    held_direction,
    held_speed,
    turning_speed,
)
from vfguide.guidance.response import COURSE, SPEED, TOLD, HoldCertainty, HoldLearner, HoldResponse
from vfguide.state import Airframe, Setpoint, SpeedHold

STEP = 0.02
"""Least change of turn efficiency that changes the plan."""

BANK_STEP = math.radians(1.0)
"""Least change of a bank limit that changes the plan, rad."""

UNHEARD_S = 20.0
"""Time without a bank angle after which the pilot is told, s."""

UNHEARD = (
    "no ATTITUDE is heard, so that slips: auto cannot find out: flown as a vehicle that slips; see that the"
    " autopilot sends it, or write slips: true or false"
)

LEAST_EXPLAINED = 0.5
"""Least share of the motion that a valid model explains."""

SPEED_EXPLAINED = 0.8
"""Least share explained of speeds, which gusts change as much as the hold does."""

ALL_EXPLAINED = 0.97
"""Share of the motion above which a hold counts as first-order."""

WIDEST_SPREAD = 2.0
"""Spread of a gain above which it changes nothing."""

NEWS = 1.5
"""Factor between a new gain and the last one told that makes it worth telling."""

LEFT_RATIO, LEFT_SHARE = 2.0, 0.05
"""A declaration is contradicted if it leaves more motion unexplained than this. Factor on the best model's
rest, and share of the motion added to it."""

LIKENESS: dict[SpeedHold, tuple[float, float]] = {
    "first-order": (1.15, 0.12),
    "total-energy": (2.5, 1.0),
}
"""(Factor between gains, difference of delays in s) that counts as equal, by the kind of hold.

A total-energy hold answers by pitch at once and by throttle later: a first-order model fits it only roughly.
"""

RETUNED_S = 4.0
"""Least time between two changes, s: the effect of one shows before the next."""

JUDGED_S = 0.5
"""Least interval of evaluating what was learned, s."""

SLOWEST_HOLD = 0.5
"""Least acceleration that a speed hold asks for per m/s of error, in the energy check, 1/s."""

SURE_SHARE = 0.75
"""Share of the greatest turn rate up to which course holds are learned: a low bank limit would look slow."""

COORDINATED_SHARE = 1.0
"""Turn efficiency of a vehicle that does not slip."""


class FlownHold(msgspec.Struct, frozen=True, kw_only=True):
    """Response of one hold as guidance assumes it."""

    gain: float
    """1/s."""
    dead_time: float
    """s."""
    lag: float
    """s."""
    certainty: HoldCertainty
    least_explained: float = LEAST_EXPLAINED
    """Share of the motion that a model must explain to replace this one."""
    kind: SpeedHold = "first-order"
    """Kind of the hold: a first-order model fits a total-energy one only roughly."""


class ResponseLearner:
    """Learner of one vehicle's response, and of the plan that fits it."""

    def __init__(self) -> None:
        self._course, self._speed = HoldLearner(COURSE), HoldLearner(SPEED)
        self._bank = BankLimit()
        self._course_wanted: float | None = None
        self.confirmed = False
        """Whether the vehicle takes up courses just as guidance assumes."""
        self._retuned_s = self._judged_s = -math.inf
        self._told: dict[str, float] = {}
        self._speed_wanted: float | None = None
        self._efficiency: float | None = None
        self._slip_said: bool | None = None
        self._since = math.inf
        self._complained = False

    def note(self, setpoint: Setpoint | None, now: float) -> None:
        """Note the setpoint that was sent; None: the vehicle is not steered."""
        if setpoint is None:
            self._course.forget_setpoints()
            self._speed.forget_setpoints()
            self._bank.interrupt()
        else:
            self._course.note(setpoint.course, now)
            self._speed.note(setpoint.speed, now)
        self._speed_wanted = None if setpoint is None else setpoint.speed
        self._course_wanted = None if setpoint is None else setpoint.course

    def observe(self, plan: FlightPlan, navigated: NavigatedState, bank: float | None) -> None:
        """Take the vehicle's motion and its bank angle, rad, positive right; None without a fresh one."""
        state, airframe = navigated.state, plan.airframe
        if navigated.moved:
            self.note(None, state.time_s)
            return
        speed = turning_speed(state, airframe)
        limit = SURE_SHARE * coordinated_turn_rate(airframe.max_bank, speed)
        self._course.observe(
            state.time_s,
            state.course,
            None if bank is None else clip(coordinated_turn_rate(bank, speed), -limit, limit),
            limit=limit,
            angle=True,
            turned=held_direction(state, airframe),
        )
        if bank is not None and self._course_wanted is not None:
            self._bank.observe(
                BankMoment(
                    time_s=state.time_s,
                    bank=bank,
                    asked=speed / GRAVITY * wrap_angle(self._course_wanted - state.course),
                ),
                airframe.course_dead_time + airframe.course_lag + plan.certainty.course.late,
            )
        held = held_speed(state, airframe)
        if self._speed_wanted is not None and is_short_of_energy(
            self._speed_wanted - held, state.airspeed, state.climb_rate, airframe
        ):
            self._speed.interrupt()
            return
        self._speed.observe(state.time_s, held, None, limit=airframe.max_acceleration)

    def step(
        self, plan: FlightPlan, slip: TurnEfficiency, now: float, *, bank_heard: bool
    ) -> tuple[list[str], FlightPlan | None]:
        """Return (sentences for the pilot, new plan or None) by what the flight has shown."""
        if plan.asks_response:
            return [], None
        words, found = self._find_slip(plan, slip, now, bank_heard=bank_heard)
        if plan.learns:
            found = self._find_limit(found, words)
        if now - self._retuned_s < RETUNED_S or now - self._judged_s < JUDGED_S:
            return words, None if found == plan else found
        self._judged_s = now
        share = slip.value if slip.is_known or found.slips else COORDINATED_SHARE
        scaled = share if bank_heard else 1.0
        airframe, certainty = found.airframe, found.certainty
        course = speed = None
        if plan.learns:
            flown = FlownHold(
                gain=airframe.alpha / scaled,
                dead_time=airframe.course_dead_time,
                lag=airframe.course_lag,
                certainty=certainty.course,
            )
            seen = self._course.response()
            course = news_of(self._course, seen, flown)
            self.confirmed = seen is not None and confirms(seen, flown)
        # A creeping hold has its own model, which commands it to more than is wanted.
        if plan.learns and plan.creeping_hold is None:
            speed = news_of(
                self._speed,
                self._speed.response(),
                FlownHold(
                    gain=airframe.beta,
                    dead_time=airframe.speed_dead_time,
                    lag=airframe.speed_lag,
                    certainty=certainty.speed,
                    least_explained=SPEED_EXPLAINED,
                    kind=airframe.speed_hold,
                ),
            )
        if course is not None or speed is not None:
            self._retuned_s = now
            before, found = (
                found,
                answering(
                    found,
                    course=None if course is None else (course, scaled),
                    speed=speed,
                    hold="first-order"
                    if speed is not None and is_first_order(speed)
                    else "total-energy",
                ),
            )
            words += self._sentences(before.airframe, found.airframe, course, speed)
        return words, None if found == plan else found

    def _find_limit(self, plan: FlightPlan, words: list[str]) -> FlightPlan:
        """Return the plan with the greatest bank reached in flight; tell the pilot once."""
        limit = self._bank.value
        known = plan.airframe.max_bank
        if limit is not None and abs(limit - known) < BANK_STEP:
            return plan
        found = banking(plan, limit)
        if (
            found is not plan
            and found.airframe.max_bank < known
            and "max_bank_deg" not in self._told
        ):
            self._told["max_bank_deg"] = math.degrees(known)
            degrees = math.degrees(found.airframe.max_bank)
            words.append(
                f"it banks no further than {degrees:.0f} degrees, and is flown so; for the mission:"
                f" max_bank_deg: {degrees:.0f}"
            )
        return found

    def _sentences(
        self,
        before: Airframe,
        after: Airframe,
        course: HoldResponse | None,
        speed: HoldResponse | None,
    ) -> list[str]:
        """Return texts for the pilot, once per hold, and again after a large change."""
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
        """Check whether a gain is far from the last one told, or else from the one flown before."""
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
        """Return, once, the sentence that slip cannot be found out."""
        self._since = min(self._since, now)
        waits = heard or self._complained or now - self._since < UNHEARD_S
        if waits or not plan.slips:
            return []
        self._complained = True
        return [UNHEARD]


def is_short_of_energy(
    error: float, airspeed: float, climb_rate: float, airframe: Airframe
) -> bool:
    """Check whether climbing or descending leaves less acceleration than a speed hold wants.

    Such a vehicle is late because of its engine or drag, not because of its speed hold.

    Args:
        error: wanted less actual speed, m/s.
        airspeed: m/s.
        climb_rate: m/s, positive up.
        airframe: with the sustained climb and sink rates.
    """
    if abs(climb_rate) < LEAST_CLIMB:
        return False
    wanted = max(airframe.beta, SLOWEST_HOLD) * error
    share = GRAVITY / airspeed
    slowest = -share * (airframe.sink_max + climb_rate)
    fastest = share * (airframe.climb_max - climb_rate)
    return not slowest <= wanted <= fastest


def news_of(
    learner: HoldLearner, found: HoldResponse | None, flown: FlownHold
) -> HoldResponse | None:
    """Return the learned response of a hold if it should replace the one in use; else None."""
    if found is None or found.explained < flown.least_explained:
        return None
    likeness, likeness_s = LIKENESS["first-order" if is_first_order(found) else flown.kind]
    apart = max(found.gain / flown.gain, flown.gain / found.gain)
    late = flown.dead_time + flown.lag
    is_other = apart > likeness or abs(found.late - late) > likeness_s
    if not is_other:
        return found if found.spread * likeness < flown.certainty.spread else None
    impossible = not found.least <= flown.gain <= found.greatest
    if flown.certainty.spread < TOLD.spread or found.spread > WIDEST_SPREAD:
        # A response is replaced only if it explains the flight much worse.
        left = 1.0 - learner.explained_by(flown.gain, flown.dead_time, flown.lag)
        contradicts = left > LEFT_RATIO * (1.0 - found.explained) + LEFT_SHARE
        settled = found.spread <= WIDEST_SPREAD or impossible
        return found if settled and contradicts else None
    return found


def confirms(found: HoldResponse, flown: FlownHold) -> bool:
    """Check whether a learned response agrees with the one in use, and explains all of the motion."""
    late = flown.dead_time + flown.lag
    agrees = found.least <= flown.gain <= found.greatest and found.earliest <= late <= found.latest
    return agrees and is_first_order(found)


def is_first_order(found: HoldResponse) -> bool:
    """Check whether a first-order model explains all of a hold's motion."""
    return found.explained > ALL_EXPLAINED and found.spread < WIDEST_SPREAD


def slip_sentence(efficiency: float, *, slips: bool) -> str:
    """Return the finding on slip as a sentence for the pilot."""
    found = f"it turns {efficiency:.2f} of what its bank says"
    if slips:
        return f"{found}: flown as a vehicle that slips; nothing to do"
    return f"{found}: it does not slip, and is flown so; nothing to do"
