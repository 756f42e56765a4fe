import json
import math
from collections.abc import Iterator
from typing import Any, Literal

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.bench.figures import figures_of
from vfguide.bench.formation import FOLLOWERS, formation
from vfguide.bench.latency import render, run_latency
from vfguide.bench.wire import has_position, has_setpoint
from vfguide.mission import check_mission


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return run_latency(seconds=1.0, rate_hz=25.0)


def numbers(value: object) -> Iterator[float]:
    """Every number of a JSON value."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from numbers(one)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)


def test_result_is_json_of_finite_numbers(result: dict[str, Any]) -> None:
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    found = list(numbers(result))
    assert found
    assert all(math.isfinite(number) and number >= 0.0 for number in found)


def test_every_companion_answers_and_shows_what_it_takes(result: dict[str, Any]) -> None:
    response = result["response"]
    assert response["companions"]["names"] == ["leader", *FOLLOWERS]
    for name in response["companions"]["names"]:
        entry = response["clients"][name]
        assert entry["count"] > 0
        assert 0.0 < entry["p50_ms"] <= entry["p99_ms"] <= entry["max_ms"]
        assert entry["memory_mb"] > 1.0
    counts = [response["clients"][name]["count"] for name in response["companions"]["names"]]
    assert response["companions"]["count"] == sum(counts)


def test_peers_are_measured_beside_or_named_as_missing(result: dict[str, Any]) -> None:
    response = result["response"]
    for peer in ("bare", "pymavlink"):
        assert response["clients"][peer]["count"] > 0
    if response["mavsdk"] == "not installed":
        assert "mavsdk" not in response["clients"]
    else:
        assert response["clients"]["mavsdk"]["count"] > 0


def test_leader_state_reaches_few_and_many(result: dict[str, Any]) -> None:
    assert [entry["subscribers"] for entry in result["link_age"]] == [3, 100]
    for entry in result["link_age"]:
        assert entry["count"] > 0
        assert 0.0 < entry["p50_ms"] <= entry["p99_ms"] <= entry["max_ms"]


def test_table_has_a_line_for_everything_measured_and_required(result: dict[str, Any]) -> None:
    lines = render(result).splitlines()
    entries = [*result["response"]["clients"], "companions together", "mavsdk"]
    entries += [f"{entry['subscribers']} subscribers" for entry in result["link_age"]]
    entries += [entry["figure"] for entry in result["required"]]
    for entry in entries:
        assert any(line.startswith(entry) for line in lines), entry
    assert "load before" in lines[1]


def test_missing_peer_is_said_in_the_table(result: dict[str, Any]) -> None:
    clients = {k: v for k, v in result["response"]["clients"].items() if k != "mavsdk"}
    response = {**result["response"], "clients": clients, "mavsdk": "not installed"}
    (line,) = (
        line
        for line in render({**result, "response": response}).splitlines()
        if line.startswith("mavsdk")
    )
    assert line.split() == ["mavsdk", "not", "installed"]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_measured_flight_has_no_errors(autopilot: Literal["ardupilot", "px4"]) -> None:
    mission = formation(50.0, autopilot)
    assert not [one for one in check_mission(mission) if one.severity == "error"]


def test_figures_of_a_hundred_and_of_none() -> None:
    figures = figures_of([number * 1e-3 for number in range(100, 0, -1)])
    assert figures == {"count": 100, "p50_ms": 51.0, "p99_ms": 100.0, "max_ms": 100.0}
    assert figures_of([]) == {"count": 0}


def frame(message: mavlink.MAVLink_message) -> bytes:
    packed: bytes = message.pack(mavlink.MAVLink(None, srcSystem=1))
    return packed


HEARTBEAT = frame(mavlink.MAVLink_heartbeat_message(1, 3, 1, 15, 4, 3))
POSITION = frame(mavlink.MAVLink_global_position_int_message(1, 2, 3, 4, 5, 6, 7, 8, 9))
COURSE = frame(mavlink.MAVLink_command_int_message(1, 1, 0, 43002, 0, 0, 0, 90, 9, 0, 0, 0, 0))
SPEED = frame(mavlink.MAVLink_command_int_message(1, 1, 0, 43000, 0, 0, 0, 20, 0, 0, 0, 0, 0))
VELOCITY = frame(
    mavlink.MAVLink_set_position_target_local_ned_message(
        1, 1, 1, 1, 3527, 0, 0, 0, 15, 0, 0, 0, 0, 0, 0, 0
    )
)


def test_position_is_found_anywhere_in_a_datagram() -> None:
    assert has_position(HEARTBEAT + POSITION)
    assert not has_position(HEARTBEAT)
    assert not has_position(b"")


def test_setpoints_of_both_kinds_of_autopilot_are_found_and_a_speed_alone_is_none() -> None:
    assert has_setpoint(HEARTBEAT + COURSE + SPEED)
    assert has_setpoint(VELOCITY)
    assert not has_setpoint(HEARTBEAT + SPEED)


def test_bytes_that_are_no_frames_hold_nothing() -> None:
    assert not has_setpoint(b"\xfe\x09garbage" + COURSE)
    assert not has_setpoint(COURSE[:5])
