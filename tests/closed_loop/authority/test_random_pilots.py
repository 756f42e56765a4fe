"""Whatever happens: a mode that the pilot has selected is the pilot's to change."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule


def load() -> ModuleType:
    """The benchmark that anybody can run."""
    file = Path(__file__).parents[2] / "benchmarks" / "authority.py"
    spec = importlib.util.spec_from_file_location("benchmark_of_authority", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


AUTHORITY = load()


@pytest.mark.parametrize("seed", [11, 21])
def test_no_mode_of_a_pilot_is_undone(seed):
    counts, undone = AUTHORITY.meet(40, seed)
    assert undone == []
    assert sum(counts[action] for action in set(AUTHORITY.ACTIONS)) == 40


class PilotMachine(RuleBasedStateMachine):
    """Looks for the shortest way to undo a pilot."""

    @initialize(kind=st.sampled_from(["ardupilot", "px4"]), seed=st.integers(0, 9))
    def begin(self, kind: str, seed: int) -> None:
        self.encounter = AUTHORITY.Encounter(seed, kind)

    @rule(
        action=st.sampled_from(sorted(set(AUTHORITY.ACTIONS))),
        length_s=st.sampled_from([0.1, 0.7, 1.3, 2.6]),
    )
    def happen(self, action: str, length_s: float) -> None:
        self.encounter.do(action, length_s)

    @invariant()
    def nothing_is_undone(self) -> None:
        encounter = getattr(self, "encounter", None)
        assert encounter is None or encounter.undone == []


TestPilotMachine = PilotMachine.TestCase
TestPilotMachine.settings = settings(
    max_examples=8, stateful_step_count=12, deadline=None, derandomize=True
)
