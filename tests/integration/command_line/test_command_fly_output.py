"""What `vfguide fly` prints with --json, and what it leaves in its directory."""

import errno
import json
import os
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from vfguide.record.flight import FlightRecord
from vfguide.record.tlog import TelemetryLog

REMEDY = "give another directory with --out, or --force to replace it"

NUMBER = (int, float)


def numbers(*names: str) -> dict[str, Any]:
    """Fields that are numbers."""
    return dict.fromkeys(names, NUMBER)


SPREAD = numbers("mean", "p95", "max")
SUMMARY = {
    **dict.fromkeys(("mission", "controller", "plant", "wind", "mode"), str),
    **numbers("rate_hz", "duration_s", "wall_s", "real_time_factor"),
    "seed": int,
    "accepted": bool,
    "formation": numbers(
        *("mean_error_m", "p95_error_m", "max_error_m", "settle_10m_s", "settle_1m_s"),
        "min_separation_m",
    ),
    "vehicles": {
        "lead": {
            "role": str,
            "cross_track_error_m": SPREAD,
            **numbers("course_setpoint_variation_rad_s"),
        },
        "wing": {
            "role": str,
            "formation_error_m": SPREAD,
            "along_track_error_m": SPREAD,
            "cross_track_error_m": SPREAD,
            "height_error_m": SPREAD,
            **numbers("limited_fraction", "bank_limited_fraction", "speed_limited_fraction"),
            **numbers("roll_rate_rad_s", "speed_setpoint_variation_m_s2"),
        },
    },
}

COURSE = 43002
"""MAV_CMD_GUIDED_CHANGE_HEADING."""


