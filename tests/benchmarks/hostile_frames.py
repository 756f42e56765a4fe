"""Hostile bytes into emulator, companions and a member of the link.

Nothing may be raised, nothing infinite flown or asked for, nothing kept in memory. With `--frames 1000000` it
takes some minutes for each. Of MAVLink a quarter is noise, a quarter a real frame with some bits changed, and
half are whole: any message of the dialect, or one that is obeyed, with random content and a right checksum,
from the one who would be believed. A member of the link believes nothing but what its leader says between
noise, cut, changed, forged and repeated datagrams.
"""

import argparse
import math
import random
import struct
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters, SteadyWind
from tests.kit.autopilot import new_autopilot
from tests.kit.figures import resident_mb, tell
from tests.kit.link import LEADER as LEADER_NAME
from tests.kit.link import Station, Wire, trust_of
from tests.kit.missions import shipped
from tests.kit.wire import frame_of, packed, position_report
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.link.codec import Kind

LEADER = 1
STEP_S = 0.001
"""Simulation time between two frames."""

GROWTH_ALLOWED_MB = 4.19
"""Memory that may come on top after the first tenth of the frames: allocator noise, no more."""

TO_EMULATOR = (11, 20, 21, 23, 43, 44, 66, 75, 76, 84, 86, 111, 4, 256, 0)
TO_COMPANION = (0, 22, 33, 74, 77, 253)
TO_FOLLOWER = (0, 33, 63, 111, 144, 235)
"""Messages that are acted on."""

SEQUENCE = slice(32, 36)
"""Of a datagram on the link: its number."""

COMMANDS = (
    *(17, 20, 22, 176, 178, 192, 246, 400, 401, 410),
    *(510, 511, 512, 519, 520, 43000, 43001, 43002),
)


