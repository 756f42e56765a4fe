"""Environments: the same flight as without agents, the libraries' own checks, rewards and ends."""

from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import vfguide
from tests.kit import missions
from tests.kit.missions import in_place, mission_with, on_the_circle, replaced, shipped
from vfguide import errors
from vfguide.errors import InputError, VfguideError
from vfguide.lab import environment as environments
from vfguide.lab.environment import FlownStep, SteppedFlight, usual_reward
from vfguide.lab.rehearsal.lockstep import LockstepFlight, fly_lockstep
from vfguide.laws import DesiredMotion, Law, View, approach, law
from vfguide.mission.model import Mission
from vfguide.registry import laws

STILL = np.zeros(2, dtype=np.float32)
SHORT = {"duration_s": 4.0, "rate_hz": 10.0}
UNEVEN = {"settings": {"rehearsal.sensors": "standalone"}, **SHORT}
"""Flights that a seed changes."""


def toward_slot(view: View) -> DesiredMotion:
    """Return the motion of a law that remembers nothing."""
    return approach(
        view,
        course=view.motion.course + 0.02 * view.error.cross_track,
        speed=view.motion.speed + 0.3 * view.error.along_track,
        course_rate=view.motion.turn_rate,
    )


class TowardSlot(Law):
    """The same as a law."""

    def step(self, view: View, memory: Any) -> tuple[DesiredMotion, Any]:
        """Toward the slot."""
        return toward_slot(view), memory


class StraightOn(Law):
    """Another one, which asks for nothing."""

    def step(self, view: View, memory: Any) -> tuple[DesiredMotion, Any]:
        """Straight on."""
        return approach(view, course=view.state.course, speed=view.state.ground_speed), memory


@pytest.fixture(scope="module", autouse=True)
def own_laws() -> Iterator[None]:
    """Make laws known that are forgotten afterwards: other tests list all that there are."""
    known = laws._known  # noqa: SLF001
    before = {*known, *laws.own}
    law("toward slot")(TowardSlot)
    law("straight on")(StraightOn)
    yield
    for name in {*known} - before:
        del known[name]


def agents_flight(mission: Mission, *, wants: bool) -> LockstepFlight:
    """Fly a mission step by step; agents want what `toward_slot` wants, or leave all to the mission's law."""
    flight, asked = SteppedFlight(mission, [*mission.followers_by_name]), 0
    while not flight.is_over:
        asked += len(flight.views)
        flight.step({name: toward_slot(view) for name, view in flight.views.items() if wants})
    assert asked > 30
    return flight.brought_home()


def is_same(one: LockstepFlight, other: LockstepFlight) -> bool:
    """Whether two flights are the same to the last bit; in the last instant no agent is asked."""
    series = ("north_m", "east_m", "altitude_amsl_m", "course_setpoint_rad", "mode", "lyapunov")
    return one.events == other.events and all(
        np.array_equal(getattr(first, name)[:-1], getattr(second, name)[:-1], equal_nan=True)
        for first, second in zip(one.record.vehicles, other.record.vehicles, strict=True)
        for name in series
    )


@pytest.mark.parametrize("name", ["circle-wind", "leader-lost", "foreign-leader", "px4-sitl"])
def test_agents_that_leave_all_to_the_law_fly_its_flight_to_the_last_bit(name):
    """With deputies, behind a leader without a companion, and on autopilots that answer late."""
    mission = mission_with(name, rehearsal={"duration_s": 4.0})
    assert is_same(agents_flight(mission, wants=False), fly_lockstep(mission))


def test_agents_that_want_what_a_law_wants_fly_its_flight_to_the_last_bit():
    mission, by_law = (
        replaced(on_the_circle(**SHORT), controller={"type": name})
        for name in ("straight on", "toward slot")
    )
    assert is_same(agents_flight(mission, wants=True), fly_lockstep(by_law))
    assert not is_same(agents_flight(mission, wants=False), fly_lockstep(by_law))


def test_pettingzoo_finds_nothing_wrong(capsys):
    mission = shipped("line-calm")
    parallel_api_test(vfguide.environment(mission, **SHORT), num_cycles=60)
    parallel_seed_test(lambda: vfguide.environment(mission, **UNEVEN), num_cycles=30)
    assert "Passed" in capsys.readouterr().out