def refuse(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON")


def parsed(text: str) -> dict[str, Any]:
    """One JSON document without NaN or infinities, and nothing besides."""
    document: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return document


def assert_shaped(value: dict[str, Any], shape: dict[str, Any], place: str = "") -> None:
    for name, kind in shape.items():
        here = f"{place}.{name}"
        assert name in value, here
        if isinstance(kind, dict):
            assert_shaped(value[name], kind, here)
        else:
            assert isinstance(value[name], kind), here
            assert isinstance(value[name], bool) == (kind is bool), here


def test_standard_output_is_one_document_with_every_promised_field(flown):
    summary = parsed(flown.outcome.out)
    assert_shaped(summary, SUMMARY)
    assert summary["formation"]["window_s"] == [10, 20]
    assert (summary["mission"], summary["controller"]) == ("pair", "slot")
    assert (summary["plant"], summary["wind"]) == ("heading-hold", "calm")
    assert (summary["mode"], summary["rate_hz"], summary["seed"]) == ("lockstep", 20, 1)
    assert (summary["duration_s"], summary["accepted"]) == (20, True)
    assert list(summary["vehicles"]) == ["lead", "wing"]
    roles = [vehicle["role"] for vehicle in summary["vehicles"].values()]
    assert roles == ["leader", "follower"]


def test_the_summary_file_says_what_standard_output_said(flown):
    assert parsed((flown.directory / "summary.json").read_text()) == parsed(flown.outcome.out)


def test_what_was_not_measured_is_null(command, alone_with):
    summary = parsed(command("fly", alone_with(), "--duration", 2, "--json").out)
    assert summary["formation"]["mean_error_m"] is None
    assert summary["formation"]["min_separation_m"] is None
    assert list(summary["vehicles"]) == ["one"]


def test_colours_forced_on_leave_json_alone(command, alone_with, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    outcome = command("fly", alone_with(), "--duration", 1, "--json")
    assert parsed(outcome.out)["accepted"] is None


def test_the_directory_holds_all_that_was_promised_and_nothing_half_written(flown):
    names = {path.name for path in flown.directory.iterdir()}
    pictures = {name for name in names if name.endswith(".png")}
    assert len(pictures) >= 3
    expected = {"summary.json", "report.html", "flight.npz", "lead.tlog", "wing.tlog"}
    assert names - pictures == expected
    for name in pictures:
        assert (flown.directory / name).read_bytes().startswith(b"\x89PNG")
    assert "<h1>pair</h1>" in (flown.directory / "report.html").read_text(encoding="utf-8")


def test_the_record_has_a_sample_for_each_step(flown):
    record = FlightRecord.load(flown.directory / "flight.npz")
    assert record.time_s.size == 20 * 20 + 1
    assert [vehicle.name for vehicle in record.vehicles] == ["lead", "wing"]


@pytest.mark.parametrize(("vehicle", "system_id"), [("lead", 1), ("wing", 2)])
def test_pymavlink_reads_both_directions_back_in_the_order_of_time(flown, vehicle, system_id):
    log = mavutil.mavlink_connection(str(flown.directory / f"{vehicle}.tlog"))
    messages, times = [], []
    while (message := log.recv_match()) is not None:
        messages.append(message)
        times.append(log.timestamp)
    log.close()
    counts = Counter(message.get_type() for message in messages)
    assert "BAD_DATA" not in counts
    assert counts["GLOBAL_POSITION_INT"] >= 20 * 18
    commands = [one for one in messages if one.get_type() == "COMMAND_INT"]
    assert sum(one.command == COURSE for one in commands) >= 300
    acknowledged = [one for one in messages if one.get_type() == "COMMAND_ACK"]
    assert any(one.command == COURSE and one.result == 0 for one in acknowledged)
    assert {one.get_srcSystem() for one in acknowledged} == {system_id}
    assert {one.target_system for one in commands} == {system_id}
    assert all(before <= after for before, after in pairwise(times))
    assert times[-1] - times[0] == pytest.approx(20.0, abs=0.5)


@pytest.mark.usefixtures("one_plot")
def test_a_directory_is_made_with_those_above_it(command, alone_with, tmp_path):
    directory = tmp_path / "a" / "b ü"
    outcome = command("fly", alone_with(), "--duration", 1, "--out", directory)
    assert outcome.status == 0
    assert outcome.out.endswith(f"report: {directory / 'report.html'}\n")
    assert (directory / "one.tlog").stat().st_size > 0


@pytest.mark.parametrize(
    ("place", "reason"), [("file", "it is a file"), ("file/below", "Not a directory")]
)
def test_a_directory_that_cannot_be_made_is_one_line_before_flying(
    refusal, alone_with, tmp_path, place, reason
):
    (tmp_path / "file").write_text("kept")
    assert refusal("fly", alone_with(), "--out", tmp_path / place) == (
        f"{tmp_path / place}: cannot be written to ({reason}); give another directory with --out"
    )
    assert (tmp_path / "file").read_text() == "kept"


def test_a_name_that_is_taken_by_a_directory_is_one_line(refusal, alone_with, tmp_path):
    taken = tmp_path / "one.tlog"
    taken.mkdir()
    line = refusal("fly", alone_with(), "--duration", 1, "--out", tmp_path)
    assert line == f"{taken}: is a directory; give another directory with --out"


@pytest.mark.usefixtures("one_plot")
def test_a_flight_takes_the_place_of_the_same_mission_and_of_nothing_else(
    command, refusal, alone_with, tmp_path
):
    out = tmp_path / "out"
    fly = ("fly", alone_with(), "--duration", 1, "--out", out)
    assert command(*fly).status == 0
    first = (out / "flight.npz").stat().st_ino
    (out / "notes.txt").write_text("mine")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("precious")
    (out / "tracks.png").unlink()
    (out / "tracks.png").symlink_to(elsewhere)
    assert command(*fly).status == 0
    assert (out / "flight.npz").stat().st_ino != first
    assert (out / "notes.txt").read_text() == "mine"
    assert elsewhere.read_text() == "precious"
    assert not (out / "tracks.png").is_symlink()
    assert not list(out.glob(".*"))

    summary = json.loads((out / "summary.json").read_text())
    (out / "summary.json").write_text(json.dumps({**summary, "mission": "another"}))
    (out / "old.tlog").write_text("another's, but of no vehicle of it")
    assert refusal(*fly) == f"{out}: holds a flight of the mission 'another'; {REMEDY}"
    assert command(*fly, "--force").status == 0
    assert json.loads((out / "summary.json").read_text())["mission"] == summary["mission"]


def test_a_disk_that_fills_up_is_one_line_with_path_and_remedy(
    command, alone_with, tmp_path, monkeypatch
):
    def full(_log: TelemetryLog, _path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(TelemetryLog, "write", full)
    out = tmp_path / "out"
    outcome = command("fly", alone_with(), "--duration", 1, "--out", out)
    assert outcome.status == 3
    assert outcome.lines[-1] == (
        f"{out}: No space left on device; make room there, or give another directory with --out"
    )


@pytest.mark.usefixtures("one_plot")
def test_what_a_broken_flight_left_is_kept_and_told(command, alone_with, tmp_path):
    left = tmp_path / ".partial-old"
    (left / "recordings").mkdir(parents=True)
    outcome = command("fly", alone_with(), "--duration", 1, "--out", tmp_path)
    assert outcome.status == 0
    told = f"{left}: left by a flight that did not end; remove it once nobody needs it"
    assert told in outcome.lines
    assert (left / "recordings").is_dir()
    assert list(tmp_path.glob(".partial-*")) == [left]


def test_what_no_flight_wrote_is_not_overwritten(refusal, alone_with, tmp_path):
    page = tmp_path / "report.html"
    page.write_text("mine")
    line = refusal("fly", alone_with(), "--duration", 1, "--out", tmp_path)
    assert line == f"{page}: is there already, and no flight has written it; {REMEDY}"
    assert page.read_text() == "mine"
    assert list(tmp_path.glob("*.tlog")) == []


def test_a_link_is_not_followed_out(refusal, alone_with, tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "real")
    line = refusal("fly", alone_with(), "--duration", 1, "--out", link)
    assert "is a symbolic link" in line
    assert list((tmp_path / "real").iterdir()) == []
