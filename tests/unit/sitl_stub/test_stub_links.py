import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_stub.links import SCHEMES, Address, AddressError, parse_address


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("udpin://192.168.1.2:14540", Address("udpin", "192.168.1.2", 14540)),
        ("udpout://companion_1.local:14550", Address("udpout", "companion_1.local", 14550)),
        ("tcpin://localhost:0", Address("tcpin", "localhost", 0)),
        ("tcpout://[::1]:5760", Address("tcpout", "::1", 5760)),
    ],
)
def test_an_address_is_read_and_written_alike(text, address):
    assert parse_address(text) == address
    assert str(address) == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "write one like udpin://"),
        ("14540", "write one like udpin://"),
        ("udpin://127.0.0.1", "write one like udpin://"),
        ("udpin://127.0.0.1:", "write one like udpin://"),
        ("udpin://127.0.0.1:1/path", "write one like udpin://"),
        ("udpin://127.0.0.1:14540\n", "write one like udpin://"),
        ("udpin://127.0.0.1:\u0661\u0662", "write one like udpin://"),
        ("udpin://::1:14540", "write one like udpin://"),
        ("udp://127.0.0.1:14540", "use one of udpin, udpout, tcpin, tcpout"),
        ("serial://ttyACM0:57600", "use one of udpin"),
        ("udpin://:14540", "no host"),
        ("udpin://a..b:14540", "no host"),
        ("udpin://" + "a" * 64 + ":14540", "no host"),
        ("udpin://[127.0.0.1]:14540", "no host"),
        ("udpin://host name:14540", "no host"),
        ("udpin://localhost:65536", "the highest is 65535"),
        ("udpout://localhost:0", "port 0"),
        ("x" * 10_000, "..."),
    ],
)
def test_a_wrong_address_is_refused_in_one_line_that_says_why(text, said):
    with pytest.raises(AddressError) as caught:
        parse_address(text)
    message = str(caught.value)
    assert said in message
    assert len(message.splitlines()) == 1
    assert len(message) < 500


near_misses = st.from_regex(r"(udp|tcp)(in|out)?:/?/?[\[\]a-z0-9.:%_-]*:?[0-9]*", fullmatch=True)


@given(st.text() | near_misses)
def test_any_text_is_an_address_or_refused_in_one_line(text):
    try:
        address = parse_address(text)
    except AddressError as error:
        refusal = str(error)
    else:
        refusal = ""
        assert address.scheme in SCHEMES
        assert 0 <= address.port <= 65_535
        assert parse_address(str(address)) == address
    assert len(refusal.splitlines()) <= 1


@given(st.sampled_from(SCHEMES), st.ip_addresses(), st.integers(1, 65_535))
def test_every_number_of_a_host_is_understood(scheme, number, port):
    host = f"[{number}]" if ":" in str(number) else str(number)
    address = parse_address(f"{scheme}://{host}:{port}")
    assert (address.scheme, address.host, address.port) == (scheme, str(number), port)
