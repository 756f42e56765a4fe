from collections.abc import Callable

import pytest

from vfguide.companion.alerts import Alerts
from vfguide.companion.autopilot_clock import AutopilotClock, Reading


def read(clock: AutopilotClock, boot_time_s: float, now: float) -> Reading:
    """What a report says whose boot time has to be believed."""
    reading = clock.read(boot_time_s, now)
    assert reading is not None
    return reading


def time_of(clock: AutopilotClock, boot_time_s: float, now: float) -> float:
    return read(clock, boot_time_s, now).time_s


def ask(
    clock: AutopilotClock, autopilot: Callable[[float], float], now: float, way_s: float
) -> None:
    """One question, where one is due; there and back take the same time."""
    stamp = clock.ask(now - 2.0 * way_s)
    if stamp is not None:
        clock.answer(stamp, round(autopilot(now - way_s) * 1e9), now)


def test_a_report_is_true_when_it_is_read_at_first():
    assert time_of(AutopilotClock(), 3.0, 100.0) == 100.0


def test_the_report_that_travelled_fastest_sets_the_clock():
    clock = AutopilotClock()
    # Booted at 100; delays of 0.3, 0.1, 0.4 s.
    assert time_of(clock, 1.0, 101.3) == pytest.approx(101.3)
    assert time_of(clock, 2.0, 102.1) == pytest.approx(102.1)
    assert time_of(clock, 3.0, 103.4) == pytest.approx(103.1)
    assert time_of(clock, 4.0, 104.2) == pytest.approx(104.1)


def test_a_late_report_does_not_spoil_the_clock():
    clock = AutopilotClock()
    read(clock, 10.0, 110.0)
    assert time_of(clock, 9.5, 119.0) == pytest.approx(109.5)
    assert time_of(clock, 10.5, 119.1) == pytest.approx(110.5)


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drift_of_50_ppm_costs_less_than_three_milliseconds_in_an_hour(drift):
    clock = AutopilotClock()
    for step in range(3600 * 20):
        now = 500.0 + step / 20
        boot_time_s = (now - 480.0) * (1.0 + drift)
        # One report in seven travels at once, the others take up to 60 ms.
        reached = now + 0.01 * (step % 7)
        assert time_of(clock, boot_time_s, reached) == pytest.approx(now, abs=3.0e-3 + 1e-6)


def test_a_fast_report_is_remembered_for_one_to_two_windows():
    clock = AutopilotClock()
    assert time_of(clock, 0.0, 100.0) == 100.0
    # From now on every report takes 0.2 s longer.
    for step in range(1, 60 * 20):
        boot_time_s = step / 20
        assert time_of(clock, boot_time_s, boot_time_s + 100.2) == pytest.approx(
            boot_time_s + (100.0 if boot_time_s < 59.79 else 100.2)
        )


def test_a_link_that_becomes_slower_is_no_slip_where_the_autopilot_answers():
    alerts = Alerts()
    clock = AutopilotClock(alerts)
    for step in range(20 * 20):
        boot_time_s = step / 20
        way_s = 0.005 if step < 100 else 0.4
        now = boot_time_s + 100.0 + way_s
        ask(clock, lambda time_s: time_s - 100.0, now, way_s)
        assert time_of(clock, boot_time_s, now) == pytest.approx(boot_time_s + 100.0, abs=0.006)
    assert alerts.heard(now) == []


@pytest.mark.parametrize("lost_s", [0.05, 0.3, 5.0])
def test_a_slip_is_found_within_a_second(lost_s):
    """Reports go on every 50 ms after the clock has stood still, and take 5 ms."""
    alerts = Alerts()
    clock = AutopilotClock(alerts)

    def autopilot(time_s: float) -> float:
        return time_s - 100.0 - (lost_s if time_s >= 130.0 + lost_s else 0.0)

    for step in range(1200):
        made = 100.0 + step / 20
        if 130.0 <= made < 130.0 + lost_s:
            continue
        now = made + 0.005
        ask(clock, autopilot, now, 0.005)
        time_s = time_of(clock, autopilot(made), now)
        if made < 130.0 or made > 131.0 + lost_s:
            assert time_s == pytest.approx(made, abs=0.012)
    said = [one.text for one in alerts.heard(now)]
    assert len(said) == (lost_s >= 0.2)
    assert all(f"lost {lost_s:.1f} s" in text for text in said)


@pytest.mark.parametrize("rate", [0.96, 0.99, 1.02])
def test_a_clock_that_does_not_run_at_the_walls_rate_is_followed(rate):
    alerts = Alerts()
    clock = AutopilotClock(alerts)
    words = []
    for step in range(20 * 200):
        now = 100.0 + step / 20
        ask(clock, lambda time_s: (time_s - 50.0) * rate, now, 0.004)
        allowed_s = 0.045 if now < 112.0 else 0.01
        made = (now - 0.004 - 50.0) * rate
        assert time_of(clock, made, now) == pytest.approx(now, abs=allowed_s)
        words += [one.text for one in alerts.heard(now)]
    # Until its rate is known it looks like one that slips.
    assert len(words) <= 2
    assert {0.96: "4.2% slow", 0.99: "1.0% slow", 1.02: "2.0% fast"}[rate] in words[-1]


