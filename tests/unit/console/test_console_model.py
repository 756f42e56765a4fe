"""The console's model: what it makes of states, by hand-computed places; its ground and its history."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.missions import replaced, shipped
from tests.kit.orders import heard
from tests.kit.states import leader_message
from vfguide.companion.mission_plan import local_frame
from vfguide.companion.presence_figures import figures_of_leader
from vfguide.formation.arrangement import Arrangement, Point, SlotMove
from vfguide.lab.console.alarms import FINE_S, MODES, SERIES, History
from vfguide.lab.console.model import FormationModel, describe_ground, slot_of
from vfguide.lab.rehearsal.recorder import rally_points
from vfguide.link.codec import encode
from vfguide.link.presence import Presence
from vfguide.mission import Mission

MISSION = shipped("circle-wind")
"""f1 is 20 m behind and 20 m left of the leader."""

ALTITUDE_M = 588.0


@pytest.fixture
def formation() -> FormationModel:
    return FormationModel(MISSION)


def state(north: float, east: float, mission: Mission = MISSION, **values: float) -> bytes:
    """A state at 100 s, northbound at 20 m/s, but for what is given."""
    latitude, longitude = local_frame(mission).to_geodetic(north, east)
    usual = {"time_s": 100.0, "course": 0.0, "altitude_amsl": ALTITUDE_M, "turn_rate": 0.0}
    said = leader_message(
        latitude_deg=latitude,
        longitude_deg=longitude,
        ground_speed=20.0,
        acceleration=0.0,
        turn_acceleration=0.0,
        climb_rate=0.0,
        term=0,
        arrangement=0,
        **(usual | values),
    )
    return encode(said)


TRAIL = Arrangement(
    number=7,
    time_s=99.0,
    across_s=0.0,
    places=tuple(
        SlotMove(vehicle=name, begin=Point(-20, -20), end=Point(-20.0 * (row + 1), 0.0))
        for row, name in enumerate(MISSION.followers_by_name)
    ),
)
"""All one behind the other, 20 m apart, from where they are at once."""


def online(mode: str = "tracking", **more: float) -> Presence:
    return Presence(status="online", mode=mode, time_s=0.0, version="1", figures=more)


def numbers(formation: FormationModel, name: str, now: float) -> dict[str, float]:
    row = formation.sample(now)[formation.names.index(name)]
    return dict(zip(SERIES, row.tolist(), strict=True))


def alarms(formation: FormationModel, now: float) -> list[tuple[str, str]]:
    return [(one.level, one.text) for one in formation.alarms(now)]


def test_a_follower_in_its_slot_is_not_off(formation):
    """On a course of 90 degrees behind is west and left is north."""
    east = math.pi / 2.0
    formation.take_state("leader", state(0.0, 0.0, course=east), 1.0)
    formation.take_state("f1", state(20.0, -20.0, course=east), 1.0)
    shown = numbers(formation, "f1", 1.0)
    assert (shown["along_m"], shown["across_m"]) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert shown["north_m"] == pytest.approx(20.0, abs=1e-3)
    assert shown["course_deg"] == pytest.approx(90.0)


def test_a_leader_without_a_companion_is_shown_as_its_followers_hear_it():
    """It was at 100 m north 0.5 s ago and flies north at 20 m/s; f1's slot is behind and left of it."""
    mission = shipped("foreign-leader")
    formation = FormationModel(mission)
    forward, right, _ = slot_of(mission, "f1")
    follower = state(110.0 + forward, right, mission)
    said = figures_of_leader(replace(heard(9.5, 0), north=100.0, steered=False), 10.0)
    # Before the formation's time is known it says nothing of now.
    formation.take_presence("f1", online(**said), 1.0)
    assert math.isnan(numbers(formation, mission.leader.vehicle, 1.0)["north_m"])
    formation.take_state("f1", follower, 1.1)
    formation.take_presence("f1", online(**said), 1.1)
    leader = numbers(formation, mission.leader.vehicle, 1.1)
    assert leader["north_m"] == pytest.approx(110.0, abs=1e-3)
    assert leader["age_s"] == pytest.approx(0.5)
    assert numbers(formation, "f1", 1.1)["along_m"] == pytest.approx(0.0, abs=1e-2)
    # Older words, and what no aircraft does, change nothing.
    for wrong in ({"led_by_age_s": 2.0}, {"led_by_age_s": 0.0, "led_by_speed_m_s": 1e300}):
        formation.take_presence("f1", online(**{**said, "led_by_north_m": 0.0, **wrong}), 1.1)
        shown = numbers(formation, mission.leader.vehicle, 1.1)
        assert shown["north_m"] == pytest.approx(110.0, abs=1e-3)


