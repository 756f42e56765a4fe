"""What one who only watches hears by datagrams: each sender's newest true state, a few times a second."""

import pytest

from tests.kit.link import trust_of
from vfguide.link.datagrams import MOST_HELD, MOST_SENDERS, HeldMail
from vfguide.link.envelope import Kind
from vfguide.link.member import Member
from vfguide.link.trust import Trust


def state(trust: Trust, body: bytes) -> bytes:
    return trust.seal(Kind.STATE, body, time_s=0.0)


def forged(sealed: bytes) -> bytes:
    """The same with another signature."""
    return sealed[:-1] + bytes([sealed[-1] ^ 1])


@pytest.fixture
def heard() -> list[tuple[str, bytes]]:
    return []


@pytest.fixture
def watcher(heard: list[tuple[str, bytes]]) -> Member:
    return Member(
        trust_of("eye", 9, watches=True),
        clock=lambda: 0.0,
        neighbours=("f1", "f2"),
        receive_neighbour=lambda vehicle, data: heard.append((vehicle, data)),
        receive_presence=lambda _vehicle, _presence: None,
    )


def look(mail: HeldMail, watcher: Member) -> None:
    for newest_first in mail.take():
        watcher.take_newest(newest_first)


def test_of_each_sender_the_newest_is_looked_at_alone(watcher, heard):
    mail, first, second = HeldMail(), trust_of("f1", 1), trust_of("f2", 2)
    for number in range(4):
        assert mail.put(state(first, b"f1 %d" % number))
        assert mail.put(state(second, b"f2 %d" % number))
    look(mail, watcher)
    assert heard == [("f1", b"f1 3"), ("f2", b"f2 3")]
    look(mail, watcher)
    assert len(heard) == 2


def test_a_forged_state_does_not_stand_before_a_true_one(watcher, heard):
    mail, trust = HeldMail(), trust_of("f1", 1)
    mail.put(state(trust, b"true"))
    mail.put(forged(state(trust, b"another")))
    look(mail, watcher)
    assert heard == [("f1", b"true")]
    assert watcher.counters["refused: forged"] == 1


def test_a_repeated_old_state_does_not_stand_before_a_new_one(watcher, heard):
    mail, trust = HeldMail(), trust_of("f1", 1)
    old, new = state(trust, b"old"), state(trust, b"new")
    mail.put(old)
    look(mail, watcher)
    mail.put(new)
    mail.put(old)
    look(mail, watcher)
    assert heard == [("f1", b"old"), ("f1", b"new")]


def test_what_is_no_state_is_not_held():
    mail, trust = HeldMail(), trust_of("f1", 1)
    for data in (b"", b"VFE1", b"x" * 200, trust.seal(Kind.PRESENCE, b"", time_s=0.0)):
        assert not mail.put(data)
    assert len(mail) == 0


def test_a_flood_of_names_or_of_one_is_bounded():
    mail, sealed = HeldMail(), state(trust_of("f1", 1), b"")
    for number in range(MOST_SENDERS + 50):
        name = b"%02x" % (number % 256)
        assert mail.put(sealed.replace(b"f1", name, 1)) is (number < MOST_SENDERS)
    for _ in range(MOST_HELD + 50):
        mail.put(sealed)
    assert len(mail) == MOST_SENDERS
    assert max(len(states) for states in mail.take()) <= MOST_HELD + 1
