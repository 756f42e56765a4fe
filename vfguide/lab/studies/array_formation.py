"""Many formations at once, as arrays: the followers, and the step of all of them.

The followers' laws are the same objects that companions fly, one for each batch. A law that takes no
arrays is stepped vehicle by vehicle.

What a lockstep flight does through MAVLink bytes and companions is done here directly, step for step:
every vehicle reports, is navigated, is guided, and flies on. The same functions of `vfguide.guidance` are
called, with arrays. Row 0 of an array is the leaders, the rows below are their followers; a column is a
formation.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import numpy as np
from msgspec.structs import replace
from numpy.random import Generator

from vfguide.companion.autopilot_clock import AutopilotClock
from vfguide.companion.own_vehicle import PERIOD_SHARE
from vfguide.elementwise import TURN, FloatArray, clip, hypot, wrap_angle
from vfguide.guidance.airspeed_calibration import Calibration, calibrated, calibration_of
from vfguide.guidance.formation import Slot
from vfguide.guidance.leader_motion import MotionEstimate, estimated_motion, motion_at_first
from vfguide.guidance.navigation import Sample, first_state, navigate
from vfguide.lab.studies.array_case import ArrayConditions, ArrayStart, Push, Watcher, fleet_at
from vfguide.lab.studies.array_plant import Fleet, Report
from vfguide.laws.keeper import SlotKeeper
from vfguide.laws.leader import leader_step
from vfguide.mavlink.adapter import DIGITS
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mission.quantity import Section
from vfguide.state import Gusts, LeaderState, Setpoint, VehicleState


class Followers(Protocol):
    """All followers of a batch, by one law."""

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """Setpoints by a leader state that is as old as it is."""

    def reset(self) -> None:
        """Forget what was learned."""


class TogetherFollowers:
    """By a law that takes arrays."""

    def __init__(self, start: ArrayStart, conditions: ArrayConditions) -> None:
        law = conditions.law(start.gains, conditions.settings, conditions.airframe)
        self._keeper: SlotKeeper[FloatArray] = SlotKeeper(law, start.slot)

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of all."""
        return self._keeper.step(state, leader, period=period).setpoint

    def reset(self) -> None:
        """Forget what was learned."""
        self._keeper.reset()


