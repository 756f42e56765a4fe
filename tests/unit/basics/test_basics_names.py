"""A class's name stands for one thing in both packages."""

import ast
from collections import defaultdict

from tests.kit.missions import ROOT

SHARED = {
    "Air": "a mission's `rehearsal.air` declares the emulator's",
    "ArticleWind": "a mission's `rehearsal.wind` declares the emulator's",
    "CalmWind": "a mission's `rehearsal.wind` declares the emulator's",
    "Emulator": "a mission's `rehearsal.emulator` declares the emulator's manners",
    "LeaderTelemetry": "a mission's `rehearsal.leader_telemetry` declares what is heard",
    "Slot": "a mission's order declares one, which guidance flies",
    "SteadyWind": "a mission's `rehearsal.wind` declares the emulator's",
    "Vehicle": "a mission's `vehicles` declares what an adapter of one's own is given",
}
"""Names that stand in two places for two sides of the same thing."""


def places_of_classes() -> dict[str, list[str]]:
    found: dict[str, list[str]] = defaultdict(list)
    for package in ("vfguide", "sitl_stub"):
        for file in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    return found


def test_a_class_name_stands_for_one_thing():
    twice = {name: places for name, places in places_of_classes().items() if len(places) > 1}
    assert {name: places for name, places in twice.items() if name not in SHARED} == {}


def test_who_shares_a_name_still_does_and_twice_only():
    places = places_of_classes()
    assert {name: len(places[name]) for name in SHARED} == dict.fromkeys(SHARED, 2)


SPLIT = {"LATE_S", "LOOK_S"}
"""Names that stood for other times in every module: each has one with its subject now."""


def test_times_that_mean_different_things_have_their_subject_in_their_names():
    bare = [
        f"{file.relative_to(ROOT)}: {node.id}"
        for package in ("vfguide", "sitl_stub")
        for file in sorted((ROOT / package).rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name) and node.id in SPLIT
    ]
    assert bare == []
