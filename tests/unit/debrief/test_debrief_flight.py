"""A flight put together from what companions recorded, on computers whose clocks do not agree."""

import json
import math
import os
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from msgspec.structs import replace
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.missions import shipped
from tests.kit.wire import flown_position, packed
from vfguide.companion.mission_plan import local_frame
from vfguide.errors import InputError
from vfguide.lab.debrief.flight import flight_of
from vfguide.lab.debrief.recordings import FORMATION_CLOCK, TIME_OF_DAY, collect
from vfguide.lab.report.geometry import slot_error
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.replay.data import series_of
from vfguide.mission.model import Mission
from vfguide.record.events import HEADER as EVENTS_HEADER
from vfguide.record.events import FlightEvent, encode_event
from vfguide.record.guidance_log import HEADER, GuidanceStep, encode_step, read_guidance
from vfguide.record.latency import Percentiles
from vfguide.record.recording import RecordingStart, events_file, files_of
from vfguide.record.tlog import stamped

SPEED, LENGTH_S, RATE_HZ = 20.0, 30.0, 10.0
LATE_M = 3.0
"""How far f1 flies behind its slot."""

AGE_S = 0.125
"""How old the leader's states are that f1 flies by."""

FLOWN_S = 1_800_000_000.0
"""True time at which the flight begins, s since 1970."""


@pytest.fixture
def mission() -> Mission:
    return shipped("line-calm")


def moments() -> Iterator[float]:
    return (step / RATE_HZ for step in range(int(LENGTH_S * RATE_HZ)))


def write(
    parent: Path,
    mission: Mission,
    name: str,
    *,
    wrong_s: float,
    clock_s: float,
    formation_s: float,
) -> Path:
    """A recording of a vehicle of a formation that flies north at 20 m/s, a follower behind its slot.

    Args:
        wrong_s: how much its computer's time of day is ahead.
        clock_s: what its companion's clock shows at the beginning.
        formation_s: what the leader's shows then; NaN for not known.
    """
    system_id, behind_m, right_m = mission.vehicles[name].system_id, 0.0, 0.0
    if name in mission.followers_by_name:
        slot = mission.followers_by_name[name].slot
        behind_m, right_m = LATE_M - slot.forward_m, slot.right_m
    names = {"vehicle": name, "mission": mission.name, "computer": name, "program": "0"}
    clocks = {"unix_s": FLOWN_S + wrong_s, "clock_s": clock_s}
    start = RecordingStart(**names, system_id=system_id, **clocks)
    directory = parent / f"{name}-1"
    directory.mkdir()
    content = {"format": "vfguide-recording", "version": 1, **asdict(start)}
    (directory / "recording.json").write_text(json.dumps(content))
    text = yaml.safe_dump(mission.model_dump(mode="json", exclude_unset=True), sort_keys=False)
    (directory / "mission.yaml").write_text(text)
    sender = {"system_id": system_id, "component_id": 1}
    frame = local_frame(mission)
    tlog, guidance = bytearray(), bytearray(HEADER)
    for time_s in moments():
        place = frame.to_geodetic(SPEED * time_s - behind_m, right_m)
        position = flown_position(time_s + 5.0, place, north_m_s=SPEED)
        speed = mavlink.MAVLink_vfr_hud_message(SPEED, SPEED, 0, 50, 588.0, 0.0)
        tlog += stamped(start.unix_s + time_s, packed(position, speed, **sender))
        step = GuidanceStep(
            time_s=clock_s + time_s,
            mode="tracking",
            course_rad=0.0,
            speed_m_s=SPEED,
            limited=False,
            lyapunov_m2=math.nan,
            formation_time_s=formation_s + time_s,
            leader_age_s=0.0 if name == mission.leader.vehicle else AGE_S,
        )
        guidance += encode_step(step)
    for path, written in zip(files_of(directory, name), (tlog, guidance), strict=True):
        path.write_bytes(written)
    return directory


@pytest.fixture
def recordings(mission: Mission, tmp_path: Path) -> Path:
    write(tmp_path, mission, "leader", wrong_s=0.0, clock_s=100.0, formation_s=math.nan)
    write(tmp_path, mission, "f1", wrong_s=7.0, clock_s=900.0, formation_s=100.0)
    return tmp_path


def test_the_formations_clock_joins_computers_whose_time_of_day_differs(recordings):
    found = collect([recordings])
    assert found.clock == FORMATION_CLOCK
    record = flight_of(found)
    (follower,) = record.followers
    error = slot_error(record.leader, follower)
    # Positions are whole units of 1e-7 degrees, 11 mm.
    np.testing.assert_allclose(error.along_track_m, LATE_M, atol=0.03)
    np.testing.assert_allclose(error.cross_track_m, 0.0, atol=0.03)
    assert record.duration_s == pytest.approx(LENGTH_S, abs=0.3)
    assert "not the truth" in record.notes[0]
    assert "formation's clock" in record.notes[1]
    assert record.notes[2] == "Not recorded: f2, f3."


def test_what_companions_said_is_at_the_times_of_the_flight(recordings):
    # 20 s after the beginning by each clock: f1's shows 900 s then, the leader's 100 s.
    for name, clock_s in (("leader", 100.0), ("f1", 900.0)):
        fields = {"vehicle": name, "kind": "order", "text": "order 1 is understood"}
        said = FlightEvent(time_s=clock_s + 20.0, **fields)
        path = events_file(recordings / f"{name}-1", name)
        path.write_bytes(EVENTS_HEADER + encode_event(said, 120.0))
    record = flight_of(collect([recordings]))
    assert {event.vehicle for event in record.events} == {"leader", "f1"}
    first, second = (event.time_s for event in record.events)
    assert second - first == pytest.approx(0.0, abs=1e-6)
    assert first == pytest.approx(20.0, abs=0.11)


