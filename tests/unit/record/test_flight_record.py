"""A record comes back from its file as it was, and a bad file gives one line."""

import contextlib
import json
import math
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from vfguide.errors import InputError
from vfguide.record.archive import write_archive
from vfguide.record.flight import FlightRecord, RecordAcceptance, VehicleRecord
from vfguide.record.latency import Latency, Percentiles, Promptness, Usage
from vfguide.record.outline import Outline, compose_outlines
from vfguide.record.vehicle import SERIES

numbers = st.floats(allow_nan=True, allow_infinity=True)
figures = st.floats(allow_nan=False, allow_infinity=False)
limits = st.none() | figures
names = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)


def some_vehicle(name: str, role: str, samples: int, value: float) -> VehicleRecord:
    return VehicleRecord(
        name=name,
        role=role,
        system_id=7,
        slot_forward_m=-20.0,
        slot_right_m=20.0,
        mode=np.arange(samples, dtype=np.int64) % 3,
        limited=np.arange(samples) % 2 == 0,
        **{series: np.full(samples, value) + number for number, series in enumerate(SERIES)},
    )


def some_flight(samples: int = 3, value: float = 0.5, mission: str = "circle") -> FlightRecord:
    return FlightRecord(
        time_s=np.arange(float(samples)),
        vehicles=(
            some_vehicle("leader", "leader", samples, value),
            some_vehicle("f1", "follower", samples, -value),
        ),
        mode_names=("waiting", "tracking"),
        path_north_m=np.array([0.0, 1.0]),
        path_east_m=np.array([2.0, 3.0]),
        mission=mission,
        controller="slot",
        plant="heading-hold",
        wind="article",
        mode="lockstep",
        rate_hz=20.0,
        seed=4,
        duration_s=300.0,
        wall_s=4.1,
        acceptance=RecordAcceptance(mean_error_m=0.3, settle_10m_s=60.0, min_separation_m=5.0),
    )


acceptances = st.builds(
    RecordAcceptance, mean_error_m=limits, settle_1m_s=limits, min_separation_m=figures
)
records = st.builds(
    lambda flight, acceptance, seed: replace(flight, acceptance=acceptance, seed=seed),
    st.builds(some_flight, st.integers(0, 5), numbers, names),
    acceptances,
    st.integers(0, 2**32),
)


@given(record=records)
@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_a_record_comes_back_as_it_was(tmp_path, record):
    record.save(tmp_path / "flight.npz")

    loaded = FlightRecord.load(tmp_path / "flight.npz")

    assert (loaded.mission, loaded.seed, loaded.acceptance) == (
        record.mission,
        record.seed,
        record.acceptance,
    )
    assert (loaded.mode_names, loaded.mode, loaded.rate_hz) == (
        ("waiting", "tracking"),
        "lockstep",
        20.0,
    )
    assert np.array_equal(loaded.time_s, record.time_s)
    assert np.array_equal(loaded.path_east_m, record.path_east_m)
    for before, after in zip(record.vehicles, loaded.vehicles, strict=True):
        assert (before.name, before.role, before.slot_right_m) == (
            after.name,
            after.role,
            after.slot_right_m,
        )
        for series in SERIES:
            assert np.array_equal(getattr(before, series), getattr(after, series), equal_nan=True)
        assert np.array_equal(before.mode, after.mode)
        assert np.array_equal(before.limited, after.limited)


