"""What a ground station reads of a stream: frames of the wanted messages, however the stream is cut."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.autopilots.ground_station import wanted_frames

WRITER = mavlink.MAVLink(None, srcSystem=3, srcComponent=1)
CLOCK = mavlink.MAVLink_system_time_message(0, 1234).pack(WRITER)
ATTITUDE = mavlink.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0).pack(WRITER)


def test_frames_come_whole_wherever_the_stream_is_cut():
    stream = CLOCK + ATTITUDE + CLOCK
    for cut in range(1, len(stream)):
        first, waiting = wanted_frames(stream[:cut])
        second, left = wanted_frames(waiting + stream[cut:])
        assert [frame.content for frame in (*first, *second)] == [CLOCK, CLOCK]
        assert left == b""


def test_noise_before_a_frame_is_passed_over():
    frames, left = wanted_frames(b"boot: ok\n" + CLOCK)
    assert [(frame.message_id, frame.system_id) for frame in frames] == [(2, 3)]
    assert left == b""
