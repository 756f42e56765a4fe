import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.missions import ROOT
from vfguide.companion.supervisor import MODES, Control, Mode, ModeTimeouts, Situation, next_mode

WAITING, JOINING, TRACKING = Mode.WAITING, Mode.JOINING, Mode.TRACKING
PREDICTING, BREAKAWAY = Mode.PREDICTING, Mode.BREAKAWAY
LOST, PILOT = Mode.LOST, Mode.PILOT


def following(
    mode: Mode,
    *,
    control: Control = Control.GUIDED,
    telemetry_age: float = 0.05,
    leader_age: float = 0.1,
    distance: float = 50.0,
    steered: bool = True,
) -> Mode:
    """The mode after one call, joining unless said otherwise, with the timeouts that is built in."""
    situation = Situation(
        control=control,
        telemetry_age=telemetry_age,
        leader_age=leader_age,
        steered=steered,
        distance=distance,
    )
    return next_mode(mode, situation, ModeTimeouts())


UNHEARD = (math.inf, math.nan)


@pytest.mark.parametrize("before", Mode)
@pytest.mark.parametrize(
    ("situation", "after"),
    [
        # What the pilot has is the pilot's.
        *(
            ({"control": Control.PILOT, "telemetry_age": telemetry, "leader_age": age}, PILOT)
            for telemetry in (0.05, math.inf)
            for age in (0.1, 3.0, 40.0, 60.0, *UNHEARD)
        ),
        # What nobody gave is not steered.
        *(
            ({"control": control, "leader_age": age}, WAITING)
            for control in (Control.FREE, Control.DISARMED)
            for age in (0.1, 40.0, *UNHEARD)
        ),
        # Without telemetry it waits, and before the leader is heard.
        *(
            ({"telemetry_age": telemetry, "leader_age": age}, WAITING)
            for telemetry in (1.001, *UNHEARD)
            for age in (0.1, 10.0, 40.0, 60.0)
        ),
        *(({"leader_age": age}, WAITING) for age in UNHEARD),
        # Engaged and informed it joins; the clock of its leader may be a little ahead.
        ({}, JOINING),
        ({"telemetry_age": 1.0, "leader_age": 0.6}, JOINING),
        ({"leader_age": -0.2}, JOINING),
        # An unknown distance is not in place.
        *(({"distance": distance}, JOINING) for distance in UNHEARD),
        # An old leader state is predicted from, a leader that stays silent is left, and lost in the end.
        *(
            ({"leader_age": age, "distance": distance}, PREDICTING)
            for age in (0.601, 30.0)
            for distance in (0.0, 50.0, math.inf)
        ),
        *(({"leader_age": age, "distance": 0.0}, BREAKAWAY) for age in (30.001, 55.0)),
        *(({"leader_age": age, "distance": 0.0}, LOST) for age in (55.001, 1e9)),
        # What was never steered is not given back.
        *(({"leader_age": age, "steered": False}, WAITING) for age in (55.001, 1e9)),
    ],
)
def test_what_follows_from_a_situation_whatever_was_before(before, situation, after):
    assert following(before, **situation) is after


@pytest.mark.parametrize("before", Mode)
def test_where_nobody_knows_the_mode_nothing_is_steered_and_nothing_forgotten(before):
    after = before if before in {PILOT, LOST} else WAITING
    assert following(before, control=Control.UNKNOWN) is after


@pytest.mark.parametrize("telemetry_age", [0.05, math.inf])
@pytest.mark.parametrize(
    ("leader_age", "after"),
    [
        *((age, WAITING) for age in (-0.2, 0.1, 0.6)),
        *((age, LOST) for age in (0.601, 10.0, 1e9, *UNHEARD)),
    ],
)
def test_what_was_given_back_is_lost_until_the_leader_is_heard(telemetry_age, leader_age, after):
    found = following(
        LOST, control=Control.RETURNED, telemetry_age=telemetry_age, leader_age=leader_age
    )
    assert found is after


@pytest.mark.parametrize("before", [WAITING, JOINING, PREDICTING, BREAKAWAY, LOST, PILOT])
def test_within_ten_metres_it_has_arrived_and_only_beyond_twenty_it_has_strayed(before):
    assert following(before, distance=10.0) is TRACKING
    assert following(before, distance=10.001) is JOINING
    assert following(TRACKING, distance=10.001) is TRACKING
    assert following(TRACKING, distance=20.0) is TRACKING
    assert following(TRACKING, distance=20.001) is JOINING


def test_patience_is_what_decides():
    situation = Situation(
        control=Control.GUIDED, telemetry_age=2.0, leader_age=2.0, steered=True, distance=15.0
    )
    patient = ModeTimeouts(telemetry_s=3.0, leader_s=3.0, arrived_m=16.0)
    assert next_mode(JOINING, situation, patient) is TRACKING
    assert next_mode(JOINING, situation, ModeTimeouts(telemetry_s=3.0, leader_s=1.0)) is PREDICTING
    hasty = ModeTimeouts(telemetry_s=3.0, prediction_s=1.5, breakaway_s=0.5)
    assert next_mode(JOINING, situation, hasty) is BREAKAWAY
    at_once = ModeTimeouts(telemetry_s=3.0, prediction_s=1.9, breakaway_s=0.0)
    assert next_mode(JOINING, situation, at_once) is LOST
    assert next_mode(JOINING, situation, ModeTimeouts()) is WAITING


def test_setpoints_go_out_while_joining_tracking_predicting_and_breaking_away_only():
    assert {mode for mode in Mode if mode.steers} == {JOINING, TRACKING, PREDICTING, BREAKAWAY}


AGES = st.floats(-1.0, 100.0) | st.sampled_from([math.inf, math.nan])

SITUATIONS = st.builds(
    Situation,
    control=st.sampled_from(Control),
    telemetry_age=AGES,
    leader_age=AGES,
    steered=st.booleans(),
    distance=AGES,
)


@given(st.lists(SITUATIONS, min_size=1, max_size=30))
def test_whatever_happens_it_steers_only_where_the_autopilot_obeys_and_is_heard(situations):
    mode, timeouts = WAITING, ModeTimeouts()
    for situation in situations:
        mode = next_mode(mode, situation, timeouts)
        if mode.steers:
            assert situation.control is Control.GUIDED
            assert situation.telemetry_age <= timeouts.telemetry_s
            assert situation.leader_age <= timeouts.prediction_s + timeouts.breakaway_s
        if situation.control is Control.PILOT:
            assert mode is PILOT


def test_the_documentation_prints_the_table_of_modes():
    page = ROOT / "docs" / "architecture.md"
    assert MODES.strip() in page.read_text(encoding="utf-8")
