"""Navigated state from an autopilot's reports: position, velocity, wind and the wind's rate of change.

**Reach.** Bounds of what an aircraft can do between two reports. An acceleration up to a during an interval T
leaves the position open by a T² / 8; a margin of two in a is allowed.

**State.** Position noise and the acceleration of a turning wind disturb a follower. A fading-memory filter
reduces both (Morrison, Introduction to Sequential Smoothing and Prediction, 1969). The velocity carries the
position on, and the reported position corrects it slowly. The wind (ground velocity minus air velocity) is
tracked with its rate, which the laws subtract from their acceleration, and with its second derivative.
Without the latter the wind would be wrong by it times the filter's squared time constant. A leader's course
error of milliradians would then move all slots by centimetres. Without a measured ground velocity the same
filter finds wind and speed from positions alone.

In gusts the wind is a random walk and its rate predicts nothing. The filter's innovations show the gustiness,
which sets its memory.

**Velocity error.** A reported velocity may be wrong for seconds: PX4's in software by 0.3 m/s in turns, while
its positions are right to half of that. A second-order fading-memory filter of the reported positions
estimates position and velocity error.
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, low_pass
from vfguide.guidance.airframe import GRAVITY, polar
from vfguide.state import Airframe, Gusts, VehicleState

LEAN_S = 6.0
"""Time constant of the position's correction toward believed reports, s. Within it, recorded estimators'
positions and integrated velocities differ by at most 3 m."""

UNBROKEN_S = 0.5
"""Longest gap after which an innovation still shows noise and the carried position is valid, s."""

VELOCITY_TOLERANCE_M_S = 4.0
"""Noise and corrections of reported velocities, m/s."""

MARGIN = 2.0
"""Factor on the greater of commanded acceleration and 1 g: gusts and pilots."""

OVERSPEED = 1.5
"""Speed of a dive relative to the highest airspeed setpoint."""

UNDERSPEED = 0.6
"""Lowest plausible airspeed relative to the minimum; no gust changes an airspeed by more than that share."""

GREATEST_WIND_M_S = 40.0
"""Strongest wind in which these aircraft fly, m/s."""


class Reach(msgspec.Struct, frozen=True, kw_only=True):
    """Bounds of an aircraft's motion between two reports."""

    speed: float
    """Highest ground speed, m/s."""
    acceleration: float
    """Largest rate of the horizontal velocity, m/s²."""
    airspeeds: tuple[float, float]
    """Lowest and highest airspeed, m/s."""

    def velocity_change(self, interval_s: float) -> float:
        """Return the largest change of the reported velocity, m/s."""
        return VELOCITY_TOLERANCE_M_S + self.acceleration * interval_s

    def displacement(self, interval_s: float) -> float:
        """Return the largest distance from the position that the mean of both velocities predicts, m."""
        # a T² / 8, with a = acceleration / 2: without the margin of two.
        return min(0.0625 * self.acceleration * interval_s**2, 2.0 * self.speed * interval_s)


def reach_of(airframe: Airframe) -> Reach:
    """Return the reach of a vehicle with these limits, in a pilot's hands and in gusts too."""
    asked = GRAVITY * math.tan(airframe.max_bank) + airframe.max_acceleration
    return Reach(
        speed=OVERSPEED * airframe.airspeed_max + GREATEST_WIND_M_S,
        airspeeds=(UNDERSPEED * airframe.airspeed_min, OVERSPEED * airframe.airspeed_max),
        acceleration=MARGIN * max(asked, GRAVITY),
    )


class ReportedMotion(msgspec.Struct, frozen=True):
    """Reported position and velocity."""

    time_s: float
    """Time on any clock that runs evenly, s."""
    north: float
    """North coordinate, m."""
    east: float
    """East coordinate, m."""
    velocity_north: float
    """North velocity over ground, m/s."""
    velocity_east: float
    """East velocity over ground, m/s."""

    @property
    def speed(self) -> float:
        """Ground speed, m/s."""
        return math.hypot(self.velocity_north, self.velocity_east)


def carried(motion: ReportedMotion, to: ReportedMotion) -> tuple[float, float]:
    """Return (north, east) of a position carried to another motion's time by the mean of both velocities."""
    half = 0.5 * (to.time_s - motion.time_s)
    return (
        motion.north + half * (motion.velocity_north + to.velocity_north),
        motion.east + half * (motion.velocity_east + to.velocity_east),
    )


