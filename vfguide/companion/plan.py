"""One companion's part of a mission, in radians and metres; made from the mission by `mission_plan.py`."""

import math
from collections.abc import Mapping

import msgspec
from msgspec.structs import replace

from vfguide.companion.supervisor import ModeTimeouts
from vfguide.frames import LocalFrame
from vfguide.guidance.air_data import CreepingHold
from vfguide.guidance.formation import Slot
from vfguide.guidance.height import ClimbLimits
from vfguide.guidance.intended_motion import KnownLeader
from vfguide.guidance.path import Path
from vfguide.guidance.response import (
    AS_DECLARED,
    DECLARED,
    FIRM,
    TOLD,
    UNKNOWN,
    Bandwidth,
    Certainty,
    HoldCertainty,
    HoldResponse,
    Softness,
    bandwidth_of,
    bearable,
)
from vfguide.guidance.sliding_laws import GuidanceSettings, PathGains
from vfguide.laws.base import Law
from vfguide.laws.leader import LeaderTask
from vfguide.mavlink.parameters import AutopilotResponse
from vfguide.mission.quantity import Section
from vfguide.record.response import VehicleResponse
from vfguide.state import Airframe, SpeedHold

STOPPED_S = 0.7
"""Silence after which a leader, which publishes each report, may have stopped, s, for example under a
parachute. The position where it was last heard is avoided from then on."""


class ForeignLeader(msgspec.Struct, frozen=True, kw_only=True):
    """Leader without a companion."""

    connection: str
    """MAVLink address at which it is heard."""
    system_id: int | None
    """MAVLink system id of the aircraft; None where it is heard by ADS-B."""
    icao_address: int | None
    """ICAO address of the aircraft; None where it is not heard by ADS-B."""
    least_delay_s: float | None
    """Least latency of its messages, s; None where it is to be measured."""
    airframe: Airframe
    rate_filter_s: float
    """Time constant of its rates, s."""
    height: float
    """The mission's flying height, m above the origin."""


class KnownPath(msgspec.Struct, frozen=True):
    """Path that every companion of a mission knows."""

    path: Path
    gains: PathGains
    """Gains of the vector field around it."""
    least_radius: float = 0.0
    """Least radius of the leader's turn onto it, m; 0 leaves it to the field."""
    check: int = 0
    """Checksum against another path of its name (`Mission.path_checks`); 0 if no path can be ordered."""
    heights: tuple[float, float] = (0.0, 0.0)
    """Lowest and highest place, m above the mission's flying height."""
    ceiling: float = math.inf
    """Greatest height that the fence allows along it, m above the origin; infinite without a fence."""


class FollowerTask(msgspec.Struct, frozen=True, kw_only=True):
    """Slot of a follower, and its knowledge of the leader."""

    slot: Slot
    leader: KnownLeader | ForeignLeader
    airspeed: float
    """Airspeed for flying away when the formation breaks up, m/s."""
    follows_height: bool = True
    """Whether the slot counts from the leader's actual height, not only from the planned one."""


class LeadPlan(msgspec.Struct, frozen=True, kw_only=True):
    """Succession of leaders, where the mission names deputies."""

    order: tuple[str, ...]
    """The mission's leader, then its deputies."""
    task: FollowerTask
    """Task while another vehicle leads; for the mission's leader a slot at its own place."""
    altitude_amsl: float
    """Altitude of the leader, m above mean sea level."""


