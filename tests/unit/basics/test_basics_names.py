"""A class's name stands for one thing in both packages."""

import re
from collections import defaultdict
from collections.abc import Iterator

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


def texts() -> Iterator[tuple[str, str]]:
    """(file, text) of all that both packages are made of."""
    for package in ("vfguide", "sitl_stub"):
        for file in sorted((ROOT / package).rglob("*.py")):
            yield str(file.relative_to(ROOT)), file.read_text(encoding="utf-8")


def test_a_class_name_stands_for_one_thing_and_a_shared_one_for_two():
    places: dict[str, list[str]] = defaultdict(list)
    for file, text in texts():
        for name in re.findall(r"^ *class (\w+)", text, re.MULTILINE):
            places[name].append(file)
    assert len(places) > 500
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert {name: found for name, found in twice.items() if name not in SHARED} == {}
    assert {name: len(places[name]) for name in SHARED} == dict.fromkeys(SHARED, 2)


SPLIT = re.compile(r"\b(LATE_S|LOOK_S)\b")
"""Names that stood for other times in every module: each has one with its subject now."""


def test_times_that_mean_different_things_have_their_subject_in_their_names():
    assert [file for file, text in texts() if SPLIT.search(text)] == []


def test_a_module_gives_each_of_its_constants_one_value():
    twice = []
    for file, text in texts():
        names = re.findall(r"^([A-Z][A-Z0-9_]*) = ", text, re.MULTILINE)
        twice += [f"{file}: {name}" for name in set(names) if names.count(name) > 1]
    assert twice == []
