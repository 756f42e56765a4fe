"""What operator, pilot and ground stations of a vehicle hear, in which order, and what is left out."""

import math
from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.companion import Flight, new_flight
from tests.kit.missions import plan_of
from tests.kit.orders import moves, order_of
from tests.kit.states import reported
from tests.kit.wire import parsed
from vfguide.companion.alerts import (
    MOST_KEYS,
    MOST_SAID,
    MOST_WAITING,
    PAUSE_S,
    QUIET_S,
    Alerts,
    Announcer,
)
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.guided_vehicle import PlottedValues
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
from vfguide.formation.arrangement import Point
from vfguide.link.order_codec import encode_order
from vfguide.mavlink.announcements import INFO, NOTICE, WARNING
from vfguide.mavlink.reports import AirspeedReport, SensorsReport


def sent(alerts: Alerts, from_s: float, to_s: float) -> list[tuple[float, str]]:
    """(time, text) of what the pilot gets in a time, looked at ten times a second."""
    times = [from_s + 0.1 * number for number in range(round(10.0 * (to_s - from_s)))]
    return [(now, due[1]) for now in times if (due := alerts.due(now)) is not None]


def texts(alerts: Alerts, from_s: float, to_s: float) -> list[str]:
    return [text for _, text in sent(alerts, from_s, to_s)]


def said(alerts: Alerts, key: str, severity: int, *words: str, now: float = 0.0) -> list[str]:
    """Say all of these at once; those that are logged."""
    for text in words:
        alerts.say(key, severity, text)
    return [one.text for one in alerts.heard(now)]


@pytest.mark.parametrize("kinds", [["command"], ["command", "order", "clock"]])
def test_of_many_warnings_none_is_lost_and_two_seconds_are_between_any_two(alerts, kinds):
    warnings = [f"warning {number}" for number in range(12)]
    for number, text in enumerate(warnings):
        assert said(alerts, kinds[number % len(kinds)], WARNING, text) == [text]
    got = sent(alerts, 0.0, 24.0)
    assert [text for _, text in got] == warnings
    assert [time_s for time_s, _ in got] == pytest.approx(
        [2.0 * number for number in range(12)], abs=0.11
    )


def test_a_change_of_mode_waits_for_no_warning_and_for_the_change_before_it(alerts):
    said(alerts, "command", WARNING, *(f"warning {number}" for number in range(5)))
    texts(alerts, 0.0, 0.5)
    alerts.show_mode("leader lost")
    assert alerts.due(0.5) == (NOTICE, "leader lost")
    # One that still waits is out of date with the next.
    alerts.show_mode("leader lost again")
    alerts.show_mode("leader is back")
    assert texts(alerts, 0.6, 2.5) == []
    assert alerts.due(2.5) == (NOTICE, "leader is back")
    assert "leader lost again" not in texts(alerts, 2.6, 20.0)


def test_what_is_worse_is_said_first_and_each_with_its_severity(alerts):
    said(alerts, "order", INFO, "all have agreed")
    alerts.show_mode("in its place")
    said(alerts, "separation", WARNING, "too near", "much too near")
    assert [alerts.due(now) for now in (0.0, 2.0, 4.0, 6.0)] == [
        (NOTICE, "in its place"),
        (WARNING, "too near"),
        (WARNING, "much too near"),
        (INFO, "all have agreed"),
    ]


def test_a_warning_finds_room_among_many_words_that_are_none_and_those_may_come_again(alerts):
    words = [f"word {number}" for number in range(MOST_WAITING)]
    said(alerts, "order", INFO, *words)
    said(alerts, "order", WARNING, "void")
    assert texts(alerts, 0.0, 40.0) == ["void", *words[:-1]]
    said(alerts, "order", INFO, words[-1], now=40.0)
    assert texts(alerts, 40.0, 41.0) == [words[-1]]


def test_a_warning_for_which_there_is_no_room_is_sent_when_it_comes_again(alerts):
    said(alerts, "order", WARNING, *(f"warning {number}" for number in range(MOST_WAITING)))
    said(alerts, "order", WARNING, "the last straw")
    assert "the last straw" not in texts(alerts, 0.0, 35.0)
    said(alerts, "order", WARNING, "the last straw", now=35.0)
    assert texts(alerts, 35.0, 36.0) == ["the last straw"]


