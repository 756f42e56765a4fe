"""What a flight did not tell, why, and what to do about it: one line."""

from vfguide.identification.fit import Response
from vfguide.identification.recording import KNOWN_SHARE, Findings, is_good, speed_step
from vfguide.state import Airframe


def shortcoming(findings: Findings, airframe: Airframe, ended: str | None) -> str | None:
    """What was not learned, why, and the remedy; None where both responses are known well.

    Args:
        findings: what the flight told.
        airframe: by which it was flown.
        ended: why it ended before its time; None where all steps were flown.
    """
    missing = [
        part
        for part in (course_missing(findings), speed_missing(findings, airframe))
        if part is not None
    ]
    if not missing and ended is None:
        return None
    if ended is None:
        why = "; ".join(missing)
        return f"not learned well enough: {why}; until then leave what the mission says of it"
    lost = f", not learned: {'; '.join(missing)}" if missing else ", and fewer steps than planned"
    return f"the flight ended before its time ({ended}){lost}; fly it again, to its end"


def course_missing(findings: Findings) -> str | None:
    """What is not known of the course response; None where it is known well."""
    if findings.course is None:
        return "alpha_1_s (too few reports of its steps; see that telemetry comes at rehearsal.rate_hz)"
    if is_good(findings.course):
        return None
    return f"alpha_1_s ({wide(findings.course)}; fly again in calmer air, or with more --repeats)"


def speed_missing(findings: Findings, airframe: Airframe) -> str | None:
    """What is not known of the speed response; None where it is known well."""
    if speed_step(airframe) == 0.0:
        return (
            "beta_1_s (airspeed_range_m_s leaves no room for steps around"
            f" {airframe.cruise:g} m/s; widen it)"
        )
    if findings.speed is None:
        return (
            "beta_1_s (too few reports of its steps; see that telemetry comes at rehearsal.rate_hz)"
        )
    if is_good(findings.speed):
        return None
    return (
        f"beta_1_s ({wide(findings.speed)}; fly again in calmer air, or with more --repeats, or take it"
        " from the autopilot's parameters by response: auto, as for a TECS, which is no first-order hold)"
    )


def wide(response: Response) -> str:
    """A bandwidth and its interval."""
    found = response.bandwidth
    return (
        f"{found.value:.2f} +- {found.half_width:.2f} 1/s, and known well is what is within"
        f" {KNOWN_SHARE * 100.0:.0f} %"
    )
