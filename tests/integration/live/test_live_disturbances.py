"""Programs of a live formation that hang, die and come back, one disturbance after the other.

Times are those of the simulation, distances those of the true states. That nobody comes within 5 m of another
and that every program survives and ends well is seen to by the fixture.
"""

import asyncio
import signal
from collections.abc import Callable
from typing import Any

Flown = Callable[..., Any]

RECOVERY_S = 30.0
"""From the end of a disturbance until everyone is within 1 m of the slot, and stays."""

UNHURRIED = 2.0
"""Speed-up where programs start again: what that takes is real time, in which nobody steers."""


def test_formation_outlives_a_broker_that_is_killed(flown: Flown) -> None:
    async def fly() -> None:
        async with flown() as watched:
            await watched.settle()
            for length_s in (2.0, 20.0):
                await watched.broker.kill()
                await watched.wait(length_s)
                await watched.until_followers_are("predicting")
                await watched.broker.start()
                ended_s = watched.flight.time_s
                await watched.until_followers_are("tracking")
                assert await watched.recovery_s(ended_s) <= RECOVERY_S

    asyncio.run(fly())


def test_companions_that_are_killed_take_their_places_again(flown: Flown) -> None:
    async def fly() -> None:
        async with flown(speedup=UNHURRIED) as watched:
            await watched.settle()
            companions = watched.flight.companions
            # It flies straight on meanwhile: f1, outside of the turn, away from the others; f2, inside of it,
            # through the places of the others.
            for name in ("f1", "f2"):
                await companions[name].kill()
                await watched.wait(3.0)
                await companions[name].start()
                assert await watched.recovery_s(watched.flight.time_s) <= RECOVERY_S

            await companions["leader"].kill()
            heard = len(watched.heard_s)
            await companions["leader"].start()
            await watched.until(lambda: len(watched.heard_s) > heard)
            assert await watched.recovery_s(watched.heard_s[heard]) <= RECOVERY_S

    asyncio.run(fly())


def test_formation_outlives_autopilots_that_hang_and_reboot(flown: Flown) -> None:
    async def fly() -> None:
        async with flown() as watched:
            await watched.settle()
            emulators = watched.flight.emulators
            emulators["leader"].signal(signal.SIGSTOP)
            await watched.wait(3.0)
            emulators["leader"].signal(signal.SIGCONT)
            assert await watched.recovery_s(watched.flight.time_s) <= RECOVERY_S
            assert "predicting" in watched.log("f1")

            emulators["f2"].signal(signal.SIGHUP)
            assert await watched.recovery_s(watched.flight.time_s) <= RECOVERY_S
            assert "the autopilot has rebooted" in watched.log("f2")

    asyncio.run(fly())
