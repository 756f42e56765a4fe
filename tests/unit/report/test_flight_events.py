"""What companions said: kept line by line, read as far as it is whole, and found again in a flight record."""

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.records import with_vehicle
from vfguide.errors import InputError
from vfguide.record.archive import read_archive, write_archive
from vfguide.record.events import (
    EVENTS,
    MOST_EVENTS,
    FlightEvent,
    encode_event,
    merged_events,
    read_events,
)
from vfguide.record.flight import FlightRecord
from vfguide.record.log import plain


def event(time_s: float, text: str, **fields: object) -> FlightEvent:
    usual = FlightEvent(time_s=time_s, vehicle="f1", kind="order", text=text)
    return msgspec.structs.replace(usual, **fields)  # type: ignore[arg-type]


def test_an_event_is_read_as_it_was_written_on_the_flights_time(tmp_path):
    said = event(112.5, 'order 1 is refused: "f2, f3" say no', warning=True)
    path = tmp_path / "f1.events.csv"
    path.write_bytes(EVENTS.header + encode_event(said, math.nan))
    assert read_events("f1", path, zero_s=100.0) == [msgspec.structs.replace(said, time_s=12.5)]


def test_a_text_of_several_lines_is_one():
    line = encode_event(event(1.0, "fails\r\n  again"), 1.0)
    assert line == b"1.000000,1.000000,order,0,fails again\n"


@pytest.mark.parametrize(
    "rest",
    [
        b"2.0,2.0,order,0,cut o",
        b"2.0,2.0,no kind,0,text\n",
        b"nan,nan,order,0,x\n",
        b"2.0,2.0,order,0\n",
        b"\xff\n",
    ],
)
def test_what_a_killed_companion_leaves_is_read_up_to_there(tmp_path, rest):
    path = tmp_path / "f1.events.csv"
    path.write_bytes(EVENTS.header + encode_event(event(1.0, "whole"), 1.0) + rest)
    assert [one.text for one in read_events("f1", path, tmp_path / "missing")] == ["whole"]


def test_a_damaged_line_loses_itself_alone(tmp_path):
    path = tmp_path / "f1.events.csv"
    lines = [encode_event(event(at_s, "whole"), at_s) for at_s in (1.0, 3.0)]
    path.write_bytes(EVENTS.header + lines[0] + b"2.0,2.0,order,0\n" + lines[1])
    assert [one.time_s for one in read_events("f1", path)] == [1.0, 3.0]


@given(st.binary(max_size=300))
def test_whatever_lies_in_a_file_reading_it_ends(data):
    with TemporaryDirectory() as place:
        path = Path(place) / "f1.events.csv"
        path.write_bytes(EVENTS.header + data)
        assert all(math.isfinite(one.time_s) for one in read_events("f1", path))


def test_of_too_many_events_warnings_and_orders_are_kept():
    chat = [event(float(n), "chat", kind="text") for n in range(MOST_EVENTS)]
    last = [event(1e5, "an order"), event(2e5, "a warning", kind="text", warning=True)]
    assert list(merged_events([*chat, *last]))[-2:] == last


def test_a_text_keeps_what_can_be_printed_alone():
    assert plain("a\x1b[31m \ud800b\u202ec") == "a[31m bc"


def test_events_of_all_vehicles_are_in_the_order_of_their_times():
    later, earlier = event(2.0, "later"), event(1.0, "earlier", vehicle="f2")
    assert merged_events([later, earlier]) == (earlier, later)


def test_a_record_keeps_events_and_the_path_that_was_flown(circle_flight, tmp_path):
    said = (event(3.0, "order 1 is void: f2 does not answer", warning=True),)
    number = np.where(circle_flight.time_s < 5.0, 0.0, math.nan)
    flown = with_vehicle(circle_flight, "leader", path_number=number)
    replace(flown, events=said).save(tmp_path / "flight.npz")
    read = FlightRecord.load(tmp_path / "flight.npz")
    assert read.events == said
    np.testing.assert_array_equal(read.leader.path_number, number)
    assert read.followers[0].path_number is None


def test_a_record_of_before_has_no_events(circle_flight, tmp_path):
    path = tmp_path / "flight.npz"
    circle_flight.save(path)
    description, arrays = read_archive(path)
    del description["events"]
    write_archive(path, description, arrays)
    assert FlightRecord.load(path).events == ()


SAID = {"time_s": 1.0, "vehicle": "f1", "kind": "order", "text": "x", "warning": False}


@pytest.mark.parametrize(
    "entries", [{}, [{}], [5], *([SAID | {"time_s": wrong}] for wrong in ("x", -1.0, 1e300))]
)
def test_damaged_events_are_one_line(circle_flight, tmp_path, entries):
    path = tmp_path / "flight.npz"
    circle_flight.save(path)
    description, arrays = read_archive(path)
    write_archive(path, {**description, "events": entries}, arrays)
    with pytest.raises(InputError, match=r"damaged flight record"):
        FlightRecord.load(path)
