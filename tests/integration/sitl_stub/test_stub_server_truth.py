import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest

from sitl_stub import Truth
from sitl_stub.links import AddressError
from tests.kit.autopilot import new_autopilot, serve


def read(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


# 1/30 s is no whole number of microseconds, and must not drift.
@pytest.mark.parametrize(("rate_hz", "seconds"), [(20, 3), (30, 10)])
def test_true_states_are_of_the_exact_multiples_of_their_period(
    autopilot, tmp_path, rate_hz, seconds
):
    path = tmp_path / "truth.jsonl"
    options = {"speedup": 100.0, "truth_rate_hz": float(rate_hz), "duration_s": float(seconds)}
    asyncio.run(serve(autopilot, truth=str(path), **options))
    samples = read(path)
    times = [round(k / rate_hz, 6) for k in range(seconds * rate_hz + 1)]
    assert [sample["time_s"] for sample in samples] == times
    assert set(Truth.__struct_fields__) | {"system_id"} == set(samples[0])
    assert samples[0]["system_id"] == 7
    assert autopilot.truth().time_s == seconds


async def test_true_states_also_go_out_as_datagrams(served, station):
    async with station() as judge:
        url = f"udpout://127.0.0.1:{judge.port}"
        async with served(truth=url, speedup=10.0, duration_s=2.0), asyncio.timeout(60.0):
            while len(judge.datagrams) < 10:
                await asyncio.sleep(0.01)
        samples = [json.loads(datagram) for datagram in judge.datagrams[:10]]
    assert [sample["time_s"] for sample in samples] == [round(k / 20, 2) for k in range(10)]
    assert all(datagram.count(b"\n") == 1 for datagram in judge.datagrams)


def test_true_states_depend_neither_on_the_speed_up_nor_on_a_late_start(autopilot, tmp_path):
    paths = (tmp_path / "on-time.jsonl", tmp_path / "late.jsonl")
    starts = ((autopilot, 100.0, 0.2), (new_autopilot(), 10.0, -0.2))
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
