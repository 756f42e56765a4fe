"""The whole flight in virtual time, through MAVLink bytes, with an emulated autopilot."""

import math
from collections.abc import Callable
from typing import Any, Literal

import pytest
import yaml

from sitl_stub import Autopilot, PlantParameters, SteadyWind
from sitl_stub.codec import Signing
from tests.kit.autopilot import config_of
from tests.kit.missions import shipped
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.identification.core import Identification, Stage
from vfguide.identification.flown import profile_text
from vfguide.identification.plot import draw_findings
from vfguide.identification.recording import (
    Findings,
    Phase,
    course_step,
    described,
    segments,
    speed_step,
)
from vfguide.mavlink.framing import ConnectionSigning
from vfguide.state import Airframe

RATE_HZ = 20.0
UNIX_S = 1.7e9

Kind = Literal["ardupilot", "px4"]


def autopilot(
    kind: Kind = "ardupilot",
    plant: PlantParameters | None = None,
    *,
    course: float = 1.0,
    key: bytes | None = None,
) -> Autopilot:
    config = config_of(
        system_id=1,
        autopilot=kind,
        plant=plant or PlantParameters(),
        latitude_deg=47.4,
        longitude_deg=8.5,
        altitude_amsl_m=588.0,
        home_altitude_amsl_m=488.0,
        course_rad=course,
    )
    signing = None if key is None else Signing(key)
    # Both sides date their signatures by one clock.
    return Autopilot(config, SteadyWind(4.0, 2.0), signing=signing, unix_time=lambda: UNIX_S)


def identification(
    kind: Kind = "ardupilot", *, engage: bool = True, signing: ConnectionSigning | None = None
) -> Identification:
    plan = flight_plan(shipped("line-calm"), "leader")
    vehicle = shipped("line-calm").vehicles["leader"].model_copy(update={"autopilot": kind})
    return Identification(plan, adapter_of(vehicle), engage=engage, repeats=1, signing=signing)


def fly(
    flight: Identification,
    emulator: Autopilot,
    *,
    seconds: float = 300.0,
    began: float = 0.0,
    loses: Callable[[float], bool] = lambda _: False,
) -> list[str]:
    """Both sides in turns; what the operator was told. What `loses` names does not reach the autopilot."""
    replies, told = b"", []
    for step in range(round(seconds * RATE_HZ)):
        now = began + step / RATE_HZ
        answer = flight.receive(replies + emulator.advance(now), now)
        told += [event.text for event in answer.events]
        if flight.released:
            break
        replies = b"" if loses(now) else emulator.receive(answer.to_autopilot)
    return told


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_the_flight_finds_what_flies_and_hands_it_back(kind, tmp_path):
    plant = PlantParameters(
        alpha_1_s=0.9, beta_1_s=0.6, course_dead_time_s=0.3, speed_dead_time_s=0.4
    )
    flight, emulator = identification(kind), autopilot(kind, plant)
    told = fly(flight, emulator)
    assert flight.stage is Stage.DONE
    assert told[-2:] == ["all steps flown", "stopping: handing back"]
    assert flight.released
    assert emulator.truth().mode in {"LOITER", "AUTO.LOITER"}
    findings = flight.recording.findings()
    fields = yaml.safe_load(profile_text("leader", findings))["leader"]
    expected = {"alpha_1_s": 0.9, "course_dead_time_s": 0.3}
    expected |= {"beta_1_s": 0.6, "speed_dead_time_s": 0.4}
    assert {name: fields[name] for name in expected} == pytest.approx(expected, rel=0.05)
    draw_findings(findings, tmp_path / "leader.png", "leader")
    assert (tmp_path / "leader.png").read_bytes().startswith(b"\x89PNG")


def test_arduplanes_bank_and_roll_are_found():
    plant = PlantParameters(kind="bank", guided_p_cdeg_rad=12_000.0, roll_time_s=0.4)
    flight = identification()
    fly(flight, autopilot("ardupilot", plant), seconds=40.0)
    course = flight.recording.findings().course
    assert course is not None
    # 12000 cdeg/rad are 2.094 rad/rad; times 9.80665 / 20.
    assert course.gain == pytest.approx(1.027, rel=0.05)
    # The bank lags, not its tangent.
    assert course.lag == pytest.approx(0.4, abs=0.03)


