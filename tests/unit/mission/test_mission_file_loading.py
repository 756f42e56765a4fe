"""What a correct mission file means once read, what it shares, and the schema that is shipped."""

import json
import math
import time
from itertools import combinations
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.missions import LEAST, MISSION_FILES, MISSIONS, faults_of, loaded, shipped
from vfguide.mission import MissionError, load_mission, read_mission
from vfguide.mission.feasibility import follower_start, leader_start
from vfguide.mission.rehearsal import ArticleWind, CalmWind
from vfguide.mission.schema import SCHEMA_FILE, mission_schema, schema_text
from vfguide.mission.yaml_tree import read_tree
from vfguide.paths.circle import CircleShape
from vfguide.paths.line import LineShape

CONTRACT_EXAMPLE = """
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


def with_path(path: str) -> LineShape | CircleShape:
    return loaded(LEAST.replace("{type: line, course_deg: 90}", path)).mission.path


def test_these_missions_are_shipped():
    names = """
        aerosonde-gusts ardupilot-sitl circle-calm circle-wind climb-and-turn figure-eight
        foreign-leader leader-lost line-calm line-wind px4-sitl shapes survey-plan survey-racetrack
        transit-abreast
    """
    assert [file.stem for file in MISSION_FILES] == names.split()


def test_the_documented_example_loads():
    mission = loaded(CONTRACT_EXAMPLE).mission
    assert isinstance(mission.path, CircleShape)
    assert isinstance(mission.wind, ArticleWind)
    assert mission.leader_vehicle.airspeed_range_m_s == (12.0, 32.0)
    assert [one.slot.forward_m for one in mission.followers] == [-20.0, -20.0, -40.0]


def test_a_leader_alone_with_everything_else_left_out_is_a_mission_that_cannot_be_changed():
    mission = loaded(LEAST).mission
    assert mission.followers == ()
    assert isinstance(mission.wind, CalmWind)
    assert (mission.rehearsal.rate_hz, mission.controller.kappa) == (20.0, 3.0)
    assert mission.height_above_origin_m == 100.0
    patience = {"telemetry_s": 1.0, "leader_s": 0.6, "prediction_s": 30.0, "breakaway_s": 25.0}
    assert mission.patience.model_dump().items() >= patience.items()
    with pytest.raises(ValueError, match="frozen"):
        mission.name = "other"


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm():
    content = b"\xef\xbb\xbf" + LEAST.replace("\n", "\r\n").encode()
    assert loaded(content).mission.name == "alone"


def test_numbers_may_be_written_with_an_exponent_and_no_point():
    path = with_path("{type: line, course_deg: 9e1, gain: 3e-2}")
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
    assert path.point.east_m == east_m
    assert path.course_deg == pytest.approx(course_deg)


def test_each_field_is_found_on_its_line():
    source = read_mission(MISSION_FILES[0]).source
    lines = MISSION_FILES[0].read_text().splitlines()
    line = source.line_of(("vehicles", "f2", "system_id"))
    assert lines[line - 1].lstrip().startswith("f2:")
    assert source.line_of(("controller", "rho")) == source.line_of(("controller",))


@pytest.mark.parametrize(
    ("path", "north_m", "east_m", "course_deg"),
    [
        ("{type: line, course_deg: 90}", -30.0, 0.0, 90.0),
        # Where it passes nearest to the origin, 50 m north of it, and flies west.
        ("{type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 100}", 80.0, 0.0, 270.0),
    ],
)
def test_a_leader_begins_thirty_metres_right_of_its_path(path, north_m, east_m, course_deg):
    start = leader_start(loaded(LEAST.replace("{type: line, course_deg: 90}", path)).mission)
    assert (start.north_m, start.east_m) == pytest.approx((north_m, east_m))
    assert start.course_deg == pytest.approx(course_deg)


def test_a_given_start_counts_from_the_slot_in_the_course_frame_of_the_leader():
    mission = shipped("circle-wind")
    start = follower_start(mission, "f1")
    # leader at (30, 0) flying west: 80 m behind is east of it, 70 m left is south
    assert (start.north_m, start.east_m) == pytest.approx((-40.0, 80.0))
    assert start.course_deg == 270.0


def test_default_starts_lie_out_of_place_and_no_closer_together_than_the_slots():
    mission = loaded(CONTRACT_EXAMPLE).mission
    leader = leader_start(mission)
    pairs = []
    for one in mission.followers:
        slot = leader.shifted(forward_m=one.slot.forward_m, right_m=one.slot.right_m)
        start = follower_start(mission, one.vehicle)
        pairs.append([(place.north_m, place.east_m) for place in (slot, start)])
        assert 50.0 <= math.dist(*pairs[-1]) <= 100.0
    for (slot, start), (other_slot, other_start) in combinations(pairs, 2):
        assert math.dist(start, other_start) >= math.dist(slot, other_slot) - 1e-9


@pytest.mark.parametrize("file", MISSION_FILES, ids=lambda file: file.stem)
def test_a_shipped_mission_is_found_by_its_name_and_outlasts_twenty_seconds_of_silence(
    file, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    mission = load_mission(Path(file.stem))
    assert mission == load_mission(file)
    assert mission.name == file.stem
    assert mission.patience.prediction_s > 20.0


def test_a_file_of_ones_own_goes_before_a_mission_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle-wind").write_text(LEAST)
    assert load_mission(Path("circle-wind")).name == "alone"


def test_the_patience_that_is_given_counts_and_the_rest_is_as_usual():
    patience = loaded(f"{LEAST}patience: {{prediction_s: 5, breakaway_s: 0}}").mission.patience
    assert (patience.leader_s, patience.prediction_s, patience.breakaway_s) == (0.6, 5.0, 0.0)


@pytest.mark.parametrize(
    ("field", "values"),
    [
        *(("telemetry_s", "0"), ("leader_s", "0 -1"), ("prediction_s", "0 3600.1 .inf")),
        *(("breakaway_s", "-0.1 3601 .nan '5'"), ("patient", "3")),
    ],
)
def test_a_patience_that_cannot_be_had_is_refused_by_name(field, values):
    for value in values.split():
        with pytest.raises(MissionError, match=rf"patience\.{field}"):
            loaded(f"{LEAST}patience: {{{field}: {value}}}")


@pytest.mark.parametrize("file", MISSION_FILES, ids=lambda file: file.stem)
def test_a_shipped_mission_satisfies_the_schema_and_names_it(file):
    text = file.read_text(encoding="utf-8")
    assert text.startswith(f"# yaml-language-server: $schema={SCHEMA_FILE}\n")
    jsonschema.validate(yaml.safe_load(text), json.loads(schema_text()))


def test_the_schema_refuses_a_misspelt_field():
    mission = yaml.safe_load(MISSION_FILES[0].read_text(encoding="utf-8"))
    mission["controller"]["kapa"] = mission["controller"].pop("kappa")
    with pytest.raises(jsonschema.ValidationError, match="kapa"):
        jsonschema.validate(mission, mission_schema())


def undescribed(node: object, place: str = "") -> list[str]:
    if not isinstance(node, dict):
        return []
    fields = node.get("properties", {}).items()
    bare = [f"{place}/{name}" for name, field in fields if "description" not in field]
    inner = (undescribed(one, f"{place}/{name}") for name, one in node.items())
    return sum(inner, bare)


def test_the_shipped_schema_is_valid_and_the_one_the_model_amounts_to_with_all_fields_described():
    # python -c "from vfguide.mission.schema import *; print(schema_text(), end='')" renews it
    assert (MISSIONS / SCHEMA_FILE).read_text(encoding="utf-8") == schema_text()
    jsonschema.Draft202012Validator.check_schema(mission_schema())
    assert undescribed(mission_schema()) == []


HEAD = """\
name: pair
origin: {latitude_deg: 47.4, longitude_deg: 8.5, altitude_amsl_m: 488}
path: {type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 150}
leader: {vehicle: one, airspeed_m_s: 20}
followers: [{vehicle: two, slot: {forward_m: -20, right_m: 20}}]
"""


def test_every_vehicle_has_the_defaults_that_it_does_not_give_itself():
    found = loaded(
        f"{HEAD}vehicles:\n  defaults: {{alpha_1_s: 0.9, max_bank_deg: 40}}\n"
        "  one: {system_id: 1}\n  two: {system_id: 2, max_bank_deg: 30}\n"
    )
    vehicles = found.mission.vehicles
    told = {name: (one.alpha_1_s, one.max_bank_deg) for name, one in vehicles.items()}
    assert told == {"one": (0.9, 40.0), "two": (0.9, 30.0)}
    assert found.source.line_of(("vehicles", "one", "max_bank_deg")) == 7
    assert found.source.line_of(("vehicles", "two", "max_bank_deg")) == 9


def test_a_wrong_default_is_one_fault_where_it_stands():
    found = faults_of(
        f"{HEAD}vehicles:\n  defaults: {{max_bank_deg: 99, alpa_1_s: 1}}\n"
        "  one: {system_id: 1}\n  two: {system_id: 2}\n"
    )
    assert len(found) == 2
    assert "m.yaml:7: vehicles.defaults.max_bank_deg: 99 is too large; choose 80 or less" in found
    assert any("vehicles.defaults.alpa_1_s: unknown field" in one for one in found)


def test_anchors_aliases_and_merged_groups_mean_what_yaml_says():
    text = (
        "usual: &usual {alpha: 1, limits: &limits [12, 30]}\n"
        "one: {<<: *usual, alpha: 2}\n"
        "two: {alpha: 3, <<: [{beta: 5}, *usual]}\n"
        "three: *limits\n"
    )
    found = read_tree(text)
    assert found.faults == []
    assert found.data == yaml.safe_load(text)
    assert found.lines["one", "limits"] == 1
    assert found.lines["one", "alpha"] == 2


SCALARS = st.integers(0, 9).map(str)


@given(
    fields=st.dictionaries(st.sampled_from("abcd"), SCALARS, max_size=4),
    own=st.dictionaries(st.sampled_from("abcd"), SCALARS, max_size=4),
    first=st.booleans(),
)
def test_a_merged_group_is_what_pyyaml_makes_of_it(fields, own, first):
    said = [f"{name}: {value}" for name, value in own.items()]
    said.insert(0 if first else len(said), "<<: *base")
    base = ", ".join(f"{name}: {value}" for name, value in fields.items())
    text = f"base: &base {{{base}}}\nhere: {{{', '.join(said)}}}\n"
    assert read_tree(text).data == yaml.safe_load(text)


def test_what_grows_when_it_is_written_out_is_refused_before_it_has_grown():
    laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 9)}]\n" for level in range(1, 12)
    )
    with pytest.raises(MissionError, match="more than 20000 entries"):
        read_tree(laughs)
    many = "".join(f"  v{index}: {{system_id: {index}}}\n" for index in range(3000))
    fields = ", ".join(f"f{index}: 1" for index in range(3000))
    before = time.process_time()
    found = faults_of(f"{HEAD}vehicles:\n  defaults: {{{fields}}}\n{many}")
    assert found == ["m.yaml: more than 20000 entries; this is no mission file"]
    # Nine million fields would take minutes.
    assert time.process_time() - before < 60.0


def test_shipped_missions_say_what_their_vehicles_share_once():
    for name in ("ardupilot-sitl", "px4-sitl", "aerosonde-gusts"):
        declared = shipped(name).vehicles.values()
        vehicles = [one.model_dump(exclude={"system_id"}) for one in declared]
        assert all(one == vehicles[0] for one in vehicles)
