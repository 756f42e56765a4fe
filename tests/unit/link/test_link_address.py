from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vfguide.errors import InputError
from vfguide.link.carrier import parse_link, parse_links
from vfguide.link.client import MqttAddress
from vfguide.link.radio import RadioAddress
from vfguide.link.radio_schedule import Channel
from vfguide.link.udp import UdpAddress

HIDDEN = "hunter2"
AWKWARD = "p/w:@"


def outcome(text: str) -> MqttAddress | str:
    """The address, or what is said against it."""
    try:
        return parse_link(text, {})
    except InputError as fault:
        return str(fault)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mqtt://broker", MqttAddress(host="broker", port=1883)),
        ("mqtts://broker", MqttAddress(host="broker", port=8883, secure=True)),
        ("MQTT://10.0.0.1:1884/", MqttAddress(host="10.0.0.1", port=1884)),
        ("mqtt://[fd00::10]:1883/a/b", MqttAddress(host="fd00::10", port=1883, prefix="a/b")),
        ("mqtt://crew@broker", MqttAddress(host="broker", port=1883, user="crew")),
        (
            "mqtt://crew%40north:p%2Fw%3A%40@broker:1883",
            MqttAddress(host="broker", port=1883, user="crew@north", password=AWKWARD),
        ),
        (
            "mqtts://crew:hunter2@broker/team?ca=/etc/ca.pem&cert=c.pem&key=k.pem",
            MqttAddress(
                host="broker",
                port=8883,
                prefix="team",
                secure=True,
                user="crew",
                password=HIDDEN,
                ca=Path("/etc/ca.pem"),
                cert=Path("c.pem"),
                key=Path("k.pem"),
            ),
        ),
    ],
)
def test_addresses(text, expected):
    assert parse_link(text, {}) == expected


WRONG = {
    "mqtt://HOST:1883/PREFIX": ("", "broker:1883", "mqtt:broker"),
    "begin with mqtt://, mqtts://, udp://, zenoh:// or serial://": ("http://broker",),
    "IPv4 addresses and ports": ("udp://239.0.0.1", "udp://[ff02::1]:14700", "udp://host:14700"),
    "within 1 to 65535": (
        "udp://239.0.0.1:0",
        "udp://10.0.0.1:1?port=99999",
        "mqtt://broker:0",
        "mqtt://broker:65536",
        "mqtt://broker:port",
    ),
    "has no path": ("udp://239.0.0.1:14700/a",),
    "come interface= and port=": ("udp://239.0.0.1:14700?ttl=3",),
    "reaches everybody by itself": ("udp://239.0.0.1:14700,10.0.0.1:14700",),
    "goes with a multicast group": ("udp://10.0.0.1:14700?interface=eth0",),
    "blanks": ("udp://239.0.0.1:14700?interface=a b", "mqtt://bro ker"),
    "is no interface": ("udp://239.0.0.1:14700?interface=a/b",),
    "a Zenoh peer is HOST:PORT": (
        "zenoh://10.0.0.2",
        "zenoh://10.0.0.2:70000",
        "zenoh://?listen=0.0.0.0",
    ),
    "a Zenoh link has peers": ("zenoh://10.0.0.2:7447/topic", "zenoh://10.0.0.2:7447?mode=client"),
    "a device file and a baud rate": (
        "serial:///dev/ttyUSB1",
        "serial://dev/ttyUSB1:57600",
        "serial:///dev/:57600",
    ),
    "the baud rate is missing": ("serial:///dev/ttyUSB1:fast",),
    "within 1200 to 12000000": ("serial:///dev/ttyUSB1:300",),
    "key=, leader=, followers= and air=": ("serial:///dev/ttyUSB1:57600?slots=3",),
    "once each": ("serial:///dev/ttyUSB1:57600?air=1&air=2", "mqtts://broker?ca=x&ca=y"),
    "names no file": ("serial:///dev/ttyUSB1:57600?key=",),
    "leader= must be within 0.1 to 50": ("serial:///dev/ttyUSB1:57600?leader=nan",),
    "air= must be within 0.1 to 1e+06": ("serial:///dev/ttyUSB1:57600?air=0",),
    "the host is missing": ("mqtt://",),
    "blanks or control": ("mqtt://broker\n",),
    "the host is no name": ("mqtt://-broker",),
    "the host is no name or number": ("mqtt://1.2.3",),
    "the host is no": ("mqtt://[::zz]", "mqtt://[::1"),
    "the user name is missing": ("mqtt://:pw@broker",),
    "%23": ("mqtt://broker/a#b",),
    "the prefix cannot begin a topic": (
        "mqtt://broker/a+b",
        "mqtt://broker/$SYS",
        "mqtt://broker/a//b",
    ),
    "mqtts://": ("mqtt://broker?ca=x",),
    "not understood": ("mqtts://broker?ca",),
    "a file name is missing": ("mqtts://broker?ca=",),
    "ca=, cert= and key=": ("mqtts://broker?password=x",),
    "cert= and key= go together": ("mqtts://broker?cert=x",),
}


