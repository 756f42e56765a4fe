"""What a mission file says once for several vehicles: defaults, anchors, aliases and merged groups."""

import time

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.missions import faults_of, loaded, shipped
from vfguide.mission.yaml_tree import TreeError, read_tree

HEAD = """\
name: pair
origin: {latitude_deg: 47.4, longitude_deg: 8.5, altitude_amsl_m: 488}
path: {type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 150}
leader: {vehicle: one, airspeed_m_s: 20}
followers: [{vehicle: two, slot: {forward_m: -20, right_m: 20}}]
"""


def test_every_vehicle_has_the_defaults_that_it_does_not_give_itself():
    text = HEAD + (
        "vehicles:\n"
        "  defaults: {alpha_1_s: 0.9, max_bank_deg: 40}\n"
        "  one: {system_id: 1}\n"
        "  two: {system_id: 2, max_bank_deg: 30}\n"
    )
    found = loaded(text)
    vehicles = found.mission.vehicles
    assert list(vehicles) == ["one", "two"]
    one, two = vehicles.values()
    assert (one.alpha_1_s, one.max_bank_deg) == (0.9, 40.0)
    assert (two.alpha_1_s, two.max_bank_deg) == (0.9, 30.0)
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
    with pytest.raises(TreeError, match="more than 20000 entries"):
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