def test_slots_are_where_the_order_that_is_flown_has_them(formation):
    """In trail f1 is 20 m behind the leader, whatever the mission says."""
    formation.take_state("leader", state(0.0, 0.0), 1.0)
    formation.take_state("f1", state(-20.0, 3.0), 1.0)
    assert numbers(formation, "f1", 1.0)["slot_east_m"] == pytest.approx(-20.0, abs=1e-3)
    formation.take_order(7, TRAIL, leads="leader")
    shown = numbers(formation, "f1", 1.0)
    slot = (shown["slot_north_m"], shown["slot_east_m"], shown["slot_altitude_m"])
    assert slot == pytest.approx((-20.0, 0.0, ALTITUDE_M), abs=1e-3)
    assert shown["across_m"] == pytest.approx(-3.0, abs=1e-3)
    flies = formation.flies()
    assert (flies["number"], flies["order"]) == (7, "trail, 20 m apart")


def test_who_was_ordered_away_is_no_cause_for_an_alarm(formation):
    formation.take_state("f1", state(0.0, 0.0), 1.0)
    formation.take_presence("f1", online("waiting"), 1.0)
    assert any("f1 is not steered" in text for _, text in alarms(formation, 1.0))
    others = tuple(one for one in TRAIL.places if one.vehicle != "f1")
    formation.take_order(7, replace(TRAIL, places=others), leads="leader")
    assert not any("f1" in text for _, text in alarms(formation, 1.0))


def test_slots_of_an_order_that_was_not_heard_are_not_made_up_and_who_is_too_near_is_still_told(
    formation,
):
    formation.take_state("leader", state(0.0, 0.0), 1.0)
    formation.take_state("f1", state(-5.0, 0.0), 1.0)
    formation.take_order(7, None, leads="leader")
    shown = numbers(formation, "f1", 1.0)
    assert math.isnan(shown["slot_north_m"])
    assert math.isnan(shown["along_m"])
    assert "not heard" in str(formation.flies()["order"])
    assert any("5 m apart" in text for _, text in alarms(formation, 1.0))


def test_behind_a_deputy_slots_follow_the_leader_that_it_leads_by(formation):
    """The lost leader would be 100 m north by now; f1's slot is 20 m behind and left of there."""
    formation.take_state("leader", state(0.0, 0.0, time_s=95.0), 1.0)
    formation.take_lead(state(100.0, 0.0, time_s=100.0), 6.0)
    formation.take_state("f1", state(80.0, -20.0, time_s=100.0), 6.0)
    formation.take_order(0, None, leads="f1")
    shown = numbers(formation, "f1", 6.0)
    assert shown["slot_north_m"] == pytest.approx(80.0, abs=1e-2)
    assert shown["along_m"] == pytest.approx(0.0, abs=1e-2)
    flies = formation.flies()
    assert (flies["leads"], flies["succeeded"]) == ("f1", True)
    cards = zip(formation.names, formation.cards(6.0), strict=True)
    assert [name for name, card in cards if card["leads"]] == ["f1"]


def test_a_slot_ahead_and_to_the_right_is_positive(formation):
    formation.take_state("leader", state(0.0, 0.0), 1.0)
    formation.take_state("f1", state(-23.0, -24.0), 1.0)
    shown = numbers(formation, "f1", 1.0)
    assert (shown["along_m"], shown["across_m"]) == pytest.approx((3.0, 4.0), abs=1e-3)


def test_states_of_different_times_are_compared_at_one_time(formation):
    """f1 was heard 0.1 s before the leader, in which both fly 2 m."""
    formation.take_state("f1", state(-20.0, -20.0, time_s=99.9), 0.9)
    formation.take_state("leader", state(2.0, 0.0, time_s=100.0), 1.0)
    assert numbers(formation, "f1", 1.0)["along_m"] == pytest.approx(0.0, abs=1e-3)
    assert numbers(formation, "leader", 1.0)["north_m"] == pytest.approx(2.0, abs=1e-3)


