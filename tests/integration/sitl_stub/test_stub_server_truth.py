import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest

from sitl_stub import Truth
from sitl_stub.links import AddressError
from tests.kit.autopilot import serve


def read(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def test_true_states_are_of_the_exact_multiples_of_their_period(autopilot, tmp_path):
    path = tmp_path / "truth.jsonl"
    asyncio.run(serve(autopilot, speedup=20.0, truth=str(path), duration_s=3.0))
    samples = read(path)
    assert [sample["time_s"] for sample in samples] == [round(k / 20, 2) for k in range(61)]
    assert set(Truth.__struct_fields__) | {"system_id"} == set(samples[0])
    assert samples[0]["system_id"] == 7
    assert autopilot.truth().time_s == 3.0


def test_a_period_that_is_no_whole_number_of_microseconds_does_not_drift(autopilot, tmp_path):
    path = tmp_path / "truth.jsonl"
    options = {"speedup": 100.0, "truth_rate_hz": 30.0, "duration_s": 10.0}
    asyncio.run(serve(autopilot, truth=str(path), **options))
    assert [sample["time_s"] for sample in read(path)] == [round(k / 30, 6) for k in range(301)]


async def test_true_states_also_go_out_as_datagrams(served, station):
    async with station() as judge:
        url = f"udpout://127.0.0.1:{judge.port}"
        async with served(truth=url, speedup=10.0, duration_s=2.0), asyncio.timeout(60.0):
            while len(judge.datagrams) < 10:
                await asyncio.sleep(0.01)
        samples = [json.loads(datagram) for datagram in judge.datagrams[:10]]
    assert [sample["time_s"] for sample in samples] == [round(k / 20, 2) for k in range(10)]
    assert all(datagram.count(b"\n") == 1 for datagram in judge.datagrams)


def test_true_states_depend_neither_on_the_speed_up_nor_on_a_late_start(
    autopilot, another_autopilot, tmp_path
):
    paths = (tmp_path / "on-time.jsonl", tmp_path / "late.jsonl")
    starts = ((autopilot, 100.0, 0.2), (another_autopilot, 10.0, -0.2))
    for path, (vehicle, speedup, from_now_s) in zip(paths, starts, strict=True):
        options = {"speedup": speedup, "truth": str(path), "duration_s": 4.0}
        asyncio.run(serve(vehicle, epoch_s=time.time() + from_now_s, **options))
    on_time, late = map(read, paths)
    assert len(late) == 81
    assert on_time == late


async def test_telemetry_begins_with_time_zero_at_the_epoch(station, served):
    epoch_s = time.time() + 0.5
    async with station() as ground:
        url = f"udpout://127.0.0.1:{ground.port}"
        async with served(url, epoch_s=epoch_s):
            await ground.message("HEARTBEAT")
            assert time.time() >= epoch_s - 1e-3
            position = await ground.message("GLOBAL_POSITION_INT")
            assert position.time_boot_ms == 0


def test_a_full_disk_ends_it_instead_of_leaving_a_hole(autopilot):
    with pytest.raises(OSError, match="No space left"):
        asyncio.run(serve(autopilot, truth="/dev/full"))


def test_only_true_states_are_overwritten(autopilot, tmp_path):
    def fly(path: Path) -> None:
        options = {"truth": str(path), "speedup": 100.0, "duration_s": 1.0}
        asyncio.run(serve(autopilot, **options))

    own, foreign = tmp_path / "truth.jsonl", tmp_path / "thesis.tex"
    foreign.write_text("years of work")
    with pytest.raises(AddressError, match="is there already, and holds no true states"):
        fly(foreign)
    assert foreign.read_text() == "years of work"
    own.write_text('{"system_id": 7, "ti')
    fly(own)
    assert {line["system_id"] for line in read(own)} == {autopilot.system_id}
