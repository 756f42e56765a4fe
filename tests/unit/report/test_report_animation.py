"""A moving picture of a flight: small, of the part that is asked for, whole or not at all."""

import math

import numpy as np
import pytest
from PIL import Image

from tests.kit.records import still_flight, with_vehicle
from vfguide.commands.report import animate_flight
from vfguide.errors import InputError
from vfguide.lab.report.animation import (
    Span,
    choose_span,
    frame_count,
    reach_to_come,
    write_animation,
)


@pytest.mark.parametrize("name", ["join.gif", "join.webp", "join.png"])
def test_a_second_is_a_small_picture_that_moves(circle_flight, tmp_path, name):
    path = tmp_path / name
    span = write_animation(circle_flight, path, begin_s=2.0, end_s=3.0)
    assert span == Span(begin_s=2.0, end_s=3.0)
    with Image.open(path) as picture:
        assert picture.size == (640, 480)
        # 20 samples a second.
        assert 20 <= picture.n_frames <= 21  # type: ignore[attr-defined]
        picture.seek(19)
        later = np.asarray(picture.convert("RGB"))
        picture.seek(0)
        assert np.any(np.asarray(picture.convert("RGB")) != later)
    assert path.stat().st_size < 2_000_000
    assert [one.name for one in tmp_path.iterdir()] == [name]


def test_the_usual_part_is_the_way_into_the_slots(circle_flight):
    # The last follower closes in from 58 m by exp(-t / 6 s): within 1 m after 24 s, and 8 s are added.
    span = choose_span(circle_flight, None, None)
    assert span.begin_s == 0.0
    assert span.end_s == pytest.approx(6.0 * math.log(58.3) + 8.0, abs=1.0)


@pytest.mark.parametrize(("begin_s", "end_s"), [(20.0, 10.0), (400.0, None), (0.0, -1.0)])
def test_a_part_without_length_is_refused(circle_flight, begin_s, end_s):
    with pytest.raises(InputError, match="the flight is from 0 to 300 s"):
        choose_span(circle_flight, begin_s, end_s)


def test_another_ending_is_refused(circle_flight, tmp_path):
    with pytest.raises(InputError, match=r"\.gif, \.webp or \.png"):
        write_animation(circle_flight, tmp_path / "join.mp4")


def test_states_that_are_not_known_are_left_out(circle_flight, tmp_path):
    unknown = np.full_like(circle_flight.time_s, math.nan)
    record = with_vehicle(circle_flight, "f1", north_m=unknown, heading_rad=unknown)
    record = with_vehicle(record, "leader", wind_north_m_s=unknown)
    write_animation(record, tmp_path / "a.gif", begin_s=0.0, end_s=0.5)
    assert (tmp_path / "a.gif").stat().st_size > 1000


def test_a_lone_leader_is_shown_without_a_plot(tmp_path):
    write_animation(still_flight(np.arange(3.0)), tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as picture:
        assert picture.size == (640, 360)


def test_a_long_part_has_no_more_frames_than_stay_small():
    assert frame_count(Span(begin_s=0.0, end_s=10.0)) == 120
    assert frame_count(Span(begin_s=0.0, end_s=3600.0)) == 250


def test_the_picture_only_draws_near():
    east = np.array([[0.0, 0.0, 0.0, 0.0], [60.0, 80.0, 20.0, math.nan]])
    north = np.zeros_like(east)
    assert reach_to_come((east, north)).tolist() == [40.0, 40.0, 10.0, 0.0]


def test_the_command_writes_its_file_and_no_other(tmp_path):
    flown, out = tmp_path / "flown", tmp_path / "out"
    flown.mkdir()
    out.mkdir()
    still_flight(np.arange(3.0)).save(flown / "flight.npz")
    animate_flight([flown], out / "a.gif", begin_s=None, end_s=None, force=False)
    assert [one.name for one in out.iterdir()] == ["a.gif"]
    assert [one.name for one in flown.iterdir()] == ["flight.npz"]
    with pytest.raises(InputError, match="is there already"):
        animate_flight([flown], out / "a.gif", begin_s=None, end_s=None, force=False)


def test_a_picture_that_fails_leaves_the_one_before(tmp_path):
    still_flight(np.arange(3.0)).save(tmp_path / "flight.npz")
    (tmp_path / "a.gif").write_bytes(b"mine")
    with pytest.raises(InputError, match="nothing to show"):
        animate_flight([tmp_path], tmp_path / "a.gif", begin_s=50.0, end_s=None, force=True)
    assert (tmp_path / "a.gif").read_bytes() == b"mine"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.gif", "flight.npz"]
