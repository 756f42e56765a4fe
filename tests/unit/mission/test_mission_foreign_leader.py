"""Missions whose leader has no companion: what they may leave out, and what they must not say."""

from typing import Any

import pytest
from pydantic import ValidationError

from vfguide.mission.explain import explain
from vfguide.mission.finding import dotted
from vfguide.mission.load import shipped_missions
from vfguide.mission.model import Mission
from vfguide.mission.yaml_tree import read_tree

FOREIGN = ("connection", "system_id", "least_delay_s")


def content(**leader: Any) -> dict[str, Any]:
    tree = read_tree(shipped_missions()["foreign-leader"].read_text(encoding="utf-8")).data
    assert isinstance(tree, dict)
    tree["leader"] = {**tree["leader"], **leader}
    return tree


def faults(data: dict[str, Any]) -> str:
    with pytest.raises(ValidationError) as raised:
        Mission.model_validate(data)
    found = explain(raised.value, data)
    return "\n".join(f"{dotted(one.location)}: {one.message}; {one.remedy}" for one in found)


def test_it_needs_no_name_no_vehicle_and_no_path_and_followers_alone_have_companions():
    data = content()
    del data["path"]
    mission = Mission.model_validate(data)
    assert mission.leader.vehicle == "leader"
    assert mission.leader_vehicle.system_id == 7
    assert mission.leader.airspeed_m_s == 20.0
    assert mission.path.type == "line"
    # The first follower keeps the time.
    assert mission.timekeeper == "f1"
    assert mission.companions == ("f1", "f2", "f3")


def test_its_vehicle_may_be_described_as_any_other():
    data = content(vehicle="tug", system_id=None)
    data["vehicles"]["tug"] = {"system_id": 9, "max_bank_deg": 30}
    mission = Mission.model_validate(data)
    assert (mission.leader_vehicle.system_id, mission.leader_vehicle.max_bank_deg) == (9, 30.0)


def test_a_ground_station_may_lead_and_no_other_vehicle_has_its_number():
    assert Mission.model_validate(content(system_id=255)).leader_vehicle.system_id == 255
    data = content()
    data["vehicles"]["f1"] = {**data["vehicles"]["f1"], "system_id": 255}
    assert "255 is also the ground station's" in faults(data)


@pytest.mark.parametrize(
    ("leader", "told"),
    [
        ({"connection": None}, "leader.connection: needed with `follows: mavlink`"),
        ({"connection": "14560"}, "leader.connection"),
        ({"system_id": None}, "leader.system_id: needed of a leader that has no entry"),
        ({"system_id": 2}, "2 is also"),
        ({"icao_address": 5}, "leader.icao_address: a leader that followers hear by"),
        ({"follows": "adsb", "system_id": None}, "leader.icao_address: needed"),
        ({"least_delay_s": -1.0}, "leader.least_delay_s"),
        # Other leaders still need name, airspeed and path.
        ({**dict.fromkeys(FOREIGN), "follows": "companion"}, "leader.vehicle"),
    ],
)
def test_what_does_not_fit_is_told(leader, told):
    assert told in faults(content(**leader))


def adsb(forward_m: float) -> dict[str, Any]:
    data = content(follows="adsb", system_id=None, icao_address=0x4B1900)
    data["followers"] = [{"vehicle": "f1", "slot": {"forward_m": forward_m, "right_m": 0.0}}]
    data["vehicles"] = {"f1": data["vehicles"]["f1"]}
    return data


def test_an_aircraft_that_adsb_shows_is_followed_from_a_hundred_metres():
    assert Mission.model_validate(adsb(-100.0)).leader.icao_address == 0x4B1900
    assert "only 99 m from an aircraft that is heard by ADS-B" in faults(adsb(-99.0))


def test_messages_arrive_after_they_are_sent():
    data = content()
    data["rehearsal"]["leader_telemetry"] = {"delay_s": 0.1, "jitter_s": 0.2}
    assert "rehearsal.leader_telemetry.jitter_s: more than delay_s" in faults(data)
