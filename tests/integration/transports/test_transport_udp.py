import asyncio
import socket
from typing import Any

import pytest

from tests.kit.sockets import free_port, until
from tests.kit.wire import beat
from vfguide.errors import InputError
from vfguide.mavlink.connection import LARGEST_DATAGRAM

Address = tuple[Any, ...]


async def heard(peer: socket.socket) -> bytes:
    """The next datagram that reaches a peer."""
    async with asyncio.timeout(60.0):
        return await asyncio.get_running_loop().sock_recv(peer, 65_536)


async def test_a_port_answers_whoever_speaks(opened, voice):
    port = free_port()
    async with opened(f"udpin://127.0.0.1:{port}") as (connection, inbox):
        assert not connection.connected
        peer = voice()
        peer.sendto(beat(), ("127.0.0.1", port))
        await inbox.holds(beat())
        assert connection.connected
        connection.send(b"answer")
        assert await heard(peer) == b"answer"


async def test_nothing_is_sent_before_somebody_has_spoken(opened):
    async with opened(f"udpin://127.0.0.1:{free_port()}") as (connection, _):
        connection.send(b"setpoint")
        connection.send(b"setpoint")
        assert connection.counters["dropped: not connected"] == 2


def has_loopback_6() -> bool:
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True


IPV6 = pytest.mark.skipif(not has_loopback_6(), reason="this computer has no IPv6")


@pytest.mark.parametrize(
    ("here", "there"),
    [("0.0.0.0", "localhost"), pytest.param("[::1]", "[::1]", marks=IPV6)],  # noqa: S104
)
async def test_both_ends_speak_to_each_other(opened, here, there):
    port = free_port()
    async with (
        opened(f"udpin://{here}:{port}") as (waiting, waited),
        opened(f"udpout://{there}:{port}") as (speaking, answered),
    ):
        assert speaking.connected
        speaking.send(beat(1))
        await waited.holds(beat(1))
        waiting.send(beat(2) + beat(3))
        await answered.holds(beat(2) + beat(3))
        assert answered.datagrams == [beat(2) + beat(3)]


async def test_a_stray_packet_neither_steals_setpoints_nor_passes_for_telemetry(opened, voice):
    port = free_port()
    async with opened(f"udpin://127.0.0.1:{port}") as (connection, inbox):
        peer, stray = voice(), voice()
        peer.sendto(beat(1), ("127.0.0.1", port))
        await inbox.holds(beat(1))
        stray.sendto(beat(2), ("127.0.0.1", port))
        await until(lambda: connection.counters["datagrams of strangers"] == 1)
        connection.send(b"setpoint")
        assert await heard(peer) == b"setpoint"
        await inbox.holds(beat(1))
        with pytest.raises(BlockingIOError):
            stray.recv(100)


async def test_another_peer_takes_over_when_the_first_is_silent(opened, voice):
    port = free_port()
    async with opened(f"udpin://127.0.0.1:{port}") as (connection, inbox):
        first, second = voice(), voice()
        first.sendto(beat(1), ("127.0.0.1", port))
        await inbox.holds(beat(1))

        def second_is_heard() -> bool:
            second.sendto(beat(2), ("127.0.0.1", port))
            return bool(inbox.content.endswith(beat(2)))

        await until(second_is_heard)
        connection.send(b"setpoint")
        assert await heard(second) == b"setpoint"
        assert connection.counters["connected"] == 2


async def test_what_is_larger_than_a_packet_is_not_handed_on(opened, voice):
    port = free_port()
    async with opened(f"udpin://127.0.0.1:{port}") as (connection, inbox):
        peer = voice()
        peer.sendto(b"\xfe" * (LARGEST_DATAGRAM + 1), ("127.0.0.1", port))
        peer.sendto(b"\xfe" * 60_000, ("127.0.0.1", port))
        await until(lambda: connection.counters["oversized datagrams"] == 2)
        peer.sendto(b"", ("127.0.0.1", port))
        peer.sendto(b"garbage", ("127.0.0.1", port))
        await until(lambda: connection.counters["datagrams of strangers"] == 2)
        assert not connection.connected
        peer.sendto(beat(), ("127.0.0.1", port))
        await inbox.holds(beat())


async def test_what_cannot_be_sent_is_counted(opened):
    async with opened(f"udpout://127.0.0.1:{free_port()}") as (connection, _):
        connection.send(bytes(70_000))
        assert connection.counters["error: Message too long"] == 1
        connection.send(b"")


async def test_a_peer_that_is_not_up_yet_is_no_error(opened, voice):
    port = free_port()
    async with opened(f"udpout://127.0.0.1:{port}") as (connection, inbox):
        for _ in range(5):
            connection.send(beat(1))
            await asyncio.sleep(0)
        peer = voice(port)
        connection.send(beat(2))
        data, sender = await asyncio.get_running_loop().sock_recvfrom(peer, 1000)
        assert data == beat(2)
        peer.sendto(beat(3), sender)
        await inbox.holds(beat(3))
        assert connection.connected


async def test_only_the_host_that_was_given_is_listened_to(opened, voice):
    port = free_port()
    peer, stray = voice(port), voice()
    async with opened(f"udpout://127.0.0.1:{port}") as (connection, inbox):
        connection.send(beat(1))
        _, sender = await asyncio.get_running_loop().sock_recvfrom(peer, 1000)
        stray.sendto(beat(2), sender)
        await until(lambda: connection.counters["datagrams of strangers"] == 1)
        assert inbox.datagrams == []


async def test_a_name_that_is_not_known_yet_is_looked_up_again(opened, voice, monkeypatch):
    port, real = free_port(), socket.getaddrinfo
    tries: list[object] = []

    def slow_to_know(*asked: object, **options: int) -> list[Address]:
        tries.append(asked)
        if len(tries) < 3:
            raise socket.gaierror(-3, "Temporary failure in name resolution")
        return real("127.0.0.1", port, **options)

    monkeypatch.setattr(socket, "getaddrinfo", slow_to_know)
    peer = voice(port)
    async with opened(f"udpout://autopilot.example:{port}") as (connection, _):
        connection.send(b"too early")
        assert connection.counters["dropped: not connected"] == 1
        await until(lambda: connection.connected)
        connection.send(b"now")
        assert await heard(peer) == b"now"


@pytest.mark.parametrize("kind", ["udpin", "tcpin"])
async def test_a_port_in_use_is_the_operators_to_free(opened, kind):
    address = f"{kind}://127.0.0.1:{free_port()}"
    async with opened(address):
        with pytest.raises(InputError, match="in use; end the other program") as caught:
            async with opened(address):
                pytest.fail("two listen at one port")
        assert address in str(caught.value)


@pytest.mark.parametrize("kind", ["udpin", "tcpin"])
async def test_an_address_of_another_computer_cannot_be_listened_at(opened, kind):
    # 192.0.2.0/24 is kept for documentation: nobody has it.
    with pytest.raises(InputError, match=r"write an address of this computer, or 0\.0\.0\.0"):
        async with opened(f"{kind}://192.0.2.1:14540"):
            pytest.fail("listens at somebody else's address")


async def test_errors_of_the_program_pass_through(opened):
    with pytest.raises(ConnectionError, match="of the program"):
        async with opened(f"udpin://127.0.0.1:{free_port()}"):
            raise ConnectionError("of the program")
