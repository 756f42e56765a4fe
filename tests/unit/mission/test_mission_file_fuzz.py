"""Whatever the bytes are, reading a mission ends in a mission or in lines that tell what is wrong."""

import copy
from collections.abc import Iterable
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.kit.missions import MISSION_FILES
from vfguide.mission import MissionError, check_mission, parse_mission
from vfguide.mission.overrides import Overrides

MISSIONS = [file.read_bytes() for file in MISSION_FILES]
TREES = [yaml.safe_load(content) for content in MISSIONS]

bounded = settings(
    deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)

words = ["name", "type", "line", "leader", "f1", "path", "slope", "radius_m", "start", "x"]
names = st.sampled_from([*words, "", "é", "\n"])
scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    names,
    st.sampled_from([0, 1, -1, 1e308, 5e-324, 10**400, 255, 256, 360.0, "calm", "circle"]),
)
structures = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(names | st.text(), inner, max_size=4)
    ),
    max_leaves=12,
)


def read_and_check(content: bytes, overrides: Overrides | None = None) -> None:
    """Read the bytes; a mission is checked as well, a fault must be fit to be printed."""
    try:
        read = parse_mission(content, file="m.yaml", overrides=overrides or Overrides())
    except MissionError as error:
        expect_printable(error)
    else:
        for finding in check_mission(read.mission, read.source):
            assert str(finding).isprintable()
            by_option = overrides is not None and finding.option is not None
            assert finding.line is not None or by_option


def expect_printable(error: MissionError) -> None:
    lines = str(error).split("\n")
    assert len(lines) == len(error.faults) > 0
    for line in lines:
        assert line.isprintable()
        assert line.startswith(("m.yaml", "--"))
        assert line.encode()


def as_yaml(tree: object) -> bytes:
    return yaml.safe_dump(tree, allow_unicode=True).encode("utf-8", "surrogatepass")


RANDOM = {
    "bytes": st.binary(max_size=200),
    "punctuation": st.text(" \n\t-:[]{},&*!|>'\"%@?#~.0aé\\", max_size=60).map(str.encode),
    "structures": structures.map(as_yaml),
}


@pytest.mark.parametrize("kind", RANDOM)
@bounded
@given(st.data())
def test_random_content(kind, data):
    read_and_check(data.draw(RANDOM[kind]))


@bounded
@given(st.data())
def test_missions_with_one_node_deleted_replaced_or_renamed(data):
    tree = copy.deepcopy(data.draw(st.sampled_from(TREES)))
    for _ in range(data.draw(st.integers(1, 3))):
        mutate(tree, data)
    read_and_check(as_yaml(tree))


@bounded
@given(st.data())
def test_missions_with_a_stretch_of_bytes_replaced(data):
    content = data.draw(st.sampled_from(MISSIONS))
    start = data.draw(st.integers(0, len(content)))
    length = data.draw(st.integers(0, 40))
    middle = data.draw(st.binary(max_size=8) | st.text(max_size=4).map(str.encode))
    read_and_check(content[:start] + middle + content[start + length :])


@bounded
@given(st.data())
def test_missions_with_numbers_changed(data):
    tree = copy.deepcopy(data.draw(st.sampled_from(TREES)))
    places = [(group, key) for group, key in nodes(tree) if isinstance(group[key], int | float)]
    for _ in range(4):
        group, key = data.draw(st.sampled_from(places))
        group[key] = data.draw(st.floats(-400, 400) | st.integers(0, 300) | st.just(1e-6))
    read_and_check(as_yaml(tree))


@bounded
@given(st.data())
def test_missions_with_fields_of_the_command_line(data):
    tree = copy.deepcopy(data.draw(st.sampled_from(TREES)))
    places = [*locations(tree)]
    if data.draw(st.booleans()):
        mutate(tree, data)
    step = names.filter(bool) | st.integers(-1, 5)
    further = st.lists(step, max_size=2).map(tuple)
    place = st.sampled_from(places).flatmap(lambda at: further.map(lambda more: (*at, *more)))
    given = data.draw(st.lists(st.tuples(place, structures), max_size=3))
    overrides = Overrides(
        settings=tuple(given),
        controller=data.draw(st.sampled_from([None, "pid", "article exact"])),
        plant=data.draw(st.sampled_from([None, "bank", "course-hold", "no such plant"])),
        duration_s=data.draw(st.none() | st.floats()),
    )
    read_and_check(as_yaml(tree), overrides)


def locations(tree: object, outer: tuple[Any, ...] = ()) -> Iterable[tuple[Any, ...]]:
    """Return the way down to each entry of the tree."""
    for key, value in entries(tree):
        yield (*outer, key)
        yield from locations(value, (*outer, key))


Place = tuple[Any, Any]
"""A group or list, and the key of one of its entries: as untyped as YAML is."""


def nodes(tree: object) -> list[Place]:
    """Every entry of the tree, at whatever depth."""
    return [place for key, value in entries(tree) for place in ((tree, key), *nodes(value))]


def entries(tree: object) -> Iterable[tuple[Any, Any]]:
    if isinstance(tree, dict):
        return tree.items()
    return enumerate(tree) if isinstance(tree, list) else ()


def mutate(tree: object, data: st.DataObject) -> None:
    places = nodes(tree)
    if not places:
        return
    group, key = data.draw(st.sampled_from(places))
    action = data.draw(st.sampled_from(["delete", "replace", "rename"]))
    if action == "delete":
        del group[key]
    elif action == "rename" and isinstance(group, dict):
        other = names | st.text(max_size=6) | st.integers() | st.booleans()
        group[data.draw(other)] = group.pop(key)
    else:
        group[key] = data.draw(structures)
