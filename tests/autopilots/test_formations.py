"""Four autopilots in software, and a pilot who takes one of them away."""

from tests.autopilots.faults import Occurrence, faults
from tests.autopilots.formation import Plan, fly
from tests.autopilots.simulators import ArduPlane, Px4

FAULT_AT_S, DURATION_S = 50.0, 80.0

IN_SLOT_M = 30.0
"""In the last seconds. Unsteered they would be hundreds of metres off; a busy computer costs metres."""


def steered_but_for_a_pilots_rtl(plan: Plan, *, guided: int, rtl: int) -> None:
    """Three of four hold their slots; the third follower's pilot selects RTL, and it outlives its companion.

    Args:
        plan: the flight.
        guided: the guided mode's number in heartbeats.
        rtl: the number of the mode in which it returns.
    """
    fault = faults("leader", "f3")["pilot-rtl-restart"]
    verdict, modes = fly(plan, DURATION_S, [Occurrence(fault, FAULT_AT_S)])
    after = [mode for time_s, mode in modes["f3"] if time_s >= FAULT_AT_S]
    assert after == [rtl]
    assert [modes[name][-1][1] for name in ("leader", "f1", "f2")] == [guided] * 3
    assert max(verdict.at_end.values()) < IN_SLOT_M


def test_arduplanes_hold_in_gusts_and_a_pilots_rtl_outlives_a_new_companion(
    arduplanes_in_gusts: Plan,
) -> None:
    modes = ArduPlane.MODES
    steered_but_for_a_pilots_rtl(arduplanes_in_gusts, guided=modes["GUIDED"], rtl=modes["RTL"])


def test_px4s_hold_in_guided_course_and_a_pilots_rtl_outlives_a_new_companion(px4s: Plan) -> None:
    number = Px4.number
    steered_but_for_a_pilots_rtl(px4s, guided=number("GUIDED"), rtl=number("RTL"))
