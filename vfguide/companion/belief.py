"""Belief in one aircraft's reports: evidence compared with other witnesses and with a prediction.

The witnesses are position, ground velocity and, for the own vehicle, motion through the air (heading and
airspeed). An innovation is a report's difference from the prediction by the last believed one. Manoeuvres
explain part of it (`guidance/navigation.py`), noise the rest. Noise is learned from the differences of
successive innovations, so that neither a step nor a steady drift inflates it.

Two witnesses that agree outweigh the third. Velocity outweighs a position that steps, and carries it on.
Positions and air velocity outweigh a ground velocity that steps alone. A report repeated to the digit by a
moving aircraft is no evidence. If both position and velocity repeat, the air motion bridges the silence. If
position and velocity part without a step, either may be false: neither is used.

While evidence is missing, the 95 % radius of the position (m) grows. The vehicle is steered within `most_m`,
which follows from the spacing of the slots; beyond it the position is still sent to the others.

`LIVES` is the state machine of a belief.

Steps within the tolerance (4 m plus six times the noise) stay undetected. So do a drift below it in `LEAN_S`
(1 m/s at 0.3 m noise), and positions and velocities forged together.
"""

import math
from enum import Enum

import msgspec
from msgspec.structs import replace

from vfguide.companion.witnesses import (
    CARRY_ERROR_M_S,
    MOVING_M_S,
    RETURN_S,
    HeightBelief,
    OwnWord,
    Repeats,
    Witness,
)
from vfguide.guidance.navigation import (
    UNBROKEN_S,
    UNDERSPEED,
    VELOCITY_TOLERANCE_M_S,
    Reach,
    ReportedMotion,
    innovation,
    leaned,
    velocity_change,
)
from vfguide.transitions import transitions

MOVED_S = 5.0
"""Time for which deviating reports must agree to be adopted, s: longer than receiver glitches last."""

STAYED_S = 30.0
"""Replaces `MOVED_S` for the own vehicle, s: by then its autopilot has it back, and its pilot knows."""

LEAST_TOLERANCE_M = 4.0
"""Smaller innovations are never a fault: an estimator may correct itself by as much."""

NOISE_FACTOR = 6.0
"""Tolerance in standard deviations of the position noise."""

EXPECTED_NOISE_M = 0.7
"""Standard deviation per axis assumed before any is learned."""

NOISE_S = 10.0
"""Memory of the noise estimate: over a shorter one, a single position step passes for noise."""

AIR_ERROR_M_S = 2.0
"""Drift of a position carried through the air: in gusts, 4 m in 2 s. Also the wind's change per second."""

STANDS = "position and velocity do not change in flight"
"""Reason for reports that repeat to the digit."""

SPACING_SHARE = 0.25
"""Position error allowed, in parts of the spacing: two that are off toward each other keep half of it."""

GREATEST_RADIUS_M = 7.0
"""Upper bound of `radius_limit`, m: smaller errors are over before a lasting deviation is believed."""

RADIUS_SIGMAS = 2.45
"""95 % of a circular normal distribution, in standard deviations of one axis."""

GREATEST_NOISE_M = GREATEST_RADIUS_M / RADIUS_SIGMAS
"""More noise makes no report more credible: nothing could be steered by it."""


class Life(Enum):
    """Degree of belief."""

    UNKNOWN = "unknown"
    SETTLING = "settling"
    """Reports are believed, but any others that agree for as long may replace them."""
    TRUSTED = "trusted"
    """Reports are believed."""
    COASTING = "coasting"
    """Agreeing witnesses carry the vehicle on; good enough to steer by."""
    DOUBTED = "doubted"
    """Not good enough to steer by."""


