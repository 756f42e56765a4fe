"""Model-free guard against oscillation: setpoints never thrash an aircraft, whatever its assumed response.

An aircraft is strained while its setpoints throw it from side to side for some seconds. Either the commanded
turn or acceleration keeps changing sides while it is great, or the bank angle swings without end. Then all
setpoints are softened at once, the pilot is told once, and quickness returns slowly. If softness does not
help within `PATIENCE_S`, the vehicle is handed back to its autopilot.
"""

import math
from collections import deque
from itertools import pairwise

import msgspec

from vfguide.elementwise import low_pass
from vfguide.guidance.airframe import bank_limited_turn_rate
from vfguide.guidance.response import Softness
from vfguide.state import Airframe, Setpoint, VehicleState

WINDOW_S = 5.0
"""Window of setpoints and bank angles, s."""

JUDGED_S = 0.25
"""Interval of evaluating the window, s: a twentieth of it changes little."""

JOINING_S = 10.0
"""Time after engaging, or arriving, in which an aircraft may come onto its slot as hard as it can, s."""

AT_LIMIT = 0.95
"""Share of a limit that counts as being at it."""

GUSTY = 0.3
"""Share of gusts in the wind's changes from which they, not a manoeuvre, ask for limits."""

LIMIT_SHARE = 0.15
"""Share of the window at a limit that strains a vehicle in its place, in gusts."""

GREAT_COURSE = 0.5
"""Share of the greatest turn rate from which a commanded turn counts as great."""

GREAT_SPEED = 0.5
"""Share of the greatest acceleration from which a commanded acceleration counts as great."""

RESTLESS = 0.045
"""Limit of the root mean square that the low-pass removes, in parts of the greatest, to spare the servos."""

SMOOTHED_S = 0.3
"""Time constant of the low-pass on turn, acceleration and bank, s: shorter inputs move no aircraft."""

SIDES = 3
"""Changes from a great value to one on the other side, within the window, that count as strain."""

SWING = math.radians(75.0)
"""Travel of the bank over the window, beyond one roll into a turn and out of it, that is strain, rad."""

CHATTERS = 10
"""Changes of side within the window that count as strain before the low-pass."""

SOFTER = 0.5
"""Factor on the bandwidth at each step of the guard."""

SOFTER_AT_LIMIT = 0.9
"""Factor on the bandwidth at each step where only limits are reached."""

SOFTEST = 0.08
"""Softness below which nothing is gained."""

AGAIN_S = 2.5
"""Time after which a step of softness shows its effect, s."""

RECOVERY_S = 20.0
"""Time constant with which quickness returns, s."""

PATIENCE_S = 15.0
"""Duration of strain despite softness after which the vehicle is handed back, s."""

STEP = 1.1
"""Factor of change from which a new softness is applied."""

SOFTENED = (
    "the setpoints throw the aircraft from side to side: flown more softly; its response is another than"
    " was said, it is being learned"
)
"""Text for the pilot, once."""

HANDED_BACK = (
    "flown as softly as can be it is still thrown from side to side: handed back; take over, and see how it"
    " answers by `vfguide identify`"
)
"""Text for the pilot when nothing helps."""


class StrainSample(msgspec.Struct, frozen=True, kw_only=True):
    """Commanded and flown motion at one moment."""

    time_s: float
    turn: float
    """Commanded turn rate in parts of the greatest, -1 to 1."""
    turn_at_once: float
    """Commanded turn rate in parts of the greatest, before the low-pass, not limited."""
    push_at_once: float
    """Commanded acceleration in parts of the greatest before the low-pass, not limited."""
    push: float
    """Commanded acceleration in parts of the greatest, -1 to 1."""
    may_shake: bool
    """Whether shaking setpoints are tolerated: in gusts, and for a hold without delays."""
    bank: float
    """Bank angle, rad; NaN if unheard."""
    turn_limited: bool
    """Whether gusts demand the greatest turn rate, while the vehicle is in place."""
    push_limited: bool
    """Whether gusts demand the greatest acceleration, while the vehicle is in place."""


