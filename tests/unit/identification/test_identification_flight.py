"""The whole flight in virtual time, and responses that are found again from 20 reports a second."""

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import typer
import yaml
from msgspec.structs import replace

from sitl_stub import Autopilot, PlantParameters, SteadyWind
from sitl_stub.codec import Signing
from tests.kit.autopilot import config_of
from tests.kit.missions import shipped
from vfguide.commands import identify as command
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.elementwise import FloatArray
from vfguide.guidance.response import HoldResponse
from vfguide.identification.core import Identification, Stage
from vfguide.identification.flown import profile_text
from vfguide.identification.plot import draw_findings
from vfguide.identification.recording import (
    Findings,
    HoldSamples,
    Phase,
    StepsRecording,
    as_seen,
    course_step,
    described,
    followed,
    response_in,
    segments,
    shortcoming,
    speed_step,
)
from vfguide.identification.slip import Slip
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.framing import ConnectionSigning
from vfguide.state import Airframe

RATE_HZ = 20.0
NARROW = Airframe(airspeed_min=19.8, airspeed_max=20.2)
UNIX_S = 1.7e9

Kind = Literal["ardupilot", "px4"]


def autopilot(
    kind: Kind = "ardupilot", /, *, key: bytes | None = None, course: float = 1.0, **plant: Any
) -> Autopilot:
    place = {"latitude_deg": 47.4, "longitude_deg": 8.5, "altitude_amsl_m": 588.0}
    flown = {"autopilot": kind, "plant": PlantParameters(**plant), "course_rad": course}
    config = config_of(system_id=1, **place, home_altitude_amsl_m=488.0, **flown)
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
    loses: bool = False,
) -> list[str]:
    """Both sides in turns; what the operator was told. Whether what is sent does not reach the autopilot."""
    replies, told = b"", []
    for step in range(round(seconds * RATE_HZ)):
        now = began + step / RATE_HZ
        answer = flight.receive(replies + emulator.advance(now), now)
        told += [event.text for event in answer.events]
        if flight.released:
            break
        replies = b"" if loses else emulator.receive(answer.to_autopilot)
    return told


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_the_flight_finds_what_flies_and_hands_it_back(kind, tmp_path):
    flies = {"alpha_1_s": 0.9, "beta_1_s": 0.6, "course_dead_time_s": 0.3, "speed_dead_time_s": 0.4}
    flight, emulator = identification(kind), autopilot(kind, **flies)
    told = fly(flight, emulator)
    assert flight.stage is Stage.DONE
    assert told[-2:] == ["all steps flown", "stopping: handing back"]
    assert flight.released
    assert emulator.truth().mode in {"LOITER", "AUTO.LOITER"}
    findings = flight.recording.findings()
    fields = yaml.safe_load(profile_text("leader", findings))["leader"]
    assert {name: fields[name] for name in flies} == pytest.approx(flies, rel=0.05)
    draw_findings(findings, tmp_path / "leader.png", "leader")
    assert (tmp_path / "leader.png").read_bytes().startswith(b"\x89PNG")


def test_arduplanes_bank_and_roll_are_found():
    plant = {"kind": "bank", "guided_p_cdeg_rad": 12_000.0, "roll_time_s": 0.4}
    flight = identification()
    fly(flight, autopilot(**plant), seconds=40.0)
    course = flight.recording.findings().course
    # 12000 cdeg/rad are 2.094 rad/rad; times 9.80665 / 20.
    assert course.gain == pytest.approx(1.027, rel=0.05)
    # The bank lags, not its tangent.
    assert course.lag == pytest.approx(0.4, abs=0.03)


