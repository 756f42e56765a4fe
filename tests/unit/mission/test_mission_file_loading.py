"""What a correct mission file means once it is read."""

import math
from pathlib import Path

import pytest

from vfguide.errors import InputError
from vfguide.mission import MissionError, load_mission, parse_mission, read_mission
from vfguide.mission.rehearsal import ArticleWind, CalmWind
from vfguide.mission.starts import follower_start, leader_start, path_beginning
from vfguide.paths.circle import CircleShape
from vfguide.paths.line import LineShape

FOLDER = Path(__file__).parents[3] / "missions"
MISSIONS = sorted(FOLDER.glob("*.yaml"))

CONTRACT_EXAMPLE = b"""
name: circle-wind
origin: {latitude_deg: 47.397742, longitude_deg: 8.545594, altitude_amsl_m: 488}
path: {type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 150, direction: clockwise, gain: 0.03}
leader: {vehicle: leader, airspeed_m_s: 20}
followers:
  - {vehicle: f1, slot: {forward_m: -20, right_m: -20, up_m: 0}}
  - {vehicle: f2, slot: {forward_m: -20, right_m: 20, up_m: 0}}
  - {vehicle: f3, slot: {forward_m: -40, right_m: 0, up_m: 0}}
vehicles:
  leader: {system_id: 1, alpha_1_s: 1.2, beta_1_s: 0.8, airspeed_range_m_s: [12, 32], max_bank_deg: 45}
  f1: {system_id: 2}
  f2: {system_id: 3}
  f3: {system_id: 4}
controller: {type: slot, k_x: 0.2, k_y: 0.2, chi_inf_deg: 45, v_inf_m_s: 8, kappa: 3, epsilon: 0.01}
wind: {type: article}          # what the emulator blows
rehearsal: {duration_s: 300, rate_hz: 20, start: {}, link_delay_s: 0, link_loss: 0, position_noise_m: 0}
acceptance: {mean_error_m: 0.3, settle_10m_s: 60}
"""

LEAST = b"""
name: alone
origin: {latitude_deg: 0, longitude_deg: 0, altitude_amsl_m: 0}
path: {type: line, course_deg: 90}
leader: {vehicle: one, airspeed_m_s: 20}
vehicles: {one: {system_id: 1}}
"""


def with_path(path: str) -> LineShape | CircleShape:
    content = LEAST.replace(b"{type: line, course_deg: 90}", path.encode())
    loaded = parse_mission(content, file="m.yaml").mission.path
    assert isinstance(loaded, LineShape | CircleShape)
    return loaded


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_a_shipped_mission_loads_under_the_name_of_its_file(file):
    assert load_mission(file).name == file.stem


def test_these_missions_are_shipped():
    assert [file.stem for file in MISSIONS] == [
        "aerosonde-gusts",
        "ardupilot-sitl",
        "circle-calm",
        "circle-wind",
        "climb-and-turn",
        "figure-eight",
        "foreign-leader",
        "leader-lost",
        "line-calm",
        "line-wind",
        "px4-sitl",
        "shapes",
        "survey-plan",
        "survey-racetrack",
        "transit-abreast",
    ]


def test_the_documented_example_loads():
    mission = parse_mission(CONTRACT_EXAMPLE, file="m.yaml").mission
    assert isinstance(mission.path, CircleShape)
    assert isinstance(mission.wind, ArticleWind)
    assert mission.leader_vehicle.airspeed_range_m_s == (12.0, 32.0)
    assert [one.slot.forward_m for one in mission.followers] == [-20.0, -20.0, -40.0]


def test_a_leader_alone_with_everything_else_left_out_is_a_mission():
    mission = parse_mission(LEAST, file="m.yaml").mission
    assert mission.followers == ()
    assert isinstance(mission.wind, CalmWind)
    assert (mission.rehearsal.rate_hz, mission.controller.kappa) == (20.0, 3.0)
    assert mission.height_above_origin_m == 100.0


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm():
    content = b"\xef\xbb\xbf" + LEAST.replace(b"\n", b"\r\n")
    assert parse_mission(content, file="m.yaml").mission.name == "alone"


