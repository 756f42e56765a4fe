"""A vehicle in calm air."""

from vfguide.state import VehicleState


def state_in_calm_air(
    time_s: float, *, course: float = 0.0, airspeed: float = 20.0, height: float = 0.0
) -> VehicleState[float]:
    """At the origin, at a course (rad), an airspeed (m/s) and a height (m)."""
    return VehicleState(
        time_s=time_s,
        north=0.0,
        east=0.0,
        course=course,
        ground_speed=airspeed,
        heading=course,
        airspeed=airspeed,
        wind_north=0.0,
        wind_east=0.0,
        wind_rate_north=0.0,
        wind_rate_east=0.0,
        wind_jerk_north=0.0,
        wind_jerk_east=0.0,
        height=height,
    )
