"""Formations without a broker, and over several links at once, on real sockets."""

import asyncio
import errno
import socket
import struct
import time
from contextlib import nullcontext, suppress
from itertools import count
from random import Random
from typing import Any

import pytest

from tests.kit.crew import Crew, crews_on, speak
from tests.kit.link import FORMATION, LEADER, ROSTER, trust_of
from tests.kit.sockets import PATIENCE_S, free_port, until
from vfguide.link import udp
from vfguide.link.carrier import parse_link, parse_links
from vfguide.link.codec import Kind
from vfguide.link.opening import WatchedFormation, open_link, presences
from vfguide.link.presence import Presence
from vfguide.link.udp import UdpAddress
from vfguide.registry import links

OUTAGE_S = 5.0
"""For so long an interface is gone."""

GROUPS = count(1)


def group() -> tuple[str, ...]:
    """A multicast group of one's own, on the loopback interface."""
    return (f"udp://239.255.77.{next(GROUPS)}:{free_port()}?interface=127.0.0.1",)


def peers(*names: str) -> dict[str, tuple[str, ...]]:
    """Addresses of members that know each other's."""
    ports = {name: free_port() for name in names}
    return {
        own: (
            "udp://"
            + ",".join(f"127.0.0.1:{port}" for name, port in ports.items() if name != own)
            + f"?port={ports[own]}",
        )
        for own in names
    }


def zenoh_peers(first: str, *others: str) -> dict[str, tuple[str, ...]]:
    """Addresses of members of whom one is known to all others, by which they find each other."""
    known, *own = (f"127.0.0.1:{free_port()}" for _ in (first, *others))
    links = {first: (f"zenoh://?listen={known}",)}
    return links | {
        name: (f"zenoh://{known}?listen={port}",) for name, port in zip(others, own, strict=True)
    }


async def test_by_zenoh_a_member_that_goes_away_is_heard_again_when_it_is_back():
    links = zenoh_peers(LEADER, "f1")
    async with crews_on({"f1": links["f1"]}) as (one,):
        assert not one.link.connected or not one.heard
        for _ in range(2):
            one.heard.clear()
            async with crews_on({LEADER: links[LEADER]}) as (leader,):
                await speak(leader.link, lambda: one.heard)
        one.heard.clear()
        # Meanwhile nobody is there, and nothing waits for anybody.
        for number in range(1000):
            one.link.publish(b"%d" % number)


@pytest.mark.parametrize("way", ["group", "group elsewhere", "broadcast", "peers", "zenoh"])
async def test_a_formation_hears_itself_without_a_broker(way, monkeypatch):
    names = (LEADER, "f1", "f2")
    if way == "peers":
        links = peers(*names)
    elif way.startswith("group"):
        if way == "group elsewhere":
            # As on macOS and Windows: interfaces are known by their addresses.
            monkeypatch.setattr(udp, "LINUX", False)
        links = dict.fromkeys(names, group())
    elif way == "zenoh":
        links = zenoh_peers(*names)
    else:
        links = dict.fromkeys(names, (f"udp://127.255.255.255:{free_port()}",))
    async with crews_on(links) as (leader, one, other):
        await speak(leader.link, lambda: one.heard and other.heard)
        await speak(one.link, lambda: leader.neighbours and other.neighbours)
        assert one.member.peer_clock is not None
        assert abs(one.member.peer_clock.offset_s) <= one.member.peer_clock.bound_s
        assert leader.link.connected
        assert one.link.connected
        assert {vehicle for vehicle, _ in other.neighbours} == {"f1"}


@pytest.mark.parametrize(("host", "shared"), [("127.255.255.255", True), ("127.0.0.255", False)])
def test_two_programs_share_a_port_where_a_broadcast_reaches_both_and_nowhere_else(host, shared):
    """The network 127.0.0.0 has 24 bits for its hosts: 127.0.0.255 is one of them."""
    address = parse_link(f"udp://{host}:{free_port()}", {})
    with (
        udp.open_socket(address),
        nullcontext() if shared else pytest.raises(OSError, match="in use"),
    ):
        udp.open_socket(address).close()


