"""A companion that finds another of its name on the link, which was there before."""

from tests.kit.companion import new_flight
from vfguide.companion.supervisor import Mode

HEARD_S = 10.0


def test_the_younger_hands_back_the_vehicle_that_it_steers_and_says_why():
    one = new_flight(until_s=HEARD_S)
    assert one.modes[-1][1].steers
    out = one.companion.stand_back(one.now, twin=True)
    assert "another companion of this name was here before" in out.events[0].text
    assert not one.companion.stand_back(one.now, twin=True).events
    one.run(HEARD_S + 5.0)
    assert not one.modes[-1][1].steers
    assert one.autopilot_mode == "LOITER"
    assert one.companion.obstacle(one.now) is not None


def test_the_younger_that_has_not_steered_commands_nothing_until_the_other_is_silent():
    """The other one may steer this very vehicle."""
    one = new_flight()
    one.companion.stand_back(0.0, twin=True)
    one.run(HEARD_S)
    assert {mode for _, mode in one.modes} == {Mode.WAITING}
    assert one.autopilot_mode == "LOITER"
    one.companion.stand_back(one.now, twin=False)
    one.run(2.0 * HEARD_S)
    assert one.modes[-1][1].steers
    assert one.autopilot_mode == "GUIDED"
