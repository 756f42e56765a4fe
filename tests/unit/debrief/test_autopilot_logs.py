"""What autopilots' own logs tell of a flight: places, wind and slot errors, on one clock."""

import importlib.util
import math
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import flown_position, packed
from vfguide.errors import InputError
from vfguide.lab.debrief.autopilot_log import AutopilotLog
from vfguide.lab.debrief.dataflash import read_dataflash
from vfguide.lab.debrief.logged_flight import logged_flight, read_log, satellite_offsets
from vfguide.lab.debrief.telemetry import read_setpoints
from vfguide.lab.debrief.ulog import read_ulog, roll_of
from vfguide.lab.report.geometry import slot_error
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.tlog import TelemetryLog

Reader = Callable[[Path], AutopilotLog]


def helper(name: str) -> ModuleType:
    """A module beside this test."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules.setdefault(name, importlib.util.module_from_spec(spec))
    spec.loader.exec_module(module)
    return module


foreign = helper("foreign_logs")


@pytest.fixture
def mission() -> Mission:
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


def flight_in(mission: Mission, paths: list[Path]) -> FlightRecord:
    logs = [log for path in paths for log in read_log(path, mission)]
    return logged_flight(mission, logs).record


@pytest.mark.parametrize("names", [("a.BIN", "b.BIN"), ("a.ulg", "b.ulg"), ("a.BIN", "b.ulg")])
def test_slot_errors_are_found_although_the_clocks_are_apart(mission, tmp_path, names):
    record = flight_in(mission, foreign.write_all(tmp_path, names))
    error = slot_error(record.leader, record.followers[0])
    # 27 m behind and 6 m right of the leader, where 30 and 10 m are its slot: 3 m ahead of it, 4 m left.
    assert np.nanmean(error.along_track_m) == pytest.approx(-3.0, abs=0.02)
    assert np.nanmean(error.cross_track_m) == pytest.approx(4.0, abs=0.02)
    assert np.nanmax(np.abs(error.distance_m - 5.0)) < 0.05


def test_clocks_that_drift_apart_leave_no_error(mission, tmp_path):
    paths = [tmp_path / "a.BIN", tmp_path / "b.BIN"]
    leader = {"boot_s": 100.0, "north_m": 0.0, "east_m": 0.0, "drift": 5e-4}
    follower = {"boot_s": 37.5, "north_m": -27.0, "east_m": 6.0, "drift": -5e-4}
    for number, place in enumerate((leader, follower)):
        foreign.write_dataflash(paths[number], number + 1, **place, duration_s=240.0)
    # Told of from the setpoints' beginning at 5 s to their end at 15 s, in a file of 240 s: by one offset for
    # all of it the clocks would be 0.1 s apart there, which are 2 m at 20 m/s.
    error = slot_error((record := flight_in(mission, paths)).leader, record.followers[0])
    assert np.nanmax(np.abs(error.distance_m - 5.0)) < 0.1


def test_a_receiver_that_did_not_know_the_leap_seconds_at_first_moves_nothing():
    own = np.arange(0.0, 100.0, 0.2)
    # For 20 s it is 3 s off.
    satellite = 1000.0 + own + np.where(own < 20.0, 3.0, 0.0)
    found = satellite_offsets(np.column_stack([own, satellite]))
    assert found[:, 1] == pytest.approx(1000.0)


@pytest.mark.parametrize("ending", [".BIN", ".ulg"])
def test_the_flight_is_the_guided_part_of_the_log(mission, tmp_path, ending):
    record = flight_in(mission, foreign.write_all(tmp_path, ("a" + ending, "b" + ending)))
    # Guided from 5 to 15 s, 2 s for which the last setpoint holds, and 5 s of margin.
    assert record.duration_s == pytest.approx(20.0, abs=0.1)
    assert record.begin_unix_s == pytest.approx(foreign.BEGIN_UNIX_S, abs=0.05)
    middle = record.time_s.size // 2
    assert record.mode_names[record.leader.mode[middle]] == "guided"
    assert record.mode_names[record.leader.mode[0]] == "not guided"
    assert record.leader.course_setpoint_rad[middle] == pytest.approx(0.1)
    # 22 m/s of equivalent airspeed where the true one is 1.05 times as much.
    assert record.leader.airspeed_setpoint_m_s[middle] == pytest.approx(23.1, abs=0.01)


@pytest.mark.parametrize("ending", [".BIN", ".ulg"])
def test_wind_is_what_airspeed_and_heading_leave_of_the_ground_velocity(mission, tmp_path, ending):
    record = flight_in(mission, foreign.write_all(tmp_path, ("a" + ending, "b" + ending)))
    leader = record.leader
    # North at 20 m/s over the ground; 21 m/s of true airspeed on a heading of 350°.
    north = 20.0 - 21.0 * math.cos(math.radians(10.0))
    east = 21.0 * math.sin(math.radians(10.0))
    assert np.nanmean(leader.wind_north_m_s) == pytest.approx(north, abs=1e-3)
    assert np.nanmean(leader.wind_east_m_s) == pytest.approx(east, abs=1e-3)
    assert np.nanmean(leader.bank_rad) == pytest.approx(math.radians(10.0), abs=1e-5)


def write_tlog(path: Path) -> None:
    """Both vehicles' telemetry as one ground station writes it: 5 positions a second."""
    log = TelemetryLog(foreign.BEGIN_UNIX_S)
    for sample in range(101):
        time_s = sample / 5.0
        for system_id, north_m, east_m in ((1, 0.0, 0.0), (2, -27.0, 6.0)):
            place = foreign.place(time_s, north_m, east_m)
            position = flown_position(time_s, place, north_m_s=20.0, altitude_m=100.0)
            log.add(time_s, packed(position, system_id=system_id, component_id=1))
    log.write(path)


