"""Time stamps that stand still, or count in another unit: heard by when messages arrive, and told."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import new_flight
from tests.kit.wire import parsed
from tests.unit.companion.test_companion_leader_telemetry import (
    listener,
    northbound,
    packed,
    position,
    said,
)
from vfguide.companion.alerts import Alerts


class Stamped:
    """An autopilot whose boot times are others."""

    def __init__(self, autopilot: Any, stamp: Callable[[int], int]) -> None:
        self._autopilot, self._stamp = autopilot, stamp

    def advance(self, now: float) -> bytes:
        out = b""
        for one in parsed(self._autopilot.advance(now)):
            if one.get_type() == "GLOBAL_POSITION_INT":
                one.time_boot_ms = self._stamp(one.time_boot_ms)
            sender = mavlink.MAVLink(None, 2, 1)
            sender.seq = one.get_seq()
            out += bytes(one.pack(sender))
        return out

    def receive(self, data: bytes) -> bytes:
        return bytes(self._autopilot.receive(data))


WRONG = {
    "zero": (lambda _ms: 0, "stand still"),
    "stuck": (lambda _ms: 123_456, "stand still"),
    "microseconds": (lambda ms: ms * 1000 % 2**32, "run 1000 times too fast"),
    "seconds": (lambda ms: ms // 1000, "times too slow"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_an_own_boot_time_that_tells_no_time_is_told_and_flown_by_arrival(kind):
    stamp, words = WRONG[kind]
    flown = new_flight()
    flown.autopilot = Stamped(flown.autopilot, stamp)  # type: ignore[assignment]
    flown.run(20.0)
    (text,) = [text for _, text in flown.events if "boot times" in text]
    assert words in text
    assert "flown by when its reports arrive" in text
    assert flown.mode_at(20.0).steers


def test_boot_times_that_tell_time_again_are_gone_by_and_end_no_right_to_engage():
    flown = new_flight()
    flown.autopilot = Stamped(flown.autopilot, lambda ms: 5000 if 8_000 < ms < 12_000 else ms)  # type: ignore[assignment]
    flown.run(32.0)
    texts = [text for _, text in flown.events if "boot times" in text]
    assert [("stand still" in text, "tell time again" in text) for text in texts] == [
        (True, False),
        (False, True),
    ]
    assert not any("rebooted" in text for _, text in flown.events)
    assert flown.mode_at(32.0).steers


@pytest.mark.parametrize("rate", [0.0, 1e-3, 1000.0])
def test_a_leader_whose_stamps_tell_no_time_is_followed_by_arrival(rate):
    alerts = Alerts()
    telemetry = listener(alerts)
    for step in range(41):
        sent_s = 0.25 * step
        message = position(sent_s, 20.0 * sent_s, 0.0)
        message.time_boot_ms = round(message.time_boot_ms * rate) % 2**32
        telemetry.take(packed(message), sent_s + 0.2)
    newest = telemetry.newest
    assert newest is not None
    # The listener is told that the fastest message takes 0.2 s.
    assert newest.time_s == pytest.approx(10.0, abs=0.01)
    assert newest.north == pytest.approx(200.0, abs=0.5)
    (text,) = said(alerts)
    assert text.startswith("sends time stamps that ")
    assert "followed by when its messages arrive" in text


def test_a_leader_whose_messages_repeat_wholly_is_not_taken_for_one_without_a_clock():
    alerts = Alerts()
    telemetry = listener(alerts)
    for step in range(40):
        telemetry.take(northbound(5.0), 5.2 + 0.25 * step)
    assert telemetry.newest is not None
    assert telemetry.newest.time_s == pytest.approx(5.0, abs=0.01)
    assert said(alerts) == []
