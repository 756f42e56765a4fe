"""The line that says what a flight did not tell, why, and what to do about it."""

from pathlib import Path

import pytest
import typer

from vfguide.commands import identify as command
from vfguide.guidance.response import HoldResponse
from vfguide.identification.core import Identification
from vfguide.identification.recording import Findings, StepsRecording, shortcoming
from vfguide.state import Airframe

AIRFRAME = Airframe()
NARROW = Airframe(airspeed_min=19.8, airspeed_max=20.2)


def response(gain: float, half_width: float) -> HoldResponse:
    return HoldResponse(
        gain=gain,
        least=gain - half_width,
        greatest=gain + half_width,
        dead_time=0.2,
        lag=0.2,
        earliest=0.3,
        latest=0.5,
        explained=0.99,
        seconds=60.0,
    )


def findings(course: HoldResponse | None, speed: HoldResponse | None) -> Findings:
    return Findings(course=course, course_samples=None, speed=speed, speed_samples=None)


GOOD, WIDE = response(0.8, 0.1), response(0.6, 0.25)


def test_nothing_is_said_where_all_is_known_well():
    assert shortcoming(findings(GOOD, GOOD), AIRFRAME, None) is None


@pytest.mark.parametrize(
    ("found", "airframe", "ended", "words"),
    [
        ((GOOD, WIDE), AIRFRAME, None, "beta_1_s (0.60, 0.35 to 0.85 1/s|response: auto"),
        ((WIDE, GOOD), AIRFRAME, None, "alpha_1_s (0.60, 0.35 to 0.85 1/s|more --repeats"),
        ((None, GOOD), AIRFRAME, None, "alpha_1_s (too few reports|rate_hz"),
        ((GOOD, None), NARROW, None, "airspeed_range_m_s leaves no room|widen it"),
        (
            (GOOD, None),
            AIRFRAME,
            "the telemetry is silent",
            "ended before its time (the telemetry is silent)|beta_1_s|fly it again",
        ),
        ((GOOD, GOOD), AIRFRAME, "stopped", "(stopped)|fewer steps than planned"),
    ],
)
def test_one_line_says_what_was_not_learned_why_and_the_remedy(found, airframe, ended, words):
    line = shortcoming(findings(*found), airframe, ended)
    assert line is not None
    assert "\n" not in line
    for one in words.split("|"):
        assert one in line


def test_the_command_ends_with_1_and_the_line(monkeypatch, capsys):
    async def fly_steps(identification: Identification, *_: object, **__: object) -> None:
        identification.stop(0.0)

    monkeypatch.setattr(command, "fly_steps", fly_steps)
    monkeypatch.setattr(StepsRecording, "findings", lambda _self: findings(GOOD, None))
    with pytest.raises(typer.Exit) as ended:
        command.identify(
            "leader", mission=Path("missions/line-calm.yaml"), mavlink="udpin://127.0.0.1:14999"
        )
    out, err = capsys.readouterr()
    assert ended.value.exit_code == 1
    assert "alpha_1_s: 0.800" in out
    assert err.splitlines()[-1].startswith(
        "the flight ended before its time (stopped), not learned: beta_1_s"
    )
