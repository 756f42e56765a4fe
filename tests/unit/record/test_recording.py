"""A recording is written while it is made, and nothing that a disk does reaches the flight."""

import errno
import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.missions import shipped
from vfguide.errors import InputError
from vfguide.mission import load_mission
from vfguide.mission.model import Mission
from vfguide.record.guidance_log import (
    STEPS,
    GuidanceStep,
    GuidanceTrack,
    age_series,
    encode_step,
    lead_series,
    read_guidance,
    read_newest,
    slot_series,
)
from vfguide.record.recording import (
    DiskWriter,
    GrowingFile,
    begin_recording,
    files_of,
    find_recordings,
    read_start,
)
from vfguide.record.tlog import read_tlog

HEARTBEAT = bytes.fromhex("fe0900010100000000000106510003000d1a")[:17]
"""A MAVLink 1 heartbeat; its checksum does not matter here."""

REMEDY = "steering goes on, make room on the disk or mend it"

PATIENCE_S = 20.0


@pytest.fixture
def mission() -> Mission:
    return shipped("line-calm")


def until(happened: Callable[[], bool]) -> None:
    """Wait for another thread."""
    gives_up = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < gives_up
        time.sleep(0.01)


def test_what_was_recorded_is_in_the_files_before_the_recording_ends(mission, tmp_path):
    recording = begin_recording(tmp_path, mission, "f1", clock_s=100.0)
    recording.add_datagram(101.0, HEARTBEAT + HEARTBEAT)
    recording.add_step(step(101.0))
    tlog, guidance = files_of(recording.directory, "f1")
    until(lambda: len(list(read_tlog(tlog))) == 2)
    until(lambda: read_guidance(guidance).at(101.0) is not None)
    (first, _) = read_tlog(tlog)
    assert first.frame.content == HEARTBEAT
    # One second of the companion's clock after the start.
    assert first.time_s - recording.start.unix_s == pytest.approx(1.0, abs=1e-3)
    assert recording.close() == 0


def test_every_start_has_a_directory_of_its_own(mission, tmp_path):
    recordings = [begin_recording(tmp_path, mission, "f1", clock_s=0.0) for _ in range(3)]
    for recording in recordings:
        recording.close()
    names = {recording.directory for recording in recordings}
    assert len(names) == 3
    assert all(name.name.startswith("f1-2") for name in names)
    assert set(find_recordings([tmp_path])) == names
    assert read_start(recordings[0].directory) == recordings[0].start
    assert load_mission(recordings[0].directory / "mission.yaml") == mission


@pytest.mark.parametrize("place", ["file", "file/below", "/proc/none"])
def test_a_place_that_takes_nothing_is_one_line_at_the_start(mission, tmp_path, place):
    (tmp_path / "file").touch()
    words = r"cannot be recorded to .*another directory with --record"
    with pytest.raises(InputError, match=words):
        begin_recording(tmp_path / place, mission, "f1", clock_s=0.0)


def test_a_name_with_a_slash_stays_below_its_directory(mission, tmp_path):
    name = "../../f1"
    odd = mission.model_copy(
        update={"vehicles": {**mission.vehicles, name: mission.vehicles["f1"]}}
    )
    recording = begin_recording(tmp_path, odd, name, clock_s=0.0)
    recording.close()
    directory = recording.directory
    assert directory.parent == tmp_path
    assert {path.parent for path in files_of(directory, name)} == {directory}


