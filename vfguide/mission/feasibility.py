"""Feasibility checks of a mission before take-off.

`least_guarantee` bounds how near a vehicle may come that leaves its slot. For every two vehicles, one leaves
guidance in straight flight and turns at its bank limit, to either side and for any time. The other hears of
it, responds after its dead time and lag, and flies one full manoeuvre whatever the first does then. In
flight it decides again at every report, which is no worse. The kinematics are those of the study in
docs/accuracy.md.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from vfguide.formation.arrangement import MAIN_PATH
from vfguide.formation.transition import RefusedOrderError
from vfguide.frames import way_m
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.path import END_SHARE
from vfguide.guidance.separation import (
    TIMES,
    Agility,
    ComplexArray,
    OwnMotion,
    arc,
    escape_distance,
)
from vfguide.guidance.sliding_laws import LEAST_PERIOD, boundary_layer
from vfguide.mission.consistency import LEADER
from vfguide.mission.controller import Controller
from vfguide.mission.finding import Finding, MissionSource, no_more_than, worst_first
from vfguide.mission.flight_limits import (
    Conditions,
    beyond_the_fence,
    climbs_beyond_limits,
    conditions_of,
    field_beyond_bank,
    leader_in_wind,
    left_out_of_the_plan,
    lowest_of_the_path,
    slots_beyond_centre,
    slots_out_of_airspeed,
    turns_beyond_bank,
)
from vfguide.mission.flight_path import PathShape, path_of
from vfguide.mission.model import Follower, Mission
from vfguide.mission.order_plan import on_path, timetable
from vfguide.mission.place import ENGAGED_M, Place
from vfguide.mission.rehearsal import FollowerStart
from vfguide.registry import laws

LEADER_OFFSET_M = 30.0
"""Distance right of its path at which a leader starts by default."""

NEAREST_BEHIND_M, FARTHEST_BEHIND_M = 50.0, 80.0
NEAREST_OUTWARD_M, FARTHEST_OUTWARD_M = 30.0, 60.0


@dataclass(frozen=True, slots=True)
class StartState:
    """Start position and direction."""

    north_m: float
    """Metres north of the origin."""
    east_m: float
    """Metres east of the origin."""
    up_m: float
    """Metres above the leader's flying height."""
    course_deg: float
    """Course, degrees clockwise from north."""
    climb_m_s: float = 0.0
    """Climb rate, m/s, positive up."""

    def shifted(self, *, forward_m: float, right_m: float, up_m: float = 0.0) -> "StartState":
        """Return a start in the same direction, ahead of, right of and above this one (m)."""
        course = math.radians(self.course_deg)
        return StartState(
            self.north_m + forward_m * math.cos(course) - right_m * math.sin(course),
            self.east_m + forward_m * math.sin(course) + right_m * math.cos(course),
            self.up_m + up_m,
            self.course_deg,
            self.climb_m_s,
        )


def path_beginning(shape: PathShape) -> StartState:
    """Return the first point of the path with the course there, at the mission's flying height."""
    place = path_of(shape).at(0.0)
    return StartState(place.north, place.east, 0.0, math.degrees(place.course) % 360.0)


def leader_start(mission: Mission) -> StartState:
    """Return the leader's start: as given, or 30 m right of the beginning of its path and along it."""
    beginning = path_beginning(mission.path)
    given = mission.rehearsal.start.leader
    if given is None:
        return beginning.shifted(forward_m=0.0, right_m=LEADER_OFFSET_M)
    course = beginning.course_deg if given.course_deg is None else given.course_deg
    return StartState(given.north_m, given.east_m, given.up_m, course, given.climb_m_s)


def follower_start(mission: Mission, vehicle: str) -> StartState:
    """Return a follower's start: displaced from its slot relative to the leader's start."""
    slot = mission.followers_by_name[vehicle].slot
    given = mission.rehearsal.start.followers.get(vehicle)
    displacement = default_displacement(mission.followers, vehicle) if given is None else given
    start = leader_start(mission).shifted(
        forward_m=slot.forward_m + displacement.forward_m,
        right_m=slot.right_m + displacement.right_m,
        up_m=slot.up_m + displacement.up_m,
    )
    if displacement.course_deg is None:
        return start
    return replace(start, course_deg=displacement.course_deg)


