"""Python interface for flying missions: figures and data of a flight as NumPy arrays."""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import TYPE_CHECKING, Any, get_args, overload

from vfguide.commands.credentials import KeyFiles, watched_formation
from vfguide.commands.fly import keep
from vfguide.commands.order import order_of
from vfguide.commands.output import kept_in
from vfguide.elementwise import FloatArray
from vfguide.errors import (
    LEARNING,
    PLOTTING,
    POSIX,
    InputError,
    described_error,
    import_extra,
    require,
)
from vfguide.lab.export.columns import parts_of
from vfguide.lab.ordering import OrderOutcome, give_order
from vfguide.lab.rehearsal import lockstep
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.figures import SlotError, slot_error
from vfguide.lab.report.metrics import Summary, summarise
from vfguide.lab.studies.flown import executor_on, flown_by
from vfguide.laws.base import Law
from vfguide.laws.vectors import ActionKind
from vfguide.mission.feasibility import check_mission
from vfguide.mission.load import load_mission as load_file
from vfguide.mission.load import with_overrides
from vfguide.mission.model import Mission
from vfguide.mission.overrides import Overrides, place_of
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord
from vfguide.registry import laws as known_laws
from vfguide.system import run_watching_sockets

if TYPE_CHECKING:
    from vfguide.lab.environment import FollowerEnvironment, FormationEnvironment, Reward


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """A completed flight.

    Frame: metres north and east of the mission's origin, angles in radians clockwise from north, speeds in
    m/s.
    """

    flown: lockstep.LockstepFlight
    """Results of the rehearsal: record, events of the companions, telemetry logs."""

    @property
    def record(self) -> FlightRecord:
        """Record of the flight."""
        return self.flown.record

    @property
    def time_s(self) -> FloatArray:
        """N sample times, s from the beginning."""
        return self.record.time_s

    @cached_property
    def summary(self) -> Summary:
        """Figures of the flight, such as `summary.formation.mean_error_m`."""
        return summarise(self.record)

    @cached_property
    def tracks(self) -> Mapping[str, VehicleRecord]:
        """Record of each vehicle by name, the leader first: `tracks["f1"].north_m` has N entries."""
        return {one.name: one for one in self.record.vehicles}

    @cached_property
    def errors(self) -> Mapping[str, SlotError]:
        """Slot error of each follower by name: `errors["f1"].distance_m` has N entries, m."""
        return {one.name: slot_error(self.record.reference, one) for one in self.record.followers}

    def to_dataframe(self) -> Any:  # noqa: ANN401 - pandas has no types of its own
        """Return all samples of all vehicles as a `pandas.DataFrame`.

        The columns are those of the CSV export, with angles in degrees. Each sample and vehicle has one row,
        ordered by part of the time, then vehicle, the leader first.

        Raises:
            ImportError: pandas is not installed.
        """
        pandas = import_extra("pandas")
        return pandas.concat(
            [
                pandas.DataFrame(
                    {
                        "time_s": part.time_s,
                        "vehicle": part.vehicle.name,
                        "role": part.vehicle.role,
                        **part.numbers,
                        "mode": part.modes,
                        "limited": part.limited,
                    }
                )
                for part in parts_of(self.record)
            ],
            ignore_index=True,
        )

    def report(self, directory: str | Path, *, force: bool = False) -> None:
        """Write summary, report, record and plots, like `vfguide fly --out`.

        Args:
            directory: created if missing; an earlier flight of this mission in it is replaced.
            force: whether to replace files of another flight or program.

        Raises:
            InputError: the directory cannot be written to, or holds other files.
            ImportError: the plotting libraries are not installed.
        """
        require(*PLOTTING)
        names = list(self.tracks)
        with kept_in(
            Path(directory), mission=self.record.mission, vehicles=names, force=force
        ) as partial:
            keep(self.flown, self.summary, partial)


