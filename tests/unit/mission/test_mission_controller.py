"""The section `controller:` of a mission: what every law shares, and the gains of the one that flies."""

import pickle

import pytest
from pydantic import ValidationError

from tests.kit.missions import faults_of, line_of, loaded, mission_with, shipped, text_of
from vfguide.errors import InputError
from vfguide.mission import Mission, check_mission
from vfguide.mission.controller import controller_of, with_law
from vfguide.mission.finding import told_apart
from vfguide.mission.load import with_overrides
from vfguide.mission.overrides import Overrides, parse_settings

CIRCLE = shipped("circle-wind")


def test_a_mission_without_a_word_about_it_is_flown_by_the_slots_field():
    controller = controller_of({})
    assert controller.type == "slot"
    usual = {"k_x": 0.2, "k_y": 0.2, "chi_inf_deg": 45.0, "v_inf_m_s": 8.0}
    usual |= {"rate_feedforward": True, "integral_s": None}
    assert controller.model_dump().items() >= usual.items()


def test_gains_of_a_law_stand_beside_what_all_laws_share_or_in_a_group_of_its_name():
    controller = controller_of({"type": "pid", "lateral_p_rad_m": 0.3, "kappa": 2.0})
    assert (controller.kappa, controller.lateral_p_rad_m) == (2.0, 0.3)
    assert controller.longitudinal_d == 5.79
    groups = {"pid": {"lateral_p_rad_m": 0.3}, "mpc": {"integral_s": 2.0}}
    assert controller_of({"type": "pid", **groups}).lateral_p_rad_m == 0.3
    assert controller_of({"type": "mpc", **groups}).integral_s == 2.0
    # Gains of another law do not count.
    assert not hasattr(controller_of({"type": "pid", "k_x": 0.3, "mpc": {}}), "k_x")
    with pytest.raises(ValidationError, match="pid"):
        controller_of({"type": "pid", "pid": 3})


def test_a_loaded_mission_is_flown_by_another_law_with_the_gains_that_its_file_has_for_it():
    groups = ("k_x: 0.42", "k_x: 0.42, pid: {lateral_p_rad_m: 0.3}")
    mission = loaded(text_of("circle-wind", groups)).mission
    other = with_overrides(mission, Overrides(controller="pid"))
    assert other.controller.lateral_p_rad_m == 0.3
    # And back again; the field's gains were flat, and have no meaning for a PID.
    assert with_overrides(other, Overrides(controller="slot")).controller.k_x == 0.2
    # A value of the command line goes before the group of the file.
    asked = Overrides(controller="pid", settings=((("controller", "lateral_p_rad_m"), 0.5),))
    assert with_overrides(mission, asked).controller.lateral_p_rad_m == 0.5
    assert pickle.loads(pickle.dumps(mission)) == mission  # noqa: S301 - of this test's own making


@pytest.mark.parametrize(
    "settings", [("rehearsal=3",), ("rehearsal=",), ("controller=3", "controller.type=pid")]
)
def test_what_the_command_line_puts_in_the_place_of_a_group_is_refused_by_its_option(settings):
    option = f"--set {settings[-1].partition('=')[0]}:"
    with pytest.raises(InputError, match=option):
        with_overrides(CIRCLE, Overrides(settings=parse_settings(settings), duration_s=60.0))


def test_for_another_law_a_gain_of_the_same_name_does_not_count():
    field = {"type": "slot", "k_x": 0.4, "integral_s": 0.65, "kappa": 2.0}
    # The article's field has the gains of the slot's, but learns nothing.
    assert with_law(field, "article") == {"type": "article", "k_x": 0.4, "kappa": 2.0}
    # The integral of `mpc` is not that of the field.
    assert with_law(field, "mpc") == {"type": "mpc", "kappa": 2.0}
    with pytest.raises(InputError, match="no such law; known are slot, article, pid, mpc"):
        with_law(field, "pursuit")


def test_a_mission_is_the_same_in_another_process():
    there = pickle.loads(pickle.dumps(CIRCLE))  # noqa: S301 - of this test's own making
    assert there == CIRCLE
    assert type(there.controller) is type(CIRCLE.controller)
    assert Mission.model_validate(CIRCLE.model_dump()) == CIRCLE


@pytest.mark.parametrize(
    ("gain", "fault"),
    [
        ("k_x: 20", "controller.k_x: 20 is too large; choose 10 or less"),
        ("k_z: 1", "controller.k_z: unknown field 'k_z'; did you mean"),
    ],
)
def test_a_wrong_gain_is_a_fault_at_its_line(gain, fault):
    text = text_of("circle-wind", ("k_x: 0.42", gain))
    (found,) = faults_of(text)
    place, told = found.split(": ", 1)
    assert int(place.removeprefix("m.yaml:")) >= line_of("controller:", text)
    assert told.startswith(fault)


@pytest.mark.parametrize("law", ["pid", "mpc"])
def test_a_law_that_is_no_field_is_not_judged_as_one(law):
    """`type: pid` with k_x 5 used to be told to lower k_x."""
    controller = with_law(CIRCLE.controller.model_dump(exclude_unset=True), law)
    mission = mission_with(CIRCLE, controller={**controller, "k_x": 5.0})
    found = [str(one) for one in check_mission(mission)]
    assert not any("k_x" in one or "swings" in one for one in found)


def test_two_numbers_of_a_message_differ_in_it():
    assert told_apart(2.14, 2.12, 1) == ("2.14", "2.12")
    assert told_apart(70.0, 5.7, 1) == ("70.0", "5.7")
    assert told_apart(60.2, 60.0, 0) == ("60.2", "60.0")
