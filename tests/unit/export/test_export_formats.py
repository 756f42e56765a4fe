"""Every format is read again by a program that is not ours; one file is written, whole, where it is told."""

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


def csv_of(record: FlightRecord, directory: Path) -> list[dict[str, str]]:
    write_csv(record, directory / "a.csv")
    with (directory / "a.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_csv_has_a_row_for_each_vehicle_at_each_sample(tmp_path):
    rows = csv_of(short_flight(), tmp_path)
    assert len(rows) == 42
    assert set(UNITS) < set(rows[0])
    last = [row for row in rows if row["vehicle"] == "f1"][-1]
    assert last["time_s"] == "2.000"
    assert last["time_utc"] == "2026-01-01T00:00:02.000Z"
    assert float(last["north_m"]) == pytest.approx(13.0)
    # The leader flies north: ahead is north, right is east.
    slot = [float(last[f"slot_{name}_m"]) for name in ("ahead", "right", "distance")]
    assert slot == pytest.approx([-3.0, 4.0, 5.0])
    assert last["mode"] == "tracking"
    # A degree of latitude is 111 km: 13 m are 0.000117°.
    assert float(last["latitude_deg"]) == pytest.approx(47.000117, abs=2e-6)
    assert rows[0]["slot_ahead_m"] == ""


@pytest.mark.parametrize("name", ['=HYPERLINK("x")', "+1", "@a", "-2"])
def test_names_are_no_formulas_for_a_spreadsheet(tmp_path, name):
    rows = csv_of(short_flight(name=name), tmp_path)
    assert {row["vehicle"] for row in rows} == {"lead", f"'{name}"}


def test_parquet_keeps_types_and_units(tmp_path):
    lost = with_vehicle(short_flight(), "f1", airspeed_m_s=np.full(21, math.nan))
    write_parquet(lost, tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.num_rows == 42
    unit = {b"unit": b"degrees, right wing down positive"}
    assert table.schema.field("bank_deg").metadata == unit
    last = table.to_pylist()[-1]
    assert (last["vehicle"], last["airspeed_m_s"]) == ("f1", None)
    assert last["slot_distance_m"] == pytest.approx(5.0)
    assert last["time_utc"] == datetime(2026, 1, 1, 0, 0, 2, tzinfo=UTC)


def test_kml_has_a_track_with_time_for_each_vehicle_and_kmz_is_the_same_packed(tmp_path):
    write_earth(short_flight(name="<b>&\x00"), tmp_path / "a.kml", compressed=False)
    text = (tmp_path / "a.kml").read_text(encoding="utf-8")
    assert "href" not in text
    root = ET.fromstring(text)  # noqa: S314
    names = [one.text for one in root.iter(f"{KML}name")]
    assert names == ["line", "path", "lead", "<b>& "]
    tracks = list(root.iter(f"{GX}Track"))
    # 10 samples a second, at most 5 of them shown.
    for tag in (f"{GX}coord", f"{KML}when"):
        assert [len(list(track.iter(tag))) for track in tracks] == [11, 11]
    first = [float(one) for one in str(next(tracks[0].iter(f"{GX}coord")).text).split()]
    assert first == pytest.approx([8.0, 47.0, 588.0]), "longitude first"
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
            if schema.name == "vfguide.VehicleState":
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                strict = json.loads(schema.data) | {"additionalProperties": False}
                jsonschema.validate(json.loads(message.data), strict)
            else:
                assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            counts[channel.topic] += 1
        assert reader.get_summary().statistics.message_count == counts.total()
    places = dict.fromkeys(("/lead/location", "/f1/location", "/scene/lead", "/scene/f1"), 11)
    states = dict.fromkeys(("/lead/state", "/f1/state"), 21)
    # Joining at first and tracking after a second, each of two vehicles.
    assert counts == {**states, **places, "/tf": 22, "/scene/path": 1, "/log": 4}


def test_neither_changes_of_mode_nor_pictures_depend_on_the_parts(tmp_path, monkeypatch):
    """Both change their mode at sample 10; pictures are of samples 0, 2, ... 20."""

    def times() -> list[list[int]]:
        said = [(one.topic, raw.log_time) for one, raw, _ in messages_of(short_flight(), tmp_path)]
        return [[at for topic, at in said if topic == name] for name in ("/log", "/scene/f1")]

    whole = times()
    for size in (5, 10):
        monkeypatch.setattr("vfguide.lab.export.columns.PART", size)
        assert times() == whole, size


@pytest.mark.parametrize("step_s", [0.1, 0.05, 0.04, 0.02])
def test_pictures_are_a_fifth_of_a_second_apart_whatever_the_rounding(step_s):
    for samples in (4, 58, 3001):
        time_s = step_s * np.arange(samples)
        record = still_flight(time_s, vehicle("lead", time_s))
        assert finest_stride(record) == round(0.2 / step_s), samples


def test_a_csv_tells_places_to_a_centimetre(tmp_path):
    """In longitudes beyond 100 degrees, too; 1e-7 degrees of longitude are 8 mm here."""
    last = csv_of(short_flight(origin=replace(ORIGIN, longitude_deg=171.0)), tmp_path)[-1]
    frame = LocalFrame(ORIGIN.latitude_deg, 171.0, ORIGIN.altitude_amsl_m)
    place = frame.to_local(float(last["latitude_deg"]), float(last["longitude_deg"]))
    assert place == pytest.approx((13.0, 6.0), abs=0.006)


def messages_of(record: FlightRecord, directory: Path, **wanted: list[str]) -> list[Any]:
    """(channel, message, what it says) of each message of a flight's MCAP."""
    write_mcap(record, directory / "a.mcap")
    with (directory / "a.mcap").open("rb") as file:
        return [
            (channel, raw, said(schema.name, channel.message_encoding, schema.data, raw.data))
            for schema, channel, raw in make_reader(file).iter_messages(**wanted)
        ]


def test_orders_and_warnings_are_lines_of_the_log(tmp_path):
    events = (
        FlightEvent(time_s=0.5, vehicle="f1", kind="order", text="order 1 is understood"),
        FlightEvent(time_s=1.0, vehicle="f1", kind="mode", text="joining -> tracking"),
        FlightEvent(time_s=1.5, vehicle="f1", kind="text", text="take over", warning=True),
    )
    record = replace(short_flight(begin_unix_s=1_790_000_000.0), events=events)
    messages = messages_of(record, tmp_path, topics=["/log"])
    told = [(raw.log_time, line.level, line.message) for _, raw, line in messages]
    assert (1_790_000_000_500_000_000, 2, "f1: order 1 is understood") in told
    assert (1_790_000_001_500_000_000, 3, "f1: take over") in told
    assert not any("->" in text for _, _, text in told)


def test_the_mcap_says_where_and_when(tmp_path):
    record = short_flight(begin_unix_s=1_790_000_000.5)
    _, last, fix = messages_of(record, tmp_path, topics=["/f1/location"])[-1]
    assert last.log_time == fix.timestamp.ToNanoseconds() == 1_790_000_002_500_000_000
    assert (fix.latitude, fix.altitude) == pytest.approx((47.000117, 588.0), abs=2e-6)


def test_what_is_not_known_is_in_no_message(tmp_path):
    unknown = np.full(21, math.nan)
    lost = with_vehicle(short_flight(), "f1", north_m=unknown, heading_rad=unknown)
    topics = {channel.topic for channel, *_ in messages_of(lost, tmp_path)}
    assert "/f1/state" in topics
    assert not {"/f1/location", "/scene/f1"} & topics


def turned(vector: tuple[float, ...], quaternion: tuple[float, float, float, float]) -> np.ndarray:
    """A vector turned by a unit quaternion (x, y, z, w): v + 2 u x (u x v + w v)."""
    axis, w, v = np.array(quaternion[:3]), quaternion[3], np.array(vector)
    return v + 2.0 * np.cross(axis, np.cross(axis, v) + w * v)


@pytest.mark.parametrize(
    ("nose", "heading", "bank", "points"),
    [
        *(((1, 0, 0), 0.0, 0.0, (0, 1, 0)), ((1, 0, 0), 90.0, 0.0, (1, 0, 0))),
        ((1, 0, 0), 225.0, 0.0, (-math.sqrt(0.5), -math.sqrt(0.5), 0)),
        # A bank lowers the right wing: heading north, right is east; y of a body is its left.
        ((0, -1, 0), 0.0, 30.0, (math.cos(math.radians(30.0)), 0, -0.5)),
    ],
)
def test_the_nose_points_along_the_heading_and_a_bank_lowers_the_right_wing(
    nose, heading, bank, points
):
    assert turned(nose, attitude(heading, bank)) == pytest.approx(points, abs=1e-9)


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


@pytest.mark.parametrize(
    ("out", "words"),
    [("flight.xlsx", "the ending is the format"), ("absent/a.csv", "no such directory")],
)
def test_a_place_or_ending_that_there_is_not_is_refused(flown, tmp_path, out, words):
    with pytest.raises(InputError, match=words):
        export([flown], out=tmp_path / out)


def test_a_file_that_is_there_stays_without_force_and_no_link_is_written_through(flown, tmp_path):
    out, link = tmp_path / "a.csv", tmp_path / "b.csv"
    out.write_text("mine", encoding="utf-8")
    link.symlink_to(out)
    for place, force, words in ((out, False, "--force"), (link, True, "symbolic link")):
        with pytest.raises(InputError, match=words):
            export([flown], out=place, force=force)
        assert out.read_text(encoding="utf-8") == "mine"
    export([flown], out=out, force=True)
    assert out.read_text(encoding="utf-8").startswith("time_s,")


def test_an_export_that_fails_leaves_nothing(tmp_path, flown):
    short_flight(begin_unix_s=-5.0).save(flown / "flight.npz")
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(InputError, match="damaged"):
        export([flown], out=out / "a.mcap")
    assert list(out.iterdir()) == []


def test_a_mission_says_where_an_old_record_was_flown_and_that_of_another_is_refused(
    tmp_path, flown
):
    out, mission = tmp_path / "a.csv", MISSIONS / "line-calm.yaml"
    short_flight(origin=None).save(flown / "flight.npz")
    with pytest.raises(InputError, match="not 'line-calm'"):
        export([flown], out=out, mission=mission)
    short_flight(origin=None, mission="line-calm").save(flown / "flight.npz")
    export([flown], out=out, mission=mission)
    latitude = out.read_text(encoding="utf-8").splitlines()[1].split(",")[3]
    assert float(latitude) == pytest.approx(shipped("line-calm").origin.latitude_deg)


@pytest.mark.parametrize("latitude", [91.0, -1e300])
def test_place_and_time_are_kept_in_the_record_and_nowhere_on_the_earth_is_damage(
    tmp_path, latitude
):
    path = tmp_path / "flight.npz"
    flight = short_flight(begin_unix_s=1.79e9, origin=replace(ORIGIN))
    flight.save(path)
    record = FlightRecord.load(path)
    assert (record.begin_unix_s, record.origin) == (1.79e9, ORIGIN)
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


def place_of(point: dict[str, float]) -> tuple[float, float]:
    return FRAME.to_local(point["latitude_deg"], point["longitude_deg"])


def test_a_straight_flight_is_a_route_of_its_two_ends(tmp_path):
    """40 m north of the origin, 588 m above sea level; the plan has altitudes above the home's 488 m."""
    write_plan(short_flight(), tmp_path / "a.plan")
    first, last = read_plan(tmp_path / "a.plan")["waypoints"]
    assert place_of(last) == pytest.approx((40.0, 0.0), abs=0.01)
    assert (first["latitude_deg"], first["longitude_deg"]) == pytest.approx((47.0, 8.0), abs=1e-7)
    assert [one["altitude_amsl_m"] for one in (first, last)] == [588.0, 588.0]


def test_a_climbing_turn_is_followed_to_within_a_metre(tmp_path):
    angle = np.linspace(0.0, 2.0 * math.pi, 21)
    track = np.column_stack([10.0 * np.sin(angle), 10.0 * np.cos(angle), 588.0 + 5.0 * angle])
    write_plan(with_track(short_flight(), track), tmp_path / "a.plan")
    waypoints = read_plan(tmp_path / "a.plan")["waypoints"]
    route = np.array([(*place_of(one), one["altitude_amsl_m"]) for one in waypoints])
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
    assert place_of(point) == pytest.approx((100.0, -50.0), abs=0.01)


def test_a_leader_of_whom_nothing_was_recorded_is_one_line(tmp_path):
    record = with_track(short_flight(), np.full((21, 3), math.nan))
    with pytest.raises(InputError, match="there is nothing to plan; give another flight"):
        write_plan(record, tmp_path / "a.plan")
