"""Leaders and followers without a companion, on the command line of those who have one."""

from collections.abc import Callable
from typing import Any

import pytest

Make = Callable[..., Any]


def companion(command: Make, mission: str, vehicle: str, *options: str) -> Any:
    return command(
        *("companion", vehicle, "--mission", mission, "--mavlink", "udpin://127.0.0.1:14540"),
        *("--link", "udp://127.0.0.1:14700", "--insecure", *options),
    )


@pytest.mark.parametrize(
    ("mission", "vehicle", "options", "told"),
    [
        ("foreign-leader", "leader", (), "'leader' flies without a companion in foreign-leader"),
        (
            "circle-calm",
            "f1",
            ("--leader", "udpin://0.0.0.0:1"),
            "--leader: the leader of circle-calm",
        ),
        ("foreign-leader", "f1", ("--leader", "nowhere"), "MAVLink address"),
        (
            "circle-calm",
            "f1",
            ("--follow-target", "udpout://127.0.0.1:1"),
            "--follow-target: 'f1' does not lead circle-calm",
        ),
    ],
)
def test_what_cannot_be_is_told_in_a_line(mission, vehicle, options, told, command):
    outcome = companion(command, mission, vehicle, *options)
    assert outcome.status == 2
    assert told in outcome.err
    assert len(outcome.lines) == 1
