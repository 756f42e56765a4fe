"""Flights on which pilots, companions, autopilots, positions and the link do what they should not.

Everything passes through MAVLink bytes in virtual time; distances are those of the emulators' true states.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from msgspec.structs import replace

import sitl_stub
from tests.kit.formation import Formation
from tests.kit.missions import content_of
from vfguide.companion.mission_plan import airframe_of
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import BoolArray, FloatArray
from vfguide.guidance.airframe import bank_limited_turn_rate
from vfguide.guidance.separation import TIMES, Agility, OwnMotion, escape_tracks
from vfguide.lab.rehearsal.aircraft import Mail, emulator_of
from vfguide.link.codec import decode, encode
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

MODES = {"RTL": 11, "LOITER": 12, "MANUAL": 0, "GUIDED": 15}
METRES_PER_DEGREE = 111_320.0

LEAST_M = 5.0
"""Nearer than this no vehicle under guidance may come to one that is heard."""

HEARING_S = 2.0
"""From when a companion steers until it has heard of the others and its vehicle has answered."""

HEARD_S = 10.0
"""A vehicle that was heard this long ago has to be kept clear of."""

REACTION_S = 0.5
"""Age of what is heard, and half a period of what answers: no turn of a neighbour is known sooner."""


def mission_in_place(name: str, **rehearsal: float) -> Mission:
    """A shipped mission with every follower in its slot at the start, and ArduPlane's modes to select.

    Args:
        name: of the mission.
        rehearsal: fields of that section in the place of the mission's.
    """
    content = content_of(name)
    start = {one["vehicle"]: {} for one in content["followers"]}
    content["rehearsal"] = content.get("rehearsal", {}) | {"start": start, **rehearsal}
    for vehicle in content["vehicles"].values():
        vehicle["autopilot"] = "ardupilot"
    return Mission.model_validate(content)


@dataclass(frozen=True, slots=True, order=True)
class Event:
    """Something happens to a vehicle."""

    time_s: float
    what: str
    """A mode that its pilot selects; "bank": the pilot's stick; "killed", "restarted": its companion;
    "frozen", "thawed": its autopilot; "lies", "honest": what it says on the link; "glitch": its positions."""
    vehicle: str
    value: float = 0.0
    """Bank in rad; metres east of a lie or of a glitch."""
    length_s: float = 0.0
    """Of a glitch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """How near two vehicles came while it was in the hands of guidance."""

    first: str
    second: str
    time_s: float
    distance_m: float
    """In space."""
    level_m: float
    """The least, in the plane."""
    unavoidable: bool
    """Whether one flew at the other faster than that could turn away."""


class Strays(Formation):
    """A formation, and what happens to it."""

    def __init__(self, mission: Mission, events: Sequence[Event]) -> None:
        super().__init__(mission, carry=lambda said: [self._said(one) for one in said])
        self.waiting = sorted(events)
        self.lies: dict[str, float] = {}
        for name in self.names:
            faults = tuple(
                sitl_stub.Fault("offset", one.time_s, one.length_s, 0.0, one.value)
                for one in events
                if one.what == "glitch" and one.vehicle == name
            )
            self.emulators[name].autopilot = emulator_of(mission, name, faults)

    def step(self) -> None:
        """Let happen what is due, and fly on."""
        while self.waiting and self.waiting[0].time_s <= self.now:
            self._happen(self.waiting.pop(0))
        super().step()

    def _said(self, mail: Mail) -> Mail:
        """What a vehicle says, or its lie."""
        sender, data = mail
        if sender not in self.lies:
            return mail
        message = decode(data)
        east = self.lies[sender] / METRES_PER_DEGREE
        east /= math.cos(math.radians(message.latitude_deg))
        return sender, encode(replace(message, longitude_deg=message.longitude_deg + east))

    def _happen(self, event: Event) -> None:
        name, emulator = event.vehicle, self.emulators[event.vehicle]
        match event.what:
            case "killed":
                self.kill(name)
            case "restarted":
                self.restart(name)
            case "frozen":
                emulator.freeze()
            case "thawed":
                emulator.frozen = False
            case "bank":
                emulator.autopilot.hold_bank(event.value)
            case "lies":
                self.lies[name] = event.value
            case "honest":
                self.lies.pop(name, None)
            case "glitch":
                pass
            case mode:
                emulator.select(MODES[mode])


STEERING = {mode.value for mode in Mode if mode.steers}


def gone(record: FlightRecord, name: str, events: Sequence[Event], lag_s: float = 0.0) -> BoolArray:
    """When a vehicle's companion is killed or its autopilot hangs; some time later, s, if so wished."""
    away = np.zeros(len(record.time_s), dtype=bool)
    for begin, end in (("killed", "restarted"), ("frozen", "thawed")):
        starts = [one.time_s for one in events if one.vehicle == name and one.what == begin]
        ends = [one.time_s for one in events if one.vehicle == name and one.what == end]
        for start, stop in zip(starts, [*ends, math.inf][: len(starts)], strict=True):
            away |= (record.time_s >= start + lag_s) & (record.time_s <= stop)
    return away


