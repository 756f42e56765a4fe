"""From a mission file to what one companion has to know: radians, metres, and its own part only."""

import math
from dataclasses import dataclass

from vfguide.companion.supervisor import Patience
from vfguide.frames import LocalFrame
from vfguide.guidance.formation import FieldGains, Slot
from vfguide.guidance.give_way import SlotLimits
from vfguide.guidance.leader import LeaderTask
from vfguide.guidance.limits import GRAVITY
from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.observer import ObserverGains
from vfguide.guidance.path import Circle, Direction, Line, Path, Racetrack
from vfguide.guidance.settings import GuidanceSettings, PathGains, SlidingGains
from vfguide.guidance.virtual_leader import KnownLeader
from vfguide.mavlink.adapter import AutopilotAdapter, Vehicle
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4
from vfguide.mission.flight_path import CirclePath, FlightPath, LinePath
from vfguide.mission.model import Mission
from vfguide.mission.model import Slot as SlotOffset
from vfguide.mission.vehicle import Vehicle as MissionVehicle
from vfguide.state import Airframe


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
    patience: Patience
    """How long silences are borne."""
    task: LeaderTask | FollowerTask
    """What to fly: a path as the leader, or a slot as a follower."""

    @property
    def leads(self) -> bool:
        """Whether this vehicle is the leader."""
        return isinstance(self.task, LeaderTask)


def flight_plan(mission: Mission, name: str) -> FlightPlan:
    """The part of the vehicle with this name.

    Raises:
        KeyError: nobody of this name flies in the mission.
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
        airframe=airframe_of(vehicle),
        patience=Patience(**mission.patience.model_dump()),
        task=task,
    )


def local_frame(mission: Mission) -> LocalFrame:
    """The frame around the mission's origin."""
    origin = mission.origin
    return LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)


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
    )


def adapter_of(vehicle: MissionVehicle) -> AutopilotAdapter:
    """How to speak to a vehicle's autopilot."""
    address = Vehicle(
        system_id=vehicle.system_id,
        component_id=vehicle.component_id,
        hold=vehicle.plant,
        lateral_acceleration=GRAVITY * math.tan(math.radians(vehicle.max_bank_deg)),
    )
    return ArduPlane(address) if vehicle.autopilot == "ardupilot" else Px4(address)


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
        field_type=chosen.type,
        field=FieldGains(
            k_x=chosen.k_x,
            k_y=chosen.k_y,
            chi_inf=math.radians(chosen.chi_inf_deg),
            v_inf=chosen.v_inf_m_s,
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
    )
