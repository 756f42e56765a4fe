"""Live flights to disturb, judged by the true states of all aircraft and in simulation time."""

import logging
import re
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from random import Random

import numpy as np
import pytest

from tests.kit.missions import on_the_circle
from tests.kit.programs import Mosquitto
from tests.kit.sockets import until
from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.live import LiveFlight, live_flight
from vfguide.lab.report.figures import pair_separations, slot_error
from vfguide.link.keys import OPERATOR
from vfguide.link.member import Member
from vfguide.link.opening import WatchedFormation, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust, new_session
from vfguide.mission import Mission

IN_SLOT_M = 1.0

RECOVERY_S = 30.0
"""Simulation time within which a formation is asked to be whole again."""

STEADY_S = 6.0
"""Simulation time that everyone has to stay in the slots to count as back."""

MODE = re.compile(r"\b[a-z]+ -> ([a-z]+)\b")
"""A change of mode in the log of a companion."""

logger = logging.getLogger(__name__)


def spectator(watched: WatchedFormation, receive: Callable[[bytes], None]) -> Member:
    """A member that hears the leader's states."""
    trust = Trust(
        formation=watched.formation,
        name=OPERATOR,
        leader=watched.leader,
        session=new_session(),
        roster=watched.roster,
        key=watched.key,
    )
    return Member(trust, clock=watched.clock, receive=receive, peer_clock=PeerClock())


class Logged:
    """A live flight, and what its companions say."""

    def __init__(self, flight: LiveFlight, directory: Path) -> None:
        self.flight = flight
        self.directory = directory

    def log(self, vehicle: str) -> str:
        """What a companion had to say so far."""
        return (self.directory / f"{vehicle}.companion.log").read_text()

    async def all_say(self, words: str, *vehicles: str) -> None:
        """Wait until each of some companions, or of all, has said something."""
        await until(lambda: all(words in self.log(name) for name in vehicles or self.flight.names))

    def times_steering(self, vehicle: str) -> int:
        """How often a companion began to steer."""
        return len(re.findall(r"waiting -> (?:joining|tracking)", self.log(vehicle)))

    async def start_again(self, vehicle: str) -> None:
        """Start a companion again, until it steers: how long that takes is the machine's."""
        steered = self.times_steering(vehicle)
        await self.flight.companions[vehicle].start()
        await until(lambda: self.times_steering(vehicle) > steered)


class Watched(Logged):
    """The same, its broker, and how well the formation is kept."""

    def __init__(self, flight: LiveFlight, broker: Mosquitto, directory: Path) -> None:
        super().__init__(flight, directory)
        self.broker = broker
        self.heard_s: list[float] = []
        """When states of the leader came over the link."""
        self.is_over = False
        """Whether companions have been told to stop."""

    async def reach(self, time_s: float) -> None:
        """Wait until every aircraft has flown to this simulation time."""
        await until(lambda: self.flight.truth_collector.time_s >= time_s)

    async def stop_companions(self) -> None:
        """Tell companions, who have to run until then, to stop."""
        assert all(companion.running for companion in self.flight.companions.values())
        self.is_over = True
        await self.flight.stop_companions()

    async def settle(self) -> None:
        """Wait until everyone is in the slots."""
        recovery_s = await self.recovery_s(0.0)
        assert recovery_s < RECOVERY_S

    async def until_followers_are(self, *modes: str) -> None:
        """Wait until each follower's companion says that it is in one of these modes."""
        _, *followers = self.flight.names
        await until(lambda: all(MODE.findall(self.log(name))[-1] in modes for name in followers))

    async def wait(self, length_s: float) -> None:
        """Let this much simulation time pass by the clock, whether or not anybody flies."""
        ends_s = self.flight.time_s + length_s
        await until(lambda: self.flight.time_s >= ends_s)

    async def recovery_s(self, ended_s: float) -> float:
        """Simulation time from the end of a disturbance until everyone is back, and stays."""
        judge = self.flight.truth_collector
        now_s = max(ended_s, judge.time_s) + STEADY_S
        while True:
            await self.reach(now_s)
            times, errors = self.errors(ended_s)
            outside = times[(errors >= IN_SLOT_M).any(axis=0)]
            back_s = outside[-1] if outside.size else ended_s
            now_s = judge.time_s + 1.0
            if judge.time_s - back_s >= STEADY_S or now_s - ended_s > RECOVERY_S + STEADY_S:
                logger.info(
                    "back after %.1f s, at most %.1f m off, at least %.1f m apart",
                    back_s - ended_s,
                    errors.max(),
                    self.least_separation_m(),
                )
                return float(back_s - ended_s)

    def errors(self, from_s: float) -> tuple[FloatArray, FloatArray]:
        """Times, and distances of the followers from their slots at them, m."""
        record = self.flight.record(wall_s=0.0)
        late = record.time_s >= from_s
        rows = [slot_error(record.leader, one).distance_m[late] for one in record.followers]
        return record.time_s[late], np.array(rows)

    def least_separation_m(self) -> float:
        """Of any two aircraft, since the beginning."""
        record = self.flight.record(wall_s=0.0)
        return min(float(pair.distance_m.min()) for pair in pair_separations(record))


@pytest.fixture
def mission() -> Mission:
    return on_the_circle()


@pytest.fixture
def speedup(request: pytest.FixtureRequest) -> float:
    """Seconds of the simulation for each real one.

    At 2 a flight takes one of two cores. If it failed, the computer may have been too slow: it flies again
    in real time.
    """
    attempt = getattr(request.node, "execution_count", 1)
    return 2.0 if attempt == 1 else 1.0


@pytest.fixture
def flown(
    mission: Mission, tmp_path: Path, mosquitto: Callable[[], Mosquitto], speedup: float
) -> Callable[..., AbstractAsyncContextManager[Watched]]:
    """Flies live, and sees that nobody came too near to another and that every program ended well."""

    @asynccontextmanager
    async def fly(beside_broker: Sequence[str] = ()) -> AsyncIterator[Watched]:
        broker = mosquitto()
        async with (
            live_flight(
                mission, directory=tmp_path, links=[broker.url, *beside_broker], speedup=speedup
            ) as flight,
            open_link(
                flight.watched.addresses,
                formation=mission.name,
                member=spectator(flight.watched, lambda _: watched.heard_s.append(flight.time_s)),
                random=Random(1),
            ),
        ):
            watched = Watched(flight, broker, tmp_path)
            yield watched
            flight.check()
            if not watched.is_over:
                await watched.stop_companions()
            least_m = watched.least_separation_m()
        logs = {log.name: log.read_text() for log in tmp_path.glob("*.log")}
        assert not [name for name, text in logs.items() if "Traceback" in text]
        codes = {name: companion.exit_code for name, companion in flight.companions.items()}
        assert codes == dict.fromkeys(flight.names, 0)
        assert least_m >= mission.acceptance.min_separation_m

    return fly
