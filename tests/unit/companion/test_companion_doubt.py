"""What the pilot hears of reports that are not believed, and that a recovery is one."""

import math
from collections.abc import Iterable
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import GUIDED, leader_bytes, new_flight
from tests.kit.states import FRAME
from tests.kit.wire import heartbeat, spoken
from vfguide.companion.alerts import Alerts
from vfguide.companion.belief import STAYED_S, Belief, Believed, Life
from vfguide.companion.doubt import Doubt
from vfguide.companion.state_receiver import StateReceiver
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SAME_CLOCK
from vfguide.companion.witnesses import HeightBelief, OwnWord
from vfguide.guidance.navigation import reach_of
from vfguide.mavlink.codec import REPORTS
from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport
from vfguide.state import Airframe


def told(faults: Iterable[tuple[float, float]], until_s: float) -> list[tuple[float, str]]:
    """When what is said of a speed that is wrong in these spans, at ten reports a second."""
    alerts = Alerts()
    doubt, spans, words = Doubt(alerts), list(faults), []
    belief = Belief(reach_of(Airframe()), moved_s=STAYED_S)
    for step in range(round(until_s * 10)):
        now = step / 10
        wrong = any(begin <= now < end for begin, end in spans)
        right = Believed(Life.TRUSTED, 0.0, 0.0)
        refused = replace(right, life=Life.DOUBTED, by_place=False, leads=False, reason="a speed")
        doubt.note(refused if wrong else right, belief, now)
        words += [(now, one.text) for one in alerts.heard(now)]
    return words


def test_a_second_fault_that_lasts_is_told_soon_after_the_first():
    words = told([(20.0, 20.4), (24.0, 90.0)], 60.0)
    assert [time for time, _ in words] == [20.0, 20.4, 25.0]
    assert words[2][1].startswith("a speed: not steered")
    # Other words than the first time: texts that say the same are sent once in half a minute.
    assert words[2][1] != words[0][1]


def test_each_recovery_that_follows_a_fault_of_which_was_told_is_told():
    words = [word for _, word in told([(20.0, 21.0), (24.0, 26.0)], 60.0)]
    right = [word.startswith("position and velocity are right again") for word in words]
    assert right == [False, True] * 2
    assert len(set(words)) == 4


def test_a_fault_that_comes_and_goes_is_no_flood():
    words = told([(20.0 + 0.5 * k, 20.2 + 0.5 * k) for k in range(60)], 60.0)
    assert len(words) <= 8


def test_an_estimator_that_comes_back_is_steered_by_once():
    def without_a_position(message: MAVLink_message, now: float) -> MAVLink_message:
        if message.get_type() == "EKF_STATUS_REPORT" and 40.0 <= now < 45.0:
            message.flags = 1 | 2 | 4 | 32
        return message

    flown = new_flight(edit=without_a_position, until_s=52.0)
    assert flown.told("->", from_s=38.0) == ["tracking -> waiting", "waiting -> tracking"]
    (back,) = [time for time, text in flown.events if text == "waiting -> tracking"]
    assert 46.5 < back < 48.5
    texts = [text for time, text in flown.texts() if time > 38.0]
    assert sum("not steered until it has been right" in text for text in texts) == 1
    assert sum("are right again" in text for text in texts) == 1


def test_a_mode_that_the_autopilot_denies_is_not_called_the_pilots():
    flown = new_flight(until_s=15.0)
    flown.pilot("RTL", until_s=18.0)
    flown.run(24.0, forge=lambda _now: spoken(heartbeat(GUIDED)))
    assert flown.mode is Mode.PILOT
    # Texts have 2 s between them, and warnings come before this one.
    flown.run(30.0)
    later = [text for time, text in flown.texts() if time > 18.0]
    assert not any("GUIDED: the pilot flies" in text for text in later)
    assert any("the autopilot denies being in GUIDED" in text for text in later)


def judged(altitudes: list[float], interval_s: float = 1.0) -> list[bool]:
    """Which of these reports are believed."""
    gate = HeightBelief()
    return [
        not math.isnan(gate.judge(altitude, number * interval_s))
        for number, altitude in enumerate(altitudes)
    ]