def test_a_message_that_took_long_is_shown_where_its_vehicle_is_by_now(formation):
    """The first took no time, the second half a second, in which 10 m are flown."""
    formation.take_state("leader", state(0.0, 0.0, time_s=100.0), 1.0)
    formation.take_state("leader", state(20.0, 0.0, time_s=101.0), 2.0)
    formation.take_state("f1", state(-20.0 + 20.0, -20.0, time_s=101.0), 2.5)
    assert numbers(formation, "f1", 2.5)["north_m"] == pytest.approx(10.0, abs=1e-3)
    assert numbers(formation, "f1", 2.6)["along_m"] == pytest.approx(0.0, abs=1e-3)


def test_who_is_heard_sooner_than_the_leader_is_carried_back(formation):
    """The leader's messages take 0.2 s, f1's none: f1's state is 0.2 s, or 4 m, ahead of the leader's."""
    formation.take_state("leader", state(0.0, 0.0, time_s=99.8), 1.0)
    formation.take_state("f1", state(-16.0, -20.0, time_s=100.0), 1.0)
    assert numbers(formation, "f1", 1.0)["along_m"] == pytest.approx(0.0, abs=1e-3)


def test_a_turn_is_flown_on(formation):
    """A quarter turn in 2 s at 20 m/s: a circle of radius 80 / pi m."""
    turning = state(0.0, 0.0, turn_rate=math.pi / 4.0)
    formation.take_state("leader", turning, 0.0)
    shown = numbers(formation, "leader", 2.0)
    assert shown["course_deg"] == pytest.approx(90.0)
    # A chord of the arc's length: 40 m toward 45 degrees.
    assert shown["north_m"] == pytest.approx(40.0 * math.sqrt(0.5), abs=1e-2)
    bank_deg = math.degrees(math.atan(20.0 * math.pi / 4.0 / 9.80665))
    assert shown["bank_deg"] == pytest.approx(bank_deg, abs=1e-3)


def test_wind_gives_airspeed_and_heading(formation):
    """North at 20 m/s over ground, the air moves east by 15 m/s: the nose points to the west, 25 m/s."""
    formation.take_presence("leader", online(wind_north_m_s=0.0, wind_east_m_s=15.0), 0.0)
    formation.take_state("leader", state(0.0, 0.0), 0.0)
    shown = numbers(formation, "leader", 0.0)
    assert shown["airspeed_m_s"] == pytest.approx(25.0)
    assert shown["heading_deg"] == pytest.approx(-math.degrees(math.atan2(15.0, 20.0)))


def test_who_is_not_heard_any_more_has_no_slot_and_then_no_place(formation):
    formation.take_state("leader", state(0.0, 0.0), 0.0)
    formation.take_state("f1", state(0.0, 0.0), 0.0)
    assert math.isfinite(numbers(formation, "f1", 1.0)["along_m"])
    shown = numbers(formation, "f1", 3.0)
    assert math.isnan(shown["along_m"])
    assert math.isfinite(shown["north_m"])
    assert shown["age_s"] == pytest.approx(3.0)
    assert math.isnan(numbers(formation, "f1", 16.0)["north_m"])


def test_a_formation_in_its_slots_has_no_alarm(formation):
    places = {"leader": (0.0, 0.0), "f1": (-20.0, -20.0), "f2": (-20.0, 20.0), "f3": (-40.0, 0.0)}
    for name, (north, east) in places.items():
        formation.take_state(name, state(north, east), 0.0)
        formation.take_presence(name, online(), 0.0)
    formation.sample(0.1)
    assert alarms(formation, 0.1) == []
    assert [card["level"] for card in formation.cards(0.1)] == ["good"] * 4


def test_a_companion_that_is_gone_is_an_alarm_of_its_card_alone(formation):
    for name in formation.names:
        formation.take_state(name, state(0.0, 100.0 * len(name)), 0.0)
        formation.take_presence(name, online(), 0.0)
    gone = Presence(status="offline", mode="", time_s=0.0, version="1")
    formation.take_presence("f2", gone, 0.5)
    ((level, text),) = [one for one in alarms(formation, 0.5) if "lost" in one[1]]
    assert level == "alarm"
    assert text.startswith("f2 has lost its companion")
    assert "take it over by hand" in text
    row = formation.names.index("f2")
    assert formation.cards(0.5)[row]["level"] == "alarm"
    assert MODES[int(numbers(formation, "f2", 0.5)["mode"])] == "offline"


