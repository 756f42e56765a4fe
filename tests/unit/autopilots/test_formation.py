"""How a mission is changed for a flight."""

from tests.autopilots.formation import merged

MISSION = {
    "path": {"type": "circle", "radius_m": 250},
    "vehicles": {"f1": {"slips": True}, "f2": {}},
}


def test_fields_change_and_the_others_stay():
    changed = merged(MISSION, {"path": {"radius_m": 150}})
    assert changed["path"] == {"type": "circle", "radius_m": 150}
    assert changed["vehicles"] == MISSION["vehicles"]


def test_a_group_of_another_type_takes_nothing_over():
    line = {"type": "line", "course_deg": 45}
    assert merged(MISSION, {"path": line})["path"] == line


def test_null_removes():
    assert merged(MISSION, {"vehicles": {"f2": None}})["vehicles"] == {"f1": {"slips": True}}
