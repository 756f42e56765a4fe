"""A flight put together from what companions recorded, or from autopilots' own logs, on one clock."""

import json
import math
import os
import struct
import tracemalloc
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.missions import content_of, shipped
from tests.kit.wire import flown_position, packed
from tests.unit.debrief import foreign_logs as foreign
from vfguide.companion.mission_plan import local_frame
from vfguide.errors import InputError
from vfguide.lab.debrief import autopilot_log
from vfguide.lab.debrief.flight import FORMATION_CLOCK, TIME_OF_DAY, collect, flight_of
from vfguide.lab.debrief.logged_flight import logged_flight, read_log, satellite_offsets
from vfguide.lab.debrief.paparazzi import from_utm
from vfguide.lab.debrief.ulog import roll_of
from vfguide.lab.report.figures import SlotError, slot_error
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.replay import series_of
from vfguide.mission.model import Mission
from vfguide.record.events import EVENTS, FlightEvent, encode_event
from vfguide.record.events import SUFFIX as EVENTS_SUFFIX
from vfguide.record.flight import FlightRecord
from vfguide.record.guidance_log import STEPS, GuidanceStep, encode_step, read_guidance
from vfguide.record.latency import Percentiles
from vfguide.record.recording import RecordingStart, files_of, part_of
from vfguide.record.tlog import TelemetryLog, stamped

SPEED, LENGTH_S, RATE_HZ = 20.0, 30.0, 10.0
LATE_M = 3.0
"""How far f1 flies behind its slot."""

AGE_S = 0.125
"""How old the leader's states are that f1 flies by."""

FLOWN_S = 1_800_000_000.0
"""True time at which the flight begins, s since 1970."""

EXAMPLES_IN_ONE_PLACE = settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture
def mission() -> Mission:
    return shipped("line-calm")


TIMES = tuple(step / RATE_HZ for step in range(int(LENGTH_S * RATE_HZ)))


