"""How long a companion bears silence."""

from typing import Annotated

from pydantic import Field

from vfguide.mission.quantity import NotNegative, Positive, Section

Silence = Annotated[Positive, Field(le=3600.0)]


class Timeouts(Section):
    """What happens when telemetry or the leader falls silent, and after how long."""

    telemetry_s: Silence = 1.0
    """Position reports: after this the companion stops sending setpoints until they come again, s."""

    telemetry_lost_s: Silence = 10.0
    """Position reports: after this a vehicle that was steered is handed back to its autopilot, s."""

    leader_s: Silence = 0.6
    """Leader states: after this the leader is predicted along its path, s."""

    prediction_s: Silence = 30.0
    """Age of the newest leader state up to which it is predicted; then the formation breaks up, s."""

    breakaway_s: Annotated[NotNegative, Field(le=3600.0)] = 25.0
    """How long each follower then flies away from the others, before its autopilot takes over, s."""