def default_displacement(followers: tuple[Follower, ...], vehicle: str) -> FollowerStart:
    """Return a displacement of 50 to 100 m out of the slot, away from the leader.

    Slots further out are displaced further, so that distances only grow. No vehicle starts closer to another
    than in the formation, and none has to pass another on the way in.
    """
    slot = {one.vehicle: one.slot for one in followers}[vehicle]
    forward = _outward(
        slot.forward_m,
        sorted({abs(one.slot.forward_m) for one in followers}),
        NEAREST_BEHIND_M,
        FARTHEST_BEHIND_M,
    )
    right = _outward(
        slot.right_m,
        sorted({abs(one.slot.right_m) for one in followers}),
        NEAREST_OUTWARD_M,
        FARTHEST_OUTWARD_M,
    )
    # A slot at the leader's side starts behind the slot, any other slot also farther out on its own side.
    return FollowerStart(
        forward_m=forward if slot.forward_m > 0.0 else -abs(forward),
        right_m=0.0 if slot.right_m == 0.0 else right,
    )


def _outward(offset: float, distances: list[float], nearest: float, farthest: float) -> float:
    """Return a displacement with the offset's sign, growing with its rank among all distances."""
    share = distances.index(abs(offset)) / max(1, len(distances) - 1)
    return math.copysign(nearest + (farthest - nearest) * share, offset)


# Before take-off: is the guidance loop fast enough for its gains, and are its inputs fresh enough?

LIMIT_CYCLE = 2.0
"""kappa (period + delay) / epsilon above which the sampled law limit-cycles."""

RESTLESS = 0.5
"""kappa (period + delay) / epsilon above which the setpoint still overshoots at every step."""

WIDEST_LAYER = math.pi / 4.0
"""Boundary layer above which course errors up to a quarter turn get less than full authority, rad."""

STALE_S = 1.0
"""Age of a leader state above which its prediction is a guess, s."""

RADIO_BYTES = 56
"""Size of a leader state on a radio, bytes."""


def effective_layer(controller: Controller, period: float) -> float:
    """Return the boundary layer epsilon (rad, m/s) that the laws use in a loop with this period (s)."""
    return boundary_layer(
        controller.kappa,
        controller.epsilon,
        period=max(period, LEAST_PERIOD),
        delay=controller.loop_delay_s,
        factor=controller.layer_factor,
    )


def loop_too_slow(mission: Mission) -> Iterator[Finding]:
    """Find a loop that chatters, or whose boundary layer makes it soft.

    The law crosses kappa (dt + delay) / epsilon boundary layers before it sees the result. Above 2 the error
    changes sign by more than its size at every step: a limit cycle.
    """
    controller = mission.controller
    rate = mission.rehearsal.rate_hz
    layer = effective_layer(controller, 1.0 / rate)
    crossing = controller.kappa * (1.0 / rate + controller.loop_delay_s) / layer
    if crossing > RESTLESS:
        word = "limit-cycles" if crossing > LIMIT_CYCLE else "is restless"
        message = (
            f"at {rate:g} Hz the law crosses {crossing:.1f} boundary layers in one step and {word}"
        )
        remedy = "set boundary_layer_factor to 2 or more (3.5 to 5 are usual), or raise rehearsal.rate_hz"
        location = ("controller", "boundary_layer_factor")
        yield Finding("error" if crossing > LIMIT_CYCLE else "warning", location, message, remedy)
    if layer > WIDEST_LAYER:
        message = (
            f"at {rate:g} Hz kappa {controller.kappa:g} takes a boundary layer of {layer:.2f} rad, "
            f"wider than {WIDEST_LAYER:.2f}: the formation is kept softly"
        )
        remedy = "raise rehearsal.rate_hz, or lower controller.kappa or boundary_layer_factor"
        yield Finding("warning", ("controller", "kappa"), message, remedy)


