"""A pilot who may have flown unseen has flown: the vehicle is not engaged by itself any more."""

from collections.abc import Callable
from typing import Any, Protocol

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, Truth
from tests.kit.companion import leader_bytes, new_flight
from tests.kit.wire import parsed, spoken

Make = Callable[..., Any]

SET_MODE, MESSAGE_INTERVAL = 176, 511
HOLD = {"ardupilot": (12, 0), "px4": (4, 3)}
MANUAL = {"ardupilot": (0, 0), "px4": (1, 0)}
HELD = {"ardupilot": "LOITER", "px4": "AUTO.LOITER"}
KINDS = ["ardupilot", "px4"]


class Flown(Protocol):
    """A flight, as far as it can be left unseen."""

    now: float
    deaf: bool

    def run(self, until_s: float) -> None: ...

    def hang(self, until_s: float) -> None: ...


def deaf(flown: Flown, until_s: float, between: Callable[[], None]) -> None:
    """Nothing is heard for a while in which something happens."""
    flown.deaf = True
    flown.run((flown.now + until_s) / 2.0)
    between()
    flown.run(until_s)
    flown.deaf = False


def hung(flown: Flown, until_s: float, between: Callable[[], None]) -> None:
    """The companion stands still for a while in which something happens."""
    flown.hang((flown.now + until_s) / 2.0)
    between()
    flown.hang(until_s)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_request_that_nobody_has_answered_is_forgotten_by_one_that_did_not_watch(kind, away):
    flown = new_flight(kind=kind)
    flown.lose = frozenset({SET_MODE})
    flown.run(5.5)
    assert flown.times(SET_MODE)

    def fly_by_hand() -> None:
        flown.pilot(*MANUAL[kind])
        flown.pilot(*HOLD[kind])

    away(flown, 20.0, fly_by_hand)
    flown.lose = frozenset()
    flown.run(50.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.autopilot.truth().mode == HELD[kind]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_vehicle_that_waits_for_its_leader_is_not_engaged_after_it_was_not_watched(kind, away):
    flown = new_flight(kind=kind, link=lambda now: [leader_bytes(now)] if now >= 20.0 else [])
    flown.run(4.0)

    def fly_by_hand() -> None:
        flown.pilot(*MANUAL[kind])
        flown.pilot(*HOLD[kind])

    away(flown, 14.0, fly_by_hand)
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    reasons = [text for _, text in flown.texts() if "heartbeats were not heard" in text]
    assert len(reasons) == 1
    assert reasons[0].endswith("to be steered")


@pytest.fixture
def astray() -> Callable[..., Any]:
    """Makes an autopilot one whose positions are lost, or 5 km off, while it is told so."""

    class Astray:
        wrong = True

        def __init__(self, autopilot: Autopilot, *, lies: bool) -> None:
            self._autopilot, self._lies = autopilot, lies

        def truth(self) -> Truth:
            return self._autopilot.truth()

        def receive(self, data: bytes) -> bytes:
            return self._autopilot.receive(data)

        def advance(self, now: float) -> bytes:
            edited = map(self._edited, parsed(self._autopilot.advance(now)))
            return bytes(spoken(*(one for one in edited if one is not None)))

        def _edited(self, message: mavlink.MAVLink_message) -> mavlink.MAVLink_message | None:
            if not self.wrong or message.get_type() != "GLOBAL_POSITION_INT":
                return message
            if not self._lies:
                return None
            message.lat += 500_000
            return message

    return Astray


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lies", [False, True])
def test_flying_by_hand_without_positions_spends_the_right_to_engage(astray, kind, lies):
    flown = new_flight(kind=kind, link=lambda now: [leader_bytes(now)] if now >= 18.0 else [])
    flown.autopilot = astray(flown.autopilot, lies=lies)
    flown.autopilot.wrong = False
    flown.run(4.0)
    flown.autopilot.wrong = True
    flown.run(8.0)
    flown.pilot(*MANUAL[kind])
    flown.run(12.0)
    flown.pilot(*HOLD[kind])
    flown.run(15.0)
    flown.autopilot.wrong = False
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    assert flown.autopilot.truth().mode == HELD[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_one_lost_heartbeat_hides_no_flight(kind):
    flown = new_flight(kind=kind, link=lambda now: [leader_bytes(now)] if now >= 10.0 else [])
    flown.run(5.5)
    flown.deaf = True
    flown.run(6.5)
    flown.deaf = False
    flown.run(20.0)
    assert len(flown.times(SET_MODE)) == 1
