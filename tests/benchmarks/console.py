"""What the console takes: its server's share of a core, the browser's, pictures and bytes a second.

    python -m tests.benchmarks.console [--aircraft 30] [--link mqtt|udp] [--seconds 20] [--chromium PROGRAM]

A program in the place of the companions sends signed states of all aircraft ten times a second, over a
broker or by UDP. The console runs as a program of its own, with one page open in Chromium. Fails if the
server takes a tenth of a core or more.
"""

import argparse
import asyncio
import cmath
import math
import re
import shutil
import socket
import sys
import tempfile
import time
import urllib.request
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path

import aiomqtt
import psutil
import yaml
from playwright.async_api import Page

from tests.kit.browser import device, launched
from tests.kit.figures import tell
from tests.kit.keys import trusts_of
from tests.kit.missions import content_of
from tests.kit.programs import running
from tests.kit.sockets import free_port
from vfguide.companion.mission_plan import local_frame
from vfguide.lab.studies.programs import broker
from vfguide.link.codec import LeaderMessage, encode
from vfguide.link.envelope import Kind
from vfguide.link.presence import Presence, encode_presence
from vfguide.link.session import Topics
from vfguide.mission import Mission, load_mission

RATE_HZ = 10.0
SPEED_M_S, RADIUS_M = 20.0, 300.0
MOST_SERVER_SHARE = 0.10
WARM_UP_S = 5.0

FRAMES = """seconds => new Promise(done => {
    let frames = 0;
    const began = performance.now();
    const count = () => {
        frames += 1;
        const passed = (performance.now() - began) / 1000;
        if (passed < seconds) requestAnimationFrame(count);
        else done(frames / passed);
    };
    requestAnimationFrame(count);
})"""


