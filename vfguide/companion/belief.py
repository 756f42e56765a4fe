"""What is believed of one aircraft: reports are evidence, held against each other and against a prediction.

Witnesses are the place, the velocity over ground and, of the own vehicle, the motion through the air (heading
and airspeed). Each report is compared with where the vehicle must be, carried on from the last believed one:
what is left is an innovation. Manoeuvres explain some of it (`guidance/navigation.py`), the noise of the
reports the rest. Noise is learned from how much successive innovations differ: neither a step nor a steady
drag makes it look greater.

Two that agree outweigh the third. A place that steps is outweighed by the velocity, which carries it on. A
velocity that steps, where the air velocity does not, is outweighed by places and air. What is repeated to
the digit although the aircraft must have moved is no evidence at all: place and velocity that both stand
still are a silence, through which the air motion leads. Where place and velocity part without a step it
cannot be known which of them is false: neither is used.

Whatever is missing, the radius of what is known (m, 95 %) grows. It is steered within `most_m`, which follows
from the spacing of the mission; beyond it the place is still told to the others.

`LIVES` is the whole life of a belief.

What cannot be seen: steps within the tolerance (4 m and six times the noise), positions that drift off by
less than that in `LEAN_S` (1 m/s where noise is 0.3 m), and positions and velocities forged together.
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
"""Reports that stay elsewhere are believed after having agreed with each other for so long: longer than a
receiver's glitches of some seconds last."""

STAYED_S = 30.0
"""The same for one's own vehicle, which flies by them: by then it has been handed to its autopilot, and its
pilot knows."""

LEAST_TOLERANCE_M = 4.0
"""Innovations below this are never a fault: an estimator may correct itself by as much."""

NOISE_FACTOR = 6.0
"""Tolerance in standard deviations of the position noise."""

EXPECTED_NOISE_M = 0.7
"""Standard deviation, per axis, that is assumed before anything is known."""

NOISE_S = 10.0
"""Memory of the noise: over a shorter one a place that has stepped once passes for noise."""

AIR_ERROR_M_S = 2.0
"""How fast a place that is carried through the air may leave the true one: in gusts, 4 m in 2 s. By as much
the wind changes in each second."""

STANDS = "position and velocity do not change in flight"
"""Reason for what is repeated to the digit."""

SPACING_SHARE = 0.25
"""Part of the spacing that a place may be off by: two that are off toward each other keep half of it."""

GREATEST_RADIUS_M = 7.0
"""Most of that: what is over before reports that stay are believed."""

RADIUS_SIGMAS = 2.45
"""95 % of a circular normal distribution, in standard deviations of an axis."""

GREATEST_NOISE_M = GREATEST_RADIUS_M / RADIUS_SIGMAS
"""More noise than this makes no report more credible: nothing could be steered by."""


class Life(Enum):
    """How much is believed."""

    UNKNOWN = "unknown"
    """Nothing yet."""
    SETTLING = "settling"
    """Reports are believed, but no more than others that agree with each other for as long."""
    TRUSTED = "trusted"
    """Reports are believed."""
    COASTING = "coasting"
    """The vehicle is carried on by the witnesses that agree; good enough to steer by."""
    DOUBTED = "doubted"
    """Not good enough to steer by."""


class Evidence(Enum):
    """What one more report comes to."""

    AGREES = "agrees"
    """The witnesses agree."""
    SETTLED = "settled"
    """They have done so for long enough."""
    OUTWEIGHED = "outweighed"
    """One of them is false or missing, others carry on."""
    CONTRADICTED = "contradicted"
    """It cannot be known which is false, or nothing is left."""
    WORN = "worn"
    """What is carried on is too uncertain by now."""
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
"""The life that follows from a life (rows) and what the evidence comes to (columns)."""


NEXT = transitions(LIVES, Life, Evidence)


class Believed(msgspec.Struct, frozen=True):
    """What one more report leaves of a belief."""

    life: Life
    """How much is believed."""
    north: float
    """Of the place to go by, m."""
    east: float
    """Of the place to go by, m."""
    by_place: bool = True
    """Whether the reported place counts; else it is carried on."""
    by_velocity: bool = True
    """Whether the reported velocity counts; else the motion through the air leads."""
    leads: bool = True
    """Whether anything leads on, so that the others can be told of a place."""
    off: float = 0.0
    """How far the report is from where the vehicle must be, m."""
    moved: tuple[float, float] | None = None
    """(north, east) in m from the carried place to the one that is believed now, if it is another one."""
    reason: str | None = None
    """Why it is not believed, in words."""

    @property
    def is_reported(self) -> bool:
        """Whether the report is believed as it is."""
        return self.by_place and self.by_velocity


