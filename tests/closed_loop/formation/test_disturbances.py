"""A bad link, a pilot, a silent autopilot and rubbish on the link, measured on the emulators' true states."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import sitl_stub
import vfguide.lab.rehearsal.aircraft
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.role import Outgoing, Snapshot
from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.aircraft import Aircraft, Mail, step_all
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.geometry import pair_separations, slot_error
from vfguide.link.codec import decode, encode
from vfguide.link.memory import LinkQuality, MemoryLink
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.tlog import TelemetryLog

MissionWith = Callable[..., Mission]

IN_PLACE = {
    "leader": {"north_m": 0, "east_m": 0, "course_deg": 270},
    **{name: {} for name in ("f1", "f2", "f3")},
}
"""A start on the path of the circle, and everyone in the slot."""

SETTLED_S = 20.0
"""From here on everyone who started like that has settled."""

RECOVERY_S = 30.0
"""From the end of a disturbance until everyone is within 1 m of the slot, and stays."""

GUIDED, LOITER = 15, 12
CHANGE_SPEED, CHANGE_HEADING = 43000, 43002


class Disturbed:
    """An emulated autopilot, and what happens between it and its companion."""

    def __init__(self, autopilot: sitl_stub.Autopilot) -> None:
        self.autopilot = autopilot
        self.silent = False
        """Whether nothing that it sends arrives."""
        self.setpoints = 0
        """Courses and speeds that it was sent."""
        self._answers = b""

    def advance(self, to_s: float) -> bytes:
        answers, self._answers = self._answers, b""
        return self._heard(answers + self.autopilot.advance(to_s))

    def receive(self, data: bytes) -> bytes:
        for message in mavlink.MAVLink(None).parse_buffer(data) or []:
            command = getattr(message, "command", None)
            self.setpoints += command in {CHANGE_SPEED, CHANGE_HEADING}
        return self._heard(self.autopilot.receive(data))

    def truth(self) -> sitl_stub.Truth:
        return self.autopilot.truth()

    def select(self, mode: int) -> None:
        """What the pilot does with a switch; whoever listens hears of the new mode."""
        order = mavlink.MAVLink_command_long_message(
            self.autopilot.system_id, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, mode, 0, 0, 0, 0, 0
        )
        self._answers += self.autopilot.receive(order.pack(mavlink.MAVLink(None, srcSystem=255)))

    def _heard(self, data: bytes) -> bytes:
        return b"" if self.silent else data


class Dead:
    """A companion that is no more."""

    def __init__(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot

    def receive_link(self, data: bytes, now: float) -> None:
        del data, now

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        del vehicle, data, now

    def receive_mavlink(self, data: bytes, now: float) -> Outgoing:
        del data, now
        return Outgoing()


@dataclass(slots=True)
class Formation:
    """Aircraft in virtual time, with access to what is between them."""

    mission: Mission
    logged: bool = False
    inject: Callable[[list[bytes]], list[bytes]] = list
    """What followers get to hear for what the leader publishes."""
    emulators: dict[str, Disturbed] = field(default_factory=dict)
    links: list[MemoryLink] = field(default_factory=list)
    companions: list[Companion] = field(default_factory=list)
    aircraft: list[Aircraft] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    mail: list[Mail] = field(default_factory=list)
    """What the followers have published, heard by the others a step later."""

    def launch(self, patch: pytest.MonkeyPatch) -> None:
        def emulator(mission: Mission, name: str) -> Disturbed:
            return self.emulators.setdefault(name, Disturbed(emulator_of(mission, name)))

        def link(quality: LinkQuality, seeds: dict[str, str]) -> MemoryLink:
            self.links.append(MemoryLink(quality, seeds))
            return self.links[-1]

        def companion(*arguments: object, **options: object) -> Companion:
            self.companions.append(Companion(*arguments, **options))
            return self.companions[-1]

        with patch.context() as patched:
            patched.setattr(vfguide.lab.rehearsal.aircraft, "emulator_of", emulator)
            patched.setattr(vfguide.lab.rehearsal.aircraft, "MemoryLink", link)
            patched.setattr(vfguide.lab.rehearsal.aircraft, "Companion", companion)
            for name in [self.mission.leader.vehicle, *self.mission.followers_by_name]:
                log = TelemetryLog(1.7e9) if self.logged else None
                self.aircraft.append(Aircraft(self.mission, name, log=log))

    def kill(self, name: str) -> None:
        """End a companion without a last word."""
        (aircraft,) = (one for one in self.aircraft if one.name == name)
        aircraft.companion = Dead(aircraft.companion.snapshot)

    def restart(self, name: str) -> None:
        """Start a companion that knows nothing of the one before."""
        (aircraft,) = (one for one in self.aircraft if one.name == name)
        vehicle = self.mission.vehicles[name]
        plan = flight_plan(self.mission, name)
        aircraft.companion = Companion(plan, adapter_of(vehicle), engage=True)

    def fly(self, until_s: float) -> FlightRecord:
        """Fly on; what has happened so far."""
        leader, *followers = self.aircraft
        rate_hz = self.mission.rehearsal.rate_hz
        while (now := len(self.times) / rate_hz) <= until_s:
            led = self.inject([data for _, data in leader.step(now, [])])
            self.mail = step_all(followers, now, [*((leader.name, one) for one in led), *self.mail])
            self.times.append(now)
        records = [aircraft.recorder.record() for aircraft in self.aircraft]
        return flight_record(self.mission, self.times, records, wall_s=0.0)


Launched = Callable[..., Formation]


@pytest.fixture
def launched(mission_with: MissionWith, monkeypatch: pytest.MonkeyPatch) -> Launched:
    """Launches the formation of the article's circle in wind, everyone in place."""

    def launch(**options: object) -> Formation:
        formation = Formation(mission_with("circle-wind", rehearsal={"start": IN_PLACE}), **options)
        formation.launch(monkeypatch)
        return formation

    return launch


