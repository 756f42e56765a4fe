"""Which mode follows from a situation, and who may be engaged again by an order."""

import math
from typing import Any
from unittest.mock import create_autospec

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import GUIDED, LOITER
from tests.kit.missions import ROOT, shipped
from vfguide.companion.alerts import Alerts
from vfguide.companion.authority import (
    NEXT_RIGHT,
    RIGHTS,
    EngageRule,
    ModeAuthority,
    Right,
    Sign,
    Wish,
)
from vfguide.companion.consent import FlightPhase, MemoryStore
from vfguide.companion.mission_plan import adapter_of
from vfguide.companion.supervisor import MODES, Control, Mode, ModeTimeouts, Situation, next_mode
from vfguide.mavlink.reports import HeartbeatReport

WAITING, JOINING, TRACKING = Mode.WAITING, Mode.JOINING, Mode.TRACKING
PREDICTING, BREAKAWAY = Mode.PREDICTING, Mode.BREAKAWAY
LOST, PILOT = Mode.LOST, Mode.PILOT


USUAL = {"control": Control.GUIDED, "telemetry_age": 0.05, "leader_age": 0.1, "distance": 50.0}


def following(mode: Mode, **changes: Any) -> Mode:
    """The mode after one call, joining unless said otherwise, with the timeouts that are built in."""
    situation = Situation(**(USUAL | {"steered": True} | changes))
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
    ages = {"telemetry_age": telemetry_age, "leader_age": leader_age}
    assert following(LOST, control=Control.RETURNED, **ages) is after


@pytest.mark.parametrize("before", [WAITING, JOINING, PREDICTING, BREAKAWAY, LOST, PILOT])
def test_within_ten_metres_it_has_arrived_and_only_beyond_twenty_it_has_strayed(before):
    assert following(before, distance=10.0) is TRACKING
    assert following(before, distance=10.001) is JOINING
    assert following(TRACKING, distance=10.001) is TRACKING
    assert following(TRACKING, distance=20.0) is TRACKING
    assert following(TRACKING, distance=20.001) is JOINING


@pytest.mark.parametrize(
    ("changes", "after"),
    [
        ({"telemetry_s": 3.0, "leader_s": 3.0, "arrived_m": 16.0}, TRACKING),
        ({"telemetry_s": 3.0, "leader_s": 1.0}, PREDICTING),
        ({"telemetry_s": 3.0, "prediction_s": 1.5, "breakaway_s": 0.5}, BREAKAWAY),
        ({"telemetry_s": 3.0, "prediction_s": 1.9, "breakaway_s": 0.0}, LOST),
        ({}, WAITING),
    ],
)
def test_patience_is_what_decides(changes, after):
    ages = {"telemetry_age": 2.0, "leader_age": 2.0}
    situation = Situation(control=Control.GUIDED, steered=True, distance=15.0, **ages)
    assert next_mode(JOINING, situation, ModeTimeouts(**changes)) is after


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


@given(st.lists(st.sampled_from(Sign), max_size=40))
def test_once_the_guided_mode_was_seen_only_an_order_or_a_new_flight_gives_the_right_back(signs):
    right, asked = Right.FREE, 0
    for sign in signs:
        before, right = right, NEXT_RIGHT[right][sign]
        if sign in {Sign.RENEWED, Sign.OVER}:
            assert right is Right.FREE
            asked = 0
            continue
        asked += right is Right.ASKING and before is not Right.ASKING
        assert asked <= 1
        assert (right is Right.FLOWN) is (Sign.GUIDED is sign or before is Right.FLOWN)
        if before is not Right.FREE:
            assert right is not Right.FREE


def test_while_the_guided_mode_is_asked_for_every_sign_of_the_pilot_ends_it():
    ends = {sign for sign in Sign if NEXT_RIGHT[Right.ASKING][sign] is Right.SPENT}
    assert ends == {Sign.FAILSAFE, Sign.ELSEWHERE, Sign.UNSEEN, Sign.UNHEARD, Sign.REBOOTED}


@pytest.mark.parametrize("table", [MODES, RIGHTS])
def test_the_documentation_prints_the_tables_of_states(table):
    page = ROOT / "docs" / "architecture.md"
    assert table.strip() in page.read_text(encoding="utf-8")


ACTIVE, CRITICAL = mavlink.MAV_STATE_ACTIVE, mavlink.MAV_STATE_CRITICAL


def in_the_air() -> FlightPhase:
    """A flight that goes on all the time."""
    flight = create_autospec(FlightPhase, instance=True, is_over=False)
    flight.hear.return_value = flight.is_on_ground.return_value = False
    flight.flies.return_value = True
    flight.obstacle.return_value = None
    return flight


class Vehicle:
    """Heartbeats of an autopilot, and what they are answered with."""

    def __init__(self) -> None:
        self.alerts = Alerts()
        self.authority = ModeAuthority(
            adapter_of(shipped("line-calm").vehicles["f1"]),
            EngageRule(allowed=True, modes=("LOITER",)),
            MemoryStore(),
            in_the_air(),
            self.alerts,
        )

    def beat(self, mode: int, now: float, wish: Wish = Wish.NONE, status: int = ACTIVE) -> bool:
        """Whether a heartbeat is answered with a mode command."""
        report = HeartbeatReport(autopilot=3, custom_mode=mode, armed=True, status=status)
        self.authority.note_life(now)
        self.authority.hear(report, now)
        return bool(self.authority.commands(wish, now, age_s=0.1))

    def engages(self, from_s: int) -> bool:
        """Whether an order back leads to a command within 6 s."""
        self.authority.renew()
        return any(self.beat(LOITER, float(from_s + s), Wish.STEER) for s in range(6))


@pytest.fixture
def left() -> Vehicle:
    """Steered for 6 s, and handed back into a loiter; the last heartbeat at 11 s."""
    vehicle = Vehicle()
    for now in range(6):
        vehicle.beat(GUIDED, float(now))
        vehicle.authority.note_steering()
    assert vehicle.beat(GUIDED, 6.0, Wish.RETURN)
    for now in range(7, 12):
        vehicle.beat(LOITER, float(now))
    assert vehicle.authority.control(11.0) is Control.RETURNED
    return vehicle


def test_a_vehicle_that_was_watched_all_the_time_is_engaged_again(left):
    assert left.engages(12)


def unheard(vehicle: Vehicle) -> None:
    """A minute without telemetry, in which a pilot may have flown and loitered again."""
    for now in range(72, 80):
        vehicle.beat(LOITER, float(now))


def rebooted(vehicle: Vehicle) -> None:
    vehicle.authority.rebooted()
    vehicle.beat(LOITER, 12.0)


def failing(vehicle: Vehicle) -> None:
    vehicle.beat(LOITER, 12.0, status=CRITICAL)


@pytest.mark.parametrize(("happens", "from_s"), [(unheard, 80), (rebooted, 13), (failing, 13)])
def test_a_vehicle_is_left_to_its_pilot_after_what_ends_the_right_to_engage_it(
    left, happens, from_s
):
    happens(left)
    assert not left.engages(from_s)
    assert left.authority.control(from_s + 5.0) is Control.PILOT
    said = [one.text for one in left.alerts.heard(from_s + 5.0)]
    assert any(text.startswith("ordered back into the formation: select GUIDED") for text in said)
