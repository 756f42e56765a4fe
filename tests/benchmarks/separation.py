"""Vehicles that leave the formation, at random and several at a time: how near do any two come?

Counted where it is in the hands of guidance: at least one of the two is steered by its companion, and has
been for as long as it takes to hear of the others, and the other is heard or was heard within the last 10 s.
What flies at another faster than that could turn away is told apart (`strays.dives_at`).

Run with `.venv/bin/python -m tests.benchmarks.separation [FLIGHTS] [--first N] [--jobs N]`. Exit status 1
where two came within 5 m that should not have.
"""

import argparse
import math
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from random import Random

from tests.benchmarks.strays import LEAST_M, Approach, Event, Strays, approaches, mission_in_place
from tests.kit.figures import tell
from vfguide.mission.feasibility import least_guarantee

BEGIN_S = 12.0
"""Vehicles that start in their slots have settled by then."""

SPAN_S = 10.0
"""Within this time the first things happen."""

AFTERWARDS_S = 15.0

KINDS = (
    "line-wind",
    "circle-wind",
    "survey-racetrack",
    "line-calm",
    "circle-calm",
    "ardupilot-sitl",
)
"""Missions that are flown in turn; the last has vehicles that slip and lag."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a flight came to."""

    number: int
    mission: str
    events: tuple[Event, ...]
    nearest: Approach


def random_events(random: Random, names: list[str]) -> tuple[Event, ...]:
    """One to three vehicles, the leader among them, and at times one that lies."""
    events: list[Event] = []
    for name in random.sample(names, random.choice([1, 1, 2, 3])):
        begins_s = round(BEGIN_S + random.uniform(0.0, SPAN_S), 2)
        lasts_s = round(random.uniform(2.0, 9.5), 2)
        ends_s = begins_s + lasts_s
        match random.choice(["RTL", "LOITER", "MANUAL", "MANUAL", "killed", "frozen", "glitch"]):
            case "killed":
                events += [Event(begins_s, "killed", name), Event(ends_s, "restarted", name)]
            case "frozen":
                ends_s = begins_s + min(lasts_s, 5.0)
                events += [Event(begins_s, "frozen", name), Event(ends_s, "thawed", name)]
            case "glitch":
                off_m = random.choice([-1.0, 1.0]) * random.uniform(10.0, 50.0)
                events.append(Event(begins_s, "glitch", name, off_m, min(lasts_s, 4.0)))
            case mode:
                events.append(Event(begins_s, mode, name))
                turn_s = begins_s
                while mode == "MANUAL" and turn_s < ends_s:
                    bank = math.radians(random.choice([-45.0, -30.0, 0.0, 30.0, 45.0]))
                    events.append(Event(round(turn_s + 0.05, 2), "bank", name, bank))
                    turn_s += random.uniform(1.0, 5.0)
                events.append(Event(ends_s + 0.1, "GUIDED", name))
    if random.random() < 0.15:
        name = random.choice(names[1:])
        begins_s = BEGIN_S + random.uniform(0.0, SPAN_S)
        events.append(Event(begins_s, "lies", name, random.choice([-1, 1]) * random.uniform(8, 40)))
        events.append(Event(begins_s + random.uniform(2.0, 9.0), "honest", name))
    return tuple(sorted(events))


def fly(number: int, afterwards_s: float = AFTERWARDS_S, **rehearsal: float) -> Outcome:
    """One flight, for some time (s) after the last thing has happened; see `mission_in_place`."""
    mission = mission_in_place(KINDS[number % len(KINDS)], **rehearsal)
    names = [mission.leader.vehicle, *mission.followers_by_name]
    events = random_events(Random(number), names)
    record = Strays(mission, events).fly(events[-1].time_s + afterwards_s).record
    pairs = approaches(mission, record, events, from_s=BEGIN_S)
    avoidable = [one for one in pairs if not one.unavoidable]
    return Outcome(
        number=number,
        mission=mission.name,
        events=events,
        nearest=min(avoidable or pairs, key=lambda one: one.distance_m),
    )


def line_of(outcome: Outcome) -> str:
    """One line."""
    near = outcome.nearest
    what = ", ".join(
        f"{one.time_s:.1f} {one.vehicle} {one.what}" for one in outcome.events if one.what != "bank"
    )
    return (
        f"{outcome.number:4} {outcome.mission:16} {near.distance_m:5.1f} m ({near.level_m:5.1f} level) "
        f"{near.first}-{near.second} at {near.time_s:.1f} s"
        f"{' dived at' if near.unavoidable else ''}; {what}"
    )


def main() -> int:
    """Fly them all; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("flights", nargs="?", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args()
    numbers = range(chosen.first, chosen.first + chosen.flights)
    outcomes = []
    with ProcessPoolExecutor(chosen.jobs) as pool:
        for outcome in pool.map(fly, numbers):
            outcomes.append(outcome)
            tell(line_of(outcome))
    for name in KINDS:
        tell(mission_line(name, [one for one in outcomes if one.mission == name]))
    return verdict(outcomes)


def nearest_of(outcomes: list[Outcome]) -> tuple[list[Outcome], float, float]:
    """(flights in which nobody was dived at, the nearest two of them in space, and level, m)."""
    counted = [one for one in outcomes if not one.nearest.unavoidable]
    space = min((one.nearest.distance_m for one in counted), default=math.nan)
    return counted, space, min((one.nearest.level_m for one in counted), default=math.nan)


def mission_line(name: str, outcomes: list[Outcome]) -> str:
    """What the flights on a mission came to, beside what `vfguide check` says of it."""
    counted, space, level = nearest_of(outcomes)
    stated = least_guarantee(mission_in_place(name))
    check = math.nan if stated is None else stated.distance_m
    return (
        f"{name:16} {len(counted):4} flights: nearest {space:.1f} m in space, {level:.1f} m level; "
        f"check says {check:.1f} m for one turn"
    )


def verdict(outcomes: list[Outcome]) -> int:
    """Say what they came to; the exit status."""
    counted, nearest, lowest = nearest_of(outcomes)
    near = [one for one in counted if one.nearest.distance_m < LEAST_M]
    level = [one for one in counted if one.nearest.level_m < LEAST_M]
    missions = Counter(one.mission for one in near)
    tell(
        f"{len(outcomes)} flights: nearest two {nearest:.1f} m in space, {lowest:.1f} m level; within "
        f"{LEAST_M:g} m in {len(near)} ({len(level)} level) {dict(missions)}; dived at in "
        f"{len(outcomes) - len(counted)}"
    )
    return int(bool(near))


if __name__ == "__main__":
    sys.exit(main())
