"""The interface of a role (leader, follower, deputy) in a companion, and the values that go in and out.

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
    """By what a vehicle leads."""

    term: int
    """The term in which it leads."""
    motion: LeaderState
    """Of the leader: itself, or one that it carries on."""


class RoleStep(msgspec.Struct, frozen=True, kw_only=True):
    """What a part makes of one state."""

    setpoint: Setpoint | None
    """None where there is nothing to steer by."""
    distance: float
    """m from path or slot; infinite while not known."""
    lyapunov: float
    """W, m²; NaN for the leader."""
    publish: bytes | None
    """Own state for the link."""
    height: float
    """To be asked of the autopilot now, m above the mission's origin; it leads by the autopilot's delay."""
    keeps_clear: bool = False
    """Whether the setpoint keeps clear of another vehicle, in the place of what guidance asks for."""
    climb_m: float = 0.0
    """To be added to that, m: it keeps clear of another vehicle."""
    along_track: float = math.nan
    """How far ahead the slot is, m; NaN for the leader and while not known."""
    cross_track: float = math.nan
    """How far to the right the slot is, or the path, m; NaN while not known."""
    up: float = math.nan
    """How far above the vehicle the slot is, m; NaN for the leader and while not known."""
    motion: LeaderState | None = None
    """Of the leader, by itself; None for a follower."""
    slot: Point | None = None
    """That was ordered; None for the mission's, and for the leader."""
    lead: bytes | None = None
    """State of the leader by which this vehicle leads, for the link; None where it does not."""


class Role(Protocol):
    """A part in the formation."""

    @property
    def counters(self) -> Counter[str]:
        """What came over the link and was not used, by reason."""

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """Guidance for a navigated report, in the supervisor's present mode."""

    def retune(self, plan: FlightPlan) -> None:
        """Go on with another response of the same vehicle; what is known of the formation is kept."""

    def receive(self, data: bytes, now: float) -> None:
        """Take a leader state from the link."""

    def receive_lead(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of the leader by which another vehicle leads; of use only where there are deputies."""
        del vehicle, data, now

    def leave(self) -> RoleStep | None:
        """Last states for the link, before this companion ends; of use only where there are deputies."""
        return None

    @property
    def lead(self) -> Lead | None:
        """By what this vehicle leads and its companion steers it; None where there are no deputies."""
        return None

    @property
    def foreign_leader(self) -> HeardState | None:
        """How a leader without a companion was heard to move last, on the own clock; None of any other."""
        return None

    @property
    def leadership(self) -> tuple[str, int] | None:
        """Who leads as far as is known, and its term; None where there are no deputies."""
        return None

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take the state of another follower from the link."""

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Take what the own autopilot reports of an aircraft that is not of the formation."""

    def unheard(self) -> list[str]:
        """Names of followers that were never heard: nobody can keep clear of them. A leader needs not."""
        return []

    def lose_link(self, now: float) -> None:
        """Note that nobody can be heard now."""

    def to_leader(self, now: float) -> bytes:
        """What is to be said to a leader without a companion, one datagram."""

    def leader_age(self, now: float) -> float:
        """Seconds since the newest leader state was true."""


def flight_event(vehicle: str, event: Event) -> FlightEvent:
    """An event of a vehicle's companion as an entry of a record."""
    return FlightEvent(
        time_s=event.time_s,
        vehicle=vehicle,
        kind=event.kind,
        text=plain(event.text),
        warning=event.warning,
    )


class Outgoing(msgspec.Struct):
    """What a call leads to."""

    to_autopilot: bytes = b""
    """One datagram."""
    to_link: list[bytes] = msgspec.field(default_factory=list)
    """Own states."""
    to_followers: list[bytes] = msgspec.field(default_factory=list)
    """States of the leader by which this vehicle leads, in a term above 0."""
    replies: list[bytes] = msgspec.field(default_factory=list)
    """Answers to orders."""
    repeats: list[bytes] = msgspec.field(default_factory=list)
    """Orders, as they were signed, for vehicles that have missed them."""
    requested: list[Order] = msgspec.field(default_factory=list)
    """Orders that a ground station has requested, to be given."""
    to_leader: bytes = b""
    """One datagram, for a leader without a companion."""
    to_others: bytes = b""
    """One datagram, for followers without a companion."""
    steered: bool = False
    """Whether the vehicle is steered: the setpoint goes to the autopilot unless that has it already."""
    events: list[Event] = msgspec.field(default_factory=list)
    """In the order in which they happened."""

    @property
    def is_empty(self) -> bool:
        """Whether nothing has come of the call."""
        said = self.to_autopilot or self.to_link or self.to_followers or self.to_others
        return not (said or self.steered or self.events or self.requested)

    def share(self, step: RoleStep | None) -> None:
        """Send over the link what a step of the vehicle's part has to say, if there was one."""
        if step is not None and step.publish is not None:
            self.to_link.append(step.publish)
        if step is not None and step.lead is not None:
            self.to_followers.append(step.lead)


class Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """What the companion did last, for records."""

    mode: Mode
    """Of the supervisor."""
    setpoint: Setpoint | None
    """The last that was sent."""
    lyapunov: float
    """W, m²; NaN for the leader."""
    slot: Point | None = None
    """That was ordered; None for the mission's, and for the leader."""
    left: bool = False
    """Whether it was ordered out of the formation, or all was called off: then it has no slot."""
    path: str | None = MAIN_PATH
    """Name of the path that the leader follows; None in a hold, and once all was called off."""
    lead: Lead | None = None
    """By which it leads; None where it does not, or where there are no deputies."""
    response: VehicleResponse | None = None
    """By which it is flown."""

    def guidance_step(self, now: float, leader_age: float) -> GuidanceStep:
        """As an entry of the log.

        Args:
            now: s of the companion's clock.
            leader_age: of the leader's newest state then, s; infinite where there is none.
        """
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
        height_sense: int = 0,
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
            height_sense: which way it leaves its height, see `LeaderMessage.height_sense`.
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
