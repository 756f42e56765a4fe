"""Vehicles that leave the formation, at random and several at a time: how near do any two come?

Counted where it is in the hands of guidance: at least one of the two is steered by its companion, and has
been for as long as it takes to hear of the others, and the other is heard or was heard within the last 10 s.
What flies at another faster than that could turn away is told apart (`strays.dives_at`).

`python -m tests.benchmarks.separation NUMBER ...` tells of single flights.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from random import Random

from tests.benchmarks.results import Cases
from tests.benchmarks.strays import Approach, Event, Strays, approaches, mission_in_place
from tests.kit.figures import tell

BEGIN_S = 12.0
"""Vehicles that start in their slots have settled by then."""

SPAN_S = 10.0
"""Within this time the first things happen."""

AFTERWARDS_S = 15.0

FLIGHTS = 1000

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


def cases() -> Cases:
    """Fly a thousand; a case for each mission."""
    with ProcessPoolExecutor() as pool:
        outcomes = list(pool.map(fly, range(FLIGHTS)))
    for name in KINDS:
        counted = [one for one in outcomes if one.mission == name and not one.nearest.unavoidable]
        yield (
            name,
            {
                "flights": len(counted),
                "nearest_m": min(one.nearest.distance_m for one in counted),
                "level_m": min(one.nearest.level_m for one in counted),
            },
        )


def main() -> None:
    """Fly some by their numbers, and say what became of each."""
    for number in map(int, sys.argv[1:]):
        tell(line_of(fly(number)))


if __name__ == "__main__":
    main()
