"""`vfguide status --watch` at a real broker: what it has kept, who speaks, and when it goes away."""

import asyncio
import json
import shutil
import signal
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import aiomqtt
import pytest

from tests.kit.keys import trusts_of
from tests.kit.missions import MISSIONS
from tests.kit.programs import running
from tests.kit.sockets import PATIENCE_S
from vfguide.link.codec import Kind
from vfguide.link.mqtt import Topics
from vfguide.link.presence import Presence, encode_presence
from vfguide.mission import load_mission

MISSION = MISSIONS / "line-calm.yaml"


class Companions:
    """What the companions of a formation say of themselves; a process that is gone has left no last will."""

    def __init__(self, file: Path) -> None:
        mission = load_mission(file)
        self.names = mission.companions
        self._trusts = trusts_of(mission, file)
        self._formation = mission.name
        self.living = set(self.names)

    async def say(self, client: aiomqtt.Client, name: str) -> None:
        """One presence, which the broker keeps."""
        now = time.monotonic()
        presence = Presence(status="online", mode="waiting", time_s=now, version="1", signed=True)
        data = self._trusts[name].seal(Kind.PRESENCE, encode_presence(presence), time_s=now)
        topics = Topics(prefix="vfguide", formation=self._formation, vehicle=name)
        await client.publish(topics.presence(name), data, qos=1, retain=True)

    async def speak(self, port: int) -> None:
        """Those who live say it again and again, also after the broker was away."""
        while True:
            with suppress(aiomqtt.MqttError):
                async with aiomqtt.Client("127.0.0.1", port) as client:
                    while True:
                        for name in sorted(self.living):
                            await self.say(client, name)
                        await asyncio.sleep(0.4)
            await asyncio.sleep(0.2)


@asynccontextmanager
async def watch(file: Path, port: int, *options: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """The command, ended by Ctrl-C."""
    words = ("status", file, "--watch", "--link", f"mqtt://127.0.0.1:{port}", *options)
    async with running("vfguide", *words, stdout=asyncio.subprocess.PIPE) as process:
        yield process
        process.send_signal(signal.SIGINT)
        async with asyncio.timeout(PATIENCE_S):
            assert await process.wait() == 0


async def lines_until(process: asyncio.subprocess.Process, wanted: str) -> list[str]:
    """What it prints, to the first line with something in it."""
    assert process.stdout is not None
    lines: list[str] = []
    async with asyncio.timeout(PATIENCE_S):
        while not lines or wanted not in lines[-1]:
            line = (await process.stdout.readline()).decode().strip()
            assert line, f"it ended after {lines}"
            lines.append(line)
    return lines


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A mission, beside which keys can be made."""
    return Path(shutil.copy(MISSION, tmp_path / "mission.yaml"))


async def test_it_says_go_once_all_have_spoken_and_tells_a_lost_broker_from_silent_companions(
    mosquitto, file
):
    broker, companions = mosquitto(), Companions(file)
    async with aiomqtt.Client("127.0.0.1", broker.port) as client:
        # The broker keeps its word, nobody speaks any more.
        await companions.say(client, "f3")
    companions.living.remove("f3")
    speaking = asyncio.create_task(companions.speak(broker.port))
    async with watch(file, broker.port) as process:
        for line in await lines_until(process, "it may be gone"):
            assert line.startswith("NO-GO")
        (kept,) = await lines_until(process, "NO-GO")
        assert kept.startswith("NO-GO  f3: nothing new of its companion in ")
        assert ";" not in kept
        companions.living.add("f3")
        await lines_until(process, "GO  line-calm: all 4 companions are ready")
        companions.living.remove("f3")
        await lines_until(process, "NO-GO  f3: its companion has been silent for ")
        companions.living.add("f3")
        await lines_until(process, "GO  line-calm")
        broker.kill()
        *before, lost = await lines_until(process, "NO-GO")
        assert all(line.startswith("GO  ") for line in before)
        assert lost.startswith(f"NO-GO  link mqtt://127.0.0.1:{broker.port}/vfguide: ")
        assert "nothing is known of the vehicles until it stands again" in lost
        broker.start()
        await lines_until(process, "GO  line-calm")
    speaking.cancel()


async def test_as_json_each_look_is_a_line_and_a_lost_broker_is_no_silent_companion(
    mosquitto, file
):
    broker, companions = mosquitto(), Companions(file)
    speaking = asyncio.create_task(companions.speak(broker.port))
    async with watch(file, broker.port, "--json") as process:
        *_, line = await lines_until(process, '"online"')
        assert list(json.loads(line)) == list(companions.names)
        broker.kill()
        *_, line = await lines_until(process, "not heard")
        said = json.loads(line)
        assert {one["status"] for one in said.values()} == {"not heard"}
        assert "until it stands again" in said["leader"]["obstacle"]
    speaking.cancel()