@pytest.mark.parametrize(
    ("higher_m", "told"),
    [
        (0.0, "leader and f1 are 5 m apart: take one of them out of the formation by hand."),
        (20.0, None),
    ],
)
def test_two_that_are_too_near_are_named(formation, higher_m, told):
    formation.take_state("leader", state(0.0, 0.0), 0.0)
    formation.take_state("f1", state(3.0, 4.0, altitude_amsl=ALTITUDE_M + higher_m), 0.0)
    formation.sample(0.0)
    found = alarms(formation, 0.0)
    assert [text for _, text in found if "apart" in text] == [told] * bool(told)
    assert not told or found[0] == ("alarm", told)


def test_silence_of_one_is_its_own_and_of_all_is_the_links(formation):
    for name in ("leader", "f1"):
        formation.take_state(name, state(0.0, 50.0 * len(name)), 0.0)
        formation.take_presence(name, online(), 0.0)
    formation.take_state("leader", state(0.0, 0.0, time_s=105.0), 5.0)
    texts = [text for _, text in alarms(formation, 5.0)]
    assert any(text.startswith("f1 has not been heard for 5 s") for text in texts)
    texts = [text for _, text in alarms(formation, 10.0)]
    assert any(text.startswith("No aircraft has been heard for 5 s") for text in texts)
    assert not any(text.startswith("f1 has not") for text in texts)
    assert {card["level"] for card in formation.cards(10.0)} == {"alarm"}


@pytest.mark.parametrize(
    ("mode", "level", "advice"),
    [
        ("predicting", "alarm", "mend the link within 30 s"),
        ("breakaway", "alarm", "give it room"),
        ("lost", "alarm", "take it over"),
        ("pilot", "note", "select the guided mode"),
        ("waiting", "note", "armed and in the guided mode"),
    ],
)
def test_modes_in_which_somebody_should_act_say_what_to_do(formation, mode, level, advice):
    formation.take_state("f1", state(0.0, 0.0), 0.0)
    formation.take_presence("f1", online(mode), 0.0)
    ((found, text),) = [one for one in alarms(formation, 0.1) if one[1].startswith("f1 ")]
    assert found == level
    assert advice in text


def test_a_warning_is_as_old_as_it_was_new(formation):
    for now in (1.0, 2.0, 3.0):
        said = Presence(status="online", mode="tracking", time_s=0.0, version="1", warning="hot")
        formation.take_presence("f1", said, now)
    card = formation.cards(11.0)[formation.names.index("f1")]
    assert card["warning"] == "hot"
    assert card["warned_s"] == 10


def test_the_flight_so_far_is_json_that_the_replay_reads(formation):
    formation.sample(0.0)
    formation.take_state("leader", state(0.0, 0.0), 0.0)
    formation.sample(0.1)
    content = formation.describe()
    json.dumps(content, allow_nan=False)
    assert content["modes"] == list(MODES)
    assert content["live"] is True
    assert len(formation.history.time_s) == 2


@settings(deadline=None, derandomize=True, max_examples=200)
@given(data=st.binary(max_size=120), name=st.sampled_from(["leader", "f1", "stranger"]))
def test_whatever_comes_the_picture_stays_json(data, name):
    formation = FormationModel(MISSION)
    formation.take_state(name, data, 0.0)
    formation.sample(0.1)
    json.dumps(formation.describe(), allow_nan=False)
    assert not formation.heard_anything


def test_a_card_has_the_battery_as_its_autopilot_tells_it(formation):
    formation.take_presence("f1", online(battery_percent=62.0, battery_v=11.4), 1.0)
    formation.take_presence("f2", online(), 1.0)
    told = [(card["battery_percent"], card["battery_v"]) for card in formation.cards(1.0)]
    unknown = (None, None)
    assert formation.names[1] == "f1"
    assert told == [unknown, (62.0, 11.4), unknown, unknown]


def test_pages_are_told_the_limits_of_each_vehicle(formation):
    described = json.loads(json.dumps(formation.describe()))
    lowest, highest = MISSION.vehicles["f1"].airspeed_range_m_s
    assert described["vehicles"][1]["limits"] == {
        "least_airspeed_m_s": lowest,
        "greatest_airspeed_m_s": highest,
        "greatest_bank_deg": MISSION.vehicles["f1"].max_bank_deg,
    }


