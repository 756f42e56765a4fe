"""Options of a companion that do not go with its mission, on the command line."""

from pathlib import Path

import pytest

ANY, TARGET = "udpin://0.0.0.0:1", "udpout://127.0.0.1:1"


@pytest.mark.parametrize(
    ("mission", "vehicle", "options", "told"),
    [
        ("foreign-leader", "leader", (), "'leader' flies without a companion in foreign-leader"),
        ("circle-calm", "f1", ("--leader", ANY), "--leader: the leader of circle-calm"),
        ("foreign-leader", "f1", ("--leader", "nowhere"), "MAVLink address"),
        ("circle-calm", "f1", ("--follow-target", TARGET), "'f1' does not lead circle-calm"),
    ],
)
def test_what_cannot_be_is_told_in_a_line(mission, vehicle, options, told, refusal):
    link = ("--mavlink", "udpin://127.0.0.1:14540", "--link", "udp://127.0.0.1:14700")
    words = ("companion", vehicle, "--mission", mission, *link, "--insecure", *options)
    assert told in refusal(*words)


@pytest.mark.parametrize("verb", ["companion", "identify"])
def test_what_mavsdk_does_not_hand_on_is_not_waited_for(verb, command, tmp_path):
    mission, key = tmp_path / "mission.yaml", tmp_path / "key"
    flown = (Path(__file__).parents[3] / "missions/px4-sitl.yaml").read_text(encoding="utf-8")
    mission.write_text(flown.replace("autopilot: px4", "autopilot: mavsdk"), encoding="utf-8")
    key.write_text("a passphrase", encoding="utf-8")
    words = [verb, "f1", "--mission", mission, "--mavlink", "udpin://127.0.0.1:14540"]
    refused = [("--signing-key-file", key)]
    if verb == "companion":
        words += ["--link", "udp://127.0.0.1:14700", "--insecure"]
        refused += [("--ground-station-orders",)]
    for option in refused:
        outcome = command(*words, *option)
        assert outcome.status == 2
        assert f"{option[0]}: MAVSDK does not hand that on" in outcome.err
