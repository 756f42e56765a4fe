"""Whatever happens: a mode that the pilot has selected is the pilot's to change."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from tests.benchmarks.authority import ACTIONS, Encounter, meet


@pytest.mark.parametrize("seed", [11, 21])
def test_no_mode_of_a_pilot_is_undone(seed):
    counts, undone = meet(40, seed)
    assert undone == []
    assert sum(counts[action] for action in set(ACTIONS)) == 40


class PilotMachine(RuleBasedStateMachine):
    """Looks for the shortest way to undo a pilot."""

    @initialize(kind=st.sampled_from(["ardupilot", "px4"]), seed=st.integers(0, 9))
    def begin(self, kind: str, seed: int) -> None:
        self.encounter = Encounter(seed, kind)

    @rule(
        action=st.sampled_from(sorted(set(ACTIONS))), length_s=st.sampled_from([0.1, 0.7, 1.3, 2.6])
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
