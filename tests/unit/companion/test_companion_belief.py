"""What is believed of an aircraft that flies at 20 m/s, reported 20 times a second."""

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from vfguide.companion.belief import LIVES, NEXT, STAYED_S, Belief, Believed, Evidence, Life
from vfguide.companion.witnesses import HeightBelief, HeightWitnesses
from vfguide.guidance.navigation import ReportedMotion, reach_of
from vfguide.state import Airframe

REACH = reach_of(Airframe())
PERIOD_S = 0.05
BELIEVED, CARRIED, ADRIFT, REFUSED = "believed", "carried", "adrift", "refused"


def kind_of(one: Believed) -> str:
    """What became of a report."""
    if one.is_reported:
        return BELIEVED
    if not one.leads:
        return REFUSED
    return CARRIED if one.life is Life.COASTING else ADRIFT


def witnesses_of(one: Believed) -> str:
    """The life of what is believed, and whether place and velocity bear it."""
    return f"{one.life.value} {one.by_place:d}{one.by_velocity:d}"


def gate() -> Belief:
    return Belief(REACH, moved_s=STAYED_S)


def flying(
    time_s: float, north: float, velocity: tuple[float, float] = (20.0, 0.0)
) -> ReportedMotion:
    """Northbound at 20 m/s, if nothing is said."""
    return ReportedMotion(
        time_s=time_s, north=north, east=0.0, velocity_north=velocity[0], velocity_east=velocity[1]
    )


def straight(
    until_s: float, north: Callable[[float], float] = lambda _: 0.0
) -> Iterator[ReportedMotion]:
    """North at 20 m/s, with positions that are off by some metres at a time."""
    for step in range(round(until_s / PERIOD_S) + 1):
        time_s = step * PERIOD_S
        yield flying(time_s, 20.0 * time_s + north(time_s))


Judgements = list[tuple[float, Believed]]


def judged(motions: Iterable[ReportedMotion]) -> Judgements:
    one = gate()
    return [(motion.time_s, one.take(motion)) for motion in motions]


def believed(
    judgements: Judgements, from_s: float, to_s: float, of: Callable[[Believed], str] = kind_of
) -> set[str]:
    return {of(one) for time_s, one in judgements if from_s - 0.01 < time_s < to_s - 0.01}


def during(start_s: float, end_s: float, off: float) -> Callable[[float], float]:
    return lambda time_s: off if start_s - 0.01 < time_s < end_s - 0.01 else 0.0


def moved_at(judgements: Judgements) -> float:
    """When a new place is believed first."""
    return next(time_s for time_s, one in judgements if one.moved is not None)


@pytest.mark.parametrize(
    ("begin_s", "end_s", "off", "kinds", "true_s"),
    [
        # The true ones begin at 0.05 s, and agree with each other for 0.5 s before they are believed.
        (0.0, 0.05, 40.0, {(0.05, 0.5): REFUSED, (0.6, 30.0): BELIEVED}, 0.05),
        # A start far from the true place does not keep the true one out.
        (0.0, 3.0, 100_000.0, {(6.2, 30.0): BELIEVED}, 6.2),
        # Wrong for 3 s, and then right for the 2 s after which it is believed; the velocity carries over.
        (10.0, 13.0, 50.0, {(0, 10): BELIEVED, (10, 15): CARRIED, (15, 30): BELIEVED}, 0.0),
        # A single forged report costs one report.
        (10.0, 10.05, 50.0, {(0, 10): BELIEVED, (10, 10.05): CARRIED, (10.05, 30): BELIEVED}, 0.0),
    ],
)
def test_wrong_places_for_a_while_are_over_soon(begin_s, end_s, off, kinds, true_s):
    found = judged(straight(30.0, during(begin_s, end_s, off)))
    for span, kind in kinds.items():
        assert believed(found, *span) == {kind}
    assert all(abs(one.north - 20.0 * time_s) < 0.01 for time_s, one in found if time_s >= true_s)
    assert begin_s == 0.0 or all(one.moved is None for _, one in found)


def test_a_start_with_3_s_of_wrong_reports_is_over_after_as_long_of_true_ones():
    found = judged(straight(20.0, during(0.0, 3.0, -28.0)))
    first = moved_at(found)
    assert 5.8 < first < 6.2
    assert believed(found, first, 21.0) == {BELIEVED}


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
    assert moved_at(found) - 10.0 == pytest.approx(5000.0 / REACH.speed, abs=1.0)


