"""What is believed of an aircraft that flies at 20 m/s, reported 20 times a second."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.companion.belief import (
    LIVES,
    NEXT,
    STAYED_S,
    Belief,
    Believed,
    Evidence,
    HeightBelief,
    HeightWitnesses,
    Life,
    ReportedMotion,
    radius_limit,
    reach_of,
)
from vfguide.state import Airframe

REACH = reach_of(Airframe())
PERIOD_S = 0.05
BELIEVED, CARRIED, ADRIFT, REFUSED = "believed", "carried", "adrift", "refused"

Change = Callable[[ReportedMotion], ReportedMotion]


def kind_of(one: Believed) -> str:
    """What became of a report."""
    if one.is_reported:
        return BELIEVED
    if not one.leads:
        return REFUSED
    return CARRIED if one.life is Life.COASTING else ADRIFT


def gate() -> Belief:
    return Belief(REACH, moved_s=STAYED_S, most_m=radius_limit(28.0))


def straight(
    until_s: float, north: Callable[[float], float] = lambda _: 0.0
) -> Iterator[ReportedMotion]:
    """North at 20 m/s, with positions that are off by some metres at a time."""
    for step in range(round(until_s / PERIOD_S) + 1):
        time_s = step * PERIOD_S
        yield ReportedMotion(
            time_s=time_s,
            north=20.0 * time_s + north(time_s),
            east=0.0,
            velocity_north=20.0,
            velocity_east=0.0,
        )


def judged(motions: Iterator[ReportedMotion]) -> list[tuple[float, Believed]]:
    one = gate()
    return [(motion.time_s, one.take(motion)) for motion in motions]


def believed(judgements: list[tuple[float, Believed]], from_s: float, to_s: float) -> set[str]:
    return {kind_of(one) for time_s, one in judgements if from_s - 0.01 < time_s < to_s - 0.01}


def during(start_s: float, end_s: float, off: float) -> Callable[[float], float]:
    return lambda time_s: off if start_s - 0.01 < time_s < end_s - 0.01 else 0.0


def test_a_first_report_that_stands_alone_is_flown_by_for_one_period():
    found = judged(straight(3.0, during(0.0, 0.05, 40.0)))
    # The true ones begin at 0.05 s, and agree with each other for 0.4 s before they are believed.
    assert believed(found, 0.05, 0.4) == {REFUSED}
    assert believed(found, 0.5, 3.1) == {BELIEVED}
    assert all(abs(one.north - 20.0 * time_s) < 0.01 for time_s, one in found[1:])


def test_a_start_with_3_s_of_wrong_reports_is_over_after_as_long_of_true_ones():
    found = judged(straight(20.0, during(0.0, 3.0, -28.0)))
    first = next(time_s for time_s, one in found if one.moved is not None)
    assert 5.8 < first < 6.2
    assert believed(found, first, 21.0) == {BELIEVED}


def test_a_start_far_from_the_true_place_does_not_keep_the_true_one_out():
    found = judged(straight(20.0, during(0.0, 3.0, 100_000.0)))
    assert believed(found, 6.2, 21.0) == {BELIEVED}
    assert all(abs(one.north - 20.0 * time_s) < 0.01 for time_s, one in found if time_s > 6.2)


def test_a_step_of_50_m_for_3_s_is_carried_over_by_the_velocity():
    found = judged(straight(30.0, during(10.0, 13.0, 50.0)))
    assert believed(found, 0.0, 10.0) == {BELIEVED}
    # Wrong for 3 s, and then right for the 2 s after which it is believed.
    assert believed(found, 10.0, 15.0) == {CARRIED}
    assert believed(found, 15.0, 31.0) == {BELIEVED}
    assert all(abs(one.north - 20.0 * time_s) < 0.01 for time_s, one in found)
    assert all(one.moved is None for _, one in found)


def test_a_single_forged_report_costs_one_report():
    found = judged(straight(20.0, during(10.0, 10.05, 50.0)))
    assert [time_s for time_s, one in found if kind_of(one) != BELIEVED] == [10.0]


def test_a_step_that_stays_is_not_flown_by_before_half_a_minute():
    found = judged(straight(50.0, during(10.0, 99.0, 40.0)))
    # A quarter of 28 m is 7 m: at 0.5 m/s 14 s, less what the noise takes of it.
    assert believed(found, 10.0, 20.0) == {CARRIED}
    assert believed(found, 24.0, 40.0) == {ADRIFT}
    assert believed(found, 40.0, 51.0) == {BELIEVED}
    (moved,) = [one.moved for _, one in found if one.moved is not None]
    assert math.isclose(moved[0], 40.0, abs_tol=0.1)


def test_5_km_are_not_believed_before_an_aircraft_could_have_flown_them():
    found = judged(straight(90.0, during(10.0, 199.0, 5000.0)))
    # 88 m/s: 48 in a dive, and 40 of wind.
    first = next(time_s for time_s, one in found if one.moved is not None)
    assert 5000.0 / REACH.speed - 1.0 < first - 10.0 < 5000.0 / REACH.speed + 1.0


def test_a_place_after_the_autopilot_had_none_is_believed_after_2_s():
    one = gate()
    judgements = []
    for motion in straight(20.0, during(9.0, 99.0, 40.0)):
        fault = "the GPS has no fix" if 10.0 <= motion.time_s < 12.0 else None
        judgements.append((motion.time_s, one.take(motion, fault=fault)))
    assert believed(judgements, 9.0, 10.0) == {CARRIED}
    assert believed(judgements, 10.0, 12.0) == {REFUSED}
    assert believed(judgements, 14.2, 20.0) == {BELIEVED}
    assert BELIEVED not in believed(judgements, 12.0, 14.0)
    # Another step, of which the autopilot says nothing, is a step like any other.
    assert one.take(motion._replace(time_s=20.05, north=motion.north + 60.0)).reason is not None


def behind(gap_s: float) -> Iterator[ReportedMotion]:
    """North at 20 m/s, and from 10 s on 20 m behind, after a gap."""
    for motion in straight(25.0, during(10.0, 99.0, -20.0)):
        if not 10.0 - gap_s < motion.time_s < 10.0:
            yield motion


def test_who_was_stopped_for_a_second_is_believed_2_s_later_where_that_left_it():
    found = judged(behind(gap_s=1.0))
    assert BELIEVED not in believed(found, 10.0, 12.0)
    assert believed(found, 12.1, 25.0) == {BELIEVED}


def test_a_step_back_without_a_gap_is_a_step_like_any_other():
    found = judged(behind(gap_s=0.0))
    assert BELIEVED not in believed(found, 10.0, 25.0)


def test_positions_that_stay_where_they_are_are_never_a_new_place():
    found = judged(straight(60.0, lambda time_s: -20.0 * max(time_s - 10.0, 0.0)))
    assert BELIEVED not in believed(found, 11.0, 60.0)
    assert all(one.moved is None for _, one in found)


def test_frozen_positions_are_found_in_half_a_second():
    found = judged(straight(12.0, lambda time_s: min(0.0, 20.0 * (10.0 - time_s))))
    first = next(time_s for time_s, one in found if kind_of(one) != BELIEVED)
    assert 10.0 < first < 10.6


def test_a_velocity_of_327_m_s_is_refused():
    one = gate()
    motions = list(straight(20.0))
    for motion in motions[:200]:
        one.take(motion)
    wrong = ReportedMotion(
        time_s=10.0, north=200.0, east=0.0, velocity_north=327.67, velocity_east=0.0
    )
    assert kind_of(one.take(wrong)) == REFUSED
    assert kind_of(one.take(motions[201])) == BELIEVED


def with_velocity(
    from_s: float, to_s: float, north: float, east: float
) -> Iterator[ReportedMotion]:
    """Straight flight whose reports have another velocity for a while."""
    for motion in straight(30.0):
        false = from_s - 0.01 < motion.time_s < to_s - 0.01
        yield (motion._replace(velocity_north=north, velocity_east=east) if false else motion)


@pytest.mark.parametrize(("north", "east"), [(0.0, 0.0), (0.0, 20.0), (-20.0, 0.0), (12.0, 0.0)])
def test_a_false_velocity_is_not_flown_by_however_long_it_stays(north, east):
    # By 0.6 s an aircraft could have changed its velocity by 19 m/s; it would have left its course.
    found = judged(with_velocity(10.0, 99.0, north, east))
    assert believed(found, 10.0, 30.0) == {REFUSED}


def test_a_false_velocity_that_goes_is_forgotten_2_s_later():
    found = judged(with_velocity(10.0, 13.0, 0.0, 20.0))
    assert believed(found, 10.0, 15.0) == {REFUSED}
    assert believed(found, 15.1, 30.0) == {BELIEVED}
    assert all(one.moved is None for _, one in found)


def test_a_velocity_that_grows_false_is_not_carried_on_by():
    # 3 m/s each second: no step of the velocity, and none of the positions, which go on as they did.
    def drifting() -> Iterator[ReportedMotion]:
        for motion in straight(30.0):
            east = min(max(motion.time_s - 10.0, 0.0) * 3.0, 15.0)
            yield motion._replace(velocity_east=east)

    found = judged(drifting())
    assert CARRIED not in believed(found, 0.0, 30.0)
    first = next(time_s for time_s, one in found if kind_of(one) == REFUSED)
    assert first < 13.0
    assert believed(found, first, 30.0) == {REFUSED}


@pytest.mark.parametrize("gap_s", [1.3, 1.9, 2.5, 3.0])
def test_a_step_of_28_m_that_a_gap_hides_is_not_flown_by(gap_s):
    # A turn at 45 degrees of bank that begins within 3 s of silence ends 11 m off the straight course.
    motions = straight(30.0, during(10.0, 99.0, 28.0))
    found = judged(motion for motion in motions if not 10.0 - 0.01 < motion.time_s < 10.0 + gap_s)
    assert BELIEVED not in believed(found, 10.0, 30.0)


def test_a_turn_that_began_in_a_gap_is_believed_at_once():
    # 45 degrees of bank at 20 m/s: 0.49 rad/s on a circle of 41 m, from 10 s on.
    rate, gap_s = 9.81 / 20.0, 2.5

    def turning() -> Iterator[ReportedMotion]:
        for motion in straight(30.0):
            angle = rate * max(motion.time_s - 10.0, 0.0)
            yield motion._replace(
                north=200.0 + 20.0 / rate * math.sin(angle) if angle else motion.north,
                east=20.0 / rate * (1.0 - math.cos(angle)),
                velocity_north=20.0 * math.cos(angle),
                velocity_east=20.0 * math.sin(angle),
            )

    for begins_s in (8.0, 8.8, 9.5, 10.0, 11.0):
        ends_s = begins_s + gap_s
        heard = (one for one in turning() if not begins_s < one.time_s < ends_s)
        assert {kind_of(one) for _, one in judged(heard)} == {BELIEVED}


def test_what_is_no_number_is_refused():
    nowhere = ReportedMotion(
        time_s=0.0, north=math.nan, east=0.0, velocity_north=0.0, velocity_east=0.0
    )
    assert kind_of(gate().take(nowhere)) == REFUSED


def test_a_drag_of_4_m_s_is_found_and_one_of_half_a_metre_is_not():
    fast = judged(straight(60.0, lambda time_s: 4.0 * max(0.0, time_s - 10.0)))
    slow = judged(straight(60.0, lambda time_s: 0.5 * max(0.0, time_s - 10.0)))
    found = [time_s for time_s, one in fast if kind_of(one) != BELIEVED]
    assert 10.0 < found[0] < 15.0
    assert believed(slow, 0.0, 61.0) == {BELIEVED}


@given(
    off=st.floats(25.0, 1e7),
    bearing=st.floats(0.0, 6.28),
    at=st.integers(110, 200),
    length=st.integers(1, 590),
    noise=st.floats(0.0, 0.5),
)
@settings(max_examples=25, deadline=None)
def test_no_step_is_ever_flown_by(off, bearing, at, length, noise):
    """Up to half a minute long, and 25 m or more: what is gone by stays near the true place."""
    random, one = Random(at), gate()
    for step, motion in enumerate(straight(20.0)):
        away = off if at <= step < at + length else 0.0
        judgement = one.take(
            ReportedMotion(
                time_s=motion.time_s,
                north=motion.north + away * math.cos(bearing) + random.gauss(0.0, noise),
                east=motion.east + away * math.sin(bearing) + random.gauss(0.0, noise),
                velocity_north=motion.velocity_north,
                velocity_east=motion.velocity_east,
            )
        )
        if kind_of(judgement) in {BELIEVED, CARRIED}:
            apart = math.hypot(judgement.north - motion.north, judgement.east - motion.east)
            assert apart < 4.0


@given(seed=st.integers(0, 10**6), noise=st.floats(0.0, 0.6), lost=st.floats(0.0, 0.6))
@settings(max_examples=25, deadline=None)
def test_no_flight_of_an_aircraft_within_limits_is_doubted(seed, noise, lost):
    """Banks and speeds at random within the limits, in gusts; noise, velocity noise, lost reports."""
    random, one, airframe = Random(seed), gate(), Airframe()
    north = east = course = turn = 0.0
    speed, gust_north, gust_east = 20.0, 0.0, 0.0
    acceleration = 0.0
    for step in range(1200):
        if random.random() < 0.02:
            turn = random.uniform(-1.0, 1.0) * 9.81 * math.tan(airframe.max_bank) / speed
            acceleration = random.uniform(-1.0, 1.0) * airframe.max_acceleration
        course += turn * PERIOD_S
        speed = min(max(speed + acceleration * PERIOD_S, 12.0), 32.0)
        gust_north += 0.2 * (random.gauss(0.0, 1.5) - gust_north)
        gust_east += 0.2 * (random.gauss(0.0, 1.5) - gust_east)
        velocity_north = speed * math.cos(course) + gust_north
        velocity_east = speed * math.sin(course) + gust_east
        north, east = north + velocity_north * PERIOD_S, east + velocity_east * PERIOD_S
        if random.random() < lost:
            continue
        motion = ReportedMotion(
            time_s=step * PERIOD_S,
            north=north + random.gauss(0.0, noise),
            east=east + random.gauss(0.0, noise),
            velocity_north=velocity_north + random.gauss(0.0, 0.2),
            velocity_east=velocity_east + random.gauss(0.0, 0.2),
        )
        assert kind_of(one.take(motion)) == BELIEVED


AIR = (18.0, -3.0)
"""Through the air; the wind is (2, 3) m/s."""


def repeated(
    from_s: float, to_s: float, *, place: bool, velocity: bool, wind_rate: float = 0.0
) -> list[tuple[float, str]]:
    """What becomes of reports in a turn of 0.13 rad/s, of which some are repeated to the digit.

    From then on the wind changes by `wind_rate`, m/s².
    """
    one, held, kinds = gate(), None, []
    for step in range(round(20.0 / PERIOD_S)):
        time_s = step * PERIOD_S
        angle, radius = 0.13 * time_s, 20.0 / 0.13
        true = ReportedMotion(
            time_s=time_s,
            north=radius * math.sin(angle),
            east=-radius * math.cos(angle),
            velocity_north=20.0 * math.cos(angle),
            velocity_east=20.0 * math.sin(angle),
        )
        if held is None or not from_s <= time_s < to_s:
            held = true
        motion = true
        if place:
            motion = motion._replace(north=held.north, east=held.east)
        if velocity:
            motion = motion._replace(
                velocity_north=held.velocity_north, velocity_east=held.velocity_east
            )
        wind = 2.0 + wind_rate * max(time_s - from_s, 0.0)
        air = (true.velocity_north - wind, true.velocity_east - 3.0)
        found = one.take(motion, air=air)
        kinds.append((time_s, f"{found.life.value} {found.by_place:d}{found.by_velocity:d}"))
    return kinds


def between(kinds: list[tuple[float, str]], from_s: float, to_s: float) -> set[str]:
    return {kind for time_s, kind in kinds if from_s - 0.01 < time_s < to_s - 0.01}


def test_a_place_and_velocity_that_are_repeated_are_a_silence():
    kinds = repeated(10.0, 12.0, place=True, velocity=True)
    # Three reports alike; after them heading and airspeed lead, until the first that differs.
    assert between(kinds, 10.2, 12.0) == {"coasting 00"}
    assert between(kinds, 12.0, 20.0) == {"trusted 11"}


def test_what_is_repeated_for_long_is_not_steered_by():
    kinds = repeated(10.0, 16.0, place=True, velocity=True)
    # 2 m/s from some 1 m to 7 m.
    assert between(kinds, 10.2, 12.5) == {"coasting 00"}
    assert between(kinds, 13.5, 16.0) == {"doubted 00"}
    assert between(kinds, 16.0, 20.0) == {"trusted 11"}


def test_a_silence_in_a_wind_that_swings_ends_with_the_first_report_that_differs():
    kinds = repeated(10.0, 13.0, place=True, velocity=True, wind_rate=2.0)
    assert between(kinds, 13.0, 20.0) == {"trusted 11"}


def test_a_velocity_alone_that_is_repeated_in_a_turn_is_outweighed():
    kinds = repeated(10.0, 15.0, place=False, velocity=True)
    # 1.33 m/s² of positions that leave it, of which three standard deviations may be noise: 1.2 m.
    assert between(kinds, 11.2, 15.0) == {"coasting 10"}
    assert between(kinds, 17.1, 20.0) == {"trusted 11"}


def test_a_place_alone_that_is_repeated_is_carried_on_by_the_velocity():
    kinds = repeated(10.0, 13.0, place=True, velocity=False)
    assert between(kinds, 10.2, 13.0) == {"coasting 01"}
    assert between(kinds, 15.1, 20.0) == {"trusted 11"}


def test_without_the_air_motion_nothing_leads_through_a_silence():
    one = gate()
    for motion in straight(10.0):
        one.take(motion)
    last = motion
    for step in range(1, 5):
        found = one.take(last._replace(time_s=last.time_s + step * PERIOD_S))
    assert (found.life, found.leads) == (Life.DOUBTED, False)


def test_a_velocity_that_steps_is_outweighed_by_place_and_air():
    one = gate()
    for motion in with_velocity(10.0, 13.0, 12.0, 12.0):
        found = one.take(motion, air=AIR)
        if 10.0 <= motion.time_s < 13.0:
            assert (found.life, found.by_place, found.by_velocity) == (Life.COASTING, True, False)
        elif motion.time_s > 15.1:
            assert found.life is Life.TRUSTED


BESIDE = HeightWitnesses(planned=588.0, own=590.0, above=100.0)


@pytest.mark.parametrize("off_m", [-588.0, 47.0])
def test_a_first_altitude_that_no_other_witness_bears_out_is_doubted(off_m):
    heights = HeightBelief()
    assert math.isnan(heights.judge(588.0 + off_m, 0.0, beside=BESIDE))
    assert heights.doubted
    assert heights.judge(588.0, 1.0, beside=BESIDE) == 588.0
    assert not heights.doubted


@given(st.lists(st.sampled_from(Evidence), max_size=30))
def test_no_life_is_steered_by_after_a_contradiction_before_reports_have_agreed(findings):
    life, contradicted = Life.UNKNOWN, True
    for finding in findings:
        life = NEXT[life][finding]
        if finding in {Evidence.CONTRADICTED, Evidence.WORN}:
            contradicted = True
        elif finding in {Evidence.SETTLED, Evidence.MOVED} or life is Life.SETTLING:
            contradicted = False
        if contradicted:
            assert life in {Life.UNKNOWN, Life.DOUBTED}


def test_every_life_knows_what_follows_from_every_finding():
    assert set(NEXT) == set(Life)
    assert all(set(row) == set(Evidence) for row in NEXT.values())


def test_the_documentation_prints_the_table_of_lives():
    page = Path(__file__).parents[3] / "docs" / "belief.md"
    assert LIVES.strip() in page.read_text(encoding="utf-8")
