"""Whether a reported motion can be true: an innovation gate on position and velocity.

A report is compared with where the vehicle must be, carried on from the last believed one by the reported
velocities. With a greatest acceleration a, a manoeuvre that begins within an interval T leaves the place open
by a T² / 8; the gate allows a margin of two in a. To that comes the noise of the reports, which is learned
from how much successive innovations differ. Neither a step nor a steady drag makes it look noisier.

A position that fails is not used. While velocities pass, the place is carried on by them for `CARRIED_S`.
Reports that agree with the carried place again are believed after `RETURN_S` of agreeing with each other;
those that stay elsewhere after `MOVED_S` of it, one's own after `STAYED_S`, and not before an aircraft could
have flown there. Two kinds of elsewhere need `RETURN_S` only: a place that follows a time for which the
autopilot itself said that it did not know the place, and one as far back along the course as a gap in the
reports explains. An autopilot in software that is stopped for a second is behind by a second's flight.

A position that leaves the carried place without a step, and is not stuck, or a velocity that steps, says
that positions and velocities contradict each other, not which of them is false: neither is used until
velocities alone have led from place to place for `RETURN_S`.

The first report is believed until one does not agree with it. A place that has been believed for less than
`MOVED_S` is no surer than reports from elsewhere that have agreed with each other for as long, and for
`START_S`: these replace it. One that was contradicted within `START_S` is not used at all.

What cannot be seen: steps within the tolerance (4 m and six times the noise), positions that drift off by
less than that in `LEAN_S` (2 m/s where noise is 0.3 m), and positions and velocities forged together.
"""

import math
from enum import Enum
from typing import NamedTuple

import msgspec

from vfguide.guidance.airframe import GRAVITY
from vfguide.state import Airframe

START_S = 0.4
"""Reports that contradict a place that has only just been believed have to agree for at least this."""

RETURN_S = 2.0
"""Reports that come back to the carried place are believed after having agreed with each other for this."""

MOVED_S = 5.0
"""Reports that stay elsewhere are believed after having agreed with each other for so long: longer than a
receiver's glitches of some seconds last."""

STAYED_S = 30.0
"""The same for one's own vehicle, which flies by them: by then it has been handed to its autopilot, and its
pilot knows."""

CARRIED_S = 5.0
"""For so long the place is carried on by velocities: at an error of 0.5 m/s that is 2.5 m."""

BRIEF_S = 0.5
"""After less than this of wrong reports, right ones are believed at once: a frame or two were forged."""

LEAN_S = 3.0
"""Memory of the carried place: how long it takes to lean on believed positions."""

LEAST_TOLERANCE_M = 4.0
"""Innovations below this are never a fault: an estimator may correct itself by as much."""

NOISE_FACTOR = 6.0
"""Tolerance in standard deviations of the position noise."""

EXPECTED_NOISE_M = 0.7
"""Standard deviation, per axis, that is assumed before anything is known."""

GREATEST_NOISE_M = 3.0
"""More noise than this does not make the gate any wider."""

NOISE_S = 10.0
"""Memory of the noise."""

UNBROKEN_S = 0.5
"""After a longer gap an innovation says nothing of the noise, and the carried place nothing any more."""

STOOD_S = 0.3
"""After a longer gap an autopilot may have been stopped."""

VELOCITY_TOLERANCE_M_S = 4.0
"""Noise and corrections of reported velocities."""

CARRY_ERROR_M_S = 0.5
"""How fast a place that is carried by velocities may leave the true one."""

LEAST_ACCELERATION_M_S2 = 20.0
"""What any airframe can do in a pilot's hands."""

MARGIN = 2.0
"""Over the acceleration that a vehicle is asked for at most: gusts, and pilots."""

OVERSPEED = 1.5
"""Speed of a dive in parts of the greatest speed that a vehicle may be asked for."""

GREATEST_WIND_M_S = 40.0
"""No wind that these aircraft fly in is stronger."""


