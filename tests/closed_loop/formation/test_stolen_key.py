"""A vehicle's key is stolen in flight and revoked by the operator: the others fly on without that vehicle."""

import math
from collections.abc import Iterable
from typing import Any

from msgspec.structs import replace

from tests.kit.missions import in_place, shipped
from tests.kit.signed_flight import Impostor, SignedFlight
from vfguide.lab.rehearsal.aircraft import OPERATOR
from vfguide.lab.report.figures import slot_error
from vfguide.link.codec import Envelope, Kind, decode, encode
from vfguide.link.member import KEY_OUT
from vfguide.link.trust import REVOKED, Message

METRES_A_DEGREE = 111_000.0

STOLEN_S, REVOKED_S, ENDS_S = 12.0, 22.0, 50.0

OUT_S = 2.0
"""A revoked key is out so long after the statement."""

BACK_S = 12.0
"""So long after it everybody is in its slot again."""


class Thief(Impostor):
    """Says whenever the leader speaks that f1 flies 4 m ahead of the slot of f2."""

    lies = False

    def hear(self, envelope: Envelope) -> None:
        if not (self.lies and self.state and envelope.kind is Kind.STATE):
            return
        if envelope.sender != "leader":
            return
        leader, slot = decode(envelope.body), shipped("line-calm").followers_by_name["f2"].slot
        ahead_m = slot.forward_m + 4.0
        north_m = ahead_m * math.cos(leader.course) - slot.right_m * math.sin(leader.course)
        east_m = ahead_m * math.sin(leader.course) + slot.right_m * math.cos(leader.course)
        east_m /= math.cos(math.radians(leader.latitude_deg))
        place = replace(
            decode(self.state),
            time_s=leader.time_s,
            latitude_deg=leader.latitude_deg + north_m / METRES_A_DEGREE,
            longitude_deg=leader.longitude_deg + east_m / METRES_A_DEGREE,
        )
        self.say(Kind.STATE, encode(place))


def noted(flight: SignedFlight, sender: str, hearers: Iterable[str]) -> list[float]:
    """Times at which anything of a sender is believed by some, to be filled while all fly."""
    times: list[float] = []
    for name in hearers:
        member = flight.members[name].member
        believe = member.trust.believe

        def note(envelope: Envelope, *rest: Any, believe: Any = believe, **options: Any) -> Message:
            message: Message = believe(envelope, *rest, **options)
            if message.sender == sender:
                times.append(flight.now)
            return message

        member.trust.believe = note  # type: ignore[method-assign]
    return times


def test_a_stolen_key_is_out_two_seconds_after_it_is_revoked_and_the_others_fly_in_their_slots():
    flight = SignedFlight(in_place("line-calm", rate_hz=10.0, link_delay_s=0.1))
    thief = Thief(flight, "f1")
    believed = noted(flight, "f1", ("leader", "f2", "f3", OPERATOR))
    flight.fly(STOLEN_S)
    thief.lies = True
    flight.fly(REVOKED_S)
    flight.operator.member.revoke("f1")
    flight.fly(ENDS_S)
    assert REVOKED_S - 1.0 < max(believed) <= REVOKED_S + OUT_S
    assert flight.members["f2"].member.counters[f"refused: {REVOKED}"] > 100
    record = flight.record()
    errors = {one.name: slot_error(record.leader, one).distance_m for one in record.followers}
    stolen = (record.time_s >= STOLEN_S) & (record.time_s < REVOKED_S)
    # It is an attack: f2 makes way for what is not there.
    assert errors["f2"][stolen].max() > 5.0
    assert errors["f2"][record.time_s >= REVOKED_S + BACK_S].max() < 1.0
    assert errors["f3"][record.time_s >= STOLEN_S].max() < 1.0
    # Its owner cannot be heard any more, and does not steer.
    assert not flight.aircraft["f1"].companion.snapshot.mode.steers
    told = [event.text for event in flight.aircraft["f1"].events]
    assert any(KEY_OUT in text for text in told), told