@pytest.mark.parametrize(("efficiency", "slips"), [(0.745, True), (1.0, False)])
def test_what_is_turned_of_the_bank_is_found_in_two_minutes(efficiency, slips):
    plant = {"kind": "bank", "turn_efficiency": efficiency, "roll_time_s": 0.35}
    flight = identification()
    fly(flight, autopilot(**plant), seconds=120.0)
    assert flight.stage is Stage.DONE
    slip = flight.recording.banks.slip()
    assert slip.efficiency.value == pytest.approx(efficiency, abs=0.02)
    assert slip.efficiency.half_width < 0.04
    # The emulated nose points where it flies.
    assert abs(slip.lead.value) < 0.1
    profile = profile_text("leader", findings_of(None, None, slip))
    assert yaml.safe_load(profile)["leader"] == {"slips": slips}


def test_without_leave_it_waits_for_the_pilot():
    flight, emulator = identification(engage=False), autopilot()
    fly(flight, emulator, seconds=5.0)
    assert flight.stage is Stage.WAITING
    assert emulator.truth().mode == "LOITER"


def test_telemetry_that_falls_silent_ends_it():
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=10.0)
    polled = [flight.poll(10.1 + 0.1 * step).events for step in range(25)]
    assert [event.text for events in polled for event in events][-2:] == [
        "nothing to steer by for 2 s: telemetry is silent, or not believed",
        "stopping: handing back",
    ]
    # Nothing is known of its mode meanwhile; once it is heard again it is handed back.
    assert not flight.released
    fly(flight, emulator, seconds=10.0, began=12.5)
    assert flight.released
    assert emulator.truth().mode == "LOITER"


@pytest.mark.parametrize("lost", [False, True])
def test_the_operator_can_end_it_and_a_lost_hand_back_is_repeated_until_it_is_seen(lost):
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=10.0)
    stopped = flight.stop(10.0).to_autopilot
    if lost:
        fly(flight, emulator, seconds=2.5, began=10.05, loses=True)
        assert emulator.truth().mode == "GUIDED"
        assert not flight.released
    else:
        emulator.receive(stopped)
    fly(flight, emulator, seconds=10.0, began=12.55 if lost else 10.05)
    assert flight.released
    assert emulator.truth().mode == "LOITER"
    assert (flight.stage, flight.ended) == (Stage.ENDED, "stopped")


def test_a_vehicle_that_its_pilot_took_is_not_engaged_again():
    flight, emulator = identification(), autopilot()
    fly(flight, emulator, seconds=20.0)
    taken = adapter_of(shipped("line-calm").vehicles["leader"]).hand_back()
    emulator.receive(Codec(1, 1).encode(taken))
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
    # The steps are 15 degrees either way, the wind turns the nose by 12 degrees at most.
    assert abs(samples.turned.mean() - samples.setpoint.mean()) < 0.6


@pytest.mark.parametrize("alpha", [0.5, 1.2, 5.0])
def test_no_step_comes_near_a_limit(alpha):
    airframe = Airframe(alpha=alpha, beta=alpha, max_acceleration=1.5)
    # 45 degrees of bank at 20 m/s turn at 0.49 rad/s.
    assert course_step(airframe) * alpha <= 0.6 * 0.4904
    assert speed_step(airframe) * alpha <= 0.6 * 1.5 + 1e-9
    for segment in segments(airframe, 2):
        assert airframe.airspeed_min < segment.speed < airframe.airspeed_max
    # One with no room for its speed makes no steps of it.
    assert speed_step(NARROW) == 0.0


def test_it_comes_back_along_the_way_it_went():
    flown = segments(Airframe(), 1)
    assert {one.course for one in flown if one.phase is Phase.SPEED} == {math.pi}
    assert any("s in all" in line for line in described(Airframe(), 1))


FINE_S = 0.0025
"""Step of the truth: an explicit Euler step of this size is right to a thousandth."""

EVERY = 20
"""Of them there is a report: 20 Hz."""

WIND = (3.0, -4.0)
G = 9.80665


def steps(size: float, base: float) -> tuple[FloatArray, FloatArray]:
    """When setpoints went out, and which: one up, one back, one down, one back."""
    told = np.array([base, base + size, base, base - size, base])
    return np.array([-5.0, 1.5, 7.0, 12.0, 19.0]), told


