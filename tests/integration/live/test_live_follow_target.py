"""A leader that tells followers without a companion where it is, over a real socket."""

import socket
import time
from subprocess import DEVNULL, Popen
from sys import executable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.sockets import PATIENCE_S, free_port


def test_a_leader_sends_follow_target_ten_times_a_second(tmp_path):
    autopilot = f"127.0.0.1:{free_port()}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(PATIENCE_S)
        companion = [
            *("vfguide", "companion", "leader", "--mission", "circle-calm", "--insecure"),
            *("--mavlink", f"udpin://{autopilot}", "--link", "mqtt://127.0.0.1:1"),
            *("--state", str(tmp_path)),
            *("--follow-target", f"udpout://127.0.0.1:{listener.getsockname()[1]}"),
        ]
        emulator = ["sitl_stub", "--system-id", "1", "--mavlink", f"udpout://{autopilot}"]
        emulator += ["--airborne"]
        started = [
            Popen([executable, "-m", *one], stdout=DEVNULL, stderr=DEVNULL)
            for one in (companion, emulator)
        ]
        try:
            times = []
            for _ in range(30):
                (message,) = mavlink.MAVLink(None).parse_buffer(listener.recv(1024)) or ()
                times.append(time.monotonic())
                assert (message.get_type(), message.get_srcSystem()) == ("FOLLOW_TARGET", 1)
        finally:
            for one in started:
                one.terminate()
            for one in started:
                one.wait(PATIENCE_S)
    # The last twenty: at first the autopilot sends what it sends unasked.
    assert times[-1] - times[-21] == pytest.approx(2.0, abs=0.5)