class Evidence(Enum):
    """Outcome of one more report."""

    AGREES = "agrees"
    SETTLED = "settled"
    """The witnesses have agreed for long enough."""
    OUTWEIGHED = "outweighed"
    """One witness is false or missing; others carry on."""
    CONTRADICTED = "contradicted"
    """The false witness cannot be identified, or none is left."""
    WORN = "worn"
    """The carried position is too uncertain by now."""
    MOVED = "moved"
    """Reports from elsewhere have agreed for long enough."""


LIVES = """
|           | agrees   | settled | outweighed | contradicted | worn    | moved    |
| --------- | -------- | ------- | ---------- | ------------ | ------- | -------- |
| unknown   | settling | trusted | unknown    | unknown      | unknown | settling |
| settling  | settling | trusted | coasting   | doubted      | doubted | settling |
| trusted   | trusted  | trusted | coasting   | doubted      | doubted | settling |
| coasting  | coasting | trusted | coasting   | doubted      | doubted | settling |
| doubted   | doubted  | trusted | doubted    | doubted      | doubted | settling |
"""
"""Next life by life (rows) and evidence (columns)."""


NEXT = transitions(LIVES, Life, Evidence)


class Believed(msgspec.Struct, frozen=True):
    """Belief after one more report."""

    life: Life
    north: float
    """Position to use, north, m."""
    east: float
    """Position to use, east, m."""
    by_place: bool = True
    """Whether the reported position counts; else the position is carried on."""
    by_velocity: bool = True
    """Whether the reported velocity counts; else the motion through the air leads."""
    leads: bool = True
    """Whether any witness carries the position on, so that the others can be told of one."""
    off: float = 0.0
    """Distance from the report to the prediction, m."""
    moved: tuple[float, float] | None = None
    """Displacement (north, east) from the carried to a newly adopted position, m; None without one."""
    reason: str | None = None
    """Reason for disbelief."""

    @property
    def is_reported(self) -> bool:
        """Whether the report is believed unchanged."""
        return self.by_place and self.by_velocity


def radius_limit(spacing: float) -> float:
    """Return the position radius up to which a vehicle is steered, by the spacing of the nearest slot, m."""
    return min(max(SPACING_SHARE * spacing, LEAST_TOLERANCE_M), GREATEST_RADIUS_M)


