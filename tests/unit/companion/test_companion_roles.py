import math

import pytest
from msgspec.structs import replace

from tests.kit.companion import Said, leader_bytes, new_flight
from tests.kit.missions import plan_of, replaced
from tests.kit.orders import heard, order_of
from tests.kit.states import reported
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.roles import FollowerRole, LeaderRole, role_of
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.formation.arrangement import HoldCircle, Manoeuvre
from vfguide.link.codec import LeaderMessage, decode, encode
from vfguide.link.order_codec import encode_order
from vfguide.link.packed import (
    TAG_SIZE,
    PackedKind,
    decode_packet,
    encode_motion,
    encode_packet,
    ticks_of,
)
from vfguide.mavlink.reports import AirspeedReport
from vfguide.paths.circle import Circle, Helix
from vfguide.paths.climb import Climb


@pytest.fixture
def follower() -> FollowerRole:
    return role_of(plan_of(vehicle="f1"), SAME_CLOCK)


@pytest.fixture
def leader() -> LeaderRole:
    return role_of(plan_of(vehicle="leader"), SAME_CLOCK)


def fixes(plan: FlightPlan, course: float, times: list[float]) -> list[NavigatedState]:
    """Calm air, 20 m/s from the origin, turning right by 0.1 rad/s."""
    own = OwnVehicle(plan)
    found = []
    begin = course + 0.1 * times[0]
    for time_s in times:
        angle = course + 0.1 * time_s
        north = 200.0 * (math.sin(angle) - math.sin(begin))
        east = 200.0 * (math.cos(begin) - math.cos(angle))
        velocity = 20.0 * math.cos(angle), 20.0 * math.sin(angle)
        own.note(AirspeedReport(airspeed=20.0), time_s)
        found.append(
            own.take(reported(time_s, north, east, velocity=velocity, heading=angle), time_s)
        )
    return found


def published(leader: LeaderRole, navigated: NavigatedState) -> LeaderMessage:
    return decode(leader.step(navigated, Mode.TRACKING).publish)


def test_a_leader_publishes_where_it_is_and_how_it_moves_and_counts_up(leader):
    times = [3.0, 3.05, 3.1]
    messages = [published(leader, one) for one in fixes(plan_of(vehicle="leader"), 0.5, times)]
    assert [one.sequence - messages[0].sequence for one in messages] == [0, 1, 2]
    assert [one.time_s for one in messages] == pytest.approx(times)
    message = messages[0]
    assert (message.time_s, message.altitude_amsl) == (3.0, 588.0)
    place = (message.latitude_deg, message.longitude_deg)
    assert place == pytest.approx((47.397742, 8.545594), abs=1e-9)
    assert (message.course, message.ground_speed) == pytest.approx((0.8, 20.0))
    assert (message.acceleration, message.turn_rate, message.turn_acceleration) == (0.0, 0.0, 0.0)


def test_a_leader_learns_its_turn_rate_and_forgets_it_in_a_gap(leader):
    times = [0.05 * number for number in range(100)]
    found = fixes(plan_of(vehicle="leader"), 0.5, [*times, 6.5])
    messages = [published(leader, navigated) for navigated in found]
    assert messages[-2].turn_rate == pytest.approx(0.1, abs=1e-3)
    assert messages[-1].turn_rate == 0.0
    # It is never without itself.
    leader.receive(leader_bytes(5.0), 5.0)
    assert leader.leader_age(1e6) == 0.0


def test_a_leader_state_is_put_into_the_local_frame(follower):
    data = leader_bytes(10.0, course=0.5, ground_speed=21.0, acceleration=0.25, turn_rate=0.125)
    follower.receive(data, 10.2)
    state = follower.followed.motion
    assert (state.north, state.east) == pytest.approx((200.0, 0.0), abs=1e-3)
    assert (state.time_s, state.course, state.ground_speed) == (10.0, 0.5, 21.0)
    assert (state.acceleration, state.turn_rate, state.turn_acceleration) == (0.25, 0.125, 0.0)
    assert follower.leader_age(10.7) == pytest.approx(0.7)
    assert not follower.counters


def test_before_the_first_leader_state_there_is_nothing_to_steer_by_and_then_a_slot(follower):
    assert follower.leader_age(5.0) == math.inf
    (navigated,) = fixes(plan_of(), -0.3, [3.0])
    step = follower.step(navigated, Mode.WAITING)
    assert step.setpoint is None
    assert step.distance == math.inf
    # Leader at 60 m north, northbound: the slot is at (40, -20); the follower is at the origin.
    follower.receive(leader_bytes(3.0), 3.0)
    distance = follower.step(navigated, Mode.JOINING).distance
    assert distance == pytest.approx(math.hypot(40.0, 20.0), abs=1e-3)


