"""What an autopilot's impossible reports cost: metres off the slot, flown in virtual time.

The article's circle in its wind, everybody in place; at 30 s one vehicle's reports go wrong. Told are the
greatest distance of f1 from where it flies without the fault, and the least distance between any two.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from math import inf

import numpy as np

from sitl_stub import Autopilot, Fault
from tests.benchmarks.results import Cases, Figures, Value
from tests.kit.flight import Flight
from tests.kit.formation import Formation
from tests.kit.missions import IN_PLACE, mission_with
from tests.kit.wire import parsed
from vfguide.elementwise import BoolArray
from vfguide.lab.rehearsal.aircraft import emulator_of
from vfguide.mission import Mission

COURSE_DEG = {"circle-wind": 270.0, "line-wind": 45.0}
"""Of the paths, where they pass the origin."""

AT_S = 30.0


@dataclass(frozen=True, slots=True)
class Late:
    """Position reports come late for a while, or not at all."""

    start_s: float
    """When it begins, s."""
    length_s: float
    """For how long, s."""
    late_s: float
    """By how much, s; infinite where they are lost."""


STUCK = {"place": ("frozen",), "velocity": ("held",), "place and velocity": ("frozen", "held")}
"""Kinds of the emulator's faults by the witness that stands still."""


def stuck(witness: str, length_s: float) -> tuple[Fault, ...]:
    """A witness stands still from `AT_S` on."""
    return tuple(Fault(kind, AT_S, length_s) for kind in STUCK[witness])


FAULTS: dict[str, tuple[Fault | Late, ...]] = {
    "place stuck for 5 s": stuck("place", 5.0),
    "velocity stuck for 5 s": stuck("velocity", 5.0),
    "place and velocity stuck for 5 s": stuck("place and velocity", 5.0),
    "place and velocity stuck for ever": stuck("place and velocity", inf),
    "place 5 km off for 3 s": (Fault("offset", AT_S, 3.0, 5000.0),),
    "place 40 m off for ever": (Fault("offset", AT_S, inf, 40.0),),
    "place drifts by 0.5 m/s for 20 s": (Fault("drift", AT_S, 20.0, 0.5),),
    "place drifts by 5 m/s for 20 s": (Fault("drift", AT_S, 20.0, 5.0),),
    "place and velocity stuck, airspeed 0 for 5 s": (
        *stuck("place and velocity", 5.0),
        Fault("airspeed", AT_S, 5.0, 0.0),
    ),
    "positions 3 s late for 10 s": (Late(AT_S, 10.0, 3.0),),
    "positions missing for 5 s": (Late(AT_S, 5.0, inf),),
    "altitude 0 from the start": (Fault("altitude", 0.0, inf, -588.0),),
}
"""Faults by their names in the table."""


class Flown(Flight):
    """What became of a formation; positions are true ones."""

    def during(self, from_s: float, to_s: float) -> BoolArray:
        """Which samples are of a time."""
        time_s = self.record.time_s
        return (time_s > from_s - 1e-6) & (time_s < to_s - 1e-6)

    def off(self, other: "Flown", name: str, from_s: float = 0.0, to_s: float = inf) -> float:
        """Greatest distance (m) of a vehicle from where it was in another flight."""
        when = self.during(from_s, to_s)
        own, others = self.vehicle(name), other.vehicle(name)
        north, east = (
            getattr(own, axis)[when] - getattr(others, axis)[: when.size][when]
            for axis in ("north_m", "east_m")
        )
        return float(np.hypot(north, east).max())

    def said(self, name: str, from_s: float, to_s: float) -> list[str]:
        """What a companion said, but for its modes."""
        return [text for text in self.told(name, from_s, to_s) if " -> " not in text]

    def mode_changes(self, name: str, from_s: float, to_s: float) -> list[str]:
        """Modes that a companion changed to."""
        told = self.told(name, from_s, to_s)
        return [text.split(" -> ")[1] for text in told if " -> " in text]

    def told(self, name: str, from_s: float, to_s: float) -> list[str]:
        """All that a companion said in a time."""
        return [one.text for one in self.events[name] if from_s <= one.time_s < to_s]

    def mode_at(self, name: str, time_s: float) -> str:
        """The mode of a companion."""
        return self.mode_changes(name, 0.0, time_s)[-1]


