"""Interface of a role in a companion (leader, follower, deputy), and its inputs and outputs.

A vehicle's motion, estimated from its own states, is sent to companions and as FOLLOW_TARGET.
"""

import math
from collections import Counter
from typing import Protocol

import msgspec

from vfguide.companion.alerts import Event
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.companion.supervisor import Mode
from vfguide.formation.arrangement import MAIN_PATH, Point
from vfguide.formation.orders import Order
from vfguide.guidance.leader_motion import MotionEstimate, estimated_motion, motion_at_first
from vfguide.link.codec import LeaderMessage, LeaderSighting, encode
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.leader_messages import INTERVAL_S, follow_target_message
from vfguide.mavlink.reports import TrafficReport
from vfguide.record.events import FlightEvent
from vfguide.record.guidance_log import GuidanceStep
from vfguide.record.log import plain
from vfguide.record.response import VehicleResponse
from vfguide.state import GAP_S, HeardState, LeaderFix, LeaderState, Setpoint


class Lead(msgspec.Struct, frozen=True, kw_only=True):
    """Leadership by a vehicle."""

    term: int
    motion: LeaderState
    """Motion of the leader: the vehicle itself, or one that it carries on."""


class RoleStep(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one guidance step of a role."""

    setpoint: Setpoint | None
    """None without anything to steer by."""
    distance: float
    """Distance from path or slot, m; infinite while unknown."""
    lyapunov: float
    """Lyapunov function W, m²; NaN for the leader."""
    publish: bytes | None
    """Own state for the link."""
    height: float
    """Height to command now, m above the mission's origin; it leads by the autopilot's delay."""
    keeps_clear: bool = False
    """Whether the setpoint keeps clear of another vehicle, in place of guidance's."""
    climb_m: float = 0.0
    """Step to add to the height in order to keep clear, m."""
    along_track: float = math.nan
    """Distance to the slot, positive ahead of the vehicle, m; NaN for the leader and while unknown."""
    cross_track: float = math.nan
    """Distance to slot or path, positive right of the vehicle, m; NaN while unknown."""
    up: float = math.nan
    """Height of the slot above the vehicle, m; NaN for the leader and while unknown."""
    motion: LeaderState | None = None
    """The leader's own motion; None for a follower."""
    slot: Point | None = None
    """Ordered slot; None for the mission's, and for the leader."""
    lead: bytes | None = None
    """Leader state by which this vehicle leads, for the link; None where it does not lead."""


class Role(Protocol):
    """Part of a vehicle in the formation."""

    @property
    def counters(self) -> Counter[str]:
        """Messages from the link that were not used, counted by reason."""

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """Run guidance for a navigated report, in the supervisor's present mode."""

    def retune(self, plan: FlightPlan) -> None:
        """Go on with another response of the same vehicle, and keep what is known of the formation."""

    def receive(self, data: bytes, now: float) -> None:
        """Take a leader state from the link."""

    def receive_lead(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a leader state by which the named vehicle leads; ignored unless the mission names deputies."""
        del vehicle, data, now

    def leave(self) -> RoleStep | None:
        """Return the last states for the link before this companion ends; None without deputies."""
        return None

    @property
    def lead(self) -> Lead | None:
        """Own leadership while the companion steers; None while not leading, or without deputies."""
        return None

    @property
    def foreign_leader(self) -> HeardState | None:
        """Newest state of a leader without a companion, on the own clock; None for any other leader."""
        return None

    @property
    def leadership(self) -> tuple[str, int] | None:
        """Known leader and its term; None without deputies."""
        return None

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take the state of another follower from the link."""

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Take the own autopilot's report of an aircraft outside the formation."""

    def unheard(self) -> list[str]:
        """Return the followers never heard, of which nobody can keep clear; empty for a leader."""
        return []

    def lose_link(self, now: float) -> None:
        """Note that nobody can be heard now."""

    def to_leader(self, now: float) -> bytes:
        """Return one datagram for a leader without a companion; empty for any other."""

    def leader_age(self, now: float) -> float:
        """Return the age of the newest leader state, s."""


def flight_event(vehicle: str, event: Event) -> FlightEvent:
    """Return an event of a vehicle's companion as an entry of a record."""
    return FlightEvent(
        time_s=event.time_s,
        vehicle=vehicle,
        kind=event.kind,
        text=plain(event.text),
        warning=event.warning,
    )


class Outgoing(msgspec.Struct):
    """Output of one call to a companion."""

    to_autopilot: bytes = b""
    """One datagram."""
    to_link: list[bytes] = msgspec.field(default_factory=list)
    """Own states."""
    to_followers: list[bytes] = msgspec.field(default_factory=list)
    """Leader states by which this vehicle leads, in a term above 0."""
    replies: list[bytes] = msgspec.field(default_factory=list)
    """Answers to orders."""
    repeats: list[bytes] = msgspec.field(default_factory=list)
    """Signed orders for vehicles that have missed them."""
    requested: list[Order] = msgspec.field(default_factory=list)
    """Orders requested by a ground station, to be issued."""
    to_leader: bytes = b""
    """One datagram for a leader without a companion."""
    to_others: bytes = b""
    """One datagram for followers without a companion."""
    steered: bool = False
    """Whether the vehicle is steered; the setpoint is sent unless the autopilot already has it."""
    events: list[Event] = msgspec.field(default_factory=list)
    """In order of occurrence."""

    @property
    def is_empty(self) -> bool:
        """Whether the call has yielded nothing."""
        said = self.to_autopilot or self.to_link or self.to_followers or self.to_others
        return not (said or self.steered or self.events or self.requested)

    def share(self, step: RoleStep | None) -> None:
        """Add a step's states to the output for the link."""
        if step is not None and step.publish is not None:
            self.to_link.append(step.publish)
        if step is not None and step.lead is not None:
            self.to_followers.append(step.lead)


class Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """Mode, setpoint and formation state of the last step, for records."""

    mode: Mode
    setpoint: Setpoint | None
    """Last setpoint sent."""
    lyapunov: float
    """Lyapunov function W, m²; NaN for the leader."""
    slot: Point | None = None
    """Ordered slot; None for the mission's, and for the leader."""
    left: bool = False
    """Whether the vehicle has no slot: ordered out of the formation, or everything called off."""
    path: str | None = MAIN_PATH
    """Name of the leader's path; None in a hold, and once everything was called off."""
    lead: Lead | None = None
    """Leadership of this vehicle; None where it does not lead, or without deputies."""
    response: VehicleResponse | None = None
    """Response used for guidance."""

    def guidance_step(self, now: float, leader_age: float) -> GuidanceStep:
        """Return the snapshot as a log entry; an infinite `leader_age` means no leader state."""
        setpoint = self.setpoint
        slot = {}
        if self.slot is not None:
            ordered = self.slot
            slot = {
                "slot_forward_m": ordered.forward,
                "slot_right_m": ordered.right,
                "slot_up_m": ordered.up,
            }
        lead = {}
        if self.lead is not None:
            motion = self.lead.motion
            lead = {
                "lead_term": float(self.lead.term),
                "lead_time_s": motion.time_s,
                "lead_north_m": motion.north,
                "lead_east_m": motion.east,
                "lead_course_rad": motion.course,
                "lead_height_m": motion.height,
            }
        return GuidanceStep(
            time_s=now,
            mode=self.mode.value,
            course_rad=math.nan if setpoint is None else setpoint.course,
            speed_m_s=math.nan if setpoint is None else setpoint.speed,
            limited=setpoint is not None and bool(setpoint.limited),
            lyapunov_m2=self.lyapunov,
            leader_age_s=leader_age if math.isfinite(leader_age) else math.nan,
            left=self.left,
            path=self.path,
            **slot,
            **lead,
        )


class StatePublisher:
    """Estimate and message of one vehicle's motion."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._motion: MotionEstimate | None = None
        self._sequence = 0
        self.term = 0
        """Term of the leader that the vehicle obeys, or is."""

    def note(self, navigated: NavigatedState) -> LeaderState:
        """Take a navigated state; return the motion estimated with it."""
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
        height_sense: int = 0,
        leader: LeaderFix | None = None,
    ) -> bytes:
        """Return the motion, as estimated by `note` for the same navigated state, as bytes for the link.

        `time_s` is on the clock shared by the formation. `arrangement` is the number of the order being
        flown. `course_setpoint` is NaN without one, rad. `leader` is its leader's place by the newest state
        of it, if any.
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
                height_sense=height_sense if steered else 0,
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
    """Sender of the leader's motion as FOLLOW_TARGET."""

    def __init__(self, plan: FlightPlan) -> None:
        self._codec = Codec(plan.system_id, plan.component_id)
        self._sent_s = -math.inf

    def due(self, motion: LeaderState | None, navigated: NavigatedState) -> bytes:
        """Return one datagram; empty between intervals, or where the leader's motion is unknown."""
        # Within half a period of the due time, now is closer to it than the next report.
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
