"""A connection that MAVSDK keeps, also one that goes wrong, and what it calls messages."""

import asyncio
import json
import math
from collections.abc import Callable, Iterator
from contextlib import AbstractAsyncContextManager, contextmanager
from dataclasses import dataclass, field
from random import Random
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mavsdk import MavsdkError
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import vfguide.mavlink.mavsdk
from tests.kit.autopilot import address, asked
from tests.kit.sockets import until
from tests.kit.wire import framed
from vfguide.errors import InputError
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.connection import open_connection
from vfguide.mavlink.mavsdk import (
    DEAF_S,
    HEARD,
    Plugins,
    direct_message,
    message_of,
    position_of,
    velocity_of,
    wanted_mode,
)
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import (
    AirspeedReport,
    AttitudeReport,
    CommandReport,
    HeartbeatReport,
    ParameterReport,
    TextReport,
    VersionReport,
)

OFFBOARD = 6 << 16


@dataclass(slots=True)
class Life:
    """One MAVSDK from its making to its end."""

    fails_at: str = ""
    error: Exception = field(default_factory=MavsdkError)
    hear: Callable[[Any, None], None] | None = None
    """Takes what the autopilot says."""

    def step(self, name: str) -> None:
        if name == self.fails_at:
            raise self.error

    def first_autopilot_async(self, _timeout_s: float, callback: Callable[[object], None]) -> int:
        self.step("search")
        callback(self)
        return 1

    def cancel_first_autopilot(self, _handle: int) -> None:
        pass

    def subscribe_message(self, _name: str, hear: Callable[[Any, None], None]) -> int:
        self.step("subscribe")
        self.hear = hear
        return 2

    def unsubscribe_message(self, _handle: int) -> None:
        self.hear = None

    def set_velocity_ned(self, _velocity: object) -> None:
        pass

    def is_active(self) -> bool:
        self.step("watch")
        return False

    def beat(self, custom_mode: int = OFFBOARD) -> None:
        """The autopilot's heartbeat."""
        fields = dict.fromkeys(mavlink.MAVLink_heartbeat_message.fieldnames, 0)
        said = json.dumps(fields | {"autopilot": 12, "custom_mode": custom_mode})
        assert self.hear is not None
        heard = SimpleNamespace(
            message_name="HEARTBEAT", fields_json=said, system_id=7, component_id=1
        )
        self.hear(heard, None)


Lives = Callable[..., list[Life]]


@pytest.fixture
def lives(monkeypatch: pytest.MonkeyPatch) -> Lives:
    """Lets MAVSDK live these lives, one after the other, then good ones; returns those begun."""

    def set_out(*planned: Life) -> list[Life]:
        begun: list[Life] = []

        @contextmanager
        def instance(_url: str) -> Iterator[tuple[Life, tuple[int, int]]]:
            life = planned[len(begun)] if len(begun) < len(planned) else Life()
            begun.append(life)
            life.step("open")
            yield life, (1, 195)

        def plugins_of(life: Life, own: tuple[int, int]) -> Plugins:
            life.step("plugins")
            return Plugins(direct=life, offboard=life, action=life, own=own)

        monkeypatch.setattr(vfguide.mavlink.mavsdk, "instance", instance)
        monkeypatch.setattr(vfguide.mavlink.mavsdk, "plugins_of", plugins_of)
        monkeypatch.setattr(vfguide.mavlink.mavsdk, "WATCH_S", 0.002)
        return begun

    return set_out