def velocity_change(motion: ReportedMotion, to: ReportedMotion) -> float:
    """Return the magnitude of the velocity difference, m/s."""
    return math.hypot(
        to.velocity_north - motion.velocity_north, to.velocity_east - motion.velocity_east
    )


def innovation(
    motion: ReportedMotion, to: ReportedMotion, slack_s: float = 0.0, stood_s: float = 0.0
) -> tuple[float, float]:
    """Return (north, east) from the carried position to the reported one, m.

    Timing errors along the velocity are excused: the interval may have been `slack_s` longer or `stood_s`
    shorter than the stamps say, s.
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
    """Return a carried position corrected toward the reported one; the reported one after a gap.

    (north, east) is the innovation, m; `interval_s` is the time since the previous report, s.
    """
    rest = 0.0 if interval_s > UNBROKEN_S else LEAN_S / (LEAN_S + interval_s)
    return replace(motion, north=motion.north - rest * north, east=motion.east - rest * east)


GUSTS_WATCH_S = 4.0
"""Time constant of the power and correlation of wind innovations, s."""

GUSTS_LEARN_S = 1.0
"""Time in which the gust share would grow to 1 if all innovations were alike, s."""

GUSTS_LEAK = 0.1
"""Correlation of innovations that still counts as smooth air."""

GUSTS_CALM_M_S = 0.15
"""Innovation size with half weight, m/s: as in light turbulence, above rounding and oscillation."""


class FilterTimes(msgspec.Struct, frozen=True, kw_only=True):
    """Time constants of the navigation filter."""

    position_s: float
    """Time constant of reported positions, s."""
    wind_s: float
    """Time constant of the wind and its first two derivatives, s."""
    velocity_s: float = 0.0
    """Time constant of the check of reported velocities by positions, s; 0 trusts the velocities."""
    blind_s: float = 0.4
    """Time constant of the filter for positions alone, s."""
    height_s: float = 1.0
    """Time constant of reported heights, s."""


class Sample(msgspec.Struct, frozen=True, kw_only=True):
    """Report of an autopilot, in the formation's local frame."""

    time_s: float
    """Time of validity, s."""
    north: float
    """North coordinate, m."""
    east: float
    """East coordinate, m."""
    velocity_north: float
    """North ground velocity, m/s."""
    velocity_east: float
    """East ground velocity, m/s."""
    heading: float
    """Heading, rad."""
    airspeed: float
    """True airspeed, m/s."""
    height: float = 0.0
    """Height, m; NaN where unknown."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up."""


def memory_of(period: float, time_constant: float) -> float:
    """Return the share of the past that a filter keeps over one period; 0 for a time constant of 0."""
    return math.exp(-period / time_constant) if time_constant > 0.0 else 0.0


def fading_memory_2(period: float, time_constant: float) -> tuple[float, float]:
    """Return the gains (value, rate times period) of a second-order fading-memory filter."""
    memory = memory_of(period, time_constant)
    return 1.0 - memory * memory, (1.0 - memory) ** 2


def fading_memory_3(period: float, time_constant: float) -> tuple[float, float, float]:
    """Return the third-order gains (value, rate times period, half second derivative times period²)."""
    memory = memory_of(period, time_constant)
    return (1.0 - memory**3, 1.5 * (1.0 - memory) ** 2 * (1.0 + memory), 0.5 * (1.0 - memory) ** 3)


def first_state(sample: Sample) -> VehicleState:
    """Return the state from one report alone, with the wind's rates zero."""
    air_north, air_east = air = polar(sample.airspeed, sample.heading)
    return _state(
        sample,
        air,
        height=sample.height,
        position=(sample.north, sample.east),
        wind=(sample.velocity_north - air_north, sample.velocity_east - air_east),
        wind_rate=(0.0, 0.0),
        wind_jerk=(0.0, 0.0),
    )


