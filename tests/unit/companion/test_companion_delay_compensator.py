"""The near future of a vehicle, against a vehicle that is stepped finely by the same kind of response."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.states import vehicle_at
from vfguide.companion.delay_compensator import SLIPPING, DelayCompensator, Memory, memory_of
from vfguide.guidance.airframe import ActiveSetpoint, Bias, Inner, propagate, propagate_inner
from vfguide.state import Airframe, Setpoint, VehicleState

LATE = Airframe(alpha=1.03, beta=0.55, course_lag=0.4, speed_dead_time=0.5, course_dead_time=0.2)
PERIOD = 0.05


def flown(
    delay_compensator: DelayCompensator, airframe: Airframe, bias: Bias, seconds: float
) -> VehicleState:
    """Fly 0.3 rad to the right and 2 m/s faster, reporting at 20 Hz, with the setpoints sent at time 0."""
    now, inner = vehicle_at(), Inner()
    delay_compensator.observe(now)
    delay_compensator.note(Setpoint(course=0.0, speed=20.0), -10.0)
    for step in range(round(seconds / PERIOD)):
        time_s = step * PERIOD
        delay_compensator.note(Setpoint(course=0.3, speed=22.0), time_s)
        for part in range(4):
            at = time_s + part * PERIOD / 4
            told = ActiveSetpoint(
                course=0.3 if at >= airframe.course_dead_time else 0.0,
                speed=22.0 if at >= airframe.speed_dead_time else 20.0,
            )
            inner = propagate_inner(inner, now, told, PERIOD / 4, airframe)
            now = propagate(now, inner, bias, PERIOD / 4, airframe)
        delay_compensator.observe(now)
    return now


def straight_on(ahead: VehicleState) -> Setpoint:
    """A law that neither turns nor accelerates."""
    return Setpoint(course=ahead.course, speed=ahead.airspeed)


def ahead_of(delay_compensator: DelayCompensator) -> VehicleState:
    """The state that a law for the speed is shown."""
    seen = []

    def law(ahead: VehicleState) -> Setpoint:
        seen.append(ahead)
        return straight_on(ahead)

    delay_compensator.setpoint(law, law)
    return seen[1]


def test_the_future_is_what_comes():
    delay_compensator = DelayCompensator(LATE)
    flown(delay_compensator, LATE, Bias(), 1.0)
    expected = flown(DelayCompensator(LATE), LATE, Bias(), 1.5)
    ahead = ahead_of(delay_compensator)
    # Half a second of dead time ahead, of which the last setpoints are still on their way.
    assert ahead.time_s == pytest.approx(1.5)
    assert ahead.airspeed == pytest.approx(expected.airspeed, abs=0.02)
    assert ahead.course == pytest.approx(expected.course, abs=0.01)
    assert (ahead.north, ahead.east) == pytest.approx((expected.north, expected.east), abs=0.05)


def test_what_the_vehicle_does_beyond_its_model_is_taken_off():
    delay_compensator = DelayCompensator(LATE)
    now = flown(delay_compensator, LATE, Bias(turn_rate=0.05, acceleration=0.3), 4.0)
    still = delay_compensator.setpoint(straight_on, straight_on)
    # To neither turn nor accelerate it has to be told to turn left by 0.05 rad/s, to slow by 0.3 m/s².
    at = ahead_of(delay_compensator)
    assert still.speed - at.airspeed == pytest.approx(-0.3 / 0.55, abs=0.1)
    assert still.course < now.course + 0.1


def held(delay_compensator: DelayCompensator, speed: float) -> float:
    """The speed that is sent where the laws ask for this one, northbound."""
    wanted = Setpoint(course=0.0, speed=speed)
    return delay_compensator.setpoint(lambda _: wanted, lambda _: wanted).speed


@pytest.mark.parametrize(
    ("wind", "slowest", "fastest"),
    [
        ((0.0, 0.0), 12.0, 32.0),
        ((5.0, 0.0), 17.0, 37.0),  # from behind
        ((-4.0, 0.0), 8.0, 28.0),  # from ahead
        ((0.0, 9.0), math.sqrt(63.0), math.sqrt(943.0)),  # 12² - 9², 32² - 9²
    ],
)
def test_a_ground_speed_is_one_that_the_airspeed_range_allows(wind, slowest, fastest):
    # Half a second late, nothing on its way.
    delay_compensator = DelayCompensator(replace(LATE, hold="course-hold"))
    delay_compensator.observe(replace(vehicle_at(), wind_north=wind[0], wind_east=wind[1]))
    told = [held(delay_compensator, speed) for speed in (3.0, 20.0, 60.0)]
    assert told == pytest.approx([slowest, 20.0, fastest])


def test_a_ground_speed_is_allowed_by_the_wind_on_the_course_on_which_it_takes_effect():
    # It turns right by 0.2 rad/s, nobody steers it: after the dead time of 0.5 s by 0.1 rad.
    delay_compensator = DelayCompensator(replace(LATE, hold="course-hold"))
    for step in range(200):
        course = 0.2 * PERIOD * step
        now = replace(vehicle_at(course=course), time_s=step * PERIOD, wind_north=5.0)
        delay_compensator.observe(now)
    tail, cross = 5.0 * math.cos(course + 0.1), 5.0 * math.sin(course + 0.1)
    # On the course of now it would be 0.4 m/s more.
    fastest = tail + math.sqrt(32.0**2 - cross**2)
    assert held(delay_compensator, 60.0) == pytest.approx(fastest, abs=0.01)


def test_a_long_memory_hardly_answers_to_a_swing():
    """The turn rate swings by 0.1 rad/s at 1 Hz: what of that is sent back as a course."""
    spreads = []
    for memory in (Memory(), SLIPPING):
        delay_compensator = DelayCompensator(LATE, memory=memory)
        delay_compensator.note(Setpoint(course=0.0, speed=20.0), -10.0)
        sent = []
        for step in range(400):
            time_s = step * PERIOD
            # The course stays within a sixtieth of a radian: 0.1 / (2 pi).
            swing = 0.1 / math.tau * math.sin(math.tau * time_s)
            delay_compensator.observe(vehicle_at(time_s=time_s, course=swing))
            sent.append(delay_compensator.course_setpoint(straight_on).course - swing)
        spreads.append(max(sent[200:]) - min(sent[200:]))
    # First-order filters of 0.6 s and of 3 s pass 0.26 and 0.05 of 1 Hz.
    assert spreads[1] < 0.6 * spreads[0]


def sent_errors(memory: Memory, asked: list[float]) -> list[float]:
    """Course errors (rad) sent to a vehicle that flies straight on, for turn rates (rad/s) asked of it."""
    delay_compensator, airframe = DelayCompensator(Airframe(), memory=memory), Airframe()
    sent = []
    for step, turn_rate in enumerate(asked):
        delay_compensator.observe(vehicle_at(time_s=step * PERIOD))
        wanted = Setpoint(course=turn_rate / airframe.alpha, speed=20.0)
        sent.append(delay_compensator.course_setpoint(lambda _, wanted=wanted: wanted).course)
    return sent


def test_a_swing_in_what_is_asked_of_a_vehicle_that_slips_is_answered_by_a_third():
    # A low-pass of 0.5 s at 0.9 Hz: 1 / sqrt(1 + (2 pi 0.9 0.5)²) = 0.333, of a small angle in still air.
    swing = [0.01 * math.sin(math.tau * 0.9 * step * PERIOD) for step in range(400)]
    usual, slipping = (max(sent_errors(memory, swing)[200:]) for memory in (Memory(), SLIPPING))
    assert slipping / usual == pytest.approx(0.333, abs=0.02)


def test_a_lasting_turn_is_asked_of_a_vehicle_that_slips_in_full():
    # What is left after 0.5 s is 1/e of the step, after 5 s nothing.
    asked = [0.0] + [0.01] * 100
    usual, slipping = sent_errors(Memory(), asked), sent_errors(SLIPPING, asked)
    assert slipping[10] / usual[10] == pytest.approx(1.0 - math.exp(-1.0), abs=0.03)
    assert slipping[-1] == pytest.approx(usual[-1], rel=1e-3)


def test_a_total_energy_hold_is_learned_slowly_whether_or_not_the_vehicle_slips():
    assert memory_of(slips=False, speed_hold="first-order") == Memory()
    assert memory_of(slips=False, speed_hold="total-energy") == Memory(acceleration_s=10.0)
    # Of a hold that bears 0.5 1/s what is not known is learned in 2 s; one that bears more keeps its 0.6 s.
    assert memory_of(slips=False, speed_hold="first-order", course_bandwidth=0.5).turn_rate_s == 2.0
    assert memory_of(slips=False, speed_hold="first-order", course_bandwidth=9.0).turn_rate_s == 0.6
    slipping = memory_of(slips=True, speed_hold="total-energy")
    assert slipping == Memory(turn_rate_s=3.0, acceleration_s=10.0, answer_s=0.5)


def test_a_vehicle_that_nobody_steers_is_expected_to_turn_on():
    delay_compensator = DelayCompensator(LATE)
    bank = math.atan(0.1 * 20.0 / 9.80665)
    now = vehicle_at()
    for _ in range(200):
        delay_compensator.observe(now)
        now = propagate(now, Inner(bank=bank), Bias(), PERIOD, LATE)
    ahead = ahead_of(delay_compensator)
    assert ahead.course - (now.course - 0.1 * PERIOD) == pytest.approx(0.05, abs=0.005)
    assert replace(ahead, time_s=0.0).airspeed == pytest.approx(20.0, abs=0.01)
