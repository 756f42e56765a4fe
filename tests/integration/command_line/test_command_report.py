"""`vfguide report`: the report of a flight that was recorded before, or one line that says why not."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from vfguide.errors import InputError
from vfguide.record.guidance_log import read_guidance
from vfguide.record.recording import read_start
from vfguide.record.tlog import read_tlog


@pytest.fixture
def copy_of_flown(flown: SimpleNamespace, tmp_path: Path) -> Path:
    directory = tmp_path / "copy"
    shutil.copytree(flown.directory, directory)
    return directory


def test_a_report_is_written_again_from_the_record(command, copy_of_flown, flown):
    for path in copy_of_flown.iterdir():
        if path.name not in {"flight.npz", "summary.json"}:
            path.unlink()
    outcome = command("report", copy_of_flown)
    assert outcome.status == 0
    assert outcome.err == ""
    assert outcome.out.endswith(f"report: {copy_of_flown / 'report.html'}\n")
    for name in ("summary.json", "report.html"):
        again, first = copy_of_flown / name, flown.directory / name
        assert again.read_text(encoding="utf-8") == first.read_text(encoding="utf-8")


@pytest.mark.usefixtures("unplotted")
def test_without_a_summary_only_the_time_that_the_flight_took_is_lost(command, copy_of_flown):
    summary = copy_of_flown / "summary.json"
    first = json.loads(summary.read_text(encoding="utf-8"))
    for content in ("{", "[]", '{"wall_s": "long"}', '{"wall_s": NaN}', None):
        if content is None:
            summary.unlink()
        else:
            summary.write_text(content, encoding="utf-8")
        assert command("report", copy_of_flown).status == 0
        again = json.loads(summary.read_text(encoding="utf-8"))
        assert again == {**first, "wall_s": None, "real_time_factor": None}


@pytest.mark.usefixtures("unplotted")
def test_a_refused_flight_is_reported_without_complaint(command, pair_with, tmp_path):
    command("fly", pair_with(), "--duration", 1, "--out", tmp_path / "out")
    outcome = command("report", tmp_path / "out")
    assert outcome.status == 0
    assert "Not accepted" in outcome.out


def test_what_is_no_flight_is_one_line(refusal, flown, tmp_path):
    path, record = tmp_path / "none", flown.directory / "flight.npz"
    known = "give one that `vfguide fly --out` wrote, or companions recorded into"
    assert refusal("report", path) == f"{path}: no such directory; {known}"
    assert (
        refusal("report", record) == f"{record}: is a file; give its directory, {flown.directory}"
    )
    assert refusal("report", tmp_path) == (
        f"{tmp_path}: holds neither flight.npz nor recordings; {known.replace('one', 'a directory', 1)}"
    )


def test_a_report_is_of_one_rehearsal(refusal, flown, copy_of_flown, tmp_path):
    line = refusal("report", flown.directory, copy_of_flown, "--out", tmp_path / "both")
    assert line.endswith("is a rehearsal, and the report is of one at a time; give it alone")


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "nothing left": lambda content: content[:0],
    "cut short": lambda content: content[: len(content) // 2],
    "in the middle": lambda content: (
        content[: len(content) // 2] + bytes(1000) + content[len(content) // 2 + 1000 :]
    ),
    "something else": lambda content: b"GIF89a" + content[6:100],
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_record_is_one_line(refusal, copy_of_flown, damage):
    record = copy_of_flown / "flight.npz"
    record.write_bytes(damage(record.read_bytes()))
    line = refusal("report", copy_of_flown)
    assert line.startswith(f"{record}: is no flight record")
    assert line.endswith("; give the directory of another flight, or fly it again")


@pytest.mark.usefixtures("one_plot")
def test_a_report_that_cannot_be_written_is_one_line(refusal, copy_of_flown):
    for name in ("summary.json", "report.html"):
        (copy_of_flown / name).unlink()
        (copy_of_flown / name).mkdir()
        line = refusal("report", copy_of_flown)
        assert line.startswith(str(copy_of_flown))
        assert "cannot be written" in line
        (copy_of_flown / name).rmdir()
        (copy_of_flown / name).touch()


@pytest.mark.usefixtures("unplotted")
def test_a_report_does_not_take_the_place_of_what_is_somebody_elses(
    command, refusal, copy_of_flown, tmp_path
):
    foreign, other = tmp_path / "foreign", tmp_path / "other"
    foreign.mkdir()
    (foreign / "report.html").write_text("mine")
    other.mkdir()
    summary = json.loads((copy_of_flown / "summary.json").read_text(encoding="utf-8"))
    (other / "summary.json").write_text(json.dumps({**summary, "mission": "another"}))
    for directory, said in ((foreign, "no flight has written it"), (other, "mission 'another'")):
        before = {path.name: path.read_bytes() for path in directory.iterdir()}
        line = refusal("report", copy_of_flown, "--out", directory)
        assert said in line
        assert line.endswith("--force to replace it")
        assert {path.name: path.read_bytes() for path in directory.iterdir()} == before
        assert command("report", copy_of_flown, "--out", directory, "--force").status == 0
        assert command("report", copy_of_flown, "--out", directory).status == 0


@pytest.mark.usefixtures("unplotted")
def test_a_report_waits_for_no_pipe(command, refusal, copy_of_flown, tmp_path):
    (copy_of_flown / "summary.json").unlink()
    os.mkfifo(copy_of_flown / "summary.json")
    assert command("report", copy_of_flown).status == 0
    (copy_of_flown / "flight.npz").unlink()
    os.mkfifo(copy_of_flown / "flight.npz")
    recorded = tmp_path / "recorded" / "one"
    recorded.mkdir(parents=True)
    os.mkfifo(recorded / "recording.json")
    os.mkfifo(recorded / "one.tlog")
    line = refusal("report", copy_of_flown)
    assert line.startswith(f"{copy_of_flown / 'flight.npz'}: cannot be read: this is a pipe")
    assert list(read_guidance(recorded / "one.tlog").steps) == []
    with pytest.raises(InputError, match="this is a pipe"):
        next(read_tlog(recorded / "one.tlog"))
    with pytest.raises(InputError, match="this is a pipe"):
        read_start(recorded)


def test_recordings_that_a_killed_flight_left_are_named(refusal, tmp_path):
    left = tmp_path / ".partial-x"
    recording = left / "recordings" / "one-20261122T061500Z"
    recording.mkdir(parents=True)
    (recording / "recording.json").write_text("{")
    told = f"{tmp_path}: holds no flight that ended; give {left}, where companions recorded"
    assert refusal("report", tmp_path) == told