class AxisGuard:
    """Guard of one axis, turns or accelerations, in parts of the greatest."""

    def __init__(self) -> None:
        self.softness = 1.0
        """Factor on the bandwidth of this axis."""
        self.doubted = False
        """Whether the motion contradicts the assumed response."""
        self._softened_s = self._strained_s = -math.inf
        self._since: float | None = None

    def reset(self) -> None:
        """Forget the present strain, as the vehicle is not steered."""
        self._since = None

    def judge(self, now: float, period: float, *, is_strained: bool, is_thrown: bool) -> bool:
        """Soften once the last step has had its time; return whether nothing helps any more.

        `period` is the time since the last call, s. `is_thrown`: the aircraft is better off with its
        autopilot.
        """
        if not is_strained:
            self.softness = min(self.softness * math.exp(period / RECOVERY_S), 1.0)
            if now - self._strained_s > WINDOW_S:
                self._since = None
            return False
        self._strained_s = now
        self.doubted |= is_thrown
        if is_thrown and self._since is None:
            self._since = now
        if now - self._softened_s >= AGAIN_S:
            self._softened_s = now
            self.softness = max((SOFTER if is_thrown else SOFTER_AT_LIMIT) * self.softness, SOFTEST)
        lasts = self._since is not None and now - self._since > PATIENCE_S
        return is_thrown and lasts and self.softness <= SOFTEST


class StrainGuard:
    """Guard of one vehicle's setpoints while it is steered."""

    def __init__(self) -> None:
        self.gives_up = False
        """Whether nothing has helped, so that the vehicle is to be handed back."""
        self._course, self._speed = AxisGuard(), AxisGuard()
        self._moments: deque[StrainSample] = deque()
        self._begun_s: float | None = None
        self._placed_s: float | None = None
        self._judged_s = -math.inf
        self._said = False

    @property
    def softness(self) -> Softness:
        """Factors on the bandwidth of all setpoints."""
        return Softness(course=self._course.softness, speed=self._speed.softness)

    @property
    def doubted(self) -> bool:
        """Whether the assumed course response was found wrong; reading clears it.

        Gusts alone do not throw courses about. They do throw speeds about, where a hold answers at once.
        """
        doubted, self._course.doubted = self._course.doubted, False
        return doubted

    def reset(self) -> None:
        """Forget samples and timers, as the vehicle is not steered."""
        self._moments.clear()
        self._course.reset()
        self._speed.reset()
        self._begun_s = self._placed_s = None
        self.gives_up = False

    def pause(self) -> None:
        """Forget the last samples, which another cause than guidance determined."""
        self._moments.clear()

    def watch(
        self,
        state: VehicleState,
        setpoint: Setpoint,
        airframe: Airframe,
        bank: float | None,
        *,
        in_place: bool,
        confirmed: bool = False,
    ) -> str | None:
        """Take a setpoint that is sent; return a sentence for the pilot, or None.

        Args:
            state: state of the vehicle.
            setpoint: checked, within its limits.
            airframe: assumed response and limits.
            bank: bank angle, rad; None if unheard.
            confirmed: whether the vehicle answers just as assumed: then gusts throw it about, not the loop.
            in_place: whether it is on its slot or path, where nothing asks for a limit for long.
        """
        now = state.time_s
        if not in_place or self._placed_s is None:
            self._placed_s = now
        placed = now - self._placed_s >= JOINING_S
        if self._moments and not 0.0 <= now - self._moments[-1].time_s <= WINDOW_S:
            self._moments.clear()
        greatest = bank_limited_turn_rate(airframe.max_bank, max(state.airspeed, 1.0))
        course_error = math.remainder(setpoint.course - state.course, math.tau)
        held = state.ground_speed if airframe.hold == "course-hold" else state.airspeed
        turn = airframe.alpha * course_error / greatest
        push = airframe.beta * (setpoint.speed - held) / airframe.max_acceleration
        # An airspeed at its bound may be commanded steadily, as on the outside of a turn.
        bounded = not airframe.airspeed_min < setpoint.speed < airframe.airspeed_max
        gusty = placed and float(state.gust_share) > GUSTY
        asked = StrainSample(
            time_s=now,
            turn=min(max(turn, -1.0), 1.0),
            turn_at_once=turn,
            push_at_once=push,
            may_shake=airframe.is_ideal or float(state.gust_share) > GUSTY,
            push=min(max(push, -1.0), 1.0),
            bank=math.nan if bank is None else bank,
            turn_limited=gusty and abs(turn) >= AT_LIMIT,
            push_limited=gusty and bool(setpoint.speed_limited) and not bounded,
        )
        self._moments.append(smoothed(self._moments[-1], asked) if self._moments else asked)
        while now - self._moments[0].time_s > WINDOW_S:
            self._moments.popleft()
        if self._begun_s is None:
            self._begun_s = now
        if now - self._begun_s < JOINING_S or 0.0 <= now - self._judged_s < JUDGED_S:
            return None
        return self._judge(now, confirmed=confirmed)

    def _judge(self, now: float, *, confirmed: bool) -> str | None:
        """Soften strained axes; return a sentence for the pilot, or None."""
        moments = self._moments
        # Time whose samples were forgotten, as after a pause, does not count as recovery.
        period = now - max(self._judged_s, moments[0].time_s)
        self._judged_s = now
        swings = swing([one.bank for one in moments if not math.isnan(one.bank)]) > SWING
        turned = swings or is_thrown([one.turn for one in moments], GREAT_COURSE)
        turned |= is_thrown([one.turn_at_once for one in moments], GREAT_COURSE, CHATTERS)
        turned = turned and not confirmed
        pushed = not confirmed and is_thrown([one.push for one in moments], GREAT_SPEED)
        still = [one for one in moments if not one.may_shake]
        worn = is_restless([one.turn_at_once - one.turn for one in still])
        worn_out = is_restless([one.push_at_once - one.push for one in still])
        turn_limited = sum([one.turn_limited for one in moments]) > LIMIT_SHARE * len(moments)
        push_limited = sum([one.push_limited for one in moments]) > LIMIT_SHARE * len(moments)
        lost = self._course.judge(
            now, period, is_strained=turned or turn_limited or worn, is_thrown=turned
        )
        self._speed.judge(
            now, period, is_strained=pushed or push_limited or worn_out, is_thrown=False
        )
        if lost:
            said, self.gives_up = self.gives_up, True
            return None if said else HANDED_BACK
        if turned:
            said, self._said = self._said, True
            return None if said else SOFTENED
        return None