def errors(record: FlightRecord, from_s: float, to_s: float = np.inf) -> FloatArray:
    """Distances of the followers from their slots, m."""
    when = (record.time_s >= from_s) & (record.time_s <= to_s)
    return np.array([slot_error(record.leader, one).distance_m[when] for one in record.followers])


def least_separation(record: FlightRecord) -> float:
    return min(float(pair.distance_m.min()) for pair in pair_separations(record))


def test_formation_is_kept_over_a_bad_link(launched: Launched) -> None:
    formation = launched()
    formation.fly(SETTLED_S)
    good = formation.links[0].quality
    for link in formation.links:
        link.quality = replace(good, delay_s=0.3, loss=0.3)
    formation.fly(SETTLED_S + 60.0)
    for link in formation.links:
        link.quality = good
    record = formation.fly(SETTLED_S + 60.0 + RECOVERY_S)
    assert errors(record, SETTLED_S).max() < 1.0
    assert least_separation(record) >= 5.0


@pytest.mark.parametrize(("name", "length_s"), [("f1", 5.0), ("f2", 10.0), ("f3", 5.0)])
def test_a_follower_that_its_pilot_borrows_comes_back(
    name: str, length_s: float, launched: Launched
) -> None:
    returned_s = SETTLED_S + length_s
    formation = launched()
    formation.fly(SETTLED_S)
    borrowed = formation.emulators[name]
    borrowed.select(LOITER)
    before = borrowed.setpoints
    formation.fly(returned_s)
    assert borrowed.setpoints == before > 0
    assert borrowed.truth().mode == "LOITER"
    borrowed.select(GUIDED)
    record = formation.fly(returned_s + RECOVERY_S + 10.0)
    assert borrowed.setpoints > before
    assert errors(record, SETTLED_S, returned_s).max() > 10.0
    assert errors(record, returned_s + RECOVERY_S).max() < 1.0
    assert least_separation(record) >= 5.0


