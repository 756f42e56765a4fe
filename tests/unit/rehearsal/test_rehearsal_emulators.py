"""The emulator of a live flight is started by a file: it must be the aircraft that lockstep flies."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sitl_stub import Autopilot, cli
from tests.kit.missions import content_of, mission_with
from vfguide.companion.mission_plan import airframe_of
from vfguide.errors import InputError
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.live import emulator_command
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.studies.flown import article_mission
from vfguide.mission import Mission

UNUSUAL_VEHICLE = {
    "autopilot": "px4",
    "alpha_1_s": 0.9,
    "beta_1_s": 0.7,
    "airspeed_range_m_s": [13, 29],
    "max_bank_deg": 40,
    "max_acceleration_m_s2": 1.7,
    "climb_range_m_s": [-2, 2.5],
    "height_delay_s": 1.5,
}
UNUSUAL_EMULATOR = {
    "plant": "bank",
    "vehicles": {"f1": {"roll_time_s": 0.35, "height_delay_s": 1.2}},
    "guided_p": 9000,
    "roll_time_s": 0.3,
    "roll_delay_s": 0.1,
    "turn_efficiency": 0.8,
    "speed_response": "tecs",
    "course_dead_time_s": 0.15,
    "speed_dead_time_s": 0.25,
    "indicated_airspeed": True,
    "airspeed_calibration": 1.1,
    "loop_rate_hz": 50,
}


def unusual_mission() -> Mission:
    """A mission in which nothing of the aircraft is as it is by default."""
    noisy = {"sensors": "sbas", "position_noise_m": 0.2, "seed": 7}
    gust = {"at_s": 3, "for_s": 2, "north_m_s": 4, "east_m_s": -1}
    wind = {"turbulence": "light", "roughness_m": 0.03, "gusts": [gust]}
    rehearsal = {"emulator": UNUSUAL_EMULATOR, **noisy}
    mission = article_mission("circle-wind", {"rehearsal": rehearsal, "wind": wind})
    f1 = {**content_of(mission)["vehicles"]["f1"], **UNUSUAL_VEHICLE}
    return mission_with(mission, vehicles={"f1": f1})


def emulator_by_command(
    mission: Mission, name: str, file: Path, monkeypatch: pytest.MonkeyPatch
) -> Autopilot:
    """What the emulator program makes of the file that a live flight starts it with."""
    served: list[Any] = []
    monkeypatch.setattr(cli, "serve_all", lambda fleet, *_arguments, **_named: served.extend(fleet))
    monkeypatch.setattr(cli, "run", lambda _service, _on_hangup: None)
    command = emulator_command(
        mission,
        name,
        file=file,
        mavlink="udpout://127.0.0.1:14540",
        truth="udpout://127.0.0.1:14541",
        epoch_s=time.time(),
        speedup=1.0,
    )
    cli.app(command[command.index("sitl_stub") + 1 :], standalone_mode=False)
    ((emulated, _address),) = served
    assert isinstance(emulated, Autopilot)
    return emulated


@pytest.mark.parametrize("name", ["leader", "f1"])
def test_a_live_flight_flies_the_aircraft_that_lockstep_flies(name, tmp_path, monkeypatch):
    mission = unusual_mission()
    live = emulator_by_command(mission, name, tmp_path / "emulator.yaml", monkeypatch)
    lockstep = emulator_of(mission, name)
    assert live.config == lockstep.config
    # The air, too: wind, turbulence, gusts and shear show in what it reports.
    assert live.advance(6.0) == lockstep.advance(6.0)


REAL_RESPONSE = {
    "alpha_1_s": 0.4,
    "beta_1_s": 0.3,
    "airspeed_range_m_s": [14, 27],
    "max_bank_deg": 33,
    "max_acceleration_m_s2": 1.1,
    "climb_range_m_s": [-1.5, 2],
    "height_delay_s": 3.5,
}


def emulated_mission(emulator: dict[str, Any], duration_s: float = 20.0) -> Mission:
    """circle-calm, flown by emulators that are not as the vehicles are declared."""
    rehearsal = {"emulator": emulator, "duration_s": duration_s}
    return article_mission("circle-calm", {"rehearsal": rehearsal})


def test_an_aircraft_flies_with_its_own_response_and_its_companion_is_told_the_declared_one():
    mission, declared = emulated_mission(REAL_RESPONSE), emulated_mission({})
    flown = emulator_of(mission, "f1").config.plant
    assert (flown.alpha_1_s, flown.beta_1_s) == (0.4, 0.3)
    assert (flown.airspeed_min_m_s, flown.airspeed_max_m_s) == (14.0, 27.0)
    assert flown.max_bank_rad == pytest.approx(np.radians(33.0))
    assert flown.max_acceleration_m_s2 == 1.1
    assert (flown.sink_rate_max_m_s, flown.climb_rate_max_m_s) == (1.5, 2.0)
    assert flown.height_delay_s == 3.5
    told = [airframe_of(one.vehicles["f1"]) for one in (mission, declared)]
    assert told[0] == told[1]


@pytest.mark.parametrize(("real", "alpha"), [({}, 1.2), ({"alpha_1_s": 0.4}, 0.4)])
def test_a_course_is_taken_up_with_the_emulators_own_alpha(real, alpha):
    flight = fly_lockstep(emulated_mission({"plant": "heading-hold", **real})).record
    f1 = flight.vehicles[1]
    # In calm air the heading is the course: dchi/dt = alpha (setpoint - chi), away from the limit of bank.
    missing = np.angle(np.exp(1j * (f1.course_setpoint_rad - f1.course_rad)))
    rate = f1.airspeed_m_s * np.gradient(np.unwrap(f1.course_rad), flight.time_s) / 9.80665
    turning = np.gradient(np.unwrap(f1.course_rad), flight.time_s)
    clear = (np.abs(rate) < 0.8) & (np.abs(missing) > 0.05) & (flight.time_s > 2.0)
    assert np.count_nonzero(clear) > 40
    assert np.median(turning[clear] / missing[clear]) == pytest.approx(alpha, rel=0.1)


@pytest.mark.parametrize("loop", ["course", "speed"])
def test_a_dead_time_of_the_emulator_delays_what_is_flown_by_just_that(loop):
    late_s = 0.4
    start = article_mission("circle-calm").rehearsal.start.model_dump(exclude_unset=True)
    # Slots far ahead: the setpoints change in one step, and what follows them can be seen.
    moved = {"f1": {"forward_m": -60, "right_m": -50}}
    begins = []
    for emulator in ({}, {f"{loop}_dead_time_s": late_s}):
        rehearsal = {"emulator": emulator, "duration_s": 6, "start": {**start, **moved}}
        flight = fly_lockstep(article_mission("circle-calm", {"rehearsal": rehearsal})).record
        f1 = flight.vehicles[1]
        flown = f1.airspeed_m_s if loop == "speed" else np.unwrap(f1.course_rad)
        told = f1.airspeed_setpoint_m_s if loop == "speed" else f1.course_setpoint_rad
        first = int(np.argmax(np.isfinite(told)))
        # Before it is steered the aircraft circles by itself.
        rate = np.diff(flown) / np.diff(flight.time_s)
        moves = np.abs(rate[first:] - rate[first - 1]) > 0.02
        begins.append(flight.time_s[first + int(np.argmax(moves))] - flight.time_s[first])
    assert begins[1] - begins[0] == pytest.approx(late_s, abs=0.06)


def test_one_vehicle_can_differ_from_the_others():
    own = {"f1": {"alpha_1_s": 0.4}, "f2": {"plant": "bank", "roll_time_s": 0.8}}
    mission = emulated_mission({"alpha_1_s": 2.0, "guided_p": 9000, "vehicles": own})
    plants = {name: emulator_of(mission, name).config.plant for name in mission.vehicles}
    bandwidths = {"leader": 2.0, "f1": 0.4, "f2": 2.0, "f3": 2.0}
    assert {name: one.alpha_1_s for name, one in plants.items()} == bandwidths
    assert {one.guided_p_cdeg_rad for one in plants.values()} == {9000.0}
    assert [name for name, one in plants.items() if one.kind == "bank"] == ["f2"]
    assert plants["f2"].roll_time_s == 0.8
    assert plants["f3"].roll_time_s == 0.4


def test_what_one_vehicle_cannot_fly_is_refused_in_its_own_place():
    impossible = {"plant": "course-hold", "speed_response": "tecs"}
    mission = emulated_mission({"vehicles": {"f2": impossible}})
    emulator_of(mission, "f1")
    with pytest.raises(InputError, match=r"^rehearsal\.emulator\.vehicles\.f2: .*another plant"):
        emulator_of(mission, "f2")
