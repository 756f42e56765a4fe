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

from tests.kit.records import still_flight, still_follower, still_leader
from vfguide.errors import InputError
from vfguide.lab.report.metrics import summarise, summary_json
from vfguide.lab.report.page import write_report
from vfguide.lab.report.wording import response_words, verdict_text
from vfguide.record.archive import write_archive
from vfguide.record.flight import FlightRecord, Outline, RecordAcceptance
from vfguide.record.latency import Latency, Percentiles, Promptness, Usage, latency_of
from vfguide.record.response import RESPONSES, VehicleResponse, read_response
from vfguide.record.vehicle import SERIES

numbers = st.just(float("nan")) | st.floats(-1e14, 1e14)
figures = st.floats(allow_nan=False, allow_infinity=False)
limits = st.none() | figures
names = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)


def some_flight(samples: int = 3, value: float = 0.5, mission: str = "circle") -> FlightRecord:
    """Every series of every vehicle is another one."""
    time_s = np.arange(float(samples))

    def series(value: float) -> dict[str, object]:
        numbers = {name: np.full(samples, value) + number for number, name in enumerate(SERIES)}
        slots = {"slot_forward_m": -20.0, "slot_right_m": 20.0, "system_id": 7}
        mode = np.arange(samples, dtype=np.int64) % 3
        return {**numbers, **slots, "mode": mode, "limited": np.arange(samples) % 2 == 0}

    return still_flight(
        time_s,
        still_leader(time_s, **series(value)),
        still_follower(time_s, **series(-value)),
        mode_names=("waiting", "tracking"),
        path_north_m=np.array([0.0, 1.0]),
        path_east_m=np.array([2.0, 3.0]),
        mission=mission,
        wind="article",
        rate_hz=20.0,
        seed=4,
        duration_s=300.0,
        acceptance=RecordAcceptance(mean_error_m=0.3, settle_10m_s=60.0, min_separation_m=5.0),
    )


records = st.builds(
    lambda flight, acceptance, seed: replace(flight, acceptance=acceptance, seed=seed),
    st.builds(some_flight, st.integers(0, 5), numbers, names),
    st.builds(RecordAcceptance, mean_error_m=limits, settle_1m_s=limits, min_separation_m=figures),
    st.integers(0, 2**32),
)


def one_place(examples: int) -> settings:
    """All examples share a directory."""
    shared = [HealthCheck.function_scoped_fixture]
    return settings(max_examples=examples, deadline=None, suppress_health_check=shared)


@given(record=records)
@one_place(30)
def test_a_record_comes_back_as_it_was(tmp_path, record):
    record.save(tmp_path / "flight.npz")
    loaded = FlightRecord.load(tmp_path / "flight.npz")
    for name in ("mission", "seed", "acceptance", "mode_names", "mode", "rate_hz"):
        assert getattr(loaded, name) == getattr(record, name)
    assert np.array_equal(loaded.time_s, record.time_s)
    assert np.array_equal(loaded.path_east_m, record.path_east_m)
    for before, after in zip(record.vehicles, loaded.vehicles, strict=True):
        for name in ("name", "role", "slot_right_m"):
            assert getattr(before, name) == getattr(after, name)
        for series in SERIES:
            assert np.array_equal(getattr(before, series), getattr(after, series), equal_nan=True)
        assert np.array_equal(before.mode, after.mode)
        assert np.array_equal(before.limited, after.limited)


def test_the_same_record_gives_the_same_bytes_however_long_the_flight_took(tmp_path):
    contents = set()
    for wall_s in (4.1, 4.1, 99.0):
        replace(some_flight(), wall_s=wall_s).save(tmp_path / "flight.npz")
        contents.add((tmp_path / "flight.npz").read_bytes())
    assert len(contents) == 1
    assert FlightRecord.load(tmp_path / "flight.npz").wall_s is None
    assert [path.name for path in tmp_path.iterdir()] == ["flight.npz"]


def test_what_only_some_flights_have_comes_back(tmp_path):
    quick, old = Percentiles(p50=0.3, p99=2.0, max=9.0), Percentiles(p50=50, p99=60, max=70)
    vehicles = {
        "leader": Promptness(response_ms=quick, leader_age_ms=None),
        "f1": Promptness(response_ms=quick, leader_age_ms=old),
    }
    processes = {"companion of f1": Usage(cpu_share=0.03, rss_mb=70.5)}
    latency = Latency(vehicles=vehicles, processes=processes)
    edge = Outline(kind="fence", north_m=np.array([0.0, 9.0]), east_m=np.array([1.0, 2.0]))
    other = Outline(kind="path", north_m=np.array([5.0]), east_m=np.array([6.0]))
    flown = replace(some_flight(), interrupted=True, latency=latency, outlines=(edge, other))
    flown.save(tmp_path / "flight.npz")
    loaded = FlightRecord.load(tmp_path / "flight.npz")
    assert (loaded.interrupted, loaded.latency) == (True, latency)
    drawn = [(one.kind, one.north_m.tolist(), one.east_m.tolist()) for one in loaded.outlines]
    assert drawn == [("fence", [0.0, 9.0], [1.0, 2.0]), ("path", [5.0], [6.0])]
    with pytest.raises(ValueError, match="as many norths as easts"):
        Outline(kind="fence", north_m=np.zeros(2), east_m=np.zeros(3))


