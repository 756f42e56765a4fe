import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import HEADING, SPEED, new_flight
from tests.kit.wire import packed
from vfguide.companion.alerts import Alerts
from vfguide.companion.own_vehicle import RadioRoom
from vfguide.companion.supervisor import Mode
from vfguide.mavlink.adapter import AutopilotSetpoint, SetpointStream, Vehicle
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.reports import RadioReport

SET_MESSAGE_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL

SIK = {"system_id": 51, "component_id": 68}
"""Names that SiK radios give themselves."""


def radio_status(free_percent: int) -> bytes:
    return packed(mavlink.MAVLink_radio_status_message(100, 100, free_percent, 10, 10, 0, 0), **SIK)


@pytest.mark.parametrize(
    ("percent", "reports"),
    [(35, [RadioReport(free=0.35)]), (0, [RadioReport(free=0.0)]), (255, [])],
)
def test_a_radio_of_any_name_tells_how_much_of_its_buffer_is_free(percent, reports):
    assert Codec(2, 1).decode(radio_status(percent)) == reports


def test_a_full_radio_is_not_filled_by_words_about_it():
    alerts = Alerts()
    room, said = RadioRoom(alerts), []
    for second in range(60):
        # Each report shows another share.
        room.note(RadioReport(free=0.49 - 0.001 * second), float(second))
        said += alerts.heard(float(second))
    assert len(said) == 2


def test_halved_setpoints_are_every_other_one_each_of_them_whole():
    vehicle = Vehicle(system_id=2, component_id=1, hold="heading-hold", lateral_acceleration=9.8)
    adapter = ArduPlane(vehicle)
    stream = SetpointStream(adapter)

    def sent(course: float, speed: float, now: float) -> int:
        here = {"altitude_amsl": 588.0, "latitude_deg": 47.0, "longitude_deg": 8.0}
        asked = adapter.fly(AutopilotSetpoint(course=course, speed=speed, **here))
        return len(stream.due(asked, now, halved=True))

    assert [sent(0.1 * step, 20.0 + step, 0.1 * step) for step in range(8)] == [2, 0] * 4
    # Whoever is asked more rarely than twice a second is told each time.
    assert [sent(1.0, 20.0, 5.0 + time_s) for time_s in range(3)] == [2, 2, 2]


def free_percent(now: float) -> int | None:
    """Free at first, then short, then full; then the radio says nothing any more."""
    return 100 if now < 20.0 else 40 if now < 30.0 else 10 if now < 45.0 else None


def test_a_full_radio_carries_what_steers_and_heartbeats_alone_and_the_pilot_hears_it():
    def said(now: float) -> bytes:
        percent = free_percent(now)
        return b"" if percent is None or now % 1.0 else radio_status(percent)

    flown = new_flight(forge=said, until_s=60.0)

    def between(what: int | str, begin_s: float, end_s: float) -> int:
        return sum(begin_s < time <= end_s for time in flown.times(what))

    # While it is free, short, full, and silent.
    windows = [(10.0, 20.0), (21.0, 30.0), (31.0, 45.0), (51.0, 60.0)]
    for begin_s, end_s in windows:
        assert between("HEARTBEAT", begin_s, end_s) == round(end_s - begin_s)
        assert between(HEADING, begin_s, end_s) + between(SPEED, begin_s, end_s) >= end_s - begin_s
    curves = [between("NAMED_VALUE_FLOAT", *one) > 0 for one in windows]
    assert curves == [True, False, False, True]
    assert [between("TIMESYNC", *one) > 0 for one in windows] == [True, True, False, True]
    told = flown.told("radio to the autopilot is behind")
    assert "40% of its buffer are free: setpoints at half their rate" in told[0]
    assert flown.mode is Mode.TRACKING


def test_a_full_radio_carries_no_requests_for_telemetry():
    """Without airspeeds and positions from 31 s on it asks once a second, but for the full radio."""
    flown = new_flight(
        forge=lambda now: b"" if now % 1.0 else radio_status(10 if now > 30.0 else 100),
        edit=lambda message, now: (
            message if now < 31.0 or message.get_type() == "HEARTBEAT" else None
        ),
        until_s=45.0,
    )
    assert flown.times(SET_MESSAGE_INTERVAL) != []
    assert flown.later(SET_MESSAGE_INTERVAL, 30.0) == []
    flown.run(53.0, forge=lambda _: b"")
    assert flown.later(SET_MESSAGE_INTERVAL, 45.0) != []
