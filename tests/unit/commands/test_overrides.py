"""What is typed behind `--set` and `vfguide order`, and one sentence for what is wrong."""

from typing import Any

import pytest

from tests.kit.missions import line_of, shipped, text_of
from vfguide.commands.order import order_of
from vfguide.errors import InputError
from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Order
from vfguide.mission import Mission, check_mission, parse_mission
from vfguide.mission.load import with_overrides
from vfguide.mission.overrides import Overrides, parse_settings

MISSION = shipped("line-calm")
CIRCLE_TEXT = text_of("circle-wind")


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
        with_overrides(MISSION, Overrides(settings=parse_settings([setting])))
    assert said in str(caught.value)


def test_a_default_of_the_vehicles_is_set_for_all_of_them():
    settings = parse_settings(["vehicles.defaults.max_bank_deg=20"])
    changed = with_overrides(MISSION, Overrides(settings=settings))
    assert {one.max_bank_deg for one in changed.vehicles.values()} == {20.0}
    assert list(changed.vehicles) == list(MISSION.vehicles)


def test_a_plant_of_the_command_line_is_flown_by_the_vehicles_that_had_others_too():
    settings = parse_settings(["rehearsal.emulator.vehicles.f1.plant=bank"])
    changed = with_overrides(MISSION, Overrides(settings=settings))
    assert changed.rehearsal.emulator.of("f1").plant == "bank"
    again = with_overrides(changed, Overrides(plant="npfg"))
    assert {again.rehearsal.emulator.of(name).plant for name in again.vehicles} == {"npfg"}


def told_of(*settings: str, text: str = CIRCLE_TEXT, **options: Any) -> list[str]:
    """Return what is wrong with the circle in wind, changed by settings, a line each."""
    overrides = Overrides(settings=parse_settings(settings), **options)
    with pytest.raises(InputError) as caught:
        parse_mission(text.encode(), file="m.yaml", overrides=overrides)
    return str(caught.value).split("\n")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("leader.airsped=20", "unknown field 'airsped'; did you mean 'airspeed_m_s'?"),
        ("leader.airspeed_m_s=fast", "'fast' is not a number; write a number without quotes"),
        (
            "leader.airspeed_m_s=20 m/s",
            "'20 m/s' is not a number; write the number alone, without a unit",
        ),
        ("path=5", "5 is not a group of fields; write its fields below it"),
        (
            "followers[7].slot.up_m=3",
            "there is no entry 7 in followers, a list of 3; write followers[0] to followers[2]",
        ),
        ("followers[-1].slot.up_m=3", "there is no entry -1 in followers, a list of 3; write"),
        ("followers.f2.slot.up_m=3", "followers is a list; write followers[1] for 'f2'"),
        (
            "orders[0].at_s=3",
            "there is no entry 0 in orders, a list of 0; give the list as a whole",
        ),
        ("vehicles[0].system_id=3", "there is no entry 0 in vehicles; name one of: leader, f1"),
        (
            "leader.airspeed_m_s.x=3",
            "leader.airspeed_m_s is 20, which has no fields; give --set leader.airspeed_m_s=VALUE",
        ),
    ],
)
def test_a_wrong_setting_is_one_line_with_its_option_and_what_would_be_right(setting, said):
    (line,) = told_of(setting)
    assert line.startswith(f"--set {setting.partition('=')[0]}: {said}") or "[-1]" in setting
    assert said in line


@pytest.mark.parametrize(
    "text",
    [
        "controller.k_x",
        "=3",
        "controller..k_x=3",
        ".k_x=3",
        "a[=3",
        "controller.k_x=[0.3",
        "x=!!int 3",
    ],
)
def test_what_is_no_field_with_a_value_is_refused_with_what_was_typed(text):
    with pytest.raises(InputError) as refusal:
        parse_settings([text])
    assert str(refusal.value).startswith(f"--set {text}: ")


def test_values_are_read_as_in_a_mission_file():
    texts = ["a = 1e3", "b=no", "c=12:30", "d=0x4B1900", "e[2].f={g: [1, x]}", "h="]
    assert dict(parse_settings(texts)) == {
        ("a",): 1000.0,
        ("b",): "no",
        ("c",): "12:30",
        ("d",): 0x4B1900,
        ("e", 2, "f"): {"g": [1, "x"]},
        ("h",): None,
    }


