"""Many formations at once, as arrays: what they fly, made of a mission, and what comes of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vfguide.companion.mission_plan import airframe_of, guidance_settings, leader_task
from vfguide.elementwise import FloatArray, wrap_angle
from vfguide.errors import VfguideError
from vfguide.guidance.formation import Slot
from vfguide.guidance.settings import GuidanceSettings
from vfguide.guidance.wind_triangle import ground_speed_on_course
from vfguide.lab.studies.array_plant import (
    Fleet,
    FleetTargets,
    Ground,
    SwingingWind,
    ellipsoid_of,
    swinging_wind,
)
from vfguide.laws.base import Law
from vfguide.laws.leader import LeaderTask
from vfguide.mission.controller import gains_of
from vfguide.mission.model import Mission
from vfguide.mission.quantity import Section
from vfguide.mission.rehearsal import Emulator
from vfguide.mission.starts import follower_start, leader_start
from vfguide.registry import laws
from vfguide.state import Airframe, Setpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A disturbance that nobody measures: the followers' holds hold something beside their setpoints."""

    course: float
    """rad, to the right."""
    speed: float
    """m/s, too fast."""
    from_s: float
    """When it begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayConditions:
    """What a batch of formations has in common."""

    task: LeaderTask
    """What every leader flies."""
    settings: GuidanceSettings
    """Settings that all laws share."""
    law: type[Law]
    """Law of every follower."""
    airframe: Airframe
    """What the laws take the vehicles for."""
    plant: Airframe
    """What the vehicles are."""
    ground: Ground
    """What they fly over, and how positions are reported."""
    rounded: bool
    """Whether reports and setpoints are rounded as MAVLink rounds them."""
    rate_hz: float
    """Steps per second."""
    duration_s: float
    """Length of each flight, s."""
    link_delay_s: float
    """Age of a leader state on arrival."""
    calibrates: bool = True
    """Whether everybody calibrates its airspeed, as companions do; here it is the true one already."""
    position_noise_m: float = 0.0
    """Standard deviation of the reported positions on each axis."""
    push: Push | None = None
    """What disturbs the followers."""
    engaged_after_s: float = 1.0
    """The companion's first try to engage its autopilot; the setpoints begin one step later."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayStart:
    """Where everybody begins, 1 + F rows by M columns, and in which wind."""

    north: FloatArray
    """m."""
    east: FloatArray
    """m."""
    course: FloatArray
    """rad."""
    airspeed: float
    """m/s."""
    wind: SwingingWind
    """Wind of each formation."""
    slot: Slot[FloatArray]
    """Offsets, F by 1 or F by M."""
    gains: Section
    """Gains of the followers' law; a value may be an array with one for each formation."""


Watcher = Callable[[float, FloatArray, Setpoint[FloatArray] | None], None]
"""Hears the time, the distances from the slots (F by M, m) and the followers' setpoints, at each step."""


def fleet_at(start: ArrayStart, conditions: ArrayConditions) -> Fleet:
    """The vehicles in the air, loitering."""
    wind_north, wind_east = start.wind.at(0.0)
    airspeed = np.full_like(start.course, start.airspeed)
    direction = start.course
    if conditions.plant.hold == "heading-hold":
        over_ground = ground_speed_on_course(airspeed, start.course, wind_north, wind_east)
        direction = np.arctan2(
            over_ground * np.sin(start.course) - wind_east,
            over_ground * np.cos(start.course) - wind_north,
        )
    return Fleet(
        airframe=conditions.plant,
        ground=conditions.ground,
        wind=start.wind,
        direction=direction,
        speed=airspeed,
        place=conditions.ground.place(start.north, start.east),
        targets=FleetTargets(None, airspeed),
    )


