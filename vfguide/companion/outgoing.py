"""What a companion wants sent and has to say, and what it did last."""

import math
from dataclasses import dataclass, field

from vfguide.companion.role import Lead, RoleStep
from vfguide.companion.supervisor import Mode
from vfguide.formation.arrangement import MAIN_PATH, Point
from vfguide.record.events import EventKind, FlightEvent, plain
from vfguide.record.guidance_log import GuidanceStep
from vfguide.state import Setpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something an operator should know."""

    time_s: float
    """When."""
    text: str
    """What, in one line."""
    warning: bool = False
    """Whether it is something to worry about."""
    tell: bool = False
    """Whether the pilot gets it as a text; texts of the autopilot reach the pilot anyway."""
    kind: EventKind = "text"
    """What it is about."""


def flight_event(vehicle: str, event: Event) -> FlightEvent:
    """An event of a vehicle's companion as an entry of a record."""
    return FlightEvent(
        time_s=event.time_s,
        vehicle=vehicle,
        kind=event.kind,
        text=plain(event.text),
        warning=event.warning,
    )


@dataclass(slots=True)
class Outgoing:
    """What a call leads to."""

    to_autopilot: bytes = b""
    """One datagram."""
    to_link: list[bytes] = field(default_factory=list)
    """Own states."""
    to_followers: list[bytes] = field(default_factory=list)
    """States of the leader by which this vehicle leads, in a term above 0."""
    replies: list[bytes] = field(default_factory=list)
    """Answers to orders."""
    repeats: list[bytes] = field(default_factory=list)
    """Orders, as they were signed, for vehicles that have missed them."""
    requested: list[tuple[str, ...]] = field(default_factory=list)
    """Orders that a ground station has requested, in the words of `vfguide order`, to be given."""
    to_leader: bytes = b""
    """One datagram, for a leader without a companion."""
    to_others: bytes = b""
    """One datagram, for followers without a companion."""
    steered: bool = False
    """Whether the vehicle is steered: the setpoint goes to the autopilot unless that has it already."""
    events: list[Event] = field(default_factory=list)
    """In the order in which they happened."""

    def share(self, step: RoleStep | None) -> None:
        """Send over the link what a step of the vehicle's part has to say, if there was one."""
        if step is not None and step.publish is not None:
            self.to_link.append(step.publish)
        if step is not None and step.lead is not None:
            self.to_followers.append(step.lead)

    def tell(self, text: str | None, now: float) -> None:
        """Add an event, if there is one."""
        if text is not None:
            self.events.append(Event(time_s=now, text=text))

    def warn(self, text: str | None, now: float, *, kind: EventKind = "text") -> None:
        """Add an event to worry about, if there is one."""
        if text is not None:
            self.events.append(Event(time_s=now, text=text, warning=True, tell=True, kind=kind))


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """What the companion did last, for records."""

    mode: Mode
    """Of the supervisor."""
    setpoint: Setpoint[float] | None
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

    def guidance_step(self, now: float) -> GuidanceStep:
        """As an entry of the log.

        Args:
            now: s of the companion's clock.
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
            left=self.left,
            path=self.path,
            **slot,
            **lead,
        )
