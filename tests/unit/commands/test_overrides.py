"""What `--set` says about a whole mission: contradictions in one line, defaults for every vehicle."""

from pathlib import Path

import pytest

from vfguide.commands.overrides import Overrides, apply_overrides, parse_settings
from vfguide.errors import InputError
from vfguide.mission import load_mission

MISSION = load_mission(Path(__file__).parents[3] / "missions" / "line-calm.yaml")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("vehicles.f1.system_id=1", "--set vehicles.f1.system_id: 1 is also leader's; "),
        ("leader.vehicle=nobody", "--set leader.vehicle: there is no vehicle 'nobody'; "),
        ("vehicles.defaults.max_bank_deg=200", "200 is too large; choose 80 or less"),
        ("vehicles.defaults.system_id=3", "3 is also leader's; "),
    ],
)
def test_a_setting_that_contradicts_the_mission_is_told(setting: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        apply_overrides(MISSION, Overrides(settings=parse_settings([setting])))
    assert said in str(caught.value)


def test_a_default_of_the_vehicles_is_set_for_all_of_them() -> None:
    settings = parse_settings(["vehicles.defaults.max_bank_deg=20"])
    changed = apply_overrides(MISSION, Overrides(settings=settings))
    assert {one.max_bank_deg for one in changed.vehicles.values()} == {20.0}
    assert list(changed.vehicles) == list(MISSION.vehicles)
