"""Whatever arrives, in frames of every kind of damage, a companion goes on.

VFGUIDE_FUZZ_FRAMES=1000000 takes some minutes.
"""

import math
import os
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import companion_of, leader_bytes, new_flight
from tests.kit.figures import resident_mb
from tests.kit.link import sealed
from tests.kit.missions import mission_with, with_vehicle
from tests.kit.wire import frame_of, heartbeat, packed, parsed, position_report
from vfguide.companion.mission_plan import flight_plan
from vfguide.link.codec import LeaderMessage, encode

HEARTBEATS = st.builds(
    mavlink.MAVLink_heartbeat_message,
    *(st.just(1), st.sampled_from([3, 8, 12]), st.just(129)),
    *(st.sampled_from([15, 15, 12, 6 << 16, 2**32 - 1]), st.just(4), st.just(3)),
)

AIRSPEEDS = st.builds(
    mavlink.MAVLink_vfr_hud_message,
    st.floats(width=32) | st.floats(0.0, 40.0, width=32),
    *(st.just(0.0), st.just(0), st.just(0), st.just(0.0), st.just(0.0)),
)

NEARBY = (st.integers(473_970_000, 473_980_000), st.integers(85_450_000, 85_460_000))
ANYWHERE = (st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))

POSITIONS = st.one_of(
    st.builds(
        mavlink.MAVLink_global_position_int_message,
        st.integers(0, 3000) | st.integers(0, 2**32 - 1),
        *place,
        *(st.integers(-(2**31), 2**31 - 1), st.just(0)),
        *(st.integers(-(2**15), 2**15 - 1), st.integers(-(2**15), 2**15 - 1), st.just(0)),
        st.integers(0, 65_535),
    )
    for place in (NEARBY, NEARBY, ANYWHERE)
)

TELEMETRY = st.lists(HEARTBEATS | AIRSPEEDS | POSITIONS, max_size=4)

STATES = st.builds(
    LeaderMessage,
    sequence=st.just(1),
    time_s=st.floats(allow_nan=False, allow_infinity=False) | st.floats(0.0, 10.0),
    latitude_deg=st.floats(-90.0, 90.0) | st.floats(47.39, 47.40),
    longitude_deg=st.floats(-180.0, 180.0) | st.floats(8.54, 8.55),
    altitude_amsl=st.just(588.0),
    course=st.floats(-10.0, 10.0),
    ground_speed=st.floats(-500.0, 500.0),
    acceleration=st.floats(-100.0, 100.0),
    turn_rate=st.floats(-10.0, 10.0),
    turn_acceleration=st.floats(-100.0, 100.0),
)

STEPS = st.lists(
    st.tuples(st.sampled_from([0.0, 0.001, 0.05, 0.05, 0.5, 3.0]), TELEMETRY, st.none() | STATES),
    min_size=1,
    max_size=12,
)

VARIANTS = st.tuples(
    st.sampled_from(["leader", "f1"]),
    st.sampled_from(["ardupilot", "px4"]),
    st.sampled_from(["heading-hold", "course-hold"]),
    st.sampled_from(["measured", "observer"]),
)
"""Vehicle, autopilot, what its loops hold, where the leader's law takes its ground speed from."""


def is_sound(message: MAVLink_message, limits: tuple[float, float]) -> bool:
    """Whether every number of a message is finite, and a commanded airspeed within the limits."""
    values = [getattr(message, name) for name in message.get_fieldnames()]
    if not all(math.isfinite(value) for value in values if isinstance(value, float)):
        return False
    changes_airspeed = getattr(message, "command", 0) in {178, 43_000} and message.param1 == 0.0
    return not changes_airspeed or limits[0] <= message.param2 <= limits[1]


@settings(deadline=None, derandomize=True, max_examples=250)
@given(variant=VARIANTS, steps=STEPS)
def test_whatever_arrives_a_companion_goes_on_and_sends_sound_messages(variant, steps):
    vehicle, kind, hold, speed_source = variant
    chosen = mission_with("line-calm", controller={"leader_speed_source": speed_source})
    mission = with_vehicle(chosen, vehicle, autopilot=kind, plant=hold)
    known, companion = flight_plan(mission, vehicle), companion_of(vehicle, mission=mission)
    limits = (known.airframe.airspeed_min, known.airframe.airspeed_max)
    now = 0.0
    for wait, telemetry, state in steps:
        now += wait
        if state is not None:
            companion.receive_link(encode(state), now)
        data = packed(*telemetry, system_id=known.system_id, component_id=1)
        out = companion.receive_mavlink(data, now)
        for message in parsed(out.to_autopilot):
            assert is_sound(message, limits)
        for published in out.to_link:
            # A follower tells where its leader was, too.
            assert len(published) == 104 or (vehicle == "f1" and len(published) == 112)


@settings(deadline=None, derandomize=True, max_examples=100)
@given(
    datagrams=st.lists(st.binary(max_size=120), max_size=6), links=st.lists(st.binary(max_size=100))
)
def test_random_bytes_from_everywhere_are_borne(datagrams, links):
    companion = companion_of()
    for number, data in enumerate(datagrams):
        for state in links:
            companion.receive_link(state, number / 10)
        out = companion.receive_mavlink(data, number / 10)
        assert out.to_link == out.events == []
    assert companion.snapshot.setpoint is None


F1 = 2
"""System of f1."""

FRAMES = int(os.environ.get("VFGUIDE_FUZZ_FRAMES", "40000"))
POOL = 4000
"""Frames that are made beforehand, as checksums take longest."""

DATAGRAM = 10
"""Frames that come together."""