def test_gymnasium_finds_nothing_wrong():
    one = vfguide.environment(shipped("line-calm"), follower="f2", **UNEVEN)
    check_env(one, skip_render_check=True)
    one.close()
    with pytest.raises(InputError, match=r"no flight is under way; call reset\(\) before"):
        one.step(STILL)


def test_a_seed_makes_a_flight_and_those_that_follow_it():
    flown = vfguide.environment(shipped("line-calm"), **UNEVEN)

    def seen(seed: int | None = None) -> bytes:
        return b"".join(one.tobytes() for one in flown.reset(seed)[0].values())

    assert seen() == seen(shipped("line-calm").rehearsal.seed)
    again = [seen(7), seen(), seen()]
    assert [seen(7), seen(), seen()] == again
    assert len({*again}) == 3


def begun(**sections: Any) -> Any:
    """An environment of a line in calm air, everybody in the slot, whose flight has begun."""
    flown = vfguide.environment(in_place("line-calm", **sections), **SHORT)
    flown.reset()
    return flown


def test_all_end_with_the_mission_and_bring_the_flight_home():
    flown = begun()
    steps = 0
    while flown.agents:
        observations, rewards, terminated, truncated, infos = flown.step(
            dict.fromkeys(flown.agents, STILL)
        )
        steps += 1
    assert {*terminated.values()} == {False}
    assert truncated == {"f1": True, "f2": True, "f3": True}
    home = vfguide.Flight(flown=flown.brought_home())
    assert home.time_s[-1] == 4.0
    # Everyone is steered after 1.1 s.
    assert steps == 29
    for name, info in infos.items():
        assert info["distance_m"] == pytest.approx(home.errors[name].distance_m[-1], abs=0.01)
        square = info["distance_m"] ** 2
        assert rewards[name] == pytest.approx(-square / (square + 100.0))
        assert observations[name] in flown.observation_space(name)


def test_one_agent_turns_as_it_asks_and_the_others_fly_by_the_missions_law():
    one = vfguide.environment(in_place("line-calm"), follower="f2", **SHORT)
    _, info = one.reset()
    from_m = info["distance_m"]
    ended = False
    while not ended:
        observation, _, lost, ended, info = one.step(np.array([1.0, 0.0]))
        assert not lost
    # To the right, away from a slot that goes straight on.
    assert observation[1] < -5.0
    assert observation[4] > 0.5
    home = vfguide.Flight(flown=one.formation.brought_home())
    assert info["distance_m"] > from_m + 5.0
    assert home.errors["f1"].distance_m[-1] < 1.0


def test_who_loses_its_companion_is_lost_and_the_others_fly_on():
    flown = begun(losses=[{"vehicle": "f1", "at_s": 2.0, "what": "companion"}])
    ends = {}
    while flown.agents:
        _, rewards, terminated, truncated, _ = flown.step(dict.fromkeys(flown.agents, STILL))
        ends |= {name: rewards[name] for name, lost in terminated.items() if lost}
    assert [*ends] == ["f1"]
    # About 20 steps were left.
    assert -22.0 < ends["f1"] < -17.0
    assert truncated == {"f2": True, "f3": True}


@pytest.mark.parametrize(("least_m", "ended"), [(28.0, set()), (29.0, {"f1", "f2", "f3"})])
def test_who_comes_too_near_to_another_is_lost(monkeypatch, least_m, ended):
    """Slots are 20 m behind the leader and 20 m beside it: 28.3 m away from it and from the one behind."""
    monkeypatch.setattr(environments, "COLLISION_M", least_m)
    flown = begun()
    *_, terminated, _, _ = flown.step({})
    assert {name for name, lost in terminated.items() if lost} == ended
    assert {*flown.agents} == {"f1", "f2", "f3"} - ended