def test_a_field_that_is_given_twice_is_refused_whatever_options_give_it():
    k_x = "controller.k_x=0.3"
    assert told_of(k_x, k_x) == ["--set controller.k_x: is given twice; give it once"]
    assert told_of("rehearsal.seed=4", seed=4) == [
        "--set rehearsal.seed: --seed says it already; give it once"
    ]
    assert told_of("controller.type=pid", controller="mpc") == [
        "--set controller.type: --controller says it already; give it once"
    ]


def test_a_group_comes_before_its_fields_in_whatever_order_they_are_given():
    given = [
        "path.radius_m=300",
        "path={type: circle, centre: {north_m: 9, east_m: 0}, radius_m: 400, gain: 0.01}",
    ]
    mission = parse_mission(
        CIRCLE_TEXT.encode(), file="m", overrides=Overrides(settings=parse_settings(given))
    ).mission
    assert (mission.path.gain, mission.path.model_dump()["radius_m"]) == (0.01, 300.0)
    general = ["vehicles.f1.max_bank_deg=30", "vehicles.defaults.max_bank_deg=20"]
    changed = with_overrides(MISSION, Overrides(settings=parse_settings(general)))
    banks = {name: one.max_bank_deg for name, one in changed.vehicles.items()}
    assert banks == {"leader": 20.0, "f1": 30.0, "f2": 20.0, "f3": 20.0}


def test_what_an_option_contradicts_is_told_with_the_line_and_the_option():
    line = line_of("f1: {system_id: 2", CIRCLE_TEXT)
    (shared,) = told_of("vehicles.leader.system_id=2", seed=3)
    assert shared == (
        f"m.yaml:{line}: vehicles.f1.system_id: 2 is also leader's (with --set"
        " vehicles.leader.system_id); give each vehicle its own number from 1 to 254"
    )
    (missing,) = told_of("leader.follows=mavlink")
    line = line_of("leader: {vehicle", CIRCLE_TEXT)
    assert missing.startswith(f"m.yaml:{line}: leader.connection: needed with `follows: mavlink`")
    assert "(with --set leader.follows)" in missing


def test_faults_of_the_file_are_told_without_options_that_have_no_part_in_them():
    wrong = text_of("circle-wind", ("radius_m", "radios_m"))
    told = told_of("leader.airspeed_m_s=99", text=wrong, duration_s=5.0)
    assert told[0].startswith("--set leader.airspeed_m_s: 99")
    assert "unknown field 'radios_m'; did you mean 'radius_m'?" in "\n".join(told[1:])
    assert not any("(with" in one for one in told)
    # An option in the place of the only fault leaves none.
    text = text_of("circle-wind", ("airspeed_m_s: 20", "airspeed_m_s: fast"))
    settings = parse_settings(["leader.airspeed_m_s=21"])
    given = Overrides(settings=settings)
    mission = parse_mission(text.encode(), file="m", overrides=given).mission
    assert mission.leader.airspeed_m_s == 21.0


def test_a_finding_of_a_mission_names_the_option_that_gave_its_field():
    overrides = Overrides(duration_s=5.0, settings=parse_settings(["controller.k_x=9"]))
    read = parse_mission(CIRCLE_TEXT.encode(), file="m.yaml", overrides=overrides)
    told = [str(one) for one in check_mission(read.mission, read.source)]
    assert any(": --set controller.k_x: " in one and "m.yaml" not in one for one in told)
    assert any("lengthen --duration" in one for one in told)


@pytest.mark.parametrize("of_the_file", [True, False])
def test_the_system_id_of_a_leader_without_a_companion_is_set_in_one_place(of_the_file):
    overrides = Overrides(
        settings=parse_settings(["leader.system_id=77", "vehicles.leader.max_bank_deg=30"])
    )
    if of_the_file:
        text = text_of("foreign-leader").encode()
        mission = parse_mission(text, file="m", overrides=overrides).mission
    else:
        mission = with_overrides(shipped("foreign-leader"), overrides)
    assert mission.leader_vehicle.system_id == 77
    assert mission.leader_vehicle.max_bank_deg == 30.0


def test_a_mission_is_validated_once_with_all_that_the_command_line_says(monkeypatch):
    validations = []
    validate = Mission.model_validate
    monkeypatch.setattr(
        Mission, "model_validate", lambda data: validations.append(data) or validate(data)
    )
    overrides = Overrides(
        controller="pid", plant="bank", wind="calm", seed=2, settings=parse_settings(["name=other"])
    )
    mission = parse_mission(CIRCLE_TEXT.encode(), file="m", overrides=overrides).mission
    assert (mission.name, mission.controller.type, len(validations)) == ("other", "pid", 1)


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
