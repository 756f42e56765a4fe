import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.companion.distrust import NavigationHealth
from vfguide.mavlink.codec import REPORTS
from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport

Word = GpsReport | EstimatorReport | SensorsReport

ALL_GOOD = 0x33F
"""What ArduPlane 4.7 and PX4 1.18 send in flight; PX4 sends 0x3BF at rest."""


def gps(fix_type: int, h_acc: int = 300) -> mavlink.MAVLink_gps_raw_int_message:
    return mavlink.MAVLink_gps_raw_int_message(0, fix_type, 0, 0, 0, 121, 200, 0, 0, 10, 0, h_acc)


def ekf(flags: int) -> mavlink.MAVLink_ekf_status_report_message:
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.0, 0.0, 0.0, 0.0, 0.0)


def estimator(flags: int) -> mavlink.MAVLink_estimator_status_message:
    return mavlink.MAVLink_estimator_status_message(0, flags, *(0.1,) * 6, 0.3, 0.3)


def sensors(present: int, enabled: int, health: int) -> mavlink.MAVLink_sys_status_message:
    return mavlink.MAVLink_sys_status_message(
        present, enabled, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


def fault_of(message: mavlink.MAVLink_message, for_s: float = 2.0) -> str | None:
    """What is wrong after an autopilot has said this twice a second for a while."""
    health = NavigationHealth()
    report = REPORTS[message.get_msgId()](message)
    assert isinstance(report, GpsReport | EstimatorReport | SensorsReport)
    now = 0.0
    while now <= for_s:
        health.take(report, now)
        now += 0.5
    return health.fault(for_s)


@pytest.mark.parametrize(
    "message",
    [
        gps(3),
        gps(6, 0),
        ekf(ALL_GOOD),
        estimator(ALL_GOOD),
        estimator(0x3BF),
        # ArduPlane in software, before and after arming, and PX4.
        sensors(0x1361FC3F, 0x1261803F, 0x1331803F),
        sensors(0x1361FC3F, 0x1361FC3F, 0x1331FC3F),
        sensors(0x300C03F, 0x301C03F, 0x1320C83F),
        # A receiver that is not there does not fail.
        sensors(0, 0x20, 0),
    ],
)
def test_what_real_autopilots_send_in_good_health_is_good(message: mavlink.MAVLink_message) -> None:
    assert fault_of(message) is None


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (gps(1), "the GPS has no fix"),
        (gps(2), "the GPS has no fix"),
        (gps(3, 40_000), "the GPS is certain to 40 m only"),
        (ekf(ALL_GOOD & ~16), "the autopilot's estimator has no position"),
        (ekf(0x400), "the autopilot's estimator has no position"),
        (estimator(ALL_GOOD & ~2), "the autopilot's estimator has no velocity"),
        (sensors(0x20, 0x20, 0), "the autopilot says that its GPS fails"),
        (sensors(0x200000, 0x200000, 0), "the autopilot says that its attitude estimate fails"),
    ],
)
def test_what_is_bad_for_a_second_is_told(message: mavlink.MAVLink_message, words: str) -> None:
    assert fault_of(message, 0.5) is None
    assert fault_of(message) == words


def test_what_is_not_said_any_more_is_unknown() -> None:
    health = NavigationHealth()
    for now in (0.0, 1.0, 2.0):
        health.take(GpsReport(fix_type=0, accuracy=None), now)
    assert health.fault(12.0) is not None
    assert health.fault(12.1) is None
