"""Flying from Python: a mission in, a flight with its figures and its data as NumPy arrays out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

from vfguide.bench.spread import executor_on, flown_by
from vfguide.commands.fly import keep
from vfguide.commands.output import kept_in
from vfguide.commands.overrides import Overrides, apply_overrides, place_of
from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.laws.base import Law
from vfguide.mission.feasibility import check_mission
from vfguide.mission.load import load_mission as load_file
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord
from vfguide.registry import laws as known_laws
from vfguide.rehearsal import lockstep
from vfguide.report.geometry import SlotError, slot_error
from vfguide.report.metrics import summarise
from vfguide.report.summary import Summary


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """A flight that was flown in virtual time.

    Frame: metres north and east of the mission's origin, angles in radians clockwise from north, speeds in
    m/s.
    """

    flown: lockstep.Flight
    """What the rehearsal brought home: record, events of the companions, telemetry logs."""

    @property
    def record(self) -> FlightRecord:
        """Everything that was recorded."""
        return self.flown.record

    @property
    def time_s(self) -> FloatArray:
        """N times of the samples, s from the beginning."""
        return self.record.time_s

    @cached_property
    def summary(self) -> Summary:
        """The flight in figures, such as `summary.formation.mean_error_m`."""
        return summarise(self.record)

    @cached_property
    def tracks(self) -> Mapping[str, VehicleRecord]:
        """What each vehicle did, by name, the leader first: `tracks["f1"].north_m` has N entries."""
        return {one.name: one for one in self.record.vehicles}

    @cached_property
    def errors(self) -> Mapping[str, SlotError]:
        """Where each follower's slot was, by name: `errors["f1"].distance_m` has N entries, m."""
        return {one.name: slot_error(self.record.leader, one) for one in self.record.followers}

    def report(self, directory: str | Path, *, force: bool = False) -> None:
        """Write summary, report, record and plots, as `vfguide fly --out` does.

        Args:
            directory: made if need be; an earlier flight of this mission in it is replaced.
            force: whether what another flight or program wrote there may be replaced.

        Raises:
            InputError: it cannot be written to, or holds something else.
        """
        names = list(self.tracks)
        with kept_in(
            Path(directory), mission=self.record.mission, vehicles=names, force=force
        ) as partial:
            keep(self.flown, self.summary, partial)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One flight of a comparison."""

    law: str
    """By which followers kept their slots."""
    seed: int
    """Of everything random."""
    summary: Summary
    """What the flight came to."""


def load_mission(file: str | Path) -> Mission:
    """Read a mission file.

    Raises:
        InputError: it cannot be read, or is no mission; lists every fault that was found.
    """
    return load_file(Path(file))


def fly(
    mission: Mission,
    *,
    law: str | type[Law] | None = None,
    settings: Mapping[str, object] | None = None,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int | None = None,
    processes: int = 1,
) -> Flight:
    """Fly a mission in virtual time; the same seed gives the same flight, to the last bit.

    Args:
        mission: what to fly.
        law: its name, or its class, instead of the mission's `controller.type`.
        settings: values instead of those of any fields, such as `{"controller.k_x": 0.3}`.
        duration_s: length of the flight, s, instead of the mission's.
        rate_hz: guidance steps per second instead of the mission's.
        seed: of everything random instead of the mission's.
        processes: to spread the vehicles over. More than one imports the program that calls this again, whose
            own code then has to stand under `if __name__ == "__main__":`.

    Raises:
        InputError: a value is out of its range, a name is not known, or the mission cannot be flown.
    """
    overrides = Overrides(
        controller=None if law is None else name_of(law),
        settings=tuple((place_of(field), value) for field, value in (settings or {}).items()),
        duration_s=duration_s,
        rate_hz=rate_hz,
        seed=seed,
    )
    changed = apply_overrides(mission, overrides)
    impossible = [str(one) for one in check_mission(changed) if one.severity == "error"]
    if impossible:
        raise InputError("\n".join(impossible))
    return Flight(flown=lockstep.fly_lockstep(changed, processes=processes))


def compare(
    mission: Mission,
    *,
    laws: Iterable[str | type[Law]],
    seeds: Iterable[int] = (1,),
    duration_s: float | None = None,
    processes: int = 1,
) -> list[Comparison]:
    """Fly a mission by several laws, each with the same seeds.

    Args:
        mission: what to fly.
        laws: their names or classes.
        seeds: of everything random, a flight each.
        duration_s: length of the flights, s, instead of the mission's.
        processes: to spread the flights over; see `fly`.

    Returns:
        The flights, law by law, in the order of the seeds.

    Raises:
        InputError: as `fly`.
    """
    names = [name_of(one) for one in laws]
    tasks = [
        {"mission": mission, "law": law, "seed": seed, "duration_s": duration_s}
        for law, seed in product(names, seeds)
    ]
    if processes == 1:
        return [fly_one(task) for task in tasks]
    with executor_on(processes=processes) as executor:
        return list(flown_by(executor, fly_one, tasks))


def name_of(law: str | type[Law]) -> str:
    """The name of a law that is given by its name or its class.

    Raises:
        InputError: there is no law of this name, or the class has none.
    """
    if isinstance(law, str):
        return str(known_laws.find(law).name)
    if not hasattr(law, "name"):
        raise InputError(f'{law.__name__}: the law has no name; put @law("name") above its class')
    return law.name


def fly_one(task: Mapping[str, Any]) -> Comparison:
    """One flight of a comparison."""
    return Comparison(law=task["law"], seed=task["seed"], summary=fly(**task).summary)
