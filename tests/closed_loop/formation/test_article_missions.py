"""The article's four cases, through MAVLink bytes, measured on the emulators' true states."""

import pytest

from tests.kit.flight import fly
from tests.kit.missions import content_of, in_place

# Mean formation error over the last half, m. The article claims 0.85, 2.31, 1.12 and 2.97.
REQUIRED = {"line-calm": 0.05, "line-wind": 0.15, "circle-calm": 0.05, "circle-wind": 0.25}

# What is flown, 0.006, 0.006, 0.003 and 0.007 m, and half as much again: any filter or gain is worth more.
USUAL = {"line-calm": 0.009, "line-wind": 0.009, "circle-calm": 0.0045, "circle-wind": 0.011}

EVERY_MISSION = pytest.mark.parametrize("name", REQUIRED)
EASIEST_AND_HARDEST = pytest.mark.parametrize("name", ["line-calm", "circle-wind"])

SHORT = {"duration_s": 44.0, "rate_hz": 10.0}
"""All are in place after 20 s, and the mean is of the last half; what is seen takes no fast loop."""

WHOLE_S = {"line-calm": 60.0, "line-wind": 126.0, "circle-calm": 100.0, "circle-wind": 126.0}
"""The last half has a round of the circle, 47 s, and a whole swing of the wind, 63 s, where there is one."""


@EVERY_MISSION
def test_formation_is_kept_as_closely_as_required_with_smooth_setpoints(name):
    summary = fly(name, WHOLE_S[name]).summary
    formation = summary.formation
    assert formation.mean_error_m <= REQUIRED[name]
    assert formation.mean_error_m <= USUAL[name]
    assert formation.max_error_m <= 2.0
    assert formation.settle_10m_s <= 30.0
    assert formation.settle_1m_s <= 60.0
    assert formation.min_separation_m >= 5.0
    assert summary.accepted
    for vehicle in summary.vehicles.values():
        if "calm" in name:
            # What is left of the total variation once the turning that the circle itself asks for is off.
            assert vehicle.course_setpoint_excess_variation_rad_s < 0.1
        if name == "line-calm":
            assert vehicle.course_setpoint_variation_rad_s < 0.1


def test_setpoints_are_smooth_in_a_fast_loop_too():
    flight = fly(in_place("line-calm", rate_hz=50.0, duration_s=16.0))
    for vehicle in flight.summary.vehicles.values():
        assert vehicle.course_setpoint_variation_rad_s < 0.1


@EASIEST_AND_HARDEST
def test_a_leader_without_measured_ground_speed_costs_at_most_twice_the_error(name):
    observer = {"leader_speed_source": "observer"}
    formation = fly(name, controller=observer, rehearsal=SHORT).summary.formation
    assert formation.mean_error_m <= 2.0 * REQUIRED[name]
    assert formation.settle_10m_s <= 30.0
    assert formation.min_separation_m >= 5.0


@EASIEST_AND_HARDEST
def test_a_slow_lossy_link_and_noisy_positions_are_borne(name):
    bad = {
        **SHORT,
        "link_delay_s": 0.2,
        "link_jitter_s": 0.05,
        "link_loss": 0.2,
        "position_noise_m": 0.3,
    }
    flight = fly(name, rehearsal=bad)
    formation = flight.summary.formation
    assert formation.mean_error_m < 0.6
    assert formation.settle_10m_s <= 30.0
    assert formation.min_separation_m >= 5.0
    assert [
        one for one in flight.texts() if "can be" in one or "cannot be" in one or "clock" in one
    ] == []


@pytest.mark.parametrize("name", ["line-wind", "circle-wind"])
def test_the_articles_own_plant_is_flown_as_well(name):
    vehicles = {
        vehicle: {**fields, "plant": "course-hold"}
        for vehicle, fields in content_of(name)["vehicles"].items()
    }
    formation = fly(name, vehicles=vehicles, rehearsal=SHORT).summary.formation
    assert formation.mean_error_m <= REQUIRED[name]


def test_the_articles_field_keeps_a_steady_error_on_every_turn():
    # Slots 20 m aside and 40 m behind on a 150 m circle ask for a course up to 14.9 degrees and a speed
    # up to 2.7 m/s off the leader's; the article's field gives them only to an error of metres.
    formation = fly("circle-calm", 60.0, controller={"type": "article"}).summary.formation
    assert formation.mean_error_m > 2.0
    assert formation.max_error_m - formation.mean_error_m < 0.5
