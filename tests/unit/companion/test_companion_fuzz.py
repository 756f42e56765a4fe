import math

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import companion_of
from tests.kit.missions import shipped
from tests.kit.wire import packed, parsed
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.link.codec import LeaderMessage, encode

HEARTBEATS = st.builds(
    mavlink.MAVLink_heartbeat_message,
    *(st.just(1), st.sampled_from([3, 8, 12]), st.just(129)),
    *(st.sampled_from([15, 15, 12, 6 << 16, 2**32 - 1]), st.just(4), st.just(3)),
)

AIRSPEEDS = st.builds(
    mavlink.MAVLink_vfr_hud_message,
    st.floats(width=32) | st.floats(0.0, 40.0, width=32),
    *(st.just(0.0), st.just(0), st.just(0), st.just(0.0), st.just(0.0)),
)

NEARBY = (
    st.integers(473_970_000, 473_980_000),
    st.integers(85_450_000, 85_460_000),
)
ANYWHERE = (st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))

POSITIONS = st.one_of(
    st.builds(
        mavlink.MAVLink_global_position_int_message,
        st.integers(0, 3000) | st.integers(0, 2**32 - 1),
        *place,
        *(st.integers(-(2**31), 2**31 - 1), st.just(0)),
        *(st.integers(-(2**15), 2**15 - 1), st.integers(-(2**15), 2**15 - 1), st.just(0)),
        st.integers(0, 65_535),
    )
    for place in (NEARBY, NEARBY, ANYWHERE)
)

TELEMETRY = st.lists(HEARTBEATS | AIRSPEEDS | POSITIONS, max_size=4)

STATES = st.builds(
    LeaderMessage,
    sequence=st.just(1),
    time_s=st.floats(allow_nan=False, allow_infinity=False) | st.floats(0.0, 10.0),
    latitude_deg=st.floats(-90.0, 90.0) | st.floats(47.39, 47.40),
    longitude_deg=st.floats(-180.0, 180.0) | st.floats(8.54, 8.55),
    altitude_amsl=st.just(588.0),
    course=st.floats(-10.0, 10.0),
    ground_speed=st.floats(-500.0, 500.0),
    acceleration=st.floats(-100.0, 100.0),
    turn_rate=st.floats(-10.0, 10.0),
    turn_acceleration=st.floats(-100.0, 100.0),
)

STEPS = st.lists(
    st.tuples(st.sampled_from([0.0, 0.001, 0.05, 0.05, 0.5, 3.0]), TELEMETRY, st.none() | STATES),
    min_size=1,
    max_size=12,
)

VARIANTS = st.tuples(
    st.sampled_from(["leader", "f1"]),
    st.sampled_from(["ardupilot", "px4"]),
    st.sampled_from(["heading-hold", "course-hold"]),
    st.sampled_from(["measured", "observer"]),
)
"""Vehicle, autopilot, what its loops hold, where the leader's law takes its ground speed from."""


def is_sound(message: MAVLink_message, limits: tuple[float, float]) -> bool:
    """Whether every number of a message is finite, and a commanded airspeed within the limits."""
    values = [getattr(message, name) for name in message.get_fieldnames()]
    if not all(math.isfinite(value) for value in values if isinstance(value, float)):
        return False
    changes_airspeed = getattr(message, "command", 0) in {178, 43_000} and message.param1 == 0.0
    return not changes_airspeed or limits[0] <= message.param2 <= limits[1]


@settings(deadline=None, derandomize=True, max_examples=250)
@given(variant=VARIANTS, steps=STEPS)
def test_whatever_arrives_a_companion_goes_on_and_sends_sound_messages(variant, steps):
    vehicle, kind, hold, speed_source = variant
    article = shipped("line-calm")
    declared = article.vehicles[vehicle].model_copy(update={"autopilot": kind, "plant": hold})
    chosen = article.controller.model_copy(update={"leader_speed_source": speed_source})
    changed = {"vehicles": {**article.vehicles, vehicle: declared}, "controller": chosen}
    known = flight_plan(article.model_copy(update=changed), vehicle)
    companion = Companion(known, adapter_of(declared), engage=True)
    limits = (known.airframe.airspeed_min, known.airframe.airspeed_max)
    now = 0.0
    for wait, telemetry, state in steps:
        now += wait
        if state is not None:
            companion.receive_link(encode(state), now)
        data = packed(*telemetry, system_id=known.system_id, component_id=1)
        out = companion.receive_mavlink(data, now)
        for message in parsed(out.to_autopilot):
            assert is_sound(message, limits)
        for published in out.to_link:
            assert len(published) == 104


@settings(deadline=None, derandomize=True, max_examples=100)
@given(
    datagrams=st.lists(st.binary(max_size=120), max_size=6), links=st.lists(st.binary(max_size=100))
)
def test_random_bytes_from_everywhere_are_borne(datagrams, links):
    companion = companion_of()
    for number, data in enumerate(datagrams):
        for state in links:
            companion.receive_link(state, number / 10)
        out = companion.receive_mavlink(data, number / 10)
        assert out.to_link == out.events == []
    assert companion.snapshot.setpoint is None