@pytest.fixture
def failures(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Failures in a row, as they are given to the backoff; nobody waits for it."""
    given: list[int] = []

    def retry_delay(failures: int, _share: float) -> float:
        given.append(failures)
        return 0.0

    monkeypatch.setattr(vfguide.mavlink.connection, "retry_delay", retry_delay)
    return given


def opened(receive: Callable[[bytes], None] = lambda _: None) -> AbstractAsyncContextManager[Any]:
    """A connection by MAVSDK."""
    port = parse_address("udpin://127.0.0.1:14540")
    return open_connection(port, receive, random=Random(1), by_mavsdk=True)


@pytest.mark.parametrize("fails_at", ["open", "search", "plugins", "subscribe"])
@pytest.mark.parametrize("error", [MavsdkError("x"), RuntimeError("x"), OSError(5, "x")])
async def test_a_mavsdk_that_fails_is_followed_by_another(lives, fails_at, error):
    begun = lives(Life(fails_at, error), Life())
    heard: list[bytes] = []
    async with opened(heard.append) as made:
        await until(lambda: made.connected)
        assert len(begun) == made.counters["tries"] == 2
        begun[1].beat()
        await until(lambda: heard)
    assert len(Codec(7, 1).decode(heard[0])) == 1


async def test_a_mavsdk_that_fails_in_flight_is_followed_by_another(lives, monkeypatch):
    monkeypatch.setattr(vfguide.mavlink.mavsdk, "SILENCE_S", 0.0)
    begun = lives(Life("watch", RuntimeError("has been destroyed")), Life())
    plane = Px4(address(component_id=1, px4_steering="velocity"))
    velocity = Codec(7, 1).encode(plane.stay_ready(asked(1.0, 20.0)))
    async with opened() as made:
        await until(lambda: made.connected)
        begun[0].beat(OFFBOARD)
        await asyncio.sleep(0)
        made.send(velocity)
        await until(lambda: len(begun) == 2 and made.connected)
        assert (made.counters["connected"], made.counters["disconnected"]) == (2, 1)
        begun[1].beat()


async def test_it_waits_as_every_connection_does_and_anew_after_each_success(
    lives, failures, monkeypatch
):
    monkeypatch.setattr(vfguide.mavlink.mavsdk, "DEAF_S", 0.0)
    # The third hears an autopilot for a moment.
    lives(Life("open"), Life("search"), Life(), Life("open"), Life("subscribe"))
    async with opened():
        await until(lambda: len(failures) >= 5)
    assert failures[:5] == [1, 2, 1, 2, 3]


async def test_a_mavsdk_that_hears_nothing_any_more_is_followed_by_another(lives, monkeypatch):
    looks, now = [0], [100.0]

    def monotonic() -> float:
        looks[0] += 1
        return now[0]

    monkeypatch.setattr(vfguide.mavlink.mavsdk, "time", SimpleNamespace(monotonic=monotonic))
    begun = lives(Life(), Life())

    async def look() -> None:
        seen = looks[0]
        await until(lambda: looks[0] >= seen + 10)

    async with opened() as made:
        await until(lambda: made.connected)
        now[0] += DEAF_S - 0.1
        begun[0].beat()
        await look()
        now[0] += DEAF_S - 0.1
        await look()
        assert len(begun) == 1
        assert made.connected
        now[0] += 0.2
        await until(lambda: len(begun) == 2)
        await until(lambda: made.connected)


async def test_an_address_that_will_not_do_is_told_before_anything_flies(lives):
    lives(Life("open", InputError("MAVLink address x: MAVSDK says CONNECTION_URL_INVALID")))

    with pytest.raises(InputError, match="CONNECTION_URL_INVALID"):
        async with opened():
            pytest.fail("it was opened")


async def test_an_address_that_was_good_is_tried_again(lives, failures, monkeypatch):
    monkeypatch.setattr(vfguide.mavlink.mavsdk, "DEAF_S", 0.0)
    taken = Life("open", InputError("MAVLink address x: MAVSDK says BIND_ERROR"))
    begun = lives(Life(), taken)
    async with opened():
        await until(lambda: len(begun) >= 3)
    assert failures[:2] == [1, 2]


VERSION = dict.fromkeys(
    ("flight_custom_version", "middleware_custom_version", "os_custom_version"), [0] * 8
) | {"flight_sw_version": 0x01120080, "uid2": [0] * 18}


POSITION = (
    '{"message_id":33,"message_name":"GLOBAL_POSITION_INT","alt":588000,"hdg":1497,"lat":473980997,'
    '"lon":85456638,"relative_alt":100000,"time_boot_ms":2000,"vx":1980,"vy":529,"vz":0}'
)


def frame_of(name: str, fields_json: str) -> bytes:
    return framed(message_of(name, fields_json))


def test_a_position_arrives_as_it_was_sent(codec):
    (report,) = codec.decode(frame_of("GLOBAL_POSITION_INT", POSITION))
    assert report.boot_time_s == 2.0
    assert report.latitude_deg == pytest.approx(47.3980997)
    assert (report.velocity_north, report.velocity_east) == (19.8, 5.29)


@pytest.mark.parametrize(
    ("name", "fields", "kind"),
    [
        ("HEARTBEAT", {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}, HeartbeatReport),
        ("COMMAND_ACK", {"command": 178, "result": 0, "result_param2": 0}, CommandReport),
        ("STATUSTEXT", {"severity": 4, "text": "low battery"}, TextReport),
        ("PARAM_VALUE", {"param_id": "FW_R_LIM", "param_value": 50.0}, ParameterReport),
        ("AUTOPILOT_VERSION", VERSION, VersionReport),
        ("VFR_HUD", {"airspeed": 20.5, "alt": 588.0, "climb": None}, AirspeedReport),
        ("ATTITUDE", {"roll": 0.4}, AttitudeReport),
    ],
)
def test_what_companions_listen_to_becomes_frames_again(name, fields, kind):
    codec = Codec(7, 1, hears_attitude=True)
    filled = dict.fromkeys(HEARD[name].fieldnames, 0) | fields
    (report,) = codec.decode(frame_of(name, json.dumps(filled)))
    assert isinstance(report, kind)


@given(name=st.sampled_from(sorted(HEARD)), text=st.text() | st.just('{"lat": "x"}'))
def test_what_is_no_message_is_none(name, text):
    assert message_of(name, text) is None


def test_a_setpoint_becomes_mavsdks_velocity_or_position_above_sea_level():
    setpoint, _ = Px4(address(px4_steering="velocity")).fly(asked(2.0, 20.0))
    velocity = velocity_of(setpoint)
    assert (velocity.north_m_s, velocity.east_m_s) == pytest.approx((-8.3229, 18.1859), abs=1e-4)
    assert velocity.down_m_s == 0.0
    assert velocity.yaw_deg == pytest.approx(114.5916, abs=1e-4)
    setpoint, _ = Px4(address(px4_steering="position")).fly(asked(0.0, 20.0))
    position = position_of(setpoint)
    # 1500 m north: the meridian's radius at 47 degrees is 6 369 700 m.
    assert position.lat_deg == pytest.approx(47.0 + math.degrees(1500.0 / 6_369_700.0), abs=1e-5)
    assert position.lon_deg == pytest.approx(8.0, abs=1e-7)
    assert (position.alt_m, position.altitude_type.name) == (588.0, "AMSL")


def test_modes_are_recognised_and_speeds_are_none():
    for steering, mode in (("guided-course", (4, 19)), ("position", (6, 0))):
        plane = Px4(address(px4_steering=steering))
        assert [wanted_mode(message) for message in plane.engage()] == [mode]
        assert [wanted_mode(message) for message in plane.hand_back()] == [(4, 3)]
    assert [wanted_mode(message) for message in plane.fly(asked(1.0, 20.0))] == [None, None]


def test_everything_else_goes_through_with_all_its_fields():
    _, speed = Px4(address()).fly(asked(1.0, 20.5))
    direct = direct_message(speed)
    fields = json.loads(direct.fields_json)
    assert direct.message_name == "COMMAND_LONG"
    assert (fields["command"], fields["param1"], fields["param2"]) == (178, 0, 20.5)
    assert (fields["target_system"], fields["target_component"]) == (7, 3)