def is_other(softness: Softness, flown: Softness) -> bool:
    """Check whether a softness differs enough from the one in use."""
    pairs = ((softness.course, flown.course), (softness.speed, flown.speed))
    return any(
        max(new / old, old / new) >= STEP or (new == 1.0 and old < 1.0) for new, old in pairs
    )


def smoothed(before: StrainSample, asked: StrainSample) -> StrainSample:
    """Return a sample after the low-pass."""
    period = asked.time_s - before.time_s
    bank = before.bank
    if not math.isnan(asked.bank):
        bank = asked.bank if math.isnan(bank) else low_pass(bank, asked.bank, period, SMOOTHED_S)
    return StrainSample(
        time_s=asked.time_s,
        turn=low_pass(before.turn, asked.turn, period, SMOOTHED_S),
        turn_at_once=asked.turn_at_once,
        push_at_once=asked.push_at_once,
        may_shake=asked.may_shake,
        push=low_pass(before.push, asked.push, period, SMOOTHED_S),
        bank=bank,
        turn_limited=asked.turn_limited,
        push_limited=asked.push_limited,
    )


def is_thrown(asked: list[float], great: float, sides: int = SIDES) -> bool:
    """Check whether a command changes sides at least `sides` times between values beyond `great`."""
    side, changes = 0.0, 0
    for value in asked:
        if -great < value < great:
            continue
        if side * value < 0.0:
            changes += 1
        side = value
    return changes >= sides


def is_restless(differences: list[float]) -> bool:
    """Check whether noise shakes a command, by its differences from its low-pass, in parts of the greatest.

    Noise changes sides many times; a leader heard once a second makes one jump each time.
    """
    changes = sum(before * after < 0.0 for before, after in pairwise(differences))
    power = sum(one * one for one in differences)
    return changes >= CHATTERS and power > RESTLESS * RESTLESS * len(differences)


def swing(banks: list[float]) -> float:
    """Return the travel of a bank angle beyond twice its range, rad."""
    if len(banks) < 2:
        return 0.0
    way = sum([abs(after - before) for before, after in pairwise(banks)])
    return way - 2.0 * (max(banks) - min(banks))