def mean_leader_age(mission: Mission) -> float:
    """Return the mean age (s) of the newest leader state from delay and losses; jitter averages out.

    Of states sent every dt with a share p lost, the newest is older by dt p / (1 - p) on average.
    """
    rehearsal = mission.rehearsal
    radio = rehearsal.radio
    if radio is not None:
        # Half a send interval, half a control step and the transmission time.
        way_s = RADIO_BYTES * (20.0 / radio.baud + 1.0 / radio.air_bytes_s)
        lost = radio.loss + radio.bursts - radio.loss * radio.bursts
        return way_s + (0.5 + lost / (1.0 - lost)) / radio.leader_hz + 0.5 / rehearsal.rate_hz
    wait = rehearsal.link_loss / (1.0 - rehearsal.link_loss) / rehearsal.rate_hz
    return rehearsal.link_delay_s + wait


def unknown_delay(mission: Mission) -> Iterator[Finding]:
    """Find a leader without a companion whose minimum latency is not given."""
    if mission.leader.least_delay_s is not None:
        return
    behind = 0.1 * mission.leader.airspeed_m_s
    message = (
        "how long its messages take at least is not told: followers ask it for its time, and where it does"
        f" not answer they fly {behind:.1f} m behind their slots for each 0.1 s"
    )
    remedy = "measure it on the ground, and write least_delay_s"
    yield Finding("note", ("leader", "least_delay_s"), message, remedy)


def leader_state_too_old(mission: Mission) -> Iterator[Finding]:
    """Find leader states that are old when they are used."""
    if not mission.followers:
        return
    if mission.leader.is_foreign:
        yield from unknown_delay(mission)
        return
    age = mean_leader_age(mission)
    patience = mission.patience.leader_s
    if age > patience:
        message = (
            f"leader states are {age:.1f} s old on average: no follower ever hears one that is fresh "
            f"within patience.leader_s, {patience:g} s, and none joins"
        )
        remedy = f"a link below {patience:g} s, or a longer patience.leader_s"
        yield Finding("error", ("rehearsal", "link_delay_s"), message, remedy)
    elif age > STALE_S:
        message = f"leader states are {age:.1f} s old on average, more than prediction bridges well"
        yield Finding(
            "warning", ("rehearsal", "link_delay_s"), message, "expect a less precise formation"
        )
    behind = age * mission.leader.airspeed_m_s
    if not mission.controller.predict_leader and behind > 0.1:
        message = (
            f"leader states are {age:.2f} s old on average: "
            f"followers fly {behind:.1f} m behind their slots"
        )
        remedy = "set predict_leader: true"
        yield Finding("warning", ("controller", "predict_leader"), message, remedy)


def observer_out_of_tune(mission: Mission) -> Iterator[Finding]:
    """Find a ground-speed observer that drifts, or whose step makes it unstable."""
    controller = mission.controller
    if controller.leader_speed_source != "observer":
        return
    location = ("controller", "observer", "sigma")
    pull = controller.observer.gamma * controller.observer.sigma
    if pull == 0.0:
        message = "without sigma nothing holds the estimate to the airspeed: it drifts"
        yield Finding("warning", location, message, "set sigma to 0.5 or so")
    elif pull / mission.rehearsal.rate_hz > LIMIT_CYCLE:
        rate = mission.rehearsal.rate_hz
        message = f"gamma * sigma = {pull:g} 1/s is too fast for {rate:g} Hz: it diverges"
        yield Finding(
            "error", location, message, "lower gamma or sigma, or raise rehearsal.rate_hz"
        )


FAR_M = 1000.0
"""A start further away than this (m) takes most of a rehearsal to fly in from."""

PROMISED_M = 5.0
"""Promised minimum distance between two vehicles, one of them under guidance."""

PUBLISH_S = 0.1
"""Interval of the states of a vehicle that is not under guidance."""


