"""What `--set` says about a whole mission: contradictions in one line, defaults for every vehicle."""

import pytest

from tests.kit.missions import shipped
from vfguide.commands.overrides import Overrides, apply_overrides, parse_settings
from vfguide.errors import InputError

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
