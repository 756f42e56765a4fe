import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import astuple, replace

from vfguide.record.guidance_log import (
    HEADER,
    GuidanceStep,
    GuidanceTrack,
    age_series,
    encode_step,
    lead_series,
    read_guidance,
    read_newest,
    slot_series,
)


def step(time_s: float, mode: str = "tracking") -> GuidanceStep:
    return GuidanceStep(
        time_s=time_s,
        mode=mode,
        course_rad=0.5,
        speed_m_s=21.0,
        limited=True,
        lyapunov_m2=0.25,
        formation_time_s=7.5,
    )


def values(steps: GuidanceStep | Sequence[GuidanceStep] | None) -> object:
    """As tuples, which are equal where NaN stands in both; dataclasses are not from Python 3.13 on."""
    if steps is None or isinstance(steps, GuidanceStep):
        return steps and astuple(steps)
    return [astuple(one) for one in steps]


def written(path: Path, *steps: GuidanceStep) -> Path:
    path.write_bytes(HEADER + b"".join(encode_step(one) for one in steps))
    return path


def test_the_newest_step_that_is_not_later_counts(tmp_path):
    file = written(tmp_path / "f1.csv", step(100.0, "joining"), step(100.05))
    track = read_guidance(file)
    assert track.at(99.99) is None
    assert values(track.at(100.0)) == values(step(100.0, "joining"))
    assert values(track.at(100.049)) == values(step(100.0, "joining"))
    assert values(track.at(500.0)) == values(step(100.05))
    # Times count from where the flight began.
    assert values(read_guidance(file, zero_s=90.0).at(10.0)) == values(step(10.0, "joining"))


@pytest.mark.parametrize("file", ["absent.csv", "/dev/zero"])
def test_a_file_that_is_not_there_or_has_no_end_leaves_nothing(tmp_path, file):
    assert read_guidance(tmp_path / file).at(1.0) is None


def test_what_was_not_sent_stays_unknown(tmp_path):
    nothing = {"course_rad": math.nan, "speed_m_s": math.nan, "lyapunov_m2": math.nan}
    unsent = replace(step(1.0, "waiting"), limited=False, **nothing)
    found = read_guidance(written(tmp_path / "f1.csv", unsent)).at(1.0)
    assert found is not None
    assert math.isnan(found.course_rad)
    assert found.limited is False


SLOT = {"slot_forward_m": -20.0, "slot_right_m": 10.0, "slot_up_m": 0.0}
LED = {"lead_term": 2.0, "lead_course_rad": 0.0, "lead_height_m": 100.0}


def test_ordered_slots_and_who_is_led_by_are_kept(tmp_path):
    lead = LED | {"lead_time_s": 99.75, "lead_north_m": 5.0, "lead_east_m": 6.0}
    led = replace(step(100.0), **SLOT, **lead, leader_age_s=0.125)
    track = read_guidance(written(tmp_path / "f1.csv", step(99.0), led), zero_s=90.0)
    assert values(track.steps) == values([step(9.0), replace(led, time_s=10.0, lead_time_s=9.75)])


def test_the_age_of_what_was_heard_holds_until_the_next_step_and_not_over_a_gap():
    steps = [step(0.0), replace(step(1.0), leader_age_s=0.1), replace(step(1.5), leader_age_s=0.6)]
    moments = np.array([0.5, 1.0, 1.4, 1.5, 2.5, 2.6])
    ages = age_series(GuidanceTrack(steps), moments)["leader_age_s"]
    assert ages == pytest.approx([math.nan, 0.1, 0.1, 0.6, 0.6, math.nan], nan_ok=True)
    # Of a version that tells none.
    assert age_series(GuidanceTrack(steps[:1]), moments) == {}


def test_a_slot_counts_from_the_order_on_and_is_the_missions_before():
    ordered = [replace(step(2.0), **SLOT), replace(step(4.0), **SLOT | {"slot_right_m": 20.0})]
    moments = np.array([0.0, 2.0, 3.0, 9.0])
    series = slot_series(GuidanceTrack([step(1.0), *ordered]), moments, (-20.0, 5.0, 0.0))
    assert series["slot_right_series_m"].tolist() == [5.0, 10.0, 15.0, 20.0]
    assert slot_series(GuidanceTrack([step(1.0)]), moments, (-20.0, 5.0, 0.0)) == {}