def crowded_starts(mission: Mission) -> Iterator[Finding]:
    """Find vehicles that start closer together than the minimum separation."""
    places = {LEADER: leader_start(mission)}
    places |= {one.vehicle: follower_start(mission, one.vehicle) for one in mission.followers}
    allowed = mission.acceptance.min_separation_m
    for (other, at_other), (name, here) in combinations(places.items(), 2):
        distance = math.dist(
            (at_other.north_m, at_other.east_m, at_other.up_m),
            (here.north_m, here.east_m, here.up_m),
        )
        if distance < allowed:
            yield Finding(
                "warning",
                ("rehearsal", "start", name),
                f"begins {distance:.1f} m from {other}",
                f"keep starts acceptance.min_separation_m = {allowed:g} m apart",
            )


def distant_starts(mission: Mission) -> Iterator[Finding]:
    """Find vehicles that start so far away that the rehearsal is mostly their way in."""
    begins = leader_start(mission)
    nearest = path_of(mission.path).nearest(
        begins.north_m, begins.east_m, math.radians(begins.course_deg)
    )
    away = abs(nearest.cross_track_error)
    if away > FAR_M:
        yield _distant(LEADER, away, "the path")
    for name, start in mission.rehearsal.start.followers.items():
        displacement = math.hypot(start.forward_m, start.right_m)
        if displacement > FAR_M:
            yield _distant(name, displacement, "its slot")


def _distant(name: str, distance: float, target: str) -> Finding:
    location = ("rehearsal", "start", name)
    message = f"begins {distance:.0f} m from {target}"
    return Finding("warning", location, message, f"begin within {FAR_M:.0f} m of it")


def far_from_home(mission: Mission) -> Iterator[Finding]:
    """Find a plan whose home is far from the mission's origin: the origin is a mistake."""
    for name, shape in mission.paths_by_name.items():
        home: Place | None = getattr(shape, "home", None)
        if home is None or home.latitude_deg is None or home.longitude_deg is None:
            continue
        place = home.latitude_deg, home.longitude_deg
        origin = mission.origin.latitude_deg, mission.origin.longitude_deg
        away = way_m(origin, place)
        if away > ENGAGED_M:
            yield Finding(
                "warning",
                ("origin",) if name == MAIN_PATH else ("paths", name),
                f"at {origin[0]:g}, {origin[1]:g}, {away / 1e3:.1f} km from the home of its plan; nobody"
                f" is engaged farther than {ENGAGED_M / 1e3:g} km from path or slot",
                f"set origin where it is flown: the plan's home is {place[0]:g}, {place[1]:g}",
            )


def below_ground(mission: Mission) -> Iterator[Finding]:
    """Find slots below the origin's altitude."""
    for index, follower in enumerate(mission.followers):
        height = mission.height_above_origin_m + follower.slot.up_m
        if height <= 0.0:
            yield Finding(
                "error",
                ("followers", index, "slot", "up_m"),
                f"this slot is {-height:g} m below the origin",
                "raise the slot or height_above_origin_m",
            )


def orders_that_cannot_be(mission: Mission) -> Iterator[Finding]:
    """Find the first order of the timetable that cannot be carried out."""
    if not mission.orders:
        return
    try:
        found = timetable(mission)
    except RefusedOrderError as refusal:
        yield Finding("error", ("orders",), str(refusal))
        return
    last, duration = found[-1][0], mission.rehearsal.duration_s
    if last.time_s >= duration:
        message = (
            f"the order at {last.time_s:g} s is not flown: the rehearsal ends at {duration:g} s"
        )
        remedy = f"lengthen rehearsal.duration_s beyond {last.time_s + last.duration_s:.0f}, or take it out"
        yield Finding("error", ("orders", len(found) - 1, "at_s"), message, remedy)
        return
    if last.time_s + last.duration_s > duration:
        message = (
            f"the last order ends at {last.time_s + last.duration_s:.0f} s, after the rehearsal"
        )
        yield Finding("warning", ("orders",), message, "lengthen rehearsal.duration_s")