Metric = Callable[[Flight], float]
"""User-defined figure of a flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One flight of a comparison."""

    law: str
    """Name of the law that followers flew by."""
    seed: int
    """Seed of all random processes."""
    settings: Mapping[str, object]
    """Values that replaced fields of the mission."""
    summary: Summary
    metrics: Mapping[str, float]
    """User-defined figures, by the names of their functions."""

    def row(self) -> dict[str, object]:
        """Return the flight as a table row, as for `pandas.DataFrame([one.row() for one in found])`."""
        formation = self.summary.formation
        figures = {
            "mean_error_m": formation.mean_error_m,
            "p95_error_m": formation.p95_error_m,
            "max_error_m": formation.max_error_m,
            "intended_error_m": formation.intended_error_m,
            "settle_1m_s": formation.settle_1m_s,
            "min_separation_m": formation.min_separation_m,
        }
        return {"law": self.law, "seed": self.seed, **self.settings, **figures, **self.metrics}


def load_mission(file: str | Path) -> Mission:
    """Read a mission file.

    Raises:
        InputError: the file cannot be read, or is no mission; lists every fault found.
    """
    return load_file(Path(file))


def order(
    mission: Mission,
    what: str,
    *,
    links: Sequence[str],
    spacing: float | None = None,
    keys: str | Path | None = None,
    dry_run: bool = False,
    tell: Callable[[str], None] = print,
) -> OrderOutcome:
    """Order a change of a formation in the air, like `vfguide order`.

    Args:
        mission: mission of the formation.
        what: order as on the command line, such as "vee" or "swap f1 f2".
        links: addresses of the formation's links.
        spacing: distance between neighbours, m.
        keys: mission file beside which the operator's key and the roster are; None for unsigned messages.
        dry_run: whether only to rehearse the order.
        tell: called with a line for each event.

    Raises:
        InputError: an address, a key or the order is wrong, or the order cannot be carried out.
        VfguideError: no link works, or the formation is not heard.
    """
    files = KeyFiles(mission=Path("mission.yaml" if keys is None else keys), insecure=keys is None)
    credentials = files.of_operator()
    watched = watched_formation(mission, links, credentials)
    wanted = order_of(what.split(), spacing)
    return run_watching_sockets(give_order(mission, wanted, watched, tell=tell, dry_run=dry_run))


def fly(
    mission: Mission,
    *,
    law: str | type[Law] | None = None,
    settings: Mapping[str, object] | None = None,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int | None = None,
    processes: int = 1,
    live: bool = False,
    links: Sequence[str] = (),
    speedup: float = 1.0,
) -> Flight:
    """Fly a mission in virtual time, or live.

    In virtual time the same seed gives the same flight, to the last bit. A live flight runs in real time,
    with a process for each program and real sockets between them.

    Args:
        mission: mission to fly.
        law: name or class of a law; replaces the mission's `controller.type`.
        settings: values that replace fields, such as `{"controller.k_x": 0.3}`.
        duration_s: duration of the flight, s; replaces the mission's.
        rate_hz: guidance steps per second; replaces the mission's.
        seed: seed of all random processes; replaces the mission's.
        processes: number of processes for the vehicles. With more than one, each imports the calling program
            again, whose own code then has to stand under `if __name__ == "__main__":`.
        live: whether to fly in real time. A law given as a class has to be in a file that `VFGUIDE_PLUGINS`
            names, or in an installed package.
        links: links of a live flight, such as "mqtt://host:1883", or "mqtt" for a mosquitto of its own; by
            default UDP on this computer.
        speedup: simulated seconds per real second of a live flight, at most 100.

    Raises:
        InputError: a value is out of range, a name is unknown, or the mission cannot be flown.
        VfguideError: a live flight failed: a process ended, or no link works.
        ImportError: the law, or a live flight, needs a library that is not installed; the text names the
            extra that installs it. The exception is also a VfguideError.
    """
    if not 0.0 < speedup <= 100.0:
        raise InputError(f"speedup: {speedup:g} is not above 0 and at most 100")
    changed = flyable(
        mission, law=law, settings=settings, duration_s=duration_s, rate_hz=rate_hz, seed=seed
    )
    if not live:
        return Flight(flown=fly_rehearsal(changed, processes=processes))
    require(POSIX, "psutil")
    from vfguide.commands.fly_live import flown_live

    # A separate thread, since a notebook already has an event loop.
    stopped = Event()
    with TemporaryDirectory() as scratch, ThreadPoolExecutor(max_workers=1) as thread:
        flight = flown_live(
            changed, links, speedup=speedup, directory=Path(scratch), stop=stopped.is_set
        )
        try:
            return Flight(flown=thread.submit(asyncio.run, flight).result())
        finally:
            # After Ctrl-C the processes would otherwise fly on to the end.
            stopped.set()


