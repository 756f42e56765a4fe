"""Who an emulator says it is: component, type of vehicle, number of its hardware."""

import pytest

from sitl_stub.settings import Settings
from tests.kit.autopilot import new_station
from tests.kit.wire import command_long


def test_it_says_its_type_and_number_and_speaks_as_its_component():
    station = new_station(component_id=2, vehicle_type=2, uid=77)
    said = station.advance(1.5)
    (beat, *_) = [one for one in said if one.get_type() == "HEARTBEAT"]
    assert (beat.get_srcComponent(), beat.type) == (2, 2)
    answered = station.send(command_long(512, 148, system_id=7, component_id=2))
    (version,) = [one for one in answered if one.get_type() == "AUTOPILOT_VERSION"]
    assert version.uid == 77


def test_numbers_of_a_fleet_count_up_and_none_stays_none():
    fleet = Settings.of({"system_id": 1, "mavlink": "udpout://h:1", "count": 2, "uid": 5})
    assert [fleet.config(index).uid for index in range(2)] == [5, 6]
    alone = Settings.of({"system_id": 1, "mavlink": "udpout://h:1"})
    assert (alone.config(1).uid, alone.config().component_id, alone.config().vehicle_type) == (
        0,
        1,
        1,
    )


@pytest.mark.parametrize(
    "changes", [{"component_id": 0}, {"component_id": 256}, {"vehicle_type": -1}, {"uid": -1}]
)
def test_what_no_aircraft_can_be_is_refused(changes):
    with pytest.raises(ValueError, match=next(iter(changes))):
        new_station(**changes)
