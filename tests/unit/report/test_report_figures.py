"""Figures of a flight against values worked out by hand."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.kit.records import still_flight, still_follower, still_leader, with_vehicle
from vfguide.lab.report.figures import (
    excess_variation_rate,
    least_separation,
    pair_separations,
    seen_from_leader,
    settling_time,
    slot_error,
    slot_track,
    spread,
    variation_rate,
)
from vfguide.lab.report.metrics import FollowerSummary, plain_json, summarise, summary_json
from vfguide.lab.report.wording import verdict
from vfguide.record.flight import FlightRecord, RecordAcceptance
from vfguide.record.latency import Latency, Percentiles, Promptness
from vfguide.record.vehicle import SLOT_SERIES, FlightLimits

ONE = np.array([0.0])
TIME = np.arange(11.0)
EASTBOUND = still_leader(ONE, course_rad=ONE + math.pi / 2.0)


@pytest.mark.parametrize(
    ("leader", "place"),
    [
        (still_leader(ONE), (-20.0, 20.0)),
        # Flying east, behind is west and right is south.
        (replace(EASTBOUND, north_m=ONE + 100.0), (80.0, -20.0)),
    ],
)
def test_a_slot_behind_and_to_the_right_of_the_leader_is_where_its_course_puts_it(leader, place):
    north, east = slot_track(leader, -20.0, 20.0)
    assert (north[0], east[0]) == pytest.approx(place)


def test_a_leader_that_is_shaken_moves_its_slots_but_not_those_of_the_formation_as_it_is_meant():
    # 0.1 rad off the path's course, 50 m ahead: the slot swings by 2 * 50 * sin(0.05) = 4.998 m.
    leader = still_leader(TIME, course_rad=np.full_like(TIME, 0.1))
    follower = still_follower(TIME, slot_forward_m=-50.0, north_m=np.full_like(TIME, -50.0))
    formation = summarise(still_flight(TIME, leader, follower)).formation
    assert formation.mean_error_m == pytest.approx(4.998, abs=1e-3)
    assert formation.intended_error_m == pytest.approx(0.0, abs=1e-9)


def test_error_is_positive_where_the_slot_is_ahead_and_to_the_right():
    """Leader eastbound, slot at north -20 and east -20, follower 3 m west and 4 m north of that."""
    slot = {"slot_forward_m": -20.0, "slot_right_m": 20.0}
    follower = still_follower(ONE, **slot, north_m=ONE - 16.0, east_m=ONE - 23.0)
    error = slot_error(EASTBOUND, follower)
    assert error.along_track_m[0] == pytest.approx(3.0)
    assert error.cross_track_m[0] == pytest.approx(4.0)
    assert error.distance_m[0] == pytest.approx(5.0)


@given(course=st.floats(-10, 10), forward=st.floats(-100, 100), right=st.floats(-100, 100))
def test_a_vehicle_in_its_slot_is_seen_there(course, forward, right):
    leader = still_leader(ONE, course_rad=ONE + course, north_m=ONE + 7.0)
    north, east = slot_track(leader, forward, right)
    seen = seen_from_leader(leader, still_follower(ONE, north_m=north, east_m=east))
    assert (seen[0][0], seen[1][0]) == pytest.approx((forward, right), abs=1e-9)


STAIRCASE_TIME = np.arange(6.0)
STAIRCASE = np.array([[30.0, 12.0, 8.0, 2.0, 0.5, 0.5], [30.0, 9.0, 9.0, 10.0, 0.9, 0.2]])


@pytest.mark.parametrize(
    ("limit", "settled"),
    [(10.0, 3.0), (1.0, 3.0), (31.0, 0.0), (9.5, 3.0), (0.9, 4.0), (0.4, None)],
)
def test_settling_is_the_last_time_any_follower_was_out(limit, settled):
    assert settling_time(STAIRCASE_TIME, STAIRCASE, limit) == settled


def test_an_error_that_is_not_known_counts_as_out():
    assert settling_time(np.arange(3.0), np.array([[0.0, math.nan, 0.0]]), 1.0) == 1.0


def test_spread_is_of_sizes():
    """95th percentile of 0 .. 20, the 19th of twenty steps."""
    found = spread(np.arange(-20.0, 1.0))
    assert found is not None
    assert (found.mean, found.p95, found.max) == pytest.approx((10.0, 19.0, 20.0))
    assert spread(np.array([])) is None
    assert spread(np.array([1.0, math.nan])) is None


TURNED = 0.1 * np.arange(200.0)


@pytest.mark.parametrize(
    ("angles", "total", "excess"),
    [
        pytest.param(np.radians([179.0, -179.0, 179.0]), *[math.radians(2.0)] * 2, id="past south"),
        # 0.1 rad/s for 200 s, three times round the compass.
        pytest.param(np.arctan2(np.sin(TURNED), np.cos(TURNED)), 0.1, 0.0, id="a steady turn"),
        pytest.param([0.0, 0.2, 0.0, 0.2, 0.0], 0.2, 0.2, id="chatter, without net turning"),
        pytest.param([math.nan, math.nan, 0.0, 0.3], 0.3, 0.0, id="not sent at first"),
        pytest.param([math.nan] * 4, None, None, id="never sent"),
    ],
)
def test_setpoints_vary_each_second_by_their_steps_and_in_excess_by_what_turns_back(
    angles, total, excess
):
    time_s = np.arange(float(len(angles)))
    found = (
        variation_rate(time_s, np.array(angles)),
        excess_variation_rate(time_s, np.array(angles)),
    )
    assert found == pytest.approx((total, excess), abs=1e-12)


@given(angles=arrays(np.float64, st.integers(2, 30), elements=st.floats(-50, 50)))
def test_excess_is_between_nothing_and_all_of_the_variation(angles):
    time_s = np.arange(float(angles.size))
    excess, total = excess_variation_rate(time_s, angles), variation_rate(time_s, angles)
    assert excess is not None
    assert total is not None
    assert 0.0 <= excess <= total


def test_separation_counts_height():
    """3 m north, 4 m east, 12 m up: 13 m."""
    above = still_follower(ONE, north_m=ONE + 3.0, east_m=ONE + 4.0, altitude_amsl_m=ONE + 600.0)
    (pair,) = pair_separations(still_flight(ONE, still_leader(ONE), above))
    assert (pair.first, pair.second) == ("leader", "f1")
    assert pair.distance_m[0] == pytest.approx(13.0)


def test_least_separation_is_over_all_pairs_and_times():
    assert least_separation([np.array([9.0, 7.0]), np.array([8.0, 30.0])]) == 7.0
    assert least_separation([]) is None
    assert least_separation([np.array([9.0, math.nan])]) is None


@pytest.fixture
def stepped_flight() -> FlightRecord:
    """Ten seconds; the slot is 20 m behind the leader, the follower 50, 12, 9, 4, 0.5 .. m behind it."""
    behind = np.array([50.0, 12.0, 9.0, 4.0, 0.5, 0.5, 0.4, 0.3, 0.2, 0.2, 0.2])
    leader = still_leader(TIME, path_cross_track_error_m=-0.1 * TIME)
    follower = still_follower(
        TIME, slot_forward_m=-20.0, north_m=-20.0 - behind, limited=TIME > 8.0
    )
    limits = RecordAcceptance(mean_error_m=0.3, settle_10m_s=1.0, min_separation_m=20.2)
    return still_flight(TIME, leader, follower, acceptance=limits)


def test_figures_of_a_stepped_approach(stepped_flight):
    """The window is 5 to 10 s: errors 0.5, 0.4, 0.3, 0.2, 0.2, 0.2, of mean 0.3."""
    summary = summarise(stepped_flight)
    formation = summary.formation
    assert formation.window_s == (5.0, 10.0)
    assert formation.mean_error_m == pytest.approx(0.3)
    assert formation.max_error_m == pytest.approx(0.5)
    assert (formation.settle_10m_s, formation.settle_1m_s) == (1.0, 3.0)
    assert formation.min_separation_m == pytest.approx(20.2)


def without_slot(since_s: float) -> dict[str, np.ndarray]:
    """Slots of a follower 20 m behind that is ordered out of the formation."""
    places = zip(SLOT_SERIES, (-20.0, 0.0, 0.0), strict=True)
    return {name: np.where(since_s <= TIME, math.nan, value) for name, value in places}


@pytest.mark.parametrize("mode", ["lockstep", "recorded"])
def test_who_was_ordered_out_of_the_formation_is_in_no_figure_of_errors(stepped_flight, mode):
    """It is 300 m away from 8 s on: of the window 0.5, 0.4 and 0.3 m are left, of mean 0.4."""
    north = np.where(TIME >= 8.0, -300.0, stepped_flight.followers[0].north_m)
    away = with_vehicle(stepped_flight, "f1", north_m=north, **without_slot(8.0))
    summary = summarise(replace(away, mode=mode))
    formation, own = summary.formation, summary.vehicles["f1"]
    assert isinstance(own, FollowerSummary)
    assert own.formation_error_m is not None
    assert formation.mean_error_m == pytest.approx(0.4)
    assert formation.mean_error_3d_m == pytest.approx(0.4)
    assert formation.intended_error_m == pytest.approx(0.4)
    assert (formation.settle_10m_s, formation.settle_1m_s) == (1.0, 3.0)
    assert own.formation_error_m.max == pytest.approx(0.5)


def test_where_all_were_sent_away_before_the_window_there_is_nothing_to_measure(stepped_flight):
    formation = summarise(with_vehicle(stepped_flight, "f1", **without_slot(4.0))).formation
    assert formation.mean_error_m is None
    assert formation.intended_error_m is None


def test_a_leader_on_the_way_onto_another_path_swings_no_slot_as_it_is_meant():
    """From 8 s on the path is 100 m away and leads east: the slots behind it are where they were."""
    ordered = TIME >= 8.0
    leader = still_leader(
        TIME,
        path_course_rad=np.where(ordered, math.pi / 2, 0.0),
        path_cross_track_error_m=np.where(ordered, 100.0, 0.0),
    )
    follower = still_follower(TIME, slot_forward_m=-50.0, north_m=np.full_like(TIME, -51.0))
    formation = summarise(still_flight(TIME, leader, follower)).formation
    assert formation.mean_error_m == pytest.approx(1.0)
    assert formation.intended_error_m == pytest.approx(1.0)


def test_a_flight_that_was_stopped_is_not_accepted(stepped_flight):
    easy = replace(stepped_flight, acceptance=RecordAcceptance(mean_error_m=100.0))
    assert summarise(easy).accepted
    stopped = summarise(replace(easy, interrupted=True))
    assert not stopped.accepted
    assert stopped.rejections == ("stopped after 10.0 s, before its end",)


def test_only_a_live_flight_has_latencies(stepped_flight):
    assert "latency" not in summary_json(summarise(stepped_flight))
    quick = Promptness(response_ms=Percentiles(p50=0.3, p99=2.0, max=9.0), leader_age_ms=None)
    live = replace(stepped_flight, latency=Latency(vehicles={"leader": quick}))
    latency = summary_json(summarise(live))["latency"]
    assert latency["response_ms"] == {"p50": 0.3, "p99": 2.0, "max": 9.0}
    assert latency["vehicles"]["leader"]["leader_age_ms"] is None


FORMATION_FIGURES = [
    *("mean_error_m", "p95_error_m", "max_error_m", "mean_error_3d_m", "intended_error_m"),
    *("settle_10m_s", "settle_1m_s", "min_separation_m"),
]


def test_json_has_the_published_layout(stepped_flight):
    plain = summary_json(summarise(stepped_flight))
    assert plain["mission"] == "line-calm"
    assert (plain["controller"], plain["plant"], plain["wind"]) == ("slot", "heading-hold", "calm")
    assert (plain["mode"], plain["rate_hz"], plain["seed"]) == ("lockstep", 1.0, 1)
    assert (plain["duration_s"], plain["wall_s"], plain["real_time_factor"]) == (10.0, 0.5, 20.0)
    assert isinstance(plain["accepted"], bool)
    assert set(plain["formation"]) == {"window_s", *FORMATION_FIGURES}
    leader, follower = plain["vehicles"]["leader"], plain["vehicles"]["f1"]
    assert leader["role"] == "leader"
    assert leader["cross_track_error_m"] == pytest.approx({"mean": 0.75, "p95": 0.975, "max": 1.0})
    assert leader["course_setpoint_variation_rad_s"] == 0.0
    assert follower["role"] == "follower"
    assert follower["formation_error_m"]["max"] == pytest.approx(0.5)
    assert follower["along_track_error_m"]["mean"] == pytest.approx(0.3)
    assert follower["cross_track_error_m"]["max"] == 0.0
    assert follower["limited_fraction"] == pytest.approx(2 / 6)


def test_json_has_null_for_what_is_not_finite(stepped_flight):
    assert plain_json({"a": [1.0, math.inf], "b": (math.nan,)}) == {"a": [1.0, None], "b": [None]}
    broken = with_vehicle(stepped_flight, "leader", north_m=np.full_like(TIME, math.nan))
    plain = summary_json(summarise(replace(broken, wall_s=0.0)))
    json.dumps(plain, allow_nan=False)
    assert plain["formation"]["mean_error_m"] is None
    assert plain["real_time_factor"] is None
    assert not plain["accepted"]


def test_a_flight_at_its_limits_is_accepted(stepped_flight):
    generous = replace(stepped_flight.acceptance, mean_error_m=0.3001, min_separation_m=20.19)
    summary = summarise(replace(stepped_flight, acceptance=generous))
    assert (summary.accepted, summary.rejections) == (True, ())


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        ({"mean_error_m": 0.2}, "mean formation error 0.3 m is above 0.2 m"),
        ({"mean_error_m": 0.29999}, "mean formation error 0.3 m is above 0.29999 m"),
        ({"max_error_m": 0.4}, "greatest formation error 0.5 m is above 0.4 m"),
        ({"settle_10m_s": 0.5}, "all within 10 m of their slots only after 1 s, not 0.5 s"),
        ({"settle_1m_s": 2.0}, "all within 1 m of their slots only after 3 s, not 2 s"),
        (
            {"min_separation_m": 25.0},
            "two vehicles came within 20.2 m of each other, closer than 25 m",
        ),
    ],
)
def test_a_rejection_says_why(stepped_flight, limits, reason):
    summary = summarise(replace(stepped_flight, acceptance=RecordAcceptance(**limits)))
    assert not summary.accepted
    assert summary.rejections == (reason,)


def test_a_follower_out_at_the_end_is_never_accepted(stepped_flight):
    away = with_vehicle(stepped_flight, "f1", north_m=np.full_like(TIME, -60.0))
    summary = summarise(replace(away, acceptance=RecordAcceptance(settle_10m_s=1e9)))
    assert summary.rejections == (
        "a follower was still 10 m or more from its slot at the end",
        "f1 was 40 m from its slot in the last half",
    )


@pytest.mark.parametrize(
    ("acceptance", "away_m", "accepted"),
    [
        # Nothing is asked for but what is asked of every flight.
        (RecordAcceptance(), 9.0, None),
        (RecordAcceptance(min_separation_m=5.0), 9.0, None),
        (RecordAcceptance(), 30.0, False),
        (RecordAcceptance(min_separation_m=5.0, settle_1m_s=None), 30.0, False),
        # Who wants no more than that has said so.
        (RecordAcceptance(mean_error_m=40.0), 30.0, True),
        (RecordAcceptance(max_error_m=40.0), 30.0, True),
        (RecordAcceptance(mean_error_m=20.0), 30.0, False),
    ],
)
def test_a_flight_whose_followers_did_not_come_to_their_slots_is_not_accepted_by_any_mission(
    stepped_flight, acceptance, away_m, accepted
):
    away = with_vehicle(stepped_flight, "f1", north_m=np.full_like(TIME, -20.0 - away_m))
    summary = summarise(replace(away, acceptance=acceptance))
    assert summary.accepted == accepted
    assert (verdict(summary) == "Accepted") == (accepted is True)
    if accepted is False:
        assert summary.rejections[-1] == "f1 was 30 m from its slot in the last half"


@pytest.mark.parametrize(
    ("gone_s", "reasons"), [(3.0, ()), (8.0, ("f1 was 30 m from its slot in the last half",))]
)
def test_a_follower_that_was_ordered_out_is_not_asked_to_be_in_a_slot(
    stepped_flight, gone_s, reasons
):
    north = np.full_like(TIME, -50.0)
    away = with_vehicle(stepped_flight, "f1", north_m=north, **without_slot(gone_s))
    limits = RecordAcceptance(min_separation_m=0.0)
    assert summarise(replace(away, acceptance=limits)).rejections == reasons


LIMITS = FlightLimits(least_airspeed_m_s=12.0, greatest_airspeed_m_s=32.0, greatest_bank_deg=45.0)


def test_how_hard_a_vehicle_was_flown_is_counted_over_the_last_half(stepped_flight):
    """Six samples from 5 s on: bank 0, 4, 0, 4, 44.5, 45 degrees; speeds 20, 12, 32, 20, 20, 20 m/s."""
    banks = np.radians([0, 0, 0, 0, 0, 0.0, 4.0, 0.0, 4.0, 44.5, 45.0])
    speeds = np.array([12.0] * 5 + [20.0, 12.0, 32.0, 20.0, 20.0, 20.0])
    setpoints = {"bank_rad": banks, "airspeed_setpoint_m_s": speeds}
    flown = with_vehicle(stepped_flight, "f1", limits=LIMITS, **setpoints)
    own = summarise(flown).vehicles["f1"]
    steps_deg = (4.0, 4.0, 4.0, 40.5, 0.5)
    rms = math.radians(math.sqrt(sum(step**2 for step in steps_deg) / 5.0))
    assert own.roll_rate_rad_s == pytest.approx(rms)
    assert own.speed_setpoint_variation_m_s2 == pytest.approx((8.0 + 20.0 + 12.0) / 5.0)
    assert own.bank_limited_fraction == pytest.approx(2 / 6)
    assert own.speed_limited_fraction == pytest.approx(2 / 6)


def test_where_limits_or_setpoints_are_not_known_no_share_of_them_is_told(stepped_flight):
    unknown = np.full_like(TIME, math.nan)
    setpoints = {"bank_rad": unknown, "airspeed_setpoint_m_s": unknown}
    silent = with_vehicle(stepped_flight, "f1", limits=LIMITS, **setpoints)
    summary = summarise(silent)
    lead, own = summary.vehicles["leader"], summary.vehicles["f1"]
    assert (lead.bank_limited_fraction, lead.speed_limited_fraction) == (None, None)
    assert (own.bank_limited_fraction, own.speed_limited_fraction) == (None, None)
    assert own.roll_rate_rad_s is None
    # Ground speeds are what such a vehicle is told.
    ground = with_vehicle(silent, "f1", ground_speed_setpoint_m_s=20.0 + TIME)
    told = summarise(ground).vehicles["f1"]
    assert told.speed_setpoint_variation_m_s2 == pytest.approx(1.0)


def test_a_follower_that_nobody_saw_in_the_last_half_is_not_accepted_and_it_is_said_why(
    stepped_flight,
):
    gone = with_vehicle(stepped_flight, "f1", north_m=np.where(TIME < 4.0, -20.0, np.nan))
    summary = summarise(
        replace(gone, mode="recorded", acceptance=RecordAcceptance(max_error_m=9.0))
    )
    assert summary.accepted is False
    assert summary.rejections[-1] == (
        "f1 was not seen in its slot: no place of f1 is known in the last half"
    )


def test_a_lone_leader_has_no_formation_and_is_not_judged():
    plain = summary_json(summarise(still_flight(TIME)))
    assert plain["accepted"] is None
    nothing = dict.fromkeys(FORMATION_FIGURES)
    assert plain["formation"] == {"window_s": [5.0, 10.0], **nothing}


def test_a_flight_that_broke_at_once_is_not_accepted():
    none = np.array([])
    summary = summarise(still_flight(none, still_leader(none), still_follower(none)))
    assert not summary.accepted
    json.dumps(summary_json(summary), allow_nan=False)
