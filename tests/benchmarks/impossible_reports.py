"""What an autopilot's impossible reports cost: metres off the slot, flown in virtual time.

    .venv/bin/python tests/benchmarks/impossible_reports.py [f1|leader] [PART OF A NAME]

A row for each witness (place, velocity, airspeed, altitude, alone and in pairs) and each kind of fault:
stands still, steps, drifts, is noisy, comes late, is missing.

The article's circle in its wind, everybody in place; at 30 s one vehicle's reports go wrong. Told are the
greatest distance of that vehicle (or of f1, where it is the leader's) from where it flies without the fault,
the least distance between any two, and what its companion says.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import dist, hypot, inf
from pathlib import Path

import vfguide.lab.rehearsal.aircraft
from sitl_stub import Autopilot, Fault, Truth
from vfguide.companion.mission_plan import local_frame
from vfguide.lab.rehearsal.aircraft import Aircraft, step_all
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.mission import Mission, load_mission

MISSIONS = Path(__file__).parents[2] / "missions"

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
    **{
        f"{witness} stuck for {length_s:g} s": stuck(witness, length_s)
        for witness in STUCK
        for length_s in (2.0, 2.5, 3.0, 5.0, inf)
    },
    "position 40 m off, for ever": (Fault("offset", AT_S, inf, 40.0),),
    "position 50 m off for 3 s": (Fault("offset", AT_S, 3.0, 50.0),),
    "position 5 km off for 3 s": (Fault("offset", AT_S, 3.0, 5000.0),),
    "position 5 km off, for ever": (Fault("offset", AT_S, inf, 5000.0),),
    "latitude and longitude 0 for 3 s": (Fault("zero", AT_S, 3.0),),
    **{
        f"position drifts by {rate:g} m/s for 20 s": (Fault("drift", AT_S, 20.0, rate),)
        for rate in (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
    },
    "position noisy by 3 m for 20 s": (Fault("noise", AT_S, 20.0, 3.0),),
    "velocity 327 m/s for 3 s": (Fault("velocity", AT_S, 3.0, 327.0),),
    "velocity 20 m/s east for 5 s": (Fault("velocity", AT_S, 5.0, 0.0, 20.0),),
    "airspeed 500 m/s for 10 s": (Fault("airspeed", AT_S, 10.0, 500.0),),
    "airspeed 0 for 10 s": (Fault("airspeed", AT_S, 10.0, 0.0),),
    "place, velocity stuck and airspeed 0 for 5 s": (
        *stuck("place and velocity", 5.0),
        Fault("airspeed", AT_S, 5.0, 0.0),
    ),
    **{
        f"positions {late_s:g} s late for 10 s": (Late(AT_S, 10.0, late_s),)
        for late_s in (0.2, 1.0, 3.0)
    },
    **{
        f"positions missing for {length_s:g} s": (Late(AT_S, length_s, inf),)
        for length_s in (1.0, 3.0, 5.0)
    },
    "altitude 47 m off, for ever": (Fault("altitude", AT_S, inf, 47.0),),
    "altitude 47 m off from the start": (Fault("altitude", 0.0, inf, 47.0),),
    "altitude 0 from the start": (Fault("altitude", 0.0, inf, -588.0),),
    "clock loses 1.6 s in 30 s": (Fault("clock", AT_S, 30.0, 1.6),),
    "clock loses 0.5 s at once": (Fault("clock", AT_S, 0.05, 0.5),),
}

Place = tuple[float, float, float]
"""North, east and altitude, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What became of a formation."""

    places: dict[str, list[Place]]
    """True (north, east) in m of each vehicle at each step."""
    events: dict[str, list[tuple[float, str]]]
    """What each companion said, and when."""

    rate_hz: float
    """Steps in a second."""

    def off(self, other: "Flown", name: str, from_s: float = 0.0, to_s: float = inf) -> float:
        """Greatest distance (m) of a vehicle from where it was in another flight."""
        pairs = zip(
            self.between(name, from_s, to_s), other.between(name, from_s, to_s), strict=True
        )
        return max(hypot(one[0] - two[0], one[1] - two[1]) for one, two in pairs)

    def nearest(self, from_s: float = 0.0, to_s: float = inf) -> float:
        """Least distance (m) in space between any two."""
        places = [self.between(name, from_s, to_s) for name in self.places]
        return min(
            dist(one, two)
            for first, second in combinations(places, 2)
            for one, two in zip(first, second, strict=True)
        )

    def said(self, name: str, from_s: float, to_s: float) -> list[str]:
        """What a companion said, but for its modes."""
        between = [text for time_s, text in self.events[name] if from_s <= time_s < to_s]
        return [text for text in between if " -> " not in text]

    def mode_changes(self, name: str, from_s: float, to_s: float) -> list[str]:
        """Modes that a companion changed to."""
        between = [text for time_s, text in self.events[name] if from_s <= time_s < to_s]
        return [text.split(" -> ")[1] for text in between if " -> " in text]

    def mode_at(self, name: str, time_s: float) -> str:
        """The mode of a companion."""
        return self.mode_changes(name, 0.0, time_s)[-1]

    def between(self, name: str, from_s: float, to_s: float) -> list[Place]:
        """True places of a vehicle, one for each step."""
        last = None if to_s == inf else round(to_s * self.rate_hz)
        return self.places[name][round(from_s * self.rate_hz) : last]


@dataclass(frozen=True, slots=True)
class Stop:
    """An autopilot in software is stopped, its simulated aircraft with it."""

    start_s: float
    """When, s."""
    length_s: float
    """For how long, s."""


GLOBAL_POSITION_INT = 33


class LatePositions:
    """An emulated autopilot whose position reports come late, or not at all."""

    def __init__(self, autopilot: Autopilot, faults: Sequence[Late]) -> None:
        self._autopilot = autopilot
        self._faults = faults
        self._held: list[tuple[float, bytes]] = []

    def advance(self, now: float) -> bytes:
        """Fly to a time; what is said then, and what was held until then."""
        said = b""
        for frame in frames_of(self._autopilot.advance(now)):
            late_s = max(
                (one.late_s for one in self._faults if 0.0 <= now - one.start_s < one.length_s),
                default=0.0,
            )
            position = int.from_bytes(frame[7:10], "little") == GLOBAL_POSITION_INT
            if position and late_s > 0.0:
                self._held.append((now + late_s, frame))
            else:
                said += frame
        due = [frame for due_s, frame in self._held if due_s <= now]
        self._held = [one for one in self._held if one[0] > now]
        return said + b"".join(due)

    def receive(self, data: bytes) -> bytes:
        """Hear."""
        return self._autopilot.receive(data)

    def truth(self) -> Truth:
        """Where the aircraft is."""
        return self._autopilot.truth()


def frames_of(data: bytes) -> list[bytes]:
    """Split bytes into MAVLink 2 frames, which are signed where the third byte says so."""
    frames = []
    while data:
        length = 12 + data[1] + (13 if data[2] & 1 else 0)
        frames.append(data[:length])
        data = data[length:]
    return frames


class Stopped:
    """An emulated autopilot that is stopped now and then: it hears and says nothing, and its time stands."""

    def __init__(self, autopilot: Autopilot, stops: Sequence[Stop]) -> None:
        self._autopilot = autopilot
        self._stops = stops
        self._stands = False

    def advance(self, now: float) -> bytes:
        """Fly to a time, less what was lost."""
        self._stands = any(0.0 <= now - one.start_s < one.length_s for one in self._stops)
        lost_s = sum(min(max(now - one.start_s, 0.0), one.length_s) for one in self._stops)
        return b"" if self._stands else self._autopilot.advance(now - lost_s)

    def receive(self, data: bytes) -> bytes:
        """Hear, unless it stands."""
        return b"" if self._stands else self._autopilot.receive(data)

    def truth(self) -> Truth:
        """Where the aircraft is."""
        return self._autopilot.truth()


def in_place(name: str = "circle-wind") -> Mission:
    """One of the article's missions in wind, everybody in the slot."""
    content = load_mission(MISSIONS / f"{name}.yaml").model_dump(exclude_unset=True)
    leader = {"north_m": 0, "east_m": 0, "course_deg": COURSE_DEG[name]}
    followers = {one["vehicle"]: {} for one in content["followers"]}
    content.setdefault("rehearsal", {})["start"] = {"leader": leader, **followers}
    return Mission.model_validate(content)