@given(st.lists(st.floats(-14.9, 14.9), min_size=1, max_size=50))
def test_what_an_aircraft_can_climb_is_believed(rates):
    assert all(judged([*accumulate(rates, initial=588.0)]))


@given(st.floats(26.0, 1000.0), st.sampled_from([-1.0, 1.0]))
def test_a_step_is_doubted_at_once(step, side):
    assert judged([588.0, 588.0, 588.0 + side * step]) == [True, True, False]


@pytest.mark.parametrize(
    ("altitudes", "interval_s", "believed"),
    [
        # Steps that are small enough one by one do not add up: 12 m every tenth of a second; an aircraft
        # dives or climbs by 1.5 m. 10.5 m are left over, then 21.
        ([588.0] * 3 + [600.0, 612.0, 624.0, 636.0], 0.1, [True] * 3 + [False] * 4),
        # A climb at 10 m/s is believed for as long as it lasts.
        ([588.0 + number for number in range(300)], 0.1, [True] * 300),
        # Doubted at 2 s and 3 s; back at 4 s, agreed with itself at 6 s.
        ([588.0] * 2 + [688.0] * 2 + [588.0] * 4, *(1.0, [True] * 2 + [False] * 4 + [True] * 2)),
        # 10 m and 0.5 m/s reach 100 m at 180 s after the last believed report, at 1 s; for 2 s it has agreed.
        ([588.0] * 2 + [688.0] * 182, 1.0, [True] * 2 + [False] * 181 + [True]),
    ],
)
def test_an_altitude_that_steps_is_doubted_for_as_long_as_it_may_be_wrong(
    altitudes, interval_s, believed
):
    assert judged(altitudes, interval_s) == believed


@pytest.mark.parametrize("step", [100.0, -100.0])
def test_a_neighbour_whose_altitude_steps_has_none(alerts, step):
    receiver = StateReceiver(FRAME, SAME_CLOCK, alerts, whose="f2")
    for number in range(20):
        time_s, altitude = number / 5, 588.0 + (step if number >= 10 else 0.0)
        assert receiver.take(leader_bytes(time_s, altitude_amsl=altitude), time_s)
        assert math.isnan(receiver.newest.altitude_amsl) is (number >= 10)
    (said,) = alerts.heard(4.0)
    assert said.text.startswith("f2 reports an altitude that steps")


ALL_GOOD = 0x33F
"""What ArduPlane 4.7 and PX4 1.18 send in flight; PX4 sends 0x3BF at rest."""


def gps(fix_type: int, h_acc: int = 300) -> MAVLink_message:
    return mavlink.MAVLink_gps_raw_int_message(0, fix_type, 0, 0, 0, 121, 200, 0, 0, 10, 0, h_acc)


def ekf(flags: int) -> MAVLink_message:
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.0, 0.0, 0.0, 0.0, 0.0)


def estimator(flags: int) -> MAVLink_message:
    return mavlink.MAVLink_estimator_status_message(0, flags, *(0.1,) * 6, 0.3, 0.3)


def sensors(present: int, enabled: int, health: int) -> MAVLink_message:
    return mavlink.MAVLink_sys_status_message(present, enabled, health, *[0] * 10)


def fault_of(message: MAVLink_message, for_s: float = 2.0) -> str | None:
    """What is wrong after an autopilot has said this twice a second for a while."""
    health, report = OwnWord(), REPORTS[message.get_msgId()](message)
    assert isinstance(report, GpsReport | EstimatorReport | SensorsReport)
    for step in range(round(2.0 * for_s) + 1):
        health.take(report, step / 2.0)
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
def test_what_real_autopilots_send_in_good_health_is_good(message):
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
def test_what_is_bad_for_a_second_is_told(message, words):
    assert fault_of(message, 0.5) is None
    assert fault_of(message) == words


def test_what_is_not_said_any_more_is_unknown():
    health = OwnWord()
    for now in (0.0, 1.0, 2.0):
        health.take(GpsReport(fix_type=0, accuracy=None, altitude_amsl=0.0), now)
    assert health.fault(12.0) is not None
    assert health.fault(12.1) is None