def test_the_same_record_gives_the_same_bytes(tmp_path):
    some_flight().save(tmp_path / "first.npz")
    some_flight().save(tmp_path / "second.npz")
    assert (tmp_path / "first.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()


def test_how_long_a_flight_took_makes_no_difference_to_its_file(tmp_path):
    flight = some_flight()
    flight.save(tmp_path / "first.npz")
    replace(flight, wall_s=99.0).save(tmp_path / "second.npz")
    assert (tmp_path / "first.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()
    assert FlightRecord.load(tmp_path / "first.npz").wall_s is None


def test_latencies_and_the_fact_that_a_flight_was_stopped_come_back(tmp_path):
    quick = Percentiles(p50=0.3, p99=2.0, max=9.0)
    latency = Latency(
        vehicles={
            "leader": Promptness(response_ms=quick, leader_age_ms=None),
            "f1": Promptness(response_ms=quick, leader_age_ms=Percentiles(p50=50, p99=60, max=70)),
        },
        processes={"companion of f1": Usage(cpu_share=0.03, rss_mb=70.5)},
    )
    flight = replace(some_flight(), interrupted=True, latency=latency)
    flight.save(tmp_path / "flight.npz")
    loaded = FlightRecord.load(tmp_path / "flight.npz")
    assert (loaded.interrupted, loaded.latency) == (True, latency)


def test_saving_leaves_no_other_file_behind(tmp_path):
    some_flight().save(tmp_path / "flight.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["flight.npz"]


def complaint(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        FlightRecord.load(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    return text


def test_a_missing_file_is_named(tmp_path):
    assert "No such file" in complaint(tmp_path / "absent.npz")


def test_a_directory_is_no_record(tmp_path):
    assert "directory" in complaint(tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"hello", b"PK\x03\x04", b"\x93NUMPY\x01\x00", b"\x80\x04K\x01."]
)
def test_other_bytes_are_no_record(tmp_path, content):
    path = tmp_path / "flight.npz"
    path.write_bytes(content)
    assert "no flight record" in complaint(path)


def test_a_single_array_is_no_record(tmp_path):
    np.save(tmp_path / "one.npy", np.zeros(3))
    assert "single NumPy array" in complaint(tmp_path / "one.npy")


def test_an_archive_of_something_else_is_no_record(tmp_path):
    np.savez(tmp_path / "other.npz", weights=np.zeros(3))
    assert "no description" in complaint(tmp_path / "other.npz")


def test_pickled_objects_are_never_loaded(tmp_path):
    np.savez(tmp_path / "pickle.npz", description=np.array([{"a": 1}], dtype=object))
    assert "no flight record" in complaint(tmp_path / "pickle.npz")


def test_a_newer_version_is_refused(tmp_path):
    write_archive(tmp_path / "new.npz", {"format": "vfguide-flight-record", "version": 99}, {})
    assert "version 99" in complaint(tmp_path / "new.npz")


@pytest.mark.parametrize(
    "damage",
    [
        {"vehicles": []},
        {"vehicles": 3},
        {"acceptance": None},
        {"acceptance": {"mean_error_m": "x"}},
        {"mode": "asleep"},
        {"rate_hz": "fast"},
        {"seed": None},
        {"seed": 1e999},
    ],
)
def test_a_damaged_description_is_told_in_one_line(tmp_path, damage):
    path = tmp_path / "flight.npz"
    some_flight().save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    description = {**json.loads(str(arrays.pop("description"))), **damage}
    np.savez(path, description=np.array(json.dumps(description)), **arrays)
    assert "damaged flight record" in complaint(path)


@pytest.mark.parametrize("value", [np.zeros(2), np.array(["a", "b", "c"])])
def test_an_array_that_does_not_fit_is_named(tmp_path, value):
    path = tmp_path / "flight.npz"
    some_flight().save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    np.savez(path, **{**arrays, "vehicle_1_east_m": value})
    assert "east_m" in complaint(path)


@given(data=st.data())
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_a_record_with_wrong_bytes_loads_or_is_refused(tmp_path, data):
    path = tmp_path / "flight.npz"
    some_flight().save(path)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
    with contextlib.suppress(InputError):
        FlightRecord.load(path)


@given(
    header=st.binary(max_size=40)
    | st.text("(){}',:<>|fi8 0123456789shapedecrOTu", max_size=40).map(str.encode)
)
@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@example(header=b"0L")  # a number of Python 2
def test_an_array_with_a_wrong_header_is_refused(tmp_path, header):
    path = tmp_path / "flight.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "description.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
        )
    assert "no flight record" in complaint(path)


def test_a_place_that_is_not_there_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        some_flight().save(tmp_path / "absent" / "flight.npz")


def test_a_record_needs_its_leader_first():
    record = some_flight()
    with pytest.raises(ValueError, match="leader comes first"):
        replace(record, vehicles=record.vehicles[::-1])
    with pytest.raises(ValueError, match="exactly one leader"):
        replace(record, vehicles=())


def test_two_vehicles_need_two_names():
    record = some_flight()
    with pytest.raises(ValueError, match="same name"):
        replace(record, vehicles=(record.leader, replace(record.followers[0], name="leader")))


def test_times_need_to_ascend():
    for times in ([0.0, 2.0, 1.0], [0.0, math.nan, 1.0]):
        with pytest.raises(ValueError, match="ascending"):
            replace(some_flight(), time_s=np.array(times))


def test_a_small_file_that_would_grow_beyond_all_flights_is_refused_unread(tmp_path):
    path = tmp_path / "flight.npz"
    piece = bytes(16 * 1024**2)
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("time_s.npy", "w", force_zip64=True) as member,
    ):
        for _ in range(65):
            member.write(piece)
    assert path.stat().st_size < 3e6
    with pytest.raises(InputError, match="unpacked it would be 1091 MB, more than 1074 MB"):
        FlightRecord.load(path)


def test_fence_and_other_paths_come_back(tmp_path):
    edge = Outline(kind="fence", north_m=np.array([0.0, 9.0]), east_m=np.array([1.0, 2.0]))
    other = Outline(kind="path", north_m=np.array([5.0]), east_m=np.array([6.0]))
    replace(some_flight(), outlines=(edge, other)).save(tmp_path / "flight.npz")

    loaded = FlightRecord.load(tmp_path / "flight.npz").outlines

    assert [one.kind for one in loaded] == ["fence", "path"]
    assert loaded[0].north_m.tolist() == [0.0, 9.0]
    assert loaded[1].east_m.tolist() == [6.0]


@pytest.mark.parametrize("kinds", [["wall"], [["fence"]], "fence", ["fence"] * 1001])
def test_drawn_lines_of_no_known_kind_are_damage(kinds):
    with pytest.raises(ValueError, match="drawn line"):
        compose_outlines(kinds, {})


def test_a_drawn_line_has_as_many_norths_as_easts():
    with pytest.raises(ValueError, match="as many norths as easts"):
        Outline(kind="fence", north_m=np.zeros(2), east_m=np.zeros(3))
