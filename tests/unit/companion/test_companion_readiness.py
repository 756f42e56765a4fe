"""What a companion says before take-off: why no position is used, and which parameters speak against it."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import companion_of, new_flight
from tests.kit.wire import heartbeat, position_report, spoken
from vfguide.companion.supervisor import NOTHING_HEARD
from vfguide.link.presence import LONGEST_TEXT

HEARTBEAT = heartbeat(10, status=3, armed=False)
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
        one.receive_mavlink(spoken(HEARTBEAT, *said, place), now)
    assert one.obstacle(2.9) == why
    assert len(why) <= LONGEST_TEXT
    # Nothing comes any more, and what was said is old.
    assert one.obstacle(20.0) == NOTHING_HEARD


def test_what_the_estimator_says_counts_where_it_sends_no_position_at_all():
    one = companion_of(inspect=True)
    for tenth in range(30):
        one.receive_mavlink(spoken(HEARTBEAT, NO_POSITION), 0.1 * tenth)
    assert one.obstacle(2.9) == (
        "the autopilot's estimator has no position: wait, or see its ground station"
    )


def test_a_parameter_that_speaks_against_taking_off_is_found_until_it_is_mended():
    flown = new_flight()
    flown.companion = companion_of(inspect=True)
    flown.run(1.0)
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