def test_a_ground_stations_log_tells_of_all_vehicles(mission, tmp_path):
    write_tlog(tmp_path / "a.tlog")
    record = flight_in(mission, [tmp_path / "a.tlog"])
    error = slot_error(record.leader, record.followers[0])
    # Positions are told to 1.1 cm.
    assert np.nanmax(np.abs(error.distance_m - 5.0)) < 0.05
    assert any("the clock of the computer" in note for note in record.notes)


def test_a_companions_log_tells_what_it_asked_for(tmp_path):
    log = TelemetryLog(foreign.BEGIN_UNIX_S)

    def command(
        time_s: float, number: int, *parameters: float, sender: tuple[int, int] = (1, 191)
    ) -> None:
        system_id, component = sender
        padded = (*parameters, *(0.0,) * (4 - len(parameters)))
        fields = (system_id, 1, 0, number, 0, 0, *padded, 0, 0, 0.0)
        message = mavlink.MAVLink_command_int_message(*fields)
        log.add(time_s, packed(message, system_id=system_id, component_id=component))

    # A course of 350 degrees alone is no setpoint yet; 0 is the type of a course, and of an airspeed.
    command(1.0, 43002, 0, 350.0)
    command(1.5, 43000, 0, 21.0)
    command(2.0, 43002, 0, 90.0)
    command(2.5, 178, 0, 22.0)
    # A ground speed, another command, a ground station's command, another vehicle's companion.
    command(3.0, 178, 1, 30.0)
    command(3.5, 43001, 0, 100.0)
    command(4.0, 43002, 0, 10.0, sender=(255, 190))
    command(4.5, 43002, 0, 10.0, sender=(2, 191))
    log.write(tmp_path / "a.tlog")
    begin = foreign.BEGIN_UNIX_S
    found = read_setpoints(tmp_path / "a.tlog", system_id=1, start_s=begin)
    told = [(time_s - begin, math.degrees(course), speed) for time_s, course, speed in found]
    wanted = [(1.5, -10.0, 21.0), (2.0, 90.0, 21.0), (2.5, 90.0, 22.0)]
    assert np.array(told) == pytest.approx(np.array(wanted), abs=1e-5)


def test_the_roll_of_an_attitude_is_the_right_wing_down():
    half = math.radians(15.0)
    (roll,) = roll_of(np.array([[math.cos(half), math.sin(half), 0.0, 0.0]]))
    assert roll == pytest.approx(2.0 * half)


def test_a_log_without_satellite_time_stands_alone_only(mission, tmp_path):
    leader, follower = foreign.write_all(tmp_path, ("a.ulg", "b.ulg"))
    foreign.write_ulog(leader, 1, boot_s=3.0, north_m=0.0, east_m=0.0, satellites=False)
    assert flight_in(mission, [leader]).begin_unix_s is None
    with pytest.raises(InputError, match=r"a\.ulg: tells no satellite time"):
        flight_in(mission, [leader, follower])


def test_a_log_of_somebody_else_is_refused(mission, tmp_path):
    path = tmp_path / "a.BIN"
    foreign.write_dataflash(path, 77, boot_s=0.0, north_m=0.0, east_m=0.0)
    with pytest.raises(InputError, match="system 77, which no vehicle of the mission 'north' has"):
        read_log(path, mission)


def test_two_logs_of_one_vehicle_are_refused(mission, tmp_path):
    path, _ = foreign.write_all(tmp_path, ("a.BIN", "b.BIN"))
    with pytest.raises(InputError, match="one log for each vehicle"):
        flight_in(mission, [path, path])


def test_the_leaders_log_is_needed(mission, tmp_path):
    _, follower = foreign.write_all(tmp_path, ("a.BIN", "b.BIN"))
    with pytest.raises(InputError, match="leader 'lead'"):
        flight_in(mission, [follower])


@pytest.mark.parametrize("name", ["a.BIN", "a.ulg", "a.tlog"])
@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 this is a zip", b"\xa3\x95\x80" * 100])
def test_something_else_is_one_line(mission, tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_log(path, mission)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


@pytest.mark.parametrize("name", ["a.BIN", "a.ulg", "a.tlog"])
def test_a_log_that_is_too_large_is_not_read(mission, tmp_path, name):
    path = tmp_path / name
    path.touch()
    os.truncate(path, 3 * 1024**3)
    with pytest.raises(InputError, match=r"GB|MB"):
        read_log(path, mission)


@pytest.mark.parametrize("name", ["a.BIN", "a.ulg", "a.tlog"])
def test_a_pipe_is_not_waited_for(mission, tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="pipe"):
        read_log(tmp_path / name, mission)


def test_another_ending_is_refused(mission, tmp_path):
    with pytest.raises(InputError, match=r"\.bin, \.ulg, \.tlog"):
        read_log(tmp_path / "a.log", mission)


@pytest.mark.parametrize(("ending", "read"), [(".BIN", read_dataflash), (".ulg", read_ulog)])
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(damage=st.lists(st.tuples(st.integers(0, 20_000), st.binary(max_size=8)), max_size=8))
# In the ULog this makes a number of it a signalling NaN.
@example(damage=[(5519, b"\x7f")])
def test_damage_is_one_line_or_is_skipped(tmp_path, ending, read, damage):
    path, _ = foreign.write_all(tmp_path, ("a" + ending, "b" + ending))
    content = bytearray(path.read_bytes()[:20_000])
    for where, what in damage:
        content[where : where + len(what)] = what
    path.write_bytes(content)
    with suppress(InputError):
        log = read(path)
        assert np.all(np.diff(log.telemetry.positions[:, 0]) >= 0.0)