@pytest.mark.parametrize(
    ("time_s", "now", "reason"),
    [
        (10.0, 10.0, "not newer"),
        (9.95, 10.0, "not newer"),
        # A copy by a link that rounds times.
        (10.0009, 10.0, "not newer"),
        (10.26, 10.0, "from the future"),
        (1e300, 10.0, "from the future"),
        (10.5, 71.0, "too old"),
        (-1e308, 10.0, "too old"),
    ],
)
def test_a_leader_state_of_the_wrong_time_is_counted_and_forgotten(follower, time_s, now, reason):
    follower.receive(leader_bytes(10.0), 10.0)
    kept = follower.followed.motion
    follower.receive(leader_bytes(0.0, time_s=time_s, latitude_deg=47.0), now)
    assert follower.followed.motion == kept
    assert dict(follower.counters) == {reason: 1}


def test_a_leader_whose_clock_is_a_little_ahead_is_believed(follower):
    follower.receive(leader_bytes(10.25), 10.0)
    assert follower.leader_age(10.0) == -0.25


def test_a_leaders_clock_is_read_by_way_of_the_followers_own():
    def ahead(seconds: float) -> Said:
        """Hear a leader whose clock is so much ahead, by times that have exact binary values."""
        return lambda now: [leader_bytes(now, time_s=round(now * 1024.0) / 1024.0 + seconds)]

    two_ahead = SharedClock(to_own=lambda time_s: time_s - 2.0)
    same = new_flight(link=ahead(0.0), until_s=20.0)
    mapped = new_flight(link=ahead(2.0), clock=two_ahead, until_s=20.0)
    unmapped = new_flight(link=ahead(2.0), until_s=20.0).companion
    assert (mapped.sent, mapped.events) == (same.sent, same.events)
    assert mapped.companion.counters == same.companion.counters
    assert same.companion.snapshot.setpoint is not None
    assert unmapped.counters["from the future"] > 150
    assert unmapped.snapshot.setpoint is None


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        *((data, "malformed") for data in (b"", b"VFLS", bytes(88))),
        (leader_bytes(0.0, time_s=10.26), "from the future"),
        *((leader_bytes(0.0, time_s=time_s), "too old") for time_s in (-1e308, -1e4)),
    ],
)
def test_what_is_no_leader_state_or_a_first_one_of_the_wrong_time_is_counted(
    follower, data, reason
):
    follower.receive(data, 10.0)
    assert follower.followed.motion is None
    assert dict(follower.counters) == {reason: 1}


def test_a_follower_tells_the_others_five_times_a_second_on_the_formations_clock():
    role = role_of(plan_of(), SharedClock(from_own=lambda time_s: time_s + 50.0))
    times = [3.0 + 0.05 * number for number in range(20)]
    steps = [role.step(navigated, Mode.TRACKING) for navigated in fixes(plan_of(), 0.5, times)]
    told = [decode(step.publish) for step in steps if step.publish is not None]
    assert [one.time_s for one in told] == pytest.approx([53.0, 53.2, 53.4, 53.6, 53.8])
    assert [one.sequence for one in told] == [1, 2, 3, 4, 5]
    assert told[0].latitude_deg == pytest.approx(47.397742, abs=1e-9)
    # One that does not know the formation's clock keeps quiet.
    role = role_of(plan_of(), SharedClock(from_own=lambda _: math.nan))
    (navigated,) = fixes(plan_of(), 0.5, [3.0])
    assert role.step(navigated, Mode.TRACKING).publish is None


def test_a_leader_whose_altitude_is_doubted_is_followed_up_its_helix():
    circle = Circle(north=0.0, east=0.0, radius=300.0, direction=1)
    helix = Helix(circle=circle, climb=Climb(slope=0.1, end=1000.0))
    made = plan_of(vehicle="f1")
    task = replace(made.task, leader=replace(made.task.leader, path=helix))
    role = FollowerRole(made, task, SAME_CLOCK, Arrangements(made, SAME_CLOCK))
    for step in range(100):
        # On the second turn, by 20 m/s; from the fourth second on it says 60 m too much.
        now = 0.1 * step
        place = helix.at(2000.0 + 20.0 * now)
        high = made.altitude_amsl + place.height + (60.0 if now > 4.0 else 0.0)
        motion = {"turn_rate": 20.0 / 300.0, "climb_rate": 2.0, "altitude_amsl": high}
        motion["course"] = math.remainder(place.course, math.tau)
        role.receive(leader_bytes(now, north=place.north, east=place.east, **motion), now)
        assert role.leader_age(now) == pytest.approx(0.0, abs=1e-6)
        assert role.followed.motion.height == pytest.approx(made.height + place.height, abs=1.0)


