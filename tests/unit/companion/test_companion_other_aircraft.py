"""Aircraft that are not of the formation: which reports count, for how long, and which are in the way."""

import cmath
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.states import FRAME, view
from vfguide.companion.other_aircraft import (
    MOST_AIRCRAFT,
    MOST_VERDICTS,
    STALE_S,
    NearbyAircraft,
    OtherAircraft,
)
from vfguide.companion.possibilities import Viewpoint
from vfguide.mavlink.reports import TrafficReport

HERE = view(10.0)


def report(north: float, east: float = 0.0, *, number: int = 1, **changes: object) -> TrafficReport:
    """An aircraft at this place, as high, that flies south at 30 m/s."""
    latitude, longitude = FRAME.to_geodetic(north, east)
    made = TrafficReport(
        icao_address=number,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl=588.0,
        velocity=(-30.0, 0.0),
        climb_rate=0.0,
        age_s=0.0,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def seen(
    *reports: TrafficReport,
    at_s: float = 10.0,
    here: Viewpoint = HERE,
    members: tuple[tuple[complex, complex], ...] = (),
    distance_m: float = 100.0,
) -> NearbyAircraft | None:
    aircraft = OtherAircraft(FRAME, distance_m=distance_m)
    for one in reports:
        aircraft.take(one, at_s)
    return aircraft.nearby(here, lambda: members)


def test_an_aircraft_is_carried_on_and_given_more_room_the_older_its_report():
    """Two seconds old when heard: at 400 - 2 x 30 m now, and 2 x 5 m more are kept."""
    found = seen(report(400.0, age_s=2.0))
    assert found.names == ("aircraft 000001",)
    assert found.others.tracks[0, 0] == pytest.approx(340 + 0j, abs=0.1)
    # After four steps of half a second.
    assert found.others.tracks[0, 4] == pytest.approx(280 + 0j, abs=0.1)
    assert found.others.keep[0] == pytest.approx(110.0)
    assert found.others.floor[0] == pytest.approx(100.0)


LATER = replace(HERE, time_s=10.0 + STALE_S)


@pytest.mark.parametrize(
    ("one", "here", "counts"),
    [
        *(
            (report(300.0, altitude_amsl=588.0 + up), HERE, up == 59.0)
            for up in (59.0, 61.0, -61.0)
        ),
        # 8 s at 2 m/s are 16 m: 75 m above may be 59 m; an unknown height may be any.
        (report(300.0, altitude_amsl=663.0, climb_rate=-2.0), HERE, True),
        (report(300.0, altitude_amsl=math.nan), HERE, True),
        # A report is forgotten when it is stale.
        (report(400.0), LATER, True),
        (report(400.0), replace(LATER, time_s=10.01 + STALE_S), False),
        # Who cannot come near within the horizon: 100 m, 40 m of doubt, 8 s of 20 and of 30 m/s: 540 m.
        (report(539.0), HERE, True),
        (report(541.0), HERE, False),
    ],
)
def test_an_aircraft_counts_where_it_may_come_near_in_place_and_height(one, here, counts):
    assert (seen(one, here=here) is not None) is counts


@pytest.mark.parametrize(("up_m", "in_the_way"), [(559.0, True), (561.0, False), (-561.0, False)])
def test_a_pressure_altitude_counts_with_what_it_may_be_off(up_m, in_the_way):
    """60 m of room and 500 m of error; which side to pass on it does not tell."""
    found = seen(report(300.0, altitude_amsl=588.0 + up_m, altitude_error=500.0))
    assert (found is not None) is in_the_way
    assert found is None or math.isnan(found.altitudes[0])


def test_members_that_appear_by_adsb_are_not_kept_clear_of_twice():
    """One 70 m from where it says it is, at its velocity; at another velocity it is a stranger."""
    member = (-40 + 20j, 20 + 0j)
    with_it = report(-40.0, 90.0, velocity=(19.0, 3.0))
    assert seen(with_it, members=(member,)) is None
    assert seen(with_it) is not None
    assert seen(report(-40.0, 90.0), members=(member,)) is not None
    # And so its own vehicle.
    assert seen(report(30.0, velocity=(20.0, 0.0))) is None


def in_the_way(
    aircraft: OtherAircraft, time_s: float, *reports: TrafficReport, here: Viewpoint = HERE
) -> bool:
    """Whether any aircraft is, after these reports."""
    for one in reports:
        aircraft.take(one, time_s)
    return aircraft.nearby(replace(here, time_s=time_s), tuple) is not None


@pytest.fixture
def aircraft() -> OtherAircraft:
    return OtherAircraft(FRAME, distance_m=100.0)


def test_a_stranger_that_overtakes_slowly_stays_one_however_near_it_comes(aircraft):
    """5 m/s faster, from 200 m behind to as much ahead: within 75 m for 30 s."""
    for second in range(80):
        one = report(-200.0 + 5.0 * second, velocity=(25.0, 0.0))
        assert in_the_way(aircraft, 10.0 + second, one)


def test_a_member_stays_one_where_a_report_is_off_and_while_it_is_not_heard(aircraft):
    own = report(10.0, velocity=(20.0, 0.0))
    off = report(200.0, velocity=(-20.0, 0.0))
    assert not in_the_way(aircraft, 10.0, own)
    assert not in_the_way(aircraft, 11.0, off)
    assert not in_the_way(aircraft, 70.0, off)
    # Not heard for longer, or nowhere near for longer than 60 s: judged anew.
    assert in_the_way(aircraft, 71.0, off)
    assert not in_the_way(aircraft, 140.0, own)


def test_a_member_whose_transponder_is_heard_before_its_states_is_one_after_a_minute(aircraft):
    beside = report(0.0, 100.0, velocity=(20.0, 0.0))
    assert in_the_way(aircraft, 10.0, beside)
    for time_s, stranger in ((11.0, True), (70.0, True), (70.5, False)):
        aircraft.take(beside, time_s)
        found = aircraft.nearby(replace(HERE, time_s=time_s), lambda: [(100j, 20 + 0j)])
        assert (found is not None) is stranger


@pytest.mark.parametrize("radius", [150.0, 250.0])
@pytest.mark.parametrize("age_s", [0.0, 2.0, 3.5, 5.0])
def test_the_own_transponder_is_a_member_on_a_circle_however_old_its_reports(
    aircraft, radius, age_s
):
    """At 20 m/s, reports once a second. On 150 m it turns by 38° in 5 s: 13 m/s."""
    for second in range(60):
        then = cmath.rect(1.0, 20.0 / radius * (second - age_s))
        turned = cmath.rect(1.0, 20.0 / radius * second)
        motion = {"velocity": (-20.0 * then.imag, 20.0 * then.real), "age_s": age_s}
        heard = report(radius * then.real, radius * then.imag, **motion)
        here = replace(HERE, place=radius * turned, velocity=20j * turned)
        assert not in_the_way(aircraft, 10.0 + second, heard, here=here)


def test_a_report_without_a_velocity_is_judged_by_place_until_one_comes(aircraft):
    """3 s old, from 60 m behind: where the own vehicle was."""
    own = report(-60.0, velocity=None, age_s=3.0)
    assert not in_the_way(aircraft, 10.0, own)
    assert seen(report(-60.0, 120.0, velocity=None, age_s=3.0)) is not None
    # It flies south: nobody of the formation.
    assert in_the_way(aircraft, 11.0, report(50.0))


def test_addresses_are_remembered_up_to_a_number_the_newest(aircraft):
    for number in range(500):
        in_the_way(aircraft, 10.0 + 0.1 * number, report(300.0 - 0.1 * number, number=number))
    assert len(aircraft._known) == MOST_AIRCRAFT  # noqa: SLF001
    assert set(aircraft._verdicts) == set(range(500 - MOST_VERDICTS, 500))  # noqa: SLF001


def test_reports_that_cannot_be_are_counted_and_not_used(aircraft):
    for one, time_s in (
        (report(400.0, velocity=(-351.0, 0.0)), 10.0),
        (report(60_000.0), 10.0),
        (report(400.0), 10.0),
        # A second later 350 m farther, and 300 m for what a report is off.
        (report(1060.0), 11.0),
    ):
        aircraft.take(one, time_s)
    reasons = ("too fast", "far away", "cannot have got there")
    assert aircraft.counters == {f"traffic: {reason}": 1 for reason in reasons}
    found = aircraft.nearby(replace(HERE, time_s=11.0), tuple)
    assert found.others.tracks[0, 0] == pytest.approx(370 + 0j, abs=0.1)


def test_an_aircraft_that_does_not_tell_its_velocity_has_that_between_its_reports(aircraft):
    for time_s in (8.0, 10.0):
        aircraft.take(report(500.0 - 25.0 * time_s, velocity=None), time_s)
    track = aircraft.nearby(HERE, tuple).others.tracks[0]
    assert track[2] - track[0] == pytest.approx(-25 + 0j, abs=0.1)


def test_of_too_many_the_nearest_are_kept_in_mind(aircraft):
    for number in range(100):
        aircraft.take(report(10_000.0 - number * 90.0, number=number), 10.0)
    assert set(aircraft._known) == set(range(100 - MOST_AIRCRAFT, 100))  # noqa: SLF001
    aircraft.take(report(20_000.0, number=200), 10.0)
    assert aircraft.counters["traffic: too many"] == 1


def test_with_a_distance_of_0_none_is_looked_at_nor_is_the_one_that_leads():
    assert seen(report(200.0), distance_m=0.0) is None
    followed = OtherAircraft(FRAME, distance_m=100.0, followed=1)
    followed.take(report(200.0), 10.0)
    assert followed.nearby(HERE, tuple) is None


@given(
    st.lists(
        st.builds(
            TrafficReport,
            icao_address=st.integers(0, 60),
            latitude_deg=st.floats(-90.0, 90.0) | st.just(47.397742),
            longitude_deg=st.floats(-180.0, 180.0) | st.just(8.545594),
            altitude_amsl=st.floats(-1000.0, 30_000.0) | st.just(math.nan),
            velocity=st.none() | st.tuples(st.floats(-1000.0, 1000.0), st.floats(-1000.0, 1000.0)),
            climb_rate=st.floats(-30.0, 30.0),
            age_s=st.floats(0.0, 5.0),
            altitude_error=st.sampled_from([0.0, 500.0]),
        ),
        max_size=80,
    )
)
def test_whatever_is_reported_what_comes_of_it_is_finite_and_bounded(reports):
    found = seen(*reports)
    if found is not None:
        assert len(found.names) <= MOST_AIRCRAFT
        assert bool(abs(found.others.tracks).max() < 1e6)