def complaint(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        FlightRecord.load(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    return text


def test_what_is_no_record_is_refused_and_pickled_objects_are_never_loaded(tmp_path):
    np.save(tmp_path / "one.npy", np.zeros(3))
    np.savez(tmp_path / "other.npz", weights=np.zeros(3))
    np.savez(tmp_path / "pickle.npz", description=np.array([{"a": 1}], dtype=object))
    write_archive(tmp_path / "new.npz", {"format": "vfguide-flight-record", "version": 99}, {})
    assert "No such file" in complaint(tmp_path / "absent.npz")
    assert "directory" in complaint(tmp_path)
    assert "single NumPy array" in complaint(tmp_path / "one.npy")
    assert "no description" in complaint(tmp_path / "other.npz")
    assert "no flight record" in complaint(tmp_path / "pickle.npz")
    assert "version 99" in complaint(tmp_path / "new.npz")
    with pytest.raises(InputError, match="cannot be written"):
        some_flight().save(tmp_path / "absent" / "flight.npz")


@pytest.mark.parametrize(
    "content", [b"", b"hello", b"PK\x03\x04", b"\x93NUMPY\x01\x00", b"\x80\x04K\x01."]
)
def test_other_bytes_are_no_record(tmp_path, content):
    (tmp_path / "flight.npz").write_bytes(content)
    assert "no flight record" in complaint(tmp_path / "flight.npz")


def change(path: Path, **changes: object) -> None:
    """Write a flight's file whose arrays, or the fields of its description, are some others."""
    some_flight().save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    description = json.loads(str(arrays.pop("description")))
    arrays |= {name: changes.pop(name) for name in arrays.keys() & changes.keys()}
    np.savez(path, description=np.array(json.dumps(description | changes)), **arrays)


RESPONSE = {"name": "leader", "role": "leader", "response": {"alpha_1_s": math.nan}}


@pytest.mark.parametrize(
    "damage",
    [
        *({"vehicles": []}, {"vehicles": 3}, {"vehicles": [RESPONSE]}),
        *({"acceptance": None}, {"acceptance": {"mean_error_m": "x"}}, {"mode": "asleep"}),
        *({"rate_hz": "fast"}, {"rate_hz": 1e308}, {"seed": None}, {"seed": 1e999}),
        *({"duration_s": 1e308}, {"time_s": np.array([1e308])}),
        {"vehicle_0_north_m": np.array([-1e308])},
        *({"outlines": ["wall"]}, {"outlines": [["fence"]]}, {"outlines": "fence"}),
        {"outlines": ["fence"] * 1001},
    ],
)
def test_a_damaged_description_is_told_in_one_line(tmp_path, damage):
    change(tmp_path / "flight.npz", **damage)
    assert "damaged flight record" in complaint(tmp_path / "flight.npz")


@pytest.mark.parametrize("value", [np.zeros(2), np.array(["a", "b", "c"])])
def test_an_array_that_does_not_fit_is_named(tmp_path, value):
    change(tmp_path / "flight.npz", vehicle_1_east_m=value)
    assert "east_m" in complaint(tmp_path / "flight.npz")


@given(data=st.data())
@one_place(150)
def test_a_record_with_wrong_bytes_loads_or_is_refused(tmp_path, data):
    path = tmp_path / "flight.npz"
    some_flight().save(path)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
    with contextlib.suppress(InputError):
        FlightRecord.load(path)


WORDS = st.text("(){}',:<>|fi8 0123456789shapedecrOTu", max_size=40).map(str.encode)


@given(header=st.binary(max_size=40) | WORDS)
@one_place(100)
@example(header=b"0L")  # a number of Python 2
def test_an_array_with_a_wrong_header_is_refused(tmp_path, header):
    path = tmp_path / "flight.npz"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("description.npy", content)
    assert "no flight record" in complaint(path)


FLIGHT = some_flight()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"vehicles": FLIGHT.vehicles[::-1]}, "leader comes first"),
        ({"vehicles": ()}, "exactly one leader"),
        ({"vehicles": (FLIGHT.leader, replace(FLIGHT.followers[0], name="leader"))}, "same name"),
        ({"time_s": np.array([0.0, 2.0, 1.0])}, "ascending"),
        ({"time_s": np.array([0.0, math.nan, 1.0])}, "ascending"),
    ],
)
def test_a_record_needs_one_leader_first_names_of_its_own_and_ascending_times(changes, words):
    with pytest.raises(ValueError, match=words):
        replace(FLIGHT, **changes)


