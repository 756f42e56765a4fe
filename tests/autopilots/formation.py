"""A formation of real autopilots in software: started, taken off, given to companions, disturbed, judged."""

import json
import shutil
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tests.autopilots.faults import Occurrence
from tests.autopilots.ground_station import GroundStation
from tests.autopilots.programs import FlightError, Program, broker, first_in_line, vfguide
from tests.autopilots.relay import Relay
from tests.autopilots.simulators import (
    CLIMB_S,
    ENOUGH_M,
    Aircraft,
    ArduPlane,
    Conditions,
    Px4,
    Simulator,
    free_instances,
)
from tests.autopilots.true_tracks import STEP_S, true_track
from tests.autopilots.verdict import Verdict, flight_record, judge
from tests.kit.missions import content_of
from vfguide.companion.clock import Clock
from vfguide.companion.mission_plan import local_frame
from vfguide.lab.rehearsal.processes import free_port
from vfguide.link.keys import key_places, make_keys
from vfguide.mission import Mission
from vfguide.mission.load import parse_mission
from vfguide.record.guidance_log import SUFFIX, read_guidance
from vfguide.record.recording import parts_of

SPACING_M = 110.0
"""From one runway to the next, eastward."""

RECORDED = "recorded"
"""Directory of what companions record."""

TRUE_TRACKS = "true-tracks.npz"
"""File of where everybody truly was, beside what the companions recorded."""

BOOT_S = 90.0
"""Patience with a companion that starts, and with a broker."""