def mission_of(aircraft: int) -> dict[str, object]:
    """The circle, with rows of aircraft."""
    content = content_of("circle-wind", "json")
    vehicle = content["vehicles"]["leader"]
    content["name"] = f"rows-of-{aircraft}"
    content["path"]["radius_m"] = RADIUS_M
    names = [f"f{number}" for number in range(1, aircraft)]
    content["followers"] = [
        {
            "vehicle": name,
            "slot": {"forward_m": -20.0 * (row // 5 + 1), "right_m": 20.0 * (row % 5 - 2)},
        }
        for row, name in enumerate(names)
    ]
    content["vehicles"] = {
        name: {**vehicle, "system_id": number + 1} for number, name in enumerate(["leader", *names])
    }
    content["rehearsal"].pop("start", None)
    return content


class Formation:
    """All companions in one program: they fly their slots exactly and say so."""

    def __init__(self, mission: Mission, file: Path) -> None:
        self._mission = mission
        self.names = mission.companions
        self._trusts = trusts_of(mission, file)
        self._topics = {
            name: Topics(prefix="vfguide", formation=mission.name, vehicle=name)
            for name in self.names
        }

    def state(self, name: str, time_s: float) -> bytes:
        """Of an aircraft at a time."""
        turn_rate = SPEED_M_S / RADIUS_M
        course = math.remainder(turn_rate * time_s, math.tau)
        follower = self._mission.followers_by_name.get(name)
        forward = follower.slot.forward_m if follower else 0.0
        right = follower.slot.right_m if follower else 0.0
        north = RADIUS_M * math.sin(course) + forward * math.cos(course) - right * math.sin(course)
        east = -RADIUS_M * math.cos(course) + forward * math.sin(course) + right * math.cos(course)
        latitude, longitude = local_frame(self._mission).to_geodetic(north, east)
        # Those beside and behind the leader turn about the same centre.
        velocity = complex(SPEED_M_S - turn_rate * right, turn_rate * forward)
        return encode(
            LeaderMessage(
                sequence=0,
                time_s=time_s,
                latitude_deg=latitude,
                longitude_deg=longitude,
                altitude_amsl=588.0,
                course=math.remainder(course + cmath.phase(velocity), math.tau),
                ground_speed=abs(velocity),
                acceleration=0.0,
                turn_rate=turn_rate,
                turn_acceleration=0.0,
                steered=True,
            )
        )

    async def fly_by_broker(self, port: int) -> None:
        """Publish states and presences until cancelled."""
        async with aiomqtt.Client("127.0.0.1", port) as client:

            async def say(name: str, kind: Kind, data: bytes) -> None:
                topics, kept = self._topics[name], kind is Kind.PRESENCE
                topic = topics.presence(name) if kept else topics.state(name)
                await client.publish(topic, data, retain=kept)

            await self._fly(say)

    async def fly_by_udp(self, port: int) -> None:
        """Send states and presences to a port of this computer until cancelled."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:

            async def say(_name: str, _kind: Kind, data: bytes) -> None:
                with suppress(ConnectionRefusedError):
                    sender.sendto(data, ("127.0.0.1", port))

            await self._fly(say)

    async def _fly(self, say: Callable[[str, Kind, bytes], Awaitable[None]]) -> None:
        """Say states and presences until cancelled, evenly spread over time."""
        pause_s = 1.0 / RATE_HZ / len(self.names)
        began_s, count = time.monotonic(), 0
        while True:
            name = self.names[count % len(self.names)]
            now = time.monotonic()
            state = self._trusts[name].seal(Kind.STATE, self.state(name, now), time_s=now)
            await say(name, Kind.STATE, state)
            if count // len(self.names) % int(RATE_HZ) == 0:
                await say(name, Kind.PRESENCE, self._presence(name, now))
            count += 1
            await asyncio.sleep(max(began_s + count * pause_s - time.monotonic(), 0.0))

    def _presence(self, name: str, now: float) -> bytes:
        presence = Presence(
            status="online",
            mode="tracking",
            time_s=now,
            version="0",
            signed=True,
            autopilot="GUIDED",
            figures={"leader_age_ms_last": 50.0, "wind_north_m_s": 3.0, "wind_east_m_s": 1.0},
        )
        return self._trusts[name].seal(Kind.PRESENCE, encode_presence(presence), time_s=now)


@asynccontextmanager
async def console(file: Path, link: str) -> AsyncIterator[tuple[str, psutil.Process]]:
    """The console as a program; yields its address and its process."""
    words = ("console", file, "--link", link, "--port", 0)
    async with running("vfguide", *words, stdout=asyncio.subprocess.PIPE) as process:
        assert process.stdout is not None
        line = (await process.stdout.readline()).decode()
        found = re.search(r"http\S+", line)
        if found is None:
            raise SystemExit(f"the console did not start: {line}")
        yield found[0], psutil.Process(process.pid)


def processor_s(processes: Sequence[psutil.Process]) -> float:
    """Processor time of some programs, s."""
    times = [one.cpu_times() for one in processes]
    return float(sum(one.user + one.system for one in times))


def bytes_of(url: str, seconds: float) -> tuple[int, float]:
    """Bytes of the flight so far, and bytes a second after it, of one page."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    opener.open(url).read()
    stream = opener.open(url.partition("?")[0] + "flight")
    head = sum(len(stream.readline()) for _ in range(3))
    began_s, count = time.monotonic(), 0
    while (passed_s := time.monotonic() - began_s) < seconds:
        count += len(stream.readline())
    return head, count / passed_s


async def measure(
    page: Page, url: str, process: psutil.Process, *, aircraft: int, seconds: float
) -> bool:
    """Print what it takes; whether that is little enough."""
    began_s = time.monotonic()
    await page.goto(url)
    await page.get_by_text("live,").wait_for()
    first_s = time.monotonic() - began_s
    await asyncio.sleep(WARM_UP_S)
    shown = await page.locator("article.card .mode", has_text="tracking").count()
    if shown != aircraft:
        raise SystemExit(f"only {shown} of {aircraft} aircraft are shown")
    own = psutil.Process()
    browsers = [one for one in own.children(recursive=True) if "chrom" in one.name()]
    server_s, browser_s, began_s = processor_s([process]), processor_s(browsers), time.monotonic()
    frames = await page.evaluate(FRAMES, seconds)
    passed_s = time.monotonic() - began_s
    server = (processor_s([process]) - server_s) / passed_s
    drawing = (processor_s(browsers) - browser_s) / passed_s
    tell(f"server: {server:.1%} of a core, {process.memory_info().rss / 1e6:.0f} MB")
    tell(f"browser: {frames:.0f} pictures a second, {drawing:.0%} of a core")
    tell(f"first picture after {first_s:.2f} s")
    head, rate = await asyncio.to_thread(bytes_of, url, 5.0)
    tell(f"one page: {head / 1e3:.0f} kB to begin with, {rate / 1e3:.0f} kB a second")
    return server < MOST_SERVER_SHARE


async def main() -> int:
    """Measure; exit status 1 if the server takes too much."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--aircraft", type=int, default=30)
    parser.add_argument("--link", choices=["mqtt", "udp"], default="mqtt")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--chromium", default=shutil.which("chromium") or "chromium")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "mission.yaml"
        file.write_text(yaml.safe_dump(mission_of(options.aircraft)), encoding="utf-8")
        formation = Formation(load_mission(file), file)
        async with AsyncExitStack() as stack:
            if options.link == "mqtt":
                _, port = await stack.enter_async_context(broker(Path(scratch)))
                link, fly = f"mqtt://127.0.0.1:{port}", formation.fly_by_broker
            else:
                port, other = free_port(), free_port()
                link, fly = f"udp://127.0.0.1:{other}?port={port}", formation.fly_by_udp
            url, process = await stack.enter_async_context(console(file, link))
            flying = asyncio.create_task(fly(port))
            browser = await stack.enter_async_context(launched(options.chromium))
            page = await browser.new_page(**device())
            tell(f"{options.aircraft} aircraft at {RATE_HZ:g} Hz by {options.link}")
            good = await measure(
                page, url, process, aircraft=options.aircraft, seconds=options.seconds
            )
            await page.close()
            flying.cancel()
            with suppress(asyncio.CancelledError):
                await flying
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
