"""What positions say of the velocities that come with them.

An autopilot's estimator gives both, and its velocity may be wrong for seconds: PX4's in software by 0.3 m/s
in turns, while the same estimator's positions move right to half of that. A second-order fading-memory filter
carries the position on by the reported velocity and an error of it, and finds both by the reported position.
"""

from dataclasses import dataclass, replace

from vfguide.guidance.navigation import Sample, fading_memory_2


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityError:
    """A carried position, and by how much reported velocities fall short of its motion."""

    sample: Sample[float]
    """The last report."""
    north: float
    """Carried position, m."""
    east: float
    """m."""
    short_north: float = 0.0
    """To be added to reported velocities, m/s."""
    short_east: float = 0.0
    """m/s."""


def velocity_error_at_first(sample: Sample[float]) -> VelocityError:
    """Nothing is known against the first velocity."""
    return VelocityError(sample=sample, north=sample.north, east=sample.east)


def velocity_error(
    before: VelocityError, sample: Sample[float], time_constant: float
) -> VelocityError:
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


def with_right_velocity(sample: Sample[float], error: VelocityError) -> Sample[float]:
    """The report with the velocity that positions show."""
    return replace(
        sample,
        velocity_north=sample.velocity_north + error.short_north,
        velocity_east=sample.velocity_east + error.short_east,
    )
