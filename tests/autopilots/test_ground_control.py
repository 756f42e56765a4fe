"""QGroundControl beside a companion, each on a port of a real ArduPlane."""

import time

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.autopilots.formation import RECORDED, Formation, Plan, airborne
from tests.autopilots.qgroundcontrol import PLANS, QGroundControl
from tests.autopilots.simulators import ARDUPLANE_MODES
from vfguide.elementwise import FloatArray
from vfguide.record.tlog import read_tlog

COMPANION = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
SLOT = {"slot_along", "slot_cross", "slot_up", "form_mode"}

BESIDE_S = 20.0
"""How long both are watched beside each other."""


def intervals_s(plan: Plan, begin_s: float) -> FloatArray:
    """From each position that the companion of f1 heard to the next, by the autopilot's clock."""
    (path,) = (plan.directory / RECORDED).glob("*/f1.tlog")
    parser = mavlink.MAVLink(None)
    times = [
        parser.decode(bytearray(stamped.frame.content)).time_boot_ms * 1e-3
        for stamped in read_tlog(path)
        if stamped.frame.message_id == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
        and stamped.time_s >= begin_s
        and stamped.frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1
    ]
    return np.diff(times)


def look_at_everything(station: QGroundControl) -> None:
    """What QGroundControl shows of the vehicle and its companion."""
    station.start()
    heard = station.heard
    station.wait(lambda: heard[1, "HEARTBEAT"], "no vehicle")
    station.wait(lambda: heard[COMPANION, "HEARTBEAT"], "no companion")
    station.wait(lambda: heard[1, "AUTOPILOT_VERSION"], "no version")
    station.wait(lambda: station.plans >= set(PLANS), "no mission, fence and rally points")
    station.wait(lambda: set(station.values) >= SLOT, "no slot errors")

    def complete() -> bool:
        told = list(station.parameters.values())
        return len(told) >= max((one.param_count for one in told), default=1)

    station.wait(complete, "not all parameters", 120.0)


def steered(station: QGroundControl) -> bool:
    """Whether the companion says that it joins, or is in its place."""
    return station.values.get("form_mode") in {1.0, 2.0}


def give_orders(station: QGroundControl, formation: Formation) -> None:
    """The pilot's orders arrive, and the companion gives way to them."""
    modes = ARDUPLANE_MODES
    station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, modes["LOITER"])
    station.wait(lambda: station.mode == modes["LOITER"], "not in LOITER")
    station.wait(lambda: station.values.get("form_mode") == 6.0, "the companion does not give way")
    assert station.results[mavlink.MAV_CMD_DO_SET_MODE] == mavlink.MAV_RESULT_ACCEPTED
    said = [text for component, text in station.texts if component == COMPANION]
    assert any(text.startswith("vfguide f1: ") for text in said)
    formation.give("f1")
    station.wait(lambda: steered(station), "not steered again")
    # Fly to here, while the companion steers: taken, and followed by the companion's next course.
    station.fly_to(-35.36, 149.17, 100.0)
    station.wait(lambda: mavlink.MAV_CMD_DO_REPOSITION in station.results, "no answer")
    assert station.results[mavlink.MAV_CMD_DO_REPOSITION] == mavlink.MAV_RESULT_ACCEPTED
    station.wait(lambda: steered(station), "not steered any more")


def test_it_sees_the_companion_its_orders_arrive_and_its_streams_disturb_nobody(
    arduplane_pair: Plan,
) -> None:
    with airborne(arduplane_pair) as formation:
        simulator = formation.simulators["f1"]
        station = QGroundControl(simulator.tcp_port + 3, simulator.system_id)
        try:
            look_at_everything(station)
            station.wait(lambda: steered(station), "not steered")
            began_s = time.time()
            positions = station.heard[1, "GLOBAL_POSITION_INT"]
            time.sleep(BESIDE_S)
            positions = station.heard[1, "GLOBAL_POSITION_INT"] - positions
            give_orders(station, formation)
        finally:
            station.close()
    apart_s = intervals_s(arduplane_pair, began_s)
    # 25 a second for the companion, as its mission asks, and 3 for the ground station, of one vehicle.
    assert np.median(apart_s) == pytest.approx(0.04, abs=0.001)
    assert np.mean(apart_s < 0.06) > 0.95
    assert 0.5 * 3 * BESIDE_S < positions < 1.5 * 3 * BESIDE_S