class Reach(msgspec.Struct, frozen=True, kw_only=True):
    """What an aircraft can do between two reports."""

    speed: float
    """Greatest speed over ground, m/s."""
    acceleration: float
    """Greatest change of the horizontal velocity, m/s²."""

    def velocity_change(self, interval_s: float) -> float:
        """By how much the reported velocity can change, m/s."""
        return VELOCITY_TOLERANCE_M_S + self.acceleration * interval_s

    def displacement(self, interval_s: float) -> float:
        """How far the place can be from the one that the mean of both velocities leads to, m."""
        # a T² / 8, a being the acceleration without its margin of two.
        return min(0.0625 * self.acceleration * interval_s**2, 2.0 * self.speed * interval_s)


def reach_of(airframe: Airframe) -> Reach:
    """What a vehicle with these limits can do, in a pilot's hands and in gusts too."""
    asked = GRAVITY * math.tan(airframe.max_bank) + airframe.max_acceleration
    return Reach(
        speed=OVERSPEED * airframe.airspeed_max + GREATEST_WIND_M_S,
        acceleration=max(MARGIN * asked, LEAST_ACCELERATION_M_S2),
    )


class ReportedMotion(NamedTuple):
    """Position and velocity at a time."""

    time_s: float
    """s, on any clock that runs evenly."""
    north: float
    """m."""
    east: float
    """m."""
    velocity_north: float
    """Over ground, m/s."""
    velocity_east: float
    """Over ground, m/s."""

    @property
    def speed(self) -> float:
        """Over ground, m/s."""
        return math.hypot(self.velocity_north, self.velocity_east)


class GateVerdict(Enum):
    """What becomes of a report."""

    BELIEVED = "believed"
    """It can be true."""
    CARRIED = "carried"
    """The position cannot; the place is carried on by the velocity, which can."""
    ADRIFT = "adrift"
    """The same for too long to steer by it; it tells others where the vehicle is, more or less."""
    REFUSED = "refused"
    """Nothing of it is used."""


class Judgement(NamedTuple):
    """A verdict, and what goes with it."""

    verdict: GateVerdict
    """What becomes of the report."""
    north: float
    """Of the place to go by, m."""
    east: float
    """Of the place to go by, m."""
    off: float = 0.0
    """How far the report is from where the vehicle must be, m."""
    moved: tuple[float, float] | None = None
    """(north, east) in m from the carried place to the one that is believed now, if it is another one."""
    reason: str | None = None
    """Why it is not believed, in words."""


def carried(motion: ReportedMotion, to: ReportedMotion) -> tuple[float, float]:
    """(north, east) of a place that is carried to the time of another motion by the mean velocity of both."""
    half = 0.5 * (to.time_s - motion.time_s)
    return (
        motion.north + half * (motion.velocity_north + to.velocity_north),
        motion.east + half * (motion.velocity_east + to.velocity_east),
    )


def velocity_change(motion: ReportedMotion, to: ReportedMotion) -> float:
    """By how much the velocity differs, m/s."""
    return math.hypot(
        to.velocity_north - motion.velocity_north, to.velocity_east - motion.velocity_east
    )


def innovation(
    motion: ReportedMotion, to: ReportedMotion, slack_s: float = 0.0, stood_s: float = 0.0
) -> tuple[float, float]:
    """(north, east) from the carried place to the reported one, m.

    Args:
        motion: the one before.
        to: the reported one.
        slack_s: by so much the time between both may have been longer than their stamps say.
        stood_s: by so much it may have been shorter.
    """
    north, east = carried(motion, to)
    north, east = to.north - north, to.east - east
    speed = to.speed
    if speed == 0.0 or (slack_s <= 0.0 and stood_s <= 0.0):
        return north, east
    ahead_north, ahead_east = to.velocity_north / speed, to.velocity_east / speed
    along = north * ahead_north + east * ahead_east
    excused = min(max(along, -speed * stood_s), speed * slack_s)
    return north - excused * ahead_north, east - excused * ahead_east