def radius_limit(spacing: float) -> float:
    """Radius (m) within which an aircraft is steered whose nearest neighbour's slot is that far away, m."""
    return min(max(SPACING_SHARE * spacing, LEAST_TOLERANCE_M), GREATEST_RADIUS_M)


class Belief:
    """What is believed of one aircraft, and how well its place is known."""

    def __init__(self, reach: Reach, *, moved_s: float, most_m: float = GREATEST_RADIUS_M) -> None:
        """Before the first report, which is believed where its speed is possible.

        Args:
            reach: what the vehicle can do.
            moved_s: for how long reports from elsewhere have to agree with each other.
            most_m: radius of a place that may be steered by, m.
        """
        self._reach = reach
        self._moved_s = moved_s
        self._most_m = most_m
        self._variance = EXPECTED_NOISE_M**2
        self.word = OwnWord()
        """What its autopilot says of its own navigation."""
        self.airspeed = Witness()
        """Whether its airspeeds can be used."""
        self._airspeed_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """The next report is the first one."""
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
        """What is believed of its altitudes."""
        self._wind: tuple[float, float] | None = None
        self._contradicts = self._silent = self._velocity_is_false = False
        self.agree_s = RETURN_S
        """For how long doubted reports have to agree before they are believed again, s."""
        self._innovation: tuple[float, float] | None = None
        self._lost_m = 0.0

    @property
    def noise(self) -> float:
        """Standard deviation of the places along an axis, m."""
        return min(math.sqrt(self._variance), GREATEST_NOISE_M)

    @property
    def tolerance(self) -> float:
        """Innovation (m) that noise explains."""
        return LEAST_TOLERANCE_M + NOISE_FACTOR * self.noise

    @property
    def radius(self) -> float:
        """Within which the vehicle is at 95 %, m; infinite while nothing is known."""
        if self._known is None:
            return math.inf
        return RADIUS_SIGMAS * self.noise + self._lost_m

    def lasts_s(self, believed: Believed) -> float:
        """For how long a vehicle that coasts may be steered on, s."""
        witnessed = believed.by_velocity or believed.by_place
        growth = CARRY_ERROR_M_S if witnessed else AIR_ERROR_M_S
        return max(self._most_m - self.radius, 0.0) / growth

    @property
    def doubts(self) -> bool:
        """Whether what was reported last is not believed."""
        return self._doubted_since is not None

    def take_airspeed(self, airspeed: float, expected: float | None, now: float) -> str | None:
        """Hold an airspeed against the one that ground velocity and wind come to.

        Args:
            airspeed: as the sensor shows it, m/s.
            expected: what it should show, m/s; None while not known.
            now: s.

        Returns:
            what is wrong with it, in words.
        """
        slowest, fastest = self._reach.airspeeds
        if expected is None or math.isinf(self._airspeed_s) or not slowest <= expected <= fastest:
            # No aircraft flies like that: it is the known wind that is wrong.
            expected = airspeed
        # A blocked tube shows nothing at all, and no wind that has changed meanwhile explains that.
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
        """Take a report, which has to be later than the one before.

        Args:
            motion: as reported.
            air: velocity (north, east) through the air, m/s; None where it is not known.
            fault: why it is not to be believed whatever it says, if there is a reason; the place after it is
                a new one.
            slack_s: by so much the time since the report before may have been longer than the stamps say.
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
            # The velocity steps, and nothing but the place speaks against it.
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
        """Place and velocity are repeated: no evidence, through which the air motion leads."""
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
        """By how much (m/s) a velocity is off from air and wind, once those and places outweigh it."""
        if air is None or self._wind is None:
            return None
        north = motion.velocity_north - air[0] - self._wind[0]
        east = motion.velocity_east - air[1] - self._wind[1]
        if not (self._velocity_is_false or repeats):
            # What was repeated until now shows nothing of how the velocity changes.
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
        """Judge a report whose velocity is off from what places and air lead to."""
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
        # The place steps as well: the air leads alone.
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
        """The velocity can be true: the position, after the believed one and the newest one?"""
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
        """Whether what agrees now may be believed at once."""
        if self._silent:
            # A silence ends with the first report that fits, as a gap does.
            return True
        if self._doubted_since is None or self.agree_s > RETURN_S:
            return False
        # Time passes, and with it what the velocity could have become: it has to be the former one.
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
        """The place cannot be true: it steps or stands, or it cannot be known what is false."""
        interval_s = motion.time_s - known.time_s
        flown = math.hypot(*innovation(known, motion, stood_s=interval_s))
        if interval_s > UNBROKEN_S and flown <= self.tolerance:
            # It has flown for a part of the time, as after its autopilot was stopped.
            self._elsewhere_s = RETURN_S
        else:
            stepped = math.hypot(*innovation(newest, motion)) > self.tolerance
            self._contradicts = not (repeats or stepped)
            # What parts slowly agrees again only where it does not go on parting.
            self.agree_s = MOVED_S if self._contradicts else RETURN_S
        self._doubt(known)

    def _impossible(
        self, motion: ReportedMotion, air: tuple[float, float] | None = None
    ) -> str | None:
        """What no aircraft does, whatever it did before; a speed that the air outweighs is not looked at."""
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
        """The witnesses that agree carry the vehicle on."""
        self._find(Evidence.WORN if self.radius > self._most_m else Evidence.OUTWEIGHED)
        where = place.north, place.east
        return Believed(self.life, *where, by_place, by_velocity, off=off, reason=reason)

    def _refused(self, motion: ReportedMotion, reason: str) -> Believed:
        """Nothing leads on."""
        self._find(Evidence.CONTRADICTED)
        where = motion.north, motion.east
        return Believed(
            self.life, *where, by_place=False, by_velocity=False, leads=False, reason=reason
        )

    def _agreed(self, motion: ReportedMotion, known: ReportedMotion, off: float) -> Believed:
        """The report is believed as it is."""
        self._known = known
        if self.life is not Life.TRUSTED:
            self._settle()
            long = motion.time_s - self._believed_since >= MOVED_S
            settled = long or self.life is not Life.SETTLING
            self._find(Evidence.SETTLED if settled else Evidence.AGREES)
        return Believed(self.life, motion.north, motion.east, off=off)

    def _adopted(self, motion: ReportedMotion) -> Believed:
        """The vehicle is there, wherever it was thought to be."""
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
        """Nothing is doubted any more."""
        self._doubted_since = self._seen = None
        self._contradicts = self._silent = self._velocity_is_false = False
        self.agree_s = RETURN_S
        self._elsewhere_s = self._moved_s
        self._lost_m = 0.0

    def _stood_still(self, known: ReportedMotion, motion: ReportedMotion) -> bool:
        """Whether a report fits a vehicle that has flown for a part of the time since the one before."""
        interval_s = motion.time_s - known.time_s
        off = math.hypot(*innovation(known, motion, stood_s=interval_s))
        return interval_s > UNBROKEN_S and off <= self.tolerance

    def _doubt(self, known: ReportedMotion) -> None:
        if self._doubted_since is None:
            self._doubted_since = known.time_s

    def _drift(self, motion: ReportedMotion) -> float:
        """How far the carried place may have left the true one since it was last believed, m."""
        if self._doubted_since is None or self._silent:
            return 0.0
        return CARRY_ERROR_M_S * (motion.time_s - self._doubted_since)

    def _watch(self, motion: ReportedMotion, slack_s: float) -> None:
        """Whether doubted reports agree with each other."""
        seen, self._seen = self._seen, motion
        if seen is not None:
            interval_s = motion.time_s - seen.time_s
            turned = velocity_change(seen, motion)
            north, east = innovation(seen, motion, slack_s)
            within = self.tolerance + self._reach.displacement(interval_s)
            turns = turned <= self._reach.velocity_change(interval_s)
            if turns and math.hypot(north, east) <= within:
                # Not the report itself: one that stays behind its velocity a little each time is not steady.
                self._seen = (
                    replace(motion, north=motion.north - north, east=motion.east - east)
                    if self._contradicts or self._velocity_is_false
                    else leaned(motion, north, east, interval_s)
                )
                return
            self._elsewhere_s = self._moved_s
        self._seen_since = motion.time_s

    def _has_moved(self, motion: ReportedMotion) -> bool:
        """Whether doubted reports have been steady for long, where an aircraft could have flown."""
        known, since = self._known, self._doubted_since
        if known is None or since is None:
            return False
        steady_s, believed_s = motion.time_s - self._seen_since, since - self._believed_since
        if believed_s < MOVED_S and steady_s >= max(believed_s, UNBROKEN_S):
            # However far: that the vehicle was at the former place is no surer.
            return True
        if steady_s < self._elsewhere_s:
            return False
        far = math.hypot(motion.north - known.north, motion.east - known.east)
        return far <= self._reach.speed * (motion.time_s - since)

    def _learn_noise(self, north: float, east: float, interval_s: float) -> None:
        """Both axes of two innovations: the mean square of their difference is four variances."""
        before, self._innovation = self._innovation, (north, east)
        if before is None:
            return
        if not 0.0 < interval_s <= UNBROKEN_S:
            self._innovation = None
            return
        differ = math.hypot(north - before[0], east - before[1])
        # One step, however far, is no noise.
        squared = min(differ, NOISE_FACTOR * GREATEST_NOISE_M) ** 2
        share = min(interval_s / NOISE_S, 0.1)
        self._variance += share * (0.25 * squared - self._variance)