def test_a_clock_that_runs_slow_loses_no_more_time_once_that_is_known():
    """At 0.987 of the wall's rate slips of 10 ms would come every second."""
    clock = AutopilotClock()
    late = []
    for step in range(25 * 60):
        now = 100.0 + step / 25
        ask(clock, lambda time_s: (time_s - 50.0) * 0.987, now, 0.0005)
        late.append(now - time_of(clock, (now - 0.0005 - 50.0) * 0.987, now))
    assert max(late[25 * 5 : 25 * 8]) > 0.005
    assert max(late[25 * 15 :]) - min(late[25 * 15 :]) < 0.002


def test_a_link_that_becomes_slower_and_slower_is_no_slow_clock():
    clock = AutopilotClock()
    for step in range(20 * 30):
        way_s = 0.005 + 0.02 * step / 20
        now = 100.0 + step / 20 + way_s
        ask(clock, lambda time_s: time_s - 100.0, now, way_s)
        assert read(clock, step / 20, now).skew == 0.0


def test_the_rate_of_a_clock_that_has_slipped_is_not_taken_from_that():
    clock = AutopilotClock()
    for step in range(20 * 40):
        made = 100.0 + step / 20
        lost_s = 0.5 if made >= 120.0 else 0.0
        ask(clock, lambda time_s, lost_s=lost_s: time_s - 100.0 - lost_s, made + 0.002, 0.002)
        assert read(clock, made - 100.0 - lost_s, made + 0.002).skew == 0.0


def test_without_answers_a_slip_that_no_link_explains_is_found_within_a_second():
    clock = AutopilotClock()
    for step in range(1200):
        now = 100.0 + step / 20
        lost_s = 0.4 if now >= 130.0 else 0.0
        time_s = time_of(clock, now - 60.0 - lost_s, now)
        if not 130.0 <= now <= 131.0:
            assert time_s == pytest.approx(now, abs=1e-6)


def test_answers_that_nobody_asked_for_change_nothing():
    clock = AutopilotClock()
    for step in range(200):
        now = 100.0 + step / 20
        clock.answer(17, 1, now)
        stamp = clock.ask(now)
        if stamp is not None:
            clock.answer(stamp + 1, 1, now)
        assert time_of(clock, now - 60.0, now) == pytest.approx(now)


def test_a_boot_time_that_wraps_goes_on():
    clock = AutopilotClock()
    wrap_s = 2**32 * 1e-3
    before = read(clock, wrap_s - 0.03, 100.0)
    for step in range(1, 100):
        now = 100.0 + 0.05 * step
        ask(clock, lambda time_s: time_s + wrap_s - 100.03, now, 0.0)
        after = read(clock, round(0.05 * step - 0.03, 3) % wrap_s, now)
        assert not after.rebooted
        assert after.time_s == pytest.approx(now, abs=1e-3)
        assert after.boot_time_s - before.boot_time_s == pytest.approx(0.05, abs=1e-5)
        before = after


def rebooted(clock: AutopilotClock, boot_time_s: float, now: float) -> bool:
    reading = clock.read(boot_time_s, now)
    return reading is not None and reading.rebooted


def test_a_boot_time_that_falls_and_goes_on_from_there_for_a_second_is_a_reboot():
    clock = AutopilotClock()
    read(clock, 100.0, 200.0)
    assert [
        step for step in range(30) if rebooted(clock, 0.1 + 0.05 * step, 205.0 + 0.05 * step)
    ] == [20]


def test_a_slow_stream_shows_a_reboot_with_its_third_report():
    clock = AutopilotClock()
    read(clock, 100.0, 200.0)
    assert [rebooted(clock, 0.1 + step, 205.0 + step) for step in range(3)] == [False, False, True]


def test_reports_that_a_router_repeats_all_at_once_are_no_reboot():
    clock = AutopilotClock()
    read(clock, 100.0, 200.0)
    assert not any(rebooted(clock, 90.0 + 0.05 * number, 200.01) for number in range(100))


def test_old_reports_among_new_ones_are_no_reboot_and_not_believed():
    clock = AutopilotClock()
    for step in range(100):
        now = 200.0 + 0.05 * step
        assert time_of(clock, now - 100.0, now) == pytest.approx(now)
        assert clock.read(now - 105.0, now) is None


@pytest.mark.parametrize("apart_s", [0.0, 0.02, 0.05])
def test_eight_forged_reports_that_fall_are_no_reboot(apart_s):
    clock = AutopilotClock()
    read(clock, 100.0, 200.0)
    assert not any(
        clock.read(90.0 + 0.05 * number, 200.0 + apart_s * number) for number in range(8)
    )
    assert time_of(clock, 100.5, 200.5) == pytest.approx(200.5)


def test_a_forged_report_that_leaps_ahead_does_not_lock_the_autopilot_out():
    clock = AutopilotClock()
    read(clock, 100.0, 200.0)
    assert clock.read(5000.0, 200.02) is None
    assert time_of(clock, 100.05, 200.05) == pytest.approx(200.05)


def test_what_is_late_by_up_to_a_second_is_no_reboot():
    clock = AutopilotClock()
    read(clock, 100.0, 200.0)
    read(clock, 99.2, 200.1)
    assert not any(rebooted(clock, 99.0 + 0.05 * step, 200.2 + 0.05 * step) for step in range(100))


def test_the_first_boot_time_is_no_reboot():
    assert not rebooted(AutopilotClock(), 0.0, 100.0)
