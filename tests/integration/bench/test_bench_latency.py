import json
import math
from collections.abc import Iterator
from typing import Any

import pytest

from vfguide.lab.studies.latency import render, run_latency


@pytest.fixture(scope="module")
def measured() -> list[dict[str, Any]]:
    """What was measured so far."""
    return []


@pytest.fixture
def result(request: pytest.FixtureRequest, measured: list[dict[str, Any]]) -> dict[str, Any]:
    """What was measured at last; a test that has failed, and is run again, measures again."""
    if len(measured) < getattr(request.node, "execution_count", 1):
        measured.append(run_latency(seconds=1.0, rate_hz=25.0))
    return measured[-1]


def numbers(value: object) -> Iterator[float]:
    """Every number of a JSON value."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from numbers(one)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)


def test_result_is_json_of_finite_numbers(result):
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    found = list(numbers(result))
    assert found
    assert all(math.isfinite(number) and number >= 0.0 for number in found)


def test_every_companion_answers_and_shows_what_it_takes(result):
    response = result["response"]
    assert response["companions"]["names"] == ["leader", "f1", "f2", "f3"]
    for name in response["companions"]["names"]:
        entry = response["clients"][name]
        assert entry["count"] > 0
        assert 0.0 < entry["p50_ms"] <= entry["p99_ms"] <= entry["max_ms"]
        assert entry["memory_mb"] > 1.0
    counts = [response["clients"][name]["count"] for name in response["companions"]["names"]]
    assert response["companions"]["count"] == sum(counts)


def test_peers_are_measured_beside_or_named_as_missing(result):
    response = result["response"]
    for peer in ("bare", "pymavlink"):
        assert response["clients"][peer]["count"] > 0
    if response["mavsdk"] == "not installed":
        assert "mavsdk" not in response["clients"]
    else:
        assert response["clients"]["mavsdk"]["count"] > 0


def test_table_has_a_line_for_everything_measured(result):
    lines = render(result).splitlines()
    entries = [*result["response"]["clients"], "companions together", "mavsdk"]
    for entry in entries:
        assert any(line.startswith(f"| {entry} |") for line in lines), entry
    assert "load before" in lines[1]


def test_missing_peer_is_said_in_the_table(result):
    clients = {k: v for k, v in result["response"]["clients"].items() if k != "mavsdk"}
    response = {**result["response"], "clients": clients, "mavsdk": "not installed"}
    (line,) = (
        line
        for line in render({**result, "response": response}).splitlines()
        if line.startswith("| mavsdk")
    )
    assert line.startswith("| mavsdk | not installed | ")