def test_after_an_order_to_leave_a_recording_has_no_slot_to_be_off(recordings):
    path = files_of(recordings / "f1-1", "f1")[1]
    steps = read_guidance(path).steps
    half = len(steps) // 2
    written = [replace(step, left=number >= half) for number, step in enumerate(steps)]
    path.write_bytes(HEADER + b"".join(encode_step(step) for step in written))
    record = flight_of(collect([recordings]))
    share = float(np.mean(record.followers[0].in_formation))
    assert share == pytest.approx(0.5, abs=0.05)
    # The window is the last half of the flight, of which it has no slot.
    assert np.isnan(slot_error(record.leader, record.followers[0]).distance_m[-1])


def test_a_recording_tells_how_old_the_leaders_states_were(recordings):
    record = flight_of(collect([recordings]))
    leader, follower = record.vehicles
    assert leader.leader_age_s is None
    assert follower.leader_age_s is not None
    middle = follower.leader_age_s[record.time_s.size // 2]
    assert middle == pytest.approx(AGE_S)
    assert record.latency is not None
    found = record.latency.vehicles["f1"].leader_age_ms
    assert found == Percentiles(p50=125.0, p99=125.0, max=125.0)
    assert "leader_age_s" in series_of(record, follower)
    assert "leader_age_s" not in series_of(record, leader)


def test_without_a_common_clock_the_page_says_what_that_costs(recordings):
    path = files_of(recordings / "f1-1", "f1")[1]
    path.write_bytes(HEADER)
    found = collect([recordings])
    assert found.clock == TIME_OF_DAY
    record = flight_of(found)
    # 7 s at 20 m/s.
    error = slot_error(record.leader, record.followers[0]).along_track_m
    assert np.nanmedian(error) == pytest.approx(LATE_M + 7.0 * SPEED, abs=0.1)
    assert any("time of day" in note for note in record.notes)


def test_a_recording_that_was_cut_off_counts_up_to_there(recordings):
    tlog, guidance = files_of(recordings / "f1-1", "f1")
    for path in (tlog, guidance):
        os.truncate(path, path.stat().st_size // 2 + 3)
    record = flight_of(collect([recordings]))
    known = np.isfinite(record.followers[0].north_m)
    assert known[: known.size // 2 - 5].all()
    assert not known[known.size // 2 + 15 :].any()
    summary = summarise(record)
    assert summary.formation.min_separation_m is not None
    # 3 m off its slot when it was last heard of, and so it stays.
    assert summary.formation.settle_10m_s is not None
    assert summary.formation.settle_1m_s is None
    log = mavutil.mavlink_connection(str(tlog))
    count = sum(1 for _ in iter(partial(log.recv_match, type="GLOBAL_POSITION_INT"), None))
    log.close()
    assert count == pytest.approx(LENGTH_S * RATE_HZ / 2, abs=2)


def test_recordings_of_two_missions_are_not_mixed(mission, recordings):
    path = recordings / "f1-1" / "mission.yaml"
    path.write_text(path.read_text().replace(f"name: {mission.name}", "name: another"))
    with pytest.raises(InputError, match="flew another mission than"):
        collect([recordings])


def test_without_the_leader_there_is_no_formation(recordings):
    with pytest.raises(InputError, match="no position of the leader 'leader' is recorded"):
        flight_of(collect([recordings / "f1-1"]))


@pytest.mark.parametrize("wrong_s", [1e9, -1e9])
def test_frames_that_are_years_from_their_start_are_left_out(recordings, wrong_s):
    path = recordings / "f1-1" / "recording.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "unix_s": content["unix_s"] + wrong_s}))
    record = flight_of(collect([recordings / "f1-1", recordings / "leader-1"]))
    assert record.duration_s < LENGTH_S
    assert "Not recorded: f2, f3." in record.notes


def test_a_log_of_something_else_is_named(recordings):
    path = files_of(recordings / "f1-1", "f1")[0]
    path.write_bytes(bytes(range(256)) * 40)
    told = f"{path}: no position of system 2 is in it: its autopilot was not heard, or the file is damaged"
    record = flight_of(collect([recordings]))
    assert "Not recorded: f2, f3." in record.notes
    assert [note for note in record.notes if note.startswith(told)]
    path = files_of(recordings / "leader-1", "leader")[0]
    path.write_bytes(b"")
    with pytest.raises(InputError, match="is damaged or another system's; the leader's is needed"):
        flight_of(collect([recordings]))


def test_a_leader_without_a_companion_is_where_its_follower_heard_it(tmp_path):
    mission = shipped("foreign-leader")
    directory = write(tmp_path, mission, "f1", wrong_s=7.0, clock_s=900.0, formation_s=900.0)
    frame = local_frame(mission)
    sender = {"system_id": mission.leader_vehicle.system_id, "component_id": 1}
    heard = bytearray()
    for time_s in moments():
        place = frame.to_geodetic(SPEED * time_s, 0.0)
        position = packed(flown_position(time_s + 77.0, place, north_m_s=SPEED), **sender)
        # It arrives when the mission says that it does: least_delay_s after it was sent.
        heard += stamped(FLOWN_S + 7.0 + time_s + 0.2, position)
    tlog, _ = files_of(directory, "f1")
    with tlog.open("ab") as file:
        file.write(heard)
    record = flight_of(collect([tmp_path]))
    assert [one.name for one in record.vehicles] == ["leader", "f1"]
    error = slot_error(record.leader, record.followers[0]).distance_m
    assert np.nanmean(error) == pytest.approx(LATE_M, abs=0.05)
    assert not np.isfinite(record.leader.course_setpoint_rad).any()