def test_a_place_after_the_autopilot_had_none_is_believed_after_2_s():
    one, judgements = gate(), []
    for motion in straight(20.0, during(9.0, 99.0, 40.0)):
        fault = "the GPS has no fix" if 10.0 <= motion.time_s < 12.0 else None
        judgements.append((motion.time_s, one.take(motion, fault=fault)))
    assert believed(judgements, 9.0, 10.0) == {CARRIED}
    assert believed(judgements, 10.0, 12.0) == {REFUSED}
    assert believed(judgements, 14.2, 20.0) == {BELIEVED}
    assert BELIEVED not in believed(judgements, 12.0, 14.0)
    # Another step, of which the autopilot says nothing, is a step like any other.
    assert one.take(replace(motion, time_s=20.05, north=motion.north + 60.0)).reason is not None


@pytest.mark.parametrize(("gap_s", "doubted_s"), [(1.0, 2.0), (0.0, 15.0)])
def test_who_was_stopped_for_a_second_is_believed_2_s_later_and_not_after_a_mere_step_back(
    gap_s, doubted_s
):
    # From 10 s on it is 20 m behind.
    motions = straight(25.0, during(10.0, 99.0, -20.0))
    found = judged(one for one in motions if not 10.0 - gap_s < one.time_s < 10.0)
    assert BELIEVED not in believed(found, 10.0, 10.0 + doubted_s)
    assert believed(found, 10.1 + doubted_s, 25.0) <= {BELIEVED}


def test_frozen_positions_are_found_in_half_a_second_and_are_never_a_new_place():
    found = judged(straight(60.0, lambda time_s: -20.0 * max(time_s - 10.0, 0.0)))
    first = next(time_s for time_s, one in found if kind_of(one) != BELIEVED)
    assert 10.0 < first < 10.6
    assert BELIEVED not in believed(found, 11.0, 60.0)
    assert all(one.moved is None for _, one in found)


def test_what_is_no_number_is_refused_and_a_velocity_of_327_m_s():
    assert kind_of(gate().take(flying(0.0, math.nan))) == REFUSED
    one = gate()
    for motion in straight(10.0):
        one.take(motion)
    assert kind_of(one.take(flying(10.05, 201.0, (327.67, 0.0)))) == REFUSED
    assert kind_of(one.take(flying(10.1, 202.0))) == BELIEVED


def with_velocity(
    from_s: float, to_s: float, north: float, east: float
) -> Iterator[ReportedMotion]:
    """Straight flight whose reports have another velocity for a while."""
    for motion in straight(30.0):
        false = from_s - 0.01 < motion.time_s < to_s - 0.01
        yield (replace(motion, velocity_north=north, velocity_east=east) if false else motion)


@pytest.mark.parametrize("to_s", [99.0, 13.0])
@pytest.mark.parametrize(("north", "east"), [(0.0, 0.0), (0.0, 20.0), (-20.0, 0.0), (12.0, 0.0)])
def test_a_false_velocity_is_not_flown_by_and_forgotten_2_s_after_it_has_gone(north, east, to_s):
    # By 0.6 s an aircraft could have changed its velocity by 19 m/s; it would have left its course.
    found = judged(with_velocity(10.0, to_s, north, east))
    assert believed(found, 10.0, min(to_s + 2.0, 30.0)) == {REFUSED}
    assert believed(found, to_s + 2.1, 30.0) == ({BELIEVED} if to_s < 30.0 else set())
    assert all(one.moved is None for _, one in found)


def test_a_velocity_that_grows_false_is_not_carried_on_by():
    # 3 m/s each second: no step of the velocity, and none of the positions, which go on as they did.
    found = judged(
        replace(motion, velocity_east=min(max(motion.time_s - 10.0, 0.0) * 3.0, 15.0))
        for motion in straight(30.0)
    )
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


