"""Flight plans from a mission: each companion's own part, in radians and metres."""

import math
from collections.abc import Mapping
from functools import lru_cache

from msgspec.structs import replace

from vfguide.companion.plan import (
    STOPPED_S,
    FlightPlan,
    FollowerTask,
    ForeignLeader,
    KnownPath,
    LeadPlan,
    OtherVehicle,
)
from vfguide.companion.supervisor import ModeTimeouts
from vfguide.errors import require
from vfguide.formation.orders import STACK_M
from vfguide.frames import LocalFrame
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.formation import Slot, SlotLimits
from vfguide.guidance.intended_motion import KnownLeader
from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.response import DECLARED, UNKNOWN, Certainty
from vfguide.guidance.sliding_laws import GuidanceSettings, ObserverGains, PathGains, SlidingGains
from vfguide.laws.leader import LeaderTask
from vfguide.mavlink.adapter import AutopilotAdapter, Vehicle
from vfguide.mission.flight_limits import climb_limits, top_of
from vfguide.mission.flight_path import PathShape, height_span, path_of
from vfguide.mission.model import Mission
from vfguide.mission.model import Slot as SlotOffset
from vfguide.mission.vehicle import Vehicle as MissionVehicle
from vfguide.registry import autopilots, laws, leader_laws
from vfguide.state import Airframe, SpeedHold

CREWED_M = 65.0
"""Distance kept from a leader heard by ADS-B, m; its slots are 100 m away or more."""


LEAST_SILENCE_S = 2.5
"""Least silence of a leader without a companion, s: one message a second, half a second late, one lost."""


def flight_plan(mission: Mission, name: str) -> FlightPlan:
    """Return the flight plan of the named vehicle.

    Raises:
        KeyError: the mission has no vehicle of this name.
        VfguideError: a library of its law is not installed.
    """
    vehicle = mission.vehicles[name]
    height = mission.origin.altitude_amsl_m + mission.height_above_origin_m
    up = 0.0
    paths = known_paths(mission)
    task: LeaderTask | FollowerTask
    if name == mission.leader.vehicle:
        task = leader_task(mission)
    else:
        offset = mission.followers_by_name[name].slot
        up = offset.up_m
        height += up
        task = follower_task(mission, vehicle, offset)
        require(*laws.find(mission.controller.type).libraries)
    return FlightPlan(
        name=name,
        system_id=vehicle.system_id,
        component_id=vehicle.component_id,
        rate_hz=mission.rehearsal.rate_hz,
        frame=local_frame(mission),
        altitude_amsl=height,
        settings=guidance_settings(mission),
        law=laws.find(mission.controller.type),
        gains=mission.controller,
        airframe=replace(airframe_of(vehicle), cruise=mission.leader.airspeed_m_s),
        asks_response=vehicle.asks_response,
        certainty=certainty_of(vehicle),
        slips=may_slip(vehicle),
        speed_hold=speed_hold_of(vehicle),
        finds_slip=finds_slip(vehicle),
        timeouts=timeouts_of(mission),
        engage_from=vehicle.engage_from,
        task=task,
        height=height - mission.origin.altitude_amsl_m,
        lowest=height - mission.origin.altitude_amsl_m + lowest_of(paths),
        up=up,
        rank=formation_of(mission).index(name),
        others=other_vehicles(mission, name),
        timekeeper=mission.timekeeper,
        traffic_m=mission.avoidance.traffic_m,
        lead=lead_plan(mission, name) if mission.deputies else None,
        loiter_up=loiter_step(mission) * formation_of(mission).index(name),
        loiter_room=fence_room(mission) - loiter_step(mission) * len(mission.followers),
        climb_limits=climb_limits(mission),
        paths=paths,
        ceiling=top_of((mission.fence, mission.path.fence)),
    )


def loiter_step(mission: Mission) -> float:
    """Return the height step between two loitering vehicles after an abort, m: all fit below the fence."""
    room = fence_room(mission) / max(len(mission.followers), 1)
    return min(max(room, 0.0), STACK_M)


def fence_room(mission: Mission) -> float:
    """Return the height from the flying height to the top of the lowest fence, m; infinite without one."""
    fences = [mission.fence, *(one.fence for one in mission.paths_by_name.values())]
    return top_of(fences) - mission.height_above_origin_m


