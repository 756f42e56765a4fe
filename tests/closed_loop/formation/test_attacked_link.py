"""An attacker forges, replays and reflects what is said: the formation flies as without the attack."""

from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from tests.kit.missions import on_the_circle
from tests.kit.signed_flight import ELSEWHERE, SignedFlight
from vfguide.lab.report.figures import slot_error
from vfguide.link.codec import (
    Kind,
    Scheme,
    checksum,
    decode,
    decode_envelope,
    encode,
    encode_signed,
)

Attack = Callable[[bytes, Sequence[bytes]], list[bytes]]
"""What is heard in addition to a message, all that was said so far given."""

FLOWN_S, SETTLED_S = 30.0, 20.0

DEGREES_60_M = 60.0 / 111_000.0


def flown(attack: Attack, *, signed: bool = True) -> SignedFlight:
    """Fly the article's circle, everybody in place, over a wire that is attacked."""
    flight, said = SignedFlight(on_the_circle(rate_hz=10.0), signed=signed), list[bytes]()

    def overhear(sender: str, data: bytes) -> None:
        if sender != ELSEWHERE:
            said.append(data)
            for made in attack(data, said):
                flight.carry(ELSEWHERE, made)

    flight.overhears.append(overhear)
    flight.fly(FLOWN_S)
    return flight


def forged_states(data: bytes, said: Sequence[bytes]) -> list[bytes]:
    """The same sender 60 m farther north, newer in all but the signature; with and without one."""
    del said
    real = decode_envelope(data)
    if real.kind is not Kind.STATE:
        return []
    state = decode(real.body)
    made = []
    for scheme in Scheme:
        signed = encode_signed(
            scheme,
            real.kind,
            formation=real.formation,
            sender=real.sender,
            session=real.session,
            epoch=real.epoch,
            sequence=real.sequence + 1_000,
            time_s=real.time_s + 1.0,
            body=encode(replace(state, latitude_deg=state.latitude_deg + DEGREES_60_M)),
        )
        made.append(signed + (checksum(signed) if scheme is Scheme.UNSIGNED else real.tag))
    return made


def replayed_and_reflected(data: bytes, said: Sequence[bytes]) -> list[bytes]:
    """What was said seconds ago and at the beginning, in the same words, and this once more."""
    return [data, *said[-400:-390], *said[:3]]


def test_an_attacked_formation_flies_bit_for_bit_as_if_it_were_not():
    calm = flown(lambda data, said: []).record()  # noqa: ARG005
    late = calm.time_s >= SETTLED_S
    for follower in calm.followers:
        assert slot_error(calm.leader, follower).distance_m[late].max() < 1.0
    for attack in (forged_states, replayed_and_reflected):
        beset = flown(attack)
        for before, now in zip(calm.vehicles, beset.record().vehicles, strict=True):
            assert np.array_equal(before.north_m, now.north_m)
            assert np.array_equal(before.east_m, now.east_m)
        refused = sum(sum(one.member.counters.values()) for one in beset.members.values())
        assert refused > 1000


def test_without_signatures_who_forges_the_leader_leads():
    """What --insecure means, and that the attack of the test above is one: followers leave their slots."""
    record = flown(forged_states, signed=False).record()
    errors = [slot_error(record.leader, one).distance_m for one in record.followers]
    assert max(float(one.max()) for one in errors) > 10.0