def leadership_after(said: Said, clock: SharedClock) -> tuple[str, int]:
    """Who leads f1 after 20 s at 20 Hz of this leader, in which a follower is heard as well."""
    plan = flight_plan(replaced("line-calm", deputies=["f1", "f2"]), "f1")
    role = role_of(plan, clock)
    for navigated in fixes(plan_of(), 0.0, [0.05 * step for step in range(400)]):
        now = navigated.state.time_s
        for data in said(now):
            role.receive(data, now)
        role.receive_neighbour("f3", leader_bytes(now, north=-60.0 + 20.0 * now, east=60.0), now)
        role.step(navigated, Mode.TRACKING)
    return role.leadership


@pytest.mark.parametrize(
    ("north", "ahead_s", "expected"),
    [
        (0.0, 0.0, ("leader", 0)),
        # 5 km off, from the future, and too old.
        (5000.0, 0.0, ("f1", 2)),
        (0.0, 30.0, ("f1", 2)),
        (0.0, -90.0, ("f1", 2)),
    ],
)
def test_a_leader_that_says_what_cannot_be_is_succeeded(north, ahead_s, expected):
    def said(now: float) -> list[bytes]:
        # From the fifth second on what it says is wrong.
        off_m, off_s = (north, ahead_s) if now > 5.0 else (0.0, 0.0)
        return [leader_bytes(now, north=20.0 * now + off_m, time_s=100.0 + now + off_s)]

    clock = SharedClock(to_own=lambda time_s: time_s - 100.0, from_own=lambda now: now + 100.0)
    assert leadership_after(said, clock) == expected


def test_a_leader_is_heard_while_the_time_is_not_known():
    clock = SharedClock(to_own=lambda _: math.nan, from_own=lambda _: math.nan)
    assert leadership_after(lambda now: [leader_bytes(now)], clock) == ("leader", 0)


@pytest.mark.parametrize("by_radio", [False, True])
def test_an_order_that_the_others_fly_by_is_waited_for_by_radio_too(by_radio):
    made = plan_of(vehicle="f1")
    arrangements = Arrangements(made, SAME_CLOCK)
    role = FollowerRole(made, made.task, SAME_CLOCK, arrangements)
    state = decode(leader_bytes(1.0, arrangement=217_000_000))
    if by_radio:
        header = {"formation": 4, "sender": 3, "ticks": ticks_of(1.0)}
        packet = encode_packet(PackedKind.STATE, **header, body=encode_motion(state))
        state = decode_packet(packet + bytes(TAG_SIZE)).state
    role.receive(encode(state), 1.0)
    role.receive_neighbour("f2", encode(state), 1.0)
    assert role.followed.motion is not None
    assert arrangements.waits(1.0)


def test_a_leader_that_is_restarted_in_a_hold_keeps_the_height_that_it_has():
    own = plan_of(vehicle="leader")
    arrangements = Arrangements(own, SAME_CLOCK)
    role = LeaderRole(own, own.task, SAME_CLOCK, arrangements)  # type: ignore[arg-type]
    first, second = fixes(own, 0.5, [3.0, 3.1])
    first = replace(first, state=replace(first.state, height=160.0))
    second = replace(second, state=replace(second.state, height=161.5))
    # It waits until the order is repeated, and has not steered yet.
    role.step(first, Mode.WAITING)
    latitude_deg, longitude_deg = own.frame.to_geodetic(0.0, 200.0)
    circle = HoldCircle(latitude_deg=latitude_deg, longitude_deg=longitude_deg, radius_m=200.0)
    hold = order_of(number=3, time_s=2.0, flown=Manoeuvre.HOLD, across_s=0.0, circle=circle)
    for name in ("f1", "f2"):
        arrangements.hear(name, heard(3.0, 3), 3.0)
    arrangements.receive_order(encode_order(hold), b"", 3.0, repeated=True)
    assert arrangements.flight.circle is not None
    assert role.step(second, Mode.TRACKING).height == pytest.approx(161.5, abs=0.5)
