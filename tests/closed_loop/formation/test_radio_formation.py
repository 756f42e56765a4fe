"""Formations whose members share one emulated radio: 57600 baud, 4000 bytes a second in the air."""

import numpy as np
import pytest

from tests.kit.flight import Flight
from tests.kit.missions import content_of, mission_with
from vfguide.errors import InputError
from vfguide.lab.rehearsal.radio_flight import fly_by_radio
from vfguide.lab.studies.scale import fly_radio, radio_mission

RADIO = {"leader_hz": 10.0, "followers_hz": 2.5}


def test_twelve_aircraft_at_10_and_2_5_hz_fit_and_keep_their_slots():
    mission = radio_mission(12, 40.0, {"leader_hz": 10.0, "followers_hz": 2.5})
    leader = content_of(mission)["rehearsal"]["start"]["leader"]
    start = {"leader": leader, **{name: {} for name in mission.followers_by_name}}
    mission = mission_with(mission, rehearsal={"rate_hz": 10.0, "start": start})
    flown = fly_by_radio(mission)
    assert flown.air["bytes"] / 40.0 < 2100.0
    assert flown.air["in collisions"] == 0
    flight = Flight(flown.flight.record, flown.flight.events)
    # In so tight a crowd the last ones come past the others half a minute after take-over.
    errors = flight.errors(from_s=34.0)
    assert errors.mean() < 0.05
    assert errors.max() < 1.5
    assert flight.nearest() > 5.0


def test_a_radio_that_loses_a_tenth_and_has_bursts_costs_centimetres():
    figures = fly_radio((4, 44.0, {**RADIO, "loss": 0.1, "bursts": 0.05}))
    assert figures["refused: damaged on the air"] > 20
    assert figures["mean_m"] < 0.1


def test_a_flight_by_radio_is_the_same_each_time():
    mission = radio_mission(2, 20.0)
    first, second = (fly_by_radio(mission).flight.record for _ in range(2))
    for one, other in zip(first.vehicles, second.vehicles, strict=True):
        assert np.array_equal(one.north_m, other.north_m)
    assert first.vehicles[1].north_m.std() > 1.0


def test_what_does_not_fit_is_not_flown():
    with pytest.raises(InputError, match="do not fit"):
        fly_by_radio(radio_mission(12, 20.0, {"leader_hz": 20.0, "followers_hz": 10.0}))
