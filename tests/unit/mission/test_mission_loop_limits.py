"""How fast a loop may run, and how old a leader's state may be."""

import pytest

from tests.kit.missions import loaded, text_of
from vfguide.mission import Finding, Mission, MissionError, check_mission
from vfguide.mission.feasibility import effective_layer, mean_leader_age


def mission(*changes: tuple[str, str]) -> Mission:
    return loaded(text_of("line-calm", *changes)).mission


def about_the_link(*changes: tuple[str, str]) -> list[Finding]:
    found = check_mission(mission(*changes))
    return [one for one in found if one.field == "rehearsal.link_delay_s"]


@pytest.mark.parametrize("rate_hz", [2.0, 20.0, 100.0])
def test_a_loop_runs_at_two_to_a_hundred_hertz(rate_hz):
    assert mission(("rate_hz: 20", f"rate_hz: {rate_hz}")).rehearsal.rate_hz == rate_hz


@pytest.mark.parametrize(
    ("rate_hz", "fault"),
    [
        ("1.99", "1.99 is too small; choose 2 or more"),
        ("0", "0 is too small; choose 2 or more"),
        ("100.1", "100.1 is too large; choose 100 or less"),
    ],
)
def test_a_loop_runs_neither_slower_nor_faster(rate_hz, fault):
    with pytest.raises(MissionError, match=f"rehearsal.rate_hz: {fault}"):
        mission(("rate_hz: 20", f"rate_hz: {rate_hz}"))


@pytest.mark.parametrize("jitter_s", [0.0, 0.05, 0.1])
def test_jitter_goes_either_way_and_makes_no_state_older_on_average(jitter_s):
    jittery = mission(("rate_hz: 20", f"rate_hz: 20\n  link_jitter_s: {jitter_s}"))
    assert mean_leader_age(jittery) == pytest.approx(0.1)


def test_a_link_older_than_the_patience_with_it_is_an_error():
    (error,) = about_the_link(("link_delay_s: 0.1", "link_delay_s: 0.7"))
    assert error.severity == "error"
    assert "leader states are 0.7 s old on average" in error.message
    assert "patience.leader_s, 0.6 s, and none joins" in error.message
    assert error.remedy == "a link below 0.6 s, or a longer patience.leader_s"


def test_losses_age_a_link_beyond_patience_as_well():
    # 0.1 s and 0.05 . 0.92/0.08 = 0.575 s
    (error,) = about_the_link(("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.92"))
    assert error.severity == "error"
    # 0.1 s and 0.05 . 0.9/0.1 = 0.45 s
    assert about_the_link(("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.9")) == []


@pytest.mark.parametrize(("delay_s", "severities"), [(0.59, []), (1.5, ["warning"])])
def test_a_link_within_patience_is_no_error(delay_s, severities):
    patience = ("wind: {", "patience: {leader_s: 2}\nwind: {") if delay_s > 1.0 else ("", "")
    found = about_the_link(("link_delay_s: 0.1", f"link_delay_s: {delay_s}"), patience)
    assert [one.severity for one in found] == severities


@pytest.mark.parametrize(("period", "layer"), [(0.01, 0.525), (0.05, 0.525), (0.1, 1.05)])
def test_the_layer_before_take_off_is_the_one_in_flight(period, layer):
    usual = mission(("boundary_layer_factor: 4.8", "boundary_layer_factor: 3.5")).controller
    assert effective_layer(usual, period) == pytest.approx(layer)
