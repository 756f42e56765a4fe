"""What the article's wind leaves of a formation's precision, against numbers worked out by hand."""

from pathlib import Path

import pytest

from vfguide.mission import Mission, parse_mission
from vfguide.mission.conditions import conditions_of
from vfguide.mission.predicted_error import (
    article_wind_rates,
    integral_share,
    predicted_mean_error,
    wind_left_over,
)

WINDY = (Path(__file__).parents[3] / "missions" / "line-wind.yaml").read_text()

# w = s e^(i a), s = 5 + 3 cos(0.1 t), a = 3 pi/4 + pi sin(0.1 t): means of |s' + i s a'| and of
# |s'' + 2 i s' a' + i s a'' - s a'^2| over a period
RATE, JERK = 1.0490193, 0.3026650


def mission(*controls: str, plant: str = "heading-hold") -> Mission:
    text = WINDY.replace("epsilon: 0.01", ", ".join(["epsilon: 0.01", *controls]))
    if any("integral_s" in one for one in controls):
        text = text.replace("integral_s: 1.2, ", "", 1)
    text = text.replace("max_bank_deg: 45}", f"max_bank_deg: 45, plant: {plant}}}")
    assert f"plant: {plant}" in text
    return parse_mission(text.encode(), file="m.yaml").mission


def test_the_articles_wind_changes_by_a_metre_per_second_each_second() -> None:
    assert article_wind_rates() == pytest.approx((RATE, JERK), rel=5e-3)


@pytest.mark.parametrize(
    ("plant", "controls", "left"),
    [
        # the leader's rates lag by 0.4 + 0.05 s, a heading hold's wind by 0.2 + 0.05 s
        ("course-hold", [], 0.45 * JERK),
        ("heading-hold", [], 0.7 * JERK),
        ("heading-hold", ["wind_feedforward: false"], 0.45 * JERK + RATE),
        ("course-hold", ["wind_feedforward: false"], 0.45 * JERK),
        ("heading-hold", ["rate_filter_s: 1.0", "wind_filter_s: 0.1"], 1.2 * JERK),
        ("course-hold", ["rate_filter_s: 1.0", "wind_filter_s: 0.1"], 1.05 * JERK),
    ],
)
def test_what_is_left_of_the_wind_is_what_the_feed_forward_lags_behind(
    plant: str, controls: list[str], left: float
) -> None:
    found = wind_left_over(mission(*controls, plant=plant), "f1")
    assert found == pytest.approx(left, rel=5e-3)


def test_what_is_left_of_the_wind_becomes_an_error_by_way_of_layer_and_field() -> None:
    # 0.7 . 0.30267 = 0.21187 m/s², 0.14981 each way; times 0.525/3: 0.026217 m/s and, over 20, 0.0013108 rad;
    # tan(2 . 0.0013108)/0.25 = 0.010487 m, tan(pi/16 . 0.026217)/0.25 = 0.020591 m; hypot
    windy = mission("integral_s: 0")
    found = predicted_mean_error(windy, conditions_of(windy.path, windy.wind))
    assert found == pytest.approx(0.023107, rel=5e-3)


def test_the_integral_learns_two_thirds_of_an_error_that_swings_slowly() -> None:
    # w = 0.30267/1.04902 = 0.28852 rad/s. Across, s = 2.5 1/s, s/T = 2.08333:
    # 0.28852 hypot(0.28852, 2.5) = 0.72609 over hypot(2.08333 - 0.08325, 0.72131) = 2.12619 is 0.34150;
    # along, s = 1.27324, s/T = 1.06103: 0.37667 over hypot(0.97779, 0.36736) = 1.04452 is 0.36061.
    # hypot(0.010487 . 0.34150, 0.020591 . 0.36061)
    windy = mission()
    found = predicted_mean_error(windy, conditions_of(windy.path, windy.wind))
    assert found == pytest.approx(0.0082445, rel=1e-2)
    assert integral_share(2.5, 1.2, 0.28852) == pytest.approx(0.34150, rel=1e-3)


def test_an_integral_never_predicts_more_than_there_is_without_it() -> None:
    # near sqrt(s/T) = 1 rad/s it would be 1.4 times as much
    assert integral_share(1.0, 1.0, 1.0) == 1.0
    assert integral_share(1.0, 0.0, 1.0) == 1.0