def known_paths(mission: Mission) -> dict[str, KnownPath]:
    """Return the mission's paths by name; empty where its leader has no companion."""
    if mission.leader.is_foreign:
        return {}
    checks = mission.path_checks
    return {
        name: replace(
            known_path(shape), check=checks[name], ceiling=top_of((mission.fence, shape.fence))
        )
        for name, shape in mission.paths_by_name.items()
    }


def known_path(shape: PathShape) -> KnownPath:
    """Return a path of a mission, and the field around it."""
    path = path_of(shape)
    gains = PathGains(
        gain=shape.gain,
        approach_angle=shape.approach_angle,
        chosen="gain" in shape.model_fields_set,
    )
    return KnownPath(path, gains, heights=height_span(path))


def lowest_of(paths: Mapping[str, KnownPath]) -> float:
    """Return the lowest place of any path, m above the flying height; 0 if none is below it."""
    return min([0.0, *(known.heights[0] for known in paths.values())])


def lead_plan(mission: Mission, name: str) -> LeadPlan:
    """Return who may lead, and the named vehicle's task while another leads."""
    slot = SlotOffset(forward_m=0.0, right_m=0.0)
    if name != mission.leader.vehicle:
        slot = mission.followers_by_name[name].slot
    require(*laws.find(mission.controller.type).libraries)
    return LeadPlan(
        order=(mission.leader.vehicle, *mission.deputies),
        task=follower_task(mission, mission.vehicles[name], slot),
        altitude_amsl=mission.origin.altitude_amsl_m + mission.height_above_origin_m,
    )


def timeouts_of(mission: Mission) -> ModeTimeouts:
    """Return the silences that the mission tolerates."""
    patience = ModeTimeouts(**mission.patience.model_dump())
    if not mission.leader.is_foreign:
        return patience
    return replace(patience, leader_s=max(patience.leader_s, LEAST_SILENCE_S))


def formation_of(mission: Mission) -> list[str]:
    """Return the names of all vehicles by rank."""
    return [mission.leader.vehicle, *mission.followers_by_name]


def local_frame(mission: Mission) -> LocalFrame:
    """Return the frame around the mission's origin."""
    origin = mission.origin
    return frame_at(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)


@lru_cache
def frame_at(latitude_deg: float, longitude_deg: float, altitude_amsl: float) -> LocalFrame:
    """Return the frame at an origin (degrees, m), shared by a whole process."""
    return LocalFrame(latitude_deg, longitude_deg, altitude_amsl)


def airframe_of(vehicle: MissionVehicle) -> Airframe:
    """Return response and limits of a vehicle."""
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
        # A vehicle that slips is an ArduPlane, which has a total-energy hold, too.
        speed_hold="total-energy" if may_slip(vehicle) else speed_hold_of(vehicle),
        height_delay=vehicle.height_delay_s,
        climb_max=vehicle.climb_range_m_s[1],
        sink_max=-vehicle.climb_range_m_s[0],
    )


def may_slip(vehicle: MissionVehicle) -> bool:
    """Check whether to assume slip until more is known.

    A vehicle that holds course and ground speed tells nothing of its turns through the air: `auto` means no.
    """
    if vehicle.slips is None or vehicle.slips == "auto":
        is_open = vehicle.slips == "auto" or not vehicle.declares_response
        return is_open and vehicle.plant == "heading-hold"
    return vehicle.slips


def finds_slip(vehicle: MissionVehicle) -> bool:
    """Check whether slip is to be found out in flight."""
    return vehicle.plant == "heading-hold" and vehicle.slips in {None, "auto"}


def speed_hold_of(vehicle: MissionVehicle) -> SpeedHold:
    """Return the kind of speed hold; an unknown one may swing as a total-energy hold does."""
    if vehicle.speed_hold is not None:
        return vehicle.speed_hold
    return "first-order" if vehicle.declares_response else "total-energy"


def certainty_of(vehicle: MissionVehicle) -> Certainty:
    """Return the certainty of the response: declared, or unknown where the mission leaves it open."""
    given = vehicle.model_fields_set
    return Certainty(
        course=DECLARED if "alpha_1_s" in given else UNKNOWN,
        speed=DECLARED if "beta_1_s" in given else UNKNOWN,
    )


def adapter_of(vehicle: MissionVehicle) -> AutopilotAdapter:
    """Return the protocol adapter of a vehicle's autopilot."""
    address = Vehicle(
        system_id=vehicle.system_id,
        component_id=vehicle.component_id,
        hold=vehicle.plant,
        lateral_acceleration=GRAVITY * math.tan(math.radians(vehicle.max_bank_deg)),
        px4_steering=vehicle.px4_steering,
    )
    adapter: AutopilotAdapter = autopilots.find(vehicle.autopilot)(address)
    return adapter