def test_the_usual_reward_is_the_square_of_the_distance_near_the_slot_and_bounded_far_away():
    flown = SteppedFlight(in_place("line-calm"), ["f1"])
    while not flown.views:
        flown.step({})

    def worth(distance_m: float, *, action: tuple[float, float] = (0.0, 0.0), lost: bool = False):
        step = {"action": np.array(action), "distance_m": distance_m, "lost": lost}
        return usual_reward(FlownStep(view=flown.views["f1"], nearest_m=28.0, left=40, **step))

    assert worth(0.0) == 0.0
    assert worth(0.1) == pytest.approx(-0.0001, rel=1e-3)
    assert worth(10.0) == pytest.approx(-0.5)
    assert worth(1e6) == pytest.approx(-1.0)
    assert worth(10.0, action=(1.0, 0.0)) == pytest.approx(-0.505)
    assert worth(10.0, lost=True) == pytest.approx(-40.5)


def test_a_reward_of_ones_own_and_setpoints_are_taken_and_a_flight_may_differ_from_the_mission():
    flown = vfguide.environment(
        in_place("line-calm"), actions="setpoints", reward=lambda step: step.nearest_m, **SHORT
    )
    _, infos = flown.reset(options={"settings": {"rehearsal.start.f1": {"right_m": -30.0}}})
    assert infos["f1"]["distance_m"] == pytest.approx(30.0, abs=4.0)
    for _ in range(20):
        _, rewards, *_, infos = flown.step({"f1": (0.0, 0.0), "f2": (0.5, 0.0), "f3": (0.0, -0.5)})
    assert rewards == {name: info["nearest_m"] for name, info in infos.items()}
    observations = flown.step({})[0]
    # Toward 45 degrees to the right; toward 5 m/s less than the slot.
    assert observations["f2"][4] > 0.4
    assert observations["f3"][5] < -2.0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"follower": "f9"}, "follower: f9 is none of f1, f2, f3"),
        ({"actions": "thrust"}, "actions: thrust is none of rates, setpoints"),
        ({"rate_hz": -1.0}, "--rate"),
        ({"settings": {"controller.k_z": 1.0}}, r"controller\.k_z: unknown field"),
    ],
)
def test_what_cannot_be_an_environment_is_said(given, said):
    with pytest.raises(InputError, match=said):
        vfguide.environment(shipped("line-calm"), **given)


def test_a_flight_by_radio_and_one_that_is_never_steered_are_refused():
    by_radio = vfguide.environment(mission_with("line-calm", rehearsal={"radio": {}}))
    with pytest.raises(InputError, match="no environment flies by radio; leave it out"):
        by_radio.reset()
    with pytest.raises(InputError, match=r"no flight has begun; call reset\(\) before"):
        by_radio.step({})
    losses = [{"vehicle": "f1", "at_s": 0.0}]
    alone = vfguide.environment(mission_with("line-calm", rehearsal={"losses": losses}), **SHORT)
    with pytest.raises(VfguideError, match="f1: not steered within 4 s"):
        alone.reset()


def test_without_the_extra_it_says_in_one_line_what_to_install(monkeypatch):
    monkeypatch.setattr(errors, "find_spec", lambda _: None)
    with pytest.raises(VfguideError) as refused:
        vfguide.environment(shipped("line-calm"))
    needed = "this needs gymnasium, which is not installed: pip install 'vfguide[rl]'"
    assert str(refused.value) == needed


LEARNED = [[0.36, 0.10, 0.07], [-0.08, 0.41, -0.07]]
"""What the example learns on circle-wind."""


@pytest.fixture(scope="module")
def example() -> Any:
    """The example as a module."""
    spec = spec_from_file_location("learned_law", missions.ROOT / "examples" / "learned_law.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_tells_better_weights_from_worse(example):
    mission = str(missions.MISSIONS / "line-calm.yaml")
    learned, idle, reversed_ = example.scores(
        mission, [np.array(LEARNED), np.zeros((2, 3)), -np.array(LEARNED)], 1
    )
    assert learned > idle > reversed_


def test_what_the_example_has_learned_flies_as_a_law(example, tmp_path):
    mission = on_the_circle(duration_s=20.0, rate_hz=10.0)
    file = tmp_path / "learned.npz"
    settings = {"controller.weights": str(file)}
    with pytest.raises(InputError, match="there are no weights; `python examples/"):
        vfguide.fly(mission, law=example.Learned, settings=settings)
    np.savez(file, weights=LEARNED)
    flown = vfguide.fly(mission, law=example.Learned, settings=settings)
    assert flown.summary.formation.mean_error_m < 0.3
