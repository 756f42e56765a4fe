"""Leaders and followers without a companion, on the command line of those who have one."""

import pytest

ANY, TARGET = "udpin://0.0.0.0:1", "udpout://127.0.0.1:1"


@pytest.mark.parametrize(
    ("mission", "vehicle", "options", "told"),
    [
        ("foreign-leader", "leader", (), "'leader' flies without a companion in foreign-leader"),
        ("circle-calm", "f1", ("--leader", ANY), "--leader: the leader of circle-calm"),
        ("foreign-leader", "f1", ("--leader", "nowhere"), "MAVLink address"),
        (
            "circle-calm",
            "f1",
            ("--follow-target", TARGET),
            "--follow-target: 'f1' does not lead circle-calm",
        ),
    ],
)
def test_what_cannot_be_is_told_in_a_line(mission, vehicle, options, told, command):
    outcome = command(
        *("companion", vehicle, "--mission", mission, "--mavlink", "udpin://127.0.0.1:14540"),
        *("--link", "udp://127.0.0.1:14700", "--insecure", *options),
    )
    assert outcome.status == 2
    assert told in outcome.err
    assert len(outcome.lines) == 1
