"""What a pilot hears of a vehicle that keeps clear of another, and what the vehicle does."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from tests.kit.companion import Flight, companion_of, emulator, leader_bytes, new_flight
from tests.kit.flight import fly
from tests.kit.missions import content_of
from vfguide.companion.supervisor import Mode
from vfguide.mission.model import Mission

JOINED_S = 10.0
"""By then f1, which begins there, is steered in its slot, 20 m behind and 20 m left of the leader."""


def in_slot(**parts: Any) -> Flight:
    """Make a flight of f1 that begins in its slot; `parts` as of `new_flight`."""
    return new_flight(autopilot=emulator(north=-20.0, east=-20.0), **parts)


def test_the_pilot_hears_of_whom_the_vehicle_keeps_clear_and_how():
    def by_hand(now: float) -> dict[str, bytes]:
        """f2 comes up from behind to beside f1's slot: by 3 m/s, 4 m right of it."""
        north = 20.0 * now - 60.0 + 3.0 * (now - JOINED_S)
        state = leader_bytes(now, north=north, east=-16.0, ground_speed=23.0, steered=False)
        return {"f2": state} if now >= JOINED_S else {}

    one = in_slot(neighbours=by_hand, until_s=JOINED_S + 20.0)
    assert one.mode_at(JOINED_S) is Mode.TRACKING
    said = [text for time, text in one.texts() if time > JOINED_S and "f2" in text]
    assert any("keeping clear of f2, off its slot until that is past" in text for text in said)
    assert all(text.endswith("; watch f2, be ready to take over") for text in said)
    # Once each, not at every look.
    assert len(said) == len(set(said)) <= 4


def test_a_vehicle_with_room_around_it_says_nothing():
    def far(now: float) -> dict[str, bytes]:
        return {"f2": leader_bytes(now, north=20.0 * now - 20.0, east=200.0, steered=False)}

    one = in_slot(neighbours=far, until_s=JOINED_S + 10.0)
    assert not [text for _, text in one.texts() if "f2" in text]


def test_two_that_meet_for_a_moment_while_they_join_use_no_height_and_say_so_once():
    # f1 and f2 cross in front of f3: for one or two steps no turn alone keeps 10 m.
    flight_of = fly("circle-wind", 12.0)
    said = [event.text for event in flight_of.events["f1"] if "be ready to take over" in event.text]
    assert said
    assert len(said) == len(set(said))
    assert not [text for text in said if "descending" in text or "climbing" in text]
    altitude = flight_of.record.followers[0].altitude_amsl_m
    assert altitude.max() - altitude.min() < 1.0


def heights_beside(
    f3_up_m: Callable[[float], float | None] = lambda _: None,
    *,
    height_m: float = 100.0,
    last_s: float = 8.0,
) -> dict[float, float]:
    """Fly f1 in its slot, with f2, flown by hand, 3 m right of it until it climbs away, and f3 behind.

    Args:
        f3_up_m: how high f3 is above the slot, steered by its companion; None where it is not near.
        height_m: of the slot above the origin.
        last_s: how long to fly.

    Returns:
        how many metres f1 is higher than the slot, by the seconds since f2 is near.
    """
    one, heights, altitude = in_slot(), dict[float, float](), 488.0 + height_m

    def beside(now: float) -> dict[str, bytes]:
        since_s, north = round(now - JOINED_S, 1), 20.0 * now - 20.0
        if since_s < 0.0:
            return {}
        heights[since_s] = one.autopilot.truth().altitude_amsl_m - altitude
        away_m = max(5.0 * (since_s - 3.0), 0.0)
        up = {"altitude_amsl": altitude + away_m, "climb_rate": 5.0 if away_m else 0.0}
        near = {"f2": leader_bytes(now, north=north, east=-17.0, steered=False, **up)}
        f3_up = f3_up_m(since_s)
        if f3_up is not None:
            third = {"north": north - 6.0, "east": -20.0, "altitude_amsl": altitude + f3_up}
            near["f3"] = leader_bytes(now, **third)
        return near

    one.neighbours = beside
    one.link = lambda now: [leader_bytes(now, altitude_amsl=altitude)]
    one.run(JOINED_S + last_s)
    return heights


def test_beside_one_alone_the_earlier_in_the_mission_descends_and_comes_back():
    heights = heights_beside(last_s=25.0)
    assert max(heights.values()) < 1.0
    assert min(heights.values()) == pytest.approx(-20.0, abs=1.0)
    assert heights[25.0] == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("f3_up_m", [-12.0, -20.0, -24.0])
def test_no_vehicle_steps_into_the_layer_of_a_third_one(f3_up_m):
    heights = heights_beside(lambda _: f3_up_m)
    assert min(heights.values()) > -1.0
    assert max(heights.values()) > 7.0


def test_a_vehicle_does_not_come_back_through_the_height_of_another():
    # f1 is 20 m lower when f3 comes along 12 m under the slot, and stays until 25 s.
    heights = heights_beside(lambda since_s: -12.0 if 7.0 <= since_s < 25.0 else 300.0, last_s=45.0)
    assert max(height for since_s, height in heights.items() if 10.0 < since_s < 25.0) < -17.0
    assert heights[45.0] == pytest.approx(0.0, abs=1.0)


def test_no_vehicle_descends_by_more_than_a_quarter_of_the_height_that_it_has():
    # 76 m above the origin, in a mission of 100 m: f3 keeps it from climbing, and it would descend by 20 m.
    heights = heights_beside(lambda _: 12.0, height_m=76.0)
    assert min(heights.values()) == pytest.approx(-19.0, abs=0.5)


@pytest.mark.parametrize(("slot_m", "step_m"), [(8.0, 0.0), (20.0, 20.0)])
def test_a_leader_uses_no_height_beside_a_follower_in_a_close_slot_that_would_come_along(
    slot_m, step_m
):
    # f1's slot is 11 or 28 m away. 30 m off its path the leader keeps clear of all; f1 flies 3 m right of it.
    content = content_of("line-calm")
    content["path"]["course_deg"], content["rehearsal"]["rate_hz"] = 0.0, 10.0
    content["followers"][0]["slot"] = {"forward_m": -slot_m, "right_m": -slot_m}
    one, heights = new_flight("leader"), list[float]()
    one.companion = companion_of("leader", mission=Mission.model_validate(content))

    def f1(now: float) -> dict[str, bytes]:
        true, (north, east) = one.autopilot.truth(), one.place()
        heights.append(abs(true.altitude_amsl_m - 588.0))
        course = math.remainder(true.course_rad, math.tau)
        state = leader_bytes(now, north=north, east=east + 3.0, course=course)
        return {"f1": state} if now >= 3.0 else {}

    one.link, one.neighbours = lambda _now: [], f1
    one.run(12.0)
    assert max(heights) == pytest.approx(step_m, abs=5.0)
