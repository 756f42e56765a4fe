"""What a flight comes down to: the shape of its summary. None stands for what was not measured."""

from dataclasses import dataclass

from vfguide.lab.report.figures import Spread
from vfguide.record.flight import RecordAcceptance, Role
from vfguide.record.latency import Latency
from vfguide.record.response import VehicleResponse


@dataclass(frozen=True, slots=True, kw_only=True)
class FormationSummary:
    """How well the followers held their slots; None where nothing was measured."""

    window_s: tuple[float, float]
    """The last half of the flight, s."""
    mean_error_m: float | None
    """Mean distance from the slot, over all samples of the window and all followers that an order had not
    sent out of the formation."""
    p95_error_m: float | None
    """95th percentile of the formation error, m."""
    max_error_m: float | None
    """The greatest."""
    mean_error_3d_m: float | None
    """Mean distance from the slot in space, over all followers and all samples of the window."""
    intended_error_m: float | None
    """Mean distance from the slot as it is meant, in the course of the path where the leader is: it does not
    swing with a leader that gusts turn. Without the times at which the leader is not on its path."""
    settle_10m_s: float | None
    """Last time any follower was 10 m or more from its slot; None: still out at the end."""
    settle_1m_s: float | None
    """Last time any follower was 1 m or more from its slot; None: still out at the end."""
    min_separation_m: float | None
    """Least distance of any two vehicles on the whole flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Handling:
    """How hard a vehicle was flown, over the window."""

    role: Role
    """`leader` or `follower`."""
    course_setpoint_variation_rad_s: float | None
    """Total variation of the course setpoint per second."""
    course_setpoint_excess_variation_rad_s: float | None
    """What of that is not net turning: chatter, and the path's own bends one way and the other."""
    speed_setpoint_variation_m_s2: float | None
    """Total variation of the speed setpoint per second."""
    roll_rate_rad_s: float | None
    """Root mean square of the roll rate."""
    limited_fraction: float | None
    """Share of setpoints that a limit of the vehicle cut."""
    bank_limited_fraction: float | None
    """Share of the time at the greatest bank; None where the record does not hold limits."""
    speed_limited_fraction: float | None
    """Share of the time with the lowest or highest airspeed as setpoint; None where that is not known."""
    response: VehicleResponse | None
    """How it was finally flown; None where no companion told."""
    declared: VehicleResponse | None
    """What the mission declares of that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderSummary(Handling):
    """How well the leader held the path, over the window."""

    cross_track_error_m: Spread | None
    """Distance from the path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerSummary(Handling):
    """How well one follower held its slot, over the window."""

    formation_error_m: Spread | None
    """Distance from the slot."""
    along_track_error_m: Spread | None
    """Size of its component along the leader's course."""
    cross_track_error_m: Spread | None
    """Size of its component across the leader's course."""
    height_error_m: Spread | None
    """Height between it and its slot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A flight in figures."""

    mission: str
    """Name of the mission."""
    controller: str
    """Name of the law by which followers kept their slots."""
    plant: str
    """`course-hold`, `heading-hold` or `bank`."""
    wind: str
    """Type of wind."""
    mode: str
    """`lockstep` or `live`."""
    rate_hz: float
    """Guidance steps per second."""
    seed: int
    """Seed of everything random in the flight."""
    duration_s: float
    """Length of the flight."""
    wall_s: float | None
    """What it took."""
    real_time_factor: float | None
    """Duration over wall time."""
    accepted: bool | None
    """Whether the flight reached all that its mission asks for; None where that is nothing."""
    rejections: tuple[str, ...]
    """Why it was not accepted, in words with figures; empty if it was."""
    acceptance: RecordAcceptance
    """What the mission asks for."""
    formation: FormationSummary
    """All followers together."""
    vehicles: dict[str, LeaderSummary | FollowerSummary]
    """Each vehicle by name, the leader first."""
    latency: Latency | None
    """How quick the programs of a live flight were; None of one in virtual time."""