class FullDisk:
    """Takes some bytes, then none, then all again."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.write = os.write

    def __call__(self, descriptor: int, content: bytes | memoryview) -> int:
        if self.room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = self.write(descriptor, content[: self.room])
        self.room -= count
        return count


def test_a_start_that_failed_leaves_no_directory(mission, tmp_path, monkeypatch):
    monkeypatch.setattr("vfguide.record.recording.os.write", FullDisk(room=0))
    with pytest.raises(InputError, match=r"No space left on device.*make room"):
        begin_recording(tmp_path, mission, "f1", clock_s=0.0)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_once_and_leaves_whole_entries(tmp_path, monkeypatch):
    path = tmp_path / "some.file"
    file = GrowingFile(path)
    disk = FullDisk(room=14)
    monkeypatch.setattr("vfguide.record.recording.os.write", disk)
    writer = DiskWriter(write_s=0.01)
    writer.put(file, lambda: b"entry 1\n")
    until(lambda: path.read_bytes() == b"entry 1\n")
    writer.put(file, lambda: b"entry 2\n")
    until(lambda: writer.lost == 1)
    writer.put(file, lambda: b"entry 3\n")
    until(lambda: writer.lost == 2)
    until(lambda: path.read_bytes() == b"entry 1\n")
    assert writer.news() == [f"not recording: No space left on device; {REMEDY}"]
    disk.room = 1000
    writer.put(file, lambda: b"entry 4\n")
    until(lambda: path.read_bytes() == b"entry 1\nentry 4\n")
    writer.close()
    assert writer.news() == ["recording again, 2 entries lost: nothing to do"]
    assert writer.missing == 2


def test_an_entry_that_cannot_be_encoded_is_told_and_those_after_it_are_written(tmp_path):
    path = tmp_path / "some.file"
    file, writer = GrowingFile(path), DiskWriter(write_s=0.01)
    writer.put(file, lambda: bytes([256]))
    until(lambda: writer.lost == 1)
    writer.put(file, lambda: b"entry 2\n")
    writer.close()
    assert path.read_bytes() == b"entry 2\n"
    first, last = writer.news()
    assert first.startswith("not recording: ValueError in test_recording.py")
    assert last == "recording again, 1 entries lost: nothing to do"


def test_a_disk_that_hangs_delays_nobody_and_what_is_dropped_is_counted(tmp_path):
    file = GrowingFile(tmp_path / "some.file")
    began, released = threading.Event(), threading.Event()

    def hang() -> bytes:
        began.set()
        released.wait(PATIENCE_S)
        return b"x"

    writer = DiskWriter(longest_queue=5, write_s=0.01)
    writer.put(file, hang)
    until(began.is_set)
    for number in range(20):
        writer.put(file, partial(bytes, [number]))
    assert writer.dropped == 15
    released.set()
    writer.close()
    assert (tmp_path / "some.file").read_bytes() == b"x" + bytes(range(5))
    assert writer.missing == 15
    slow = f"not recording: the disk is too slow; {REMEDY}"
    assert writer.news() == [slow, "recording again, 15 entries lost: nothing to do"]


def test_a_file_that_is_there_is_not_written_to(tmp_path):
    (tmp_path / "other").write_text("precious")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for name in ("other", "link"):
        with pytest.raises(FileExistsError):
            GrowingFile(tmp_path / name)
    assert not (tmp_path / "elsewhere").exists()


def step(time_s: float, mode: str = "tracking") -> GuidanceStep:
    fields = {"limited": True, "lyapunov_m2": 0.25, "formation_time_s": 7.5}
    return GuidanceStep(time_s=time_s, mode=mode, course_rad=0.5, speed_m_s=21.0, **fields)


def values(steps: GuidanceStep | Sequence[GuidanceStep] | None) -> str:
    """In words, which are equal where NaN stands in both."""
    return repr(list(steps) if isinstance(steps, Sequence) else steps)


def written(path: Path, *steps: GuidanceStep) -> Path:
    path.write_bytes(STEPS.header + b"".join(encode_step(one) for one in steps))
    return path


def test_the_newest_step_that_is_not_later_counts_and_starts_make_one_track(tmp_path):
    first, second = written(tmp_path / "1.csv", step(100.0, "joining")), tmp_path / "2.csv"
    for track in (
        read_guidance(written(second, step(100.05)), first),
        read_guidance(written(tmp_path / "f1.csv", step(100.0, "joining"), step(100.05))),
    ):
        assert track.at(99.99) is None
        assert values(track.at(100.0)) == values(step(100.0, "joining"))
        assert values(track.at(100.049)) == values(step(100.0, "joining"))
        assert values(track.at(500.0)) == values(step(100.05))
    # Times count from where the flight began.
    assert values(read_guidance(first, zero_s=90.0).at(10.0)) == values(step(10.0, "joining"))


@pytest.mark.parametrize("file", ["absent.csv", "/dev/zero"])
def test_a_file_that_is_not_there_or_has_no_end_leaves_nothing(tmp_path, file):
    assert read_guidance(tmp_path / file).at(1.0) is None


def test_what_was_not_sent_who_has_left_and_which_path_is_followed_are_kept(tmp_path):
    nothing = {"course_rad": math.nan, "speed_m_s": math.nan, "lyapunov_m2": math.nan}
    steps = [
        replace(step(0.5, "waiting"), limited=False, **nothing),
        step(1.0),
        replace(step(2.0), path="survey"),
        replace(step(3.0), path=None),
        replace(step(4.0), left=True, path=None),
    ]
    assert values(read_guidance(written(tmp_path / "f1.csv", *steps)).steps) == values(steps)


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


NAN = math.nan
ORDERED = [replace(step(2.0), **SLOT), replace(step(4.0), **SLOT | {"slot_right_m": 20.0})]
SLOTTED = [replace(step(time_s), **SLOT) for time_s in (1.0, 4.0)]
LEFT = [replace(step(time_s), left=True) for time_s in (2.0, 2.5)]


@pytest.mark.parametrize(
    ("steps", "moments", "rights"),
    [
        ([step(1.0), *ORDERED], [0.0, 2.0, 3.0, 9.0], [5.0, 10.0, 15.0, 20.0]),
        # Who has left has none until it is given one again.
        ([SLOTTED[0], *LEFT, SLOTTED[1]], [0, 1.5, 2, 3, 4, 5], [5, 10, NAN, NAN, 10, 10]),
        ([step(1.0), *LEFT], [0, 1.5, 2, 3, 4, 5], [5, 5, NAN, NAN, NAN, NAN]),
    ],
)
def test_a_slot_counts_from_the_order_on_and_is_the_missions_before(steps, moments, rights):
    series = slot_series(GuidanceTrack(steps), np.array(moments), (-20.0, 5.0, 0.0))
    assert np.array_equal(series["slot_right_series_m"], rights, equal_nan=True)
    assert slot_series(GuidanceTrack([step(1.0)]), np.array(moments), (-20.0, 5.0, 0.0)) == {}


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
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bytes_are_read_or_left_alone(tmp_path, content):
    path = tmp_path / "any.csv"
    path.write_bytes(STEPS.header + content + b"\n")
    assert all(math.isfinite(one.time_s) for one in read_newest(path).steps)
    path.write_bytes(b"time_s,mode,course_rad,speed_m_s,limited,lyapunov_m2\n" + content)
    read_guidance(path).at(0.0)


def test_what_a_vehicle_led_by_is_known_while_it_led_and_at_its_own_time():
    steps = [
        replace(step(at + 0.1), **LED, lead_time_s=at, lead_north_m=20.0 * at, lead_east_m=0.0)
        for at in (1.0, 1.5)
    ]
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