@pytest.mark.parametrize(
    ("text", "remedy"), [(text, remedy) for remedy, texts in WRONG.items() for text in texts]
)
def test_a_wrong_address_is_one_line_with_the_remedy(text, remedy):
    with pytest.raises(InputError) as caught:
        parse_link(text, {})
    line = str(caught.value)
    assert line.startswith("link address: ")
    assert remedy in line
    assert "\n" not in line


@pytest.mark.parametrize(
    "text",
    [
        "mqtt://crew:hunter2@broker:1883/p",
        "mqtt://crew:hunter2/x@broker:1883",
        "mqtt://crew:hunter2",
        "mqtt:crew:hunter2@broker",
        "crew:hunter2@broker",
        "mqtt://crew:#hunter2@broker",
        "mqtt://crew:hunter2@broker:port",
        "mqtts://crew:hunter2@broker?password=hunter2",
        "mqtts://crew:hunter2@broker?hunter2",
        "mqtt://:hunter2@broker",
        "mqtt://crew:x?hunter2@broker",
        "mqtt://crew:hunter2@[broker",
        "mqtt://crew:hunter2 @broker",
        "mqtt://broker/+hunter2",
    ],
)
def test_the_password_is_never_shown(text):
    found = outcome(text)
    assert HIDDEN not in repr(found) + str(found) + f"{found}"
    assert isinstance(found, str) or found.password == HIDDEN


@pytest.mark.parametrize(
    ("text", "password", "shown"),
    [
        ("mqtt://crew@broker", HIDDEN, "mqtt://broker:1883/vfguide"),
        ("mqtt://crew:p%2Fw%3A%40@[fd00::1]/p", AWKWARD, "mqtt://[fd00::1]:1883/p"),
        # Nobody to whom it could belong.
        ("mqtts://broker", None, "mqtts://broker:8883/vfguide"),
    ],
)
def test_the_environment_has_the_password_that_the_address_leaves_out(text, password, shown):
    address = parse_link(text, {"VFGUIDE_LINK_PASSWORD": HIDDEN})
    assert address.password == password
    assert str(address) == shown


LINKS = st.text("udp:/,?=.0123456789 port interface", max_size=60)


@settings(deadline=None, derandomize=True, max_examples=500)
@example(text="\u2100")
@example(text="a\ud800")
@given(text=st.text() | LINKS)
def test_any_text_is_an_address_or_refused_in_one_line(text):
    for start in ("", "mqtt://", "mqtts://h?", "udp://", "udp://10.0.0.1:"):
        found = outcome(start + text)
        if isinstance(found, str):
            assert len(found.splitlines()) == 1
        elif isinstance(found, MqttAddress):
            assert 1 <= found.port <= 65_535
            assert not set("+#") & set(found.prefix)


def test_a_group_a_broadcast_address_and_peers_are_told_apart():
    group = parse_link("udp://239.255.42.1:14700?interface=wlan0", {})
    assert (group.group, group.port, group.interface) == ("239.255.42.1", 14700, "wlan0")
    broadcast = parse_link("udp://10.0.0.255:14700", {})
    assert broadcast.group is None
    peers = parse_link("udp://10.0.0.2:1400,10.0.0.3:1500?port=1600", {})
    assert peers.destinations == (("10.0.0.2", 1400), ("10.0.0.3", 1500))
    assert (peers.group, peers.port) == (None, 1600)
    assert str(peers) == "udp://10.0.0.2:1400,10.0.0.3:1500"
    assert {type(one) for one in (group, broadcast, peers)} == {UdpAddress}


def test_a_link_that_is_named_twice_is_opened_once():
    text = "udp://239.255.42.1:14700"
    assert len(parse_links([text, "mqtt://broker", text])) == 2
    with pytest.raises(InputError, match="there is none"):
        parse_links([])


def test_a_radio_is_a_port_with_a_speed_and_rates():
    port = "/dev/serial/by-path/pci-0000:00:14.0-port0"
    address = parse_link(f"serial://{port}:57600?key=a.keys/radio.psk&leader=5&air=2000", {})
    assert address == RadioAddress(
        device=port,
        channel=Channel(baud=57_600, air_bytes_s=2000.0),
        key=Path("a.keys/radio.psk"),
        leader_hz=5.0,
        followers_hz=2.5,
    )
    assert str(address) == f"serial://{port}:57600"
