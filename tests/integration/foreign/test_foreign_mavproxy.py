"""MAVProxy, as its users type it, against the emulator with ArduPlane's manners."""

import asyncio
import os
import sys
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.programs import running
from tests.kit.sockets import PATIENCE_S, free_port


class Console:
    """MAVProxy's prompt."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process
        self._said = ""

    def type(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line.encode() + b"\n")

    async def says(self, words: str) -> str:
        """Wait until it has said these words; what came after them is looked at next time."""
        assert self._process.stdout is not None
        try:
            async with asyncio.timeout(PATIENCE_S):
                while words not in self._said:
                    data = await self._process.stdout.read(4096)
                    assert data, f"MAVProxy has ended: {self._said}"
                    self._said += data.decode(errors="replace")
        except TimeoutError:
            pytest.fail(f"MAVProxy never said {words!r}, but: {self._said}")
        before, self._said = self._said.split(words, 1)
        return before


@asynccontextmanager
async def console(
    program: Path,
    state: Path,
    port: int,
    modules: str = "mode,arm,param,wp,cmdlong",
    outputs: Sequence[int] = (),
) -> AsyncIterator[Console]:
    state.mkdir()
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, str(program)),
        f"--master=udpin:127.0.0.1:{port}",
        *(f"--out=udpout:127.0.0.1:{output}" for output in outputs),
        f"--default-modules={modules}",
        f"--state-basedir={state}",
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        cwd=state,
        env={
            **os.environ,
            "PYTHONPATH": str(program.parents[1]),
            "PYTHONUNBUFFERED": "1",
            "HOME": str(state),
            "MPLBACKEND": "agg",
        },
    )
    try:
        yield Console(process)
    finally:
        process.kill()
        await process.communicate()


async def test_it_loads_parameters_arms_takes_off_and_flies_guided(emulate, mavproxy, tmp_path):
    async with (
        emulate("--speedup", "5", "--ready-after", "2", "--plant", "bank") as emulation,
        console(mavproxy, tmp_path / "state", emulation.port) as ground,
    ):
        await ground.says("Detected vehicle 1:1")
        await ground.says("Received ")
        assert int((await ground.says(" parameters")).strip()) > 40
        ground.type("param show GUIDED_P")
        await ground.says("12000")
        ground.type("param set TKOFF_ALT 60")
        ground.type("wp list")
        await ground.says("Requesting 0 waypoints")
        ground.type("arm throttle")
        await ground.says("ARMED")
        ground.type("mode TAKEOFF")
        await ground.says("Mode TAKEOFF")
        height_m = 588.0 + 60.0
        await emulation.until(lambda state: state["altitude_amsl_m"] > height_m - 2.0)
        ground.type("mode GUIDED")
        await ground.says("Mode GUIDED")
        # GUIDED_CHANGE_HEADING: course over ground, 200 degrees, 9.8 m/s^2.
        ground.type("long 43002 0 200 9.8")
        await ground.says("ACCEPTED")
        await emulation.until(lambda state: abs(state["course_rad"] - 3.4907) < 0.01)


async def test_disarming_in_the_air_and_leaving_the_airspeed_range_are_refused(
    emulate, mavproxy, tmp_path
):
    async with (
        emulate("--airborne") as emulation,
        console(mavproxy, tmp_path / "state", emulation.port) as ground,
    ):
        await ground.says("online system 1")
        ground.type("disarm")
        await ground.says("COMPONENT_ARM_DISARM: FAILED")
        ground.type("mode GUIDED")
        await ground.says("Mode GUIDED")
        ground.type("long 43000 0 40 0")
        await ground.says("FAILED")
        ground.type("long 43000 1 20 0")
        await ground.says("DENIED")
        assert emulation.latest()["armed"]


async def test_a_signed_link_is_set_up_with_its_passphrase(emulate, mavproxy, tmp_path):
    options = ("--airborne", "--signing-key", "sesame-4711")
    modules = "mode,arm,signing"
    async with (
        emulate(*options) as emulation,
        console(mavproxy, tmp_path / "state", emulation.port, modules) as ground,
    ):
        await ground.says("Detected vehicle 1:1")
        ground.type("mode GUIDED")
        await asyncio.sleep(1.0)  # an unsigned command has had every chance to be obeyed
        assert emulation.latest()["mode"] == "LOITER"
        ground.type("signing key sesame-4711")
        ground.type("mode GUIDED")
        await ground.says("Mode GUIDED")
        await emulation.until(lambda state: state["mode"] == "GUIDED")


class Listener(asyncio.DatagramProtocol):
    """A ground station that only listens, and counts what it hears by component and kind."""

    def __init__(self) -> None:
        self.heard: Counter[tuple[int, str]] = Counter()
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True

    def datagram_received(self, data: bytes, _from: object) -> None:
        for message in self._parser.parse_buffer(data) or []:
            self.heard[message.get_srcComponent(), message.get_type()] += 1


@asynccontextmanager
async def companion(port: int, directory: Path) -> AsyncIterator[None]:
    """The companion of system 1, which hears nobody on its link."""
    link = f"udp://127.0.0.1:{free_port()}?port={free_port()}"
    words = ("companion", "leader", "--mission", "circle-calm", "--insecure", "--link", link)
    places = ("--mavlink", f"udpin://127.0.0.1:{port}", "--state", directory / "companion")
    async with running("vfguide", *words, *places, stderr=asyncio.subprocess.DEVNULL) as process:
        yield
        assert process.returncode is None


async def test_a_companion_at_its_output_reaches_the_autopilot_and_no_other_output(
    emulate, mavproxy, tmp_path
):
    to_companion, to_station = free_port(), free_port()
    station = Listener()
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: station, local_addr=("127.0.0.1", to_station)
    )
    async with (
        emulate("--airborne") as emulation,
        console(
            mavproxy, tmp_path / "state", emulation.port, "mode", outputs=(to_companion, to_station)
        ) as ground,
        companion(to_companion, tmp_path),
    ):
        await ground.says("Detected vehicle 1:1")
        async with asyncio.timeout(PATIENCE_S):
            # Parameters come to who asks for them: the companion's questions have arrived.
            while not station.heard[1, "PARAM_VALUE"] or not station.heard[1, "TIMESYNC"]:
                await asyncio.sleep(0.1)
        await asyncio.sleep(2.0)  # some of its heartbeats and values, two of these a second
        assert not [kind for component, kind in station.heard if component == 191]
    transport.close()