@pytest.mark.parametrize("way", ["group", "zenoh"])
async def test_a_key_that_is_revoked_is_out_over_every_such_link(way):
    names = (LEADER, "f1", "f2", "eye")
    links = dict.fromkeys(names, group()) if way == "group" else zenoh_peers(*names)
    async with crews_on(links) as (leader, one, other, operator):
        await speak(one.link, lambda: other.neighbours)
        operator.link.revoke("f1")
        await until(lambda: leader.member.trust.is_revoked or other.member.trust.revoked)
        await until(lambda: all(each.member.stands_back == (each is one) for each in (one, other)))
        await until(lambda: leader.member.trust.revoked == ("f1",))


async def test_a_presence_comes_every_second_whatever_its_length_and_a_goodbye_at_the_end():
    links = group()
    watched = WatchedFormation(
        addresses=parse_links(links), formation=FORMATION, leader=LEADER, roster=ROSTER
    )
    # What is too long for a datagram is cut; that a link is lost is said to the last.
    said = Presence(
        status="online",
        mode="tracking",
        time_s=1.0,
        version="1",
        obstacle="ö" * 100,
        warning="ü" * 200,
        figures={"links_lost": 1.0, **{f"some_delay_{number}_ms": 0.5 for number in range(60)}},
    )
    found: dict[str, Presence] = {}
    async with crews_on({LEADER: links, "f1": links}) as (_, one):
        one.link.announce(said)
        async with asyncio.timeout(PATIENCE_S):
            while "f1" not in found or found["f1"].mode != "tracking":
                found = await presences(watched, seconds=1.5, random=Random(1))
        assert found["f1"].status == found[LEADER].status == "online"
        assert found["f1"].figures["links_lost"] == 1.0
        listening = asyncio.create_task(presences(watched, seconds=4.0, random=Random(1)))
        await asyncio.sleep(1.5)
    found = await listening
    assert found["f1"].status == found[LEADER].status == "offline"


async def test_two_formations_on_one_wire_never_hear_each_other():
    links = group()
    stranger = Crew(LEADER, signed=False)
    async with (
        crews_on({LEADER: links, "f1": links}) as (leader, one),
        open_link(
            parse_links(links), formation="line", member=stranger.member, random=Random(3)
        ) as stranger.link,
    ):
        await speak(leader.link, lambda: one.heard)
        one.heard.clear()
        for number in range(50):
            stranger.link.publish(b"stranger %d" % number)
        await speak(leader.link, lambda: one.heard)
        assert not [data for data in one.heard if data.startswith(b"stranger")]
        assert one.counters["refused: not signed"] > 0


async def test_the_first_copy_counts_and_the_loss_of_either_link_costs_nothing(caplog):
    """Two groups; one of them falls silent for one member, as when a cable is pulled."""
    first, second = group(), group()
    both = (*first, *second)
    async with crews_on({LEADER: both, "f1": both}) as (leader, one):
        await speak(leader.link, lambda: one.heard)
        for carrier in (0, 1):
            one.heard.clear()
            lost = leader.link.carriers[carrier]
            sending, lost.send = lost.send, lambda _: None  # type: ignore[method-assign]
            for number in range(50):
                leader.link.publish(b"%d: %d" % (carrier, number))
                await until(lambda c=carrier, n=number: one.heard[-1:] == [b"%d: %d" % (c, n)])
            assert one.heard == [b"%d: %d" % (carrier, number) for number in range(50)]
            lost.send = sending  # type: ignore[method-assign]
        one.heard.clear()
        before = one.counters["copies"]
        for number in range(50):
            leader.link.publish(b"both %d" % number)
            await asyncio.sleep(0.002)
        await until(lambda: len(one.heard) == 50)
        await until(lambda: one.counters["copies"] >= before + 50)
        assert one.heard == [b"both %d" % number for number in range(50)]
    async with crews_on({LEADER: first, "f1": both}) as (leader, one):
        await until(lambda: "nobody is heard" in one.link.detail)
        await speak(leader.link, lambda: one.heard)
        assert one.link.connected
    assert "nobody is heard" in caplog.text


