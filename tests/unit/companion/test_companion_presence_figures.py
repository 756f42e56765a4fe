from collections import Counter

import pytest

from vfguide.companion.presence_figures import (
    Quantiles,
    figures_of_battery,
    latency_figures,
    refused_messages,
)
from vfguide.mavlink.reports import SensorsReport


def test_quantiles_are_of_the_newest_values_and_the_greatest_of_all():
    series = Quantiles(size=4)
    assert series.quantiles(0.5) == []
    for value in (9.0, 1.0, 2.0, 3.0, 4.0):
        series.add(value)
    # The 9 is gone from 1, 2, 3, 4: half of them are not above the third.
    assert series.quantiles(0.0, 0.5, 1.0) == [1.0, 3.0, 4.0]
    assert (series.greatest, series.last) == (9.0, 4.0)


def test_times_become_milliseconds_and_an_empty_series_its_greatest_alone():
    series = Quantiles()
    assert latency_figures("response_ms", series) == {"response_ms_max": 0.0}
    series.add(0.0012)
    assert latency_figures("response_ms", series) == pytest.approx(
        {f"response_ms_{name}": 1.2 for name in ("p50", "p99", "last", "max")}
    )


def test_refused_messages_are_counted_in_all_and_by_reason():
    counters = Counter({"refused: not signed": 2, "refused: f1's clock": 3, "heard": 7})
    assert refused_messages(counters) == {
        "refused": 5.0,
        "refused_not_signed": 2.0,
        "refused_f1s_clock": 3.0,
    }


def test_of_the_battery_is_told_what_the_autopilot_knows_and_no_more():
    assert figures_of_battery(None) == {}
    assert figures_of_battery(SensorsReport(gps=True, attitude=True)) == {}
    known = SensorsReport(gps=True, attitude=True, battery=0.87, battery_voltage=11.804)
    assert figures_of_battery(known) == {"battery_percent": 87.0, "battery_v": 11.8}
    volts = SensorsReport(gps=True, attitude=True, battery_voltage=11.8)
    assert figures_of_battery(volts) == {"battery_v": 11.8}
