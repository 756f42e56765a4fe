"""A mission's own flight in the array form: one formation, or as many alike as wanted."""

import numpy as np

from vfguide.companion.plan import airframe_of, guidance_settings, leader_task
from vfguide.errors import VfguideError
from vfguide.guidance.formation import Slot
from vfguide.lab.studies.array_case import Conditions, Start
from vfguide.lab.studies.array_ground import Ground, ellipsoid_of
from vfguide.lab.studies.array_wind import SwingingWind, swinging_wind
from vfguide.mission.controller import gains_of
from vfguide.mission.model import Mission
from vfguide.mission.quantity import Section
from vfguide.mission.starts import follower_start, leader_start
from vfguide.registry import laws


def conditions_of(
    mission: Mission, ground: Ground | None = None, *, rounded: bool = True
) -> Conditions:
    """What every formation of a mission has in common; slots are fixed to the leader's measured motion.

    Args:
        mission: the mission.
        ground: to fly over; the ellipsoid if absent, as in lockstep.
        rounded: whether reports and setpoints are rounded as MAVLink rounds them.

    Raises:
        VfguideError: the mission has something that the array form does not: vehicles that differ, a lossy
            or jittering link, a leader without measured ground speed, vehicles that answer late, slots that
            turn with anything but the leader's measured course.
    """
    airframes = {airframe_of(vehicle) for vehicle in mission.vehicles.values()}
    rehearsal = mission.rehearsal
    settings = guidance_settings(mission)
    for wrong, what in (
        (len(airframes) > 1, "vehicles that differ"),
        (rehearsal.link_loss > 0.0 or rehearsal.link_jitter_s > 0.0, "loss or jitter on the link"),
        (rehearsal.radio is not None, "a shared radio"),
        (settings.speed_source == "observer", "a leader without measured ground speed"),
        (any(not one.is_ideal for one in airframes), "vehicles that answer late"),
        (
            settings.slot_frame != "leader",
            f"slot_frame: {settings.slot_frame} (set controller.slot_frame: leader)",
        ),
    ):
        if wrong:
            raise VfguideError(f"{mission.name}: {what} cannot be flown in the array form")
    airframe = airframes.pop()
    return Conditions(
        task=leader_task(mission),
        settings=settings,
        law=laws.find(mission.controller.type),
        airframe=airframe,
        plant=airframe,
        ground=ground or ellipsoid_of(mission),
        rounded=rounded,
        rate_hz=rehearsal.rate_hz,
        duration_s=rehearsal.duration_s,
        link_delay_s=rehearsal.link_delay_s,
        position_noise_m=rehearsal.position_noise_m,
    )


def start_of(
    mission: Mission,
    count: int = 1,
    *,
    wind: SwingingWind | None = None,
    gains: Section | None = None,
) -> Start:
    """The mission's start for so many formations, in its wind and with its gains if none are given."""
    starts = [
        leader_start(mission),
        *(follower_start(mission, name) for name in mission.followers_by_name),
    ]
    columns = np.ones(count)
    slots = [follower.slot for follower in mission.followers]
    return Start(
        north=np.array([start.north_m for start in starts])[:, None] * columns,
        east=np.array([start.east_m for start in starts])[:, None] * columns,
        course=np.radians([start.course_deg for start in starts])[:, None] * columns,
        airspeed=mission.leader.airspeed_m_s,
        wind=wind or swinging_wind(mission.wind, count),
        slot=Slot(
            forward=np.array([[slot.forward_m] for slot in slots]) * columns,
            right=np.array([[slot.right_m] for slot in slots]) * columns,
        ),
        gains=gains_of(mission.controller) if gains is None else gains,
    )