def test_numbers_may_be_written_with_an_exponent_and_no_point():
    path = with_path("{type: line, course_deg: 9e1, gain: 3e-2}")
    assert isinstance(path, LineShape)
    assert (path.course_deg, path.gain) == (90.0, 0.03)


@pytest.mark.parametrize(
    ("fields", "east_m", "course_deg"),
    [
        ("slope: 1, intercept_m: 5", 5.0, 45.0),
        ("slope: 1, direction: backward", 0.0, 225.0),
        ("slope: 0", 0.0, 0.0),
        ("slope: -1", 0.0, 315.0),
    ],
)
def test_a_slope_and_an_intercept_stand_for_a_point_and_a_course(fields, east_m, course_deg):
    path = with_path(f"{{type: line, {fields}}}")
    assert isinstance(path, LineShape)
    assert path.point.east_m == east_m
    assert path.course_deg == pytest.approx(course_deg)


def test_each_field_is_found_on_its_line():
    source = read_mission(MISSIONS[0]).source
    lines = MISSIONS[0].read_text().splitlines()
    line = source.line_of(("vehicles", "f2", "system_id"))
    assert line is not None
    assert lines[line - 1].lstrip().startswith("f2:")
    assert source.line_of(("controller", "rho")) == source.line_of(("controller",))


def test_a_leader_begins_thirty_metres_right_of_its_path():
    mission = parse_mission(LEAST, file="m.yaml").mission
    start = leader_start(mission)
    assert (start.north_m, start.east_m) == pytest.approx((-30.0, 0.0))
    assert start.course_deg == 90.0


def test_a_circle_begins_where_it_passes_nearest_to_the_origin():
    path = with_path("{type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 100}")
    beginning = path_beginning(path)
    assert (beginning.north_m, beginning.east_m) == pytest.approx((50.0, 0.0))
    assert beginning.course_deg == pytest.approx(270.0)


def test_a_given_start_counts_from_the_slot_in_the_course_frame_of_the_leader():
    mission = load_mission(FOLDER / "circle-wind.yaml")
    start = follower_start(mission, "f1")
    # leader at (30, 0) flying west: 80 m behind is east of it, 70 m left is south
    assert (start.north_m, start.east_m) == pytest.approx((-40.0, 80.0))
    assert start.course_deg == 270.0


def test_default_starts_lie_out_of_place_and_no_closer_together_than_the_slots():
    mission = parse_mission(CONTRACT_EXAMPLE, file="m.yaml").mission
    leader = leader_start(mission)
    slots = {one.vehicle: one.slot for one in mission.followers}
    starts = {name: follower_start(mission, name) for name in slots}
    for name, slot in slots.items():
        place = leader.shifted(forward_m=slot.forward_m, right_m=slot.right_m)
        start = starts[name]
        away = math.dist((place.north_m, place.east_m), (start.north_m, start.east_m))
        assert 50.0 <= away <= 100.0
        for other, other_slot in slots.items():
            apart = math.dist(
                (start.north_m, start.east_m), (starts[other].north_m, starts[other].east_m)
            )
            in_formation = math.dist(
                (slot.forward_m, slot.right_m), (other_slot.forward_m, other_slot.right_m)
            )
            assert apart >= in_formation - 1e-9


def test_a_mission_cannot_be_changed_after_it_is_read():
    mission = parse_mission(LEAST, file="m.yaml").mission
    with pytest.raises(ValueError, match="frozen"):
        mission.name = "other"


def test_a_faulty_mission_is_an_input_error():
    assert issubclass(MissionError, InputError)


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_a_mission_that_comes_along_is_found_by_its_name_from_anywhere(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load_mission(Path(file.stem)) == load_mission(file)


def test_a_file_of_ones_own_goes_before_a_mission_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle-wind").write_bytes(LEAST)
    assert load_mission(Path("circle-wind")).name == "alone"
