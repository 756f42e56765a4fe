"""What a reader of a wrong mission file is told: the line, the field, the fault and the remedy."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.missions import content_of, faults_of, line_of, text_of
from vfguide.mission import MissionError, load_mission
from vfguide.mission.model import Mission


def faults_with(*changes: tuple[str, str]) -> list[str]:
    return faults_of(text_of("circle-wind", *changes))


PATHS = "line, circle, helix, racetrack, figure-eight, waypoints, plan"
F1, OWN = "vehicles.f1.system_id", "give each vehicle its own number from 1 to 254"
RANGE, ENDS = "vehicles.leader.airspeed_range_m_s", "write [lowest, highest]"
NAME, LETTERS = "name: circle-wind", "use up to 64 lower-case letters, digits and hyphens"
LAWS = "did you mean 'slot'? use one of: slot, article, pid, mpc"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("system_id: 2", "system_id: 1", f"{F1}: 1 is also leader's; {OWN}"),
        ("system_id: 2", "system_id: 255", f"{F1}: 255 is also the ground station's; {OWN}"),
        (
            "system_id: 2",
            "system_id: 2.0",
            f"{F1}: 2.0 is not a whole number; write a whole number, without a point",
        ),
        ("gain: 0.015", "gian: 0.015", "path.gian: unknown field 'gian'; did you mean 'gain'?"),
        (
            "rate_hz: 20",
            "rate_hz: 2026-01-01",
            "rehearsal.rate_hz: '2026-01-01' is not a number; write a number without quotes",
        ),
        (
            "type: circle",
            "type: cirle",
            f"path.type: 'cirle' is not known; did you mean 'circle'? use one of: {PATHS}",
        ),
        ("type: circle, ", "", f"path.type: is missing; add one of: {PATHS}"),
        ("type: slot", "type: solt", f"controller.type: 'solt' is not known; {LAWS}"),
        (
            "[12, 32]",
            "[32, 12]",
            f"{RANGE}: the lowest airspeed comes first and must be below the highest; {ENDS}",
        ),
        ("[12, 32]", "[12]", f"{RANGE}: has too few values; {ENDS}"),
        (
            "airspeed_m_s: 20",
            "airspeed_m_s: 40",
            "leader.airspeed_m_s: 40 m/s is outside the airspeed_range_m_s of 'leader'; choose 12 to 32 m/s",
        ),
        (NAME, "name: Circle wind", f"name: 'Circle wind' cannot be a name; {LETTERS}"),
        (
            NAME,
            "name: !!python/object:os.system x",
            "name: tag !!python/object:os.system is not supported; write the plain value",
        ),
    ],
)
def test_one_wrong_field_gives_one_line(old, new, expected):
    line = line_of(old, text_of("circle-wind"))
    assert faults_with((old, new)) == [f"m.yaml:{line}: {expected}"]


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("3m", "'3m' is not a number; write the number alone, without a unit"),
        ("'3'", "'3' is not a number; write a number without quotes"),
        ("yes", "'yes' is not a number; write a number without quotes"),
        ("true", "true is not a number; write a number without quotes"),
        (".nan", "nan is not a finite number; write a finite number"),
        ("-.inf", "-inf is not a finite number; write a finite number"),
        ("-3", "-3 is too small; choose 1e-06 or more"),
    ],
)
def test_a_wrong_number_gives_one_line(written, expected):
    line = line_of("kappa: 3", text_of("circle-wind"))
    found = faults_with(("kappa: 3", f"kappa: {written}"))
    assert found == [f"m.yaml:{line}: controller.kappa: {expected}"]


def test_all_faults_are_reported_at_once_in_the_order_of_the_file():
    slower, wider = ("kappa: 3", "kappa: fast"), ("radius_m", "radius")
    found = faults_with(slower, wider, ("system_id: 2", "system_id: 1"))
    places = ["path.radius_m", "path.radius", "vehicles.f1.system_id", "controller.kappa"]
    assert [one.split(": ")[1] for one in found] == places


F3_SLOT = "forward_m: -40, right_m: 0"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("vehicle: f3", "vehicle: f4", "there is no vehicle 'f4'"),
        ("vehicle: f3", "vehicle: f4", "vehicles.f3: this vehicle has no role"),
        ("vehicle: f3", "vehicle: f2", "'f2' already flies as followers[1]"),
        ("vehicle: f3", "vehicle: leader", "'leader' already flies as the leader"),
        (F3_SLOT, "forward_m: -20, right_m: 22", "only 2.0 m from followers[1]'s slot"),
        (F3_SLOT, "forward_m: -1, right_m: 0", "only 1.0 m from the leader"),
        ("    f3: {forward", "    f9: {forward", "'f9' is neither 'leader' nor a follower"),
    ],
)
def test_contradictions_between_fields_are_faults(old, new, expected):
    assert any(expected in one for one in faults_with((old, new)))


def test_a_name_is_proposed_once():
    start = ("rehearsal:", "rehearsal:\n  start: {f9: {forward_m: 0, right_m: 0}}\n")
    found = faults_with(("vehicle: f2", "vehicle: f1"), start)
    (line,) = (one for one in found if "is neither 'leader' nor a follower" in one)
    assert line.endswith("use one of: leader, f1, f3")


def test_a_field_given_twice_names_both_lines_and_an_empty_section_what_belongs_there():
    found = faults_of("name: a\nname: b\n")
    assert "m.yaml:2: name: given twice, first in line 1; remove one" in found
    found = faults_with(("wind: {type: article}", "wind:"))
    line = line_of("wind: {type", text_of("circle-wind"))
    assert found[0].startswith(f"m.yaml:{line}: wind: is left empty")


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("path: {type: line}", "the line has no course"),
        ("path: {type: line, slope: 1, course_deg: 3}", "not both"),
        ("path: {type: line, course_deg: 3, direction: forward}", "say nothing without slope"),
    ],
)
def test_a_line_needs_a_course_and_only_one(path, expected):
    (circle,) = (one for one in text_of("circle-wind").split("\n") if one.startswith("path: {"))
    (found,) = faults_with((circle, path))
    assert expected in found


@given(
    number=st.floats(-1e6, 1e6).map(lambda value: f"{value:.3f}"),
    unit=st.sampled_from(["m", "km", " m/s", "\N{DEGREE SIGN}", "deg", "%", " s"]),
)
def test_a_unit_behind_any_number_is_told(number, unit):
    (line,) = faults_with(("kappa: 3", f"kappa: '{number}{unit}'"))
    assert line.endswith("is not a number; write the number alone, without a unit")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "m.yaml: the file is empty"),
        (b"# nothing but a comment\n", "m.yaml: the file is empty"),
        (b"- 1\n- 2\n", "m.yaml: the file holds no group of fields"),
        (b"just text", "m.yaml: the file holds no group of fields"),
        (b"name: a\n\xff\xfe", "m.yaml:2: not UTF-8 text"),
        (b"name: a\n\x00", "m.yaml:2: character U+0000 cannot stand"),
        (b"name: a\n  path: b", "m.yaml:2: not valid YAML"),
        (b"name: [1", "m.yaml:1: not valid YAML"),
        (b"a: 1\nb: *a\n", "m.yaml:2: alias *a has no anchor before it"),
        (b"a: &a [1, *a]\n", "m.yaml:1: alias *a has no anchor before it"),
        (b"a: &a [1]\n<<: *a\n", "m.yaml:1: <<: takes a group of fields"),
        (b"[" * 100_000, "m.yaml:1: nested too deeply"),
        (b"- 1\n" * 30_000, "more than 20000 entries"),
        (b"? [a]\n: 1\n", "a list or group cannot be the name of a field"),
        (b"name: a\n---\nname: b\n", "m.yaml:2: a second document begins"),
        (b'name: "\\UFFFFFFFF"', "m.yaml:1: not valid YAML"),
        (b'name: "\\ud800"', "half of a surrogate pair"),
        (b"name: " + b"9" * 5000, "name: inf is not text"),
        (b"%YAML " + b"9" * 5000 + b".1\n---\nname: a", "not valid YAML"),
    ],
    ids=range(19),
)
def test_what_is_no_mission_at_all_is_refused_in_one_line(content, expected):
    assert any(expected in one for one in faults_of(content))


def test_a_missing_file_a_directory_and_an_endless_file_are_refused(tmp_path):
    large = tmp_path / "large.yaml"
    large.write_bytes(b"#" * (1024 * 1024 + 1))
    for path, expected in [
        (tmp_path / "none.yaml", "there is no such file"),
        (tmp_path, "this is a directory"),
        (large, "larger than 1 MiB"),
        (tmp_path / "a\0b", "cannot be read"),
        (tmp_path / ("long" * 100), "cannot be read"),
        (large / "inside.yaml", "cannot be read"),
    ]:
        with pytest.raises(MissionError, match=expected):
            load_mission(path)


def test_control_characters_never_reach_the_terminal():
    (found,) = [one for one in faults_of('"\\e[31m\\nred": 1\n') if "unknown" in one]
    assert "\\u001b[31m\\u000ared" in found


def test_contradictions_are_also_found_without_a_file():
    data = content_of("circle-wind")
    data["vehicles"]["f1"]["system_id"] = 1
    with pytest.raises(ValueError, match="is also leader's"):
        Mission.model_validate(data)