def navigate(previous: VehicleState, sample: Sample, times: FilterTimes) -> VehicleState:
    """Update the state with a later report whose ground velocity is measured."""
    period = sample.time_s - previous.time_s
    lean = period / (times.position_s + period)
    gain, rate_gain, second_gain = fading_memory_3(period, times.wind_s)
    jerk_gain = 2.0 * second_gain / period**2
    air_north, air_east = air = polar(sample.airspeed, sample.heading)
    north, east, wind_north, wind_east = _predict(previous, air, period)
    surprise_north = sample.velocity_north - air_north - wind_north
    surprise_east = sample.velocity_east - air_east - wind_east
    gusts = gusts_after(previous.gusts, surprise_north, surprise_east, period)
    # A gust arrives at once and stays: its innovation is taken whole.
    wind_gain = gain + (1.0 - gain) * gusts.share
    return _state(
        sample,
        air,
        gusts=gusts,
        height=carried_height(previous, sample, times.height_s),
        position=(north + lean * (sample.north - north), east + lean * (sample.east - east)),
        wind=(wind_north + wind_gain * surprise_north, wind_east + wind_gain * surprise_east),
        wind_rate=(
            previous.wind_rate_north
            + previous.wind_jerk_north * period
            + rate_gain / period * surprise_north,
            previous.wind_rate_east
            + previous.wind_jerk_east * period
            + rate_gain / period * surprise_east,
        ),
        wind_jerk=(
            previous.wind_jerk_north + jerk_gain * surprise_north,
            previous.wind_jerk_east + jerk_gain * surprise_east,
        ),
    )


def gusts_after(
    before: Gusts | None, surprise_north: float, surprise_east: float, period: float
) -> Gusts:
    """Update the estimate of gustiness with an innovation (measured minus expected wind, m/s).

    The innovations of an optimal filter are white. Positive correlation shows that the filter lags a wind
    that walks at random, as in turbulence: its memory must shorten. Negative correlation shows that it
    follows noise, and its memory must grow (Mehra, IEEE Transactions on Automatic Control 15(2), 1970).
    `before` is None at first; `period` is the time since the previous report, s.
    """
    if before is None:
        return Gusts(
            share=0.0,
            surprise_north=surprise_north,
            surprise_east=surprise_east,
            power=0.0,
            correlation=0.0,
        )
    squared = surprise_north * surprise_north + surprise_east * surprise_east
    product = surprise_north * before.surprise_north + surprise_east * before.surprise_east
    power = low_pass(before.power, squared, period, GUSTS_WATCH_S)
    correlation = low_pass(before.correlation, product, period, GUSTS_WATCH_S)
    likeness = correlation / (power + GUSTS_CALM_M_S**2)
    growth = (likeness - GUSTS_LEAK) * period / GUSTS_LEARN_S
    return Gusts(
        share=clip(before.share + growth, 0.0, 1.0),
        surprise_north=surprise_north,
        surprise_east=surprise_east,
        power=power,
        correlation=correlation,
    )


def navigate_blind(
    previous: VehicleState, sample: Sample, times: FilterTimes, *, by_course: bool = True
) -> VehicleState:
    """Update the state with a later report without using its ground speed.

    Wind and its rate follow from the difference between the reported positions and those that airspeed and
    heading predict. With `by_course` the course is that of the reported velocity.
    """
    period = sample.time_s - previous.time_s
    gain, rate_gain, second_gain = fading_memory_3(period, times.blind_s)
    air = polar(sample.airspeed, sample.heading)
    north, east, wind_north, wind_east = _predict(previous, air, period)
    surprise_north, surprise_east = sample.north - north, sample.east - east
    return _state(
        sample,
        air,
        height=carried_height(previous, sample, times.height_s),
        position=(north + gain * surprise_north, east + gain * surprise_east),
        wind=(
            wind_north + rate_gain / period * surprise_north,
            wind_east + rate_gain / period * surprise_east,
        ),
        wind_rate=(
            previous.wind_rate_north + 2.0 * second_gain / period**2 * surprise_north,
            previous.wind_rate_east + 2.0 * second_gain / period**2 * surprise_east,
        ),
        # Positions show the wind through its integral: a third-order filter ends at its rate.
        wind_jerk=(0.0, 0.0),
        course=math.atan2(sample.velocity_east, sample.velocity_north) if by_course else None,
    )


def navigate_unseen(previous: VehicleState, sample: Sample, times: FilterTimes) -> VehicleState:
    """Update the state with a report of which only heading and airspeed are used.

    The wind continues to change at its rate, reduced by the gust share: gusts predict nothing.
    """
    period = sample.time_s - previous.time_s
    smooth = 1.0 - previous.gust_share
    before = replace(
        previous,
        wind_rate_north=smooth * previous.wind_rate_north,
        wind_rate_east=smooth * previous.wind_rate_east,
        wind_jerk_north=0.0,
        wind_jerk_east=0.0,
    )
    air = polar(sample.airspeed, sample.heading)
    north, east, wind_north, wind_east = _predict(before, air, period)
    return _state(
        sample,
        air,
        gusts=previous.gusts,
        height=carried_height(previous, sample, times.height_s),
        position=(north, east),
        wind=(wind_north, wind_east),
        wind_rate=(before.wind_rate_north, before.wind_rate_east),
        wind_jerk=(before.wind_jerk_north, before.wind_jerk_east),
    )