def test_the_same_text_is_sent_once_in_half_a_minute_and_logged_each_time(alerts):
    for now in range(59):
        assert said(alerts, "fail-safe", WARNING, "take over", now=float(now)) == ["take over"]
        alerts.due(float(now))
    assert said(alerts, "fail-safe", WARNING, "take over", now=59.0) == ["take over"]
    assert texts(alerts, 59.0, 61.0) == []
    said(alerts, "fail-safe", WARNING, "take over", now=60.0)
    assert texts(alerts, 60.0, 62.0) == ["take over"]


def test_a_key_is_quiet_for_its_time_whatever_its_text_and_its_kind_is_not(alerts):
    logged: list[tuple[int, str]] = []
    for now in range(25):
        alerts.say("airspeed", WARNING, f"{now} m/s", quiet_s=10.0)
        alerts.say("airspeed: range", WARNING, f"range at {now} s")
        logged += [(now, one.text) for one in alerts.heard(float(now))]
    assert [now for now, text in logged if text.endswith("m/s")] == [0, 10, 20]
    assert len([now for now, text in logged if text.startswith("range")]) == 25


def test_what_is_said_once_in_a_flight_is_said_again_in_the_next(alerts):
    for _ in range(3):
        alerts.say("authority: a", WARNING, "select GUIDED", quiet_s=math.inf)
    assert len(alerts.heard(0.0)) == 1
    alerts.forget("authority")
    alerts.say("authority: a", WARNING, "select GUIDED", quiet_s=math.inf)
    assert len(alerts.heard(1.0)) == 1


def test_ever_new_keys_take_no_more_memory(alerts):
    for number in range(3 * MOST_KEYS):
        alerts.say(f"authority: mode {number}", WARNING, f"mode {number}", quiet_s=math.inf)
        alerts.heard(float(number))
    assert len(alerts._quiet_until) == MOST_KEYS  # noqa: SLF001
    # The newest are still quiet.
    alerts.say(f"authority: mode {number}", WARNING, "again", quiet_s=math.inf)
    assert alerts.heard(1e6) == []


def test_a_part_is_heard_only_while_it_is_played(alerts):
    played = True
    part = alerts.only_while(lambda: played)
    part.say("separation", WARNING, "keeping clear")
    played = False
    part.say("separation", WARNING, "unheard")
    assert [one.text for one in alerts.heard(0.0)] == ["keeping clear"]


def test_three_thousand_refused_orders_hide_nothing_else(alerts):
    announcer = Announcer("f1", alerts)
    member = Arrangements(plan_of(vehicle="f1"), SAME_CLOCK, alerts)
    stranger = {"stranger": Point(-20.0, 0.0, 0.0)}
    told: list[tuple[float, str]] = []
    for step in range(300):
        now = 10.0 + 0.1 * step
        for number in range(10):
            times = {"time_s": now + 8.0, "across_s": 5.0}
            order = order_of(*moves(stranger, stranger), number=10 * step + number + 1, **times)
            member.receive_order(encode_order(order), encode_order(order), now)
        if step == 150:
            alerts.say("clock", WARNING, "the clock has lost 3 s")
            alerts.say("separation: f2", WARNING, "too near to f2")
        alerts.heard(now)
        told += [(now, str(message.text)) for message in announcer.due(now)]
    assert member.counters == {}
    assert sum("is refused" in text for _, text in told) >= 10
    for warning in ("the clock has lost 3 s", "too near to f2"):
        (when,) = [now for now, text in told if warning in text]
        # Its turn comes with the second text from then on, at the latest.
        assert when <= 25.0 + 3.0 * PAUSE_S, warning


KINDS = ("order", "refused order", "state of f2", "clock")
SEVERITIES = st.sampled_from((WARNING, INFO))
ONE = st.tuples(st.floats(0.0, 3.0), st.sampled_from(KINDS), SEVERITIES, st.integers(0, 40))
RANDOM = settings(deadline=None, derandomize=True, database=None, max_examples=60)


def flown(alerts: Alerts, script: list[tuple[float, str, int, int]]) -> list[tuple[float, str]]:
    """What the pilot gets where things are said with such pauses, until nothing waits any more."""
    now, got = 0.0, list[tuple[float, str]]()
    for pause_s, kind, severity, number in script:
        got += sent(alerts, now, now + pause_s)
        now += pause_s
        alerts.say(kind, severity, f"{kind} {number} {severity}")
        alerts.heard(now)
    return got + sent(alerts, now, now + PAUSE_S * MOST_WAITING * len(KINDS) + PAUSE_S)


