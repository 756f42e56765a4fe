"""What is sent to ground stations, and what is left out, when there is much to say."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.companion.announcer import MOST_WAITING, Announcer, PlottedValues
from vfguide.companion.own_vehicle import OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import RoleStep
from vfguide.companion.roles import LeaderRole, role_of
from vfguide.companion.supervisor import Control, Mode
from vfguide.companion.timing import SAME_CLOCK
from vfguide.laws.leader import LeaderTask
from vfguide.mavlink.reports import AirspeedReport, PositionReport


def said(announcer: Announcer, from_s: float, to_s: float) -> list[str]:
    """Texts that are sent in a time, looked at twice a second; each is short enough for one message."""
    times = (from_s + 0.5 * number for number in range(int(2.0 * (to_s - from_s))))
    return [str(message.text) for now in times for message in announcer.due(now)]


def test_the_first_of_many_warnings_is_not_lost() -> None:
    announcer = Announcer("f1")
    warnings = [f"warning {number}" for number in range(12)]
    for warning in warnings:
        announcer.warn(warning, 0.0)
    assert said(announcer, 0.0, 24.0) == [f"vfguide f1: {warning}" for warning in warnings]


def test_there_are_two_seconds_between_any_two_texts() -> None:
    announcer = Announcer("f1")
    for number in range(3):
        announcer.warn(f"warning {number}", 0.0)
    times = [0.1 * step for step in range(100) if announcer.due(0.1 * step)]
    assert times == pytest.approx([0.0, 2.0, 4.0], abs=0.11)


def test_a_change_of_mode_waits_for_no_warning_and_for_the_change_before_it() -> None:
    announcer = Announcer("f1")
    for number in range(5):
        announcer.warn(f"warning {number}", 0.0)
    said(announcer, 0.0, 0.5)
    announcer.change("leader lost")
    assert said(announcer, 0.5, 1.0) == ["vfguide f1: leader lost"]
    announcer.change("leader is back")
    assert not said(announcer, 1.0, 2.5)
    assert said(announcer, 2.5, 3.0) == ["vfguide f1: leader is back"]


def test_what_is_worse_is_said_first_and_each_with_its_severity() -> None:
    announcer = Announcer("f1")
    announcer.inform("all have agreed", 0.0)
    announcer.change("in its place")
    announcer.warn("too near", 0.0)
    announcer.warn("much too near", 0.0)
    sent = [message for now in (0.0, 2.0, 4.0, 6.0) for message in announcer.due(now)]
    assert [(message.severity, message.text) for message in sent] == [
        (5, "vfguide f1: in its place"),
        (4, "vfguide f1: too near"),
        (4, "vfguide f1: much too near"),
        (6, "vfguide f1: all have agreed"),
    ]


def test_a_warning_finds_room_among_many_words_that_are_none_and_those_may_come_again() -> None:
    announcer = Announcer("f1")
    for number in range(MOST_WAITING):
        announcer.inform(f"word {number}", 0.0)
    announcer.warn("too near", 0.0)
    texts = said(announcer, 0.0, 40.0)
    assert texts[0] == "vfguide f1: too near"
    assert texts[1:] == [f"vfguide f1: word {number}" for number in range(MOST_WAITING - 1)]
    announcer.inform(f"word {MOST_WAITING - 1}", 40.0)
    assert said(announcer, 40.0, 41.0) == [f"vfguide f1: word {MOST_WAITING - 1}"]


def test_a_warning_for_which_there_is_no_room_is_sent_when_it_comes_again() -> None:
    announcer = Announcer("f1")
    for number in range(MOST_WAITING):
        announcer.warn(f"warning {number}", 0.0)
    announcer.warn("the last straw", 0.0)
    assert "vfguide f1: the last straw" not in said(announcer, 0.0, 35.0)
    announcer.warn("the last straw", 35.0)
    assert said(announcer, 35.0, 36.0) == ["vfguide f1: the last straw"]


def test_why_nothing_is_steered_is_told_once_it_has_lasted_for_two_seconds() -> None:
    announcer = Announcer("f1")
    for tenths in range(40):
        announcer.watch(Mode.WAITING, Control.GUIDED, lambda: "nothing to steer by", 0.1 * tenths)
        sent = [message.text for message in announcer.due(0.1 * tenths)]
        assert sent == (["vfguide f1: nothing to steer by"] if tenths == 20 else []), tenths


def test_on_the_way_into_steering_only_the_steering_is_told() -> None:
    announcer = Announcer("f1")
    announcer.watch(Mode.WAITING, Control.GUIDED, lambda: "nothing to steer by", 0.0)
    announcer.watch(Mode.JOINING, Control.GUIDED, lambda: "joining", 0.2)
    announcer.watch(Mode.JOINING, Control.GUIDED, lambda: "joining", 9.0)
    assert said(announcer, 9.0, 12.0) == ["vfguide f1: joining"]


Flight = Callable[..., Any]
Flown = Any
"""A flight of conftest.py, which tests cannot import."""


def values(flown: Flown, name: str) -> list[tuple[float, float]]:
    """(time sent in s, value) of everything sent by a name."""
    parser = mavlink.MAVLink(None)
    return [
        (time, message.value)
        for time, data in flown.sent
        for message in parser.parse_buffer(data) or []
        if message.get_type() == "NAMED_VALUE_FLOAT" and message.name == name
    ]


def test_a_follower_s_errors_say_where_its_slot_is_twice_a_second(flight: Flight) -> None:
    flown = flight(engage=False)
    flown.run(10.0)
    along, cross = values(flown, "slot_along"), values(flown, "slot_cross")
    # It flies 50 m behind the origin and 30 m left of it, its slot is 20 m behind and 20 m left; both fly
    # north at 20 m/s, but the loiter turns it away: only the beginning is known beforehand.
    assert along[0][1] == pytest.approx(30.0, abs=4.0)
    assert cross[0][1] == pytest.approx(10.0, abs=2.0)
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(along)]
    assert gaps
    assert all(gap == pytest.approx(0.5, abs=0.051) for gap in gaps)


def test_in_its_slot_the_errors_are_small_and_the_mode_is_2(flight: Flight) -> None:
    flown = flight()
    flown.run(90.0)
    for name in ("slot_along", "slot_cross", "slot_up"):
        assert abs(values(flown, name)[-1][1]) < 1.0
    assert values(flown, "form_mode")[-1][1] == 2.0
    assert values(flown, "form_mode")[0][1] == 0.0


def test_without_a_leader_the_mode_is_sent_and_no_error(flight: Flight) -> None:
    flown = flight(link=lambda _now: [])
    flown.run(5.0)
    assert values(flown, "form_mode")
    assert values(flown, "slot_along") == []


def test_a_position_that_is_not_heard_any_more_leaves_a_gap_in_the_curve(flight: Flight) -> None:
    flown = flight(engage=False)
    flown.run(5.0)
    flown.deaf = True
    flown.run(10.0)
    assert values(flown, "slot_along")[-1][0] <= 6.1


def test_the_leader_sends_where_its_path_is_and_no_slot(plan: Callable[..., FlightPlan]) -> None:
    its = plan("line-calm", "leader")
    role, plotted = role_of(its, SAME_CLOCK), PlottedValues()
    assert isinstance(role, LeaderRole)
    assert isinstance(its.task, LeaderTask)
    course = its.task.path.nearest(0.0, 0.0, 0.0).course
    # 3 m to the right of a line through the origin, which is then 3 m to the left.
    latitude, longitude = its.frame.to_geodetic(-3.0 * math.sin(course), 3.0 * math.cos(course))
    report = PositionReport(
        boot_time_s=4.0,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl=588.0,
        velocity_north=20.0 * math.cos(course),
        velocity_east=20.0 * math.sin(course),
        heading=course,
    )
    own = OwnVehicle(its)
    own.note(AirspeedReport(airspeed=20.0), 4.0)
    navigated = own.take(report, 4.0)
    assert navigated is not None
    plotted.note(role.step(navigated, Mode.TRACKING), 4.0)
    sent = {message.name: message.value for message in plotted.due(Mode.TRACKING, 4.0)}
    assert sent == {"form_mode": 2.0, "path_cross": pytest.approx(-3.0, abs=0.01)}


def slot_off(*, along_track: float = 1.0, cross_track: float = 1.0, up: float = 0.0) -> RoleStep:
    """A step of one whose slot is elsewhere by so much, m."""
    return RoleStep(
        setpoint=None,
        distance=1.0,
        lyapunov=1.0,
        publish=None,
        height=100.0,
        along_track=along_track,
        cross_track=cross_track,
        up=up,
    )


def test_a_slot_above_is_positive_and_of_a_doubted_height_none_is_sent() -> None:
    for up, sent in ((-4.0, -4.0), (math.nan, None)):
        plotted = PlottedValues()
        step = slot_off(cross_track=2.0, up=up)
        plotted.note(step, 0.0)
        found = {one.name: one.value for one in plotted.due(Mode.TRACKING, 0.0)}
        assert found.get("slot_up") == sent


def test_names_fit_their_field() -> None:
    for along, count in ((1.0, 4), (math.nan, 2)):
        plotted = PlottedValues()
        step = slot_off(along_track=along)
        plotted.note(step, 0.0)
        messages = plotted.due(Mode.JOINING, 0.0)
        assert len(messages) == count
        assert all(len(message.name) <= 10 for message in messages)
