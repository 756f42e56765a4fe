"""What the pilot hears of reports that are not believed, and that a recovery is one."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, Truth
from vfguide.companion.distrust import Doubt
from vfguide.companion.plausibility import Judgement, Verdict
from vfguide.companion.supervisor import Mode

Make = Callable[..., Any]

RTL = 11


def told(faults: Iterable[tuple[float, float]], until_s: float) -> list[tuple[float, str]]:
    """When what is said of a speed that is wrong in these spans, at ten reports a second."""
    doubt, spans, words = Doubt(), list(faults), []
    for step in range(round(until_s * 10)):
        now = step / 10
        wrong = any(begin <= now < end for begin, end in spans)
        verdict = Verdict.REFUSED if wrong else Verdict.BELIEVED
        doubt.note(Judgement(verdict=verdict, north=0.0, east=0.0, reason="a speed"), now)
        words += [(now, word) for word in doubt.words()]
    return words


def test_a_second_fault_that_lasts_is_told_soon_after_the_first() -> None:
    words = told([(20.0, 20.4), (24.0, 90.0)], 60.0)
    assert [time for time, _ in words] == [20.0, 20.4, 25.0]
    assert words[2][1].startswith("a speed: not steered")
    # Other words than the first time: texts that say the same are sent once in half a minute.
    assert words[2][1] != words[0][1]


def test_each_recovery_that_follows_a_fault_of_which_was_told_is_told() -> None:
    words = [word for _, word in told([(20.0, 21.0), (24.0, 26.0)], 60.0)]
    assert [word.startswith("position and velocity are right again") for word in words] == [
        False,
        True,
        False,
        True,
    ]
    assert len(set(words)) == 4


def test_a_fault_that_comes_and_goes_is_no_flood() -> None:
    words = told([(20.0 + 0.5 * k, 20.2 + 0.5 * k) for k in range(60)], 60.0)
    assert len(words) <= 8


@pytest.fixture
def edited(parsed: Make, spoken: Make) -> Callable[..., Any]:
    """Makes an autopilot one whose estimator has no position for some time."""

    class Edited:
        def __init__(self, autopilot: Autopilot, begin: float, end: float) -> None:
            self._autopilot, self._span = autopilot, (begin, end)

        def truth(self) -> Truth:
            return self._autopilot.truth()

        def receive(self, data: bytes) -> bytes:
            return self._autopilot.receive(data)

        def advance(self, now: float) -> bytes:
            said = parsed(self._autopilot.advance(now))
            for message in said:
                if (
                    message.get_type() == "EKF_STATUS_REPORT"
                    and self._span[0] <= now < self._span[1]
                ):
                    message.flags = 1 | 2 | 4 | 32
            return bytes(spoken(*said))

    return Edited


def test_an_estimator_that_comes_back_is_steered_by_once(flight: Make, edited: Make) -> None:
    flown = flight()
    flown.autopilot = edited(flown.autopilot, 40.0, 45.0)
    flown.run(70.0)
    changes = [text for time, text in flown.events if time > 38.0 and "->" in text]
    assert changes == ["tracking -> waiting", "waiting -> tracking"]
    (back,) = [time for time, text in flown.events if text == "waiting -> tracking"]
    assert 46.5 < back < 48.5
    texts = [text for time, text in flown.texts() if time > 38.0]
    assert sum("not steered until it has been right" in text for text in texts) == 1
    assert sum("are right again" in text for text in texts) == 1


def test_a_mode_that_the_autopilot_denies_is_not_called_the_pilots(
    flight: Make, spoken: Make
) -> None:
    flown = flight()
    flown.run(15.0)
    flown.pilot(RTL)
    flown.run(18.0)
    forged = mavlink.MAVLink_heartbeat_message(1, 3, 129, 15, 4, 3)
    flown.forge = lambda _now: spoken(forged)
    flown.run(24.0)
    assert flown.mode_at(24.0) is Mode.PILOT
    # Texts have 2 s between them, and warnings come before this one.
    flown.run(30.0)
    later = [text for time, text in flown.texts() if time > 18.0]
    assert not any("GUIDED: the pilot flies" in text for text in later)
    assert any("the autopilot denies being in GUIDED" in text for text in later)
