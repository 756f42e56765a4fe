"""Who an emulator says it is: component, type of vehicle, number of its hardware."""

import math

import pytest

from sitl_stub.settings import Settings
from tests.kit.autopilot import config_of, new_station
from tests.kit.wire import command_long, of_type


def test_it_says_its_type_and_number_and_speaks_as_its_component():
    station = new_station(component_id=2, vehicle_type=2, uid=77)
    said = station.advance(1.5)
    (beat, *_) = of_type(said, "HEARTBEAT")
    assert (beat.get_srcComponent(), beat.type) == (2, 2)
    answered = station.send(command_long(512, 148, system_id=7, component_id=2))
    (version,) = of_type(answered, "AUTOPILOT_VERSION")
    assert version.uid == 77


def test_numbers_of_a_fleet_count_up_and_none_stays_none():
    fleet = Settings.of({"system_id": 1, "mavlink": "udpout://h:1", "count": 2, "uid": 5})
    assert [fleet.config(index).uid for index in range(2)] == [5, 6]
    alone = Settings.of({"system_id": 1, "mavlink": "udpout://h:1"})
    assert (alone.config(1).uid, alone.config().component_id) == (0, 1)
    assert alone.config().vehicle_type == 1


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("component_id", 0),
        ("component_id", 256),
        ("vehicle_type", -1),
        ("uid", -1),
        ("system_id", 0),
        ("latitude_deg", 90.0),
        ("longitude_deg", math.nan),
        ("airspeed_m_s", 50.0),
        ("position_noise_m", -1.0),
        ("autopilot", "other"),
    ],
)
def test_what_no_aircraft_can_be_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        config_of(**{field: value})
