"""Between MAVLink messages and what MAVSDK calls them; flights with it are in tests/integration/live."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.autopilot import address, asked
from tests.kit.wire import framed
from vfguide.mavlink.mavsdk import (
    HEARD,
    direct_message,
    message_of,
    position_of,
    velocity_of,
    wanted_mode,
)
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import (
    AirspeedReport,
    CommandReport,
    HeartbeatReport,
    ParameterReport,
    TextReport,
    VersionReport,
)

VERSION = dict.fromkeys(
    ("flight_custom_version", "middleware_custom_version", "os_custom_version"), [0] * 8
) | {"flight_sw_version": 0x01120080, "uid2": [0] * 18}


POSITION = (
    '{"message_id":33,"message_name":"GLOBAL_POSITION_INT","alt":588000,"hdg":1497,"lat":473980997,'
    '"lon":85456638,"relative_alt":100000,"time_boot_ms":2000,"vx":1980,"vy":529,"vz":0}'
)


def frame_of(name: str, fields_json: str) -> bytes:
    return framed(message_of(name, fields_json))


def test_a_position_arrives_as_it_was_sent(codec):
    (report,) = codec.decode(frame_of("GLOBAL_POSITION_INT", POSITION))
    assert report.boot_time_s == 2.0
    assert report.latitude_deg == pytest.approx(47.3980997)
    assert (report.velocity_north, report.velocity_east) == (19.8, 5.29)


@pytest.mark.parametrize(
    ("name", "fields", "kind"),
    [
        ("HEARTBEAT", {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}, HeartbeatReport),
        ("COMMAND_ACK", {"command": 178, "result": 0, "result_param2": 0}, CommandReport),
        ("STATUSTEXT", {"severity": 4, "text": "low battery"}, TextReport),
        ("PARAM_VALUE", {"param_id": "FW_R_LIM", "param_value": 50.0}, ParameterReport),
        ("AUTOPILOT_VERSION", VERSION, VersionReport),
        ("VFR_HUD", {"airspeed": 20.5, "alt": 588.0, "climb": None}, AirspeedReport),
    ],
)
def test_what_companions_listen_to_becomes_frames_again(codec, name, fields, kind):
    filled = dict.fromkeys(HEARD[name].fieldnames, 0) | fields
    (report,) = codec.decode(frame_of(name, json.dumps(filled)))
    assert isinstance(report, kind)


@given(name=st.sampled_from(sorted(HEARD)), text=st.text() | st.just('{"lat": "x"}'))
def test_what_is_no_message_is_none(name, text):
    assert message_of(name, text) is None


def test_a_setpoint_becomes_mavsdks_velocity_or_position_above_sea_level():
    setpoint, _ = Px4(address(px4_steering="velocity")).fly(asked(2.0, 20.0))
    velocity = velocity_of(setpoint)
    assert (velocity.north_m_s, velocity.east_m_s) == pytest.approx((-8.3229, 18.1859), abs=1e-4)
    assert velocity.down_m_s == 0.0
    assert velocity.yaw_deg == pytest.approx(114.5916, abs=1e-4)
    setpoint, _ = Px4(address(px4_steering="position")).fly(asked(0.0, 20.0))
    position = position_of(setpoint)
    # 1500 m north: the meridian's radius at 47 degrees is 6 369 700 m.
    assert position.lat_deg == pytest.approx(47.0 + math.degrees(1500.0 / 6_369_700.0), abs=1e-5)
    assert position.lon_deg == pytest.approx(8.0, abs=1e-7)
    assert (position.alt_m, position.altitude_type.name) == (588.0, "AMSL")


def test_modes_are_recognised_and_speeds_are_none():
    for steering, mode in (("guided-course", (4, 19)), ("position", (6, 0))):
        plane = Px4(address(px4_steering=steering))
        assert [wanted_mode(message) for message in plane.engage()] == [mode]
        assert [wanted_mode(message) for message in plane.hand_back()] == [(4, 3)]
    assert [wanted_mode(message) for message in plane.fly(asked(1.0, 20.0))] == [None, None]


def test_everything_else_goes_through_with_all_its_fields():
    _, speed = Px4(address()).fly(asked(1.0, 20.5))
    direct = direct_message(speed)
    fields = json.loads(direct.fields_json)
    assert direct.message_name == "COMMAND_LONG"
    assert (fields["command"], fields["param1"], fields["param2"]) == (178, 0, 20.5)
    assert (fields["target_system"], fields["target_component"]) == (7, 3)