def guided(record: FlightRecord, vehicle: VehicleRecord, events: Sequence[Event]) -> BoolArray:
    """When a vehicle is under guidance, and has been for as long as it takes to hear of the others."""
    numbers = [n for n, name in enumerate(record.mode_names) if name in STEERING]
    steers = np.isin(vehicle.mode, numbers) & ~gone(record, vehicle.name, events)
    samples = round(HEARING_S / (record.time_s[1] - record.time_s[0]))
    since = np.convolve(~steers, np.ones(samples + 1))[: len(steers)]
    settled: BoolArray = steers & (since < 0.5)
    return settled


def heard(record: FlightRecord, name: str, events: Sequence[Event]) -> BoolArray:
    """When a vehicle is heard, or was within the last seconds."""
    return ~gone(record, name, events, HEARD_S)


def approaches(
    mission: Mission, record: FlightRecord, events: Sequence[Event], from_s: float
) -> list[Approach]:
    """For every two vehicles, how near they came while one of them could give way; the nearest first."""
    found = []
    for first, second in combinations(record.vehicles, 2):
        gives, takes = guided(record, first, events), guided(record, second, events)
        counts = gives & heard(record, second.name, events)
        counts |= takes & heard(record, first.name, events)
        counts &= record.time_s >= from_s
        if not counts.any():
            continue
        level = np.hypot(first.north_m - second.north_m, first.east_m - second.east_m)
        space = np.hypot(level, first.altitude_amsl_m - second.altitude_amsl_m)
        at = int(np.where(counts, space, np.inf).argmin())
        lower = int(np.where(counts, level, np.inf).argmin())
        unavoidable = False
        if level[lower] < LEAST_M and not (gives[lower] and takes[lower]):
            met = (first, second) if gives[lower] else (second, first)
            unavoidable = dives_at(mission, record, met, events, lower)
        found.append(
            Approach(
                first=first.name,
                second=second.name,
                time_s=float(record.time_s[at]),
                distance_m=float(space[at]),
                level_m=float(level[lower]),
                unavoidable=unavoidable,
            )
        )
    return sorted(found, key=lambda one: one.level_m)


def dives_at(
    mission: Mission,
    record: FlightRecord,
    met: tuple[VehicleRecord, VehicleRecord],
    events: Sequence[Event],
    at: int,
) -> bool:
    """Whether a vehicle flew at one under guidance faster than that could turn away.

    From the last thing that happened to the other before they met, and what it takes to hear of it, the
    vehicle under guidance is flown anew in the plane, by its own turn rate, acceleration and delays, along
    every full manoeuvre: straight on, and left or right at its bank limit, at its lowest, present and highest
    airspeed. If not one of them stays 5 m clear of what the other really flew, nothing could have been done.
    """
    own, other = met
    met_s = float(record.time_s[at])
    begun = [one.time_s for one in events if one.vehicle == other.name and one.time_s <= met_s]
    known_s = max(begun, default=-math.inf) + REACTION_S
    if met_s - known_s > TIMES[-1]:
        return False
    start = min(int(np.searchsorted(record.time_s, known_s)), at)
    airframe = airframe_of(mission.vehicles[own.name])
    wind = complex(own.wind_north_m_s[start], own.wind_east_m_s[start])
    ground = float(own.ground_speed_m_s[start]) * np.exp(1j * float(own.course_rad[start]))
    air = complex(ground - wind)
    agility = Agility(
        turn_rate=bank_limited_turn_rate(airframe.max_bank, abs(air)),
        acceleration=airframe.max_acceleration,
        turn_delay=airframe.course_dead_time + airframe.course_lag,
        speed_delay=airframe.speed_dead_time + airframe.speed_lag,
        alpha=10.0,
        beta=10.0,
        speed_min=airframe.airspeed_min,
        speed_max=airframe.airspeed_max,
    )
    motion = OwnMotion(
        place=complex(own.north_m[start], own.east_m[start]),
        air_velocity=air,
        wind=wind,
        turn_rate=math.tan(float(own.bank_rad[start])) * 9.80665 / abs(air),
    )
    tracks = escape_tracks(motion, agility)
    fine = record.time_s[start : at + 1]
    flown = other.north_m[start : at + 1] + 1j * other.east_m[start : at + 1]
    since = fine - fine[0]

    def nearest_m(track: FloatArray) -> float:
        there = np.interp(since, TIMES, track.real) + 1j * np.interp(since, TIMES, track.imag)
        return float(np.abs(there - flown).min())

    return max(map(nearest_m, tracks)) < LEAST_M
