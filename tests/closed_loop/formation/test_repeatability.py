"""The same seed gives the same bytes, in one process or in several."""

from pathlib import Path
from typing import Any

import pytest

from tests.kit.missions import mission_with
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.mission import Mission

SHORT = {"duration_s": 5.0, "position_noise_m": 0.3, "link_loss": 0.2, "link_jitter_s": 0.05}


def bytes_of(mission: Mission, processes: int, tmp_path: Path) -> dict[str, bytes]:
    flight = fly_lockstep(mission, processes=processes, epoch_s=1.7e9)
    content = {}
    for name, log in flight.logs.items():
        log.write(tmp_path / "log.tlog")
        content[name] = (tmp_path / "log.tlog").read_bytes()
    return content


def test_same_seed_same_bytes_and_another_seed_others(tmp_path):
    mission = mission_with("circle-wind", rehearsal=SHORT)
    first = bytes_of(mission, 1, tmp_path)
    assert set(first) == {"leader", "f1", "f2", "f3"}
    assert all(len(content) > 12_000 for content in first.values())
    for processes in (1, 2, 3):
        assert bytes_of(mission, processes, tmp_path) == first
    second = bytes_of(mission_with("circle-wind", rehearsal={**SHORT, "seed": 2}), 1, tmp_path)
    assert first["f1"] != second["f1"]


GUSTY: dict[str, Any] = {
    "wind": {"turbulence": "moderate"},
    "rehearsal": {"duration_s": 5.0, "sensors": "standalone"},
}


@pytest.mark.parametrize(
    ("name", "sections"),
    [("circle-wind", GUSTY), ("foreign-leader", {"rehearsal": {"duration_s": 10.0}})],
    ids=["gusts and wandering receivers", "a leader without a companion"],
)
def test_a_flight_is_the_same_in_every_process(name, sections, tmp_path):
    mission = mission_with(name, **sections)
    assert bytes_of(mission, 2, tmp_path) == bytes_of(mission, 1, tmp_path)


def test_a_stopped_flight_keeps_what_was_flown():
    steps = iter([False] * 101)
    mission = mission_with("line-calm", rehearsal={"duration_s": 20.0})
    flight = fly_lockstep(mission, processes=2, stop=lambda: next(steps, True))
    assert flight.interrupted
    # 101 steps of 50 ms, the first at 0.
    assert flight.record.duration_s == 5.0
    assert len(flight.record.followers[2].north_m) == 101
