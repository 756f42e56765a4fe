"""Programs of a live formation that hang, die and come back, one disturbance after the other.

Times are those of the simulation, distances those of the true states. That nobody comes within 5 m of another
and that every program survives and ends well is seen to by the fixture.
"""

import signal
import socket
import time
from pathlib import Path
from typing import Any

from pymavlink import mavutil

from tests.kit.sockets import until
from vfguide.lab.rehearsal.live import RECORDINGS
from vfguide.lab.rehearsal.processes import free_port
from vfguide.record.guidance_log import SUFFIX, read_guidance
from vfguide.record.recording import files_of, find_recordings, parts_of, read_start

FOLLOWERS = ("f1", "f2", "f3")

IN_SLOT_M = 1.0

RECOVERY_S = 30.0
"""From the end of a disturbance until everyone is within 1 m of the slot, and stays."""

LOST_S = 3.0
"""Of a recording whose companion is killed, at most: it is written every second."""


async def test_formation_outlives_a_broker_that_is_killed_and_autopilots_that_hang_and_reboot(
    flown,
):
    async with flown() as watched:
        await watched.settle()
        watched.broker.kill()
        await watched.wait(20.0)
        await watched.until_followers_are("predicting")
        watched.broker.start()
        ended_s = watched.flight.time_s
        await watched.until_followers_are("tracking")
        assert await watched.recovery_s(ended_s) <= RECOVERY_S

        emulators = watched.flight.emulators
        before = watched.log("f1").count("-> predicting")
        emulators["leader"].signal(signal.SIGSTOP)
        await watched.wait(3.0)
        emulators["leader"].signal(signal.SIGCONT)
        assert await watched.recovery_s(watched.flight.time_s) <= RECOVERY_S
        assert watched.log("f1").count("-> predicting") > before

        emulators["f2"].signal(signal.SIGHUP)
        # It stays where it came up: a reboot gives a companion no right to take it.
        await until(lambda: "the autopilot has rebooted" in watched.log("f2"))
        await watched.wait(5.0)
        assert "rebooted: it is not engaged again by itself" in watched.log("f2")


async def test_a_second_link_carries_on_and_companions_that_are_killed_take_their_places_again(
    flown, speedup
):
    group = f"udp://239.255.79.1:{free_port(socket.SOCK_DGRAM)}?interface=127.0.0.1"
    async with flown(beside_broker=[group]) as watched:
        await watched.settle()
        await broker_is_not_missed(watched)

        companions = watched.flight.companions
        # It flies straight on meanwhile, inside of the turn, through the places of the others.
        killed_s = time.time()
        await companions["f2"].kill()
        assert killed_s - recorded_until_s(watched.directory, "f2", speedup) < LOST_S
        await watched.wait(3.0)
        await watched.start_again("f2")
        assert await watched.recovery_s(watched.flight.time_s) <= RECOVERY_S

        await companions["leader"].kill()
        heard = len(watched.heard_s)
        await companions["leader"].start()
        await until(lambda: len(watched.heard_s) > heard)
        assert await watched.recovery_s(watched.heard_s[heard]) <= RECOVERY_S

        await watched.stop_companions()
        # By themselves: one that has to be killed after some seconds ends with -9.
        assert {one.exit_code for one in companions.values()} == {0}
        truths = watched.flight.truth_collector.truths
        await until(lambda: [one[max(one)].mode for one in truths.values()] == ["LOITER"] * 4)
        for name in watched.flight.names:
            assert "stopping: handing back" in watched.log(name)
            recorded = parts_of(watched.directory / RECORDINGS, name, SUFFIX)
            assert recorded
            assert all(file.stat().st_size > 0 for file in recorded)


async def broker_is_not_missed(watched: Any) -> None:
    """The UDP group carries on: nobody predicts the leader, and the pilot is told."""
    before = {name: watched.log(name).count("-> predicting") for name in FOLLOWERS}
    began_s = watched.flight.truth_collector.time_s
    watched.broker.kill()
    await watched.wait(10.0)
    await watched.reach(began_s + 10.0)
    for name in FOLLOWERS:
        assert watched.log(name).count("-> predicting") == before[name]
        assert "is lost: the other goes on" in watched.log(name)
    assert watched.errors(began_s)[1].max() < IN_SLOT_M
    watched.broker.start()
    await until(lambda: all("is back: nothing to do" in watched.log(name) for name in FOLLOWERS))


def recorded_until_s(directory: Path, vehicle: str, speedup: float) -> float:
    """When the only recording of a vehicle ends, s since 1970: steps, and frames as pymavlink reads them."""
    starts = {one: read_start(one) for one in find_recordings([directory / RECORDINGS])}
    [(recording, start)] = [item for item in starts.items() if item[1].vehicle == vehicle]
    telemetry, guidance = files_of(recording, vehicle)
    log = mavutil.mavlink_connection(str(telemetry), dialect="ardupilotmega")
    frames = 0
    while (message := log.recv_match()) is not None:
        frames, stamp_s = frames + 1, message._timestamp  # noqa: SLF001 - where pymavlink keeps it
    log.close()
    assert frames > 0
    ends_s = min(start.to_unix(read_guidance(guidance).steps[-1].time_s), stamp_s)
    # Companions fly by a clock that runs faster.
    return start.unix_s + (ends_s - start.unix_s) / speedup
