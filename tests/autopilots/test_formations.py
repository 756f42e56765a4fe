"""Four ArduPlanes in software, in gusts, and a pilot who takes one of them away."""

from tests.autopilots.faults import Occurrence, faults
from tests.autopilots.formation import Plan, fly
from tests.autopilots.simulators import ArduPlane

FAULT_AT_S, DURATION_S = 50.0, 80.0

IN_SLOT_M = 30.0
"""In the last seconds. Unsteered they would be hundreds of metres off; a busy computer costs metres."""


def test_arduplanes_hold_in_gusts_and_a_pilots_rtl_outlives_a_new_companion(
    arduplanes_in_gusts: Plan,
) -> None:
    fault = faults("leader", "f3")["pilot-rtl-restart"]
    verdict, modes = fly(arduplanes_in_gusts, DURATION_S, [Occurrence(fault, FAULT_AT_S)])
    after = [mode for time_s, mode in modes["f3"] if time_s >= FAULT_AT_S]
    assert after == [ArduPlane.MODES["RTL"]]
    assert [modes[name][-1][1] for name in ("leader", "f1", "f2")] == [
        ArduPlane.MODES["GUIDED"]
    ] * 3
    assert max(verdict.at_end.values()) < IN_SLOT_M