def follower_task(mission: Mission, vehicle: MissionVehicle, offset: SlotOffset) -> FollowerTask:
    """Return the task of holding a slot of the mission."""
    lowest, highest = vehicle.airspeed_range_m_s
    return FollowerTask(
        slot=Slot(forward=offset.forward_m, right=offset.right_m),
        follows_height=mission.follows_height,
        leader=foreign_leader(mission) if mission.leader.is_foreign else known_leader(mission),
        airspeed=min(max(mission.leader.airspeed_m_s, lowest), highest),
    )


def known_leader(mission: Mission) -> KnownLeader:
    """Return the mission's data of a leader with a companion."""
    leads = leader_task(mission)
    return KnownLeader(
        path=leads.path,
        path_gains=leads.path_gains,
        airspeed=leads.airspeed,
        rate_filter_s=mission.controller.rate_filter_s,
        height=mission.height_above_origin_m,
    )


def foreign_leader(mission: Mission) -> ForeignLeader:
    """Return the mission's data of a leader without a companion."""
    leader, vehicle = mission.leader, mission.leader_vehicle
    return ForeignLeader(
        connection=leader.connection or "",
        system_id=vehicle.system_id if leader.follows == "mavlink" else None,
        icao_address=leader.icao_address,
        least_delay_s=leader.least_delay_s,
        airframe=airframe_of(vehicle),
        rate_filter_s=mission.controller.rate_filter_s,
        height=mission.height_above_origin_m,
    )


def other_vehicles(mission: Mission, name: str) -> tuple[OtherVehicle, ...]:
    """Return all vehicles but the named one."""
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
                speed_answer_s=1.0 / mission.vehicles[other].beta_1_s,
                stopped_s=LEAST_SILENCE_S if mission.leader.is_foreign else STOPPED_S,
                may_stop=mission.vehicles[other].may_stop,
                least_m=CREWED_M if rank == 0 and mission.leader.follows == "adsb" else 0.0,
            )
        )
    return tuple(found)


def slot_of(mission: Mission, name: str) -> Slot:
    """Return the slot of a vehicle; the leader's is at its own place."""
    if name == mission.leader.vehicle:
        return Slot(forward=0.0, right=0.0)
    offset = mission.followers_by_name[name].slot
    return Slot(forward=offset.forward_m, right=offset.right_m)


def leader_task(mission: Mission) -> LeaderTask:
    """Return path, law, airspeed, and the followers' slots and limits."""
    known = known_path(mission.path)
    return LeaderTask(
        path=known.path,
        path_gains=known.gains,
        airspeed=mission.leader.airspeed_m_s,
        height=mission.height_above_origin_m,
        law=leader_laws.find(mission.leader.law),
        gains=mission.leader.law_gains,
        followers=tuple(
            SlotLimits(
                slot=Slot(forward=follower.slot.forward_m, right=follower.slot.right_m),
                airspeed_min=mission.vehicles[follower.vehicle].airspeed_range_m_s[0],
                airspeed_max=mission.vehicles[follower.vehicle].airspeed_range_m_s[1],
            )
            for follower in mission.followers
        ),
    )


def guidance_settings(mission: Mission) -> GuidanceSettings:
    """Return the gains and switches of every law."""
    chosen = mission.controller
    return GuidanceSettings(
        sliding=SlidingGains(
            kappa=chosen.kappa,
            epsilon=chosen.epsilon,
            boundary_layer_factor=chosen.layer_factor,
            loop_delay_s=chosen.loop_delay_s,
            rho=chosen.rho,
            amplification=chosen.amplification,
        ),
        observer=ObserverGains(
            gamma=chosen.observer.gamma, rho=chosen.observer.rho, sigma=chosen.observer.sigma
        ),
        filters=FilterTimes(
            position_s=chosen.position_filter_s,
            wind_s=chosen.wind_filter_s,
            velocity_s=chosen.velocity_filter_s,
        ),
        rate_filter_s=chosen.rate_filter_s,
        speed_source=chosen.leader_speed_source,
        predict_leader=chosen.predict_leader,
        wind_feedforward=chosen.wind_feedforward,
        give_way=chosen.give_way,
        # The intended motion of a leader without a companion is unknown.
        slot_frame="leader"
        if mission.leader.is_foreign
        else laws.find(chosen.type).slot_frame or chosen.slot_frame,
    )
