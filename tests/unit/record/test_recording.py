"""A recording is written while it is made, and nothing that a disk does reaches the flight."""

import errno
import os
import threading
import time
from collections.abc import Callable
from functools import partial

import pytest

from tests.kit.missions import shipped
from vfguide.errors import InputError
from vfguide.mission import load_mission
from vfguide.mission.model import Mission
from vfguide.record.guidance_log import GuidanceStep, read_guidance
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


STEP = GuidanceStep(
    time_s=101.0, mode="tracking", course_rad=0.5, speed_m_s=21.0, limited=False, lyapunov_m2=0.25
)


def test_what_was_recorded_is_in_the_files_before_the_recording_ends(mission, tmp_path):
    recording = begin_recording(tmp_path, mission, "f1", clock_s=100.0)
    recording.add_datagram(101.0, HEARTBEAT + HEARTBEAT)
    recording.add_step(STEP)
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
    with pytest.raises(
        InputError, match=r"cannot be recorded to .*another directory with --record"
    ):
        begin_recording(tmp_path / place, mission, "f1", clock_s=0.0)


def test_a_start_that_failed_leaves_no_directory(mission, tmp_path, monkeypatch):
    def full(_file: GrowingFile, _content: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(GrowingFile, "append", full)
    with pytest.raises(InputError, match=r"No space left on device.*make room"):
        begin_recording(tmp_path, mission, "f1", clock_s=0.0)
    assert list(tmp_path.iterdir()) == []


def test_a_name_with_a_slash_stays_below_its_directory(mission, tmp_path):
    vehicles = {**mission.vehicles, "../../f1": mission.vehicles["f1"]}
    odd = mission.model_copy(update={"vehicles": vehicles})
    recording = begin_recording(tmp_path, odd, "../../f1", clock_s=0.0)
    recording.close()
    assert recording.directory.parent == tmp_path
    assert all(
        path.parent == recording.directory for path in files_of(recording.directory, "../../f1")
    )


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


def test_a_disk_that_hangs_delays_nobody_and_what_is_dropped_is_counted(tmp_path):
    file = GrowingFile(tmp_path / "some.file")
    released = threading.Event()
    began = threading.Event()

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
    assert writer.news() == [
        f"not recording: the disk is too slow; {REMEDY}",
        "recording again, 15 entries lost: nothing to do",
    ]


def test_a_file_that_is_there_is_not_written_to(tmp_path):
    (tmp_path / "other").write_text("precious")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for name in ("other", "link"):
        with pytest.raises(FileExistsError):
            GrowingFile(tmp_path / name)
    assert not (tmp_path / "elsewhere").exists()
