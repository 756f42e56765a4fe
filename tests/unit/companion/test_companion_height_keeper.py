"""Speed goes before height where throttle or idle leave no energy for both."""

import math
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of
from tests.kit.states import vehicle_at
from vfguide.companion.height_keeper import HeightKeeper
from vfguide.companion.own_vehicle import GeodeticPlace, NavigatedState
from vfguide.guidance.height import HeightTarget, held_height
from vfguide.state import Setpoint

PERIOD_S = 0.05
CLIMB = HeightTarget(height=150.0, climb_rate=3.0, ahead=156.0)


def navigated(time_s: float, airspeed: float) -> NavigatedState:
    return NavigatedState(
        state=vehicle_at(time_s=time_s, ground_speed=airspeed, height=150.0),
        place=GeodeticPlace(latitude_deg=47.0, longitude_deg=8.0, altitude_amsl=638.0),
        period=PERIOD_S,
        interval=PERIOD_S,
        altitude_amsl=638.0,
    )


def steady(airspeed: float) -> Callable[[float], float]:
    return lambda _: airspeed


def asked(
    keeper: HeightKeeper,
    seconds: float,
    *,
    airspeed: Callable[[float], float],
    wanted: float,
    target: HeightTarget,
    steered: bool = True,
) -> float:
    """The height that is asked for in the end."""
    height = 0.0
    for step in range(round(seconds / PERIOD_S)):
        now = step * PERIOD_S
        height = keeper.step(
            navigated(now, airspeed(now)),
            target,
            Setpoint(course=0.0, speed=wanted),
            steered=steered,
        )
    return height


@pytest.fixture
def keeper() -> HeightKeeper:
    return HeightKeeper(plan_of(vehicle="f1"))


@pytest.mark.parametrize(
    ("airspeed", "wanted", "target", "steered"),
    [
        # beta 0.8: the speed closes 2 m/s by exp(-0.8 t), as declared, and leaves energy.
        (lambda now: 22.0 - 2.0 * math.exp(-0.8 * now), 22.0, CLIMB, True),
        # Level flight gives nothing up, and nothing is learned while the pilot flies.
        (steady(20.0), 25.0, held_height(150.0), True),
        (steady(20.0), 25.0, CLIMB, False),
    ],
)
def test_a_height_that_leaves_energy_is_flown_as_wanted(keeper, airspeed, wanted, target, steered):
    height = asked(keeper, 20.0, airspeed=airspeed, wanted=wanted, target=target, steered=steered)
    assert height == target.ahead


def test_a_climb_gives_way_to_a_speed_that_does_not_come(keeper):
    height = asked(keeper, 20.0, airspeed=steady(20.0), wanted=22.0, target=CLIMB)
    assert 0.0 < height < 156.0 - 10.0
    given = keeper.given_up
    assert given > 0.0
    asked(keeper, 1.0, airspeed=steady(20.0), wanted=22.0, target=CLIMB)
    # 3 m/s of climb, no descent.
    assert keeper.given_up - given <= 3.0 + 1e-9


def test_a_descent_gives_way_to_a_speed_that_does_not_fall(keeper):
    sink = replace(CLIMB, climb_rate=-3.0, ahead=144.0)
    assert asked(keeper, 20.0, airspeed=steady(24.0), wanted=20.0, target=sink) > 144.0 + 10.0


def test_height_that_was_given_up_is_taken_back(keeper):
    asked(keeper, 10.0, airspeed=steady(20.0), wanted=22.0, target=CLIMB)
    assert keeper.given_up > 5.0
    height = asked(keeper, 90.0, airspeed=steady(22.0), wanted=22.0, target=held_height(200.0))
    assert height == pytest.approx(200.0)


def test_height_that_a_climb_gave_up_is_not_missing_in_the_descent_after_it(keeper):
    # 20 s of climb without the speed for it: from 96 m to 156 m, and nearly all of that is given up.
    begin = asked(keeper, 20.0, airspeed=steady(20.0), wanted=22.0, target=CLIMB)
    assert begin < 130.0
    lowest = begin
    for step in range(1200):
        target = max(156.0 - 3.0 * step * PERIOD_S, 60.0)
        sink = HeightTarget(height=target, climb_rate=-3.0 if target > 60.0 else 0.0, ahead=target)
        now = step * PERIOD_S
        setpoint: Setpoint[float] = Setpoint(course=0.0, speed=20.0)
        height = keeper.step(navigated(now, 20.0), sink, setpoint, steered=True)
        # Never below both where the climb ended and where the path is.
        assert height >= min(begin, target) - 1e-6
        lowest = min(lowest, height)
    assert lowest == pytest.approx(60.0)