def test_a_small_file_that_would_grow_beyond_all_flights_is_refused_unread(tmp_path):
    path = tmp_path / "flight.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("time_s.npy", "w", force_zip64=True) as member,
    ):
        for _ in range(65):
            member.write(bytes(16 * 1024**2))
    assert path.stat().st_size < 3e6
    with pytest.raises(InputError, match="unpacked it would be 1091 MB, more than 1074 MB"):
        FlightRecord.load(path)


TIME = np.arange(0.0, 4.0)

LEARNED = VehicleResponse(
    alpha_1_s=0.4,
    course_dead_time_s=0.2,
    course_lag_s=0.1,
    course_spread=1.25,
    beta_1_s=0.32,
    speed_dead_time_s=0.5,
    speed_lag_s=0.0,
    speed_spread=2.0,
    slips=True,
    turn_efficiency=0.81,
    max_bank_deg=22.0,
)
PROMPT = {"alpha_1_s": 1.0, "course_dead_time_s": 0.0, "course_lag_s": 0.0, "slips": False}
DECLARED = VehicleResponse(**PROMPT, max_bank_deg=45.0)

SENTENCE = (
    "alpha 0.40 (0.32 to 0.50) 0.3 s late, declared 1.00; beta 0.32 (0.16 to 0.64) 0.5 s late,"
    " not declared; turns 0.81 of what its bank says: slips; banks to 22°, declared 45°"
)


def flight(**given):
    return still_flight(TIME, still_leader(TIME, **given))


def test_the_last_response_that_was_flown_by_is_read(tmp_path):
    file = tmp_path / "f1.response.csv"
    first = RESPONSES.encode(VehicleResponse(alpha_1_s=1.2, slips=True), time_s=0.1)
    file.write_bytes(RESPONSES.header + first + RESPONSES.encode(LEARNED, time_s=9.0) + b"12.0,0")
    assert read_response(file) == LEARNED
    assert read_response(tmp_path / "none.csv") is None


def test_a_record_and_its_report_have_the_learned_response_beside_the_declared(tmp_path):
    record = flight(response=LEARNED, declared=DECLARED)
    record.save(tmp_path / "flight.npz")
    leader = FlightRecord.load(tmp_path / "flight.npz").leader
    assert (leader.response, leader.declared) == (LEARNED, DECLARED)
    summary = summarise(record)
    assert response_words(summary.vehicles["leader"]) == SENTENCE
    assert f"leader: {SENTENCE}" in verdict_text(summary).plain
    assert SENTENCE in write_report(record, tmp_path).read_text(encoding="utf-8")
    plain = json.loads(json.dumps(summary_json(summary)))["vehicles"]["leader"]
    assert plain["response"]["alpha_1_s"] == 0.4
    assert plain["declared"]["alpha_1_s"] == 1.0


def test_a_response_that_was_right_is_one_word_and_of_a_log_nothing_is_said():
    right = VehicleResponse(**PROMPT, course_spread=1.1)
    told = summarise(flight(response=right, declared=DECLARED)).vehicles["leader"]
    assert response_words(told) == "alpha 1.00 as declared; beta not told"
    assert response_words(summarise(flight(declared=DECLARED)).vehicles["leader"]) is None


def figures_of(**figures: tuple[float, float, float]) -> dict[str, float]:
    names = ("p50", "p99", "max")
    return {f"{one}_{name}": figures[one][at] for one in figures for at, name in enumerate(names)}


F1 = figures_of(response_ms=(0.3, 2.0, 9.0), leader_age_ms=(50.0, 60.0, 70.0))
FIGURES = {
    "leader": figures_of(response_ms=(0.2, 3.0, 4.0)),
    "f1": F1,
    "f2": {"response_ms_max": 0.0, "leader_age_ms_max": 0.0},
}


def test_what_companions_say_becomes_percentiles_and_together_none_is_worse():
    processes = {"judge": Usage(cpu_share=0.1, rss_mb=80.0)}
    latency = latency_of(FIGURES, leader="leader", processes=processes)
    old = Percentiles(p50=50.0, p99=60.0, max=70.0)
    assert latency.vehicles["f1"].response_ms == Percentiles(p50=0.3, p99=2.0, max=9.0)
    assert latency.vehicles["f1"].leader_age_ms == old
    # A leader has no age, and a companion that never steered has nothing.
    assert latency_of({"leader": F1}, leader="leader").vehicles["leader"].leader_age_ms is None
    assert latency.vehicles["f2"] == Promptness(response_ms=None, leader_age_ms=None)
    together = latency.together()
    assert together.response_ms == Percentiles(p50=0.3, p99=3.0, max=9.0)
    assert together.leader_age_ms == old