def write(
    parent: Path, mission: Mission, name: str, *, wrong_s: float, clock_s: float, formation_s: float
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
    text = yaml.safe_dump(content_of(mission, "json"), sort_keys=False)
    (directory / "mission.yaml").write_text(text)
    frame, flown = local_frame(mission), {"mode": "tracking", "course_rad": 0.0, "speed_m_s": SPEED}
    age_s = 0.0 if name == mission.leader.vehicle else AGE_S
    flown |= {"limited": False, "lyapunov_m2": math.nan, "leader_age_s": age_s}
    tlog, guidance = bytearray(), bytearray(STEPS.header)
    for time_s in TIMES:
        place = frame.to_geodetic(SPEED * time_s - behind_m, right_m)
        position = flown_position(time_s + 5.0, place, north_m_s=SPEED)
        speed = mavlink.MAVLink_vfr_hud_message(SPEED, SPEED, 0, 50, 588.0, 0.0)
        sent = packed(position, speed, system_id=system_id, component_id=1)
        tlog += stamped(start.unix_s + time_s, sent)
        times = {"time_s": clock_s + time_s, "formation_time_s": formation_s + time_s}
        guidance += encode_step(GuidanceStep(**flown, **times))
    for path, written in zip(files_of(directory, name), (tlog, guidance), strict=True):
        path.write_bytes(written)
    return directory


def errors_of(record: FlightRecord) -> SlotError:
    """Where the only follower is beside its slot."""
    return slot_error(record.leader, record.followers[0])


def assert_five_metres_off(record: FlightRecord, within_m: float = 0.05) -> None:
    """See that the follower of the autopilots' logs is 5 m off its slot all the time."""
    assert np.nanmax(np.abs(errors_of(record).distance_m - 5.0)) < within_m


@pytest.fixture
def recordings(mission: Mission, tmp_path: Path) -> Path:
    write(tmp_path, mission, "leader", wrong_s=0.0, clock_s=100.0, formation_s=math.nan)
    write(tmp_path, mission, "f1", wrong_s=7.0, clock_s=900.0, formation_s=100.0)
    return tmp_path


def test_the_formations_clock_joins_computers_whose_time_of_day_differs(recordings):
    found = collect([recordings])
    assert found.clock == FORMATION_CLOCK
    record = flight_of(found)
    # Positions are whole units of 1e-7 degrees, 11 mm.
    np.testing.assert_allclose(errors_of(record).along_track_m, LATE_M, atol=0.03)
    np.testing.assert_allclose(errors_of(record).cross_track_m, 0.0, atol=0.03)
    assert record.duration_s == pytest.approx(LENGTH_S, abs=0.3)
    truth, clock, absent = record.notes[:3]
    assert "not the truth" in truth
    assert "formation's clock" in clock
    assert absent == "Not recorded: f2, f3."


def test_what_companions_said_is_at_the_times_of_the_flight(recordings):
    # 20 s after the beginning by each clock: f1's shows 900 s then, the leader's 100 s.
    for name, clock_s in (("leader", 100.0), ("f1", 900.0)):
        fields = {"vehicle": name, "kind": "order", "text": "order 1 is understood"}
        said = FlightEvent(time_s=clock_s + 20.0, **fields)
        path = part_of(recordings / f"{name}-1", name, EVENTS_SUFFIX)
        path.write_bytes(EVENTS.header + encode_event(said, 120.0))
    record = flight_of(collect([recordings]))
    assert {event.vehicle for event in record.events} == {"leader", "f1"}
    first, second = (event.time_s for event in record.events)
    assert second - first == pytest.approx(0.0, abs=1e-6)
    assert first == pytest.approx(20.0, abs=0.11)


def test_after_an_order_to_leave_a_recording_has_no_slot_to_be_off(recordings):
    path = files_of(recordings / "f1-1", "f1")[1]
    steps = read_guidance(path).steps
    written = [replace(one, left=at >= len(steps) // 2) for at, one in enumerate(steps)]
    path.write_bytes(STEPS.header + b"".join(encode_step(step) for step in written))
    record = flight_of(collect([recordings]))
    assert np.mean(record.followers[0].in_formation) == pytest.approx(0.5, abs=0.05)
    # The window is the last half of the flight, of which it has no slot.
    assert np.isnan(errors_of(record).distance_m[-1])


def test_a_recording_tells_how_old_the_leaders_states_were(recordings):
    record = flight_of(collect([recordings]))
    leader, follower = record.vehicles
    assert leader.leader_age_s is None
    assert follower.leader_age_s[record.time_s.size // 2] == pytest.approx(AGE_S)
    found = record.latency.vehicles["f1"].leader_age_ms
    assert found == Percentiles(p50=125.0, p99=125.0, max=125.0)
    assert "leader_age_s" in series_of(record, follower)
    assert "leader_age_s" not in series_of(record, leader)


def test_without_a_common_clock_the_page_says_what_that_costs(recordings):
    path = files_of(recordings / "f1-1", "f1")[1]
    path.write_bytes(STEPS.header)
    found = collect([recordings])
    assert found.clock == TIME_OF_DAY
    record = flight_of(found)
    # 7 s at 20 m/s.
    median = np.nanmedian(errors_of(record).along_track_m)
    assert median == pytest.approx(LATE_M + 7.0 * SPEED, abs=0.1)
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


def test_recordings_of_two_missions_are_not_mixed_and_without_the_leader_is_no_formation(
    recordings,
):
    with pytest.raises(InputError, match="no position of the leader 'leader' is recorded"):
        flight_of(collect([recordings / "f1-1"]))
    path = recordings / "f1-1" / "mission.yaml"
    path.write_text(path.read_text().replace("name: line-calm", "name: another"))
    with pytest.raises(InputError, match="flew another mission than"):
        collect([recordings])


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
    frame, sender = local_frame(mission), mission.leader_vehicle.system_id
    tlog, _ = files_of(directory, "f1")
    with tlog.open("ab") as file:
        for time_s in TIMES:
            place = frame.to_geodetic(SPEED * time_s, 0.0)
            position = flown_position(time_s + 77.0, place, north_m_s=SPEED)
            # It arrives when the mission says that it does: least_delay_s after it was sent.
            sent = packed(position, system_id=sender, component_id=1)
            file.write(stamped(FLOWN_S + 7.0 + time_s + 0.2, sent))
    record = flight_of(collect([tmp_path]))
    assert [one.name for one in record.vehicles] == ["leader", "f1"]
    assert np.nanmean(errors_of(record).distance_m) == pytest.approx(LATE_M, abs=0.05)
    assert not np.isfinite(record.leader.course_setpoint_rad).any()


@pytest.fixture
def logged() -> Mission:
    """A leader due north and a follower whose slot is 30 m behind and 10 m right of it."""
    content = {
        "name": "north",
        "origin": {"latitude_deg": 0.0, "longitude_deg": 8.0, "altitude_amsl_m": 0.0},
        "path": {"type": "line", "course_deg": 0.0, "gain": 0.02},
        "leader": {"vehicle": "lead", "airspeed_m_s": 20.0},
        "followers": [{"vehicle": "f1", "slot": {"forward_m": -30.0, "right_m": 10.0}}],
        "vehicles": {"lead": {"system_id": 1}, "f1": {"system_id": 2}},
    }
    return Mission.model_validate(content)


def flight_in(logged: Mission, paths: list[Path]) -> FlightRecord:
    logs = [log for path in paths for log in read_log(path, logged)]
    return logged_flight(logged, logs).record


@pytest.mark.parametrize("names", [("a.BIN", "b.BIN"), ("a.ulg", "b.ulg"), ("a.BIN", "b.ulg")])
def test_slot_errors_are_found_although_the_clocks_are_apart(logged, tmp_path, names):
    record = flight_in(logged, foreign.write_all(tmp_path, names))
    error = errors_of(record)
    # 27 m behind and 6 m right of the leader, where 30 and 10 m are its slot: 3 m ahead of it, 4 m left.
    assert np.nanmean(error.along_track_m) == pytest.approx(-3.0, abs=0.02)
    assert np.nanmean(error.cross_track_m) == pytest.approx(4.0, abs=0.02)
    assert_five_metres_off(record)


def dataflash_of_both(directory: Path, drift: float = 0.0, **options: Any) -> list[Path]:
    """ArduPilot's logs of the leader and its follower, whose clocks are apart and drift on."""
    leader, follower = paths = [directory / "a.BIN", directory / "b.BIN"]
    places = ({"north_m": 0.0, "east_m": 0.0}, {"north_m": -27.0, "east_m": 6.0})
    foreign.write_dataflash(leader, 1, boot_s=100.0, drift=drift, **places[0], **options)
    foreign.write_dataflash(follower, 2, boot_s=37.5, drift=-drift, **places[1], **options)
    return paths


def test_clocks_that_drift_apart_leave_no_error(logged, tmp_path):
    # Told of from the setpoints' beginning at 5 s to their end at 15 s, in a file of 240 s: by one offset for
    # all of it the clocks would be 0.1 s apart there, which are 2 m at 20 m/s.
    record = flight_in(logged, dataflash_of_both(tmp_path, 5e-4, duration_s=240.0))
    assert_five_metres_off(record, 0.1)


def test_a_receiver_that_did_not_know_the_leap_seconds_at_first_moves_nothing():
    own = np.arange(0.0, 100.0, 0.2)
    # For 20 s it is 3 s off.
    satellite = 1000.0 + own + np.where(own < 20.0, 3.0, 0.0)
    found = satellite_offsets(np.column_stack([own, satellite]))
    assert found[:, 1] == pytest.approx(1000.0)


@pytest.mark.parametrize("ending", [".BIN", ".ulg"])
def test_the_flight_is_the_guided_part_of_the_log_with_the_wind_that_the_ground_velocity_leaves(
    logged, tmp_path, ending
):
    record = flight_in(logged, foreign.write_all(tmp_path, ("a" + ending, "b" + ending)))
    leader = record.leader
    # Guided from 5 to 15 s, 2 s for which the last setpoint holds, and 5 s of margin.
    assert record.duration_s == pytest.approx(20.0, abs=0.1)
    assert record.begin_unix_s == pytest.approx(foreign.BEGIN_UNIX_S, abs=0.05)
    middle = record.time_s.size // 2
    assert record.mode_names[leader.mode[middle]] == "guided"
    assert record.mode_names[leader.mode[0]] == "not guided"
    assert leader.course_setpoint_rad[middle] == pytest.approx(0.1)
    # 22 m/s of equivalent airspeed where the true one is 1.05 times as much.
    assert leader.airspeed_setpoint_m_s[middle] == pytest.approx(23.1, abs=0.01)
    # North at 20 m/s over the ground; 21 m/s of true airspeed on a heading of 350°.
    north = 20.0 - 21.0 * math.cos(math.radians(10.0))
    east = 21.0 * math.sin(math.radians(10.0))
    assert np.nanmean(leader.wind_north_m_s) == pytest.approx(north, abs=1e-3)
    assert np.nanmean(leader.wind_east_m_s) == pytest.approx(east, abs=1e-3)
    assert np.nanmean(leader.bank_rad) == pytest.approx(math.radians(10.0), abs=1e-5)


@pytest.mark.parametrize("version", ["3.9", "4.0"])
def test_logs_of_older_arduplanes_are_read(logged, tmp_path, version):
    record = flight_in(logged, dataflash_of_both(tmp_path, version=version))
    assert_five_metres_off(record)
    # 100 m above the sea the standard atmosphere has 0.9904 of its density there: 20 m/s are 20.097.
    assert np.nanmean(record.leader.airspeed_m_s) == pytest.approx(20.097, abs=0.002)
    assert np.nanmean(record.leader.bank_rad) == pytest.approx(math.radians(10.0), abs=1e-5)


@pytest.mark.parametrize("weeks_off", [-1024, 1024])
def test_a_week_number_that_began_again_moves_nothing(logged, tmp_path, weeks_off):
    leader, follower = foreign.write_all(tmp_path, ("a.BIN", "b.BIN"))
    place = {"boot_s": 37.5, "north_m": -27.0, "east_m": 6.0}
    foreign.write_dataflash(follower, 2, **place, weeks_off=weeks_off)
    record = flight_in(logged, [leader, follower])
    assert_five_metres_off(record)
    assert record.begin_unix_s == pytest.approx(foreign.BEGIN_UNIX_S, abs=0.05)


def write_tlog(
    path: Path, leaps: Sequence[tuple[float, float]] = (), *, satellites: bool = False
) -> None:
    """Both vehicles' telemetry as one ground station writes it: 5 positions a second.

    Args:
        path: of the log.
        leaps: of the computer's clock: when, and by how much, s.
        satellites: whether the autopilots tell satellite time.
    """
    log = TelemetryLog(foreign.BEGIN_UNIX_S)
    for sample in range(101):
        time_s = sample / 5.0
        shown_s = time_s + sum(leap_s for when_s, leap_s in leaps if time_s >= when_s)
        for system_id, north_m, east_m in ((1, 0.0, 0.0), (2, -27.0, 6.0)):
            place = foreign.place(time_s, north_m, east_m)
            boot_s = time_s + 100.0 * system_id
            position = flown_position(boot_s, place, north_m_s=20.0, altitude_m=100.0)
            log.add(shown_s, packed(position, system_id=system_id, component_id=1))
            unix_us = round(1e6 * (foreign.BEGIN_UNIX_S + time_s)) if satellites else 0
            instant = mavlink.MAVLink_system_time_message(unix_us, round(1e3 * boot_s))
            log.add(shown_s, packed(instant, system_id=system_id, component_id=1))
    log.write(path)


@pytest.mark.parametrize("satellites", [False, True])
@EXAMPLES_IN_ONE_PLACE
@given(
    leaps=st.lists(
        st.tuples(st.floats(1.0, 19.0), st.floats(1.5, 5e8) | st.floats(-5e8, -1.5)), max_size=3
    )
)
@example(leaps=[])
@example(leaps=[(5.0, 1.5e8)])
def test_a_ground_stations_log_tells_of_all_vehicles_however_its_computers_clock_leapt(
    logged, tmp_path, satellites, leaps
):
    write_tlog(tmp_path / "a.tlog", leaps, satellites=satellites)
    record = flight_in(logged, [tmp_path / "a.tlog"])
    assert record.duration_s == pytest.approx(20.0, abs=0.2)
    assert np.all(np.isfinite(errors_of(record).distance_m[5:-5]))
    # Positions are told to 1.1 cm.
    assert_five_metres_off(record)
    assert satellites or leaps or any("the clock of the computer" in note for note in record.notes)


def test_a_pause_is_no_leap_of_a_clock_and_one_that_stands_still_is_told_by_the_computers(
    logged, tmp_path
):
    path = tmp_path / "a.tlog"

    def flight_at(times_s: Iterable[float], booted: float) -> FlightRecord:
        log = TelemetryLog(foreign.BEGIN_UNIX_S)
        for time_s in times_s:
            place = foreign.place(time_s, 0.0, 0.0)
            position = flown_position(booted * (60.0 + time_s), place, north_m_s=20.0)
            log.add(time_s, packed(position, system_id=1, component_id=1))
        log.write(path)
        return flight_in(logged, [path])

    paused = flight_at((*np.arange(0.0, 5.0, 0.2), *np.arange(35.0, 40.0, 0.2)), 1.0)
    assert paused.duration_s == pytest.approx(39.8, abs=0.1)
    assert paused.begin_unix_s == pytest.approx(foreign.BEGIN_UNIX_S, abs=0.01)
    assert flight_at(np.arange(0.0, 20.0, 0.2), 0.0).duration_s == pytest.approx(19.8, abs=0.1)


def test_a_companions_log_tells_what_it_asked_for(logged, tmp_path):
    log = TelemetryLog(foreign.BEGIN_UNIX_S)
    for time_s, number, kind, value, sender in (
        # A course of 350 degrees alone is no setpoint yet; 0 is the type of a course, and of an airspeed.
        (1.0, 43002, 0, 350.0, (1, 191)),
        (1.5, 43000, 0, 21.0, (1, 191)),
        (2.0, 43002, 0, 90.0, (1, 191)),
        (2.5, 178, 0, 22.0, (1, 191)),
        # A ground speed, another command, a ground station's command, another vehicle's companion.
        (3.0, 178, 1, 30.0, (1, 191)),
        (3.5, 43001, 0, 100.0, (1, 191)),
        (4.0, 43002, 0, 10.0, (255, 190)),
        (4.5, 43002, 0, 10.0, (2, 191)),
    ):
        fields = (sender[0], 1, 0, number, 0, 0, kind, value, 0, 0, 0, 0, 0.0)
        message = mavlink.MAVLink_command_int_message(*fields)
        # The autopilot has been running for a minute.
        position = flown_position(60.0 + time_s, (0.0, 8.0), north_m_s=20.0)
        log.add(time_s, packed(position, system_id=1, component_id=1))
        log.add(time_s, packed(message, system_id=sender[0], component_id=sender[1]))
    log.write(tmp_path / "a.tlog")
    (found,) = read_log(tmp_path / "a.tlog", logged)
    told = [(time_s, math.degrees(course), speed) for time_s, course, speed in found.setpoints]
    wanted = [(61.5, -10.0, 21.0), (62.0, 90.0, 21.0), (62.5, 90.0, 22.0)]
    assert np.array(told) == pytest.approx(np.array(wanted), abs=1e-5)


def test_the_roll_of_an_attitude_is_the_right_wing_down():
    half = math.radians(15.0)
    (roll,) = roll_of(np.array([[math.cos(half), math.sin(half), 0.0, 0.0]]))
    assert roll == pytest.approx(2.0 * half)


def test_a_log_without_satellite_time_stands_alone_only(logged, tmp_path):
    leader, follower = foreign.write_all(tmp_path, ("a.ulg", "b.ulg"))
    foreign.write_ulog(leader, 1, boot_s=3.0, north_m=0.0, east_m=0.0, satellites=False)
    assert flight_in(logged, [leader]).begin_unix_s is None
    with pytest.raises(InputError, match=r"a\.ulg: tells no satellite time"):
        flight_in(logged, [leader, follower])


def test_rows_that_are_left_out_are_told_once_for_each_log(logged, tmp_path, monkeypatch):
    paths = foreign.write_all(tmp_path, ("a.BIN", "b.ulg"))
    whole = flight_in(logged, paths)
    monkeypatch.setattr(autopilot_log, "MOST_ROWS", 500)
    told = set(flight_in(logged, paths).notes) - set(whole.notes)
    assert told == {
        f"Only the first 500 rows of {path.name} are read: what came later is left out."
        for path in paths
    }


def test_logs_that_are_not_one_of_each_vehicle_are_refused(logged, tmp_path):
    leader, follower = foreign.write_all(tmp_path, ("a.BIN", "b.BIN"))
    other = tmp_path / "c.BIN"
    foreign.write_dataflash(other, 77, boot_s=0.0, north_m=0.0, east_m=0.0)
    for paths, words in (
        ([leader, leader], "one log for each vehicle"),
        ([follower], "leader 'lead'"),
        ([other], "system 77, which no vehicle of the mission 'north' has"),
        ([tmp_path / "a.log"], r"\.bin, \.ulg, \.tlog, \.csv"),
    ):
        with pytest.raises(InputError, match=words):
            flight_in(logged, paths)


@pytest.mark.parametrize("name", ["a.BIN", "a.ulg", "a.tlog"])
@pytest.mark.parametrize(
    "content", [b"", b"PK\x03\x04 this is a zip", b"\xa3\x95\x80" * 100, bytes(5_000_000)]
)
def test_something_else_is_one_line_and_prints_nothing(logged, tmp_path, name, content, capfd):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_log(tmp_path / name, logged)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("ending", ["BIN", "ulg", "tlog"])
def test_a_log_that_is_too_large_is_not_read_nor_a_pipe_waited_for(logged, tmp_path, ending):
    large, pipe = tmp_path / f"large.{ending}", tmp_path / f"pipe.{ending}"
    large.touch()
    os.truncate(large, 3 * 1024**3)
    os.mkfifo(pipe)
    for path, words in ((large, r"GB|MB"), (pipe, "pipe")):
        with pytest.raises(InputError, match=words):
            read_log(path, logged)


def write_paparazzi(path: Path, north_m: float, east_m: float, *, zone: int | None = None) -> None:
    """The same flight as Paparazzi exports it, every GPS fix in two rows; in UTM if a zone is given."""
    begin_s = foreign.BEGIN_UNIX_S - foreign.GPS_EPOCH_UNIX_S + foreign.LEAP_S
    places = (
        "GPS_lat(deg) GPS_long(deg)" if zone is None else "GPS:utm_zone GPS:utm_east GPS:utm_north"
    )
    columns = f"Time UTC GPS:course {places} ATTITUDE:phi GPS:alt GPS:speed GPS:itow GPS:week"
    lines = [columns.replace(" ", "\t")]
    for row in range(200):
        time_s, fix_s = row / 10.0, row // 2 / 5.0
        week, second = divmod(begin_s + fix_s, 604_800.0)
        latitude, longitude = foreign.place(fix_s, north_m, east_m)
        # Near the equator and the middle of zone 32: 0.9996 of the distances on the ellipsoid.
        utm_north = 0.9996 * latitude * foreign.METRES_OF_A_DEGREE * (1.0 - 0.00669438)
        utm_east = 500e3 + 0.9996 * (longitude - 9.0) * foreign.METRES_OF_A_DEGREE
        place = f"{latitude:.9f}\t{longitude:.9f}"
        if zone is not None:
            place = f"{zone}\t{100 * utm_east:.0f}\t{100 * utm_north:.0f}"
        seen = f"{place}\t0.17\t100000\t2000\t{1e3 * second:.0f}\t{week:.0f}"
        lines.append(f"{7.0 + time_s:.3f}\t12:00:00.0\t0\t{seen}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.parametrize("separator", ["\t", ";", ","])
def test_exports_of_paparazzi_are_joined_by_satellite_time(logged, tmp_path, separator):
    paths = [tmp_path / "lead.csv", tmp_path / "f1.csv"]
    for path, place in zip(paths, ((0.0, 0.0), (-27.0, 6.0)), strict=True):
        write_paparazzi(path, *place)
        path.write_text(path.read_text(encoding="utf-8").replace("\t", separator), encoding="utf-8")
    record = flight_in(logged, paths)
    assert_five_metres_off(record)
    assert record.begin_unix_s == pytest.approx(foreign.BEGIN_UNIX_S, abs=0.01)
    assert np.nanmean(record.leader.ground_speed_m_s) == pytest.approx(20.0)
    assert np.nanmean(record.leader.bank_rad) == pytest.approx(0.17)


# Zone 32's middle is 9 degrees east; a metre on it is 0.9996 m there. 1 degree north of the equator is
# 110,574.4 m on the ellipsoid. Heidelberg is 478,236 E, 5,471,906 N of zone 32 within some metres.
@pytest.mark.parametrize(
    ("east", "north", "northern", "place", "within"),
    [
        (500e3, 0.9996 * 110_574.4, True, (1.0, 9.0), 1e-6),
        (500e3, 1e7 - 0.9996 * 110_574.4, False, (-1.0, 9.0), 1e-6),
        (478_236.0, 5_471_906.0, True, (49.4, 8.7), 1e-3),
    ],
)
def test_utm_is_turned_into_degrees(east, north, northern, place, within):
    assert from_utm(east, north, 32, northern=northern) == pytest.approx(place, abs=within)


def test_an_export_of_paparazzi_in_utm_is_read_and_one_that_names_no_vehicle_says_how(
    logged, tmp_path
):
    write_paparazzi(tmp_path / "lead.csv", 0.0, 0.0, zone=32)
    (log,) = read_log(tmp_path / "lead.csv", logged)
    # At one degree from the middle of the zone the plane is off by less than 1e-4 of the distance from it.
    assert log.telemetry.positions[0, 1:3] == pytest.approx((0.0, 8.0), abs=1e-4)
    write_paparazzi(tmp_path / "flight.csv", 0.0, 0.0)
    named = r"name the file after the vehicle, such as lead\.csv, f1\.csv"
    with pytest.raises(InputError, match=named):
        read_log(tmp_path / "flight.csv", logged)


@pytest.mark.parametrize("ending", ["BIN", "ulg", "csv"])
@EXAMPLES_IN_ONE_PLACE
@given(damage=st.lists(st.tuples(st.integers(0, 20_000), st.binary(max_size=8)), max_size=8))
# In the ULog this makes a number of it a signalling NaN.
@example(damage=[(5519, b"\x7f")])
def test_damage_is_one_line_or_is_skipped(logged, tmp_path, ending, damage):
    path = tmp_path / f"lead.{ending}"
    if ending == "csv":
        write_paparazzi(path, 0.0, 0.0)
    else:
        foreign.write_all(tmp_path, (path.name, f"other.{ending}"))
    content = bytearray(path.read_bytes()[:20_000])
    for where, what in damage:
        content[where : where + len(what)] = what
    path.write_bytes(content)
    with suppress(InputError):
        for log in read_log(path, logged):
            assert np.all(np.diff(log.telemetry.positions[:, 0]) >= 0.0)


def ulog_of_formats(path: Path, *formats: str) -> None:
    """A log that describes some topics, and has one message of the first."""
    content = bytearray(b"ULog\x01\x12\x35\x01" + bytes(8))
    entries = [(b"F", one.encode()) for one in formats]
    name = formats[0].partition(":")[0].encode()
    for kind, body in (*entries, (b"A", bytes(3) + name), (b"D", bytes(60))):
        content += struct.pack("<Hc", len(body), kind) + body
    path.write_bytes(content)


@pytest.mark.parametrize(
    "formats",
    [
        # Each of twelve topics holds the next two hundred times over.
        [
            "vehicle_global_position:uint64_t timestamp;t0 x;double lat;double lon;float alt;",
            *(f"t{one}:t{one + 1}[100] a;t{one + 1}[100] b;" for one in range(12)),
            "t12:uint8_t a;",
        ],
        ["vehicle_attitude:uint64_t timestamp;float[900000] q;"],
        ["vehicle_attitude:vehicle_attitude[2] a;uint64_t timestamp;float[4] q;"],
    ],
)
def test_a_small_log_that_describes_something_vast_takes_no_memory(logged, tmp_path, formats):
    ulog_of_formats(tmp_path / "a.ulg", *formats)
    tracemalloc.start()
    with pytest.raises(InputError, match="tells no system id"):
        read_log(tmp_path / "a.ulg", logged)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1e6