@RANDOM
@given(st.lists(ONE, max_size=60))
def test_whatever_is_said_nobody_is_flooded_and_nothing_comes_twice_in_a_short_while(script):
    got = flown(Alerts(), script)
    assert all(later - earlier > PAUSE_S - 1e-6 for (earlier, _), (later, _) in pairwise(got))
    for text in {text for _, text in got}:
        times = [now for now, one in got if one == text]
        # Each waits for its turn: the time of quiet counts from when it was said.
        assert len(times) <= 1 + sum(pause_s for pause_s, *_ in script) / QUIET_S


@RANDOM
@given(st.lists(ONE, max_size=60), st.integers(0, 60))
def test_a_warning_of_another_kind_is_never_hidden_and_waits_for_three_texts_at_most(script, place):
    alerts, now, began = Alerts(), 0.0, math.nan
    got: list[tuple[float, str]] = []
    for number, (pause_s, kind, severity, what) in enumerate([*script, (1.0, "order", INFO, 0)]):
        if number == min(place, len(script)):
            began = now
            alerts.say("separation", WARNING, "too near")
        alerts.say(kind, severity, f"{kind} {what} {severity}")
        alerts.heard(now)
        got += sent(alerts, now, now + pause_s)
        now += pause_s
    got += sent(alerts, now, now + 20.0)
    (when,) = [now for now, text in got if text == "too near"]
    assert when - began <= PAUSE_S * 2 + 0.2


@RANDOM
@given(st.lists(st.integers(0, 2000), max_size=8), st.sampled_from(KINDS))
def test_a_flood_between_two_looks_is_logged_by_its_first_and_others_whole(sizes, kind):
    alerts = Alerts()
    for step, size in enumerate(sizes):
        for number in range(size):
            alerts.say(kind, WARNING, f"{number}")
        alerts.say("separation", WARNING, "too near")
        logged = [one.text for one in alerts.heard(float(step))]
        assert logged == [*(str(number) for number in range(min(size, MOST_SAID))), "too near"]


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
    assert len(gaps) > 15
    assert gaps == pytest.approx([0.5] * len(gaps), abs=0.051)
    # A position that is not heard any more leaves a gap in the curve.
    flown.run(15.0, deaf=True)
    assert values(flown, "slot_along")[-1][0] <= 11.1


def test_in_its_slot_the_errors_are_small_and_the_mode_is_2():
    flown = new_flight(until_s=40.0)
    for name in ("slot_along", "slot_cross", "slot_up"):
        assert abs(values(flown, name)[-1][1]) < 1.0
    assert values(flown, "form_mode")[-1][1] == 2.0
    assert values(flown, "form_mode")[0][1] == 0.0


def test_without_a_leader_the_mode_is_sent_and_no_error():
    flown = new_flight(link=lambda _now: [], until_s=5.0)
    assert values(flown, "form_mode")
    assert values(flown, "slot_along") == []


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
    names = [f"response_ms_{name}" for name in ("p50", "p99", "last", "max")]
    assert latency_figures("response_ms", series) == pytest.approx(dict.fromkeys(names, 1.2))


def test_refused_messages_are_counted_in_all_and_by_reason():
    counters = Counter({"refused: not signed": 2, "refused: f1's clock": 3, "heard": 7})
    by_reason = {"refused_not_signed": 2.0, "refused_f1s_clock": 3.0}
    assert refused_messages(counters) == {"refused": 5.0, **by_reason}


def test_of_the_battery_is_told_what_the_autopilot_knows_and_no_more():
    assert figures_of_battery(None) == {}
    assert figures_of_battery(SensorsReport(gps=True, attitude=True)) == {}
    known = SensorsReport(gps=True, attitude=True, battery=0.87, battery_voltage=11.804)
    assert figures_of_battery(known) == {"battery_percent": 87.0, "battery_v": 11.8}
    volts = SensorsReport(gps=True, attitude=True, battery_voltage=11.8)
    assert figures_of_battery(volts) == {"battery_v": 11.8}