@pytest.mark.parametrize(("efficiency", "slips"), [(0.745, True), (1.0, False)])
def test_what_is_turned_of_the_bank_is_found_in_two_minutes(efficiency, slips):
    plant = PlantParameters(kind="bank", turn_efficiency=efficiency, roll_time_s=0.35)
    flight = identification()
    fly(flight, autopilot("ardupilot", plant), seconds=120.0)
    assert flight.stage is Stage.DONE
    slip = flight.recording.banks.slip()
    assert slip is not None
    assert slip.efficiency.value == pytest.approx(efficiency, abs=0.02)
    assert slip.efficiency.half_width < 0.04
    # The emulated nose points where it flies.
    assert abs(slip.lead.value) < 0.1
    findings = Findings(course=None, course_samples=None, speed=None, speed_samples=None, slip=slip)
    assert yaml.safe_load(profile_text("leader", findings))["leader"] == {"slips": slips}


def test_without_leave_it_waits_for_the_pilot():
    flight, emulator = identification(engage=False), autopilot()
    fly(flight, emulator, seconds=5.0)
    assert flight.stage is Stage.WAITING
    assert emulator.truth().mode == "LOITER"


def test_telemetry_that_falls_silent_ends_it():
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=10.0)
    told = [
        event.text for step in range(25) for event in flight.poll(10.0 + 0.1 * (step + 1)).events
    ]
    assert told[-2:] == [
        "nothing to steer by for 2 s: telemetry is silent, or not believed",
        "stopping: handing back",
    ]
    # Nothing is known of its mode meanwhile; once it is heard again it is handed back.
    assert not flight.released
    fly(flight, emulator, seconds=10.0, began=12.5)
    assert flight.released
    assert emulator.truth().mode == "LOITER"


def test_the_operator_can_end_it():
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=10.0)
    emulator.receive(flight.stop(10.0).to_autopilot)
    fly(flight, emulator, seconds=10.0, began=10.05)
    assert emulator.truth().mode == "LOITER"
    assert flight.stage is Stage.ENDED
    assert flight.ended == "stopped"


def test_a_lost_hand_back_is_repeated_until_it_is_seen():
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=10.0)
    flight.stop(10.0)
    fly(flight, emulator, seconds=2.5, began=10.05, loses=lambda _: True)
    assert emulator.truth().mode == "GUIDED"
    assert not flight.released
    fly(flight, emulator, seconds=5.0, began=12.55)
    assert flight.released
    assert emulator.truth().mode == "LOITER"


def test_a_vehicle_that_its_pilot_took_is_not_engaged_again():
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=20.0)
    emulator.receive(_packed(adapter_of(shipped("line-calm").vehicles["leader"]).hand_back()))
    fly(flight, emulator, seconds=20.0, began=20.0)
    assert flight.ended == "the pilot has taken over: nothing more is sent"
    assert flight.released
    assert emulator.truth().mode == "LOITER"


def test_an_autopilot_that_signs_is_identified_by_its_key_alone():
    key = bytes(range(32))
    signs = identification(signing=ConnectionSigning(key, lambda: UNIX_S))
    plain = identification()
    for flight in (signs, plain):
        emulator = autopilot(key=key)
        fly(flight, emulator, seconds=10.0)
        assert flight.stage is (Stage.FLYING if flight is signs else Stage.WAITING)


@pytest.mark.parametrize("course", [3.1, -3.1, 0.02])
def test_courses_and_setpoints_lie_on_one_turn_of_the_circle(course):
    flight = identification()
    fly(flight, autopilot(course=course), seconds=45.0)
    samples = flight.recording.findings().course_samples
    assert samples is not None
    # The steps are 15 degrees either way, the wind turns the nose by 12 degrees at most.
    assert samples.turned is not None
    assert abs(samples.turned.mean() - samples.setpoint.mean()) < 0.6


@pytest.mark.parametrize("alpha", [0.5, 1.2, 5.0])
def test_no_step_comes_near_a_limit(alpha):
    airframe = Airframe(alpha=alpha, beta=alpha, max_acceleration=1.5)
    # 45 degrees of bank at 20 m/s turn at 0.49 rad/s.
    assert course_step(airframe) * alpha <= 0.6 * 0.4904
    assert speed_step(airframe) * alpha <= 0.6 * 1.5 + 1e-9
    for segment in segments(airframe, 2):
        assert airframe.airspeed_min < segment.speed < airframe.airspeed_max


def test_an_aircraft_with_no_room_for_its_speed_makes_no_steps_of_it():
    narrow = Airframe(airspeed_min=19.8, airspeed_max=20.2)
    assert speed_step(narrow) == 0.0


def test_it_comes_back_along_the_way_it_went():
    flown = segments(Airframe(), 1)
    assert {one.course for one in flown if one.phase is Phase.SPEED} == {math.pi}
    assert any("s in all" in line for line in described(Airframe(), 1))


def _packed(messages: list[Any]) -> bytes:
    from vfguide.mavlink.codec import Codec

    return Codec(1, 1).encode(messages)
