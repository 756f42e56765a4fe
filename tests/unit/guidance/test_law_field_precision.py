"""What the article's wind leaves of a formation's precision, against numbers worked out by hand."""

import re
from pathlib import Path

import pytest

from vfguide.guidance.formation import Slot
from vfguide.laws.field_findings import (
    article_wind_rates,
    frame_error,
    integral_share,
    noise_error,
    predicted_mean_error,
    wind_left_over,
)
from vfguide.mission import Mission, parse_mission
from vfguide.mission.conditions import conditions_of
from vfguide.mission.controller import gains_of
from vfguide.mission.rehearsal import CalmWind

WINDY = (Path(__file__).parents[3] / "missions" / "line-wind.yaml").read_text()

# w = s e^(i a), s = 5 + 3 cos(0.1 t), a = 3 pi/4 + pi sin(0.1 t): the means of |w'|, |w''| and |w'''| over
# a period, w' = (s' + i s a') e^(i a) and so on
RATE, JERK, SNAP = 1.0490193, 0.3026650, 0.1031888


def mission(*controls: str, plant: str = "heading-hold") -> Mission:
    controller = ", ".join(["type: slot", "k_x: 0.25", "k_y: 0.25", *controls])
    text = re.sub(r"controller: \{[^}]*\}", f"controller: {{{controller}}}", WINDY)
    text = text.replace("max_bank_deg: 45}", f"max_bank_deg: 45, plant: {plant}}}")
    assert f"plant: {plant}" in text
    return parse_mission(text.encode(), file="m.yaml").mission


def test_the_articles_wind_changes_by_a_metre_per_second_each_second() -> None:
    assert article_wind_rates() == pytest.approx((RATE, JERK, SNAP), rel=5e-3)


@pytest.mark.parametrize(
    ("plant", "controls", "left"),
    [
        # everything is 0.05 s late; 0.6 s for the leader's rates, 0.35 s for the wind of a heading hold
        ("course-hold", [], 0.05 * JERK + 0.36 * SNAP),
        ("heading-hold", [], 0.1 * JERK + (0.36 + 3.0 * 0.1225) * SNAP),
        ("heading-hold", ["wind_feedforward: false"], 0.05 * JERK + 0.36 * SNAP + RATE),
        ("course-hold", ["wind_feedforward: false"], 0.05 * JERK + 0.36 * SNAP),
        ("heading-hold", ["rate_filter_s: 1.0", "wind_filter_s: 0.1"], 0.1 * JERK + 1.03 * SNAP),
        ("course-hold", ["rate_filter_s: 1.0", "wind_filter_s: 0.1"], 0.05 * JERK + SNAP),
    ],
)
def test_what_is_left_of_the_wind_is_what_the_feed_forward_gets_wrong(
    plant: str, controls: list[str], left: float
) -> None:
    found = wind_left_over(mission(*controls, plant=plant), "f1")
    assert found == pytest.approx(left, rel=5e-3)


def test_the_slots_turn_with_what_the_leader_does_not_know_of_its_course() -> None:
    # 0.35³ . 0.10319 = 0.0044243 m/s, 0.0031284 of it across; over 20 m/s, 40 m behind the leader
    windy = mission()
    assert frame_error(windy, Slot(forward=-40.0, right=0.0)) == pytest.approx(0.0062569, rel=1e-2)
    calm = windy.model_copy(update={"wind": CalmWind(type="calm")})
    assert frame_error(calm, Slot(forward=-40.0, right=0.0)) == 0.0


def test_what_is_left_of_the_wind_becomes_an_error_by_way_of_layer_and_field() -> None:
    # 0.7275 . 0.10319 + 0.1 . 0.30267 = 0.10534 m/s², 0.074484 each way; times 0.525/3: 0.013035 m/s and,
    # over 20, 0.00065173 rad; tan(2 . 0.00065173)/0.25 = 0.0052139 m, tan(pi/16 . 0.013035)/0.25 =
    # 0.010237 m; hypot 0.011489 m. And the slots, 28.284, 28.284 and 40 m from the leader:
    # 32.189 . 0.00015642 = 0.0050351 m.
    windy = mission("integral_s: 0")
    found = predicted_mean_error(
        windy, conditions_of(windy.path, windy.wind), gains_of(windy.controller)
    )
    assert found == pytest.approx(0.016524, rel=5e-3)


def test_the_integral_learns_two_thirds_of_an_error_that_swings_slowly() -> None:
    # w = 0.30267/1.04902 = 0.28852 rad/s. Across, s = 2.5 1/s, s/T = 2.08333:
    # 0.28852 hypot(0.28852, 2.5) = 0.72609 over hypot(2.08333 - 0.08325, 0.72131) = 2.12619 is 0.34150;
    # along, s = 1.27324, s/T = 1.06103: 0.37667 over hypot(0.97779, 0.36736) = 1.04452 is 0.36061.
    # hypot(0.0052139 . 0.34150, 0.010237 . 0.36061) + 0.0050351
    windy = mission("integral_s: 1.2")
    found = predicted_mean_error(
        windy, conditions_of(windy.path, windy.wind), gains_of(windy.controller)
    )
    assert found == pytest.approx(0.0091337, rel=1e-2)
    assert integral_share(2.5, 1.2, 0.28852) == pytest.approx(0.34150, rel=1e-3)


def test_an_integral_never_predicts_more_than_there_is_without_it() -> None:
    # near sqrt(s/T) = 1 rad/s it would be 1.4 times as much
    assert integral_share(1.0, 1.0, 1.0) == 1.0
    assert integral_share(1.0, 0.0, 1.0) == 1.0


def test_noise_of_positions_is_filtered_and_counts_twice() -> None:
    # g = 0.05/2.05, 0.3 sqrt(2 g/(2 - g)) = 0.047140 m on each axis, times sqrt(pi/2): 0.059082 m.
    # Flights of a minute on line-calm and circle-wind: 0.075 and 0.073 m.
    content = mission().model_dump(exclude_unset=True)
    content["rehearsal"]["position_noise_m"] = 0.3
    assert noise_error(Mission.model_validate(content)) == pytest.approx(0.059082, rel=1e-3)
    assert noise_error(mission()) == 0.0
