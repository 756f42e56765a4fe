"""What one companion has to know of its mission: its own part only, in radians and metres.

`mission_plan.py` makes it of a mission.
"""

import math
from collections.abc import Mapping

import msgspec
from msgspec.structs import replace

from vfguide.companion.belief import radius_limit
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
"""A leader publishes a state for each report. One that was not heard for longer may have stopped, as one
under a parachute has: the place where it was last heard is not flown through."""


class ForeignLeader(msgspec.Struct, frozen=True, kw_only=True):
    """A leader without a companion."""

    connection: str
    """MAVLink address at which it is heard."""
    system_id: int | None
    """System id of the aircraft; None where it is heard by ADS-B."""
    icao_address: int | None
    """ICAO address of the aircraft by ADS-B; None where it speaks itself."""
    least_delay_s: float | None
    """How long its messages take at least, s; None where that is to be found out."""
    airframe: Airframe
    """What it can do."""
    rate_filter_s: float
    """Time constant of its rates, s."""
    height: float
    """The mission's flying height, m above the origin."""


class KnownPath(msgspec.Struct, frozen=True):
    """A path that every companion of a mission knows."""

    path: Path
    """The path."""
    gains: PathGains
    """The field around it."""
    least_radius: float = 0.0
    """The leader turns no tighter onto it, m; 0 where that is left to the field."""
    check: int = 0
    """What tells it from any other of its name (`Mission.path_checks`); 0 if none can be ordered."""
    heights: tuple[float, float] = (0.0, 0.0)
    """Heights of its lowest and its highest place, m above the mission's flying height."""
    ceiling: float = math.inf
    """Greatest height that the fence allows along it, m above the origin; infinite without one."""


class FollowerTask(msgspec.Struct, frozen=True, kw_only=True):
    """A slot, and what a follower knows of the one it follows."""

    slot: Slot
    """The follower's place in the formation."""
    leader: KnownLeader | ForeignLeader
    """What the mission tells about the leader."""
    airspeed: float
    """To fly away at when the formation breaks up, m/s."""
    follows_height: bool = True
    """Whether the slot counts from the leader's own height, not only from the one that is planned for it."""


class LeadPlan(msgspec.Struct, frozen=True, kw_only=True):
    """Who may lead, where the mission names deputies."""

    order: tuple[str, ...]
    """The leader of the mission, then its deputies."""
    task: FollowerTask
    """What this vehicle flies while another leads; for the leader of the mission a slot at its own place."""
    altitude_amsl: float
    """The leader's, m above mean sea level."""


class OtherVehicle(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle of the formation, as far as keeping clear of it needs it."""

    name: str
    """Name of the vehicle."""
    rank: int
    """Rank of the vehicle in the mission, the leader first: no two have the same."""
    leads: bool
    """Whether it is the leader."""
    slot: Slot
    """Slot of the vehicle; the leader's is at its own place."""
    spacing: float
    """From that slot to one's own, m, level."""
    lateral_acceleration: float
    """g tan(phi_max), m/s²: how hard it can turn."""
    stopped_s: float = STOPPED_S
    """Of a leader: not heard for longer, it is silent, and may have stopped where it was."""
    may_stop: bool = True
    """Whether it may come to a standstill in the air."""
    least_m: float = 0.0
    """Kept from it at least, m."""


class FlightPlan(msgspec.Struct, frozen=True, kw_only=True):
    """One vehicle's part of a mission."""

    name: str
    """Name of the vehicle."""
    system_id: int
    """MAVLink system."""
    component_id: int
    """MAVLink component of the autopilot."""
    rate_hz: float
    """Position reports asked for, and with them guidance steps."""
    frame: LocalFrame
    """The formation's local frame."""
    altitude_amsl: float
    """To be held, m above mean sea level."""
    settings: GuidanceSettings
    """Gains and switches of every law."""
    law: type[Law]
    """The law by which followers keep their slots."""
    gains: Section
    """The gains of that law."""
    airframe: Airframe
    """Response and limits."""
    asks_response: bool
    """Whether response and limits are the autopilot's to tell."""
    slips: bool
    """Whether the vehicle's nose leaves the direction of flight in turns."""
    speed_hold: SpeedHold
    """Of the airframe if it does not slip; one that does has a total-energy hold."""
    finds_slip: bool
    """Whether that is found out in flight; until then it is taken for one that does."""
    timeouts: ModeTimeouts
    """How long silences are borne."""
    engage_from: tuple[str, ...]
    """Modes of the autopilot out of which it may be engaged by itself, by name."""
    task: LeaderTask | FollowerTask
    """What to fly: a path as the leader, or a slot as a follower."""
    height: float
    """Of the altitude above the mission's origin, m."""
    lowest: float
    """The same where the leader's path is lowest, m."""
    up: float
    """Of that what the mission's slot adds to the leader's, m."""
    rank: int
    """Rank of the vehicle in the mission, the leader first."""
    others: tuple[OtherVehicle, ...]
    """All other vehicles of the formation."""
    timekeeper: str = ""
    """The vehicle whose clock the formation shares; the leader where it is not said."""
    traffic_m: float = 0.0
    """Kept from aircraft that are not of the formation, m; 0 to look at none."""
    lead: LeadPlan | None = None
    """Who may lead; None where the mission names no deputies."""
    loiter_up: float = 0.0
    """How far above the leader it loiters once everything was called off, m."""
    loiter_room: float = math.inf
    """How far above the flying height the lowest may loiter then, all within the fence, m."""
    hears_bank: bool = True
    """Whether the autopilot is asked for its bank, which tells how the vehicle takes up courses."""
    learns: bool = True
    """Whether what the flight shows of the response is flown by."""
    turn_efficiency: float | None = None
    """What it turns of what its bank says; None until flight has shown it."""
    creeping_hold: CreepingHold | None = None
    """How its airspeed hold creeps, where it does."""
    declared_bank: float | None = None
    """Bank that was said to be its limit, rad, where flight has shown another; else None."""
    coordinated_alpha: float | None = None
    """1/s: alpha if it turned as its bank says; None where the autopilot has not told it."""
    certainty: Certainty = AS_DECLARED
    """How well the response of the airframe is known."""
    softness: Softness = FIRM
    """Less than firm while a guard finds the vehicle strained."""
    climb_limits: ClimbLimits = msgspec.field(default_factory=ClimbLimits)
    """What every vehicle of the formation keeps up, as the mission declares it."""
    paths: Mapping[str, KnownPath] = msgspec.field(default_factory=dict)
    """All paths of the mission by name; none behind a leader without a companion."""
    ceiling: float = math.inf
    """Greatest height that the fence allows along the mission's first path, m above the origin."""

    def ceiling_along(self, path: str) -> float:
        """The same along a path of this name, m above the origin; infinite without a fence."""
        return self.paths[path].ceiling if path in self.paths else self.ceiling

    @property
    def most_m(self) -> float:
        """Radius of a place that may be flown by, m: the own one, or the leader's."""
        return radius_limit(min((one.spacing for one in self.others), default=math.inf))

    @property
    def surely_slips(self) -> bool:
        """Whether its nose is known not to show where it flies, not only taken not to."""
        return self.slips and (self.turn_efficiency is not None or not self.finds_slip)

    @property
    def keeps_time(self) -> bool:
        """Whether the formation goes by this vehicle's clock."""
        return self.name == self.timekeeper if self.timekeeper else self.leads

    @property
    def foreign_leader(self) -> ForeignLeader | None:
        """The leader, where it has no companion."""
        leader = self.task.leader if isinstance(self.task, FollowerTask) else None
        return leader if isinstance(leader, ForeignLeader) else None

    @property
    def leads(self) -> bool:
        """Whether this vehicle is the leader."""
        return isinstance(self.task, LeaderTask)

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Vehicles that this one hears, besides the leader."""
        return tuple(one.name for one in self.others if not one.leads)


def flown_by(plan: FlightPlan, response: AutopilotResponse) -> FlightPlan:
    """The plan with what the autopilot says of itself.

    Limits are the tighter of its own and the declared. A dead time or lag that the mission declares counts:
    it was measured on the vehicle.
    """
    airframe = plan.airframe
    lowest = max(airframe.airspeed_min, response.airspeed_min or 0.0)
    highest = min(airframe.airspeed_max, response.airspeed_max or math.inf)
    if lowest >= highest:
        # They leave nothing to fly at: what does not fit is told elsewhere.
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
    """The plan for a vehicle that turns so much of what its bank says."""
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
        plan: flown by until now.
        course: (response by bank, share of the bank that it turns); None to keep what is flown.
        speed: None to keep what is flown.
        hold: kind of the speed hold, where a response of it is given. Setpoints without the measured speed,
            as for one of the total energy, suit any kind.
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
    """Return the plan for a vehicle that banks no further than a limit (rad) that its flight has shown.

    Args:
        plan: flown by until now.
        limit: None where none was found, or where it was found to be none.
    """
    declared = plan.declared_bank or plan.airframe.max_bank
    reached = declared if limit is None else min(limit, declared)
    if reached == plan.airframe.max_bank:
        return plan
    return replace(plan, airframe=replace(plan.airframe, max_bank=reached), declared_bank=declared)


def doubting(plan: FlightPlan) -> FlightPlan:
    """Return the plan for a vehicle whose course response was found to be another, nobody knows which."""
    if plan.certainty.course.spread >= UNKNOWN.spread:
        return plan
    return replace(plan, certainty=replace(plan.certainty, course=UNKNOWN))


def certainty_of(found: HoldResponse) -> HoldCertainty:
    """Return how well a response is known that was learned in flight."""
    return HoldCertainty(
        spread=max(found.spread, DECLARED.spread), late=max(found.latest - found.late, 0.0)
    )


def response_of(plan: FlightPlan) -> VehicleResponse:
    """Return by what the vehicle of a plan is flown, for the record."""
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
    """Return what the aircraft of a plan bears, as well as its response is known."""
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
    """Return the greatest bandwidth (1/s) that the course hold of a plan bears, as well as it is known."""
    airframe = plan.airframe
    return bearable(
        airframe.course_dead_time + airframe.course_lag,
        plan.certainty.course,
        period=1.0 / plan.rate_hz,
        loop_delay=plan.settings.sliding.loop_delay_s,
        factor=0.0,
    )


def follower_law(plan: FlightPlan) -> Law:
    """Return a new object of the plan's law, within what its vehicle bears."""
    return plan.law(plan.gains, plan.settings, plan.airframe).within(bandwidth_for(plan))


def late_laws(plan: FlightPlan) -> tuple[Law, ...]:
    """Return (law of the course, law of the speed) for a late autopilot; none where nothing is late."""
    if plan.airframe.is_ideal:
        return ()
    law = follower_law(plan)
    return law, law.for_speed()


def course_settings(plan: FlightPlan) -> GuidanceSettings:
    """Return the settings of the leader's law, within what its vehicle bears."""
    bandwidth = bandwidth_for(plan).course
    return replace(
        plan.settings, sliding=replace(plan.settings.sliding, course_bandwidth=bandwidth)
    )
