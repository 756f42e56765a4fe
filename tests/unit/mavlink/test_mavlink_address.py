import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vfguide.errors import InputError
from vfguide.mavlink.address import NetworkAddress, SerialAddress, Transport, parse_address


def network(transport: str, host: str, port: int) -> NetworkAddress:
    return NetworkAddress(transport=Transport[transport], host=host, port=port)


BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0"
"""Names by path have colons of their own."""


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("udpin://0.0.0.0:14540", network("UDP_IN", "0.0.0.0", 14540)),  # noqa: S104
        ("udpin://127.0.0.2:14540", network("UDP_IN", "127.0.0.2", 14540)),
        ("udpout://192.168.1.10:14550", network("UDP_OUT", "192.168.1.10", 14550)),
        ("tcpout://autopilot-1.local:5760", network("TCP_OUT", "autopilot-1.local", 5760)),
        ("tcpin://127.0.0.1:1", network("TCP_IN", "127.0.0.1", 1)),
        ("TCPIN://localhost:65535", network("TCP_IN", "localhost", 65535)),
        ("udpin://[::]:14540", network("UDP_IN", "::", 14540)),
        ("udpout://[fe80::1%eth0]:14540", network("UDP_OUT", "fe80::1%eth0", 14540)),
        ("serial:///dev/ttyACM0:57600", SerialAddress(device="/dev/ttyACM0", baud=57_600)),
        ("serial:///dev/ttyS1:921600", SerialAddress(device="/dev/ttyS1", baud=921_600)),
        (f"serial://{BY_PATH}:115200", SerialAddress(device=BY_PATH, baud=115_200)),
    ],
)
def test_an_address_is_understood(text, address):
    assert parse_address(text) == address
    assert str(address) == text.replace("TCPIN", "tcpin")


WRONG = {
    "udpin://0.0.0.0:14540": ("udp://0.0.0.0:14540", "udpin:0.0.0.0:14540", "", "udpin://0.0.0.0"),
    "udpin://": ("udp://:14540",),
    "udpout://": ("udp://0.0.0.0:14540",),
    "tcpout://127.0.0.1:5760": ("tcp://127.0.0.1:5760",),
    "serial:///dev/ttyACM0:57600": (
        "/dev/ttyACM0",
        "serial:///dev/ttyACM0",
        "serial:///dev/ttyACM0:fast",
        "serial://ttyACM0:57600",
    ),
    "tcpout://HOST:5760": ("http://host:80", "tcpout://host"),
    "1200 to 12000000": ("serial:///dev/ttyACM0:5",),
    "write 0.0.0.0 to listen": ("udpin://:14540",),
    "name or number": ("udpout://:14540",),
    "1 to 65535": ("udpout://host:0", "udpout://host:65536"),
    "udpout://HOST:14540": ("udpout://host:-1", "udpout://host:\N{FULLWIDTH DIGIT ONE}4540"),
    "192.168.1.10": (
        "udpout://300.1.1.1:14540",
        "udpout://user@host:14540",
        "udpout://host/path:14540",
        "udpout:// host:14540",
        "udpout://-host:14540",
    ),
    "[fd00::10]": ("udpout://[fe80::zz]:14540", "udpout://fe80::1:14540"),
    "own address": (
        "udpout://0.0.0.0:14540",
        "udpout://255.255.255.255:14540",
        "tcpout://[ff02::1]:5760",
    ),
}


@pytest.mark.parametrize(
    ("text", "remedy"), [(text, remedy) for remedy, texts in WRONG.items() for text in texts]
)
def test_what_is_wrong_comes_with_what_would_be_right(text, remedy):
    with pytest.raises(InputError) as caught:
        parse_address(text)
    assert str(caught.value).startswith("MAVLink address ")
    assert remedy in str(caught.value)


def test_an_endless_address_is_not_repeated_in_full():
    with pytest.raises(InputError) as caught:
        parse_address("udp://" + "x" * 100_000)
    assert len(str(caught.value)) < 500


HOSTS = st.from_regex(r"[a-z][a-z0-9-]{0,20}[a-z0-9](\.[a-z]{1,10})?", fullmatch=True) | st.builds(
    str, st.ip_addresses().filter(lambda one: not (one.is_multicast or one.is_unspecified))
)
ADDRESSES = st.builds(
    NetworkAddress,
    transport=st.sampled_from(Transport),
    host=HOSTS.filter(lambda host: host != "255.255.255.255"),
    port=st.integers(1, 65_535),
) | st.builds(
    SerialAddress,
    device=st.from_regex(r"/dev/[A-Za-z0-9:/._-]{0,40}[A-Za-z0-9]", fullmatch=True),
    baud=st.integers(1_200, 12_000_000),
)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(address=ADDRESSES)
def test_an_address_is_read_back_as_it_is_written(address):
    assert parse_address(str(address)) == address


PIECES = st.sampled_from(["udpin", "udpout", "tcp", "serial", "host", "://", "::", *":/[]1%.\n"])


@settings(deadline=None, derandomize=True, max_examples=500)
@given(text=st.text(max_size=60) | st.lists(PIECES, max_size=12).map("".join))
@example(text="serial:///dev/tty\x1b[2J:57600")
@example(text="udpout://\ud800:1")
@example(text="udpout://[::1%\n]:1")
def test_any_text_is_an_address_or_one_line_of_advice(text):
    try:
        address = parse_address(text)
    except InputError as fault:
        line = str(fault)
        assert line.isprintable()
    else:
        assert parse_address(str(address)) == address
        assert str(address).isprintable()
