import struct
import zlib

import pytest

from tests.kit.companion import leader_bytes, new_flight

FLIGHT_S = 15.0


def with_checksum(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


def malformed(now: float) -> list[bytes]:
    good = leader_bytes(now + 0.01, course=2.0)
    return [
        b"",
        b"\x00" * 104,
        good[:-1],
        good + b"\x00",
        good[:30] + bytes([good[30] ^ 1]) + good[31:],
        with_checksum(b"XXXX" + good[4:-4]),
        with_checksum(good[:4] + b"\x01" + good[5:-4]),
        leader_bytes(now + 0.01, course=float("nan")),
        leader_bytes(now + 0.01, ground_speed=float("inf")),
        leader_bytes(now + 0.01, latitude_deg=91.0),
    ]


def not_newer(now: float) -> list[bytes]:
    turned = [leader_bytes(time_s, course=2.0) for time_s in (now, now - 0.3)]
    return [leader_bytes(now), *turned]


def from_the_future(now: float) -> list[bytes]:
    return [leader_bytes(now + 0.26), leader_bytes(now + 1e6, time_s=1e300, latitude_deg=0.0)]


@pytest.mark.parametrize("nonsense", [malformed, not_newer, from_the_future])
def test_nonsense_on_the_link_changes_nothing_but_a_counter(nonsense):
    clean = new_flight(until_s=FLIGHT_S)
    disturbed = new_flight(link=lambda now: [leader_bytes(now), *nonsense(now)], until_s=FLIGHT_S)
    assert disturbed.sent == clean.sent
    assert disturbed.events == clean.events
    assert sum(len(data) for _, data in clean.sent) > 5_000
    received = round(FLIGHT_S * 10 + 1) * len(nonsense(1.0))
    gained = disturbed.companion.counters - clean.companion.counters
    assert dict(gained) == {nonsense.__name__.replace("_", " "): received}


def test_a_leader_state_that_is_too_old_to_be_one_changes_nothing():
    ancient = leader_bytes(0.0, time_s=-1e308, turn_rate=10.0, acceleration=100.0)
    clean = new_flight(link=lambda _now: [], until_s=5.0)
    disturbed = new_flight(link=lambda _now: [ancient], until_s=5.0)
    assert disturbed.sent == clean.sent
    assert disturbed.companion.counters["too old"] == 51


def test_a_leader_state_that_comes_late_is_used_if_it_is_the_newest():
    flown = new_flight(link=lambda now: [leader_bytes(now - 0.3)], until_s=40.0)
    assert flown.companion.counters["not newer"] == 0
    assert flown.companion.snapshot.mode.value == "tracking"


def test_the_same_inputs_lead_to_the_same_bytes():
    first, second = new_flight(until_s=30.0), new_flight(until_s=30.0)
    assert first.sent == second.sent
    assert first.events == second.events


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