def samples_of(seen: FloatArray, limit: float, steps: tuple[FloatArray, FloatArray]) -> HoldSamples:
    """What is reported of a hold of which nothing but the value itself is seen."""
    return HoldSamples(
        time_s=np.arange(len(seen)) * FINE_S * EVERY,
        value=seen,
        limit=np.full(len(seen), limit),
        setpoint_s=steps[0],
        setpoint=steps[1],
    )


def setpoint_at(times: FloatArray, values: FloatArray, time_s: float) -> float:
    return float(values[max(int(np.searchsorted(times, time_s, side="right")) - 1, 0)])


def course_flight(alpha: float, dead_time: float, lag: float, noise: float) -> HoldSamples:
    """20 m/s of airspeed in a wind; the course is what is held, the heading what is seen."""
    sent = steps(0.26, 0.0)
    heading, bank, headings = math.asin(4.0 / 20.0), 0.0, []
    for number in range(round(24.0 / FINE_S)):
        headings.append(heading)
        target = setpoint_at(*sent, number * FINE_S - dead_time)
        course = math.atan2(20.0 * math.sin(heading) + WIND[1], 20.0 * math.cos(heading) + WIND[0])
        error = target - course
        if lag > 0.0:
            wanted = max(-math.pi / 4, min(math.pi / 4, alpha * 20.0 / G * error))
            bank += FINE_S / lag * (wanted - bank)
            heading += FINE_S * G * math.tan(bank) / 20.0
        else:
            heading += FINE_S * alpha * error
    seen = np.array(headings[::EVERY])
    seen += noise * np.random.default_rng(1).standard_normal(len(seen))
    course = np.arctan2(20.0 * np.sin(seen) + WIND[1], 20.0 * np.cos(seen) + WIND[0])
    return replace(samples_of(course, G * math.tan(math.pi / 4) / 20.0, sent), turned=seen)


def speed_flight(beta: float, dead_time: float, lag: float, noise: float) -> HoldSamples:
    sent = steps(2.0, 20.0)
    speed, acceleration, speeds = 20.0, 0.0, []
    for number in range(round(24.0 / FINE_S)):
        speeds.append(speed)
        target = setpoint_at(*sent, number * FINE_S - dead_time)
        wanted = max(-3.0, min(3.0, beta * (target - speed)))
        acceleration = acceleration + FINE_S / lag * (wanted - acceleration) if lag else wanted
        speed += FINE_S * acceleration
    seen = np.array(speeds[::EVERY])
    seen += noise * np.random.default_rng(2).standard_normal(len(seen))
    return samples_of(seen, 3.0, sent)


FLIGHTS = {"course": course_flight, "speed": speed_flight}


@pytest.mark.parametrize("kind", ["course", "speed"])
@pytest.mark.parametrize(
    ("bandwidth", "dead_time", "lag"),
    [(1.2, 0.2, 0), (0.6, 0.5, 0), (1.8, 0.3, 0), (1.2, 0.0, 0), (1.0, 0.2, 0.4)],
)
def test_bandwidth_dead_time_and_lag_are_found_within_five_percent(kind, bandwidth, dead_time, lag):
    response = response_in(FLIGHTS[kind](bandwidth, dead_time, lag, 0.0))
    assert response.gain == pytest.approx(bandwidth, rel=0.05)
    assert response.dead_time == pytest.approx(dead_time, rel=0.05, abs=0.02 if lag else 0.01)
    assert response.lag == pytest.approx(lag, rel=0.06)
    assert response.least < bandwidth < response.greatest


