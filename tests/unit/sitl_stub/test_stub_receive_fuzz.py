import math
import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, PlantParameters, SteadyWind
from tests.kit.autopilot import new_autopilot, new_station
from tests.kit.wire import frame_of, packed

COMMANDS = (176, 178, 400, 511, 512, 43000, 43001, 43002, 192)


def autopilot(kind: str = "ardupilot", plant: str = "heading-hold") -> Autopilot:
    plant_of_it = PlantParameters(kind=plant)
    vehicle = new_autopilot(SteadyWind(5.0, 1.0), autopilot=kind, plant=plant_of_it, course_rad=1.0)
    if kind == "ardupilot":
        vehicle.receive(command(176, (1, 15, 0, 0)))
    return vehicle


def command(number: int, parameters: tuple[float, ...], z: float = 0.0, frame: int = 3) -> bytes:
    message = mavlink.MAVLink_command_int_message(7, 1, frame, number, 0, 0, *parameters, 0, 0, z)
    return packed(message)


def is_finite(vehicle: Autopilot) -> bool:
    truth = vehicle.truth()
    values = (getattr(truth, name) for name in truth.__struct_fields__)
    return all(math.isfinite(value) for value in values if isinstance(value, float))


@given(st.binary(max_size=600))
def test_random_bytes_change_nothing_and_are_not_answered(data):
    vehicle = autopilot()
    before = vehicle.truth()
    assert vehicle.receive(data) == b""
    assert vehicle.truth() == before


@given(st.binary(min_size=1, max_size=80), st.sampled_from([b"\xfd", b"\xfe"]))
def test_garbage_does_not_swallow_the_next_datagram(data, magic):
    vehicle = autopilot()
    vehicle.receive(magic + data)
    assert vehicle.receive(command(512, (0, 0, 0, 0))) != b""


SOURCE = default_rng(5)
FRAMES = [
    frame_of(number, SOURCE.bytes(kind.unpacker.size), system_id=255)
    for number, kind in sorted(mavlink.mavlink_map.items())
]


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_every_message_of_the_dialect_with_random_content_is_survived(kind):
    vehicle = autopilot(kind)
    for frame in FRAMES:
        vehicle.receive(frame)
    vehicle.advance(2.0)
    assert is_finite(vehicle)
    assert vehicle.counters["unhandled"] > 100


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from(FRAMES),
    st.lists(st.tuples(st.integers(0, 279), st.integers(0, 255)), min_size=1, max_size=4),
)
def test_mutated_frames_are_survived_and_change_nothing(frame, changes):
    mutated = bytearray(frame)
    for position, value in changes:
        mutated[position % len(mutated)] ^= value
    vehicle = autopilot()
    before = vehicle.truth()
    vehicle.receive(bytes(mutated))
    vehicle.receive(bytes(mutated[: len(mutated) // 2]))
    if bytes(mutated) != frame:
        assert vehicle.truth() == before


FLOATS = st.floats(width=32)


@settings(deadline=None)
@given(
    kind=st.sampled_from(["ardupilot", "px4"]),
    plant=st.sampled_from(["heading-hold", "course-hold"]),
    sent=st.lists(
        st.tuples(
            st.sampled_from(COMMANDS),
            st.tuples(st.sampled_from([0.0, 1.0, 2.0, 33.0]) | FLOATS, FLOATS, FLOATS, FLOATS),
            FLOATS,
            st.integers(0, 12),
        ),
        max_size=8,
    ),
)
def test_no_command_makes_the_flight_leave_the_finite(kind, plant, sent):
    vehicle = autopilot(kind, plant)
    for index, (number, parameters, z, frame) in enumerate(sent):
        vehicle.receive(command(number, parameters, z, frame))
        vehicle.advance(0.1 * index)
        assert is_finite(vehicle)
        assert 12.0 - 1e-6 <= vehicle.truth().airspeed_m_s <= 32.0 + 1e-6


@settings(deadline=None)
@given(st.lists(st.tuples(FLOATS, FLOATS, FLOATS, st.integers(0, 4095)), max_size=6))
def test_no_setpoint_makes_the_flight_leave_the_finite(sent):
    vehicle = autopilot("px4")
    for index, (north, east, z, mask) in enumerate(sent):
        setpoint = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 7, 1, 1, mask, 0, 0, z, north, east, 0, 0, 0, 0, 0, 0
        )
        vehicle.receive(packed(setpoint))
        vehicle.receive(command(176, (1, 6, 0, 0)))
        vehicle.advance(0.1 * index)
        assert is_finite(vehicle)


def test_ordinary_traffic_is_ignored_and_counted_as_such():
    vehicle = new_station()
    heartbeat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    assert vehicle.send(heartbeat) == []
    assert dict(vehicle.autopilot.counters) == {"ignored": 1}


def test_an_unknown_message_id_is_dropped():
    vehicle = autopilot()
    frame = struct.pack("<BBBBBBBHBBH", 0xFD, 1, 0, 0, 0, 255, 190, 0xABCD, 0x01, 7, 0)
    assert vehicle.receive(frame) == b""
    assert vehicle.counters["unknown message"] == 1
