"""The easement of a racetrack: its length where the file gives none, and one that does not fit."""

import pytest

from tests.kit.missions import faults_of, line_of, loaded, text_of
from vfguide.paths.racetrack import RacetrackShape

CIRCLE = text_of("circle-calm")
FIELDS = "  type: racetrack\n  centre: {north_m: 0, east_m: 0}\n  course_deg: 0\n"


def file_with(leg_m: float, radius_m: float, easement: str = "") -> str:
    (circle,) = [line for line in CIRCLE.split("\n") if line.startswith("path: ")]
    racetrack = f"path:\n{FIELDS}  leg_m: {leg_m}\n  radius_m: {radius_m}\n{easement}"
    return CIRCLE.replace(circle, racetrack)


def easement_of(text: str) -> float:
    path = loaded(text).mission.path
    assert isinstance(path, RacetrackShape)
    return path.easement_m


@pytest.mark.parametrize(
    ("leg_m", "radius_m", "easement_m"),
    [(600, 150, 100.0), (60, 150, 60.0), (600, 80, 80.0), (70, 80, 70.0), (100.5, 100.5, 100.0)],
)
def test_an_easement_that_is_not_given_is_as_long_as_fits_up_to_a_hundred_metres(
    leg_m, radius_m, easement_m
):
    assert easement_of(file_with(leg_m, radius_m)) == easement_m


@pytest.mark.parametrize("easement_m", [0.0, 30.0, 60.0])
def test_an_easement_that_is_given_and_fits_is_taken(easement_m):
    assert easement_of(file_with(60, 150, f"  easement_m: {easement_m}\n")) == easement_m


@pytest.mark.parametrize(
    ("leg_m", "radius_m", "easement_m", "longest"),
    [(60, 150, 61, "60"), (600, 82.5, 100, "82.5")],
)
def test_one_that_is_too_long_is_a_fault_of_its_own_line(leg_m, radius_m, easement_m, longest):
    text = file_with(leg_m, radius_m, f"  easement_m: {easement_m}\n")
    (fault,) = faults_of(text)
    assert fault == (
        f"m.yaml:{line_of('easement_m', text)}: path.easement_m: is longer than the leg or the radius; "
        f"{longest} m is the most; shorten it, or leave it out"
    )


def test_a_radius_that_is_no_number_is_the_only_fault_where_no_easement_is_given():
    faults = faults_of(file_with(60, 150).replace("radius_m: 150", "radius_m: wide"))
    assert [fault.split(": ")[1] for fault in faults] == ["path.radius_m"]


def test_a_remedy_that_is_a_fields_description_is_one_line():
    faults = "\n".join(faults_of(file_with(60, 150).replace("  leg_m: 60\n", "")))
    assert "path.leg_m: is missing; add it: " in faults
    assert "\\u000a" not in faults