def hand_back_at_the_end(mission: Mission) -> Iterator[Finding]:
    """Find a route that hands no vehicle back at its end, or hands all back before the rehearsal ends."""
    path = path_of(mission.path)
    if path.last_circle is None:
        return
    if mission.leader.is_foreign:
        message = (
            "hands nobody back: where a leader without a companion ends its route is not known"
        )
        yield Finding("warning", ("path",), message, "order an abort, or take over, at its end")
        return
    run = path.last_circle + END_SHARE * (path.length - path.last_circle)
    end_s = run / mission.leader.airspeed_m_s
    if end_s < mission.rehearsal.duration_s:
        yield Finding(
            "warning",
            ("rehearsal", "duration_s"),
            f"the route hands all vehicles back after about {end_s:.0f} s: figures count what they fly then",
            f"shorten rehearsal.duration_s to {no_more_than(end_s)}",
        )


def settling_after_the_end(mission: Mission) -> Iterator[Finding]:
    """Find settling times too long for the rehearsal to verify."""
    duration = mission.rehearsal.duration_s
    for name in ("settle_10m_s", "settle_1m_s"):
        allowed = getattr(mission.acceptance, name)
        if allowed is not None and allowed >= duration:
            message = f"{allowed:g} s is no shorter than the rehearsal of {duration:g} s"
            remedy = "lengthen rehearsal.duration_s or ask for earlier settling"
            yield Finding("warning", ("acceptance", name), message, remedy)


def losses_after_the_end(mission: Mission) -> Iterator[Finding]:
    """Find losses of companions and links that are set after the end of the rehearsal."""
    duration = mission.rehearsal.duration_s
    for index, loss in enumerate(mission.rehearsal.losses):
        if loss.at_s >= duration:
            message = f"'{loss.vehicle}' loses its {loss.what} at {loss.at_s:g} s, when all is over"
            remedy = f"lengthen rehearsal.duration_s, {duration:g} s, or let it happen earlier"
            yield Finding("warning", ("rehearsal", "losses", index), message, remedy)


def least_guarantee(mission: Mission) -> tuple[float, str, str] | None:
    """Return the least distance (m) one vehicle keeps from another that leaves its slot, and both names.

    Returns:
        (distance, vehicle that keeps clear, vehicle that strays); None for a single vehicle. Slots keep
            their
        heights, so the distance combines horizontal and vertical distance.
    """
    places, heights = {mission.leader.vehicle: 0j}, {mission.leader.vehicle: 0.0}
    for follower in mission.followers:
        places[follower.vehicle] = complex(follower.slot.forward_m, follower.slot.right_m)
        heights[follower.vehicle] = follower.slot.up_m
    found = [
        (
            math.hypot(kept_from(mission, own, places, other), heights[own] - heights[other]),
            own,
            other,
        )
        for own, other in permutations(places, 2)
    ]
    return min(found, key=lambda one: one[0], default=None)


def kept_from(mission: Mission, own: str, places: dict[str, complex], other: str) -> float:
    """Return the horizontal distance (m) `own` can keep from `other`, which turns at its bank limit.

    `places` holds the positions of all vehicles, m: forward + j right.
    """
    vehicle, cruise = mission.vehicles[own], mission.leader.airspeed_m_s
    rehearsal = mission.rehearsal
    heard_s = PUBLISH_S + rehearsal.link_delay_s + 1.0 / rehearsal.rate_hz
    lowest, highest = vehicle.airspeed_range_m_s
    agility = Agility(
        turn_rate=turn_rate_of(mission, own),
        acceleration=vehicle.max_acceleration_m_s2,
        turn_delay=heard_s + vehicle.course_dead_time_s + vehicle.course_lag_s,
        speed_delay=heard_s + vehicle.speed_dead_time_s + vehicle.speed_lag_s,
        alpha=10.0,
        beta=10.0,
        speed_min=lowest,
        speed_max=highest,
    )
    motion = OwnMotion(place=places[own], air_velocity=complex(cruise, 0.0), wind=0j, turn_rate=0.0)
    hardest = turn_rate_of(mission, other)
    return min(
        escape_distance(motion, agility, turning_tracks(places[other], cruise, side * hardest))
        for side in (1.0, -1.0)
    )