def fly(
    mission: Mission,
    faults: dict[str, Sequence[Fault | Late]],
    until_s: float,
    stops: dict[str, Sequence[Stop]] | None = None,
) -> Flown:
    """Fly the mission with these faults and stops by vehicle."""
    emulators: dict[str, Autopilot] = {}

    def emulator(mission: Mission, name: str) -> Autopilot | Stopped | LatePositions:
        emulators[name] = emulator_of(mission, name)
        late = []
        for fault in faults.get(name, ()):
            if isinstance(fault, Late):
                late.append(fault)
            else:
                emulators[name].inject(fault)
        if late:
            return LatePositions(emulators[name], late)
        stopped = (stops or {}).get(name)
        return Stopped(emulators[name], stopped) if stopped else emulators[name]

    original = vfguide.lab.rehearsal.aircraft.emulator_of
    vfguide.lab.rehearsal.aircraft.emulator_of = emulator
    try:
        aircraft = [
            Aircraft(mission, name) for name in (mission.leader.vehicle, *mission.followers_by_name)
        ]
    finally:
        vfguide.lab.rehearsal.aircraft.emulator_of = original
    frame = local_frame(mission)
    places: dict[str, list[Place]] = {one.name: [] for one in aircraft}
    mail: list[tuple[str, bytes]] = []
    rate_hz = mission.rehearsal.rate_hz
    for step in range(round(until_s * rate_hz) + 1):
        sent = step_all(aircraft, step / rate_hz, mail)
        mail = [one for one in sent if one[0] != mission.leader.vehicle]
        for name, autopilot in emulators.items():
            truth = autopilot.truth()
            north, east = frame.to_local(truth.latitude_deg, truth.longitude_deg)
            places[name].append((north, east, truth.altitude_amsl_m))
    return Flown(
        places=places,
        rate_hz=rate_hz,
        events={one.name: [(said.time_s, said.text) for said in one.events] for one in aircraft},
    )


def main() -> None:
    """Print the table."""
    write = sys.stdout.write
    faulty = sys.argv[1] if len(sys.argv) > 1 else "f1"
    watched = "f1" if faulty == "leader" else faulty
    mission = in_place()
    until_s = AT_S + 60.0
    right = fly(mission, {}, until_s)
    part = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, faults in FAULTS.items():
        if part not in name:
            continue
        flown = fly(mission, {faulty: faults}, until_s)
        off, nearest = flown.off(right, watched), flown.nearest()
        write(f"{name}: {watched} {off:.1f} m off, nearest {nearest:.1f} m\n")
        for vehicle in dict.fromkeys((faulty, watched)):
            for time_s, text in flown.events[vehicle]:
                if time_s >= AT_S:
                    write(f"    {vehicle} {time_s - AT_S:5.2f} s  {text}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
