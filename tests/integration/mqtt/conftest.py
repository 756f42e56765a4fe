"""Brokers to speak to, and links that leave nothing behind."""

import asyncio
import base64
import gc
import hashlib
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.kit.programs import Mosquitto
from tests.kit.sockets import until
from vfguide.link.carrier import LinkAddress, parse_link
from vfguide.link.keys import KeyPlaces, key_places, make_keys, read_private_key, read_roster
from vfguide.link.member import Member, ignore
from vfguide.link.opening import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust, new_session

Make = Callable[..., Any]

PROOF_S = 2.0
"""For a leader's answer."""


async def proof_of(member: Member) -> None:
    """Wait until the leader has shown that it lives; where a test has none, not for long."""
    with suppress(TimeoutError):
        await until(lambda: member.trust.proven, PROOF_S)


@pytest.fixture
def password_file(tmp_path: Path) -> Callable[[str, str], Path]:
    """Writes a file with one user in it, as mosquitto_passwd would."""

    def make(user: str, secret: str) -> Path:
        salt, rounds = b"twelve bytes", 101
        digest = hashlib.pbkdf2_hmac("sha512", secret.encode(), salt, rounds)
        fields = ("7", str(rounds), *(base64.b64encode(part).decode() for part in (salt, digest)))
        path = tmp_path / "passwords"
        path.write_text(f"{user}:${'$'.join(fields)}\n")
        return path

    return make


@pytest.fixture
def guarded(mosquitto: Make, password_file: Callable[[str, str], Path], tmp_path: Path) -> Make:
    """Starts a broker for some users, whose password is `word`, by rules if there are any."""

    def start(*users: str, rules: str = "") -> Mosquitto:
        passwords, file = tmp_path / "all-passwords", tmp_path / "rules"
        passwords.write_text("".join(password_file(name, "word").read_text() for name in users))
        file.write_text(rules)
        settings = f"allow_anonymous false\npassword_file {passwords}\n"
        return mosquitto(settings + (f"acl_file {file}\n" if rules else ""), basis="user root\n")

    return start


@pytest.fixture
def port(mosquitto: Make) -> int:
    """Port of a broker that lets everybody in."""
    broker: Mosquitto = mosquitto()
    return broker.port


@pytest.fixture(scope="session")
def formation_keys(tmp_path_factory: pytest.TempPathFactory) -> KeyPlaces:
    """Keys of the formation that is tested."""
    places = key_places(tmp_path_factory.mktemp("keys") / "test.yaml")
    make_keys(places, "test", ["lead", "f0", "f1", "f2", "f3"])
    return places


@pytest.fixture(scope="session")
def opened(formation_keys: KeyPlaces) -> Make:
    """Opens a link of a vehicle, with a list of what it receives, and sees that nothing is left of it."""

    open_now = 0

    @asynccontextmanager
    async def make(
        where: int | str | LinkAddress,
        vehicle: str,
        listen_to: str | None = None,
        *,
        receive: Callable[[bytes], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
        peer_clock: PeerClock | None = None,
        signed: bool = True,
    ) -> AsyncIterator[tuple[Link, list[bytes]]]:
        nonlocal open_now
        received: list[bytes] = []
        if isinstance(where, int):
            where = f"mqtt://127.0.0.1:{where}"
        if isinstance(where, str):
            where = parse_link(where, {})
        trust = Trust(
            formation="test",
            name=vehicle,
            leader="lead",
            session=new_session(),
            roster=read_roster(formation_keys.roster) if signed else None,
            key=read_private_key(formation_keys.private(vehicle)) if signed else None,
        )
        member = Member(
            trust,
            clock=clock,
            receive=ignore if listen_to is None else receive or received.append,
            peer_clock=PeerClock() if listen_to is not None and peer_clock is None else peer_clock,
        )
        open_now += 1
        async with open_link((where,), formation="test", member=member, random=Random(1)) as link:
            if link.connected and member.peer_clock is not None:
                await proof_of(member)
            try:
                yield link, received
            finally:
                open_now -= 1
        if open_now:
            return
        # Tasks of the test itself come and go as they like.
        every = asyncio.all_tasks()
        left = {
            task
            for task in every
            if "aiomqtt" in repr(task.get_coro()) or "vfguide/link/" in repr(task.get_coro())
        }
        await asyncio.wait(left, timeout=2.0) if left else None
        assert not {task for task in left if not task.done()}
        gc.collect()

    return make
