"""An autopilot that starts anew in the air."""

from sitl_stub import Autopilot
from tests.kit.autopilot import new_autopilot
from tests.kit.wire import command_long, packed, parsed

REBOOT, SET_MESSAGE_INTERVAL, SET_MODE = 246, 511, 176


def flying() -> Autopilot:
    return new_autopilot(system_id=1, altitude_amsl_m=600.0, home_altitude_amsl_m=500.0)


def command(number: int, *parameters: float) -> bytes:
    return packed(command_long(number, *parameters, system_id=1))


def positions(data: bytes) -> list[int]:
    return [one.time_boot_ms for one in parsed(data) if one.get_type() == "GLOBAL_POSITION_INT"]


def test_reboot_forgets_mode_streams_and_boot_time_but_flies_on():
    autopilot = flying()
    autopilot.advance(1.0)
    autopilot.receive(command(SET_MESSAGE_INTERVAL, 33, 50_000))
    autopilot.receive(command(SET_MODE, 1, 15))
    assert len(positions(autopilot.advance(2.0))) == 20
    assert autopilot.truth().mode == "GUIDED"
    before = autopilot.truth()

    autopilot.receive(command(REBOOT, 1))

    after = autopilot.truth()
    assert after.mode == "LOITER"
    assert (after.latitude_deg, after.longitude_deg) == (before.latitude_deg, before.longitude_deg)
    # One position a second again, 1 s and 2 s after the boot at 2 s.
    assert positions(autopilot.advance(4.0)) == [1000, 2000]


def test_anything_but_a_reboot_is_denied():
    autopilot = flying()
    autopilot.advance(1.0)
    autopilot.receive(command(SET_MODE, 1, 15))
    autopilot.receive(command(REBOOT, 2))
    assert autopilot.truth().mode == "GUIDED"
