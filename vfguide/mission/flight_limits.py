"""Demands of a mission on its vehicles in turns, climbs and slots, compared with their limits and the fence.

Conditions hold every course and turn of the leader's path in every declared wind; each combination is one
entry of each array. Local frame: x north, y east; radians clockwise from north.

The turn rate of the field follows Nelson et al., Vector field path following for miniature air vehicles,
IEEE T-RO 2007.

The maximum climb rate that a vehicle sustains at cruise is its whole excess power. A climb leaves an
acceleration a = g (climb_max - climb) / V, all that a follower has for returning to its slot.

For fences, each slot is moved along the whole path and turned into its course: on a turn the outermost
aircraft may leave an area in which the leader stays.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray, hypot
from vfguide.errors import InputError
from vfguide.guidance.airframe import (
    GRAVITY,
    bank_limited_turn_rate,
    compose,
    ground_speed_on_course,
)
from vfguide.guidance.formation import Slot, slot_velocity
from vfguide.guidance.height import ClimbLimits
from vfguide.mission.finding import Finding, Location, no_more_than, told_apart
from vfguide.mission.flight_path import PathShape, path_of
from vfguide.mission.model import Follower, Mission
from vfguide.mission.place import Fence, frame_of
from vfguide.mission.rehearsal import ArticleWind, CalmWind, SteadyWind

ARTICLE_WIND_PERIOD_S = 2.0 * math.pi / 0.1
ARTICLE_WIND_SAMPLES = 64
PLACES = 97
"""Number of points at which the path is sampled."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Combinations of path course, path curvature and wind."""

    course: FloatArray
    """Course of the path, rad."""
    curvature: FloatArray
    """Curvature of the path, 1/m, positive clockwise."""
    wind_north: FloatArray
    """North component of the velocity of the air, m/s."""
    wind_east: FloatArray
    """East component of the velocity of the air, m/s."""
    height: FloatArray
    """Height of the path, m above the mission's flying height."""
    slope: FloatArray
    """Slope of the path, height change per metre along the ground."""

    def ground_speed(self, airspeed: float | FloatArray) -> FloatArray:
        """Return the leader's ground speed (m/s) on the path at an airspeed (m/s), which may be an array."""
        shape = np.broadcast_shapes(np.shape(airspeed), self.course.shape)
        speeds = np.broadcast_to(np.asarray(airspeed, dtype=float), shape)
        return ground_speed_on_course(speeds, self.course, self.wind_north, self.wind_east)

    def turn_rate(self, airspeed: float | FloatArray) -> FloatArray:
        """Return the leader's turn rate (rad/s) on the path, positive clockwise: V_g times curvature."""
        return self.ground_speed(airspeed) * self.curvature

    def slot_velocity(
        self, airspeed: float | FloatArray, slot: Slot
    ) -> tuple[FloatArray, FloatArray]:
        """Return the (along, right) velocity of a slot in the leader's course frame, m/s."""
        ground_speed = self.ground_speed(airspeed)
        return slot_velocity(ground_speed, ground_speed * self.curvature, slot)

    def slot_airspeed(self, airspeed: float | FloatArray, slot: Slot) -> FloatArray:
        """Return the airspeed (m/s) that keeping a slot needs: |slot velocity - wind|."""
        along, right = self.slot_velocity(airspeed, slot)
        north, east = compose(along, right, np.broadcast_to(self.course, along.shape))
        return hypot(north - self.wind_north, east - self.wind_east)


def conditions_of(shape: PathShape, wind: CalmWind | ArticleWind | SteadyWind) -> Conditions:
    """Return every course of the path combined with every wind."""
    path = path_of(shape)
    places = path.at(path.outline(PLACES))
    if not (np.all(np.isfinite(places.course)) and np.all(np.isfinite(places.curvature))):
        raise InputError(
            f"path {shape.type}: its course or its curvature is not finite everywhere; mend at()"
        )
    north, east = wind_samples(wind)
    return Conditions(
        np.repeat(places.course, north.size),
        np.repeat(places.curvature, north.size),
        np.tile(north, places.course.size),
        np.tile(east, places.course.size),
        np.repeat(places.height + 0.0 * places.course, north.size),
        np.repeat(places.slope + 0.0 * places.course, north.size),
    )