@pytest.fixture(scope="module")
def mission() -> Mission:
    """A circle of 300 m, another of 250 m round a place 50 m north, and a fence of 900 m."""
    here, north = ({"north_m": north_m, "east_m": 0.0} for north_m in (0.0, 50.0))
    return replaced(
        "circle-wind",
        path={"type": "circle", "centre": here, "radius_m": 300.0},
        paths={"near": {"type": "circle", "centre": north, "radius_m": 250.0}},
        fence={"circles": [{"centre": here, "radius_m": 900.0}]},
    )


def order(path: str) -> Arrangement:
    return Arrangement(number=3, time_s=0.0, across_s=0.0, places=(), path=path)


def test_all_paths_and_the_fence_are_drawn_where_they_are(mission):
    ground = describe_ground(mission)
    for name, north_m, radius_m in (("main", 0.0, 300.0), ("near", 50.0, 250.0)):
        line = ground["paths"][name]
        away_m = np.hypot(np.array(line["north_m"]) - north_m, line["east_m"])
        assert away_m == pytest.approx(radius_m, abs=0.02)
    (fence,) = ground["outlines"]
    assert fence["kind"] == "fence"
    assert max(fence["north_m"]) == pytest.approx(900.0, abs=0.5)


def test_rally_points_of_a_plan_are_drawn():
    mission = shipped("survey-plan")
    kinds = [one["kind"] for one in describe_ground(mission)["outlines"]]
    north, _ = rally_points(mission)
    assert north.size == len(mission.path.rally_points) > 0
    assert kinds.count("rally") == 1
    assert "fence" in kinds


def test_what_was_flown_is_kept_with_the_time_from_which_on_it_was(mission):
    formation = FormationModel(mission)
    for tenths in range(30):
        if tenths >= 10:
            formation.take_order(3, order("near"), leads=formation.names[0])
        formation.sample(0.1 * tenths)
    kept = [(one["t"], one["number"], one["path"]) for one in formation.describe()["flown"]]
    assert kept == [(0.0, 0, "main"), (pytest.approx(0.9), 3, "near")]


def test_the_path_of_the_order_that_is_flown_is_drawn(mission):
    formation = FormationModel(mission)
    assert formation.flies()["path"] == "main"
    formation.take_order(3, order("near"), leads="leader")
    assert formation.flies()["path"] == "near"
    # What follows was not heard: the path stays until it is known.
    formation.take_order(4, None, leads="leader")
    assert formation.flies()["path"] == "near"
    formation.take_order(5, replace(order("main"), number=5), leads="leader")
    assert formation.flies()["path"] == "main"


def filled(seconds: float, *, room: int) -> History:
    """Ten samples a second, each with its own time as its value."""
    history = History(2, 1, room=room)
    for time_s in np.arange(0.0, seconds, 0.1):
        history.add(float(time_s), np.full((2, 1), time_s))
    return history


def test_everything_is_kept_while_there_is_room_but_what_is_not_later():
    history = filled(20.0, room=1000)
    assert history.time_s.size == 200
    np.testing.assert_allclose(history.series(1, 0), history.time_s, atol=1e-4)
    for time_s in (19.9, 19.9, 0.5, 21.0):
        history.add(time_s, np.zeros((2, 1)))
    assert list(history.time_s[199:]) == [pytest.approx(19.9), 21.0]


@pytest.mark.parametrize("room", [800, 1500])
def test_a_long_flight_keeps_its_room_its_beginning_and_its_newest_minute(room):
    history = filled(1800.0, room=room)
    time_s = history.time_s
    assert time_s.size <= room
    assert time_s[0] == 0.0
    assert time_s[-1] == pytest.approx(1799.9)
    newest = min(FINE_S, 0.1 * room / 2) - 1.0
    assert (time_s > 1799.9 - newest).sum() >= 10.0 * newest - 1.0
    np.testing.assert_allclose(history.series(0, 0), time_s, atol=1e-3)


def test_older_samples_stay_evenly_spread():
    """1800 s in at most 0.75 * 1500 samples, 600 of which are the newest minute: 1740 s in 525 at most."""
    time_s = filled(1800.0, room=1500).time_s
    steps = np.diff(time_s[time_s < 1500.0])
    assert steps.max() <= 6.5
    assert steps.max() / steps.min() <= 2.0 + 1e-6