@pytest.mark.parametrize("name", ["f1", "f2", "f3"])
def test_a_follower_whose_companion_was_dead_comes_back_clear_of_the_others(
    name: str, launched: Launched
) -> None:
    # The autopilot holds the last course that it was given: on a circle that leads through the others' slots.
    restarted_s = SETTLED_S + 4.0
    formation = launched()
    formation.fly(SETTLED_S)
    formation.kill(name)
    before = formation.emulators[name].setpoints
    formation.fly(restarted_s)
    assert formation.emulators[name].setpoints == before > 0
    formation.restart(name)
    record = formation.fly(restarted_s + RECOVERY_S + 10.0)
    assert errors(record, SETTLED_S, restarted_s + 5.0).max() > 10.0
    assert errors(record, restarted_s + RECOVERY_S).max() < 1.0
    assert least_separation(record) >= 5.0


def test_two_that_come_back_at_once_keep_clear_of_a_third_whose_companion_is_dead(
    launched: Launched,
) -> None:
    formation = launched()
    formation.fly(SETTLED_S)
    for name in ("f1", "f3"):
        formation.emulators[name].select(LOITER)
    formation.fly(SETTLED_S + 5.0)
    formation.kill("f2")
    formation.fly(SETTLED_S + 8.0)
    for name in ("f1", "f3"):
        formation.emulators[name].select(GUIDED)
    formation.fly(SETTLED_S + 12.0)
    formation.restart("f2")
    # Those who went round have more than 100 m to make up, at 8 m/s.
    record = formation.fly(SETTLED_S + 12.0 + RECOVERY_S + 20.0)
    assert errors(record, SETTLED_S, SETTLED_S + 20.0).max() > 100.0
    assert errors(record, SETTLED_S + 12.0 + RECOVERY_S + 10.0).max() < 1.0
    assert least_separation(record) >= 5.0


def test_formation_outlives_a_leader_without_telemetry(launched: Launched) -> None:
    formation = launched()
    formation.fly(SETTLED_S)
    leader = formation.emulators["leader"]
    leader.silent, before = True, leader.setpoints
    formation.fly(SETTLED_S + 3.0)
    assert leader.setpoints == before > 0
    leader.silent = False
    record = formation.fly(SETTLED_S + 3.0 + RECOVERY_S + 10.0)
    followed = [record.mode_names[number] for number in dict.fromkeys(record.followers[0].mode)]
    assert "predicting" in followed
    assert errors(record, SETTLED_S + 3.0 + RECOVERY_S).max() < 1.0
    assert least_separation(record) >= 5.0


def rubbish(random: Random, published: Sequence[bytes]) -> list[bytes]:
    """The leader's states, each followed by what must not be mistaken for one."""
    heard: list[bytes] = []
    for data in published:
        state = decode(data)
        place = random.randrange(len(data))
        damaged = data[:place] + bytes([data[place] ^ 1 << random.randrange(8)]) + data[place + 1 :]
        heard += [
            data,
            data,
            random.randbytes(random.randrange(200)),
            random.randbytes(len(data)),
            data[: random.randrange(len(data))],
            damaged,
            encode(replace(state, time_s=state.time_s + 10.0, course=state.course + 1.0)),
            encode(replace(state, time_s=state.time_s - 1e4)),
            encode(replace(state, time_s=np.inf)),
            encode(replace(state, ground_speed=np.nan)),
        ]
    return heard


def test_rubbish_on_the_link_changes_nothing_but_counters(
    launched: Launched, tmp_path: Path
) -> None:
    random = Random(7)

    def flown(**options: object) -> tuple[dict[str, bytes], Counter[str]]:
        formation = launched(logged=True, **options)
        formation.fly(20.0)
        content, counters = {}, Counter[str]()
        for aircraft in formation.aircraft:
            aircraft.log.write(tmp_path / "log.tlog")
            content[aircraft.name] = (tmp_path / "log.tlog").read_bytes()
        for companion in formation.companions:
            counters += companion.counters
        return content, counters

    clean, nothing = flown()
    disturbed, counters = flown(inject=lambda published: rubbish(random, published))
    assert disturbed == clean
    assert all(len(content) > 50_000 for content in clean.values())
    counted = counters - nothing
    reasons = {"from the future", "not newer", "too old"}
    assert set(counted) == {"malformed", *reasons}
    # Three followers, 400 states.
    assert counted["malformed"] >= 6 * 3 * 390
    assert all(counted[reason] >= 3 * 390 for reason in reasons)
