"""What is sent to ground stations and operators, and what is left out, when there is much to say."""

import math
from collections import Counter
from itertools import pairwise

import pytest

from tests.kit.companion import Flight, new_flight
from tests.kit.missions import plan_of
from tests.kit.states import reported
from tests.kit.wire import parsed
from vfguide.companion.alerts import Alerts
from vfguide.companion.announcer import Announcer, PlottedValues
from vfguide.companion.own_vehicle import OwnVehicle
from vfguide.companion.presence_figures import (
    Quantiles,
    figures_of_battery,
    latency_figures,
    refused_messages,
)
from vfguide.companion.role import RoleStep
from vfguide.companion.roles import role_of
from vfguide.companion.supervisor import Control, Mode
from vfguide.companion.timing import SAME_CLOCK
from vfguide.mavlink.reports import AirspeedReport, SensorsReport


def test_why_nothing_is_steered_is_told_once_it_has_lasted_for_two_seconds():
    announcer = Announcer("f1", Alerts())
    for tenths in range(40):
        announcer.watch(Mode.WAITING, Control.GUIDED, lambda: "nothing to steer by", 0.1 * tenths)
        sent = [message.text for message in announcer.due(0.1 * tenths)]
        assert sent == (["vfguide f1: nothing to steer by"] if tenths == 20 else []), tenths


def test_on_the_way_into_steering_only_the_steering_is_told():
    announcer = Announcer("f1", Alerts())
    announcer.watch(Mode.WAITING, Control.GUIDED, lambda: "nothing to steer by", 0.0)
    announcer.watch(Mode.JOINING, Control.GUIDED, lambda: "joining", 0.2)
    announcer.watch(Mode.JOINING, Control.GUIDED, lambda: "joining", 9.0)
    assert [message.text for message in announcer.due(9.0)] == ["vfguide f1: joining"]
    assert not announcer.due(12.0)


def values(flown: Flight, name: str) -> list[tuple[float, float]]:
    """(time sent in s, value) of everything sent by a name."""
    sent = [(time, message) for time, data in flown.sent for message in parsed(data)]
    named = [one for one in sent if one[1].get_type() == "NAMED_VALUE_FLOAT"]
    return [(time, message.value) for time, message in named if message.name == name]


def test_a_follower_s_errors_say_where_its_slot_is_twice_a_second():
    flown = new_flight(engage=False, until_s=10.0)
    along, cross = values(flown, "slot_along"), values(flown, "slot_cross")
    # It flies 50 m behind the origin and 30 m left of it, its slot is 20 m behind and 20 m left; both fly
    # north at 20 m/s, but the loiter turns it away: only the beginning is known beforehand.
    assert along[0][1] == pytest.approx(30.0, abs=4.0)
    assert cross[0][1] == pytest.approx(10.0, abs=2.0)
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(along)]
    assert gaps
    assert all(gap == pytest.approx(0.5, abs=0.051) for gap in gaps)


def test_in_its_slot_the_errors_are_small_and_the_mode_is_2():
    flown = new_flight(until_s=90.0)
    for name in ("slot_along", "slot_cross", "slot_up"):
        assert abs(values(flown, name)[-1][1]) < 1.0
    assert values(flown, "form_mode")[-1][1] == 2.0
    assert values(flown, "form_mode")[0][1] == 0.0


def test_without_a_leader_the_mode_is_sent_and_no_error():
    flown = new_flight(link=lambda _now: [], until_s=5.0)
    assert values(flown, "form_mode")
    assert values(flown, "slot_along") == []


def test_a_position_that_is_not_heard_any_more_leaves_a_gap_in_the_curve():
    flown = new_flight(engage=False, until_s=5.0)
    flown.deaf = True
    flown.run(10.0)
    assert values(flown, "slot_along")[-1][0] <= 6.1


def test_the_leader_sends_where_its_path_is_and_no_slot():
    its = plan_of("line-calm", "leader")
    role, plotted = role_of(its, SAME_CLOCK), PlottedValues()
    course = its.task.path.nearest(0.0, 0.0, 0.0).course
    # 3 m to the right of a line through the origin, which is then 3 m to the left.
    place = -3.0 * math.sin(course), 3.0 * math.cos(course)
    velocity = 20.0 * math.cos(course), 20.0 * math.sin(course)
    own = OwnVehicle(its)
    own.note(AirspeedReport(airspeed=20.0), 4.0)
    navigated = own.take(reported(4.0, *place, velocity=velocity, heading=course), 4.0)
    plotted.note(role.step(navigated, Mode.TRACKING), 4.0)
    sent = {message.name: message.value for message in plotted.due(Mode.TRACKING, 4.0)}
    assert sent == {"form_mode": 2.0, "path_cross": pytest.approx(-3.0, abs=0.01)}


@pytest.mark.parametrize(
    ("change", "sent"),
    [
        # A slot above is positive.
        ({"up": -4.0}, {"slot_along": 1.0, "slot_cross": 2.0, "slot_up": -4.0}),
        ({"up": math.nan}, {"slot_along": 1.0, "slot_cross": 2.0}),
        ({"along_track": math.nan}, {"path_cross": 2.0}),
    ],
)
def test_what_is_known_of_the_slot_is_sent_by_names_that_fit_their_field(change, sent):
    off = {"along_track": 1.0, "cross_track": 2.0, "up": 0.0} | change
    step = RoleStep(setpoint=None, distance=1.0, lyapunov=1.0, publish=None, height=100.0, **off)
    plotted = PlottedValues()
    plotted.note(step, 0.0)
    found = {one.name: one.value for one in plotted.due(Mode.TRACKING, 0.0)}
    assert found == {"form_mode": 2.0, **sent}
    assert all(len(name) <= 10 for name in found)


def test_quantiles_are_of_the_newest_values_and_the_greatest_of_all():
    series = Quantiles(size=4)
    assert series.quantiles(0.5) == []
    for value in (9.0, 1.0, 2.0, 3.0, 4.0):
        series.add(value)
    # The 9 is gone from 1, 2, 3, 4: half of them are not above the third.
    assert series.quantiles(0.0, 0.5, 1.0) == [1.0, 3.0, 4.0]
    assert (series.greatest, series.last) == (9.0, 4.0)


def test_times_become_milliseconds_and_an_empty_series_its_greatest_alone():
    series = Quantiles()
    assert latency_figures("response_ms", series) == {"response_ms_max": 0.0}
    series.add(0.0012)
    assert latency_figures("response_ms", series) == pytest.approx(
        {f"response_ms_{name}": 1.2 for name in ("p50", "p99", "last", "max")}
    )


def test_refused_messages_are_counted_in_all_and_by_reason():
    counters = Counter({"refused: not signed": 2, "refused: f1's clock": 3, "heard": 7})
    assert refused_messages(counters) == {
        "refused": 5.0,
        "refused_not_signed": 2.0,
        "refused_f1s_clock": 3.0,
    }


def test_of_the_battery_is_told_what_the_autopilot_knows_and_no_more():
    assert figures_of_battery(None) == {}
    assert figures_of_battery(SensorsReport(gps=True, attitude=True)) == {}
    known = SensorsReport(gps=True, attitude=True, battery=0.87, battery_voltage=11.804)
    assert figures_of_battery(known) == {"battery_percent": 87.0, "battery_v": 11.8}
    volts = SensorsReport(gps=True, attitude=True, battery_voltage=11.8)
    assert figures_of_battery(volts) == {"battery_v": 11.8}
