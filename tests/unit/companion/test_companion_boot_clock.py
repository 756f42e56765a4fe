import pytest

from vfguide.companion.boot_clock import BootClock


def test_a_report_is_true_when_it_is_read_at_first() -> None:
    assert BootClock().shared_time(3.0, 100.0) == 100.0


def test_the_report_that_travelled_fastest_sets_the_clock() -> None:
    clock = BootClock()
    # Booted at 100; delays of 0.3, 0.1, 0.4 s.
    assert clock.shared_time(1.0, 101.3) == pytest.approx(101.3)
    assert clock.shared_time(2.0, 102.1) == pytest.approx(102.1)
    assert clock.shared_time(3.0, 103.4) == pytest.approx(103.1)
    assert clock.shared_time(4.0, 104.2) == pytest.approx(104.1)


def test_a_late_report_does_not_spoil_the_clock() -> None:
    clock = BootClock()
    clock.shared_time(10.0, 110.0)
    assert clock.shared_time(9.5, 119.0) == pytest.approx(109.5)
    assert clock.shared_time(10.5, 110.7) == pytest.approx(110.5)


def test_a_boot_time_that_jumps_back_and_goes_on_from_there_is_a_reboot() -> None:
    clock = BootClock()
    clock.shared_time(100.0, 200.0)
    assert not clock.rebooted(0.1, 205.0)
    assert not clock.rebooted(0.2, 205.1)
    assert clock.rebooted(0.3, 205.2)


def test_a_slow_stream_shows_a_reboot_with_its_second_report() -> None:
    clock = BootClock()
    clock.shared_time(100.0, 200.0)
    assert not clock.rebooted(0.1, 205.0)
    assert clock.rebooted(0.6, 205.5)


def test_reports_that_a_router_repeats_all_at_once_are_no_reboot() -> None:
    clock = BootClock()
    clock.shared_time(100.0, 200.0)
    assert not any(clock.rebooted(90.0 + 0.05 * number, 200.01) for number in range(100))


def test_old_reports_among_new_ones_are_no_reboot() -> None:
    clock = BootClock()
    for step in range(100):
        now = 200.0 + 0.05 * step
        assert not clock.rebooted(now - 100.0, now)
        clock.shared_time(now - 100.0, now)
        assert not clock.rebooted(now - 105.0, now)


def test_what_is_late_by_up_to_a_second_is_no_reboot() -> None:
    clock = BootClock()
    clock.shared_time(100.0, 200.0)
    clock.shared_time(99.2, 200.1)
    assert not any(clock.rebooted(99.0 + 0.05 * step, 200.2 + 0.05 * step) for step in range(100))


def test_the_first_boot_time_is_no_reboot() -> None:
    assert not BootClock().rebooted(0.0, 100.0)


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drift_of_50_ppm_costs_less_than_three_milliseconds_in_an_hour(drift: float) -> None:
    clock = BootClock()
    for step in range(3600 * 20):
        now = 500.0 + step / 20
        boot_time_s = (now - 480.0) * (1.0 + drift)
        # One report in seven travels at once, the others take up to 60 ms.
        read = now + 0.01 * (step % 7)
        assert clock.shared_time(boot_time_s, read) == pytest.approx(now, abs=3.0e-3 + 1e-6)


def test_a_fast_report_is_remembered_for_one_to_two_windows() -> None:
    clock = BootClock()
    assert clock.shared_time(0.0, 100.0) == 100.0
    # From now on every report takes 0.5 s longer.
    for step in range(1, 60 * 20):
        boot_time_s = step / 20
        assert clock.shared_time(boot_time_s, boot_time_s + 100.5) == pytest.approx(
            boot_time_s + (100.0 if boot_time_s < 59.5 else 100.5)
        )


def test_after_a_reset_the_clock_is_learnt_anew() -> None:
    clock = BootClock()
    clock.shared_time(100.0, 200.0)
    clock.reset()
    assert not clock.rebooted(0.0, 249.0)
    assert clock.shared_time(1.0, 250.0) == 250.0