class OtherVehicle(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle of the formation, as separation needs it."""

    name: str
    rank: int
    """Unique rank in the mission, the leader first."""
    leads: bool
    slot: Slot
    """Its slot; the leader's is at its own place."""
    spacing: float
    """Horizontal distance from its slot to the own one, m."""
    lateral_acceleration: float
    """g tan(phi_max), its limit in turns, m/s²."""
    speed_answer_s: float = 1.0
    """1 / beta, its time constant in taking up airspeeds, s."""
    stopped_s: float = STOPPED_S
    """For a leader: time unheard after which it is silent, and may have stopped, s."""
    may_stop: bool = True
    """Whether it may come to a standstill in the air."""
    least_m: float = 0.0
    """Minimum distance to keep, m."""


class FlightPlan(msgspec.Struct, frozen=True, kw_only=True):
    """One vehicle's part of a mission."""

    name: str
    system_id: int
    component_id: int
    """MAVLink component of the autopilot."""
    rate_hz: float
    """Requested rate of position reports, and of guidance steps with them."""
    frame: LocalFrame
    altitude_amsl: float
    """Altitude to hold, m above mean sea level."""
    settings: GuidanceSettings
    """Gains and switches of every law."""
    law: type[Law]
    """Law by which followers keep their slots."""
    gains: Section
    """Gains of the followers' law."""
    airframe: Airframe
    asks_response: bool
    """Whether the autopilot is to tell response and limits."""
    slips: bool
    """Whether the vehicle slips: in turns its nose leaves the direction of flight."""
    speed_hold: SpeedHold
    """Speed hold of the airframe if it does not slip; if it does, it has a total-energy hold."""
    finds_slip: bool
    """Whether flight is to show if the vehicle slips, which is assumed meanwhile."""
    timeouts: ModeTimeouts
    """Tolerated silences."""
    engage_from: tuple[str, ...]
    """Autopilot modes, by name, from which the companion may engage by itself."""
    task: LeaderTask | FollowerTask
    """A path as the leader, or a slot as a follower."""
    height: float
    """Height to hold, m above the mission's origin."""
    lowest: float
    """Height to hold where the leader's path is lowest, m above the mission's origin."""
    up: float
    """Height of the mission's slot above the leader, m."""
    rank: int
    others: tuple[OtherVehicle, ...]
    timekeeper: str = ""
    """Vehicle whose clock the formation shares; empty for the leader."""
    traffic_m: float = 0.0
    """Distance to keep from aircraft outside the formation, m; 0 ignores them."""
    lead: LeadPlan | None = None
    """Succession of leaders; None where the mission names no deputies."""
    loiter_up: float = 0.0
    """Height of the own loiter above the leader's after an abort, m."""
    loiter_room: float = math.inf
    """Limit of the lowest loiter after an abort, m above the flying height; keeps all in the fence."""
    hears_bank: bool = True
    """Whether the autopilot is asked for its bank angle, which shows how the vehicle takes up courses."""
    learns: bool = True
    """Whether guidance uses the response that the flight shows."""
    turn_efficiency: float | None = None
    """Actual turn in parts of the turn that its bank implies; None until flight has shown it."""
    creeping_hold: CreepingHold | None = None
    """Creep of its airspeed hold; None without."""
    declared_bank: float | None = None
    """Declared bank limit, rad, where flight has shown another; else None."""
    coordinated_alpha: float | None = None
    """alpha of a fully coordinated turn, 1/s; None where the autopilot has not told it."""
    certainty: Certainty = AS_DECLARED
    """Certainty of the airframe's response."""
    softness: Softness = FIRM
    """Less than firm while a guard finds the vehicle strained."""
    climb_limits: ClimbLimits = msgspec.field(default_factory=ClimbLimits)
    """Climb and sink that every vehicle of the formation keeps up, as the mission declares."""
    paths: Mapping[str, KnownPath] = msgspec.field(default_factory=dict)
    """All paths of the mission by name; empty behind a leader without a companion."""
    ceiling: float = math.inf
    """Greatest height that the fence allows along the mission's first path, m above the origin."""

    def ceiling_along(self, path: str) -> float:
        """Return the fence's ceiling along the named path, m above the origin; infinite without a fence."""
        return self.paths[path].ceiling if path in self.paths else self.ceiling

    @property
    def surely_slips(self) -> bool:
        """Whether the vehicle is known to slip, not only assumed to."""
        return self.slips and (self.turn_efficiency is not None or not self.finds_slip)

    @property
    def keeps_time(self) -> bool:
        """Whether the formation uses this vehicle's clock."""
        return self.name == self.timekeeper if self.timekeeper else self.leads

    @property
    def foreign_leader(self) -> ForeignLeader | None:
        """The leader if it has no companion; else None."""
        leader = self.task.leader if isinstance(self.task, FollowerTask) else None
        return leader if isinstance(leader, ForeignLeader) else None

    @property
    def leads(self) -> bool:
        """Whether this vehicle is the leader."""
        return isinstance(self.task, LeaderTask)

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Vehicles that this one hears, except the leader."""
        return tuple(one.name for one in self.others if not one.leads)


def flown_by(plan: FlightPlan, response: AutopilotResponse) -> FlightPlan:
    """Return the plan updated with the autopilot's own response and limits.

    Limits are the tighter of its own and the declared ones. A dead time or lag that the mission declares
    takes precedence: it was measured on the vehicle.
    """
    airframe = plan.airframe
    lowest = max(airframe.airspeed_min, response.airspeed_min or 0.0)
    highest = min(airframe.airspeed_max, response.airspeed_max or math.inf)
    if lowest >= highest:
        # No airspeed satisfies both: the mismatch is reported elsewhere.
        lowest, highest = airframe.airspeed_min, airframe.airspeed_max
    flown = replace(
        airframe,
        alpha=response.alpha or airframe.alpha,
        beta=response.beta or airframe.beta,
        airspeed_min=lowest,
        airspeed_max=highest,
        max_bank=min(airframe.max_bank, response.max_bank or math.inf),
        climb_max=min(airframe.climb_max, response.climb_max or math.inf),
        sink_max=min(airframe.sink_max, response.sink_max or math.inf),
        course_dead_time=airframe.course_dead_time or response.course_dead_time or 0.0,
        course_lag=airframe.course_lag or response.course_lag or 0.0,
        speed_hold=response.speed_hold or airframe.speed_hold,
    )
    certainty = plan.certainty
    return replace(
        plan,
        airframe=flown,
        asks_response=False,
        creeping_hold=response.creeping_hold,
        coordinated_alpha=response.coordinated_alpha,
        certainty=Certainty(
            course=certainty.course if response.alpha is None else TOLD,
            speed=certainty.speed if response.beta is None else TOLD,
        ),
    )


def turning(plan: FlightPlan, efficiency: float, *, slips: bool) -> FlightPlan:
    """Return the plan for a vehicle with this turn efficiency."""
    alpha = plan.coordinated_alpha
    flown = replace(
        plan.airframe,
        alpha=plan.airframe.alpha if alpha is None else efficiency * alpha,
        speed_hold="total-energy" if slips else plan.speed_hold,
    )
    return replace(plan, airframe=flown, slips=slips, turn_efficiency=efficiency)


def answering(
    plan: FlightPlan,
    *,
    course: tuple[HoldResponse, float] | None,
    speed: HoldResponse | None,
    hold: SpeedHold,
) -> FlightPlan:
    """Return the plan for a vehicle that answers as its flight has shown.

    Args:
        plan: plan flown so far.
        course: (response by bank angle, turn efficiency); None keeps the present one.
        speed: response; None keeps the present one.
        hold: kind of the speed hold, if its response is given. Setpoints that ignore the measured speed, as
            for a total-energy hold, suit any kind.
    """
    airframe, certainty = plan.airframe, plan.certainty
    coordinated = plan.coordinated_alpha
    if course is not None:
        found, share = course
        coordinated = found.gain
        airframe = replace(
            airframe,
            alpha=share * found.gain,
            course_dead_time=found.dead_time,
            course_lag=found.lag,
        )
        certainty = replace(certainty, course=certainty_of(found))
    if speed is not None:
        airframe = replace(
            airframe,
            beta=speed.gain,
            speed_dead_time=speed.dead_time,
            speed_lag=speed.lag,
            speed_hold=hold,
        )
        certainty = replace(certainty, speed=certainty_of(speed))
    return replace(
        plan,
        airframe=airframe,
        certainty=certainty,
        coordinated_alpha=coordinated,
        speed_hold=plan.speed_hold if speed is None else hold,
    )


def banking(plan: FlightPlan, limit: float | None) -> FlightPlan:
    """Return the plan with the bank limit (rad) that the flight has shown; None restores the declared one."""
    declared = plan.declared_bank or plan.airframe.max_bank
    reached = declared if limit is None else min(limit, declared)
    if reached == plan.airframe.max_bank:
        return plan
    return replace(plan, airframe=replace(plan.airframe, max_bank=reached), declared_bank=declared)


def doubting(plan: FlightPlan) -> FlightPlan:
    """Return the plan for a vehicle whose course response was found wrong, with the right one unknown."""
    if plan.certainty.course.spread >= UNKNOWN.spread:
        return plan
    return replace(plan, certainty=replace(plan.certainty, course=UNKNOWN))


def certainty_of(found: HoldResponse) -> HoldCertainty:
    """Return the certainty of a response learned in flight."""
    return HoldCertainty(
        spread=max(found.spread, DECLARED.spread), late=max(found.latest - found.late, 0.0)
    )


def response_of(plan: FlightPlan) -> VehicleResponse:
    """Return the response that a plan uses, for the record."""
    airframe, certainty = plan.airframe, plan.certainty
    return VehicleResponse(
        alpha_1_s=airframe.alpha,
        course_dead_time_s=airframe.course_dead_time,
        course_lag_s=airframe.course_lag,
        course_spread=certainty.course.spread,
        beta_1_s=airframe.beta,
        speed_dead_time_s=airframe.speed_dead_time,
        speed_lag_s=airframe.speed_lag,
        speed_spread=certainty.speed.spread,
        slips=plan.slips,
        turn_efficiency=plan.turn_efficiency,
        max_bank_deg=math.degrees(airframe.max_bank),
    )


def bandwidth_for(plan: FlightPlan) -> Bandwidth:
    """Return the bandwidth that the aircraft of a plan bears, given the certainty of its response."""
    sliding = plan.settings.sliding
    return bandwidth_of(
        plan.airframe,
        plan.certainty,
        slips=plan.slips,
        period=1.0 / plan.rate_hz,
        loop_delay=sliding.loop_delay_s,
        factor=sliding.boundary_layer_factor,
        amplification=sliding.amplification,
        softness=plan.softness,
    )


def bearable_course(plan: FlightPlan) -> float:
    """Return the greatest bandwidth (1/s) that the plan's course hold bears, given its certainty."""
    airframe = plan.airframe
    return bearable(
        airframe.course_dead_time + airframe.course_lag,
        plan.certainty.course,
        period=1.0 / plan.rate_hz,
        loop_delay=plan.settings.sliding.loop_delay_s,
        factor=0.0,
    )


def follower_law(plan: FlightPlan) -> Law:
    """Return a new object of the plan's law, within the bandwidth that its vehicle bears."""
    return plan.law(plan.gains, plan.settings, plan.airframe).within(bandwidth_for(plan))


def late_laws(plan: FlightPlan) -> tuple[Law, ...]:
    """Return (law of the course, law of the speed) for an autopilot with delays; empty without any."""
    if plan.airframe.is_ideal:
        return ()
    law = follower_law(plan)
    return law, law.for_speed()


def course_settings(plan: FlightPlan) -> GuidanceSettings:
    """Return the settings of the leader's law, within the bandwidth that its vehicle bears."""
    bandwidth = bandwidth_for(plan).course
    return replace(
        plan.settings, sliding=replace(plan.settings.sliding, course_bandwidth=bandwidth)
    )
