"""Which autopilot answers, what its parameters are, and what is said of both before take-off."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import (
    KINDS,
    LOITER,
    SET_MODE,
    companion_of,
    emulator,
    leader_bytes,
    new_flight,
)
from tests.kit.wire import heartbeat, northbound, parsed, position_report, spoken
from vfguide.companion.supervisor import NOTHING_HEARD, Mode
from vfguide.link.presence import LONGEST_TEXT


@pytest.mark.parametrize("kind", KINDS)
def test_an_autopilot_that_is_found_out_is_flown_like_one_that_is_named(kind):
    flown = new_flight(kind="auto", autopilot=emulator(kind, 2), until_s=60.0)
    assert flown.mode_at(60.0) is Mode.TRACKING
    assert flown.autopilot_mode == "GUIDED"


@pytest.mark.parametrize(("named", "flies"), [("ardupilot", "px4"), ("px4", "ardupilot")])
def test_another_autopilot_than_the_missions_is_said_once_and_not_steered(named, flies):
    flown = new_flight(kind=named, autopilot=emulator(flies, 2), until_s=20.0)
    assert [text for _, text in flown.events if "the vehicle is" in text] == [flown.events[0][1]]
    assert flown.times(SET_MODE) == []
    assert {mode for _, mode in flown.modes} == {Mode.WAITING}


def test_a_vehicle_that_is_not_armed_is_not_engaged():
    companion = companion_of()
    sent: dict[bool, list[int]] = {True: [], False: []}
    told = []
    for step in range(200):
        now, armed = step / 20, step >= 100
        companion.receive_link(leader_bytes(now), now)
        data = spoken(heartbeat(LOITER, armed=armed), northbound(now))
        out = companion.receive_mavlink(data, now)
        told += [event.text for event in out.events]
        sent[armed] += [getattr(one, "command", 0) for one in parsed(out.to_autopilot)]
    assert SET_MODE not in sent[False]
    assert SET_MODE in sent[True]
    assert told.count("the vehicle is not armed: engaged once it flies; arm it when ready") == 1


def inspected(values: dict[str, float]) -> tuple[list[float], list[str]]:
    """When parameters are asked for, and what is said of those with these values."""
    companion = companion_of(engage=False, inspect=True)
    asked, told = [], []
    answers: list[Any] = []
    for step in range(200):
        now = step / 20
        out = companion.receive_mavlink(spoken(heartbeat(LOITER), northbound(now), *answers), now)
        told += [event.text for event in out.events if event.warning]
        requests = [
            one for one in parsed(out.to_autopilot) if one.get_type() == "PARAM_REQUEST_READ"
        ]
        asked += [now] * bool(requests)
        answers = [
            mavlink.MAVLink_param_value_message(
                one.param_id.encode(), values[one.param_id], 9, 100, 1
            )
            for one in requests
            if one.param_id in values
        ]
    return asked, told


def test_what_does_not_fit_the_flight_is_told_at_the_start():
    values = {"FS_GCS_ENABL": 0.0, "AIRSPEED_MIN": 9.0, "AIRSPEED_MAX": 22.0}
    asked, told = inspected(values)
    # Names that nobody answers for are asked four times, once a second.
    assert asked in ([1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0, 3.0])
    said = [text.split(" is ")[0] for text in told if " is " in text]
    assert said == ["FS_GCS_ENABL", "AIRSPEED_MAX"]


def test_an_autopilot_that_answers_for_nothing_is_told_of_once():
    _, told = inspected({})
    assert [text for text in told if "parameters" in text] == [
        "the autopilot tells no parameters: limits and fail-safe are not checked; check them by hand"
    ]


ON_THE_GROUND = heartbeat(10, status=3, armed=False)
NO_FIX = mavlink.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 65_535, 65_535, 0, 0, 0)
NO_POSITION = mavlink.MAVLink_ekf_status_report_message(0x400, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ((), "a position of 0, 0: see its GPS and its ground station"),
        ((NO_FIX,), "the GPS has no fix: wait, or see that its antenna has a clear sky"),
        (
            (NO_POSITION,),
            "the autopilot's estimator has no position: wait, or see its ground station",
        ),
    ],
)
def test_before_the_first_position_is_believed_it_says_why_none_is(said, why):
    one = companion_of(inspect=True)
    assert one.obstacle(0.0) == NOTHING_HEARD
    for tenth in range(30):
        now = 0.1 * tenth
        place = position_report(time_boot_ms=int(now * 1e3), lat=0, lon=0, alt=488_000)
        one.receive_mavlink(spoken(ON_THE_GROUND, *said, place), now)
    assert one.obstacle(2.9) == why
    assert len(why) <= LONGEST_TEXT
    # Nothing comes any more, and what was said is old.
    assert one.obstacle(20.0) == NOTHING_HEARD


def test_what_the_estimator_says_counts_where_it_sends_no_position_at_all():
    one = companion_of(inspect=True)
    for tenth in range(30):
        one.receive_mavlink(spoken(ON_THE_GROUND, NO_POSITION), 0.1 * tenth)
    assert one.obstacle(2.9) == (
        "the autopilot's estimator has no position: wait, or see its ground station"
    )


def test_a_parameter_that_speaks_against_taking_off_is_found_until_it_is_mended():
    flown = new_flight(companion=companion_of(inspect=True), until_s=1.0)
    assert flown.companion.findings == []
    flown.run(10.0)
    # The emulated one has ArduPlane's own defaults.
    (first,) = flown.companion.findings
    assert first.startswith("FS_GCS_ENABL is 0: should this companion fall silent")
    mended = [
        mavlink.MAVLink_param_value_message(name, value, 9, 1, 0)
        for name, value in ((b"FS_GCS_ENABL", 1.0), (b"MAV_GCS_SYSID", 2.0), (b"FS_LONG_ACTN", 1.0))
    ]
    flown.companion.receive_mavlink(spoken(*mended), 10.1)
    assert flown.companion.findings == []
