"""Every format is read again by a program that is not ours, and says what was flown.

`vfguide export` writes one file, whole, where it is told, and nothing else.

A flight as a plan of QGroundControl, read back as a mission reads one.
"""

import csv
import json
import math
import zipfile
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from pyarrow import parquet

from tests.kit.foxglove import said
from tests.kit.missions import MISSIONS, shipped
from tests.kit.records import still_flight, with_vehicle
from tests.kit.short_flights import ORIGIN, short_flight, vehicle
from vfguide.commands.export import ENDINGS, export
from vfguide.errors import InputError
from vfguide.frames import LocalFrame
from vfguide.lab.export.columns import (
    UNITS,
    begin_of,
    finest_stride,
    geodetic,
    write_csv,
    write_parquet,
)
from vfguide.lab.export.earth import MOST_WAYPOINTS, chosen, distances, write_earth, write_plan
from vfguide.lab.export.foxglove import attitude, write_mcap
from vfguide.mission.plan_file import read_plan
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord, Outline

KML = "{http://www.opengis.net/kml/2.2}"
GX = "{http://www.google.com/kml/ext/2.2}"


def test_places_on_the_earth_are_those_of_the_companions_frame():
    frame = LocalFrame(47.0, 8.0, 488.0)
    latitude, longitude = geodetic(ORIGIN, np.array([3000.0]), np.array([-2000.0]))
    assert frame.to_local(latitude[0], longitude[0]) == pytest.approx((3000.0, -2000.0), abs=1e-3)