@pytest.mark.parametrize(("kind", "noise"), [("course", 0.005), ("speed", 0.1)])
def test_noise_widens_the_bounds_and_they_hold_the_truth(kind, noise):
    quiet = response_in(FLIGHTS[kind](1.2, 0.3, 0.0, 0.0))
    noisy = response_in(FLIGHTS[kind](1.2, 0.3, 0.0, noise))
    assert noisy.doubt > 1.3 * quiet.doubt
    assert noisy.least < 1.2 < noisy.greatest
    assert noisy.earliest < 0.3 < noisy.latest


@pytest.mark.parametrize(("kind", "noise"), [("course", 0.005), ("speed", 0.1)])
def test_what_was_learned_would_have_flown_what_was_seen(kind, noise):
    samples = FLIGHTS[kind](1.2, 0.3, 0.0, noise)
    left = followed(samples, response_in(samples)) - samples.seen
    assert np.std(left) == pytest.approx(noise, rel=0.1)


def test_setpoints_are_indicated_airspeeds_and_what_is_seen_are_true_ones():
    """At 700 m the true airspeed is 6.6 % greater: 1.3 m/s, as much as a step."""
    flight = speed_flight(0.6, 0.4, 0.0, 0.0)
    seen = response_in(as_seen(replace(flight, value=flight.value + 1.3)))
    assert seen.gain == pytest.approx(0.6, rel=0.05)
    assert seen.dead_time == pytest.approx(0.4, abs=0.05)


def response(gain: float, half_width: float) -> HoldResponse:
    return HoldResponse(
        gain=gain,
        least=gain - half_width,
        greatest=gain + half_width,
        dead_time=0.2,
        lag=0.2,
        earliest=0.3,
        latest=0.5,
        explained=0.99,
        seconds=60.0,
    )


def findings_of(
    course: HoldResponse | None, speed: HoldResponse | None, slip: Slip | None = None
) -> Findings:
    return Findings(course=course, course_samples=None, speed=speed, speed_samples=None, slip=slip)


GOOD, WIDE = response(0.8, 0.1), response(0.6, 0.25)

SILENT = "the telemetry is silent"
EARLY = f"ended before its time ({SILENT})|beta_1_s|fly it again"


@pytest.mark.parametrize(
    ("found", "airframe", "ended", "words"),
    [
        ((GOOD, WIDE), Airframe(), None, "beta_1_s (0.60, 0.35 to 0.85 1/s|response: auto"),
        ((WIDE, GOOD), Airframe(), None, "alpha_1_s (0.60, 0.35 to 0.85 1/s|more --repeats"),
        ((None, GOOD), Airframe(), None, "alpha_1_s (too few reports|rate_hz"),
        ((GOOD, None), NARROW, None, "airspeed_range_m_s leaves no room|widen it"),
        ((GOOD, None), Airframe(), SILENT, EARLY),
        ((GOOD, GOOD), Airframe(), "stopped", "(stopped)|fewer steps than planned"),
    ],
)
def test_one_line_says_what_was_not_learned_why_and_the_remedy(found, airframe, ended, words):
    line = shortcoming(findings_of(*found), airframe, ended)
    assert "\n" not in line
    for one in words.split("|"):
        assert one in line
    # Nothing is said where all is known well.
    assert shortcoming(findings_of(GOOD, GOOD), Airframe(), None) is None


def test_the_command_ends_with_1_and_the_line(monkeypatch, capsys):
    async def fly_steps(identification: Identification, *_: object, **__: object) -> None:
        identification.stop(0.0)

    monkeypatch.setattr(command, "fly_steps", fly_steps)
    monkeypatch.setattr(StepsRecording, "findings", lambda _self: findings_of(GOOD, None))
    with pytest.raises(typer.Exit) as ended:
        command.identify("leader", mission=Path("line-calm"), mavlink="udpin://127.0.0.1:14999")
    out, err = capsys.readouterr()
    assert ended.value.exit_code == 1
    assert "alpha_1_s: 0.800" in out
    words = "the flight ended before its time (stopped), not learned: beta_1_s"
    assert err.splitlines()[-1].startswith(words)
