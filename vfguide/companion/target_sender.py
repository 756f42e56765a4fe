"""The leader's motion for followers without a companion, ten times a second."""

import math

from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.leader_messages import INTERVAL_S, follow_target_message
from vfguide.state import LeaderState


class TargetSender:
    """Makes FOLLOW_TARGET of what the leader knows of itself."""

    def __init__(self, plan: FlightPlan) -> None:
        self._codec = Codec(plan.system_id, plan.component_id)
        self._sent_s = -math.inf

    def due(self, motion: LeaderState[float] | None, navigated: NavigatedState) -> bytes:
        """One datagram, or nothing where it is not time yet, or there is no motion to tell.

        Args:
            motion: of the leader, as its own companion estimates it.
            navigated: the report that it is of.
        """
        # Half a period early is nearer to the time than half a period late.
        if motion is None or motion.time_s - self._sent_s < INTERVAL_S - 0.5 * navigated.period:
            return b""
        self._sent_s = motion.time_s
        message = follow_target_message(
            motion,
            latitude_deg=navigated.place.latitude_deg,
            longitude_deg=navigated.place.longitude_deg,
            altitude_amsl=navigated.place.altitude_amsl,
            heading=navigated.state.heading,
        )
        return self._codec.encode([message])
