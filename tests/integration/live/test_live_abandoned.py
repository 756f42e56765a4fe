"""A live flight whose own process is gone, or whose broker was never there."""

import asyncio
import signal
import socket
import sys
from pathlib import Path

from tests.kit.programs import vfguide
from tests.kit.sockets import until
from vfguide.lab.rehearsal.processes import free_port

FLY = (sys.executable, "-m", "vfguide", "fly", "line-calm", "--live")


async def test_no_process_outlives_the_flight_that_started_it(tmp_path):
    flight = await asyncio.create_subprocess_exec(
        *FLY, "--link=mqtt", "--out", str(tmp_path / "out")
    )
    # The broker, four companions and four emulators.
    await until(lambda: len(children_of(flight.pid)) >= 9)
    children = children_of(flight.pid)
    flight.send_signal(signal.SIGKILL)
    await flight.wait()
    await until(lambda: not any(is_running(one) for one in children))


async def test_a_broker_that_is_not_there_is_told_before_the_flight(tmp_path):
    link = f"mqtt://127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    flight = await vfguide("fly", "line-calm", "--live", "--link", link, "--out", tmp_path / "out")
    assert flight.status == 3
    assert flight.err == (
        f"link {link}/vfguide: Connection refused; start a broker there, or correct the address of the link\n"
    )


def children_of(pid: int) -> list[int]:
    listed = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(word) for one in listed for word in one.read_text().split()]


def is_running(pid: int) -> bool:
    """Whether it lives; one that waits to be buried does not."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] != "Z"