GROWTH_MB = 4.2
"""Resident memory that may come in the last four fifths; 10^6 events of 100 bytes would be 100 MB."""

HEADER, CHECKSUM = 10, 2

ROUND, FORGED = 400, 120
"""Of so many datagrams, 20 s, forged frames come in this many."""

METRES = 0.0111
"""One unit of a latitude in a position frame, m."""


def sound_frames(system_id: int, now: float = 1.0) -> list[bytes]:
    """One of each kind that is listened to, and one that is not: of a vehicle that flies north at 20 m/s."""
    lat = 473_977_420 + round(20.0 * now / METRES)
    messages = [
        heartbeat(),
        heartbeat(6 << 16, autopilot=12),
        mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0),
        position_report(time_boot_ms=round(1000 * now), lat=lat, vx=2000, hdg=9000),
        mavlink.MAVLink_command_ack_message(43_002, 4),
        mavlink.MAVLink_statustext_message(4, b"low battery"),
        mavlink.MAVLink_param_value_message(b"GUIDED_P", 12_000.0, 9, 100, 1),
        mavlink.MAVLink_attitude_message(1000, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ]
    return [packed(message, system_id=system_id, component_id=1) for message in messages]


def mutated(frame: bytes, random: Random) -> bytes:
    """Some bytes of the payload changed, under a checksum that is right again."""
    content = bytearray(frame[HEADER:-CHECKSUM])
    for _ in range(random.randint(1, 6)):
        place = random.randrange(len(content))
        content[place] = random.choice((0, 0x7F, 0x80, 0xFF, random.randrange(256)))
    number = int.from_bytes(frame[7:10], "little")
    return frame_of(number, bytes(content), system_id=frame[5])


def damaged(frame: bytes, random: Random) -> bytes:
    """Cut, stretched or with a wrong byte anywhere."""
    content = bytearray(frame)
    content[random.randrange(len(content))] = random.randrange(256)
    return bytes(content[: random.randint(1, len(content))])


@pytest.mark.parametrize("kind", ["ardupilot", "px4", "auto"])
def test_no_frame_is_too_damaged_and_none_leaves_a_trace(kind):
    late = {"autopilot": kind, "course_lag_s": 0.4, "speed_dead_time_s": 0.5}
    companion = companion_of(mission=with_vehicle("line-calm", "f1", **late), inspect=True)
    random = Random(f"{kind} {FRAMES}")
    sound = sound_frames(F1)
    pool = [mutated(random.choice(sound), random) for _ in range(POOL)]
    true_heartbeat = int(kind == "px4")
    steered, early_mb = 0, 0.0
    count = FRAMES // 3 // DATAGRAM
    for number in range(count):
        now = number / 20
        if number % 2:
            companion.receive_link(leader_bytes(now), now)
        sound = sound_frames(F1, 1.0 + now)
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
            assert is_sound(message, (-math.inf, math.inf))
        if number == count // 5:
            early_mb = resident_mb()
    assert resident_mb() - early_mb < GROWTH_MB
    # It was not silent all along: some of it is obeyed.
    assert steered > 0


FLIGHT_S = 15.0


def malformed(now: float) -> list[bytes]:
    good = leader_bytes(now + 0.01, course=2.0)
    return [
        b"",
        b"\x00" * 104,
        good[:-1],
        good + b"\x00",
        good[:30] + bytes([good[30] ^ 1]) + good[31:],
        sealed(b"XXXX" + good[4:-4]),
        sealed(good[:4] + b"\x01" + good[5:-4]),
        leader_bytes(now + 0.01, course=float("nan")),
        leader_bytes(now + 0.01, ground_speed=float("inf")),
        leader_bytes(now + 0.01, latitude_deg=91.0),
    ]


def not_newer(now: float) -> list[bytes]:
    return [leader_bytes(now), *(leader_bytes(time_s, course=2.0) for time_s in (now, now - 0.3))]


def from_the_future(now: float) -> list[bytes]:
    return [leader_bytes(now + 0.26), leader_bytes(now + 1e6, time_s=1e300, latitude_deg=0.0)]


def too_old(now: float) -> list[bytes]:
    return [leader_bytes(now, time_s=-1e308, turn_rate=10.0, acceleration=100.0)]


@pytest.mark.parametrize("nonsense", [malformed, not_newer, from_the_future, too_old])
def test_nonsense_on_the_link_changes_nothing_but_a_counter(nonsense):
    clean = new_flight(until_s=FLIGHT_S)
    disturbed = new_flight(link=lambda now: [leader_bytes(now), *nonsense(now)], until_s=FLIGHT_S)
    assert disturbed.sent == clean.sent
    assert disturbed.events == clean.events
    assert sum(len(data) for _, data in clean.sent) > 5_000
    received = round(FLIGHT_S * 10 + 1) * len(nonsense(1.0))
    gained = disturbed.companion.counters - clean.companion.counters
    assert dict(gained) == {nonsense.__name__.replace("_", " "): received}


def test_the_leader_publishes_the_same_bytes_for_the_same_inputs():
    first = new_flight("leader", link=lambda _now: [], until_s=10.0)
    second = new_flight("leader", link=lambda now: [b"junk" * int(now)], until_s=10.0)
    assert first.published == second.published
    assert first.sent == second.sent
    assert len(first.published) > 75


def test_noise_between_the_frames_of_the_autopilot_changes_nothing():
    clean, disturbed = new_flight(until_s=10.0), new_flight()
    for step in range(100):
        disturbed.waiting += b"\x00\xff noise"
        disturbed.run(step / 10)
    disturbed.run(10.0)
    assert disturbed.sent == clean.sent
    assert disturbed.companion.counters["not MAVLink"] >= 100
