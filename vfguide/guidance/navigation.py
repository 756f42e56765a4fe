"""From reports of an autopilot to a navigated state: position, velocity, wind and the wind's rate of change.

**Reach.** A report is compared with where the aircraft can be. With a greatest acceleration a, a manoeuvre
within an interval T leaves the place open by a T² / 8; a margin of two in a is allowed.

**State.** Noise of the reported positions and the acceleration of a turning wind spoil a follower in wind.
A fading-memory filter answers both (Morrison, Introduction to Sequential Smoothing and Prediction, 1969).
The position is carried on by the velocity and only leans on the reported one. The wind (ground velocity
minus air velocity) is tracked with its rate, which the laws take off the acceleration they ask for, and
with the rate of that. Without the latter the wind would be wrong by it times the square of the filter's
time constant: a leader's course wrong by milliradians moves everybody's slot by centimetres. Without a
measured ground velocity the same filter finds wind and speed from the positions alone.

In gusts the wind walks at random and its rate foretells nothing. The innovations of the filter show how gusty
the air is, and its memory follows that.

**Velocity error.** A reported velocity may be wrong for seconds: PX4's in software by 0.3 m/s in turns, while
positions of the same estimator move right to half of that. A second-order fading-memory filter carries the
position on by the reported velocity and its error, and finds both by the reported position.
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, low_pass
from vfguide.guidance.airframe import GRAVITY, polar
from vfguide.state import Airframe, Gusts, VehicleState

LEAN_S = 6.0
"""Memory of the carried place: how long it takes to lean on believed positions. Places and velocities of
recorded estimators part by 3 m in it at most."""

UNBROKEN_S = 0.5
"""After a longer gap an innovation says nothing of the noise, and the carried place nothing any more."""

VELOCITY_TOLERANCE_M_S = 4.0
"""Noise and corrections of reported velocities."""

MARGIN = 2.0
"""Over the acceleration that a vehicle is asked for at most, or over 1 g: gusts, and pilots."""

OVERSPEED = 1.5
"""Speed of a dive in parts of the greatest speed that a vehicle may be asked for."""

UNDERSPEED = 0.6
"""Share of the lowest airspeed: no fixed wing flies slower. No wind changes an airspeed by more of it."""

GREATEST_WIND_M_S = 40.0
"""No wind that these aircraft fly in is stronger."""


class Reach(msgspec.Struct, frozen=True, kw_only=True):
    """What an aircraft can do between two reports."""

    speed: float
    """Greatest speed over ground, m/s."""
    acceleration: float
    """Greatest change of the horizontal velocity, m/s²."""
    airspeeds: tuple[float, float]
    """Lowest and highest, m/s."""

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
        airspeeds=(UNDERSPEED * airframe.airspeed_min, OVERSPEED * airframe.airspeed_max),
        acceleration=MARGIN * max(asked, GRAVITY),
    )


class ReportedMotion(msgspec.Struct, frozen=True):
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
    return replace(motion, north=motion.north - rest * north, east=motion.east - rest * east)


GUSTS_WATCH_S = 4.0
"""Memory of how alike neighbouring innovations of the wind are."""

GUSTS_LEARN_S = 1.0
"""In this time the share of gusts would grow to 1, were all innovations alike."""

GUSTS_LEAK = 0.1
"""Likeness of innovations that still counts as smooth air."""

GUSTS_CALM_M_S = 0.15
"""Innovations of this size count by half: as in light turbulence, and more than rounding or a swing leave."""


class FilterTimes(msgspec.Struct, frozen=True, kw_only=True):
    """Memory of the navigation filter."""

    position_s: float
    """How long a reported position is remembered, s."""
    wind_s: float
    """Time constant of the wind, its rate and the rate of that, s."""
    velocity_s: float = 0.0
    """Time constant with which reported velocities are checked by the positions, s; 0: they are right."""
    blind_s: float = 0.4
    """Time constant of the filter that has positions only, s."""
    height_s: float = 1.0
    """How long a reported height is remembered, s."""


class Sample(msgspec.Struct, frozen=True, kw_only=True):
    """One report of an autopilot, in the formation's local frame."""

    time_s: float
    """When it was true, s."""
    north: float
    """m."""
    east: float
    """m."""
    velocity_north: float
    """Ground velocity, m/s."""
    velocity_east: float
    """Ground velocity, m/s."""
    heading: float
    """rad."""
    airspeed: float
    """True airspeed, m/s."""
    height: float = 0.0
    """m; NaN where it is not known."""
    climb_rate: float = 0.0
    """m/s, positive up."""