class SeparateFollowers:
    """By a law that takes one vehicle at a time."""

    def __init__(self, start: ArrayStart, conditions: ArrayConditions) -> None:
        self._shape = start.north[1:].shape
        self._keepers: dict[tuple[int, ...], SlotKeeper[float]] = {
            (row, column): SlotKeeper(
                conditions.law(
                    gains_of_one(start.gains, column), conditions.settings, conditions.airframe
                ),
                Slot(
                    forward=float(start.slot.forward[row, column]),
                    right=float(start.slot.right[row, column]),
                ),
            )
            for row, column in np.ndindex(self._shape)
        }

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of each."""
        course, speed = np.empty(self._shape), np.empty(self._shape)
        limited = np.empty(self._shape, dtype=bool)
        for (row, column), keeper in self._keepers.items():
            setpoint = keeper.step(
                one_of(state, (row, column)), one_of(leader, (column,)), period=period
            ).setpoint
            course[row, column], speed[row, column] = setpoint.course, setpoint.speed
            limited[row, column] = setpoint.limited
        return Setpoint(course=course, speed=speed, turn_limited=limited)

    def reset(self) -> None:
        """Every one of them."""
        for keeper in self._keepers.values():
            keeper.reset()


One = TypeVar("One", VehicleState[Any], LeaderState[Any], Gusts[Any])


def one_of(state: One, place: tuple[int, ...]) -> One:
    """One vehicle's state out of many; what is no array is everybody's."""
    return picked(state, lambda values: float(values[place]))


def picked(state: One, pick: Callable[[FloatArray], float | FloatArray]) -> One:
    """A state of some of its vehicles: its arrays, and those of the states within it, by `pick`."""
    taken: dict[str, Any] = {}
    for name in state.__struct_fields__:
        value = getattr(state, name)
        if isinstance(value, np.ndarray):
            taken[name] = pick(value)
        elif isinstance(value, Gusts):
            taken[name] = picked(value, pick)
    return replace(state, **taken)


def gains_of_one(gains: Section, column: int) -> Section:
    """The gains of one formation: those of its column where they are arrays."""
    own = {
        name: value[column].item()
        for name in type(gains).model_fields
        if isinstance(value := getattr(gains, name), np.ndarray)
    }
    return gains.model_copy(update=own)


def followers_of(start: ArrayStart, conditions: ArrayConditions) -> Followers:
    """The followers of a batch."""
    together = conditions.law.arrays
    return (TogetherFollowers if together else SeparateFollowers)(start, conditions)


class Stream:
    """Setpoints on their way to ArduPlane: rounded, and sent where they change or have not been for a while.

    As `vfguide.mavlink.adapter` does it, for each vehicle and for course and speed apart.
    """

    def __init__(self) -> None:
        self._content: FloatArray | None = None
        self._sent: FloatArray | None = None
        self._held: FloatArray | None = None

    def update(
        self, course: FloatArray, speed: FloatArray, now: float
    ) -> tuple[FloatArray, FloatArray]:
        """(course, speed) that the autopilots hold from now on."""
        degrees = np.round(np.degrees(course % TURN), 3) % 360.0
        fresh = np.stack([degrees, speed])
        content = decimals(fresh)
        if self._content is None or self._sent is None or self._held is None:
            self._content, self._held = content, fresh
            self._sent = np.full_like(fresh, now)
        else:
            due = (content != self._content) | (now - self._sent >= ArduPlane.keep_alive_s)
            self._content = np.where(due, content, self._content)
            self._sent = np.where(due, now, self._sent)
            self._held = np.where(due, fresh, self._held)
        single = self._held.astype(np.float32).astype(np.float64)
        return np.radians(single[0]), single[1]


def decimals(values: FloatArray) -> FloatArray:
    """Hundredths, to the nearest as Python rounds: a product in double precision would invent ties."""
    hundredths: FloatArray = np.rint(values.astype(np.longdouble) * 10**DIGITS).astype(np.float64)
    return hundredths


class Calibrations:
    """One for each vehicle."""

    def __init__(self) -> None:
        self._known: Calibration = calibration_of(slips=False)
        self._heading: FloatArray | None = None
        self._time_s = 0.0

    @property
    def scale(self) -> FloatArray:
        """True airspeeds over the reported ones."""
        return np.asarray(self._known.scale)

    def learn(
        self,
        sample: Sample[FloatArray],
        reported_airspeed: FloatArray,
        state: VehicleState[FloatArray],
    ) -> None:
        """Learn from a report (its airspeed apart, as it came) and the state that it led to."""
        before, self._heading = self._heading, sample.heading
        interval, self._time_s = sample.time_s - self._time_s, sample.time_s
        if before is None:
            return
        # Elementwise functions take arrays for what they call floats. Nobody here is too slow to learn from.
        seen: dict[str, Any] = {
            "reported_airspeed": reported_airspeed,
            "heading": sample.heading,
            "turn_rate": wrap_angle(sample.heading - before) / interval,
            "velocity_north": sample.velocity_north,
            "velocity_east": sample.velocity_east,
            "wind_rate": hypot(state.wind_rate_north, state.wind_rate_east),
        }
        self._known = calibrated(self._known, **seen, period=interval)


def fly_formations(
    start: ArrayStart, conditions: ArrayConditions, watch: Watcher, random: Generator | None = None
) -> None:
    """Fly a batch of formations to the end.

    Args:
        start: where they begin.
        conditions: what they have in common.
        watch: hears what happens.
        random: for the noise, where there is any.
    """
    fleet = fleet_at(start, conditions)
    followers = followers_of(start, conditions)
    clock, stream = ReportClock(conditions.rate_hz), Stream()
    calibrates = conditions.calibrates and conditions.airframe.hold == "heading-hold"
    calibrations = Calibrations() if calibrates else None
    delayed = math.ceil(conditions.link_delay_s * conditions.rate_hz - 1e-6)
    heard: deque[LeaderState[FloatArray]] = deque(maxlen=delayed + 1)
    engaged = round(conditions.engaged_after_s * conditions.rate_hz) + 1
    steps = math.floor(conditions.duration_s * conditions.rate_hz + 1e-6)
    state: VehicleState[FloatArray] | None = None
    motion: MotionEstimate[FloatArray] | None = None
    task = conditions.task
    leader_law = task.law(task.gains, conditions.settings, conditions.airframe)
    for step in range(steps + 1):
        now = step / conditions.rate_hz
        if step > 0:
            fleet.advance((step - 1) / conditions.rate_hz, 1.0 / conditions.rate_hz)
        time_s = clock.report(now)
        sample, said = reported(fleet, conditions, now, random)
        reported_airspeed = sample.airspeed
        if calibrations is not None:
            sample = replace(sample, airspeed=calibrations.scale * reported_airspeed)
        sample = replace(sample, time_s=time_s)
        filters = conditions.settings.filters
        state = first_state(sample) if state is None else navigate(state, sample, filters)
        if calibrations is not None:
            calibrations.learn(sample, reported_airspeed, state)
        leaders = rows(state, 0)
        motion = (
            motion_at_first(leaders)
            if motion is None
            else estimated_motion(
                motion, leaders, conditions.airframe, conditions.settings.rate_filter_s
            )
        )
        north, east = conditions.ground.shifted(
            (said[0][0], said[1][0]),
            motion.state.north - sample.north[0],
            motion.state.east - sample.east[0],
        )
        heard.append(replace(motion.state, north=north, east=east))
        if step < engaged:
            # As in a companion that waits: it is guided already, and has learnt nothing.
            followers.reset()
        following = followers.step(rows(state, slice(1, None)), heard[0], clock.period)
        if step >= engaged:
            leading = leader_step(
                leaders,
                leader_law,
                conditions.task,
                period=clock.period,
            ).setpoint
            course = np.vstack([leading.course[None], following.course])
            speed = np.vstack([leading.speed[None], following.speed])
            if calibrations is not None:
                airframe = conditions.airframe
                shown = speed / calibrations.scale
                speed = clip(shown, airframe.airspeed_min, airframe.airspeed_max)
            if conditions.rounded:
                course, speed = stream.update(course, speed, now)
            fleet.guide(*pushed(course, speed, conditions.push, now), now)
        watch(now, slot_distances(fleet, now, start.slot), following if step >= engaged else None)


def pushed(
    course: FloatArray, speed: FloatArray, push: Push | None, now: float
) -> tuple[FloatArray, FloatArray]:
    """(course, speed) that the holds hold where they were told these."""
    if push is None or now < push.from_s:
        return course, speed
    followers = np.arange(len(course))[:, None] > 0
    return course + push.course * followers, speed + push.speed * followers


class ReportClock:
    """The time of reports as companions see it, to the last bit: stamps in milliseconds, a mean period."""

    def __init__(self, rate_hz: float) -> None:
        self.period = 1.0 / rate_hz
        """Mean interval between reports, s."""
        self._boot = AutopilotClock()
        self._newest: float | None = None

    def report(self, now: float) -> float:
        """When a report that is read now was true, s."""
        reading = self._boot.read(round(now * 1e3) * 1e-3, now)
        time_s = now if reading is None else reading.time_s
        if self._newest is not None:
            self.period += PERIOD_SHARE * (time_s - self._newest - self.period)
        self._newest = time_s
        return time_s


def reported(
    fleet: Fleet, conditions: ArrayConditions, time_s: float, random: Generator | None
) -> tuple[Sample[FloatArray], Report]:
    """What the autopilots report now, in the local frame; and the positions as they are reported."""
    moving = fleet.motion(time_s)
    wind_north, wind_east = fleet.wind.at(time_s)
    air_north, air_east = moving.north - wind_north, moving.east - wind_east
    if fleet.airframe.hold == "heading-hold":
        heading, airspeed = fleet.direction, fleet.speed
    else:
        heading, airspeed = np.arctan2(air_east, air_north), np.hypot(air_north, air_east)
    place = fleet.place
    if random is not None and conditions.position_noise_m > 0.0:
        shape = (2, *fleet.direction.shape)
        place = fleet.ground.advance(
            place, *(conditions.position_noise_m * random.standard_normal(shape))
        )
    velocity_north, velocity_east = moving.north, moving.east
    if conditions.rounded:
        velocity_north, velocity_east = np.rint(moving.north * 100.0), np.rint(moving.east * 100.0)
        velocity_north, velocity_east = velocity_north * 1e-2, velocity_east * 1e-2
        heading = np.radians((np.rint(np.degrees(heading) * 100.0) % 36_000.0) * 1e-2)
        airspeed = airspeed.astype(np.float32).astype(np.float64)
    said = fleet.ground.report(place, rounded=conditions.rounded)
    north, east = fleet.ground.local(said)
    sample = Sample(
        time_s=time_s,
        north=north,
        east=east,
        velocity_north=velocity_north,
        velocity_east=velocity_east,
        heading=heading,
        airspeed=airspeed,
    )
    return sample, said


def rows(state: VehicleState[FloatArray], wanted: int | slice) -> VehicleState[FloatArray]:
    """Some rows of a state."""
    # Heights are those of all: the array form flies level.
    return picked(state, lambda values: values[wanted])


def slot_distances(fleet: Fleet, time_s: float, slot: Slot[FloatArray]) -> FloatArray:
    """Distances of the followers from their slots in the leaders' true course frame, m."""
    north, east = fleet.ground.local(fleet.ground.report(fleet.place, rounded=False))
    moving = fleet.motion(time_s)
    speed = np.hypot(moving.north[0], moving.east[0])
    ahead, aside = moving.north[0] / speed, moving.east[0] / speed
    slot_north = north[0] + slot.forward * ahead - slot.right * aside
    slot_east = east[0] + slot.forward * aside + slot.right * ahead
    distances: FloatArray = np.hypot(slot_north - north[1:], slot_east - east[1:])
    return distances
