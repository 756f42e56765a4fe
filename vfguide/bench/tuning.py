"""What the searches for the baselines' gains minimise."""

from vfguide.report.summary import FollowerSummary, Summary

ERROR_M = 0.01
"""A mean error of this counts one."""

SETTLING_S = 10.0
"""So does that much time until everybody is within 1 m."""

CHATTER_RAD_S = 0.05
"""And that much back and forth of a course setpoint."""

UNSETTLED = 1e3
"""Cost of not settling at all."""


def cost_of(summary: Summary) -> float:
    """Cost of a flight: mean error, settling time and chatter, each in its unit above; lower is better."""
    chatter = [
        vehicle.course_setpoint_excess_variation_rad_s or 0.0
        for vehicle in summary.vehicles.values()
        if isinstance(vehicle, FollowerSummary)
    ]
    return weighed(
        summary.formation.mean_error_m,
        summary.formation.settle_1m_s,
        max(chatter, default=0.0),
    )


def weighed(error_m: float | None, settling_s: float | None, chatter_rad_s: float) -> float:
    """The same from its parts; None: not measured, never settled."""
    if error_m is None or settling_s is None:
        return UNSETTLED
    return error_m / ERROR_M + settling_s / SETTLING_S + chatter_rad_s / CHATTER_RAD_S
