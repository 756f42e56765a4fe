from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed, parsed, position_report


def beat() -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)


def test_a_datagram_holds_all_messages_in_order(codec):
    data = codec.encode([beat(), mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), beat()])
    assert [one.get_type() for one in parsed(data)] == ["HEARTBEAT", "ATTITUDE", "HEARTBEAT"]


def test_no_messages_are_no_bytes(codec):
    assert codec.encode([]) == b""


def test_frames_are_mavlink_2_from_the_onboard_computer_of_the_vehicle(codec):
    data = codec.encode([beat()])
    (message,) = parsed(data)
    assert data[0] == 0xFD
    assert message.get_srcSystem() == 7
    assert message.get_srcComponent() == 191


def test_sequence_numbers_are_consecutive_and_wrap_at_256(codec):
    numbers = []
    for _ in range(100):
        numbers += [message.get_seq() for message in parsed(codec.encode([beat()] * 3))]
    assert numbers == [number % 256 for number in range(300)]


def test_what_is_received_does_not_disturb_the_sequence_numbers(codec):
    codec.encode([beat()])
    codec.decode(framed(position_report()) + b"\xfdgarbage")
    (message,) = parsed(codec.encode([beat()]))
    assert message.get_seq() == 1