def leaned(motion: ReportedMotion, north: float, east: float, interval_s: float) -> ReportedMotion:
    """A carried place that leans on the reported one.

    Args:
        motion: as reported.
        north: of the innovation, m.
        east: of the innovation, m.
        interval_s: since the report before.
    """
    rest = 0.0 if interval_s > UNBROKEN_S else LEAN_S / (LEAN_S + interval_s)
    return motion._replace(north=motion.north - rest * north, east=motion.east - rest * east)


class InnovationGate:
    """Believes the motions of one vehicle that can be true, and knows where it must be otherwise."""

    def __init__(self, reach: Reach, *, moved_s: float) -> None:
        """Before the first report, which is believed where its speed is possible.

        Args:
            reach: what the vehicle can do.
            moved_s: for how long reports from elsewhere have to agree with each other.
        """
        self._reach = reach
        self._moved_s = moved_s
        self._known: ReportedMotion | None = None
        self._believed_since = 0.0
        self._doubted_since: float | None = None
        self._seen: ReportedMotion | None = None
        self._seen_since = 0.0
        self._elsewhere_s = moved_s
        self._newest: ReportedMotion | None = None
        self._contradicts = False
        self._variance = EXPECTED_NOISE_M**2
        self._innovation: tuple[float, float] | None = None

    @property
    def tolerance(self) -> float:
        """Innovation (m) that noise explains."""
        noise = min(math.sqrt(self._variance), GREATEST_NOISE_M)
        return LEAST_TOLERANCE_M + NOISE_FACTOR * noise

    @property
    def doubts(self) -> bool:
        """Whether what was reported last is not believed."""
        return self._doubted_since is not None

    def forget(self) -> None:
        """The next report is the first one."""
        self._known = self._doubted_since = self._seen = self._innovation = self._newest = None
        self._contradicts = False

    def judge(
        self, motion: ReportedMotion, *, fault: str | None = None, slack_s: float = 0.0
    ) -> Judgement:
        """What becomes of a report, which has to be later than the one before.

        Args:
            motion: as reported.
            fault: why it is not to be believed whatever it says, if there is a reason; the place after it is
                a new one.
            slack_s: by so much the time since the report before may have been longer than the stamps say.
        """
        unknown = fault is not None
        fault = fault or self._impossible(motion)
        known, newest = self._known, self._newest
        self._newest = motion
        if known is None:
            return self._refused(motion, fault) if fault else self._adopted(motion)
        if fault is not None:
            self._doubt(known)
            self._seen = None
            if unknown:
                self._elsewhere_s = RETURN_S
            return self._refused(motion, fault)
        interval_s = motion.time_s - known.time_s
        turned = velocity_change(known, motion)
        if turned > self._reach.velocity_change(interval_s):
            self._doubt(known)
            self._contradicts = True
            self._watch(motion, slack_s)
            if self._has_moved(motion):
                return self._adopted(motion)
            return self._refused(motion, f"the velocity steps by {turned:.0f} m/s")
        return self._judge_place(known, newest or known, motion, slack_s)

    def _judge_place(
        self, known: ReportedMotion, newest: ReportedMotion, motion: ReportedMotion, slack_s: float
    ) -> Judgement:
        """The velocity can be true: the position, after the believed one and the newest one?"""
        interval_s = motion.time_s - known.time_s
        north, east = innovation(known, motion, slack_s)
        off = math.hypot(north, east)
        self._learn_noise(north, east, interval_s)
        agrees = off <= self.tolerance + self._reach.displacement(interval_s) + self._drift(motion)
        if not agrees and self._doubted_since is None:
            if self._stood_still(known, motion):
                self._elsewhere_s = RETURN_S
            else:
                stuck = (newest.north, newest.east) == (motion.north, motion.east)
                stepped = math.hypot(*innovation(newest, motion)) > self.tolerance
                self._contradicts = not (stuck or stepped)
            self._doubt(known)
        if self._doubted_since is not None:
            self._watch(motion, slack_s)
            brief = motion.time_s - self._doubted_since <= BRIEF_S
            if self._contradicts:
                # Time passes, and with it what the velocity could have become: it has to be the former one.
                brief = brief and velocity_change(known, motion) <= VELOCITY_TOLERANCE_M_S
            if agrees and (brief or self._steady_s(motion) >= RETURN_S):
                self._settle()
        if self._doubted_since is None:
            self._known = leaned(motion, north, east, interval_s)
            return Judgement(
                verdict=GateVerdict.BELIEVED, north=motion.north, east=motion.east, off=off
            )
        if not agrees and self._has_moved(motion):
            return self._adopted(motion)
        if self._contradicts:
            return self._refused(motion, "position and velocity contradict each other")
        place_north, place_east = motion.north - north, motion.east - east
        self._known = motion._replace(north=place_north, east=place_east)
        if self._doubted_since - self._believed_since < START_S:
            return self._refused(motion, "the first positions do not agree with each other")
        lasts_s = motion.time_s - self._doubted_since
        return Judgement(
            verdict=GateVerdict.CARRIED if lasts_s <= CARRIED_S else GateVerdict.ADRIFT,
            north=place_north,
            east=place_east,
            off=off,
            reason=f"the position is {off:.0f} m from where it can be"
            if not agrees
            else "the position has just come back",
        )

    def _impossible(self, motion: ReportedMotion) -> str | None:
        """What no aircraft does, whatever it did before."""
        speed = motion.speed
        if not math.isfinite(speed + motion.north + motion.east + motion.time_s):
            return "the position is no number"
        return f"a speed of {speed:.0f} m/s" if speed > self._reach.speed else None

    def _refused(self, motion: ReportedMotion, reason: str) -> Judgement:
        return Judgement(
            verdict=GateVerdict.REFUSED, north=motion.north, east=motion.east, reason=reason
        )

    def _adopted(self, motion: ReportedMotion) -> Judgement:
        """The vehicle is there, wherever it was thought to be."""
        known, moved = self._known, None
        self._believed_since = motion.time_s
        if known is not None:
            self._believed_since = self._seen_since
            moved = innovation(known, motion)
        self._known, self._innovation = motion, None
        self._settle()
        return Judgement(
            verdict=GateVerdict.BELIEVED,
            north=motion.north,
            east=motion.east,
            off=0.0 if moved is None else math.hypot(*moved),
            moved=moved,
        )

    def _settle(self) -> None:
        """Nothing is doubted any more."""
        self._doubted_since = self._seen = None
        self._contradicts = False
        self._elsewhere_s = self._moved_s

    def _stood_still(self, known: ReportedMotion, motion: ReportedMotion) -> bool:
        """Whether a report fits a vehicle that has flown for a part of the time since the one before."""
        interval_s = motion.time_s - known.time_s
        off = math.hypot(*innovation(known, motion, stood_s=interval_s))
        return interval_s > STOOD_S and off <= self.tolerance

    def _doubt(self, known: ReportedMotion) -> None:
        if self._doubted_since is None:
            self._doubted_since = known.time_s

    def _drift(self, motion: ReportedMotion) -> float:
        """How far the carried place may have left the true one since it was last believed, m."""
        if self._doubted_since is None:
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
                    motion._replace(north=motion.north - north, east=motion.east - east)
                    if self._contradicts
                    else leaned(motion, north, east, interval_s)
                )
                return
            self._elsewhere_s = self._moved_s
        self._seen_since = motion.time_s

    def _steady_s(self, motion: ReportedMotion) -> float:
        """For how long doubted reports have agreed with each other, s."""
        return motion.time_s - self._seen_since

    def _has_moved(self, motion: ReportedMotion) -> bool:
        """Whether doubted reports have been steady for long, where an aircraft could have flown."""
        known, since = self._known, self._doubted_since
        if known is None or since is None:
            return False
        steady_s, believed_s = self._steady_s(motion), since - self._believed_since
        if believed_s < MOVED_S and steady_s >= max(believed_s, START_S):
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
