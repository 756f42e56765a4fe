"""Frames of every kind of damage, in numbers: VFGUIDE_FUZZ_FRAMES=1000000 takes some minutes."""

import math
import os
from pathlib import Path
from random import Random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message
from pymavlink.generator.mavcrc import x25crc

from tests.kit.companion import companion_of, leader_bytes
from tests.kit.missions import shipped
from tests.kit.wire import heartbeat, packed, parsed, position_report

FRAMES = int(os.environ.get("VFGUIDE_FUZZ_FRAMES", "40000"))
POOL = 4000
"""Frames that are made beforehand, as checksums take longest."""

DATAGRAM = 10
"""Frames that come together."""

GROWTH_KB = 4096
"""Resident memory that may come in the last four fifths; 10^6 events of 100 bytes would be 100 MB."""

HEADER, CHECKSUM = 10, 2

ROUND, FORGED = 400, 120
"""Of so many datagrams, 20 s, forged frames come in this many."""

METRES = 0.0111
"""One unit of a latitude in a position frame, m."""


def sound_frames(system_id: int, now: float = 1.0) -> list[bytes]:
    """One of each kind that is listened to, and one that is not: of a vehicle that flies north at 20 m/s."""
    position = position_report(
        time_boot_ms=round(1000 * now),
        lat=473_977_420 + round(20.0 * now / METRES),
        vx=2000,
        hdg=9000,
    )
    messages = [
        heartbeat(),
        heartbeat(6 << 16, autopilot=12),
        mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0),
        position,
        mavlink.MAVLink_command_ack_message(43_002, 4),
        mavlink.MAVLink_statustext_message(4, b"low battery"),
        mavlink.MAVLink_param_value_message(b"GUIDED_P", 12_000.0, 9, 100, 1),
        mavlink.MAVLink_attitude_message(1000, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ]
    return [packed(message, system_id=system_id, component_id=1) for message in messages]


def mutated(frame: bytes, random: Random) -> bytes:
    """Some bytes of the payload changed, and the checksum made right again."""
    content = bytearray(frame)
    size = content[1]
    for _ in range(random.randint(1, 6)):
        place = HEADER + random.randrange(size)
        content[place] = random.choice((0, 0x7F, 0x80, 0xFF, random.randrange(256)))
    number = content[7] | content[8] << 8 | content[9] << 16
    seed = bytes([mavlink.mavlink_map[number].crc_extra])
    checksum = x25crc(bytes(content[1 : HEADER + size]) + seed).crc
    content[HEADER + size : HEADER + size + CHECKSUM] = checksum.to_bytes(2, "little")
    return bytes(content)


def damaged(frame: bytes, random: Random) -> bytes:
    """Cut, stretched or with a wrong byte anywhere."""
    content = bytearray(frame)
    content[random.randrange(len(content))] = random.randrange(256)
    return bytes(content[: random.randint(1, len(content))])


def resident_kb() -> int:
    """Memory of this process."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1])
    raise AssertionError


def is_finite(message: MAVLink_message) -> bool:
    values = (getattr(message, name) for name in message.get_fieldnames())
    return all(math.isfinite(value) for value in values if isinstance(value, float))


@pytest.mark.parametrize("kind", ["ardupilot", "px4", "auto"])
def test_no_frame_is_too_damaged_and_none_leaves_a_trace(kind):
    article = shipped("line-calm")
    declared = article.vehicles["f1"].model_copy(
        update={"autopilot": kind, "course_lag_s": 0.4, "speed_dead_time_s": 0.5}
    )
    article = article.model_copy(update={"vehicles": {**article.vehicles, "f1": declared}})
    companion = companion_of(mission=article, inspect=True)
    random = Random(f"{kind} {FRAMES}")
    sound = sound_frames(declared.system_id)
    pool = [mutated(random.choice(sound), random) for _ in range(POOL)]
    true_heartbeat = int(kind == "px4")
    steered, early_kb = 0, 0
    count = FRAMES // 3 // DATAGRAM
    for number in range(count):
        now = number / 20
        if number % 2:
            companion.receive_link(leader_bytes(now), now)
        sound = sound_frames(declared.system_id, 1.0 + now)
        frames = [
            damaged(random.choice(sound), random)
            if random.random() < 0.3
            else random.choice(pool if random.random() < 0.8 else sound)
            for _ in range(DATAGRAM)
        ]
        if number % ROUND >= FORGED:
            # No forged frame: the autopilot, which refuses nothing, is believed again after some seconds.
            frames = [damaged(frame, random) for frame in frames[:5]]
            frames += [sound[true_heartbeat], *sound[2:4], *sound[5:]]
        out = companion.receive_mavlink(b"".join(frames), now)
        steered += out.steered
        for message in parsed(out.to_autopilot):
            assert is_finite(message)
        if number == count // 5:
            early_kb = resident_kb()
    assert resident_kb() - early_kb < GROWTH_KB
    # It was not silent all along: some of it is obeyed.
    assert steered > 0