def conditions_of(
    mission: Mission, ground: Ground | None = None, *, rounded: bool = True
) -> ArrayConditions:
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
        (rehearsal.emulator != Emulator(), "aircraft that fly otherwise than declared"),
        (
            settings.slot_frame != "leader",
            f"slot_frame: {settings.slot_frame} (set controller.slot_frame: leader)",
        ),
    ):
        if wrong:
            raise VfguideError(f"{mission.name}: {what} cannot be flown in the array form")
    airframe = airframes.pop()
    return ArrayConditions(
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
) -> ArrayStart:
    """The mission's start for so many formations, in its wind and with its gains if none are given."""
    starts = [
        leader_start(mission),
        *(follower_start(mission, name) for name in mission.followers_by_name),
    ]
    columns = np.ones(count)
    slots = [follower.slot for follower in mission.followers]
    return ArrayStart(
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayOutcome:
    """One number for each formation; the window is the last half of the flight, as in a flight report."""

    mean_error_m: FloatArray
    """Distance from the slot, mean over followers and window."""
    max_error_m: FloatArray
    """The greatest in the window."""
    settle_10m_s: FloatArray
    """Last time a follower was 10 m or more from its slot, s; infinite: at the end still."""
    settle_1m_s: FloatArray
    """Last time a follower was 1 m or more from its slot, s; infinite: at the end still."""
    chatter_rad_s: FloatArray
    """Course setpoints' variation that is not net turning, per second; mean over followers."""
    speed_variation_m_s2: FloatArray
    """Speed setpoints' variation per second; mean over followers."""
    limited: FloatArray
    """Share of the followers' setpoints that a limit cut, in the window."""


class Watch:
    """Hears what happens, step by step; what comes after its time it leaves to others."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._total: FloatArray | float = 0.0
        self._samples = 0
        self._greatest: FloatArray | float = 0.0
        self._out_10m: FloatArray | float = 0.0
        self._out_1m: FloatArray | float = 0.0
        self._setpoint: Setpoint[FloatArray] | None = None
        self._speeding: FloatArray | float = 0.0
        self._variation: FloatArray | float = 0.0
        self._turned: FloatArray | float = 0.0
        self._limited: FloatArray | float = 0.0

    def __call__(
        self, time_s: float, distances: FloatArray, setpoint: Setpoint[FloatArray] | None
    ) -> None:
        """One instant: distances from the slots, followers by formations, and their setpoints."""
        if time_s > self._duration_s + 1e-6:
            return
        farthest = distances.max(axis=0)
        self._out_10m = np.where(farthest < 10.0, self._out_10m, time_s)
        self._out_1m = np.where(farthest < 1.0, self._out_1m, time_s)
        if time_s < self._duration_s / 2.0 - 1e-6 or setpoint is None:
            return
        self._samples += 1
        self._total = self._total + distances.mean(axis=0)
        self._greatest = np.maximum(self._greatest, farthest)
        self._limited = self._limited + np.mean(setpoint.limited, axis=0)
        if self._setpoint is not None:
            change = wrap_angle(setpoint.course - self._setpoint.course)
            self._speeding = self._speeding + np.abs(setpoint.speed - self._setpoint.speed)
            self._variation = self._variation + np.abs(change)
            self._turned = self._turned + change
        self._setpoint = setpoint

    def outcome(self) -> ArrayOutcome:
        """What it came to."""
        window = self._duration_s / 2.0
        end = self._duration_s - 1e-6
        excess = np.asarray(self._variation - np.abs(self._turned))
        out_10m, out_1m = np.asarray(self._out_10m), np.asarray(self._out_1m)
        return ArrayOutcome(
            mean_error_m=np.asarray(self._total) / self._samples,
            max_error_m=np.asarray(self._greatest),
            settle_10m_s=np.where(out_10m < end, out_10m, np.inf),
            settle_1m_s=np.where(out_1m < end, out_1m, np.inf),
            chatter_rad_s=np.maximum(excess, 0.0).mean(axis=0) / window,
            speed_variation_m_s2=np.asarray(self._speeding).mean(axis=0) / window,
            limited=np.asarray(self._limited) / self._samples,
        )
