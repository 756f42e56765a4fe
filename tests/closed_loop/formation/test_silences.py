"""A leader that falls silent, for a while and for good, measured on the emulators' true states."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

import sitl_stub
import vfguide.lab.rehearsal.aircraft
from tests.benchmarks.strays import mission_in_place
from vfguide.companion.traffic import FORGET_S
from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.aircraft import Aircraft, Mail, step_all
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.geometry import pair_separations, slot_error
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

MissionWith = Callable[..., Mission]

MAKES_WAY_M = 8.0
"""How far a follower leaves its slot to keep clear of where a leader without a companion would fly by now,
and of where it was last heard."""

BACK_S = 5.0 + FORGET_S + 2.0
"""After `SETTLED_S`: a leader that is silent from 5 s on is not looked for any more, and all are back."""

SETTLED_S = 25.0
"""From here on every follower is in its slot: they start there."""


@dataclass(slots=True)
class Silence:
    """A formation whose followers hear their leader but for some time."""

    mission: Mission
    begins_s: float
    ends_s: float
    formation: list[Aircraft] = field(init=False)
    times: list[float] = field(default_factory=list)
    mail: list[Mail] = field(default_factory=list)
    """What the followers have published, heard by the others a step later."""

    def __post_init__(self) -> None:
        names = [self.mission.leader.vehicle, *self.mission.followers_by_name]
        self.formation = [Aircraft(self.mission, name) for name in names]

    def fly(self, until_s: float) -> FlightRecord:
        """Fly on; what has happened so far."""
        leader, *followers = self.formation
        while len(self.times) / self.mission.rehearsal.rate_hz <= until_s:
            now = len(self.times) / self.mission.rehearsal.rate_hz
            published = leader.step(now, [])
            mail = [] if self.begins_s < now < self.ends_s else published
            self.mail = step_all(followers, now, [*mail, *self.mail])
            self.times.append(now)
        records = [aircraft.recorder.record() for aircraft in self.formation]
        return flight_record(self.mission, self.times, records, wall_s=0.0)


def in_place(mission: Mission) -> Mission:
    """The mission with everybody in the slot at the beginning."""
    start = mission_in_place(mission.name).rehearsal.start
    return mission.model_copy(
        update={"rehearsal": mission.rehearsal.model_copy(update={"start": start})}
    )


def formation_errors(record: FlightRecord, from_s: float) -> FloatArray:
    """Distances of the followers from their slots, m."""
    late = record.time_s >= from_s
    return np.array([slot_error(record.leader, one).distance_m[late] for one in record.followers])


def separations(record: FlightRecord, names: set[str], from_s: float = 0.0) -> FloatArray:
    """Distances of these vehicles from each other, m."""
    late = record.time_s >= from_s
    return np.array(
        [
            pair.distance_m[late]
            for pair in pair_separations(record)
            if {pair.first, pair.second} <= names
        ]
    )


@pytest.fixture
def emulators(monkeypatch: pytest.MonkeyPatch) -> dict[str, sitl_stub.Autopilot]:
    """The emulated autopilots of the aircraft that are made, by name."""
    made: dict[str, sitl_stub.Autopilot] = {}

    def note(mission: Mission, name: str) -> sitl_stub.Autopilot:
        return made.setdefault(name, emulator_of(mission, name))

    monkeypatch.setattr(vfguide.lab.rehearsal.aircraft, "emulator_of", note)
    return made


@pytest.mark.parametrize("length_s", [5.0, 20.0])
@pytest.mark.parametrize("name", ["line-wind", "circle-wind"])
def test_formation_is_kept_while_the_leader_is_silent(
    name: str, length_s: float, mission_with: MissionWith
) -> None:
    ends_s = SETTLED_S + 5.0 + length_s
    silence = Silence(in_place(mission_with(name)), SETTLED_S + 5.0, ends_s)
    record = silence.fly(ends_s + 15.0)
    modes = [record.mode_names[number] for number in record.followers[0].mode]
    assert modes[int((ends_s - 0.5) * record.rate_hz)] == "predicting"
    assert modes[-1] == "tracking"
    errors = formation_errors(record, SETTLED_S)
    assert errors.max() < MAKES_WAY_M
    back = round(min(BACK_S, 5.0 + length_s + 10.0) * record.rate_hz)
    assert errors[:, back:].max() < 1.0
    everybody = {vehicle.name for vehicle in record.vehicles}
    assert separations(record, everybody).min() >= 5.0


@pytest.mark.parametrize("name", ["line-wind", "circle-wind"])
def test_a_formation_whose_leader_is_lost_for_good_comes_apart(
    name: str, mission_with: MissionWith, emulators: dict[str, sitl_stub.Autopilot]
) -> None:
    patience = {"prediction_s": 5.0, "breakaway_s": 12.0}
    silence = Silence(in_place(mission_with(name, patience=patience)), SETTLED_S, 1e9)
    lost_s = SETTLED_S + 5.0 + 12.0
    silence.fly(lost_s - 0.5)
    followers = set(silence.mission.followers_by_name)
    assert {emulators[one].truth().mode for one in followers} == {"GUIDED"}
    silence.fly(lost_s + 2.0)
    assert {emulators[one].truth().mode for one in followers} == {"LOITER"}
    record = silence.fly(lost_s + 32.0)
    assert {emulators[one].truth().mode for one in followers} == {"LOITER"}
    for follower in record.followers:
        flown = [record.mode_names[number] for number in dict.fromkeys(follower.mode)]
        assert "tracking" in flown[:-3]
        assert flown[-3:] == ["predicting", "breakaway", "lost"]
    assert separations(record, followers).min() >= 5.0
