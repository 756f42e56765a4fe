"""How a vehicle moves, told to others: estimated from its own states, for companions and FOLLOW_TARGET."""

import math

from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.guidance.leader_motion import MotionEstimate, estimated_motion, motion_at_first
from vfguide.link.codec import LeaderMessage, LeaderSighting, encode
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.leader_messages import INTERVAL_S, follow_target_message
from vfguide.state import GAP_S, LeaderFix, LeaderState


class StatePublisher:
    """One vehicle's motion."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._motion: MotionEstimate | None = None
        self._sequence = 0
        self.term = 0
        """Term of the leader that the vehicle obeys, or is."""

    def note(self, navigated: NavigatedState) -> LeaderState:
        """Take a navigated state; the motion as it is now known."""
        state, before = navigated.state, self._motion
        if (
            before is None
            or navigated.moved
            or not 0.0 < state.time_s - before.state.time_s <= GAP_S
        ):
            self._motion = motion_at_first(state)
        else:
            time_constant = self._plan.settings.rate_filter_s
            self._motion = estimated_motion(before, state, self._plan.airframe, time_constant)
        return self._motion.state

    def message(
        self,
        motion: LeaderState,
        navigated: NavigatedState,
        time_s: float,
        *,
        steered: bool,
        arrangement: int = 0,
        course_setpoint: float = math.nan,
        leader: LeaderFix | None = None,
    ) -> bytes:
        """The motion as bytes for the link.

        Args:
            motion: what `note` has made of the navigated.
            navigated: the same.
            time_s: of the navigated, s on the clock that the formation shares.
            steered: whether this companion steers the vehicle.
            arrangement: number of the order that it flies by.
            course_setpoint: that its autopilot is told to hold, rad; NaN where there is none.
            leader: where its leader was by the newest state of it; None where there is none.
        """
        self._sequence = (self._sequence + 1) % 2**32
        place, state = navigated.place, navigated.state
        return encode(
            LeaderMessage(
                sequence=self._sequence,
                time_s=time_s,
                latitude_deg=place.latitude_deg,
                longitude_deg=place.longitude_deg,
                altitude_amsl=place.altitude_amsl,
                course=motion.course,
                ground_speed=motion.ground_speed,
                acceleration=motion.acceleration,
                turn_rate=motion.turn_rate,
                turn_acceleration=motion.turn_acceleration,
                climb_rate=motion.climb_rate,
                term=self.term,
                arrangement=arrangement,
                steered=steered,
                course_setpoint=course_setpoint if steered else math.nan,
                satellite_m=navigated.satellite_m,
                sighting=None
                if leader is None
                else LeaderSighting(
                    age_s=time_s - leader.time_s,
                    north=leader.north - state.north,
                    east=leader.east - state.east,
                    up=leader.altitude_amsl - place.altitude_amsl,
                ),
            )
        )


class TargetSender:
    """Makes FOLLOW_TARGET of what the leader knows of itself."""

    def __init__(self, plan: FlightPlan) -> None:
        self._codec = Codec(plan.system_id, plan.component_id)
        self._sent_s = -math.inf

    def due(self, motion: LeaderState | None, navigated: NavigatedState) -> bytes:
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