def test_that_a_vehicle_has_left_and_which_path_is_followed_are_kept(tmp_path):
    steps = [
        step(1.0),
        replace(step(2.0), path="survey"),
        replace(step(3.0), path=None),
        replace(step(4.0), left=True, path=None),
    ]
    assert values(read_guidance(written(tmp_path / "f1.csv", *steps)).steps) == values(steps)


def test_files_of_earlier_versions_are_read_as_of_a_formation_on_its_first_path(tmp_path):
    path = written(tmp_path / "f1.csv", step(1.0))
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("".join(f"{one.rsplit(',', 2)[0]}\n" for one in lines), encoding="utf-8")
    assert values(read_guidance(path).steps) == values([step(1.0)])


def test_of_a_file_that_grows_the_newest_steps_are_read_and_no_half_line(tmp_path):
    steps = [step(float(time_s)) for time_s in range(1000)]
    path = written(tmp_path / "f1.csv", *steps)
    path.write_bytes(path.read_bytes() + encode_step(step(1000.0))[:-5])
    newest = read_newest(path, tmp_path / "absent.csv", zero_s=900.0).steps
    assert values(newest[-1]) == values(step(99.0))
    assert 20 < len(newest) < 200
    # A file of one step, whose first line names its columns.
    assert values(read_newest(written(tmp_path / "f2.csv", step(1.0))).steps) == values([step(1.0)])


@given(content=st.binary(max_size=300))
def test_whatever_a_growing_file_holds_nothing_breaks(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("log") / "f1.csv"
    path.write_bytes(HEADER + content + b"\n")
    assert all(math.isfinite(one.time_s) for one in read_newest(path).steps)


def test_who_has_left_has_no_slot_until_it_is_given_one_again():
    slotted = [replace(step(time_s), **SLOT) for time_s in (1.0, 4.0)]
    left = [replace(step(time_s), left=True) for time_s in (2.0, 2.5)]
    moments, nan = np.array([0.0, 1.5, 2.0, 3.0, 4.0, 5.0]), math.nan
    for steps, rights in (
        ([slotted[0], *left, slotted[1]], [5.0, 10.0, nan, nan, 10.0, 10.0]),
        ([step(1.0), *left], [5.0, 5.0, nan, nan, nan, nan]),
    ):
        series = slot_series(GuidanceTrack(steps), moments, (-20.0, 5.0, 0.0))
        assert np.array_equal(series["slot_right_series_m"], rights, equal_nan=True)


def test_what_a_vehicle_led_by_is_known_while_it_led_and_at_its_own_time():
    places = [
        {"lead_time_s": time_s, "lead_north_m": 20.0 * time_s, "lead_east_m": 0.0}
        for time_s in (1.0, 1.5)
    ]
    steps = [replace(step(one["lead_time_s"] + 0.1), **LED, **one) for one in places]
    series = lead_series(GuidanceTrack([step(0.1), *steps]), np.array([0.5, 1.25, 2.0]), 488.0)
    assert np.array_equal(series["lead_north_m"], [np.nan, 25.0, np.nan], equal_nan=True)
    assert series["lead_term"][1] == 2.0
    assert series["lead_altitude_amsl_m"][1] == 588.0


def test_of_a_file_that_is_cut_off_anywhere_the_whole_lines_are_read(tmp_path):
    path = written(tmp_path / "f1.csv", step(1.0), step(2.0))
    content = path.read_bytes()
    second = len(encode_step(step(2.0)))
    for left_out in range(1, second + 1):
        path.write_bytes(content[:-left_out])
        assert values(read_guidance(path).at(9.0)) == values(step(1.0))


def test_the_starts_of_one_companion_make_one_track(tmp_path):
    first, second = written(tmp_path / "1.csv", step(1.0)), written(tmp_path / "2.csv", step(5.0))
    track = read_guidance(second, first)
    assert values(track.at(4.9)) == values(step(1.0))
    assert values(track.at(5.0)) == values(step(5.0))


@given(content=st.binary(max_size=300))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bytes_are_read_or_left_alone(tmp_path, content):
    path = tmp_path / "any.csv"
    path.write_bytes(b"time_s,mode,course_rad,speed_m_s,limited,lyapunov_m2\n" + content)
    read_guidance(path).at(0.0)
