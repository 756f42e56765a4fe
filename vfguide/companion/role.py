"""A part in the formation: what a companion hands to it, and what it hands back."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Protocol

from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.supervisor import Mode
from vfguide.formation.arrangement import Point
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import HeardState, LeaderState, Setpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """By what a vehicle leads."""

    term: int
    """In which term."""
    motion: LeaderState[float]
    """Of the leader: itself, or one that it carries on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoleStep:
    """What a part makes of one state."""

    setpoint: Setpoint[float] | None
    """None where there is nothing to steer by."""
    distance: float
    """m from path or slot; infinite while not known."""
    lyapunov: float
    """W, m²; NaN for the leader."""
    publish: bytes | None
    """Own state for the link."""
    height: float
    """To be asked of the autopilot now, m above the mission's origin; it leads by the autopilot's delay."""
    climb_m: float = 0.0
    """To be added to that, m: it keeps clear of another vehicle."""
    along_track: float = math.nan
    """How far ahead the slot is, m; NaN for the leader and while not known."""
    cross_track: float = math.nan
    """How far to the right the slot is, or the path, m; NaN while not known."""
    up: float = math.nan
    """How far above the vehicle the slot is, m; NaN for the leader and while not known."""
    motion: LeaderState[float] | None = None
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

    def successions(self) -> list[str]:
        """What a pilot should know of who leads, each once; nothing where there are no deputies."""
        return []

    def words(self) -> list[str]:
        """What a pilot should know of what came over the link, each once: one sentence each."""

    def leader_age(self, now: float) -> float:
        """Seconds since the newest leader state was true."""