def memory_of(period: float, time_constant: float) -> float:
    """Share of the past that a filter keeps over one period; none where the time constant is 0."""
    return math.exp(-period / time_constant) if time_constant > 0.0 else 0.0


def fading_memory_2(period: float, time_constant: float) -> tuple[float, float]:
    """Gains (value, rate times period) of a second-order fading-memory filter."""
    memory = memory_of(period, time_constant)
    return 1.0 - memory * memory, (1.0 - memory) ** 2


def fading_memory_3(period: float, time_constant: float) -> tuple[float, float, float]:
    """Gains (value, rate times period, half second derivative times period²) of the third order."""
    memory = memory_of(period, time_constant)
    return (
        1.0 - memory**3,
        1.5 * (1.0 - memory) ** 2 * (1.0 + memory),
        0.5 * (1.0 - memory) ** 3,
    )


def first_state(sample: Sample) -> VehicleState:
    """State from one report alone."""
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
    """State after a report, with its ground velocity measured.

    Args:
        previous: state after the report before.
        sample: the report; later than the previous state.
        times: memory of the filter.
    """
    period = sample.time_s - previous.time_s
    lean = period / (times.position_s + period)
    gain, rate_gain, second_gain = fading_memory_3(period, times.wind_s)
    jerk_gain = 2.0 * second_gain / period**2
    air_north, air_east = air = polar(sample.airspeed, sample.heading)
    north, east, wind_north, wind_east = _predict(previous, air, period)
    surprise_north = sample.velocity_north - air_north - wind_north
    surprise_east = sample.velocity_east - air_east - wind_east
    gusts = gusts_after(previous.gusts, surprise_north, surprise_east, period)
    # A gust is there at once and stays: what is new of it is taken whole.
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
    """How gusty the air is after another innovation of the wind.

    The innovations of an optimal filter are white. Where each resembles the one before, the filter lags
    behind a wind that walks at random, as in turbulence: it is to remember less. Where neighbours have
    opposite signs it is noise that it follows, and it is to remember more (Mehra, IEEE Transactions on
    Automatic Control 15(2), 1970).

    Args:
        before: until now; None at first.
        surprise_north: measured wind minus the expected one, m/s.
        surprise_east: m/s.
        period: since the report before, s.
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
    previous: VehicleState,
    sample: Sample,
    times: FilterTimes,
    *,
    by_course: bool = True,
) -> VehicleState:
    """State after a report whose ground speed is not to be used.

    Wind and its rate follow from how the reported positions leave those that airspeed and heading predict.

    Args:
        previous: state after the report before.
        sample: the report; later than the previous state.
        times: memory of the filter.
        by_course: whether the course of the reported velocity is right.
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
        # Positions show the wind by its integral: three orders end with its rate.
        wind_jerk=(0.0, 0.0),
        course=math.atan2(sample.velocity_east, sample.velocity_north) if by_course else None,
    )


def navigate_unseen(previous: VehicleState, sample: Sample, times: FilterTimes) -> VehicleState:
    """State after a report of which heading and airspeed alone are used.

    The wind goes on changing as it did; what gusts changed foretells nothing.
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
    """Height (m) carried on by the climb rate, and leaning on the reported one where that is known.

    Barometers are noisy and climb rates are not: in level flight nobody is to climb after noise.
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
    """(north, east, wind north, wind east) a period later, by the mean of the air velocities then and now."""
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
    """The state that position and wind make of a sample: ground velocity = air velocity + wind."""
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
    """A carried position, and by how much reported velocities fall short of its motion."""

    sample: Sample
    """The last report."""
    north: float
    """Carried position, m."""
    east: float
    """m."""
    short_north: float = 0.0
    """To be added to reported velocities, m/s."""
    short_east: float = 0.0
    """m/s."""


def velocity_error_at_first(sample: Sample) -> VelocityError:
    """Nothing is known against the first velocity."""
    return VelocityError(sample=sample, north=sample.north, east=sample.east)


def velocity_error(before: VelocityError, sample: Sample, time_constant: float) -> VelocityError:
    """The error after another report.

    Args:
        before: after the report before.
        sample: the report; later.
        time_constant: memory of the filter, s, above 0.
    """
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
    """The report with the velocity that positions show."""
    return replace(
        sample,
        velocity_north=sample.velocity_north + error.short_north,
        velocity_east=sample.velocity_east + error.short_east,
    )
