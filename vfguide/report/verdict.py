"""Whether a flight reached what its mission asks for, and in words what it did not reach."""

from vfguide.record.flight import Acceptance
from vfguide.report.summary import FormationSummary


def find_rejections(acceptance: Acceptance, formation: FormationSummary) -> tuple[str, ...]:
    """What the flight did not reach, one phrase with figures for each; empty if it reached all."""
    found = (
        reject_error("mean formation error", formation.mean_error_m, acceptance.mean_error_m),
        reject_error("greatest formation error", formation.max_error_m, acceptance.max_error_m),
        reject_settling(10, formation.settle_10m_s, acceptance.settle_10m_s),
        reject_settling(1, formation.settle_1m_s, acceptance.settle_1m_s),
        reject_separation(formation.min_separation_m, acceptance.min_separation_m),
    )
    return tuple(reason for reason in found if reason is not None)


def reject_error(name: str, error_m: float | None, limit_m: float | None) -> str | None:
    """Why an error is not accepted; None if it is, or if no limit was set."""
    if limit_m is None:
        return None
    if error_m is None:
        return f"{name} could not be measured"
    if error_m <= limit_m:
        return None
    error, limit = tell_apart(error_m, limit_m)
    return f"{name} {error} m is above {limit} m"


def reject_settling(distance_m: int, settled_s: float | None, limit_s: float | None) -> str | None:
    """Why a settling time is not accepted; None if it is, or if no limit was set."""
    if limit_s is None:
        return None
    if settled_s is None:
        return f"a follower was still {distance_m} m or more from its slot at the end"
    if settled_s <= limit_s:
        return None
    settled, limit = tell_apart(settled_s, limit_s)
    return f"all within {distance_m} m of their slots only after {settled} s, not {limit} s"


def reject_separation(least_m: float | None, limit_m: float) -> str | None:
    """Why the least separation is not accepted; None if it is."""
    if least_m is None:
        return "separation could not be measured"
    if least_m >= limit_m:
        return None
    least, limit = tell_apart(least_m, limit_m)
    return f"two vehicles came within {least} m of each other, closer than {limit} m"


def tell_apart(first: float, second: float) -> tuple[str, str]:
    """Two figures in as few digits, three at least, as show which is the greater."""
    for digits in range(3, 17):
        texts = f"{first:.{digits}g}", f"{second:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts
