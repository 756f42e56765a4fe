"""From a mission file to what one companion has to know: radians, metres, and its own part only."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

from vfguide.companion.supervisor import Patience
from vfguide.frames import LocalFrame
from vfguide.guidance.formation import FieldGains, Slot
from vfguide.guidance.give_way import SlotLimits
from vfguide.guidance.leader import LeaderTask
from vfguide.guidance.limits import GRAVITY
from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.observer import ObserverGains
from vfguide.guidance.pace import paced, without_own_speed, without_swing
from vfguide.guidance.path import Circle, Direction, Line, Path, Racetrack
from vfguide.guidance.settings import (
    AxisGains,
    FollowerLaw,
    GuidanceSettings,
    MpcWeights,
    PathGains,
    PidGains,
    SlidingGains,
)
from vfguide.guidance.virtual_leader import KnownLeader
from vfguide.mavlink.adapter import AutopilotAdapter, Vehicle
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.detected import DetectedAutopilot
from vfguide.mavlink.parameters import AutopilotResponse
from vfguide.mavlink.px4 import Px4
from vfguide.mission.controller import ControllerType, Pid
from vfguide.mission.flight_path import CirclePath, FlightPath, LinePath
from vfguide.mission.model import Mission
from vfguide.mission.model import Slot as SlotOffset
from vfguide.mission.vehicle import Vehicle as MissionVehicle
from vfguide.state import Airframe

ADAPTERS: dict[str, Callable[[Vehicle], AutopilotAdapter]] = {
    "auto": DetectedAutopilot,
    "ardupilot": ArduPlane,
    "px4": Px4,
    # What MAVSDK carries are PX4's messages.
    "mavsdk": Px4,
}
"""By what a mission calls an autopilot."""


LAWS: dict[ControllerType, FollowerLaw] = {
    "slot": "field",
    "article": "field",
    "pid": "pid",
    "mpc": "mpc",
}
"""What keeps a follower on its slot, by the mission's word for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerTask:
    """A slot, and what a follower knows of the one it follows."""

    slot: Slot[float]
    """Its place in the formation."""
    leader: KnownLeader
    """What the mission tells about the leader."""
    airspeed: float
    """To fly away at when the formation breaks up, m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherVehicle:
    """Another vehicle of the formation, as far as keeping clear of it needs it."""

    name: str
    """Of the vehicle."""
    rank: int
    """Its place in the mission, the leader first: no two have the same."""
    leads: bool
    """Whether it is the leader."""
    slot: Slot[float]
    """Its slot; the leader's is at its own place."""
    spacing: float
    """From that slot to one's own, m, level."""
    lateral_acceleration: float
    """g tan(phi_max), m/s²: how hard it can turn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """One vehicle's part of a mission."""

    name: str
    """Of the vehicle."""
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
    """The laws' gains and switches."""
    airframe: Airframe
    """Response and limits."""
    asks_response: bool
    """Whether response and limits are the autopilot's to tell."""
    slips: bool
    """Whether the vehicle's nose leaves the direction of flight in turns."""
    patience: Patience
    """How long silences are borne."""
    engage_from: tuple[str, ...]
    """Modes of the autopilot out of which it may be engaged by itself, by name."""
    task: LeaderTask | FollowerTask
    """What to fly: a path as the leader, or a slot as a follower."""
    height: float
    """Of the altitude above the mission's origin, m."""
    rank: int
    """Its own place in the mission, the leader first."""
    others: tuple[OtherVehicle, ...]
    """All other vehicles of the formation."""

    @property
    def leads(self) -> bool:
        """Whether this vehicle is the leader."""
        return isinstance(self.task, LeaderTask)

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Vehicles that this one hears, besides the leader."""
        return tuple(one.name for one in self.others if not one.leads)


def flight_plan(mission: Mission, name: str) -> FlightPlan:
    """The part of the vehicle with this name.

    Raises:
        KeyError: the mission has no vehicle of this name.
    """
    vehicle = mission.vehicles[name]
    height = mission.origin.altitude_amsl_m + mission.height_above_origin_m
    task: LeaderTask | FollowerTask
    if name == mission.leader.vehicle:
        task = leader_task(mission)
    else:
        offset = mission.followers_by_name[name].slot
        height += offset.up_m
        task = follower_task(mission, vehicle, offset)
    return FlightPlan(
        name=name,
        system_id=vehicle.system_id,
        component_id=vehicle.component_id,
        rate_hz=mission.rehearsal.rate_hz,
        frame=local_frame(mission),
        altitude_amsl=height,
        settings=guidance_settings(mission),
        airframe=replace(airframe_of(vehicle), cruise=mission.leader.airspeed_m_s),
        asks_response=vehicle.response == "auto",
        slips=vehicle.slips,
        patience=Patience(**mission.patience.model_dump()),
        engage_from=vehicle.engage_from,
        task=task,
        height=height - mission.origin.altitude_amsl_m,
        rank=formation_of(mission).index(name),
        others=other_vehicles(mission, name),
    )


def formation_of(mission: Mission) -> list[str]:
    """Names of all vehicles by rank."""
    return [mission.leader.vehicle, *mission.followers_by_name]


def flown_by(plan: FlightPlan, response: AutopilotResponse) -> FlightPlan:
    """The plan with what the autopilot says of itself; limits are the tighter of its own and the declared."""
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
    )
    return replace(plan, airframe=flown, asks_response=False)


def course_settings(plan: FlightPlan) -> GuidanceSettings:
    """Settings for what goes out as a course, by how late that takes effect."""
    airframe = plan.airframe
    slowed = without_swing if plan.slips else paced
    return slowed(
        plan.settings,
        airframe.course_dead_time + airframe.course_lag,
        period=1.0 / plan.rate_hz,
        speed=airframe.cruise,
    )


def speed_settings(plan: FlightPlan) -> GuidanceSettings:
    """Settings for what goes out as a speed, by how late that takes effect."""
    airframe, period = plan.airframe, 1.0 / plan.rate_hz
    delay = airframe.speed_dead_time + airframe.speed_lag
    if not plan.slips:
        return paced(plan.settings, delay, period=period, speed=airframe.cruise)
    return without_own_speed(
        plan.settings, delay, airframe.beta, period=period, speed=airframe.cruise
    )


def local_frame(mission: Mission) -> LocalFrame:
    """The frame around the mission's origin."""
    origin = mission.origin
    return frame_at(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)


@lru_cache
def frame_at(latitude_deg: float, longitude_deg: float, altitude_amsl: float) -> LocalFrame:
    """The frame at an origin (degrees, m): one for all of a process, who share what they read."""
    return LocalFrame(latitude_deg, longitude_deg, altitude_amsl)


def airframe_of(vehicle: MissionVehicle) -> Airframe:
    """Response and limits of a vehicle."""
    return Airframe(
        hold=vehicle.plant,
        alpha=vehicle.alpha_1_s,
        beta=vehicle.beta_1_s,
        airspeed_min=vehicle.airspeed_range_m_s[0],
        airspeed_max=vehicle.airspeed_range_m_s[1],
        max_bank=math.radians(vehicle.max_bank_deg),
        max_acceleration=vehicle.max_acceleration_m_s2,
        course_dead_time=vehicle.course_dead_time_s,
        course_lag=vehicle.course_lag_s,
        speed_dead_time=vehicle.speed_dead_time_s,
        speed_lag=vehicle.speed_lag_s,
    )


def adapter_of(vehicle: MissionVehicle) -> AutopilotAdapter:
    """How to speak to a vehicle's autopilot."""
    address = Vehicle(
        system_id=vehicle.system_id,
        component_id=vehicle.component_id,
        hold=vehicle.plant,
        lateral_acceleration=GRAVITY * math.tan(math.radians(vehicle.max_bank_deg)),
        px4_steering=vehicle.px4_steering,
    )
    return ADAPTERS[vehicle.autopilot](address)


def follower_task(mission: Mission, vehicle: MissionVehicle, offset: SlotOffset) -> FollowerTask:
    """A slot of the mission, for a vehicle that holds it."""
    leads = leader_task(mission)
    lowest, highest = vehicle.airspeed_range_m_s
    return FollowerTask(
        slot=Slot(forward=offset.forward_m, right=offset.right_m),
        leader=KnownLeader(
            path=leads.path,
            path_gains=leads.path_gains,
            airspeed=leads.airspeed,
            rate_filter_s=mission.controller.rate_filter_s,
        ),
        airspeed=min(max(leads.airspeed, lowest), highest),
    )


def other_vehicles(mission: Mission, name: str) -> tuple[OtherVehicle, ...]:
    """All vehicles but the one of this name."""
    own = slot_of(mission, name)
    found = []
    for rank, other in enumerate(formation_of(mission)):
        if other == name:
            continue
        slot = slot_of(mission, other)
        bank = math.radians(mission.vehicles[other].max_bank_deg)
        found.append(
            OtherVehicle(
                name=other,
                rank=rank,
                leads=rank == 0,
                slot=slot,
                spacing=math.hypot(slot.forward - own.forward, slot.right - own.right),
                lateral_acceleration=GRAVITY * math.tan(bank),
            )
        )
    return tuple(found)


def slot_of(mission: Mission, name: str) -> Slot[float]:
    """The slot of a vehicle, the leader's at its own place."""
    if name == mission.leader.vehicle:
        return Slot(forward=0.0, right=0.0)
    offset = mission.followers_by_name[name].slot
    return Slot(forward=offset.forward_m, right=offset.right_m)


def leader_task(mission: Mission) -> LeaderTask:
    """Path, field, cruise, and whom to give way to."""
    approach_deg = mission.path.approach_deg if isinstance(mission.path, LinePath) else 90.0
    return LeaderTask(
        path=path_of(mission.path),
        path_gains=PathGains(gain=mission.path.gain, approach_angle=math.radians(approach_deg)),
        airspeed=mission.leader.airspeed_m_s,
        followers=tuple(
            SlotLimits(
                slot=Slot(forward=follower.slot.forward_m, right=follower.slot.right_m),
                airspeed_min=mission.vehicles[follower.vehicle].airspeed_range_m_s[0],
                airspeed_max=mission.vehicles[follower.vehicle].airspeed_range_m_s[1],
            )
            for follower in mission.followers
        ),
    )


def path_of(path: FlightPath) -> Path:
    """The path as the laws see it."""
    if isinstance(path, LinePath):
        point = path.point
        return Line(north=point.north_m, east=point.east_m, course=math.radians(path.course_deg))
    direction: Direction = 1 if path.direction == "clockwise" else -1
    north, east = path.centre.north_m, path.centre.east_m
    if isinstance(path, CirclePath):
        return Circle(north=north, east=east, radius=path.radius_m, direction=direction)
    return Racetrack(
        north=north,
        east=east,
        course=math.radians(path.course_deg),
        leg=path.leg_m,
        radius=path.radius_m,
        direction=direction,
        easement=path.easement_m,
    )


def guidance_settings(mission: Mission) -> GuidanceSettings:
    """Gains and switches."""
    chosen = mission.controller
    return GuidanceSettings(
        field_type="article" if chosen.type == "article" else "slot",
        field=FieldGains(
            k_x=chosen.k_x,
            k_y=chosen.k_y,
            chi_inf=math.radians(chosen.chi_inf_deg),
            v_inf=chosen.v_inf_m_s,
            # What keeps the article's field off its slot on a turn is no disturbance.
            integral_s=0.0 if chosen.type == "article" else chosen.integral_s,
        ),
        sliding=SlidingGains(
            kappa=chosen.kappa,
            epsilon=chosen.epsilon,
            boundary_layer_factor=chosen.boundary_layer_factor,
            loop_delay_s=chosen.loop_delay_s,
            rho=chosen.rho,
        ),
        observer=ObserverGains(
            gamma=chosen.observer.gamma, rho=chosen.observer.rho, sigma=chosen.observer.sigma
        ),
        filters=FilterTimes(position_s=chosen.position_filter_s, wind_s=chosen.wind_filter_s),
        rate_filter_s=chosen.rate_filter_s,
        speed_source=chosen.leader_speed_source,
        predict_leader=chosen.predict_leader,
        wind_feedforward=chosen.wind_feedforward,
        give_way=chosen.give_way,
        slot_frame="leader" if chosen.type == "article" else chosen.slot_frame,
        rate_feedforward=chosen.rate_feedforward,
        law=LAWS[chosen.type],
        pid=pid_gains(chosen.pid),
        mpc=MpcWeights(
            horizon_s=chosen.mpc.horizon_s,
            intervals=chosen.mpc.intervals,
            velocity=chosen.mpc.velocity_weight_s2,
            acceleration=chosen.mpc.acceleration_weight_s4,
            max_course=math.radians(chosen.mpc.max_course_deg),
            integral_s=chosen.mpc.integral_s,
        ),
    )


def pid_gains(chosen: Pid) -> PidGains[float]:
    """Gains of the PID baseline."""
    return PidGains(
        lateral=AxisGains(
            proportional=chosen.lateral_p_rad_m,
            integral=chosen.lateral_i_rad_m_s,
            derivative=chosen.lateral_d_rad_s_m,
            derivative_filter_s=chosen.derivative_filter_s,
            greatest=math.radians(chosen.max_course_deg),
        ),
        longitudinal=AxisGains(
            proportional=chosen.longitudinal_p_1_s,
            integral=chosen.longitudinal_i_1_s2,
            derivative=chosen.longitudinal_d,
            derivative_filter_s=chosen.derivative_filter_s,
            greatest=chosen.max_speed_m_s,
        ),
    )
