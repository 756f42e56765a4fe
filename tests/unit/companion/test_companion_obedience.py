"""An autopilot that refuses what it is steered by, or accepts it and flies something else."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import (
    ALTITUDE,
    HEADING,
    KINDS,
    SET_MODE,
    SPEED,
    Flight,
    emulator,
    new_flight,
)
from tests.kit.missions import shipped
from tests.kit.wire import spoken
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of
from vfguide.companion.obedience import Obedience
from vfguide.link.presence import LONGEST_TEXT
from vfguide.mavlink.reports import CommandReport

STEERING = frozenset({HEADING, SPEED, ALTITUDE})
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4


def reason(companion: Companion, now: float = 15.0) -> str | None:
    found = companion.objection(now)
    return None if found is None else found.text


def flown_by(
    result: int, *, commands: frozenset[int] = STEERING, until_s: float = 15.0, **options: Any
) -> Flight:
    return new_flight(**options, answers=dict.fromkeys(commands, result), until_s=until_s)


@pytest.mark.parametrize(
    ("kind", "commands", "refused"),
    [
        ("ardupilot", STEERING, ""),
        ("ardupilot", frozenset({HEADING}), " GUIDED_CHANGE_HEADING (UNSUPPORTED)"),
        ("ardupilot", frozenset({SPEED}), " GUIDED_CHANGE_SPEED (UNSUPPORTED)"),
        ("px4", frozenset({HEADING}), " GUIDED_CHANGE_HEADING (UNSUPPORTED)"),
    ],
)
def test_an_autopilot_without_a_steering_command_is_handed_back_at_once(kind, commands, refused):
    flown = flown_by(UNSUPPORTED, commands=commands, kind=kind)
    engaged = flown.times(SET_MODE)[0]
    words = f"not steered: the autopilot refuses{refused}"
    told = next(time for time, text in flown.texts() if words in text)
    assert told <= engaged + 3.0
    assert flown.autopilot_mode == "LOITER"
    assert len(flown.times(SET_MODE)) == 2
    # Nothing is asked of it again, however long it flies.
    assert flown.later(HEADING, engaged + 3.0) == []
    assert flown.companion.obstacle(15.0) == reason(flown.companion)


@pytest.mark.parametrize("result", [DENIED, FAILED])
def test_an_autopilot_that_refuses_courses_in_its_guided_mode_is_handed_back(result):
    flown = flown_by(result)
    assert flown.autopilot_mode == "LOITER"
    assert any("refuses GUIDED_CHANGE_" in text for _, text in flown.events)
    # Whoever selects GUIDED again lets it try again.
    assert reason(flown.companion) is None


@pytest.mark.parametrize("kind", KINDS)
def test_an_autopilot_that_accepts_courses_and_flies_none_is_told_of_and_handed_back(kind):
    flown = flown_by(ACCEPTED, until_s=25.0, kind=kind)
    engaged = flown.times(SET_MODE)[0]
    (complained,) = [time for time, text in flown.events if "follow the setpoints: asked" in text]
    assert complained <= engaged + (8.0 if kind == "ardupilot" else 8.2)
    (gave_up,) = [time for time, text in flown.events if "flies none: handed back" in text]
    assert gave_up <= complained + 6.0
    assert flown.autopilot_mode == "LOITER"


def on_the_ground(answers: dict[int, int]) -> Flight:
    """A companion whose vehicle stands disarmed for 10 s."""
    flown = new_flight(link=lambda _now: [])
    flown.autopilot = emulator(
        north=0.0, east=0.0, altitude_amsl_m=488.0, airborne=False, armed=False
    )
    flown.answers = answers
    flown.run(10.0)
    return flown


def test_on_the_ground_a_firmware_without_guided_commands_is_no_go():
    flown = on_the_ground(dict.fromkeys(STEERING, UNSUPPORTED))
    objection = reason(flown.companion)
    assert flown.companion.obstacle(10.0) == objection
    assert objection == (
        "the autopilot refuses GUIDED_CHANGE_HEADING (UNSUPPORTED): use firmware built with guided commands"
    )
    assert len(objection) <= LONGEST_TEXT
    refusals = [text for _, text in flown.events if "refuses" in text]
    assert refusals == [f"not steered: {objection}"]


def test_on_the_ground_a_usual_firmware_is_asked_once_and_nobody_hears_of_it():
    flown = on_the_ground({})
    assert reason(flown.companion) is None
    assert [text for _, text in flown.events if "GUIDED_CHANGE" in text] == []


def test_after_a_reboot_it_is_asked_anew():
    flown = flown_by(UNSUPPORTED, until_s=8.0)
    assert reason(flown.companion) is not None
    flown.reboot()
    flown.answers = {}
    flown.run(12.0)
    assert reason(flown.companion) is None


def test_a_single_answer_in_anothers_name_ends_nothing():
    flown = new_flight(until_s=10.0)
    stray = spoken(mavlink.MAVLink_command_ack_message(HEADING, UNSUPPORTED))
    flown.companion.receive_mavlink(stray, 10.05)
    flown.run(15.0)
    assert flown.mode_at(15.0).steers


ANSWER = st.tuples(st.integers(0, 65_535), st.integers(0, 255), st.floats(0.0, 3.0), st.booleans())


@given(st.lists(ANSWER, max_size=40))
def test_answers_of_other_commands_never_speak_against_it(answers):
    obedience = Obedience(adapter_of(shipped("line-calm").vehicles["f1"]))
    now = 0.0
    for command, result, passed, guided in answers:
        now += passed
        if command not in STEERING:
            obedience.hear(CommandReport(command=command, result=result), now, guided=guided)
    assert obedience.refusal is None
