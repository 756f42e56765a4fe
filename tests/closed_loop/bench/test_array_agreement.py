"""The array form against lockstep: the same case without noise, step for step."""

import numpy as np
import pytest

from vfguide.elementwise import FloatArray
from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.geometry import slot_error
from vfguide.lab.studies.array_case import conditions_of, start_of
from vfguide.lab.studies.array_formation import fly_formations
from vfguide.lab.studies.flown import MISSIONS, article_mission
from vfguide.mission import Mission

DURATION_S = 30.0


def mission_of_two(name: str, law: str, plant: str) -> Mission:
    """One of the four with one follower: the array form has nobody keep clear of anybody."""
    controller = {"type": law, "slot_frame": "leader"}
    changes = {"controller": controller, "rehearsal": {"duration_s": DURATION_S}}
    content = article_mission(name, changes, plant=plant).model_dump(exclude_unset=True)
    content["followers"] = content["followers"][:1]
    for absent in ("f2", "f3"):
        del content["vehicles"][absent], content["rehearsal"]["start"][absent]
    return Mission.model_validate(content)


def distances_in_lockstep(mission: Mission) -> FloatArray:
    record = fly_lockstep(mission).record
    return np.array([slot_error(record.leader, one).distance_m for one in record.followers])


def distances_on_arrays(mission: Mission, count: int) -> FloatArray:
    seen: list[FloatArray] = []
    fly_formations(
        start_of(mission, count), conditions_of(mission), lambda _time, far, _told: seen.append(far)
    )
    return np.moveaxis(np.array(seen), 0, -1)


@pytest.mark.parametrize(
    ("name", "law", "plant"),
    [(name, "slot", "heading-hold") for name in MISSIONS]
    + [
        ("line-wind", "slot", "course-hold"),
        ("circle-wind", "slot", "course-hold"),
        ("circle-wind", "pid", "heading-hold"),
        ("circle-wind", "article", "heading-hold"),
    ],
)
def test_the_array_form_flies_what_lockstep_flies(name, law, plant):
    mission = mission_of_two(name, law, plant)
    wanted = distances_in_lockstep(mission)
    flown = distances_on_arrays(mission, 2)
    assert flown.shape == (1, 2, wanted.shape[1])
    for column in (0, 1):
        # A millimetre is what was asked for; the arithmetic is the same to the last bits.
        assert np.max(np.abs(flown[:, column] - wanted)) < 1e-6


def test_a_predictive_law_differs_by_what_its_solver_leaves_open():
    mission = mission_of_two("circle-wind", "mpc", "heading-hold")
    apart = np.abs(distances_on_arrays(mission, 1)[:, 0] - distances_in_lockstep(mission))
    in_place = round(25.0 * mission.rehearsal.rate_hz)
    # On the way into the slot, with bounds at work, it stops at its last iteration in one step of ten.
    # Rounding errors of the inputs then lead to other commands, and to a metre within five seconds.
    assert np.max(apart) < 2.0
    assert np.max(apart[:, in_place:]) < 0.005


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"rehearsal": {"link_loss": 0.1}}, "loss or jitter"),
        ({"controller": {"leader_speed_source": "observer"}}, "measured ground speed"),
        ({"controller": {"slot_frame": "path"}}, "slot_frame: path"),
        ({}, "slot_frame: path"),
    ],
)
def test_what_the_array_form_has_not_is_refused(changes, what):
    with pytest.raises(VfguideError, match=what):
        conditions_of(article_mission("line-calm", changes))
