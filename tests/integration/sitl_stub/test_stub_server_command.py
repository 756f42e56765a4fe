import asyncio
import json
import signal
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from sitl_stub.links import parse_address
from tests.kit.programs import running
from tests.kit.sockets import PATIENCE_S

PIPES = {"stdout": asyncio.subprocess.PIPE, "stderr": asyncio.subprocess.PIPE}


@asynccontextmanager
async def command(*options: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """The command, until it ends or the context does."""
    async with running("sitl_stub.cli", *options, **PIPES) as process:
        async with asyncio.timeout(PATIENCE_S):
            yield process


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_it_says_where_it_is_answers_and_ends_with_0_on_a_signal(station, number):
    async with command(
        *("--system-id", "7", "--mavlink", "udpin://127.0.0.1:0", "--airborne"),
        *("--wind", "steady:5,90", "--start", "47,8,500,90", "--plant", "course-hold"),
    ) as process:
        assert process.stderr is not None
        said = (await process.stderr.readline()).decode()
        async with station(parse_address(said.split()[-1])) as ground:
            ground.send(ground.heartbeat())
            assert (await ground.message("HEARTBEAT")).get_srcSystem() == 7
            ground.send(ground.command(176, 1, 15))
            assert (await ground.message("COMMAND_ACK")).result == 0
        process.send_signal(number)
        assert await process.wait() == 0
        assert await process.stderr.read() == b""


async def test_it_ends_by_itself_and_leaves_the_true_states(tmp_path):
    path = tmp_path / "truth.jsonl"
    async with command(
        *("--system-id", "9", "--mavlink", "udpin://127.0.0.1:0", "--autopilot", "px4"),
        *("--speedup", "20", "--duration", "2", "--truth", str(path), "--truth-rate", "10"),
        *("--start", "47,8,500,90", "--airspeed", "15", "--airspeed-range", "10,20", "--airborne"),
    ) as process:
        assert await process.wait() == 0
    samples = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert len(samples) == 21
    assert {sample["system_id"] for sample in samples} == {9}
    assert samples[0]["airspeed_m_s"] == pytest.approx(15.0)
    assert samples[0]["east_m_s"] == pytest.approx(15.0)
    assert samples[0]["mode"] == "AUTO.LOITER"


async def test_many_in_one_process_have_ids_ports_and_places_that_count_up(station, tmp_path):
    path = tmp_path / "truth.jsonl"
    first = free_ports(3)
    async with command(
        *("--system-id", "5", "--count", "3", "--mavlink", f"udpin://127.0.0.1:{first}"),
        *("--truth", str(path), "--start", "47,8,500,0", "--spacing", "100"),
    ) as process:
        assert process.stderr is not None
        for index in range(3):
            said = (await process.stderr.readline()).decode().split()
            assert said[2] == str(5 + index)
            address = parse_address(said[-1])
            assert address.port == first + index
            async with station(address) as ground:
                ground.send(ground.heartbeat())
                assert (await ground.message("HEARTBEAT")).get_srcSystem() == 5 + index
        process.send_signal(signal.SIGTERM)
        assert await process.wait() == 0
    samples = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    east_m = {
        sample["system_id"]: round((sample["longitude_deg"] - 8.0) * 76_060.0) for sample in samples
    }
    assert east_m == {5: 0, 6: 100, 7: 200}


def free_ports(count: int) -> int:
    """The first of several free ports in a row."""
    for first in range(25_000, 60_000, 97):
        sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
        try:
            for index, one in enumerate(sockets):
                one.bind(("127.0.0.1", first + index))
        except OSError:
            continue
        else:
            return first
        finally:
            for one in sockets:
                one.close()
    raise AssertionError("no free ports")


async def test_a_port_in_use_is_one_line_and_status_3():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"udpin://127.0.0.1:{taken.getsockname()[1]}"
        async with command("--system-id", "1", "--mavlink", url) as process:
            output, errors = await process.communicate()
    assert (process.returncode, output) == (3, b"")
    assert errors.decode() == (
        f"sitl-stub: {url}: cannot listen "
        "(address already in use; end the program that has it, or choose another port)\n"
    )