def carried_height(previous: VehicleState, sample: Sample, time_constant: float) -> float:
    """Return the height (m) carried on by the climb rate, corrected toward a known reported height.

    Barometers are noisy and climb rates are not: in level flight no vehicle should follow noise.
    """
    period = sample.time_s - previous.time_s
    carried = previous.height + (previous.climb_rate + sample.climb_rate) * (0.5 * period)
    missed = sample.height - carried
    if not math.isfinite(missed):
        return carried
    return carried + period / (time_constant + period) * missed


def _predict(
    previous: VehicleState, air: tuple[float, float], period: float
) -> tuple[float, float, float, float]:
    """Return (north, east, wind north, wind east) a period later, by the mean air velocity."""
    before_north, before_east = polar(previous.airspeed, previous.heading)
    after_north, after_east = air
    change_north = (previous.wind_rate_north + 0.5 * previous.wind_jerk_north * period) * period
    change_east = (previous.wind_rate_east + 0.5 * previous.wind_jerk_east * period) * period
    mean_north = (before_north + after_north + change_north) / 2.0 + previous.wind_north
    mean_east = (before_east + after_east + change_east) / 2.0 + previous.wind_east
    return (
        previous.north + mean_north * period,
        previous.east + mean_east * period,
        previous.wind_north + change_north,
        previous.wind_east + change_east,
    )


def _state(
    sample: Sample,
    air: tuple[float, float],
    *,
    height: float,
    position: tuple[float, float],
    wind: tuple[float, float],
    wind_rate: tuple[float, float],
    wind_jerk: tuple[float, float],
    course: float | None = None,
    gusts: Gusts | None = None,
) -> VehicleState:
    """Return the state from a sample, a position and a wind: ground velocity = air velocity + wind."""
    velocity_north, velocity_east = air[0] + wind[0], air[1] + wind[1]
    return VehicleState(
        time_s=sample.time_s,
        north=position[0],
        east=position[1],
        course=math.atan2(velocity_east, velocity_north) if course is None else course,
        ground_speed=math.hypot(velocity_north, velocity_east),
        heading=sample.heading,
        airspeed=sample.airspeed,
        wind_north=wind[0],
        wind_east=wind[1],
        wind_rate_north=wind_rate[0],
        wind_rate_east=wind_rate[1],
        wind_jerk_north=wind_jerk[0],
        wind_jerk_east=wind_jerk[1],
        height=height,
        climb_rate=sample.climb_rate,
        gusts=gusts,
    )


class VelocityError(msgspec.Struct, frozen=True, kw_only=True):
    """Estimate of the error of reported velocities, by a carried position."""

    sample: Sample
    """Latest report."""
    north: float
    """Carried position, north, m."""
    east: float
    """Carried position, east, m."""
    short_north: float = 0.0
    """North correction to add to reported velocities, m/s."""
    short_east: float = 0.0
    """East correction to add to reported velocities, m/s."""


def velocity_error_at_first(sample: Sample) -> VelocityError:
    """Start without a velocity error."""
    return VelocityError(sample=sample, north=sample.north, east=sample.east)


def velocity_error(before: VelocityError, sample: Sample, time_constant: float) -> VelocityError:
    """Update the velocity error with a later report; `time_constant` is above 0 s."""
    last, period = before.sample, sample.time_s - before.sample.time_s
    gain, rate_gain = fading_memory_2(period, time_constant)
    mean_north = 0.5 * (last.velocity_north + sample.velocity_north) + before.short_north
    mean_east = 0.5 * (last.velocity_east + sample.velocity_east) + before.short_east
    north, east = before.north + mean_north * period, before.east + mean_east * period
    surprise_north, surprise_east = sample.north - north, sample.east - east
    return VelocityError(
        sample=sample,
        north=north + gain * surprise_north,
        east=east + gain * surprise_east,
        short_north=before.short_north + rate_gain / period * surprise_north,
        short_east=before.short_east + rate_gain / period * surprise_east,
    )


def with_right_velocity(sample: Sample, error: VelocityError) -> Sample:
    """Return the report with its velocity corrected."""
    return replace(
        sample,
        velocity_north=sample.velocity_north + error.short_north,
        velocity_east=sample.velocity_east + error.short_east,
    )