def wind_samples(wind: CalmWind | ArticleWind | SteadyWind) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) components of the air's velocity in the declared wind over one period, m/s."""
    if isinstance(wind, SteadyWind):
        toward = math.radians(wind.toward_deg)
        return (
            np.array([wind.speed_m_s * math.cos(toward)]),
            np.array([wind.speed_m_s * math.sin(toward)]),
        )
    if isinstance(wind, CalmWind):
        return np.zeros(1), np.zeros(1)
    time = np.linspace(0.0, ARTICLE_WIND_PERIOD_S, ARTICLE_WIND_SAMPLES, endpoint=False)
    return article_wind(time)


def article_wind(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of the article's wind at times in s.

    The wind speed is W = 5 + 3 cos 0.1 t in m/s. The air moves toward psi_w = 135° + pi sin 0.1 t, clockwise
    from north.
    """
    speed = 5.0 + 3.0 * np.cos(0.1 * time)
    toward = math.radians(135.0) + math.pi * np.sin(0.1 * time)
    return speed * np.cos(toward), speed * np.sin(toward)


FIELD_TURN_CONSTANT = 2.0 / (3.0 * math.sqrt(3.0))
"""0.385: maximum of sin(atan u) / (1 + u^2) = u (1 + u^2)^(-3/2), reached at u = k e = 1/sqrt 2."""

EXCESS_M_S2 = 0.25
"""With less excess acceleration, a follower that lost 1 m/s takes more than 4 s to regain it."""

AIRSPEED_STEPS = 41
"""Number of leader airspeeds that are tried to suit all followers."""

TOLERANCE_M_S = 0.05
"""Airspeed excess over the range that is not reported."""


def field_turn_rate(gain: float, ground_speed: float, approach: float) -> float:
    """Return the maximum turn rate (rad/s) of the field around a straight path: 0.385 k V_g (2/pi) chi_inf.

    On the field the course is chi_inf (2/pi) atan(k e) off the path. The error shrinks at V_g times the sine
    of that angle, and the field's course changes by chi_inf (2/pi) k / (1 + (k e)^2) per metre. The result
    is exact for chi_inf = pi/2 and an upper bound below.

    Args:
        gain: k, 1/m.
        ground_speed: V_g, m/s.
        approach: chi_inf, rad, at most pi/2.
    """
    return FIELD_TURN_CONSTANT * gain * ground_speed * (2.0 / math.pi) * approach


def bank_for(ground_speed: float, turn_rate: float) -> float:
    """Return the bank angle (rad) of a turn: atan(V omega / g), with V in m/s and omega in rad/s."""
    return math.atan(ground_speed * abs(turn_rate) / GRAVITY)


def turns_beyond_bank(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find arcs of the path that the leader or a slot's vehicle cannot fly."""
    airspeed = mission.leader.airspeed_m_s
    turn_rate = conditions.turn_rate(airspeed)
    for location, name, slot in _everyone(mission):
        speed = np.hypot(*conditions.slot_velocity(airspeed, slot))
        worst = int(np.argmax(speed * np.abs(turn_rate)))
        bank = math.degrees(bank_for(float(speed[worst]), float(turn_rate[worst])))
        allowed = mission.vehicles[name].max_bank_deg
        if bank > allowed:
            needed, limit = told_apart(bank, allowed, 0)
            message = (
                f"'{name}' has to bank {needed}° on the turn at up to {speed[worst]:.1f} m/s "
                f"over ground, its limit is {limit}°"
            )
            remedy = (
                "widen the path's turns, fly slower, or move the slot to the inside of the turn"
            )
            yield Finding("error", location, message, remedy)


def _everyone(mission: Mission) -> Iterator[tuple[Location, str, Slot]]:
    """Yield (location in the mission, vehicle, offset from the leader) of the leader and each follower."""
    yield ("path",), mission.leader.vehicle, Slot(forward=0.0, right=0.0)
    for index, follower in enumerate(mission.followers):
        yield ("followers", index, "slot"), follower.vehicle, follower.slot.of_guidance


def field_beyond_bank(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find a path field that turns faster than the leader can while it joins the path."""
    path = mission.path
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).max())
    curvature = float(np.abs(conditions.curvature).max())
    max_bank = math.radians(mission.leader_vehicle.max_bank_deg)
    allowed = bank_limited_turn_rate(max_bank, speed)
    field = field_turn_rate(path.gain, speed, path.approach_angle)
    needed = field + speed * curvature
    if needed <= allowed:
        return
    asked, given = told_apart(needed, allowed, 2)
    message = (
        f"joining the path, the field turns at up to {asked} rad/s at {speed:.1f} m/s over ground, "
        f"a bank of {mission.leader_vehicle.max_bank_deg:g}° gives {given}: "
        "the leader cannot keep to it there"
    )
    room = allowed - speed * curvature
    if room > 0.0:
        remedy = f"lower gain to {no_more_than(path.gain * room / field)} 1/m or less"
    else:
        remedy = "widen the path's turns or fly slower"
    yield Finding("warning", ("path", "gain"), message, remedy)


def climbs_beyond_limits(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find climbs and descents too fast for a vehicle, or that leave no power for keeping its slot."""
    rates = conditions.ground_speed(mission.leader.airspeed_m_s) * conditions.slope
    climb, sink = float(np.max(rates, initial=0.0)), float(-np.min(rates, initial=0.0))
    names = {mission.leader.vehicle, *mission.followers_by_name} & set(mission.vehicles)
    remedy = "make the path climb less steeply, or fly slower"
    for name in sorted(names):
        lowest, highest = mission.vehicles[name].climb_range_m_s
        for needed, limit, doing in ((climb, highest, "climbs"), (sink, -lowest, "descends")):
            location = ("vehicles", name, "climb_range_m_s")
            what = f"the path {doing} at up to {needed:.1f} m/s"
            excess = GRAVITY * (limit - needed) / mission.leader.airspeed_m_s
            if needed > limit:
                message = f"{what}, '{name}' at {limit:g} at most"
                yield Finding("error", location, message, remedy)
            elif needed > 0.0 and excess < EXCESS_M_S2:
                change = "faster" if doing == "climbs" else "slower"
                message = (
                    f"{what}, which leaves '{name}' {excess:.2f} m/s² to fly {change} for its slot:"
                    " its height will give way to that"
                )
                yield Finding("warning", location, message, remedy)


def climb_limits(mission: Mission) -> ClimbLimits:
    """Return the climb and sink limits that all vehicles of the formation sustain."""
    names = {mission.leader.vehicle, *mission.followers_by_name} & set(mission.vehicles)
    ranges = [mission.vehicles[name].climb_range_m_s for name in names]
    return ClimbLimits(
        climb=min(climb for _, climb in ranges), sink=min(-sink for sink, _ in ranges)
    )


def lowest_of_the_path(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find paths that lead a vehicle of the formation below the origin."""
    lowest = float(np.min(conditions.height, initial=0.0))
    slots = [0.0, *(follower.slot.up_m for follower in mission.followers)]
    height = mission.height_above_origin_m + lowest + min(slots)
    if lowest < 0.0 and height <= 0.0:
        yield Finding(
            "error",
            ("path",),
            f"it leads the lowest vehicle {-height:.0f} m below the origin",
            "raise the lowest height of the path, or height_above_origin_m",
        )


def leader_in_wind(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find wind as fast as the leader or faster."""
    strongest = float(np.hypot(conditions.wind_north, conditions.wind_east).max())
    airspeed = mission.leader.airspeed_m_s
    if strongest >= airspeed:
        message = f"the declared wind reaches {strongest:.1f} m/s, the leader's airspeed is {airspeed:g} m/s"
        remedy = "raise leader.airspeed_m_s well above the wind, or wait for less of it"
        yield Finding("error", ("wind",), message, remedy)


def slots_beyond_centre(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find slots that would move backwards on a turn: V_l - omega g_y = V_l (1 - g_y / R) <= 0."""
    for index, follower in enumerate(mission.followers):
        least = float((1.0 - conditions.curvature * follower.slot.right_m).min())
        if least <= 0.0:
            yield Finding(
                "error",
                ("followers", index, "slot", "right_m"),
                "on the turn this slot lies at or beyond the centre, where no aircraft can keep it",
                "move the slot nearer to the leader, or to its other side, or widen the path's turns",
            )


def slots_out_of_airspeed(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find slots that need an airspeed their vehicles do not have, and whether the leader can help."""
    cruise = mission.leader.airspeed_m_s
    misfits = {
        index: text
        for index, follower in enumerate(mission.followers)
        if (text := _need(mission, conditions, follower)) is not None
    }
    if not misfits:
        return
    searched = np.linspace(*mission.leader_vehicle.airspeed_range_m_s, AIRSPEED_STEPS)
    airspeeds = np.union1d(searched, [cruise])[:, np.newaxis]
    flyable = [_flyable(mission, conditions, airspeeds, one) for one in mission.followers]
    hopeless = [index for index in misfits if not flyable[index].any(axis=0).all()]
    for index in hopeless:
        remedy = "move the slot nearer to the leader, widen the turn or the airspeed range"
        message = f"{misfits[index]}, and no airspeed of the leader changes that"
        yield Finding("error", ("followers", index, "slot"), message, remedy)
    if hopeless:
        return
    together = np.logical_and.reduce(flyable)
    if not together.any(axis=0).all():
        names = ", ".join(f"'{mission.followers[index].vehicle}'" for index in misfits)
        message = f"no airspeed of the leader suits all slots at once; out of range now: {names}"
        remedy = "bring the slots closer together, widen the turn or the airspeed ranges"
        yield Finding("error", ("followers",), message, remedy)
        return
    slower, faster = giving_way(together, airspeeds, cruise)
    ways = ((faster, "faster"), (slower, "slower"))
    changes = [f"{amount:.1f} m/s {way}" for amount, way in ways if amount > 0.0]
    change = " and ".join(changes) or "a little"
    for index, text in misfits.items():
        if mission.controller.give_way:
            message = f"{text}; the leader gives way by up to {change}"
            remedy = "to keep the leader's airspeed, move the slot nearer to it or widen the turn"
        else:
            message = f"{text}, and will fall out of its slot"
            remedy = f"set controller.give_way: true (the leader would fly up to {change}), or move the slot"
        yield Finding("warning", ("followers", index, "slot"), message, remedy)


def giving_way(flyable: BoolArray, airspeeds: FloatArray, cruise: float) -> tuple[float, float]:
    """Return how much (slower, faster) than cruise the leader must fly at most, m/s, neither negative.

    `flyable` tells whether a leader's airspeed (row) suits every slot in a condition (column). `airspeeds`
    holds the airspeed of each row as a column, m/s.
    """
    change = np.where(flyable, airspeeds - cruise, np.inf)
    nearest = np.take_along_axis(
        change, np.abs(change).argmin(axis=0, keepdims=True), axis=0
    ).ravel()
    return float(-min(nearest.min(), 0.0)), float(max(nearest.max(), 0.0))


def _need(mission: Mission, conditions: Conditions, follower: Follower) -> str | None:
    """Describe the airspeed a slot needs beyond its vehicle's range; None if there is none."""
    cruise = mission.leader.airspeed_m_s
    if _flyable(mission, conditions, np.array([[cruise]]), follower).all():
        return None
    needed = conditions.slot_airspeed(cruise, follower.slot.of_guidance)
    least, most = mission.vehicles[follower.vehicle].airspeed_range_m_s
    return (
        f"this slot needs {needed.min():.1f} to {needed.max():.1f} m/s of airspeed, "
        f"'{follower.vehicle}' flies {least:g} to {most:g}"
    )


def _flyable(
    mission: Mission, conditions: Conditions, airspeeds: FloatArray, follower: Follower
) -> BoolArray:
    """Return for each leader airspeed (row) and condition (column) whether the follower can keep its slot."""
    least, most = mission.vehicles[follower.vehicle].airspeed_range_m_s
    airspeed = conditions.slot_airspeed(airspeeds, follower.slot.of_guidance)
    return (airspeed >= least - TOLERANCE_M_S) & (airspeed <= most + TOLERANCE_M_S)


STEP_M = 5.0
MOST_STEPS = 50_000
"""Maximum number of samples along the path."""

SPARE_M = 10.0
"""Distance from the fence that is reported below this: room for gusts and navigation errors."""


@dataclass(frozen=True, slots=True)
class Track:
    """Track of a vehicle along the path."""

    name: str
    location: Location
    """Location of the vehicle in the mission."""
    north: FloatArray
    """North positions, m."""
    east: FloatArray
    """East positions, m."""
    height: FloatArray
    """Heights above the mission's origin, m."""


def tracks(mission: Mission) -> Iterator[Track]:
    """Yield the leader's track along its path and the track of each slot."""
    path = path_of(mission.path)
    length = path.length
    if not math.isfinite(length):
        length = mission.leader.airspeed_m_s * mission.rehearsal.duration_s
    count = min(max(2, math.ceil(length / STEP_M)), MOST_STEPS)
    places = path.at(np.linspace(0.0, length, count))
    height = mission.height_above_origin_m + np.broadcast_to(places.height, (count,))
    return tracks_of(mission, places.north, places.east, places.course, height)


def hold_tracks(
    mission: Mission, north: float, east: float, radius: float, height: float
) -> Iterator[Track]:
    """Yield the tracks of the leader, once round a circle to the right, and of each slot.

    Centre and radius of the circle are in m, the leader's height is in m above the mission's origin.
    """
    count = max(8, math.ceil(math.tau * radius / STEP_M))
    course = np.linspace(0.0, math.tau, count, endpoint=False)
    along, across = compose(np.zeros(count), np.full(count, -radius), course)
    return tracks_of(mission, north + along, east + across, course, np.full(count, height))


def tracks_of(
    mission: Mission, north: FloatArray, east: FloatArray, course: FloatArray, height: FloatArray
) -> Iterator[Track]:
    """Yield a leader's track (m, rad) and the track of each slot."""
    yield Track(mission.leader.vehicle, ("path",), north, east, height)
    for index, follower in enumerate(mission.followers):
        slot = follower.slot
        ahead = np.full(course.size, slot.forward_m)
        along, across = compose(ahead, np.full(course.size, slot.right_m), course)
        place = ("followers", index, "slot")
        yield Track(follower.vehicle, place, north + along, east + across, height + slot.up_m)


def beyond_the_fence(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Find tracks that leave the fence, come near it or are too high, and rally points beyond it."""
    del conditions
    yield from tracks_beyond_the_fence(mission, tracks)
    yield from _rally_points_beyond(mission)


def fences_of(mission: Mission) -> list[Fence]:
    """Return the fences of the mission and of its plan that limit anything."""
    return [one for one in (mission.fence, mission.path.fence) if one is not None and one.exists]


def top_of(fences: Iterable[Fence | None]) -> float:
    """Return the maximum height that all fences allow, m above the origin; infinite without a limit."""
    limits = [one.max_height_m for one in fences if one is not None and one.max_height_m]
    return min(limits, default=math.inf)


def tracks_beyond_the_fence(
    mission: Mission, found: Callable[[Mission], Iterable[Track]]
) -> Iterator[Finding]:
    """Find tracks that leave the fences or come near them; without a fence no tracks are computed."""
    fences = fences_of(mission)
    if not fences:
        return
    frame = frame_of(mission.model_dump())
    highest = top_of(fences)
    for track in found(mission):
        rooms = [one.room(track.north, track.east, frame) for one in fences]
        room = np.min(rooms, axis=0)
        worst = int(room.argmin())
        if room[worst] < SPARE_M:
            yield _near(track, float(room[worst]), worst)
        top = int(track.height.argmax())
        if track.height[top] > highest:
            yield Finding(
                "error",
                track.location,
                f"'{track.name}' flies {track.height[top]:.0f} m above the origin {_place(track, top)}, the"
                f" fence ends at {highest:g} m",
                "lower height_above_origin_m, the waypoints or the slot",
            )


def _rally_points_beyond(mission: Mission) -> Iterator[Finding]:
    fences = fences_of(mission)
    frame = frame_of(mission.model_dump()) if fences else None
    for index, point in enumerate(mission.path.rally_points):
        north, east = (np.array([one]) for one in point.local(frame))
        if any(one.room(north, east, frame)[0] < 0.0 for one in fences):
            yield Finding(
                "warning",
                ("path", "file"),
                f"rally point {index + 1} (north {north[0]:.0f} m, east {east[0]:.0f} m) is beyond the fence",
                "move it inside, or an aircraft that returns there leaves the fence",
            )


def _near(track: Track, room: float, worst: int) -> Finding:
    place = _place(track, worst)
    if room < 0.0:
        return Finding(
            "error",
            track.location,
            f"'{track.name}' leaves the fence by {-room:.0f} m {place}",
            "move the path or the slot inwards, or make the turns smaller there",
        )
    return Finding(
        "warning",
        track.location,
        f"'{track.name}' comes within {room:.0f} m of the fence {place}",
        f"leave {SPARE_M:g} m for gusts and for what the navigation is off",
    )


def _place(track: Track, index: int) -> str:
    return f"near north {track.north[index]:.0f} m, east {track.east[index]:.0f} m"


def left_out_of_the_plan(mission: Mission) -> Iterator[Finding]:
    """Report parts of a plan that a formation does not fly."""
    if mission.path.left_out:
        what = ", ".join(mission.path.left_out[:12])
        yield Finding("note", ("path", "file"), f"not flown of this plan: {what}")
