"""What is typed behind `--set` and `vfguide order`, and one sentence for what is wrong."""

import pytest

from tests.kit.missions import shipped
from vfguide.commands.order import order_of
from vfguide.commands.overrides import Overrides, apply_overrides, parse_settings
from vfguide.errors import InputError
from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Order

MISSION = shipped("line-calm")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("vehicles.f1.system_id=1", "--set vehicles.f1.system_id: 1 is also leader's; "),
        ("leader.vehicle=nobody", "--set leader.vehicle: there is no vehicle 'nobody'; "),
        ("vehicles.defaults.max_bank_deg=200", "200 is too large; choose 80 or less"),
        ("vehicles.defaults.system_id=3", "3 is also leader's; "),
        (
            "rehearsal.emulator.vehicles.nobody.alpha_1_s=1.0",
            "there is no vehicle 'nobody' in the formation; remove it, or name one of: leader, f1",
        ),
        (
            "rehearsal.emulator.vehicles.f1.alpha_1_s=-1.0",
            "--set rehearsal.emulator.vehicles.f1.alpha_1_s: -1 is too small; choose 1e-06",
        ),
        (
            "rehearsal.emulator.vehicles.f1.alpha=1.0",
            "unknown field 'alpha'; did you mean 'alpha_1_s'",
        ),
        ("vehicles.f1.slot.up_m=1", "--set vehicles.f1.slot.up_m: unknown field 'slot'; "),
    ],
)
def test_a_setting_that_contradicts_the_mission_is_told(setting, said):
    with pytest.raises(InputError) as caught:
        apply_overrides(MISSION, Overrides(settings=parse_settings([setting])))
    assert said in str(caught.value)


def test_a_default_of_the_vehicles_is_set_for_all_of_them():
    settings = parse_settings(["vehicles.defaults.max_bank_deg=20"])
    changed = apply_overrides(MISSION, Overrides(settings=settings))
    assert {one.max_bank_deg for one in changed.vehicles.values()} == {20.0}
    assert list(changed.vehicles) == list(MISSION.vehicles)


def test_a_plant_of_the_command_line_is_flown_by_the_vehicles_that_had_others_too():
    settings = parse_settings(["rehearsal.emulator.vehicles.f1.plant=bank"])
    changed = apply_overrides(MISSION, Overrides(settings=settings))
    assert changed.rehearsal.emulator.of("f1").plant == "bank"
    again = apply_overrides(changed, Overrides(plant="npfg"))
    assert {again.rehearsal.emulator.of(name).plant for name in again.vehicles} == {"npfg"}


@pytest.mark.parametrize(
    ("words", "spacing", "order"),
    [
        (["vee"], 30.0, Order(shape="vee", spacing=30.0)),
        (["trail"], None, Order(shape="trail")),
        (["spacing"], 25.0, Order(spacing=25.0)),
        (["swap", "f1", "f2"], None, Order(swap=("f1", "f2"))),
        (["slot", "f1=-20,10"], None, Order(slots={"f1": Point(-20.0, 10.0)})),
        (["slot", "f1=-20,10,15"], None, Order(slots={"f1": Point(-20.0, 10.0, 15.0)})),
        (["leave", "f1", "f3"], None, Order(leave=("f1", "f3"))),
        (["join", "f1"], None, Order(join=("f1",))),
        (["abort"], None, Order(action="abort")),
        (["path", "survey"], None, Order(path="survey")),
        (["lead", "f1"], None, Order(lead="f1")),
    ],
)
def test_words_become_an_order(words, spacing, order):
    assert order_of(words, spacing) == order


@pytest.mark.parametrize(
    ("words", "spacing", "sentence"),
    [
        ([], None, "nothing: is no order; there are vee"),
        (["ring"], None, "ring: is no order"),
        (["vee", "f1"], None, "vee f1: is no order"),
        (
            ["spacing"],
            None,
            "spacing: is not complete, or too much; write `vfguide order MISSION spacing",
        ),
        (["swap", "f1"], None, "write `vfguide order MISSION swap A B --link URL`"),
        (["leave"], None, "write `vfguide order MISSION leave NAME --link URL`"),
        (["lead", "f1", "f2"], None, "write `vfguide order MISSION lead NAME --link URL`"),
        (["hold"], 20.0, "--spacing: goes with a shape"),
        (["slot", "f1"], None, "slot f1: write NAME=FORWARD,RIGHT"),
        (["slot", "f1=nan,1"], None, "slot f1=nan,1: write"),
        (["slot", "f1=-4000,1"], None, "no more than 3000 m away"),
    ],
)
def test_what_is_no_order_is_refused_in_a_sentence(words, spacing, sentence):
    with pytest.raises(InputError) as refusal:
        order_of(words, spacing)
    assert sentence in str(refusal.value)