def flyable(
    mission: Mission,
    *,
    law: str | type[Law] | None = None,
    settings: Mapping[str, object] | None = None,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int | None = None,
) -> Mission:
    """Return a mission with other values that can be flown; arguments as for `fly`.

    Raises:
        InputError: a value is out of range, a name is unknown, or the mission cannot be flown.
    """
    if not isinstance(mission, Mission):
        raise InputError(f"{mission!r} is no mission; write vfguide.load_mission({mission!r})")
    overrides = Overrides(
        controller=None if law is None else name_of(law),
        settings=tuple((place_of(field), value) for field, value in (settings or {}).items()),
        duration_s=duration_s,
        rate_hz=rate_hz,
        seed=seed,
    )
    changed = with_overrides(mission, overrides)
    impossible = [str(one) for one in check_mission(changed) if one.severity == "error"]
    if impossible:
        raise InputError("\n".join(impossible))
    return changed


@overload
def environment(
    mission: Mission,
    *,
    follower: None = None,
    actions: ActionKind = "rates",
    reward: "Reward | None" = None,
    settings: Mapping[str, object] | None = None,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int | None = None,
) -> "FormationEnvironment": ...


@overload
def environment(
    mission: Mission,
    *,
    follower: str,
    actions: ActionKind = "rates",
    reward: "Reward | None" = None,
    settings: Mapping[str, object] | None = None,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int | None = None,
) -> "FollowerEnvironment": ...


def environment(
    mission: Mission,
    *,
    follower: str | None = None,
    actions: ActionKind = "rates",
    reward: "Reward | None" = None,
    settings: Mapping[str, object] | None = None,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int | None = None,
) -> "FormationEnvironment | FollowerEnvironment":
    """Create an environment for reinforcement learning on a mission in virtual time.

    Args:
        mission: mission to fly.
        follower: agent of a Gymnasium environment; the others fly by the mission's law. By default all are
            agents of a PettingZoo parallel environment.
        actions: type of actions: `rates` or `setpoints`, see `vfguide.laws.motion_of`.
        reward: reward of a step; by default `vfguide.lab.environment.usual_reward`.
        settings: values that replace fields, as for `fly`.
        duration_s: duration of a flight, s; replaces the mission's.
        rate_hz: steps per second; replaces the mission's.
        seed: seed of the first flight; replaces the mission's.

    Raises:
        InputError: a value is out of range, a name is unknown, or the mission cannot be flown.
        ImportError: a library is not installed; the text names the extra that installs it. The exception is
            also a VfguideError.
    """
    require(*LEARNING)
    from vfguide.lab.environment import FollowerEnvironment, FormationEnvironment, usual_reward

    if actions not in get_args(ActionKind):
        raise InputError(f"actions: {actions} is none of {', '.join(get_args(ActionKind))}")
    fields = dict(settings or {})

    def change(more: Mapping[str, object]) -> Mission:
        return flyable(
            mission, settings={**fields, **more}, duration_s=duration_s, rate_hz=rate_hz, seed=seed
        )

    known = change({}).followers_by_name
    if follower is not None and follower not in known:
        raise InputError(f"follower: {follower} is none of {', '.join(known)}")
    formation = FormationEnvironment(
        change,
        agents=() if follower is None else (follower,),
        actions=actions,
        reward=reward or usual_reward,
    )
    return formation if follower is None else FollowerEnvironment(formation)