class Frames:
    """Makes frames that seem to come from one sender."""

    def __init__(
        self, seed: int, *, system_id: int, component_id: int, favourites: tuple[int, ...]
    ) -> None:
        self._random = random.Random(seed)
        self._sender = (system_id, component_id)
        self._favourites = favourites
        self._all = sorted(mavlink.mavlink_map)

    def __iter__(self) -> Iterator[bytes]:
        while True:
            kind = self._random.random()
            if kind < 0.25:
                yield self._random.randbytes(self._random.randint(1, 280))
            elif kind < 0.5:
                yield self._mutated(self._whole())
            else:
                yield self._whole()

    def _mutated(self, frame: bytes) -> bytes:
        changed = bytearray(frame)
        for _ in range(self._random.randint(1, 4)):
            changed[self._random.randrange(len(changed))] ^= self._random.randint(1, 255)
        return bytes(changed[: self._random.randint(1, len(changed))])

    def _whole(self) -> bytes:
        wanted = self._favourites if self._random.random() < 0.6 else self._all
        message = mavlink.mavlink_map[self._random.choice(wanted)]
        payload = bytearray(self._content(message.unpacker.size))
        self._address(message, payload)
        system_id, component_id = self._sender
        return frame_of(message.id, bytes(payload), system_id=system_id, component_id=component_id)

    def _content(self, size: int) -> bytes:
        """Noise, or numbers that floats and integers find extreme."""
        if self._random.random() < 0.5:
            return self._random.randbytes(size)
        words = (0.0, 1.0, -1.0, 20.0, 359.0, math.nan, math.inf, 3.4e38, 1e-45)
        return b"".join(
            struct.pack("<f", self._random.choice(words)) for _ in range(-(-size // 4))
        )[:size]

    def _address(self, message: type, payload: bytearray) -> None:
        """Make it a message for system 1, and a command one that is known, most of the time."""
        fields = message.ordered_fieldnames
        places = struct_places(message)
        for name, value in (("target_system", LEADER), ("target_component", 1)):
            if name in fields and self._random.random() < 0.9:
                payload[places[name]] = value
        if "command" in fields and message.id in {75, 76}:
            struct.pack_into("<H", payload, places["command"], self._random.choice(COMMANDS))


def struct_places(message: type) -> dict[str, int]:
    """Where the fields of a message begin in its payload."""
    place, places = 0, {}
    codes = message.unpacker.format[1:]
    index = 0
    for name in message.ordered_fieldnames:
        places[name] = place
        digits = ""
        while codes[index].isdigit():
            digits += codes[index]
            index += 1
        count = int(digits or 1)
        arrays = message.array_lengths[message.orders[message.fieldnames.index(name)]] or 1
        # A text is one code with a count; an array of numbers is as many codes as it has elements.
        repeats = 1 if codes[index] == "s" or digits else arrays
        place += struct.calcsize("<" + codes[index]) * count * repeats
        index += repeats if not digits else 1
    return places


Feed = Callable[[bytes, int], None]
"""Takes a frame, and its number."""


def emulator(kind: str) -> Feed:
    """Feeds frames to an emulated autopilot and looks at its true state."""
    autopilot = new_autopilot(
        SteadyWind(5.0, 1.0),
        system_id=LEADER,
        autopilot=kind,
        plant=PlantParameters(kind="bank", speed_response="tecs"),
        course_rad=1.0,
        armed=True,
    )

    def feed(frame: bytes, index: int) -> None:
        autopilot.receive(frame)
        if index % 20 == 0:
            autopilot.advance(index * STEP_S)
        if index % 50 == 0:
            truth = autopilot.truth()
            for name in truth.__struct_fields__:
                value = getattr(truth, name)
                if isinstance(value, float) and not math.isfinite(value):
                    raise AssertionError(f"{name} is {value} after frame {index}")

    return feed


def companion(kind: str) -> Feed:
    """Feeds frames to a companion and looks at every number that it says.

    A leader's gets them from its autopilot, a follower's from a leader without a companion.
    """
    follows = kind == "follower"
    mission = shipped("foreign-leader" if follows else "line-calm")
    name = "f1" if follows else mission.leader.vehicle
    vehicle = mission.vehicles[name]
    guided = Companion(flight_plan(mission, name), adapter_of(vehicle), engage=True)
    listener = mavlink.MAVLink(None)
    listener.robust_parsing = True

    def feed(frame: bytes, index: int) -> None:
        now = index * STEP_S
        said = telemetry(now, vehicle.system_id) if index % 10 == 0 else b""
        if follows:
            guided.receive_link(frame, now)
        else:
            said += frame
        out = guided.receive_mavlink(said, now)
        for message in listener.parse_buffer(out.to_autopilot) or ():
            for field in message.get_fieldnames():
                value = getattr(message, field)
                if isinstance(value, float) and not math.isfinite(value):
                    raise AssertionError(f"{message} after frame {index}")

    return feed


def telemetry(now: float, system_id: int) -> bytes:
    """What a real autopilot says between the frames: GUIDED, flying north, so that it is guided."""
    north_e7 = 473_977_420 + round(20.0 * now / 0.0111) % 100_000
    stamp = round(now * 1000.0) % 2**32
    return packed(
        mavlink.MAVLink_heartbeat_message(1, 3, 129, 15, 4, 3),
        mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0),
        position_report(lat=north_e7, vx=2000, time_boot_ms=stamp),
        system_id=system_id,
        component_id=1,
    )


def members() -> tuple[Wire, Station, Station]:
    """(wire, leader, follower) that have heard each other for two seconds, the same each time."""
    wire = Wire()
    speaker, listener = wire.station(LEADER_NAME, session=1), wire.station("f1", session=2)
    wire.fly(speaker, 2.0, listener)
    assert listener.heard
    listener.heard.clear()
    return wire, speaker, listener


def datagrams(seed: int) -> Iterator[bytes]:
    """Datagrams that no member of the formation has said, or not now."""
    chance = random.Random(seed)
    wire, *_ = members()
    real = [parcel.data for parcel in wire.sent if parcel.kind is Kind.STATE]
    strange = [
        trust_of(LEADER_NAME, 9, signed=False).seal(Kind.STATE, b"unsigned", time_s=2.0),
        trust_of(LEADER_NAME, 9).seal(Kind.STATE, b"of yesterday", time_s=2.0),
    ]
    while True:
        data = bytearray(chance.choice(real))
        match chance.randrange(6):
            case 0:
                yield chance.randbytes(chance.randrange(1500))
            case 1:
                yield bytes(data[: chance.randrange(len(data))])
            case 2:
                data[chance.randrange(len(data))] ^= chance.randrange(1, 256)
                yield bytes(data)
            case 3:
                # Newer than anything that was said, with every number right but the signature.
                data[SEQUENCE] = (2**31 + chance.randrange(2**30)).to_bytes(4, "little")
                yield bytes(data)
            case 4:
                yield chance.choice(strange)
            case _:
                yield bytes(data)


def member(_kind: str) -> Feed:
    """Feeds datagrams to a member, who believes nothing but what its leader says between them."""
    wire, speaker, listener = members()

    def feed(data: bytes, index: int) -> None:
        listener.member.take(data)
        if index % 100 == 99:
            said = b"true %d" % index
            speaker.member.publish(said)
            wire.run(1.0)
            assert [body for _, body in listener.heard] == [said], (index, listener.heard)
            assert listener.counters["failed to use"] == 0
            listener.heard.clear()
            wire.sent.clear()

    return feed


BY_GROUND = partial(Frames, system_id=255, component_id=190, favourites=TO_EMULATOR)
TARGETS: dict[str, tuple[Callable[[str], Feed], Callable[[int], Iterable[bytes]]]] = {
    "ardupilot": (emulator, BY_GROUND),
    "px4": (emulator, BY_GROUND),
    "companion": (companion, partial(Frames, system_id=1, component_id=1, favourites=TO_COMPANION)),
    "follower": (companion, partial(Frames, system_id=7, component_id=1, favourites=TO_FOLLOWER)),
    "member": (member, datagrams),
}
"""Targets, and the frames fed to each."""


def main() -> int:
    """Feed all of them; the exit status is 1 if memory grew."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000, help="for each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--targets", nargs="*", choices=sorted(TARGETS), default=sorted(TARGETS))
    options = parser.parse_args()
    grown = False
    for name in options.targets:
        make, hostile = TARGETS[name]
        feed = make(name)
        began_s, before_mb = time.perf_counter(), 0.0
        for index, frame in enumerate(hostile(options.seed)):
            if index == options.frames:
                break
            if index == options.frames // 10:
                before_mb = resident_mb()
            feed(frame, index)
        growth_mb = resident_mb() - before_mb
        grown = grown or growth_mb > GROWTH_ALLOWED_MB
        seconds = time.perf_counter() - began_s
        tell(
            f"{name}: {options.frames} frames in {seconds:.0f} s, {growth_mb:.1f} MB more at the end"
        )
    return int(grown)


if __name__ == "__main__":
    sys.exit(main())
