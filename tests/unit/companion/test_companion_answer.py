"""What a companion answers at once, and what has time until its setpoint has gone out."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import HEADING, MANUAL, SPEED, new_flight
from tests.kit.wire import heartbeat, parsed, spoken
from vfguide.companion.role import Outgoing
from vfguide.companion.supervisor import Mode


def commands(data: bytes) -> set[int]:
    return {one.command for one in parsed(data) if one.get_type() == "COMMAND_INT"}


def test_setpoints_are_in_the_first_half_and_heartbeats_in_the_second():
    whole, halves = new_flight(), new_flight()
    answer, settle = halves.companion.answer, halves.companion.settle
    at_once, later = [], []

    def in_halves(data: bytes, now: float) -> Outgoing:
        out = answer(data, now)
        at_once.append(out.to_autopilot)
        settle(out, now)
        later.append(out.to_autopilot)
        out.to_autopilot = at_once[-1] + later[-1]
        return out

    halves.companion.receive_mavlink = in_halves
    whole.run(10.0)
    halves.run(10.0)
    steering = {SPEED, HEADING}
    assert any(commands(data) >= steering for data in at_once)
    assert not any(commands(data) & steering for data in later)
    assert not any(one.get_type() == "HEARTBEAT" for one in parsed(b"".join(at_once)))
    # Once a second, from 0 to 10 s.
    beats = [one for one in parsed(b"".join(later)) if one.get_type() == "HEARTBEAT"]
    assert len(beats) == 11
    # And both together are what one call says.
    assert halves.sent == whole.sent
    assert halves.events == whole.events


def test_an_airspeed_leads_to_nothing_and_the_pilots_mode_to_something():
    flown = new_flight(until_s=10.0)
    companion, now = flown.companion, flown.now + 0.01
    assert companion.snapshot.mode.steers
    airspeed = mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0)
    assert companion.answer(spoken(airspeed), now).is_empty
    out = companion.answer(spoken(heartbeat(MANUAL)), now)
    assert companion.snapshot.mode is Mode.PILOT
    assert not out.is_empty