async def test_a_network_that_goes_away_is_told_and_found_again(caplog):
    links = group()
    async with crews_on({LEADER: links, "f1": links}) as (leader, one):
        await speak(leader.link, lambda: one.heard)
        opened = one.link.carriers[0].opened
        assert opened is not None
        # Its interface is gone: the membership is lost without a word.
        kind = socket.IPPROTO_IP, socket.IP_DROP_MEMBERSHIP
        address = one.link.carriers[0].address
        opened.setsockopt(
            *kind,
            socket.inet_aton(address.group) + struct.pack("=4si", socket.inet_aton("127.0.0.1"), 0),
        )
        one.heard.clear()
        began = time.monotonic()
        await speak(leader.link, lambda: not one.link.connected)
        await speak(leader.link, lambda: one.heard)
        assert time.monotonic() - began < 10.0
        assert one.counters["disconnected"] == 1
    assert "not connected" in caplog.text


class Interface:
    """One that can go away, as an adapter that is unplugged: Linux says so in these words."""

    def __init__(self, name: str) -> None:
        self.gone = False
        self._name = name
        self._open_socket, self._number = udp.open_socket, socket.if_nametoindex

    def number(self, name: str) -> int:
        if self.gone and name == self._name:
            raise OSError("no interface with this name")
        return self._number(name)

    def open_socket(self, address: UdpAddress) -> Any:
        real = self._open_socket(address)
        return OnInterface(real, self) if address.interface == self._name else real


class Wrapped:
    """A socket of which a test has some calls in hand."""

    def __init__(self, real: socket.socket) -> None:
        self.real = real

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real, name)


class OnInterface(Wrapped):
    """A socket on an interface that can go away."""

    def __init__(self, real: socket.socket, interface: Interface) -> None:
        super().__init__(real)
        self._interface = interface

    def sendto(self, data: bytes, destination: tuple[str, int]) -> int:
        if self._interface.gone:
            raise OSError(errno.ENODEV, "No such device")
        return self.real.sendto(data, destination)

    def recv(self, size: int) -> bytes:
        data = self.real.recv(size)
        if self._interface.gone:
            raise BlockingIOError
        return data


async def test_an_interface_that_is_gone_for_five_seconds_is_told_once_and_used_again_by_itself(
    monkeypatch, caplog
):
    """The follower's: nothing can be sent by it or heard, and no group be joined on it."""
    (by_address,) = group()
    links = {LEADER: (by_address,), "f1": (by_address.replace("=127.0.0.1", "=lo"),)}
    interface = Interface("lo")
    monkeypatch.setattr(udp, "open_socket", interface.open_socket)
    monkeypatch.setattr(socket, "if_nametoindex", interface.number)
    async with crews_on(links) as (leader, one):
        await speak(leader.link, lambda: one.heard)
        await speak(one.link, lambda: leader.neighbours)
        one.link.news()
        interface.gone = True
        await speak(one.link, lambda: not one.link.connected)
        told = one.link.news()
        one.heard.clear()
        async with asyncio.timeout(PATIENCE_S):
            for number in range(int(OUTAGE_S / 0.1)):
                leader.link.publish(b"unheard %d" % number)
                one.link.publish(b"unsaid %d" % number)
                await asyncio.sleep(0.1)
                told += one.link.news()
        assert not one.heard
        assert not one.link.connected
        assert one.link.detail == "no interface 'lo'"
        assert one.counters["failed to connect"] >= 3
        assert len(told) == 1
        assert "is lost" in told[0]
        interface.gone = False
        await speak(leader.link, lambda: one.heard)
        leader.neighbours.clear()
        await speak(one.link, lambda: leader.neighbours)
        assert one.link.connected
        assert [" is back" in text for text in one.link.news()] == [True]
        assert one.counters["disconnected"] == 1
    # That nothing can be sent, and that it is not there: each once, however often it is tried.
    assert caplog.text.count("not connected, No such device") == 1
    assert caplog.text.count("not connected, no interface 'lo'") == 1


