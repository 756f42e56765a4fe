import json
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


def test_every_companion_and_its_peers_answer_and_show_what_they_take(result):
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    response = result["response"]
    assert response["companions"]["names"] == ["leader", "f1", "f2", "f3"]
    for name in response["companions"]["names"]:
        entry = response["clients"][name]
        assert entry["count"] > 0
        assert 0.0 < entry["p50_ms"] <= entry["p99_ms"] <= entry["max_ms"]
        assert entry["memory_mb"] > 1.0
    counts = [response["clients"][name]["count"] for name in response["companions"]["names"]]
    assert response["companions"]["count"] == sum(counts)
    assert ("mavsdk" in response["clients"]) is (response["mavsdk"] != "not installed")
    for peer in {"bare", "pymavlink", "mavsdk"} & response["clients"].keys():
        assert response["clients"][peer]["count"] > 0
    assert {"bare", "pymavlink"} <= response["clients"].keys()


def test_table_has_a_line_for_everything_measured_and_for_a_peer_that_is_missing(result):
    lines = render(result).splitlines()
    for entry in (*result["response"]["clients"], "companions together", "mavsdk"):
        assert any(line.startswith(f"| {entry} |") for line in lines), entry
    assert "load before" in lines[1]
    clients = {k: v for k, v in result["response"]["clients"].items() if k != "mavsdk"}
    response = {**result["response"], "clients": clients, "mavsdk": "not installed"}
    without = render({**result, "response": response}).splitlines()
    (line,) = (line for line in without if line.startswith("| mavsdk"))
    assert line.startswith("| mavsdk | not installed | ")