def compare(
    mission: Mission,
    *,
    laws: Iterable[str | type[Law]] | None = None,
    settings: Mapping[str, Iterable[object]] | None = None,
    seeds: Iterable[int] = (1,),
    metrics: Iterable[Metric] = (),
    duration_s: float | None = None,
    processes: int = 1,
    scheduler: str | None = None,
) -> list[Comparison]:
    """Fly a mission by several laws, with each combination of settings and seeds.

    Args:
        mission: mission to fly.
        laws: names or classes of laws; by default the mission's own.
        settings: values of fields to combine, such as `{"controller.k_x": [0.2, 0.3]}`.
        seeds: seeds of all random processes.
        metrics: functions of a flight that return user-defined figures, reported under their names.
        duration_s: duration of the flights, s; replaces the mission's.
        processes: number of processes for the flights. With more than one, each imports the calling program
            again, whose own code then has to stand under `if __name__ == "__main__":`. Laws and metrics then
            have to be top-level classes and functions.
        scheduler: address of a Dask cluster for the flights instead, such as "tcp://host:8786".

    Returns:
        Flights ordered by law, then setting, then seed.

    Raises:
        InputError: as for `fly`.
        VfguideError: no Dask scheduler responds.
    """
    fields = {
        field: values if isinstance(values, list | tuple | range) else refused(field, values)
        for field, values in (settings or {}).items()
    }
    if isinstance(laws, str) or not isinstance(seeds, Iterable):
        raise InputError('laws and seeds are lists; write laws=["slot"], seeds=[1]')
    if callable(metrics) or processes < 1:
        raise InputError("metrics is a list of functions, and processes 1 or more")
    own = tuple(metrics)
    names = [mission.controller.type] if laws is None else [name_of(one) for one in laws]
    chosen = [dict(zip(fields, values, strict=True)) for values in product(*fields.values())]
    tasks = [
        {
            "fly": {
                "mission": mission,
                "law": law,
                "settings": setting,
                "seed": seed,
                "duration_s": duration_s,
            },
            "metrics": own,
        }
        for law, setting, seed in product(names, chosen, tuple(seeds))
    ]
    if processes == 1 and scheduler is None:
        return [fly_one(task) for task in tasks]
    with executor_on(scheduler, processes) as executor:
        return list(flown_by(executor, fly_one, tasks))


def refused(field: str, values: object) -> Sequence[object]:
    """Refuse a setting that is not a list of values.

    Raises:
        InputError: always.
    """
    raise InputError(f'settings of compare are lists of values; write {{"{field}": [{values!r}]}}')


def name_of(law: str | type[Law]) -> str:
    """Return the name of a law given by its name or class.

    Raises:
        InputError: there is no law of this name, or the class has none.
    """
    if isinstance(law, str):
        return str(known_laws.find(law).name)
    if not hasattr(law, "name"):
        raise InputError(f'{law.__name__}: the law has no name; put @law("name") above its class')
    return law.name


def fly_one(task: Mapping[str, Any]) -> Comparison:
    """Fly one flight of a comparison."""
    flight = fly(**task["fly"])
    return Comparison(
        law=task["fly"]["law"],
        seed=task["fly"]["seed"],
        settings=task["fly"]["settings"],
        summary=flight.summary,
        metrics={one.__name__: measured(one, flight, task["fly"]) for one in task["metrics"]},
    )


def measured(metric: Metric, flight: Flight, flown: Mapping[str, Any]) -> float:
    """Return the figure of a metric.

    Raises:
        InputError: the metric fails, or returns no number; the message names the flight.
    """
    try:
        return float(metric(flight))
    except Exception as error:
        what = f"law {flown['law']}, seed {flown['seed']}, {dict(flown['settings'])}"
        reason = described_error(error)
        raise InputError(f"metric {metric.__name__} fails ({reason}) on {what}; mend it") from error