def turning_tracks(place: complex, speed: float, turn_rate: float) -> ComplexArray:
    """Return tracks that turn at a rate (rad/s) for different times and are straight before and after."""
    tracks = []
    for turning_s in TIMES[1:]:
        first = np.minimum(TIMES, turning_s)
        turned = arc(place, complex(speed, 0.0), turn_rate, first)
        away = speed * np.exp(1j * turn_rate * first)
        tracks.append(turned + away * (TIMES - first))
    return np.array(tracks)


def turn_rate_of(mission: Mission, name: str) -> float:
    """Return the maximum turn rate of a vehicle at the mission's airspeed, rad/s."""
    bank = math.radians(mission.vehicles[name].max_bank_deg)
    return GRAVITY * math.tan(bank) / mission.leader.airspeed_m_s


def distance_kept_from_strays(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Report the guaranteed distance, or slots that are too close for the promised one."""
    del conditions
    least = least_guarantee(mission)
    if least is None:
        return
    distance_m, own, other = least
    what = (
        f"should '{other}' leave its place in one turn at its bank limit, '{own}' can stay "
        f"{distance_m:.0f} m clear of it"
    )
    if distance_m >= PROMISED_M:
        yield Finding(
            "note",
            ("followers",),
            f"{what}, the least of any two; nearer where it turns again: docs/accuracy.md, Keeping clear",
        )
        return
    remedy = "move their slots apart, or give them different heights (slot.up_m)"
    yield Finding("warning", ("followers",), f"{what}, less than {PROMISED_M:g} m", remedy)


def findings_of_the_law(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Yield the findings of the mission's own law about its gains."""
    if mission.followers:
        yield from laws.find(mission.controller.type).findings(mission, conditions)


OF_THE_MISSION: tuple[Callable[[Mission], Iterator[Finding]], ...] = (
    below_ground,
    loop_too_slow,
    leader_state_too_old,
    observer_out_of_tune,
    crowded_starts,
    distant_starts,
    far_from_home,
    hand_back_at_the_end,
    settling_after_the_end,
    losses_after_the_end,
    orders_that_cannot_be,
    left_out_of_the_plan,
)
"""Checks that need no wind."""

OF_THE_GROUND_TRACK: tuple[Callable[[Mission, Conditions], Iterator[Finding]], ...] = (
    slots_beyond_centre,
    beyond_the_fence,
    turns_beyond_bank,
    slots_out_of_airspeed,
    lowest_of_the_path,
    climbs_beyond_limits,
    distance_kept_from_strays,
    field_beyond_bank,
    findings_of_the_law,
)
"""Checks along the path, which need a leader that can fly it."""


def check_mission(mission: Mission, source: MissionSource | None = None) -> tuple[Finding, ...]:
    """Return all findings before take-off, the worst first; a source adds their lines in the file."""
    findings = [found for check in OF_THE_MISSION for found in check(mission)]
    findings += _along_the_path(mission)
    for name in mission.paths:
        findings += _along_another_path(mission, name)
    if source is not None:
        findings = [one.placed(source) for one in findings]
    return worst_first(findings)


def _along_the_path(mission: Mission) -> list[Finding]:
    """Return findings along the mission's first path, up to the first error."""
    conditions = conditions_of(mission.path, mission.wind)
    findings = list(leader_in_wind(mission, conditions))
    for check in () if findings else OF_THE_GROUND_TRACK:
        found_on_track = list(check(mission, conditions))
        findings += found_on_track
        if any(one.severity == "error" for one in found_on_track):
            # later checks would only describe the same impossible turn again
            break
    return findings


def _along_another_path(mission: Mission, name: str) -> Iterator[Finding]:
    """Yield findings along a path that may be ordered; notes are reported for the first path only."""
    for one in _along_the_path(on_path(mission, name)):
        if one.severity != "note":
            place = ("paths", name, *one.location[1:])
            yield replace(
                one,
                location=place if one.location[:1] == ("path",) else one.location,
                message=f"on the path '{name}': {one.message}",
            )
