"""What a pilot hears of a vehicle that keeps clear of another, and what the vehicle does."""

from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from vfguide.companion.avoidance import KeepClear, Obstacle
from vfguide.companion.plan import flight_plan
from vfguide.companion.supervisor import Mode
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.mission.model import Mission

Make = Callable[..., Any]

Place = Callable[[float, float], dict[str, float]]

JOINED_S = 25.0
"""By then f1 is in its slot, 20 m behind and 20 m left of the leader."""


@pytest.fixture
def place(mission: Callable[[str], Mission]) -> Place:
    """Makes the coordinates of a place, m from the mission's origin."""
    frame = flight_plan(mission("line-calm"), "f1").frame

    def make(north: float, east: float) -> dict[str, float]:
        latitude, longitude = frame.to_geodetic(north, east)
        return {"latitude_deg": latitude, "longitude_deg": longitude}

    return make


def test_the_pilot_hears_of_whom_the_vehicle_keeps_clear_and_how(
    flight: Make, leader_bytes: Make, place: Place
) -> None:
    one = flight()

    def link(now: float) -> Iterable[bytes]:
        if now >= JOINED_S:
            # f2, flown by hand, comes up from behind to beside f1's slot: by 3 m/s, 4 m right of it.
            north = 20.0 * now - 60.0 + 3.0 * (now - JOINED_S)
            state = leader_bytes(now, **place(north, -16.0), ground_speed=23.0, steered=False)
            one.companion.receive_neighbour("f2", state, now)
        return [leader_bytes(now)]

    one.link = link
    one.run(JOINED_S + 20.0)
    assert one.mode_at(JOINED_S) is Mode.TRACKING
    said = [text for time, text in one.texts() if time > JOINED_S and "f2" in text]
    assert any("keeping clear of f2, off its slot until that is past" in text for text in said)
    assert all(text.endswith("; watch f2, be ready to take over") for text in said)
    # Once each, not at every look.
    assert len(said) == len(set(said)) <= 4


def test_a_vehicle_with_room_around_it_says_nothing(
    flight: Make, leader_bytes: Make, place: Place
) -> None:
    one = flight()

    def link(now: float) -> Iterable[bytes]:
        state = leader_bytes(now, **place(20.0 * now - 20.0, 200.0), steered=False)
        one.companion.receive_neighbour("f2", state, now)
        return [leader_bytes(now)]

    one.link = link
    one.run(JOINED_S + 10.0)
    assert not [text for _, text in one.texts() if "f2" in text]


def test_two_that_meet_for_a_moment_while_they_join_use_no_height_and_say_so_once(
    mission: Callable[[str], Mission],
) -> None:
    # f1 and f2 cross in front of f3: for one or two steps no turn alone keeps 10 m.
    content = mission("circle-wind").model_dump(exclude_unset=True)
    content["rehearsal"]["duration_s"] = 12.0
    flight_of = fly_lockstep(Mission.model_validate(content))
    said = [event.text for event in flight_of.events["f1"] if "be ready to take over" in event.text]
    assert said
    assert len(said) == len(set(said))
    assert not [text for text in said if "descending" in text or "climbing" in text]
    altitude = flight_of.record.followers[0].altitude_amsl_m
    assert altitude.max() - altitude.min() < 1.0


@pytest.mark.parametrize(("height_m", "step_m"), [(100.0, -20.0), (40.0, -10.0), (-3.0, 0.0)])
def test_no_vehicle_descends_by_more_than_a_quarter_of_the_height_that_it_has(
    mission: Callable[[str], Mission], height_m: float, step_m: float
) -> None:
    # The mission flies at 100 m; f1 is below another one, which is near.
    plan = flight_plan(mission("line-calm"), "f1")
    altitude = plan.frame.altitude_m + height_m
    above = Obstacle(name="f2", altitude_amsl=altitude + 5.0, least_m=7.0, under=True)
    navigated = SimpleNamespace(state=SimpleNamespace(time_s=10.0), altitude_amsl=altitude)
    keep_clear = KeepClear(plan, cast("Any", None))
    step = keep_clear._height_for(above, cast("Any", navigated))  # noqa: SLF001
    assert step == pytest.approx(step_m)