@dataclass(frozen=True, slots=True)
class Stop:
    """An autopilot in software is stopped, its simulated aircraft with it."""

    start_s: float
    """When, s."""
    length_s: float
    """For how long, s."""


class LatePositions:
    """An emulated autopilot whose position reports come late, or not at all."""

    def __init__(self, autopilot: Autopilot, faults: Sequence[Late]) -> None:
        self._autopilot, self._faults = autopilot, faults
        self.receive, self.truth = autopilot.receive, autopilot.truth
        self._held: list[tuple[float, bytes]] = []

    def advance(self, now: float) -> bytes:
        """Fly to a time; what is said then, and what was held until then."""
        said = b""
        late_s = max(
            (one.late_s for one in self._faults if 0.0 <= now - one.start_s < one.length_s),
            default=0.0,
        )
        for message in parsed(self._autopilot.advance(now)):
            if message.get_type() == "GLOBAL_POSITION_INT" and late_s > 0.0:
                self._held.append((now + late_s, bytes(message.get_msgbuf())))
            else:
                said += message.get_msgbuf()
        due = [frame for due_s, frame in self._held if due_s <= now]
        self._held = [one for one in self._held if one[0] > now]
        return said + b"".join(due)


class Stopped:
    """An emulated autopilot that is stopped now and then: it hears and says nothing, and its time stands."""

    def __init__(self, autopilot: Autopilot, stops: Sequence[Stop]) -> None:
        self._autopilot, self._stops = autopilot, stops
        self.truth = autopilot.truth
        self._stands = False

    def advance(self, now: float) -> bytes:
        """Fly to a time, less what was lost."""
        self._stands = any(0.0 <= now - one.start_s < one.length_s for one in self._stops)
        lost_s = sum(min(max(now - one.start_s, 0.0), one.length_s) for one in self._stops)
        return b"" if self._stands else self._autopilot.advance(now - lost_s)

    def receive(self, data: bytes) -> bytes:
        """Hear, unless it stands."""
        return b"" if self._stands else self._autopilot.receive(data)


def on_course(name: str = "circle-wind") -> Mission:
    """One of the article's missions in wind, everybody in the slot."""
    leader = {"north_m": 0, "east_m": 0, "course_deg": COURSE_DEG[name]}
    return mission_with(name, rehearsal={"start": IN_PLACE | {"leader": leader}})


def fly(
    mission: Mission,
    faults: dict[str, Sequence[Fault | Late]],
    until_s: float,
    stops: dict[str, Sequence[Stop]] | None = None,
) -> Flown:
    """Fly the mission with these faults and stops by vehicle."""
    formation = Formation(mission)
    for name, pushed in formation.emulators.items():
        given = faults.get(name, ())
        lasting = tuple(one for one in given if isinstance(one, Fault))
        pushed.autopilot = emulator_of(mission, name, lasting)
        if late := [one for one in given if isinstance(one, Late)]:
            pushed.autopilot = LatePositions(pushed.autopilot, late)
        elif stopped := (stops or {}).get(name):
            pushed.autopilot = Stopped(pushed.autopilot, stopped)
    flown = formation.fly(until_s)
    return Flown(flown.record, flown.events)


@cache
def faultless() -> Flown:
    """Fly as long without a fault."""
    return fly(on_course(), {}, AT_S + 60.0)


def figures_of(name: str) -> Figures:
    """Fly a fault of f1, and then of the leader."""
    mission, until_s, right = on_course(), AT_S + 60.0, faultless()
    figures = dict[str, Value]()
    for faulty, key in (("f1", "own"), ("leader", "leader")):
        flown = fly(mission, {faulty: FAULTS[name]}, until_s)
        end = ["never engaged", *flown.mode_changes("f1", 0.0, until_s)][-1]
        figures |= {
            f"{key}_off_m": flown.off(right, "f1"),
            f"{key}_nearest_m": flown.nearest(),
            f"{key}_end": "" if end == "tracking" else f", {end}",
        }
    return figures


def cases() -> Cases:
    """Fly every fault."""
    with ProcessPoolExecutor() as pool:
        yield from zip(FAULTS, pool.map(figures_of, FAULTS), strict=True)