class Belief:
    """Belief in one aircraft's reports, and the uncertainty of its position."""

    def __init__(self, reach: Reach, *, moved_s: float) -> None:
        """Start without reports; the first is believed if its speed is possible.

        Deviating reports must agree for `moved_s`.
        """
        self._reach = reach
        self._moved_s = moved_s
        self.most_m = GREATEST_RADIUS_M
        """Greatest position radius to steer by, m."""
        self._variance = EXPECTED_NOISE_M**2
        self.word = OwnWord()
        """Autopilot's own word on its navigation."""
        self.airspeed = Witness()
        """Whether its airspeeds can be used."""
        self._airspeed_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """Treat the next report as the first one."""
        self.life = Life.UNKNOWN
        self._known: ReportedMotion | None = None
        self._believed_since = 0.0
        self._doubted_since: float | None = None
        self._seen: ReportedMotion | None = None
        self._seen_since = 0.0
        self._elsewhere_s = self._moved_s
        self._newest: ReportedMotion | None = None
        self._repeats = Repeats()
        self.height = HeightBelief()
        """Belief in its altitudes."""
        self._wind: tuple[float, float] | None = None
        self._contradicts = self._silent = self._velocity_is_false = False
        self.agree_s = RETURN_S
        """Time for which doubted reports must agree before they are believed again, s."""
        self._innovation: tuple[float, float] | None = None
        self._lost_m = 0.0

    @property
    def noise(self) -> float:
        """Standard deviation of the positions along one axis, m."""
        return min(math.sqrt(self._variance), GREATEST_NOISE_M)

    @property
    def tolerance(self) -> float:
        """Innovation that noise explains, m."""
        return LEAST_TOLERANCE_M + NOISE_FACTOR * self.noise

    @property
    def radius(self) -> float:
        """95 % radius of the position, m; infinite while nothing is known."""
        if self._known is None:
            return math.inf
        return RADIUS_SIGMAS * self.noise + self._lost_m

    def lasts_s(self, believed: Believed) -> float:
        """Return for how long a coasting vehicle may be steered on, s."""
        witnessed = believed.by_velocity or believed.by_place
        growth = CARRY_ERROR_M_S if witnessed else AIR_ERROR_M_S
        return max(self.most_m - self.radius, 0.0) / growth

    @property
    def doubts(self) -> bool:
        """Whether the newest report is disbelieved."""
        return self._doubted_since is not None

    def take_airspeed(self, airspeed: float, expected: float | None, now: float) -> str | None:
        """Compare an airspeed with the one implied by ground velocity and wind (m/s); return a mismatch."""
        slowest, fastest = self._reach.airspeeds
        if expected is None or math.isinf(self._airspeed_s) or not slowest <= expected <= fastest:
            # No aircraft flies that fast or slow: the wind estimate is wrong.
            expected = airspeed
        # A blocked tube shows nothing at all, which no change of wind explains.
        most = max(UNDERSPEED * expected, VELOCITY_TOLERANCE_M_S)
        within = min(VELOCITY_TOLERANCE_M_S + AIR_ERROR_M_S * (now - self._airspeed_s), most)
        possible = 0.0 <= airspeed <= fastest
        if self.airspeed.judge(airspeed, expected, within if possible else -1.0, now):
            self._airspeed_s = now
        if possible and abs(airspeed - expected) <= within:
            return None
        instead = f" instead of {expected:.0f}" if possible else ""
        return f"an airspeed of {airspeed:.0f} m/s{instead}"

    def take(
        self,
        motion: ReportedMotion,
        *,
        air: tuple[float, float] | None = None,
        fault: str | None = None,
        slack_s: float = 0.0,
    ) -> Believed:
        """Take a report, which must be later than the one before.

        Args:
            motion: as reported.
            air: velocity (north, east) through the air, m/s; None where unknown.
            fault: external reason to disbelieve the report; the position after it counts as a new one.
            slack_s: by this much the time since the report before may be longer than the stamps say, s.
        """
        known, newest, self._newest = self._known, self._newest, motion
        place_repeats, velocity_repeats = self._repeats.take(newest, motion, air, self.noise)
        lie = fault or self._impossible(motion, air)
        if lie is not None:
            if known is not None:
                self._doubt(known)
            self._seen, self._silent = None, False
            if fault is not None:
                self._elsewhere_s = RETURN_S
            return self._refused(motion, lie)
        if known is None or newest is None:
            return self._adopted(motion)
        if place_repeats and velocity_repeats:
            return self._silence(known, motion, motion.time_s - newest.time_s, air)
        off_air = self._off_air(newest, motion, air, repeats=velocity_repeats)
        if off_air is not None:
            return self._outweigh_velocity(
                known, motion, off_air, slack_s, repeats=velocity_repeats
            )
        turned = velocity_change(known, motion)
        if turned > self._reach.velocity_change(motion.time_s - known.time_s):
            # The velocity steps, and only the position contradicts it.
            self._doubt(known)
            self._contradicts, self._silent = True, False
            self._watch(motion, slack_s)
            reason = f"the velocity steps by {turned:.0f} m/s"
            has_moved = self._has_moved(motion)
            return self._adopted(motion) if has_moved else self._refused(motion, reason)
        if air is not None:
            self._wind = (motion.velocity_north - air[0], motion.velocity_east - air[1])
        return self._judge_place(known, newest, motion, slack_s, repeats=place_repeats)

    def _silence(
        self,
        known: ReportedMotion,
        motion: ReportedMotion,
        passed_s: float,
        air: tuple[float, float] | None,
    ) -> Believed:
        """Treat a repeated position and velocity as a silence: only the air motion can lead."""
        if self._doubted_since is None:
            self._silent = True
        self._doubt(known)
        self._seen = None
        self._lost_m += AIR_ERROR_M_S * passed_s
        if air is None or self._wind is None or motion.speed < MOVING_M_S:
            return self._refused(motion, STANDS)
        return self._carried(known, STANDS, by_velocity=False)

    def _off_air(
        self,
        newest: ReportedMotion,
        motion: ReportedMotion,
        air: tuple[float, float] | None,
        *,
        repeats: bool,
    ) -> tuple[float, float] | None:
        """Return a velocity's deviation (north, east) from air plus wind, m/s; None unless outweighed."""
        if air is None or self._wind is None:
            return None
        north = motion.velocity_north - air[0] - self._wind[0]
        east = motion.velocity_east - air[1] - self._wind[1]
        if not (self._velocity_is_false or repeats):
            # Repeats until now show nothing of how the velocity changed.
            passed_s = math.inf if self._silent else motion.time_s - newest.time_s
            steps = velocity_change(newest, motion) > self._reach.velocity_change(passed_s)
            gust = VELOCITY_TOLERANCE_M_S + AIR_ERROR_M_S * passed_s
            if not (steps and math.hypot(north, east) > gust):
                return None
        return north, east

    def _outweigh_velocity(
        self,
        known: ReportedMotion,
        motion: ReportedMotion,
        off_air: tuple[float, float],
        slack_s: float,
        *,
        repeats: bool,
    ) -> Believed:
        """Judge a report whose velocity deviates from positions and air velocity."""
        off_north, off_east = off_air
        off_m_s = math.hypot(off_north, off_east)
        self._velocity_is_false = True
        self._doubt(known)
        self._watch(motion, slack_s)
        right = replace(
            motion,
            velocity_north=motion.velocity_north - off_north,
            velocity_east=motion.velocity_east - off_east,
        )
        interval_s = motion.time_s - known.time_s
        north, east = innovation(known, right, slack_s)
        off = math.hypot(north, east)
        agrees = off <= self.tolerance + self._reach.displacement(interval_s)
        brief = motion.time_s - (self._doubted_since or 0.0) <= UNBROKEN_S
        near = off_m_s <= VELOCITY_TOLERANCE_M_S
        if repeats:
            self._seen_since = motion.time_s
        elif agrees and ((brief and near) or motion.time_s - self._seen_since >= RETURN_S):
            return self._agreed(motion, motion, off)
        if agrees:
            self._known, self._lost_m = right, self._lost_m + CARRY_ERROR_M_S * interval_s
            reason = f"the velocity steps by {off_m_s:.0f} m/s"
            if motion.speed > self._reach.speed:
                reason = f"a speed of {motion.speed:.0f} m/s"
            elif repeats:
                reason = "the velocity does not change in a turn"
            return self._carried(right, reason, by_place=True, by_velocity=False)
        if self._has_moved(motion):
            return self._adopted(motion)
        # The position steps as well: the air motion leads alone.
        self._lost_m += AIR_ERROR_M_S * interval_s
        self._known = replace(right, north=right.north - north, east=right.east - east)
        reason = "position and velocity contradict each other, and the motion through the air"
        return self._carried(self._known, reason, by_velocity=False)

    def _judge_place(
        self,
        known: ReportedMotion,
        newest: ReportedMotion,
        motion: ReportedMotion,
        slack_s: float,
        *,
        repeats: bool,
    ) -> Believed:
        """Judge the position of a report whose velocity is plausible."""
        interval_s = motion.time_s - known.time_s
        north, east = innovation(known, motion, slack_s)
        off = math.hypot(north, east)
        self._learn_noise(north, east, interval_s)
        within = off <= self.tolerance + self._reach.displacement(interval_s) + self._drift(motion)
        agrees = within and not repeats
        if not agrees and self._doubted_since is None:
            self._begin_doubt(known, newest, motion, repeats=repeats)
        if self._doubted_since is not None:
            self._watch(motion, slack_s)
            brief = self._is_brief(known, motion)
            self._silent = False
            if agrees and (brief or motion.time_s - self._seen_since >= self.agree_s):
                self._settle()
        if self._doubted_since is None:
            return self._agreed(motion, leaned(motion, north, east, interval_s), off)
        if not agrees and self._has_moved(motion):
            return self._adopted(motion)
        if self._contradicts:
            self._lost_m = max(self._lost_m, off)
            return self._refused(motion, "position and velocity contradict each other")
        self._known = replace(motion, north=motion.north - north, east=motion.east - east)
        self._lost_m += CARRY_ERROR_M_S * interval_s
        if self._doubted_since - self._believed_since < UNBROKEN_S:
            return self._refused(motion, "the first positions do not agree with each other")
        reason = "the position has just come back"
        if not within:
            reason = f"the position is {off:.0f} m from where it can be"
        elif repeats:
            reason = "the position does not change in flight"
        return self._carried(self._known, reason, off=off)

    def _is_brief(self, known: ReportedMotion, motion: ReportedMotion) -> bool:
        """Check whether an agreeing report may be believed at once."""
        if self._silent:
            # Like a gap, a silence ends with the first report that fits.
            return True
        if self._doubted_since is None or self.agree_s > RETURN_S:
            return False
        # With time any velocity becomes possible: only the former one is proof.
        former = velocity_change(known, motion) <= VELOCITY_TOLERANCE_M_S
        brief = motion.time_s - self._doubted_since <= UNBROKEN_S
        return brief and (former or not self._contradicts)

    def _begin_doubt(
        self,
        known: ReportedMotion,
        newest: ReportedMotion,
        motion: ReportedMotion,
        *,
        repeats: bool,
    ) -> None:
        """Begin to doubt: the position steps or stands still, or the false witness is unknown."""
        interval_s = motion.time_s - known.time_s
        flown = math.hypot(*innovation(known, motion, stood_s=interval_s))
        if interval_s > UNBROKEN_S and flown <= self.tolerance:
            # It has flown for only part of the time, as after a stop of its autopilot.
            self._elsewhere_s = RETURN_S
        else:
            stepped = math.hypot(*innovation(newest, motion)) > self.tolerance
            self._contradicts = not (repeats or stepped)
            # Witnesses that part slowly agree again only if they stop parting.
            self.agree_s = MOVED_S if self._contradicts else RETURN_S
        self._doubt(known)

    def _impossible(
        self, motion: ReportedMotion, air: tuple[float, float] | None = None
    ) -> str | None:
        """Return a flaw that rules the report out by itself; known air velocity judges speed instead."""
        speed = motion.speed
        if not math.isfinite(speed + motion.north + motion.east + motion.time_s):
            return "the position is no number"
        if air is not None and self._wind is not None:
            return None
        return f"a speed of {speed:.0f} m/s" if speed > self._reach.speed else None

    def _find(self, finding: Evidence) -> None:
        self.life = NEXT[self.life][finding]

    def _carried(
        self,
        place: ReportedMotion,
        reason: str,
        *,
        by_place: bool = False,
        by_velocity: bool = True,
        off: float = 0.0,
    ) -> Believed:
        """Carry the vehicle on by the witnesses that agree."""
        self._find(Evidence.WORN if self.radius > self.most_m else Evidence.OUTWEIGHED)
        where = place.north, place.east
        return Believed(self.life, *where, by_place, by_velocity, off=off, reason=reason)

    def _refused(self, motion: ReportedMotion, reason: str) -> Believed:
        """Refuse the report; no witness carries the vehicle on."""
        self._find(Evidence.CONTRADICTED)
        where = motion.north, motion.east
        return Believed(
            self.life, *where, by_place=False, by_velocity=False, leads=False, reason=reason
        )

    def _agreed(self, motion: ReportedMotion, known: ReportedMotion, off: float) -> Believed:
        """Believe the report unchanged."""
        self._known = known
        if self.life is not Life.TRUSTED:
            self._settle()
            long = motion.time_s - self._believed_since >= MOVED_S
            settled = long or self.life is not Life.SETTLING
            self._find(Evidence.SETTLED if settled else Evidence.AGREES)
        return Believed(self.life, motion.north, motion.east, off=off)

    def _adopted(self, motion: ReportedMotion) -> Believed:
        """Adopt the reported position, wherever the vehicle was believed to be."""
        known, moved = self._known, None
        self._believed_since = motion.time_s
        if known is not None:
            self._believed_since = self._seen_since
            moved = innovation(known, motion)
        self._known, self._innovation = motion, None
        self._settle()
        self._find(Evidence.MOVED)
        return Believed(
            self.life,
            motion.north,
            motion.east,
            off=0.0 if moved is None else math.hypot(*moved),
            moved=moved,
        )

    def _settle(self) -> None:
        """End all doubts."""
        self._doubted_since = self._seen = None
        self._contradicts = self._silent = self._velocity_is_false = False
        self.agree_s = RETURN_S
        self._elsewhere_s = self._moved_s
        self._lost_m = 0.0

    def _doubt(self, known: ReportedMotion) -> None:
        if self._doubted_since is None:
            self._doubted_since = known.time_s

    def _drift(self, motion: ReportedMotion) -> float:
        """Return how far the carried position may have drifted since its last belief, m."""
        if self._doubted_since is None or self._silent:
            return 0.0
        return CARRY_ERROR_M_S * (motion.time_s - self._doubted_since)

    def _watch(self, motion: ReportedMotion, slack_s: float) -> None:
        """Note since when doubted reports agree with each other."""
        seen, self._seen = self._seen, motion
        if seen is not None:
            interval_s = motion.time_s - seen.time_s
            turned = velocity_change(seen, motion)
            north, east = innovation(seen, motion, slack_s)
            within = self.tolerance + self._reach.displacement(interval_s)
            turns = turned <= self._reach.velocity_change(interval_s)
            if turns and math.hypot(north, east) <= within:
                # Not the report itself: reports that keep lagging behind their velocity are not steady.
                self._seen = (
                    replace(motion, north=motion.north - north, east=motion.east - east)
                    if self._contradicts or self._velocity_is_false
                    else leaned(motion, north, east, interval_s)
                )
                return
            self._elsewhere_s = self._moved_s
        self._seen_since = motion.time_s

    def _has_moved(self, motion: ReportedMotion) -> bool:
        """Check whether doubted reports have been steady for long, at a position within reach."""
        known, since = self._known, self._doubted_since
        if known is None or since is None:
            return False
        steady_s, believed_s = motion.time_s - self._seen_since, since - self._believed_since
        if believed_s < MOVED_S and steady_s >= max(believed_s, UNBROKEN_S):
            # At any distance: that the vehicle was at the former position is no surer.
            return True
        if steady_s < self._elsewhere_s:
            return False
        far = math.hypot(motion.north - known.north, motion.east - known.east)
        return far <= self._reach.speed * (motion.time_s - since)

    def _learn_noise(self, north: float, east: float, interval_s: float) -> None:
        """Learn the noise; the mean square difference of two innovations (two axes) is four variances."""
        before, self._innovation = self._innovation, (north, east)
        if before is None:
            return
        if not 0.0 < interval_s <= UNBROKEN_S:
            self._innovation = None
            return
        differ = math.hypot(north - before[0], east - before[1])
        # A single step is no noise, however far it goes.
        squared = min(differ, NOISE_FACTOR * GREATEST_NOISE_M) ** 2
        share = min(interval_s / NOISE_S, 0.1)
        self._variance += share * (0.25 * squared - self._variance)