@pytest.mark.parametrize("begins_s", [8.0, 8.8, 9.5, 10.0, 11.0])
def test_a_turn_that_began_in_a_gap_is_believed_at_once(begins_s):
    # 45 degrees of bank at 20 m/s: 0.49 rad/s on a circle of 41 m, from 10 s on; the gap is of 2.5 s.
    rate, radius = 9.81 / 20.0, 20.0**2 / 9.81

    def turned(motion: ReportedMotion) -> ReportedMotion:
        angle = rate * max(motion.time_s - 10.0, 0.0)
        place = {"north": min(motion.north, 200.0) + radius * math.sin(angle)}
        place["east"] = radius * (1.0 - math.cos(angle))
        velocity = (20.0 * math.cos(angle), 20.0 * math.sin(angle))
        return replace(motion, **place, velocity_north=velocity[0], velocity_east=velocity[1])

    heard = (one for one in straight(30.0) if not begins_s < one.time_s < begins_s + 2.5)
    assert {kind_of(one) for _, one in judged(map(turned, heard))} == {BELIEVED}


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
        north = motion.north + away * math.cos(bearing) + random.gauss(0.0, noise)
        east = motion.east + away * math.sin(bearing) + random.gauss(0.0, noise)
        judgement = one.take(replace(motion, north=north, east=east))
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


def repeated(what: str, to_s: float, wind_rate: float) -> Judgements:
    """Judge reports in a turn of 0.13 rad/s, of which some are repeated to the digit from 10 s on.

    From then on the wind changes by `wind_rate`, m/s².
    """
    one, held, found = gate(), None, []
    for step in range(round(20.0 / PERIOD_S)):
        time_s = step * PERIOD_S
        angle, radius = 0.13 * time_s, 20.0 / 0.13
        velocity = (20.0 * math.cos(angle), 20.0 * math.sin(angle))
        true = replace(
            flying(time_s, radius * math.sin(angle), velocity), east=-radius * math.cos(angle)
        )
        if held is None or not 10.0 <= time_s < to_s:
            held = true
        motion = replace(held, time_s=time_s)
        if "place" not in what:
            motion = replace(motion, north=true.north, east=true.east)
        if "velocity" not in what:
            motion = replace(true, north=held.north, east=held.east)
        wind = 2.0 + wind_rate * max(time_s - 10.0, 0.0)
        found.append((time_s, one.take(motion, air=(velocity[0] - wind, velocity[1] - 3.0))))
    return found


@pytest.mark.parametrize(
    ("what", "to_s", "wind_rate", "lives"),
    [
        # Three reports alike; after them heading and airspeed lead, until the first that differs.
        ("place, velocity", 12.0, 0.0, {10.2: "coasting 00", 12.0: "trusted 11"}),
        # 2 m/s from some 1 m to 7 m: what is repeated for long is not steered by.
        (
            *("place, velocity", 16.0, 0.0),
            {10.2: "coasting 00", 12.5: None, 13.5: "doubted 00", 16.0: "trusted 11"},
        ),
        # In a wind that swings the silence ends with the first report that differs, too.
        ("place, velocity", 13.0, 2.0, {13.0: "trusted 11"}),
        # 1.33 m/s² of positions that leave it, of which three standard deviations may be noise: 1.2 m.
        ("velocity", 15.0, 0.0, {11.2: "coasting 10", 15.0: None, 17.1: "trusted 11"}),
        # A place alone is carried on by the velocity.
        ("place", 13.0, 0.0, {10.2: "coasting 01", 13.0: None, 15.1: "trusted 11"}),
    ],
)
def test_what_is_repeated_is_a_silence(what, to_s, wind_rate, lives):
    found = repeated(what, to_s, wind_rate)
    for (from_s, life), until_s in zip(lives.items(), [*lives, 20.0][1:], strict=True):
        assert life is None or believed(found, from_s, until_s, witnesses_of) == {life}


def test_without_the_air_motion_nothing_leads_through_a_silence():
    motions = list(straight(10.0))
    again = [replace(motions[-1], time_s=10.0 + step * PERIOD_S) for step in range(1, 5)]
    _, found = judged([*motions, *again])[-1]
    assert (found.life, found.leads) == (Life.DOUBTED, False)


def test_a_velocity_that_steps_is_outweighed_by_place_and_air():
    one = gate()
    for motion in with_velocity(10.0, 13.0, 12.0, 12.0):
        found = one.take(motion, air=AIR)
        if 10.0 <= motion.time_s < 13.0:
            assert witnesses_of(found) == "coasting 10"
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


def test_the_documentation_prints_the_table_of_lives():
    page = Path(__file__).parents[3] / "docs" / "belief.md"
    assert LIVES.strip() in page.read_text(encoding="utf-8")
