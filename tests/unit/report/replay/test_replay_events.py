"""Events on the replay's time line: once for all to whom they happened, and what matters first."""

import math
from dataclasses import replace

import numpy as np

from tests.kit.records import still_flight, still_follower, still_leader
from vfguide.lab.report.replay import MOST_SHOWN, describe_events, flown_paths, shown_events
from vfguide.record.events import EventKind, FlightEvent


def said(
    time_s: float, vehicle: str, text: str, kind: EventKind = "order", *, warning: bool = False
) -> FlightEvent:
    return FlightEvent(time_s=time_s, vehicle=vehicle, kind=kind, text=text, warning=warning)


def test_what_several_say_at_once_is_one_event_of_all(circle_flight):
    leader, f1 = (one.name for one in circle_flight.vehicles[:2])
    events = (
        said(1.0, f1, "order 1 is understood"),
        said(1.5, leader, "order 1 is understood"),
        said(4.0, leader, "order 1 is understood"),
    )
    assert describe_events(replace(circle_flight, events=events)) == [
        {"t": 1.0, "kind": "order", "vehicles": [0, 1], "text": "order 1 is understood"},
        {"t": 4.0, "kind": "order", "vehicles": [0], "text": "order 1 is understood"},
    ]


def test_modes_are_among_the_series_and_warnings_have_a_mark(circle_flight):
    events = (
        said(1.0, "f1", "joining -> tracking", "mode"),
        said(2.0, "f1", "take over", "text", warning=True),
        said(3.0, "f1", "leads", "lead", warning=True),
    )
    shown = shown_events(replace(circle_flight, events=events))
    assert [(one.kind, one.text) for one in shown] == [("warning", "take over"), ("lead", "leads")]


def test_of_too_many_events_texts_make_way(circle_flight):
    texts = tuple(said(0.01 * n, "f1", f"text {n}", "text") for n in range(MOST_SHOWN))
    events = (*texts, said(20.0, "f1", "order 1 is flown"))
    shown = shown_events(replace(circle_flight, events=events))
    assert [one.text for one in shown] == ["order 1 is flown"]


def test_the_path_is_that_of_the_first_who_is_steered():
    time_s = np.arange(6.0)
    # The leader's companion is lost from 3 s on; its follower goes on along path 1, and holds from 5 s on.
    first = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    second = np.array([0.0, 1.0, 1.0, 1.0, 1.0, math.nan])
    leader = still_leader(time_s, path_number=first, mode=np.array([2, 2, 2, 0, 0, 0]))
    record = still_flight(time_s, leader, still_follower(time_s, path_number=second))
    assert flown_paths(record) == [[0.0, 0.0], [1.0, 1.0], [5.0, None]]


def test_a_flight_on_its_one_path_says_nothing_of_paths(circle_flight):
    assert flown_paths(circle_flight) == []