def merged(content: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A mission's content with some fields changed, or removed by null.

    A group that says its type is replaced as a whole.
    """
    result = dict(content)
    for key, value in changes.items():
        old = result.get(key)
        if value is None:
            result.pop(key, None)
        elif isinstance(value, dict) and isinstance(old, dict) and "type" not in value:
            result[key] = merged(old, value)
        else:
            result[key] = value
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is to be flown."""

    mission: Mission
    kind: type[ArduPlane] | type[Px4]
    """Which autopilot."""
    binary: Path
    """Its program."""
    conditions: Conditions
    directory: Path
    """Where everything is kept."""
    mosquitto: str
    """The broker's program."""
    first_instance: int | None = None
    """Of the simulators, which decides their ports; the first free one if None."""
    guided: str = "GUIDED"
    """The mode that pilots select for their companions."""
    engage: bool = False
    """Whether companions are allowed to enter the guided mode by themselves."""
    record: bool = False
    """Whether companions record what they hear and say, and where everybody truly was is kept."""


@dataclass(slots=True)
class Formation:
    """What flies."""

    mission: Mission
    simulators: dict[str, Simulator]
    broker: Program
    companions: dict[str, Program]
    clock: Clock
    """Of the flight."""
    guided: str = "GUIDED"
    """The mode in which an autopilot obeys, by its pilot's word for it."""
    operator: tuple[Path, str] | None = None
    """The mission's file, beside which an operator's key is, and the link's address."""
    orders: list[Program] = field(default_factory=list)
    """Programs by which orders were given."""
    began_s: float = 0.0
    """When the pilots had selected the guided mode, s of the flight's clock."""

    def give(self, vehicle: str) -> None:
        """The pilot of a vehicle gives it to its companion."""
        self.simulators[vehicle].enter(self.guided)

    def order(self, words: str) -> None:
        """An operator gives an order by `vfguide order`; what comes of it is in the program's output."""
        if self.operator is None:
            raise FlightError("nobody can give an order")
        file, link = self.operator
        command = vfguide("order", str(file), *words.split(), "--link", link)
        program = Program(f"order-{len(self.orders) + 1}", command, file.parent)
        self.orders.append(program)
        program.start()

    def check(self) -> None:
        """See that every simulator runs."""
        for simulator in self.simulators.values():
            simulator.program.check()


@contextmanager
def airborne(plan: Plan) -> Iterator[Formation]:
    """Everybody at height and in companions' hands; at the end no program is left."""
    mission, clock = plan.mission, plan.conditions.clock
    names = [mission.leader.vehicle, *mission.followers_by_name]
    first = plan.first_instance
    if first is None:
        first = free_instances(plan.kind, len(names))
    directory = plan.directory
    directory.mkdir(parents=True, exist_ok=True)
    file = directory / "mission.yaml"
    # JSON is YAML.
    file.write_text(json.dumps(content_of(mission, "json")))
    frame = local_frame(mission)
    simulators: dict[str, Simulator] = {}
    for n, name in enumerate(names):
        latitude, longitude = frame.to_geodetic(0.0, SPACING_M * n)
        follower = mission.followers_by_name.get(name)
        up_m = 0.0 if follower is None else follower.slot.up_m
        aircraft = Aircraft(
            name=name,
            system_id=mission.vehicles[name].system_id,
            instance=first + n,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_amsl_m=mission.origin.altitude_amsl_m,
            height_m=mission.height_above_origin_m + up_m,
        )
        simulators[name] = plan.kind(plan.binary, directory / name, aircraft, plan.conditions)
    mosquitto, link = broker(plan.mosquitto, directory)
    make_keys(key_places(file), mission.name, mission.companions)
    hears: dict[str, int] = {}
    relay: Relay | None = None
    if mission.leader.is_foreign:
        hears = {name: free_port(socket.SOCK_DGRAM) for name in mission.companions}
        heard = mission.rehearsal.leader_telemetry
        relay = Relay(
            source_port=simulators[mission.leader.vehicle].tcp_port,
            targets=list(hears.values()),
            system_id=mission.leader_vehicle.system_id,
            rate_hz=heard.rate_hz,
            late_s=heard.delay_s,
        )
    companions = {
        name: Program(
            f"{name}.companion",
            vfguide(
                *("companion", name, "--mission", str(file), "--link", link),
                *("--clock", f"{clock.epoch_s!r},{clock.rate!r}"),
                *("--mavlink", simulators[name].companion_url, "--state", str(directory / "state")),
                *(("--engage",) if plan.engage else ()),
                *((f"--leader=udpin://127.0.0.1:{hears[name]}",) if name in hears else ()),
                *(("--record", str(directory / RECORDED)) if plan.record else ()),
            ),
            directory,
        )
        for name in mission.companions
    }
    formation = Formation(
        mission, simulators, mosquitto, companions, clock, plan.guided, (file, link)
    )
    with first_in_line():
        try:
            mosquitto.start()
            for simulator in simulators.values():
                simulator.program.start()
            at_once([partial(climb, simulator, mission) for simulator in simulators.values()])
            for companion in companions.values():
                companion.start()
            if relay is not None:
                simulators[mission.leader.vehicle].enter("LOITER")
                relay.start()
            at_once([partial(hand_over, name, formation) for name in mission.companions])
            formation.began_s = clock.now()
            yield formation
        finally:
            # At the same time: each companion waits until its autopilot shows that it flies by itself.
            at_once([one.stop for one in (*companions.values(), *formation.orders)])
            if relay is not None:
                relay.stop()
            mosquitto.stop()
            at_once([simulator.close for simulator in simulators.values()])


def at_once(calls: Sequence[Callable[[], None]]) -> None:
    """Do several things at the same time, and wait for all."""
    with ThreadPoolExecutor(len(calls)) as pool:
        for waiting in [pool.submit(call) for call in calls]:
            waiting.result()


def climb(simulator: Simulator, mission: Mission) -> None:
    """Take off, reach the mission's height and meet the wind there."""
    station = simulator.station
    simulator.take_off()
    height = mission.origin.altitude_amsl_m + mission.height_above_origin_m
    station.wait(
        lambda: station.altitude_amsl_m > height - ENOUGH_M, f"not at {height:.0f} m", CLIMB_S
    )
    simulator.meet_wind()


def hand_over(name: str, formation: Formation) -> None:
    """The pilot selects the guided mode once the companion is there."""
    companion, station = formation.companions[name], formation.simulators[name].station
    station.wait(lambda: "connected" in companion.output.read_text(), "no companion", BOOT_S)
    formation.give(name)


def fly(
    plan: Plan, duration_s: float, faults: Sequence[Occurrence] = ()
) -> tuple[Verdict, dict[str, list[tuple[float, int]]]]:
    """Fly a mission for some time from when all pilots have selected the guided mode, and judge it.

    Return the verdict, and each vehicle's changes of mode: s after that, and the number.
    """
    with airborne(plan) as formation:
        pass_time(formation, duration_s, faults)
    time_s = np.arange(formation.began_s, formation.began_s + duration_s, STEP_S)
    modes = {
        name: changes_of(simulator.station, formation.began_s, duration_s)
        for name, simulator in formation.simulators.items()
    }
    return conclude(plan, formation, time_s, faults), modes


def changes_of(
    station: GroundStation, began_s: float, duration_s: float
) -> list[tuple[float, int]]:
    """Changes of mode (s after the beginning, number) up to the end, before companions were told to stop."""
    changes = ((change.time_s - began_s, change.custom_mode) for change in station.modes)
    return [(time_s, mode) for time_s, mode in changes if time_s <= duration_s]


def pass_time(formation: Formation, duration_s: float, faults: Sequence[Occurrence]) -> None:
    """Let the time of a flight pass, and do what is to be done in it."""
    steps = [(one.began_s + after_s, act) for one in faults for after_s, act in one.fault.steps]
    due = sorted(steps, key=lambda step: step[0])
    while (now_s := formation.clock.now() - formation.began_s) < duration_s + 0.5:
        while due and now_s >= due[0][0]:
            _, act = due.pop(0)
            act(formation)
        formation.check()
        time.sleep(0.05)


def conclude(
    plan: Plan, formation: Formation, time_s: np.ndarray, faults: Sequence[Occurrence]
) -> Verdict:
    """The verdict on a flight at the times of the flight's clock (N)."""
    mission = formation.mission
    frame = local_frame(mission)
    tracks = {
        name: true_track(simulator.station, frame, time_s, has_own_pace=simulator.has_own_pace)
        for name, simulator in formation.simulators.items()
    }
    guidance = {
        name: read_guidance(
            *parts_of(plan.directory / RECORDED, name, SUFFIX), zero_s=formation.began_s
        )
        for name in (mission.companions if plan.record else ())
    }
    record = flight_record(mission, time_s, tracks, guidance)
    if plan.record:
        began = f"Time 0 is {formation.began_s:.3f} s of the companions' clock."
        replace(record, notes=(began,)).save(plan.directory / TRUE_TRACKS)
    return judge(record, tracks, faults, guidance)


@contextmanager
def flight_directory(keep: Path | None) -> Iterator[Path]:
    """A directory for a flight; one that nobody asked for goes with a flight that succeeds."""
    directory = keep or Path(tempfile.mkdtemp(prefix="vfguide-sitl-"))
    try:
        yield directory
    except FlightError as error:
        raise FlightError(f"{error}; what the programs said is in {directory}") from error
    if keep is None:
        shutil.rmtree(directory, ignore_errors=True)


def load(file: Path, changes: Mapping[str, Any]) -> Mission:
    """A mission with some fields changed; those under `vehicles.defaults` in every vehicle."""
    mission = parse_mission(file.read_bytes(), file=str(file)).mission
    content = content_of(mission, "json")
    vehicles = dict(changes.get("vehicles", {}))
    common = {"vehicles": dict.fromkeys(mission.vehicles, vehicles.pop("defaults", {}))}
    changed = merged(merged(content, common), {**changes, "vehicles": vehicles})
    return parse_mission(json.dumps(changed).encode(), file=f"{file} with changes").mission
