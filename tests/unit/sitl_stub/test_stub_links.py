"""Who an emulator says it is: component, type of vehicle, number of its hardware."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_stub.links import SCHEMES, Address, AddressError, parse_address
from sitl_stub.settings import Settings
from tests.kit.autopilot import new_station
from tests.kit.wire import command_long, of_type


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


FORM, NO_HOST = "write one like udpin://", "no host"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        *((text, FORM) for text in ("", "14540", "udpin://127.0.0.1", "udpin://127.0.0.1:")),
        *(
            (f"udpin://{rest}", FORM)
            for rest in ("127.0.0.1:1/path", "127.0.0.1:14540\n", "127.0.0.1:\u0661", "::1:14540")
        ),
        *(
            (f"udpin://{host}:14540", NO_HOST)
            for host in ("", "a..b", "a" * 64, "[127.0.0.1]", "host name")
        ),
        ("udp://127.0.0.1:14540", "use one of udpin, udpout, tcpin, tcpout"),
        ("serial://ttyACM0:57600", "use one of udpin"),
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


def test_it_says_its_type_and_number_and_speaks_as_its_component():
    station = new_station(component_id=2, vehicle_type=2, uid=77)
    said = station.advance(1.5)
    (beat, *_) = of_type(said, "HEARTBEAT")
    assert (beat.get_srcComponent(), beat.type) == (2, 2)
    answered = station.send(command_long(512, 148, system_id=7, component_id=2))
    (version,) = of_type(answered, "AUTOPILOT_VERSION")
    assert version.uid == 77


def test_numbers_of_a_fleet_count_up_and_none_stays_none():
    fleet = Settings.of({"system_id": 1, "mavlink": "udpout://h:1", "count": 2, "uid": 5})
    assert [fleet.config(index).uid for index in range(2)] == [5, 6]
    alone = Settings.of({"system_id": 1, "mavlink": "udpout://h:1"})
    assert (alone.config(1).uid, alone.config().component_id) == (0, 1)
    assert alone.config().vehicle_type == 1
