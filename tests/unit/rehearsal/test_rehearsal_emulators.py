"""The aircraft of rehearsals, lockstep and live: how they are, where they begin, what is recorded of them."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import sitl_stub
from sitl_stub import Autopilot, cli
from tests.kit.missions import content_of, mission_with, replaced, shipped
from tests.kit.records import with_vehicle
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import airframe_of
from vfguide.companion.role import Snapshot
from vfguide.companion.supervisor import Mode
from vfguide.errors import InputError
from vfguide.formation.arrangement import Arrangement, Point, SlotMove
from vfguide.formation.orders import Formation
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab.rehearsal.aircraft import Aircraft, emulator_of
from vfguide.lab.rehearsal.live import emulator_command
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.rehearsal.recorder import VehicleRecorder, drawn_outlines, rally_points
from vfguide.lab.studies import prediction
from vfguide.lab.studies.flown import article_mission
from vfguide.lab.studies.order import BEHIND_M, starts_of_joining
from vfguide.lab.studies.prediction import fence_left, from_the_slots
from vfguide.link.order_codec import ORDER_MAGIC
from vfguide.mission import Mission
from vfguide.mission.feasibility import follower_start, leader_start
from vfguide.mission.order_plan import LeaderPlace
from vfguide.mission.place import Fence
from vfguide.state import Setpoint

UNUSUAL_VEHICLE = {"autopilot": "px4", "alpha_1_s": 0.9, "beta_1_s": 0.7, "max_bank_deg": 40}
UNUSUAL_VEHICLE |= {"airspeed_range_m_s": [13, 29], "max_acceleration_m_s2": 1.7}
UNUSUAL_VEHICLE |= {"climb_range_m_s": [-2, 2.5], "height_delay_s": 1.5}
UNUSUAL_EMULATOR = {
    "plant": "bank",
    "vehicles": {"f1": {"roll_time_s": 0.35, "height_delay_s": 1.2}},
    "guided_p": 9000,
    "roll_time_s": 0.3,
    "roll_delay_s": 0.1,
    "turn_efficiency": 0.8,
    "speed_response": "tecs",
    "course_dead_time_s": 0.15,
    "speed_dead_time_s": 0.25,
    "indicated_airspeed": True,
    "airspeed_calibration": 1.1,
    "loop_rate_hz": 50,
}


def unusual_mission() -> Mission:
    """A mission in which nothing of the aircraft is as it is by default."""
    noisy = {"sensors": "sbas", "position_noise_m": 0.2, "seed": 7}
    gust = {"at_s": 3, "for_s": 2, "north_m_s": 4, "east_m_s": -1}
    wind = {"turbulence": "light", "roughness_m": 0.03, "gusts": [gust]}
    rehearsal = {"emulator": UNUSUAL_EMULATOR, **noisy}
    mission = article_mission("circle-wind", {"rehearsal": rehearsal, "wind": wind})
    f1 = {**content_of(mission)["vehicles"]["f1"], **UNUSUAL_VEHICLE}
    return mission_with(mission, vehicles={"f1": f1})


def emulator_by_command(
    mission: Mission, name: str, file: Path, monkeypatch: pytest.MonkeyPatch
) -> Autopilot:
    """What the emulator program makes of the file that a live flight starts it with."""
    served: list[Any] = []
    monkeypatch.setattr(cli, "serve_all", lambda fleet, *_arguments, **_named: served.extend(fleet))
    monkeypatch.setattr(cli, "run", lambda _service, _on_hangup: None)
    urls = {"mavlink": "udpout://127.0.0.1:14540", "truth": "udpout://127.0.0.1:14541"}
    clock = {"epoch_s": time.time(), "speedup": 1.0}
    command = emulator_command(mission, name, file=file, **urls, **clock)
    cli.app(command[command.index("sitl_stub") + 1 :], standalone_mode=False)
    ((emulated, _address),) = served
    return emulated


@pytest.mark.parametrize("name", ["leader", "f1"])
def test_a_live_flight_flies_the_aircraft_that_lockstep_flies(name, tmp_path, monkeypatch):
    mission = unusual_mission()
    live = emulator_by_command(mission, name, tmp_path / "emulator.yaml", monkeypatch)
    lockstep = emulator_of(mission, name)
    assert live.config == lockstep.config
    # The air, too: wind, turbulence, gusts and shear show in what it reports.
    assert live.advance(6.0) == lockstep.advance(6.0)


REAL_RESPONSE = {"alpha_1_s": 0.4, "beta_1_s": 0.3, "airspeed_range_m_s": [14, 27]}
REAL_RESPONSE |= {"max_bank_deg": 33, "max_acceleration_m_s2": 1.1}
REAL_RESPONSE |= {"climb_range_m_s": [-1.5, 2], "height_delay_s": 3.5}


def emulated_mission(emulator: dict[str, Any], duration_s: float = 20.0) -> Mission:
    """circle-calm, flown by emulators that are not as the vehicles are declared."""
    rehearsal = {"emulator": emulator, "duration_s": duration_s}
    return article_mission("circle-calm", {"rehearsal": rehearsal})


def test_an_aircraft_flies_with_its_own_response_and_its_companion_is_told_the_declared_one():
    mission, declared = emulated_mission(REAL_RESPONSE), emulated_mission({})
    flown = emulator_of(mission, "f1").config.plant
    assert (flown.alpha_1_s, flown.beta_1_s) == (0.4, 0.3)
    assert (flown.airspeed_min_m_s, flown.airspeed_max_m_s) == (14.0, 27.0)
    assert flown.max_bank_rad == pytest.approx(np.radians(33.0))
    assert flown.max_acceleration_m_s2 == 1.1
    assert (flown.sink_rate_max_m_s, flown.climb_rate_max_m_s) == (1.5, 2.0)
    assert flown.height_delay_s == 3.5
    told = [airframe_of(one.vehicles["f1"]) for one in (mission, declared)]
    assert told[0] == told[1]


@pytest.mark.parametrize(("real", "alpha"), [({}, 1.2), ({"alpha_1_s": 0.4}, 0.4)])
def test_a_course_is_taken_up_with_the_emulators_own_alpha(real, alpha):
    flight = fly_lockstep(emulated_mission({"plant": "heading-hold", **real})).record
    f1 = flight.vehicles[1]
    # In calm air the heading is the course: dchi/dt = alpha (setpoint - chi), away from the limit of bank.
    missing = np.angle(np.exp(1j * (f1.course_setpoint_rad - f1.course_rad)))
    rate = f1.airspeed_m_s * np.gradient(np.unwrap(f1.course_rad), flight.time_s) / 9.80665
    turning = np.gradient(np.unwrap(f1.course_rad), flight.time_s)
    clear = (np.abs(rate) < 0.8) & (np.abs(missing) > 0.05) & (flight.time_s > 2.0)
    assert np.count_nonzero(clear) > 40
    assert np.median(turning[clear] / missing[clear]) == pytest.approx(alpha, rel=0.1)


@pytest.mark.parametrize("loop", ["course", "speed"])
def test_a_dead_time_of_the_emulator_delays_what_is_flown_by_just_that(loop):
    late_s = 0.4
    start = article_mission("circle-calm").rehearsal.start.model_dump(exclude_unset=True)
    # Slots far ahead: the setpoints change in one step, and what follows them can be seen.
    moved = {"f1": {"forward_m": -60, "right_m": -50}}
    begins = []
    for emulator in ({}, {f"{loop}_dead_time_s": late_s}):
        rehearsal = {"emulator": emulator, "duration_s": 6, "start": {**start, **moved}}
        flight = fly_lockstep(article_mission("circle-calm", {"rehearsal": rehearsal})).record
        f1 = flight.vehicles[1]
        flown = f1.airspeed_m_s if loop == "speed" else np.unwrap(f1.course_rad)
        told = f1.airspeed_setpoint_m_s if loop == "speed" else f1.course_setpoint_rad
        first = int(np.argmax(np.isfinite(told)))
        # Before it is steered the aircraft circles by itself.
        rate = np.diff(flown) / np.diff(flight.time_s)
        moves = np.abs(rate[first:] - rate[first - 1]) > 0.02
        begins.append(flight.time_s[first + int(np.argmax(moves))] - flight.time_s[first])
    assert begins[1] - begins[0] == pytest.approx(late_s, abs=0.06)


def test_one_vehicle_can_differ_from_the_others():
    own = {"f1": {"alpha_1_s": 0.4}, "f2": {"plant": "bank", "roll_time_s": 0.8}}
    mission = emulated_mission({"alpha_1_s": 2.0, "guided_p": 9000, "vehicles": own})
    plants = {name: emulator_of(mission, name).config.plant for name in mission.vehicles}
    bandwidths = {"leader": 2.0, "f1": 0.4, "f2": 2.0, "f3": 2.0}
    assert {name: one.alpha_1_s for name, one in plants.items()} == bandwidths
    assert {one.guided_p_cdeg_rad for one in plants.values()} == {9000.0}
    assert [name for name, one in plants.items() if one.kind == "bank"] == ["f2"]
    assert (plants["f2"].roll_time_s, plants["f3"].roll_time_s) == (0.8, 0.4)
    # What it cannot fly is refused in its own place.
    impossible = {"plant": "course-hold", "speed_response": "tecs"}
    mission = emulated_mission({"vehicles": {"f2": impossible}})
    emulator_of(mission, "f1")
    with pytest.raises(InputError, match=r"^rehearsal\.emulator\.vehicles\.f2: .*another plant"):
        emulator_of(mission, "f2")


def test_a_formation_begins_as_far_above_its_flying_height_as_its_leader():
    start = {"leader": {"north_m": 0, "east_m": 0, "up_m": 150}, "f1": {"up_m": -3}}
    mission = mission_with("climb-and-turn", rehearsal={"start": start})
    assert leader_start(mission).up_m == 150.0
    # f1's slot is 5 m above the leader, f2's 5 m below it.
    assert follower_start(mission, "f1").up_m == pytest.approx(152.0)
    assert follower_start(mission, "f2").up_m == pytest.approx(145.0)
    assert emulator_of(mission, "f1").truth().altitude_amsl_m == pytest.approx(488 + 100 + 152)
    # The check begins at the height of the path.
    corners = [{"north_m": north, "east_m": 0, "up_m": 40} for north in (0, 3000)]
    mission = replaced("line-calm", path={"type": "waypoints", "waypoints": corners})
    assert leader_start(from_the_slots(mission)).up_m == pytest.approx(40.0)


def test_check_holds_what_was_flown_against_the_fence_of_the_path_flown_then(monkeypatch):
    short = replaced("line-calm", rehearsal={"duration_s": 3.0, "rate_hz": 5.0, "start": {}})
    record = fly_lockstep(short).record
    fenced = replaced(short, fence={"max_height_m": 150})
    assert not [*fence_left(fenced, record)]
    # f1 is found 60 m higher for a moment, 160 m above the origin.
    high = record.followers[0].altitude_amsl_m + np.where(record.time_s >= 2.0, 60.0, 0.0)
    risen = with_vehicle(record, "f1", altitude_amsl_m=high)
    (finding,) = fence_left(fenced, risen)
    assert (finding.severity, finding.location) == ("error", ("fence",))
    assert "in the rehearsal, from 0 s on, 'f1' flies 160 m above the origin" in finding.message
    # Only the first path is that low.
    high_path = Arrangement(number=1, time_s=1.9, across_s=0.0, places=(), path="high")
    shapes = {"high": fenced.path.model_copy(), "main": fenced.path}

    def on_path(one: Mission, name: str) -> Mission:
        fence = Fence(max_height_m=150) if name == "main" else None
        return one.model_copy(update={"path": shapes[name], "fence": fence})

    monkeypatch.setattr(prediction, "timetable", lambda _: [(high_path, None)])
    monkeypatch.setattr(prediction, "on_path", on_path)
    assert not [*fence_left(fenced, risen)]


@pytest.mark.parametrize("plant", ["heading-hold", "course-hold", "bank", "npfg", "six-dof"])
def test_all_begin_at_the_climb_rate_of_the_leader(plant):
    start = {"leader": {"north_m": 0, "east_m": 0, "climb_m_s": 2.0}}
    rehearsal = {"start": start, "emulator": {"plant": plant}}
    for name in ("leader", "f1"):
        emulator = emulator_of(replaced("line-calm", rehearsal=rehearsal), name)
        before = emulator.truth().altitude_amsl_m
        emulator.advance(0.2)
        # 0.4 m, and a little less: its loiter is at the height at which it begins.
        assert emulator.truth().altitude_amsl_m - before == pytest.approx(0.4, abs=0.1)


SLOT = Point(-20.0, 20.0, 5.0)
FORMATION = Formation(leader="leader", home={"f1": SLOT, "f3": SLOT}, slots={"f1": SLOT})
PLACES = tuple(SlotMove(vehicle=name, begin=SLOT, end=SLOT) for name in ("f1", "f3"))
ORDER = Arrangement(number=1, time_s=8.0, across_s=0.0, places=PLACES)
EAST = LeaderPlace(north=100.0, east=50.0, course=math.pi / 2.0)


def test_one_that_joins_begins_where_it_is_or_behind_its_slot_and_not_far_away():
    here = {"f3": LeaderPlace(north=70.0, east=0.0, course=-math.pi / 2.0)}
    (start,) = starts_of_joining(FORMATION, ORDER, EAST, here).values()
    # 50 m behind the leader and 30 m right of it, as it flies east.
    assert (start.forward_m, start.right_m) == pytest.approx((-30.0, 10.0))
    assert start.course_deg == pytest.approx(270.0)
    (start,) = starts_of_joining(FORMATION, ORDER, EAST, {}).values()
    assert (start.forward_m, start.right_m, start.course_deg) == (-BEHIND_M, 0.0, None)
    far = {"f3": LeaderPlace(north=100.0, east=30e3, course=0.0)}
    with pytest.raises(RefusedOrderError, match="f3 is 30 km from the leader: bring it nearer"):
        starts_of_joining(FORMATION, ORDER, EAST, far)


@pytest.mark.parametrize(("height", "up_m"), [(345.0, 40.0), (math.nan, 0.0)])
def test_one_that_joins_begins_at_its_own_height_where_that_is_known(height, up_m):
    leader = LeaderPlace(0.0, 0.0, 0.0, height=300.0, climb_rate=0.0)
    here = {"f3": LeaderPlace(-100.0, 0.0, 0.0, height=height)}
    (start,) = starts_of_joining(FORMATION, ORDER, leader, here).values()
    assert start.up_m == pytest.approx(up_m)
    assert math.isfinite(start.forward_m)


MISSION = shipped("circle-wind")
FLYING = Snapshot(mode=Mode.TRACKING, setpoint=None, lyapunov=math.nan)


def truth(**values: float) -> sitl_stub.Truth:
    origin = MISSION.origin
    place = {"latitude_deg": origin.latitude_deg, "longitude_deg": origin.longitude_deg}
    numbers = dict.fromkeys(sitl_stub.Truth.__struct_fields__, 1.0)
    return sitl_stub.Truth(**numbers | place | values | {"mode": "GUIDED", "armed": True})


def test_a_record_has_the_true_states_and_what_the_companion_did_in_the_order_of_the_samples():
    recorder = VehicleRecorder(MISSION, "f1")
    waiting = Snapshot(mode=Mode.WAITING, setpoint=None, lyapunov=math.nan)
    setpoint = Setpoint(course=0.5, speed=21.0, turn_limited=True)
    recorder.sample(truth(bank_rad=0.25), waiting)
    recorder.sample(truth(bank_rad=0.75), replace(FLYING, setpoint=setpoint, lyapunov=2.5))
    record = recorder.record()
    assert record.bank_rad.tolist() == [0.25, 0.75]
    # At the origin, but for what a float leaves of the ellipsoid.
    assert abs(record.north_m).max() < 1e-6
    assert record.mode.tolist() == [list(Mode).index(one) for one in (Mode.WAITING, Mode.TRACKING)]
    assert record.limited.tolist() == [False, True]
    assert np.array_equal(record.course_setpoint_rad, [np.nan, 0.5], equal_nan=True)
    assert record.airspeed_setpoint_m_s[1] == 21.0
    assert record.lyapunov[1] == 2.5


def test_who_has_left_has_no_slot_meanwhile_and_a_leader_that_holds_is_beside_no_path():
    recorder = VehicleRecorder(MISSION, "f1")
    for left in (False, True, False):
        recorder.sample(truth(), replace(FLYING, left=left))
    record = recorder.record()
    assert record.in_formation.tolist() == [True, False, True]
    assert record.slot_forward_series_m[2] == record.slot_forward_m
    recorder = VehicleRecorder(MISSION, "leader")
    for snapshot in (FLYING, replace(FLYING, path=None)):
        recorder.sample(truth(course_rad=0.0), snapshot)
    assert np.isfinite(recorder.record().path_cross_track_error_m).tolist() == [True, False]


def test_rally_points_of_a_plan_are_drawn():
    mission = shipped("survey-plan")
    recorder = VehicleRecorder(mission, mission.leader.vehicle)
    recorder.sample(truth(), FLYING)
    outlines = drawn_outlines(mission, recorder.record())
    (points,) = [one for one in outlines if one.kind == "rally"]
    north, east = rally_points(mission)
    assert points.north_m.tolist() == north.tolist()
    assert points.east_m.tolist() == east.tolist()
    assert north.size > 0


def test_who_is_without_a_companion_misses_its_orders_and_keeps_its_pilot(monkeypatch):
    heard: list[bytes] = []
    monkeypatch.setattr(
        Companion, "receive_order", lambda _self, data, *_, **__: heard.append(data[4:])
    )
    losses = [
        {"vehicle": "f1", "what": "companion", "at_s": 5.0, "for_s": 10.0},
        {"vehicle": "f1", "what": "guidance", "at_s": 7.0, "for_s": 4.0},
    ]
    mission = mission_with("line-calm", rehearsal={"losses": losses})
    orders = [(time_s, ORDER_MAGIC + b"%d" % time_s) for time_s in (2, 8, 18)]
    aircraft = Aircraft(mission, "f1", orders=orders)
    modes = []
    for step in range(401):
        aircraft.step(0.05 * step, [])
        modes.append(aircraft.emulator.truth().mode)
    assert heard == [b"2", b"18"]
    before, taken, back = (modes[20 * second] for second in (6, 10, 14))
    assert taken == "LOITER"
    assert back == before
