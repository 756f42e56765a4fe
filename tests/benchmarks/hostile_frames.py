"""Random and mutated MAVLink frames into emulator and companion.

Nothing may be raised, nothing infinite flown or asked for, nothing kept in memory. With `--frames 1000000` it
takes some minutes for each. A quarter of the frames is noise, a quarter is a real one with some bits changed,
and half are whole: any message of the dialect, or one that is obeyed, with random content and a right
checksum, from the one who would be believed.
"""

import argparse
import math
import random
import struct
import sys
import time
from collections.abc import Callable, Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters, SteadyWind
from tests.kit.autopilot import new_autopilot
from tests.kit.figures import resident_mb, tell
from tests.kit.missions import shipped
from tests.kit.wire import packed, position_report
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan

LEADER = 1
STEP_S = 0.001
"""Simulation time between two frames."""

GROWTH_ALLOWED_MB = 4.19
"""Memory that may come on top after the first tenth of the frames: allocator noise, no more."""

TO_EMULATOR = (11, 20, 21, 23, 43, 44, 66, 75, 76, 84, 86, 111, 4, 256, 0)
TO_COMPANION = (0, 22, 33, 74, 77, 253)
"""Messages that are acted on."""

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
        header = struct.pack(
            "<BBBBBBBHB",
            *(0xFD, len(payload), 0, 0, self._random.randrange(256), *self._sender),
            *(message.id & 0xFFFF, message.id >> 16),
        )
        checksum = mavlink.x25crc(header[1:] + payload)
        checksum.accumulate(bytes([message.crc_extra]))
        return header + payload + struct.pack("<H", checksum.crc)

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


def emulator(kind: str) -> Callable[[bytes, int], None]:
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


def companion(_kind: str) -> Callable[[bytes, int], None]:
    """Feeds frames to a companion and looks at every number that it says."""
    mission = shipped("line-calm")
    name = mission.leader.vehicle
    vehicle = mission.vehicles[name]
    guided = Companion(flight_plan(mission, name), adapter_of(vehicle), engage=True)
    listener = mavlink.MAVLink(None)
    listener.robust_parsing = True

    def feed(frame: bytes, index: int) -> None:
        now = index * STEP_S
        if index % 10 == 0:
            frame = telemetry(now) + frame
        out = guided.receive_mavlink(frame, now)
        for message in listener.parse_buffer(out.to_autopilot) or ():
            for field in message.get_fieldnames():
                value = getattr(message, field)
                if isinstance(value, float) and not math.isfinite(value):
                    raise AssertionError(f"{message} after frame {index}")

    return feed


def telemetry(now: float) -> bytes:
    """What a real autopilot says between the frames: GUIDED, flying north, so that it is guided."""
    north_e7 = 473_977_420 + round(20.0 * now / 0.0111) % 100_000
    stamp = round(now * 1000.0) % 2**32
    return packed(
        mavlink.MAVLink_heartbeat_message(1, 3, 129, 15, 4, 3),
        mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0),
        position_report(lat=north_e7, vx=2000, time_boot_ms=stamp),
        system_id=LEADER,
        component_id=1,
    )


TARGETS: dict[str, tuple[Callable[[str], Callable[[bytes, int], None]], dict[str, object]]] = {
    "ardupilot": (emulator, {"system_id": 255, "component_id": 190, "favourites": TO_EMULATOR}),
    "px4": (emulator, {"system_id": 255, "component_id": 190, "favourites": TO_EMULATOR}),
    "companion": (companion, {"system_id": LEADER, "component_id": 1, "favourites": TO_COMPANION}),
}


def main() -> int:
    """Feed all of them; the exit status is 1 if memory grew."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000, help="for each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--targets", nargs="*", choices=sorted(TARGETS), default=sorted(TARGETS))
    options = parser.parse_args()
    grown = False
    for name in options.targets:
        make, sender = TARGETS[name]
        feed = make(name)
        began_s, before_mb = time.perf_counter(), 0.0
        for index, frame in enumerate(Frames(options.seed, **sender)):
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