async def test_an_interface_that_is_not_there_is_one_line_and_tried_again(caplog):
    links = (f"udp://239.255.77.250:{free_port()}?interface=nosuch0",)
    async with crews_on({"f1": links}) as (one,):
        assert not one.link.connected
        assert one.link.detail == "no interface 'nosuch0'"
        await until(lambda: one.counters["failed to connect"] >= 3)
        one.link.publish(b"into the void")
    assert caplog.text.count("not connected") == 1


async def test_hostile_datagrams_raise_nothing_and_hide_nothing():
    """Noise, cut and changed messages, and forgeries, between the true ones."""
    links = group()
    (address,) = parse_links(links)
    random = Random(5)
    async with crews_on({LEADER: links, "f1": links}) as (leader, one):
        await speak(leader.link, lambda: one.heard)
        good = leader.member.trust.seal(Kind.STATE, b"good", time_s=1.0)
        forger = trust_of(LEADER, 5, signed=False)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hostile:
            hostile.setsockopt(
                socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1")
            )
            for number in range(2000):
                changed = bytearray(good)
                changed[random.randrange(len(good))] ^= 1 + random.randrange(255)
                data = random.choice(
                    [
                        random.randbytes(random.randrange(300)),
                        good[: random.randrange(len(good))],
                        bytes(changed),
                        forger.seal(Kind.STATE, b"forged", time_s=1.0),
                    ]
                )
                with suppress(BlockingIOError):
                    hostile.sendto(data, address.destinations[0])
                if number % 50 == 0:
                    await asyncio.sleep(0.01)
        one.heard.clear()
        await speak(leader.link, lambda: one.heard)
        assert not {b"forged", b"good"} & set(one.heard)
        assert one.counters["refused: malformed"] > 500
        assert one.counters["failed to use"] == 0


async def test_a_peer_that_cannot_be_reached_cuts_nobody_else_off(monkeypatch):
    places = peers(LEADER, "f1")
    (beyond,) = (one.replace("udp://", "udp://127.0.0.9:9,") for one in places[LEADER])
    opened = udp.open_socket

    class Picky(Wrapped):
        """A socket from which one of the peers is unreachable."""

        def sendto(self, data: bytes, destination: tuple[str, int]) -> int:
            if destination[0] == "127.0.0.9":
                raise OSError(errno.ENETUNREACH, "Network is unreachable")
            return self.real.sendto(data, destination)

    monkeypatch.setattr(udp, "open_socket", lambda address: Picky(opened(address)))
    ways = {LEADER: (beyond,), "f1": places["f1"]}
    async with crews_on(ways) as (leader, follower):
        await speak(leader.link, lambda: follower.heard)


async def test_a_link_of_ones_own_that_raises_is_down_and_tried_again(caplog, monkeypatch):
    class Broken(udp.UdpCarrier):
        """Raises what no network does."""

        def transmit(self, data: bytes) -> None:
            raise ValueError(f"no\nradio for {len(data)} bytes")

    monkeypatch.setitem(links._known, "broken", Broken)  # noqa: SLF001

    class Address(UdpAddress):
        scheme = "broken"

    crew = Crew(LEADER)
    address = Address(destinations=(("127.0.0.1", free_port()),), port=free_port())
    async with open_link(
        (address,), formation=FORMATION, member=crew.member, random=Random(3)
    ) as link:
        await until(lambda: not link.connected and link.detail)
        link.publish(b"1")
        assert "ValueError in test_udp_links.py" in link.detail
        assert "no radio" in link.detail
    assert "Traceback" not in caplog.text
