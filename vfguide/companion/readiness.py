"""Before take-off: what would keep a companion from steering now."""

from vfguide.companion.supervisor import Timeouts

NOTHING_HEARD = "no position from the autopilot: check --mavlink and the autopilot's stream"
DOUBTED = "the autopilot's position is doubted: see what its pilot is told"
NO_TIME = "the formation's time is not known: see that its timekeeper's companion runs; check link and keys"
NO_LEADER = "the leader is not heard: see that its companion runs, or it sends; check link and keys"


def obstacle(
    timeouts: Timeouts, *, telemetry_age: float, doubts: bool, leader_age: float, time_known: bool
) -> str | None:
    """What would keep a companion from steering, in words; None where nothing would.

    A leader with a companion that is heard is one whose signature, session and clock have been accepted.
    Behind one without, the formation's time shows that the others are heard.

    Args:
        timeouts: of the mission.
        telemetry_age: since the newest position report, s.
        doubts: whether that is not believed.
        leader_age: of the newest leader state, s; 0 for the leader itself.
        time_known: whether the formation's clock is known: without it nobody is told where this vehicle is.
    """
    # Not "above": an age that is no number counts as silence.
    if not telemetry_age <= timeouts.telemetry_s:
        return NOTHING_HEARD
    if doubts:
        return DOUBTED
    if not leader_age <= timeouts.leader_s:
        return NO_LEADER
    if not time_known:
        return NO_TIME
    return None
