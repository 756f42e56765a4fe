"""What a vehicle believes of states that it hears, and of two stories of one leader."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.companion import leader_bytes
from tests.kit.missions import plan_of
from tests.kit.orders import heard
from tests.kit.states import FRAME
from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.followed_leader import FollowedLeader
from vfguide.companion.plan import FollowerTask
from vfguide.companion.state_receiver import LeaderStories, StateReceiver, place_said
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.state import HeardState, LeaderFix


@pytest.fixture
def receiver(alerts: Alerts) -> StateReceiver:
    return StateReceiver(FRAME, SAME_CLOCK, alerts, whose="f2")


def ahead(now: float, off: float) -> bytes:
    """A state whose place is some metres ahead of the true one."""
    return leader_bytes(now, north=20.0 * now + off)


def taken(receiver: StateReceiver, off: Callable[[float], float]) -> list[float]:
    """When a state was not taken, of 20 s."""
    times = [step / 20 for step in range(400)]
    return [now for now in times if not receiver.take(ahead(now, off(now)), now)]


@pytest.mark.parametrize("back_s", [99.0, 13.0])
def test_a_leader_that_steps_40_m_ahead_is_silent_for_5_s_or_until_2_s_after_it_is_back(
    receiver, alerts, back_s
):
    refused = taken(receiver, lambda now: 40.0 if 10.0 <= now < back_s else 0.0)
    assert (refused[0], refused[-1]) == (10.0, pytest.approx(14.95))
    assert receiver.counters == {"impossible": 100}
    first, second = (one.text for one in alerts.heard(20.0))
    assert first.startswith("f2 reports what cannot be")
    assert second.startswith("f2 reports what can be again")
    assert alerts.heard(20.0) == []


def test_after_a_long_silence_a_leader_may_have_flown_far_and_one_that_restarts_is_heard(receiver):
    assert receiver.take(leader_bytes(0.0, sequence=5000), 0.0)
    assert receiver.take(ahead(20.0, -600.0), 20.0)
    assert receiver.take(leader_bytes(23.0, north=-140.0, sequence=1), 23.0)


def test_a_formation_whose_clock_starts_anew_is_heard_again():
    shift_s = [0.0]
    ways = {"to_own": lambda time_s: time_s + shift_s[0], "from_own": lambda own: own - shift_s[0]}
    receiver = StateReceiver(FRAME, SharedClock(**ways))
    for step in range(100):
        now = 630.0 + 0.05 * step
        assert receiver.take(leader_bytes(now), now)
    # The leader's computer has started anew: its clock is at 10 s, and it has flown on for 5 s.
    shift_s[0] = 630.0
    for step in range(100):
        own = 640.0 + 0.05 * step
        heard = receiver.take(leader_bytes(own, time_s=own - 630.0), own)
    assert heard


def test_states_that_go_back_in_time_are_not_judged(receiver):
    for step in range(260):
        now = 0.05 * step
        # From 10 s on it is 60 m ahead.
        assert receiver.take(ahead(now, 60.0 if step >= 200 else 0.0), now) is (step < 200)
    before = receiver.counters["not newer"]
    for step in range(20):
        assert not receiver.take(leader_bytes(12.9 - 0.09 * step), 13.0)
    assert receiver.counters["not newer"] == before + 20


RADIUS_M = 5.0


def leader(time_s: float, north: float = 0.0, up: float = 0.0) -> HeardState:
    """A leader that flies east at 20 m/s, some metres off that line."""
    place = {"north": north, "east": 20.0 * time_s, "altitude_amsl": 588.0 + up}
    return replace(heard(time_s, 0), course=math.pi / 2.0, **place)


def follower(place: LeaderFix | None, term: int = 0) -> HeardState:
    """A follower that tells of its leader."""
    return replace(heard(0.0, 0), north=-20.0, term=term, leader_fix=place)


def told(alerts: Alerts | None = None, *, leads: bool = False) -> LeaderStories:
    """Stories of a vehicle that has heard its leader ten times a second for two seconds."""
    stories = LeaderStories(alerts, leads=leads)
    stories.most_m = RADIUS_M
    for tenths in range(21):
        stories.hear_leader(place_said(leader(tenths / 10)), 0)
    return stories


def hear(
    stories: LeaderStories, vehicle: str, time_s: float, *, now: float = 2.0, **off: float
) -> None:
    stories.hear_follower(vehicle, follower(place_said(leader(time_s, **off))), now)


def hear_for_a_second(stories: LeaderStories, others: dict[str, float]) -> None:
    """Hear each follower four times until 3.2 s, by how far north of the own one its leader is, m."""
    for now in (2.0, 2.4, 2.8, 3.2):
        for vehicle, north in others.items():
            hear(stories, vehicle, 2.0, now=now, north=north)


@pytest.mark.parametrize("time_s", [0.0, 1.0, 1.95, 2.0])
def test_one_story_told_at_any_time_of_the_last_seconds_is_one(time_s):
    stories = told()
    hear(stories, "f2", time_s, north=0.9)
    assert stories.may_be_followed(2.0)
    assert stories.elsewhere(leader(2.0), 2.0) is None


@pytest.mark.parametrize(
    ("off", "place"), [({"north": 3.0}, (3.0, 588.0)), ({"up": -4.0}, (0.0, 584.0))]
)
def test_both_places_of_a_leader_with_two_stories_are_known(off, place):
    stories = told()
    hear(stories, "f2", 1.55, **off)
    other = stories.elsewhere(leader(2.0), 2.0)
    assert other is not None
    assert (other.north, other.altitude_amsl) == pytest.approx(place)
    assert other.east == pytest.approx(40.0)
    assert not other.steered


@pytest.mark.parametrize(
    ("others", "followed"),
    [
        ({"f2": 5.5}, False),
        ({"f2": 4.5}, True),
        ({"f2": 0.0, "f3": 5.5}, True),
        ({"f2": 5.5, "f3": -5.5}, False),
        ({"f2": 5.5, "f3": 5.5}, False),
        ({"f2": 0.0, "f3": 0.0, "f4": 99.0, "f5": 99.0}, True),
        ({"f2": 9.0, "f3": 9.0, "f4": 0.0}, False),
    ],
    ids=["one to one", "near", "outvoted", "all differ", "two against", "a minority", "two to two"],
)
def test_a_leader_is_followed_by_the_majority_or_while_stories_are_near(others, followed):
    stories = told()
    hear_for_a_second(stories, others)
    assert stories.may_be_followed(3.2) is followed


def test_who_speaks_first_is_not_the_majority():
    stories = told()
    for now in (2.0, 3.2):
        for vehicle in ("f3", "f4"):
            stories.hear_follower(vehicle, follower(None), now)
        if now == 2.0:
            hear_for_a_second(stories, {"f2": 60.0})
    assert stories.may_be_followed(3.2)


def test_less_than_a_second_of_two_stories_is_no_reason_to_leave_the_leader():
    stories = told()
    for now, north in ((2.0, 60.0), (2.9, 60.0), (3.0, 0.0), (3.1, 60.0)):
        hear(stories, "f2", 2.0, now=now, north=north)
    assert stories.may_be_followed(3.1)


def test_a_leader_is_followed_again_once_all_have_agreed_for_two_seconds(alerts):
    stories = told(alerts)
    hear_for_a_second(stories, {"f2": 9.0})
    assert not stories.may_be_followed(5.1)
    stories.hear_leader(place_said(leader(2.1)), 0)
    hear(stories, "f2", 2.1, now=5.3)
    assert stories.may_be_followed(5.3)
    begins, stops, goes_on = (event.text for event in alerts.heard(5.3))
    told_of = "f2 flies by a place of the leader that is 9 m from what this vehicle was told:"
    assert begins == f"{told_of} kept clear of both, be ready to take over"
    assert stops == (
        f"{told_of} the leader is not followed until they agree; take over, and make new keys"
    )
    assert goes_on == "all fly by the same leader state again: nothing to do"


def test_a_leader_learns_that_somebody_speaks_in_its_name(alerts):
    hear(told(alerts, leads=True), "f3", 2.0, north=2.0)
    (event,) = alerts.heard(2.0)
    assert event.text == (
        "f3 flies by a place of the leader that is 2 m from the one that this leader tells: someone else"
        " has a key; land, make new keys"
    )


@pytest.mark.parametrize(
    "said",
    [
        follower(None),
        follower(place_said(leader(2.0, north=99.0)), term=1),
        follower(place_said(leader(2.5, north=99.0))),
        follower(place_said(leader(-1.0, north=99.0))),
    ],
    ids=["tells nothing", "another leader", "later than what was heard", "before all"],
)
def test_what_cannot_be_compared_is_no_story(said):
    stories = told()
    stories.hear_follower("f2", said, 2.0)
    assert stories.elsewhere(leader(2.0), 2.0) is None


@pytest.mark.parametrize("step", [{"north": 30.0}, {"up": 12.0}])
def test_a_place_that_steps_is_not_met_on_its_way(step):
    """Who has lost a state compares nothing there; who has heard it all does."""
    stories = told()
    stories.hear_leader(place_said(leader(2.2, **step)), 0)
    hear(stories, "f2", 2.1, **step)
    assert stories.elsewhere(leader(2.2), 2.2) is None
    hear(stories, "f2", 2.2, **step)
    assert stories.elsewhere(leader(2.2), 2.2) is None


def test_places_between_states_that_are_far_apart_are_not_compared():
    stories = LeaderStories()
    for time_s in (0.0, 0.7):
        stories.hear_leader(place_said(leader(time_s)), 0)
    hear(stories, "f2", 0.3, north=99.0)
    assert stories.elsewhere(leader(0.7), 0.7) is None


@given(times=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30), north=st.floats(2.0, 1e6))
def test_whatever_the_stamps_an_equal_story_is_no_other_and_another_is(times, north):
    stories = LeaderStories()
    for time_s in times:
        stories.hear_leader(place_said(leader(time_s)), 0)
    newest = stories.newest
    assert newest is not None
    hear(stories, "f2", newest.time_s)
    assert stories.elsewhere(leader(newest.time_s), 2.0) is None
    hear(stories, "f2", newest.time_s, north=north)
    assert stories.elsewhere(leader(newest.time_s), 2.0) is not None


def test_states_that_are_not_believed_hide_no_story():
    """A stamp of next week empties no memory, and a term that nobody obeys counts for nothing."""
    plan = plan_of("line-calm", "f1")
    assert isinstance(plan.task, FollowerTask)
    followed = FollowedLeader(plan, plan.task, SAME_CLOCK, Arrangements(plan, SAME_CLOCK))
    for tenths in range(21):
        now = tenths / 10
        assert followed.note_leader(leader_bytes(now), now)
        followed.note_leader(leader_bytes(now + 6e5), now)
        followed.note_lead("f2", leader_bytes(now + 6e5, term=9), now)
    told_f2 = replace(followed.receiver.newest, north=60.0 + 20.0 * now)
    for now in (2.1, 2.5, 2.9, 3.3):
        followed.stories.hear_follower("f2", follower(place_said(told_f2)), now)
    assert not followed.stories.may_be_followed(3.3)
    assert not followed.note_leader(leader_bytes(3.3), 3.3)