def test_a_csv_has_a_row_for_each_vehicle_at_each_sample(tmp_path):
    write_csv(short_flight(), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 42
    assert set(UNITS) < set(rows[0])
    last = [row for row in rows if row["vehicle"] == "f1"][-1]
    assert last["time_s"] == "2.000"
    assert last["time_utc"] == "2026-01-01T00:00:02.000Z"
    assert float(last["north_m"]) == pytest.approx(13.0)
    # The leader flies north: ahead is north, right is east.
    assert float(last["slot_ahead_m"]) == pytest.approx(-3.0)
    assert float(last["slot_right_m"]) == pytest.approx(4.0)
    assert float(last["slot_distance_m"]) == pytest.approx(5.0)
    assert last["mode"] == "tracking"
    # A degree of latitude is 111 km: 13 m are 0.000117°.
    assert float(last["latitude_deg"]) == pytest.approx(47.000117, abs=2e-6)
    assert rows[0]["slot_ahead_m"] == ""


@pytest.mark.parametrize("name", ['=HYPERLINK("x")', "+1", "@a", "-2"])
def test_names_are_no_formulas_for_a_spreadsheet(tmp_path, name):
    write_csv(short_flight(name=name), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        assert {row["vehicle"] for row in csv.DictReader(file)} == {"lead", f"'{name}"}


def test_parquet_keeps_types_and_units(tmp_path):
    lost = with_vehicle(short_flight(), "f1", airspeed_m_s=np.full(21, math.nan))
    write_parquet(lost, tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.num_rows == 42
    unit = {b"unit": b"degrees, right wing down positive"}
    assert table.schema.field("bank_deg").metadata == unit
    rows = table.to_pylist()
    assert rows[-1]["vehicle"] == "f1"
    assert rows[-1]["slot_distance_m"] == pytest.approx(5.0)
    assert rows[-1]["airspeed_m_s"] is None
    assert rows[-1]["time_utc"] == datetime(2026, 1, 1, 0, 0, 2, tzinfo=UTC)


def test_kml_has_a_track_with_time_for_each_vehicle(tmp_path):
    write_earth(short_flight(name="<b>&\x00"), tmp_path / "a.kml", compressed=False)
    root = ET.parse(tmp_path / "a.kml").getroot()  # noqa: S314
    names = [one.text for one in root.iter(f"{KML}name")]
    assert names == ["line", "path", "lead", "<b>& "]
    tracks = list(root.iter(f"{GX}Track"))
    # 10 samples a second, at most 5 of them shown.
    assert [len(list(track.iter(f"{GX}coord"))) for track in tracks] == [11, 11]
    assert [len(list(track.iter(f"{KML}when"))) for track in tracks] == [11, 11]
    first = [float(one) for one in str(next(tracks[0].iter(f"{GX}coord")).text).split()]
    assert first == pytest.approx([8.0, 47.0, 588.0]), "longitude first"
    assert "href" not in (tmp_path / "a.kml").read_text(encoding="utf-8")


def test_kmz_is_the_same_packed(tmp_path):
    write_earth(short_flight(), tmp_path / "a.kmz", compressed=True)
    with zipfile.ZipFile(tmp_path / "a.kmz") as archive:
        assert archive.namelist() == ["doc.kml"]
        ET.fromstring(archive.read("doc.kml"))  # noqa: S314


def test_every_message_of_the_mcap_is_what_its_schema_says(tmp_path):
    write_mcap(short_flight(), tmp_path / "a.mcap")
    counts: Counter[str] = Counter()
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            if schema.name == "vfguide.VehicleState":
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                strict = json.loads(schema.data) | {"additionalProperties": False}
                jsonschema.validate(json.loads(message.data), strict)
            else:
                assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            counts[channel.topic] += 1
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == counts.total()
    assert counts == {
        "/lead/state": 21,
        "/f1/state": 21,
        "/lead/location": 11,
        "/f1/location": 11,
        "/tf": 22,
        "/scene/lead": 11,
        "/scene/f1": 11,
        "/scene/path": 1,
        # Joining at first and tracking after a second, each of two vehicles.
        "/log": 4,
    }


def test_neither_changes_of_mode_nor_pictures_depend_on_the_parts(tmp_path, monkeypatch):
    """Both change their mode at sample 10; pictures are of samples 0, 2, ... 20."""
    whole = messages_of(short_flight(), tmp_path)
    for size in (5, 10):
        monkeypatch.setattr("vfguide.lab.export.columns.PART", size)
        in_parts = messages_of(short_flight(), tmp_path)
        for topic in ("/log", "/scene/f1"):
            times = [
                [raw.log_time for _, channel, raw, _ in found if channel.topic == topic]
                for found in (whole, in_parts)
            ]
            assert times[0] == times[1], (size, topic)


@pytest.mark.parametrize("step_s", [0.1, 0.05, 0.04, 0.02])
def test_pictures_are_a_fifth_of_a_second_apart_whatever_the_rounding(step_s):
    for samples in (4, 58, 3001):
        time_s = step_s * np.arange(samples)
        record = still_flight(time_s, vehicle("lead", time_s))
        assert finest_stride(record) == round(0.2 / step_s), samples


def test_a_csv_tells_places_to_a_centimetre(tmp_path):
    """In longitudes beyond 100 degrees, too; 1e-7 degrees of longitude are 8 mm here."""
    origin = replace(ORIGIN, longitude_deg=171.0)
    write_csv(short_flight(origin=origin), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    frame = LocalFrame(ORIGIN.latitude_deg, 171.0, ORIGIN.altitude_amsl_m)
    place = frame.to_local(float(last["latitude_deg"]), float(last["longitude_deg"]))
    assert place == pytest.approx((13.0, 6.0), abs=0.006)


def messages_of(record: FlightRecord, directory: Path, **wanted: list[str]) -> list[Any]:
    """(schema, channel, message, what it says) of each message of a flight's MCAP."""
    write_mcap(record, directory / "a.mcap")
    with (directory / "a.mcap").open("rb") as file:
        return [
            (
                schema,
                channel,
                raw,
                said(schema.name, channel.message_encoding, schema.data, raw.data),
            )
            for schema, channel, raw in make_reader(file).iter_messages(**wanted)
            if schema is not None
        ]


def test_orders_and_warnings_are_lines_of_the_log(tmp_path):
    events = (
        FlightEvent(time_s=0.5, vehicle="f1", kind="order", text="order 1 is understood"),
        FlightEvent(time_s=1.0, vehicle="f1", kind="mode", text="joining -> tracking"),
        FlightEvent(time_s=1.5, vehicle="f1", kind="text", text="take over", warning=True),
    )
    record = replace(short_flight(begin_unix_s=1_790_000_000.0), events=events)
    messages = messages_of(record, tmp_path, topics=["/log"])
    told = [(raw.log_time, line.level, line.message) for _, _, raw, line in messages]
    assert (1_790_000_000_500_000_000, 2, "f1: order 1 is understood") in told
    assert (1_790_000_001_500_000_000, 3, "f1: take over") in told
    assert not any("->" in text for _, _, text in told)


def test_the_mcap_says_where_and_when(tmp_path):
    record = short_flight(begin_unix_s=1_790_000_000.5)
    _, _, last, fix = messages_of(record, tmp_path, topics=["/f1/location"])[-1]
    assert last.log_time == fix.timestamp.ToNanoseconds() == 1_790_000_002_500_000_000
    assert (fix.latitude, fix.altitude) == pytest.approx((47.000117, 588.0), abs=2e-6)


def test_what_is_not_known_is_in_no_message(tmp_path):
    unknown = np.full(21, math.nan)
    lost = with_vehicle(short_flight(), "f1", north_m=unknown, heading_rad=unknown)
    topics = {channel.topic for _, channel, *_ in messages_of(lost, tmp_path)}
    assert "/f1/state" in topics
    assert not {"/f1/location", "/scene/f1"} & topics


@pytest.mark.parametrize(
    ("heading", "ahead"),
    [(0.0, (0.0, 1.0, 0.0)), (90.0, (1.0, 0.0, 0.0)), (225.0, (-0.7071, -0.7071, 0.0))],
)
def test_the_nose_points_along_the_heading(heading, ahead):
    assert turned((1.0, 0.0, 0.0), attitude(heading, 0.0)) == pytest.approx(ahead, abs=1e-4)


def test_a_bank_lowers_the_right_wing():
    """Heading north, right is east; y of a body is its left."""
    east, north, up = turned((0.0, -1.0, 0.0), attitude(0.0, 30.0))
    assert (east, north, up) == pytest.approx((math.cos(math.radians(30.0)), 0.0, -0.5), abs=1e-9)


def turned(
    vector: tuple[float, float, float], quaternion: tuple[float, float, float, float]
) -> tuple[float, ...]:
    """A vector turned by a unit quaternion (x, y, z, w): v + 2 u x (u x v + w v)."""
    axis, w, v = np.array(quaternion[:3]), quaternion[3], np.array(vector)
    return tuple((v + 2.0 * np.cross(axis, np.cross(axis, v) + w * v)).tolist())


@pytest.mark.parametrize("begin", [-1.0, math.nan, math.inf, 1e30])
def test_a_record_of_no_possible_time_is_refused(begin):
    with pytest.raises(InputError, match="damaged"):
        begin_of(short_flight(begin_unix_s=begin))


def test_a_record_without_a_place_says_what_to_do(tmp_path):
    with pytest.raises(InputError, match="--mission"):
        write_csv(short_flight(origin=None), tmp_path / "a.csv")


@pytest.fixture
def flown(tmp_path: Path) -> Path:
    """The directory of a flight."""
    directory = tmp_path / "flown"
    directory.mkdir()
    short_flight().save(directory / "flight.npz")
    return directory


@pytest.mark.parametrize("ending", ENDINGS)
def test_each_ending_is_a_format(flown, tmp_path, ending):
    out = tmp_path / "out"
    out.mkdir()
    export([flown], out=out / f"flight{ending}")
    assert [one.name for one in out.iterdir()] == [f"flight{ending}"]
    assert [one.name for one in flown.iterdir()] == ["flight.npz"]


def test_another_ending_is_refused(flown, tmp_path):
    with pytest.raises(InputError, match="the ending is the format"):
        export([flown], out=tmp_path / "flight.xlsx")


def test_a_file_that_is_there_stays_without_force(flown, tmp_path):
    out = tmp_path / "a.csv"
    out.write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="--force"):
        export([flown], out=out)
    assert out.read_text(encoding="utf-8") == "mine"
    export([flown], out=out, force=True)
    assert out.read_text(encoding="utf-8").startswith("time_s,")


def test_no_link_is_written_through(flown, tmp_path):
    elsewhere = tmp_path / "elsewhere.csv"
    elsewhere.write_text("mine", encoding="utf-8")
    (tmp_path / "a.csv").symlink_to(elsewhere)
    with pytest.raises(InputError, match="symbolic link"):
        export([flown], out=tmp_path / "a.csv", force=True)
    assert elsewhere.read_text(encoding="utf-8") == "mine"


def test_an_export_that_fails_leaves_nothing(tmp_path, flown):
    short_flight(begin_unix_s=-5.0).save(flown / "flight.npz")
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(InputError, match="damaged"):
        export([flown], out=out / "a.mcap")
    assert list(out.iterdir()) == []


def test_a_directory_that_is_not_there_is_one_line(flown, tmp_path):
    with pytest.raises(InputError, match="no such directory"):
        export([flown], out=tmp_path / "absent" / "a.csv")


def test_a_mission_says_where_an_old_record_was_flown(tmp_path, flown):
    short_flight(origin=None, mission="line-calm").save(flown / "flight.npz")
    mission = shipped("line-calm")
    export([flown], out=tmp_path / "a.csv", mission=MISSIONS / "line-calm.yaml")
    latitude = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[1].split(",")[3]
    assert float(latitude) == pytest.approx(mission.origin.latitude_deg)


def test_the_mission_of_another_flight_is_refused(tmp_path, flown):
    short_flight(origin=None).save(flown / "flight.npz")
    with pytest.raises(InputError, match="not 'line-calm'"):
        export([flown], out=tmp_path / "a.csv", mission=MISSIONS / "line-calm.yaml")


def test_place_and_time_are_kept_in_the_record(tmp_path):
    short_flight(begin_unix_s=1.79e9).save(tmp_path / "flight.npz")
    record = FlightRecord.load(tmp_path / "flight.npz")
    assert record.begin_unix_s == 1.79e9
    assert record.origin == ORIGIN


@pytest.mark.parametrize("latitude", [91.0, -1e300])
def test_a_record_of_nowhere_on_the_earth_is_damaged(tmp_path, latitude):
    path = tmp_path / "flight.npz"
    flight = short_flight(origin=replace(ORIGIN))
    # No record can be made with such an origin; a damaged file has one.
    object.__setattr__(flight.origin, "latitude_deg", latitude)
    flight.save(path)
    with pytest.raises(InputError, match="nowhere on the earth"):
        FlightRecord.load(path)


FRAME = LocalFrame(47.0, 8.0, 488.0)


def with_track(record: FlightRecord, track: np.ndarray) -> FlightRecord:
    """The same with another track of the leader: north, east and altitude of each sample, m."""
    north, east, altitude = track.T
    return with_vehicle(record, "lead", north_m=north, east_m=east, altitude_amsl_m=altitude)


def test_a_straight_flight_is_a_route_of_its_two_ends(tmp_path):
    """40 m north of the origin, 588 m above sea level; the plan has altitudes above the home's 488 m."""
    write_plan(short_flight(), tmp_path / "a.plan")
    found = read_plan(tmp_path / "a.plan")
    first, last = found["waypoints"]
    north, east = FRAME.to_local(last["latitude_deg"], last["longitude_deg"])
    assert (north, east) == pytest.approx((40.0, 0.0), abs=0.01)
    assert (first["latitude_deg"], first["longitude_deg"]) == pytest.approx((47.0, 8.0), abs=1e-7)
    assert [one["altitude_amsl_m"] for one in (first, last)] == [588.0, 588.0]


def test_a_climbing_turn_is_followed_to_within_a_metre(tmp_path):
    angle = np.linspace(0.0, 2.0 * math.pi, 21)
    track = np.column_stack([10.0 * np.sin(angle), 10.0 * np.cos(angle), 588.0 + 5.0 * angle])
    write_plan(with_track(short_flight(), track), tmp_path / "a.plan")
    route = np.array(
        [
            (*FRAME.to_local(one["latitude_deg"], one["longitude_deg"]), one["altitude_amsl_m"])
            for one in read_plan(tmp_path / "a.plan")["waypoints"]
        ]
    )
    away = np.min([distances(track, *ends) for ends in pairwise(route)], 0)
    assert away.max() < 1.05
    assert len(route) < len(track)


def test_a_long_flight_has_as_many_waypoints_as_an_autopilot_keeps():
    angle = np.linspace(0.0, 600.0, 20_000)
    track = np.column_stack([300.0 * np.sin(angle), 200.0 * np.cos(0.7 * angle), 0.0 * angle])
    kept = chosen(track)
    assert 2 < np.count_nonzero(kept) <= MOST_WAYPOINTS
    assert kept[0]
    assert kept[-1]


def test_rally_points_are_in_the_plan(tmp_path):
    rally = Outline(kind="rally", north_m=np.array([100.0]), east_m=np.array([-50.0]))
    write_plan(short_flight(outlines=(rally,)), tmp_path / "a.plan")
    (point,) = read_plan(tmp_path / "a.plan")["rally_points"]
    found = FRAME.to_local(point["latitude_deg"], point["longitude_deg"])
    assert found == pytest.approx((100.0, -50.0), abs=0.01)


def test_a_leader_of_whom_nothing_was_recorded_is_one_line(tmp_path):
    record = with_track(short_flight(), np.full((21, 3), math.nan))
    with pytest.raises(InputError, match="there is nothing to plan; give another flight"):
        write_plan(record, tmp_path / "a.plan")
