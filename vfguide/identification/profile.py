"""What was found, as lines for the mission file."""

from vfguide.guidance.response import HoldResponse
from vfguide.identification.recording import Findings
from vfguide.identification.slip import Slip


def profile_text(vehicle: str, findings: Findings) -> str:
    """The fields of a vehicle that were measured, as YAML to be put under its name in `vehicles`.

    Args:
        vehicle: its name.
        findings: what was found; what was not is left out.
    """
    lines = [
        f"# {vehicle}, as `vfguide identify` has measured it, in bounds of 95 %.",
        f"{vehicle}:",
    ]
    if findings.course is not None:
        lines += response_lines(findings.course, "alpha_1_s", "course")
    if findings.speed is not None:
        lines += response_lines(findings.speed, "beta_1_s", "speed")
    lines.append(slip_line(findings.slip))
    return "\n".join(lines) + "\n"


def slip_line(slip: Slip | None) -> str:
    """Whether it slips, and what that is worth; a remark where it is not known."""
    if slip is None:
        return "  # slips is not known, for want of banks or of turns: leave what the mission says"
    found, lead = slip.efficiency, slip.lead
    words = (
        f"it turns {found.value:.3f} +- {found.half_width:.3f} of what its bank says, its nose leads by"
        f" {lead.value:.2f} +- {lead.half_width:.2f} s times the turn rate"
    )
    if slip.slips is None:
        return (
            f"  # slips is open: {words}; leave what the mission says, or fly again in calmer air"
        )
    return f"  slips: {str(slip.slips).lower()} # {words}"


def response_lines(found: HoldResponse, bandwidth: str, loop: str) -> list[str]:
    """Return the three fields of a response, with the bounds of what it may be."""
    return [
        f"  {bandwidth}: {found.gain:.3f} # {found.least:.2f} to {found.greatest:.2f}",
        f"  {loop}_dead_time_s: {found.dead_time:.3f}",
        f"  {loop}_lag_s: {found.lag:.3f} # together {found.earliest:.2f} to {found.latest:.2f}",
    ]
