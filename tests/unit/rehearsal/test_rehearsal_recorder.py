import math

from msgspec.structs import replace

import sitl_stub
from tests.kit.missions import shipped
from vfguide.companion.role import Snapshot
from vfguide.companion.supervisor import Mode
from vfguide.lab.rehearsal.recorder import VehicleRecorder, drawn_outlines, rally_points
from vfguide.state import Setpoint

MISSION = shipped("circle-wind")


def truth(**values: float) -> sitl_stub.Truth:
    origin = MISSION.origin
    place = {"latitude_deg": origin.latitude_deg, "longitude_deg": origin.longitude_deg}
    numbers = dict.fromkeys(sitl_stub.Truth.__struct_fields__, 1.0)
    return sitl_stub.Truth(**numbers | place | values | {"mode": "GUIDED", "armed": True})


def test_a_record_has_the_true_states_and_what_the_companion_did_in_the_order_of_the_samples():
    recorder = VehicleRecorder(MISSION, "f1")
    waiting = Snapshot(mode=Mode.WAITING, setpoint=None, lyapunov=math.nan)
    setpoint = Setpoint(course=0.5, speed=21.0, turn_limited=True)
    tracking = Snapshot(mode=Mode.TRACKING, setpoint=setpoint, lyapunov=2.5)
    recorder.sample(truth(bank_rad=0.25), waiting)
    recorder.sample(truth(bank_rad=0.75), tracking)
    record = recorder.record()
    assert record.bank_rad.tolist() == [0.25, 0.75]
    # At the origin, but for what a float leaves of the ellipsoid.
    assert abs(record.north_m).max() < 1e-6
    assert record.mode.tolist() == [list(Mode).index(one) for one in (Mode.WAITING, Mode.TRACKING)]
    assert record.limited.tolist() == [False, True]
    assert math.isnan(record.course_setpoint_rad[0])
    assert record.course_setpoint_rad[1] == 0.5
    assert record.airspeed_setpoint_m_s[1] == 21.0
    assert record.lyapunov[1] == 2.5


def test_who_has_left_the_formation_has_no_slot_meanwhile():
    recorder = VehicleRecorder(MISSION, "f1")
    flying = Snapshot(mode=Mode.TRACKING, setpoint=None, lyapunov=0.0)
    for left in (False, True, False):
        recorder.sample(truth(), replace(flying, left=left))
    record = recorder.record()
    assert record.in_formation.tolist() == [True, False, True]
    assert record.slot_forward_series_m is not None
    assert record.slot_forward_series_m[2] == record.slot_forward_m


def test_a_leader_that_holds_is_beside_no_path():
    recorder = VehicleRecorder(MISSION, "leader")
    flying = Snapshot(mode=Mode.TRACKING, setpoint=None, lyapunov=math.nan)
    recorder.sample(truth(course_rad=0.0), flying)
    recorder.sample(truth(course_rad=0.0), replace(flying, path=None))
    error = recorder.record().path_cross_track_error_m
    assert math.isfinite(error[0])
    assert math.isnan(error[1])


def test_rally_points_of_a_plan_are_drawn():
    mission = shipped("survey-plan")
    recorder = VehicleRecorder(mission, mission.leader.vehicle)
    recorder.sample(truth(), Snapshot(mode=Mode.TRACKING, setpoint=None, lyapunov=math.nan))
    drawn = [one for one in drawn_outlines(mission, recorder.record()) if one.kind == "rally"]
    (points,) = drawn
    north, east = rally_points(mission)
    assert points.north_m.tolist() == north.tolist()
    assert points.east_m.tolist() == east.tolist()
    assert north.size > 0
