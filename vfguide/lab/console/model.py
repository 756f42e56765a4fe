"""From states and presences to what the console shows. Pure: bytes and times go in, plain values come out.

Times are seconds since the console began. Places are in the mission's local frame: metres north and east of
its origin, altitudes above mean sea level.
"""

import cmath
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vfguide.companion.plan import local_frame
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.lab.console.alarms import Alarm, Knowledge, Nearness, alarms_of
from vfguide.lab.console.history import History
from vfguide.lab.report.colours import NIGHT_COLOURS, colours_of
from vfguide.lab.report.replay.data import FORMAT, KINDS, Kind, encode, rounded
from vfguide.link.codec import LeaderMessage, LinkDataError, decode
from vfguide.link.presence import Presence
from vfguide.mission import Mission
from vfguide.mission.flight_path import path_of

GRAVITY = 9.80665
"""m/s²."""

MODES = (*(mode.value for mode in Mode), "offline", "not known")
"""What a card can show, by number."""

SERIES = (
    "north_m",
    "east_m",
    "altitude_m",
    "course_deg",
    "heading_deg",
    "bank_deg",
    "ground_speed_m_s",
    "airspeed_m_s",
    "wind_north_m_s",
    "wind_east_m_s",
    "along_m",
    "across_m",
    "mode",
    "age_s",
)
"""The numbers of a vehicle in a sample, by the names that the replay has for them."""

CONSOLE_KINDS = {**KINDS, "age_s": Kind(unit=0.01, bits=16)}
"""How they are written."""

CARRIED_S = 2.0
"""For so long a place is carried on along its turn; no slot is reckoned by an older one."""

KEPT_S = 15.0
"""For so long the place where a vehicle was heard last is shown."""

OLDEST_S = 300.0
"""Greatest age that is told."""

CLIMB_S = 0.5
"""Over so long climb rates are averaged."""

STEEPEST_M_S = 20.0
"""More is no climb, but a height that was set right."""

STEP_S = 0.3
"""A clock that is behind by more than this has been set, or the flight is slower than real time."""

DRAWN_POINTS = 400
"""Of the path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """The newest state of a vehicle."""

    message: LeaderMessage
    """As it came."""
    place: complex
    """North and east as real and imaginary part, m."""
    climb: float
    """m/s; the state does not say it."""
    received_s: float
    """When it came."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """The newest presence of a vehicle."""

    presence: Presence
    """As it came."""
    received_s: float
    """When it came."""
    warned_s: float
    """When its warning was new; NaN without one."""


class Formation:
    """A formation, as somebody knows it who hears all of it."""

    def __init__(self, mission: Mission) -> None:
        """Make one of which nothing has been heard."""
        self._mission = mission
        self._frame = local_frame(mission)
        self.names = (mission.leader.vehicle, *mission.followers_by_name)
        """Vehicles, the leader first."""
        self.history = History(len(self.names), len(SERIES))
        """Everything so far."""
        self.counters: Counter[str] = Counter()
        """What came and was no state."""
        self._rows = {name: row for row, name in enumerate(self.names)}
        self._slots = np.array([slot_of(mission, name) for name in self.names])
        self._heard: dict[str, Heard] = {}
        self._said: dict[str, Said] = {}
        self._offset_s: float | None = None
        self._near: tuple[Nearness, ...] = ()

    @property
    def heard_anything(self) -> bool:
        """Whether any vehicle has been heard."""
        return bool(self._heard or self._said)

    def take_state(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of a vehicle; what is none is counted, what is older than the last is passed over."""
        if vehicle not in self._rows:
            return
        try:
            message = decode(data)
        except LinkDataError:
            self.counters["no state"] += 1
            return
        place = complex(*self._frame.to_local(message.latitude_deg, message.longitude_deg))
        climb = climb_between(self._heard.get(vehicle), message)
        self._heard[vehicle] = Heard(message=message, place=place, climb=climb, received_s=now)
        leader = self._heard.get(self.names[0])
        if vehicle == self.names[0] or leader is None or now - leader.received_s > CARRIED_S:
            self._note_clock(message.time_s - now)

    def take_presence(self, vehicle: str, presence: Presence, now: float) -> None:
        """Take what a vehicle says about itself."""
        if vehicle not in self._rows:
            return
        before = self._said.get(vehicle)
        warned_s = math.nan if before is None else before.warned_s
        if presence.warning and (before is None or presence.warning != before.presence.warning):
            warned_s = now
        self._said[vehicle] = Said(presence=presence, received_s=now, warned_s=warned_s)

    def _note_clock(self, offset_s: float) -> None:
        """Learn what to add to the own clock for the formation's: the message that took least counts."""
        known = self._offset_s
        if known is None or offset_s > known or known - offset_s > STEP_S:
            self._offset_s = offset_s
        else:
            self._offset_s = known + 0.02 * (offset_s - known)

    def sample(self, now: float) -> FloatArray:
        """(vehicles, series) values of this moment, which are added to the history; NaN is not known."""
        values = np.full((len(self.names), len(SERIES)), math.nan)
        carried: dict[int, tuple[complex, complex]] = {}
        for row, name in enumerate(self.names):
            values[row, -2:] = MODES.index(self._mode(name)), self._age(name, now)
            heard = self._heard.get(name)
            if heard is None or now - heard.received_s > KEPT_S:
                continue
            passed_s = now + (self._offset_s or 0.0) - heard.message.time_s
            # A vehicle whose messages take less than the leader's is heard ahead of the moment.
            carried_s = min(max(passed_s, -CARRIED_S), CARRIED_S)
            place, velocity = carry(heard, carried_s)
            fresh = now - heard.received_s <= CARRIED_S
            if fresh:
                carried[row] = place, velocity
            values[row, :-2] = self._numbers(name, heard.message, place, velocity, fresh=fresh)
            values[row, 2] += heard.climb * carried_s
        self._reckon_slots(values, carried)
        self._near = self._nearness(values, sorted(carried))
        self.history.add(now, values)
        return values

    def _numbers(
        self, name: str, message: LeaderMessage, place: complex, velocity: complex, *, fresh: bool
    ) -> list[float]:
        """What `SERIES` names but for mode and age; slots are reckoned later."""
        course = math.degrees(cmath.phase(velocity)) if fresh else math.nan
        speed = abs(velocity)
        wind = self._wind(name)
        air = velocity - wind if cmath.isfinite(wind) else velocity
        bank = math.degrees(math.atan(message.turn_rate * speed / GRAVITY)) if fresh else 0.0
        return [
            place.real,
            place.imag,
            message.altitude_amsl,
            course,
            math.degrees(cmath.phase(air)),
            bank,
            speed if fresh else math.nan,
            abs(air) if fresh and cmath.isfinite(wind) else math.nan,
            wind.real,
            wind.imag,
            math.nan,
            math.nan,
        ]

    def _reckon_slots(
        self, values: FloatArray, carried: Mapping[int, tuple[complex, complex]]
    ) -> None:
        """Where the slots are as their vehicles see them, along and right of the leader's course."""
        if 0 not in carried:
            return
        led, velocity = carried[0]
        ahead = cmath.rect(1.0, cmath.phase(velocity))
        for row, (place, _) in carried.items():
            if row:
                forward, right, _ = self._slots[row]
                off = complex(forward, right) - (place - led) / ahead
                values[row, 10:12] = off.real, off.imag

    def _nearness(self, values: FloatArray, rows: list[int]) -> tuple[Nearness, ...]:
        """Every two vehicles that are heard now and nearer than they should ever be."""
        places, slots = values[rows, :3], self._slots[rows]
        first, second = np.triu_indices(len(rows), 1)
        distance = np.linalg.norm(places[first] - places[second], axis=1)
        wanted = np.linalg.norm(slots[first] - slots[second], axis=1)
        near = Nearness.is_too_near(distance, wanted)
        return tuple(
            Nearness(
                first=self.names[rows[first[i]]],
                second=self.names[rows[second[i]]],
                distance_m=float(distance[i]),
            )
            for i in np.flatnonzero(near)
        )

    def cards(self, now: float) -> list[dict[str, object]]:
        """What is said of each vehicle in words, ready for JSON; its numbers are in the samples."""
        alarms: dict[str, str] = {}
        for alarm in self.alarms(now):
            for name in alarm.vehicles:
                if alarms.get(name) != "alarm":
                    alarms[name] = alarm.level
        return [self._card(name, alarms.get(name, "good"), now) for name in self.names]

    def _card(self, name: str, level: str, now: float) -> dict[str, object]:
        said = self._said.get(name)
        if said is None:
            return {"level": level, "autopilot": "", "warning": "", "hears_s": None, "signed": None}
        presence = said.presence
        hears_ms = presence.figures.get("leader_age_ms_last")
        leads = name == self.names[0]
        return {
            "level": level,
            "autopilot": presence.autopilot,
            "warning": presence.warning,
            "warned_s": None if math.isnan(said.warned_s) else round(now - said.warned_s),
            "hears_s": None if hears_ms is None or leads else round(hears_ms * 1e-3, 2),
            "signed": presence.signed,
        }

    def alarms(self, now: float) -> list[Alarm]:
        """What somebody should look at or do, the worst first."""
        known = [self._knowledge(name, now) for name in self.names]
        return alarms_of(known, self._near, patience=self._mission.patience)

    def _knowledge(self, name: str, now: float) -> Knowledge:
        said, heard = self._said.get(name), self._heard.get(name)
        return Knowledge(
            name=name,
            leads=name == self.names[0],
            mode=None if said is None else said.presence.mode,
            offline=said is not None and said.presence.status == "offline",
            state_age_s=math.inf if heard is None else now - heard.received_s,
            autopilot="" if said is None else said.presence.autopilot,
            links_lost=0 if said is None else int(said.presence.figures.get("links_lost", 0.0)),
        )

    def _mode(self, name: str) -> str:
        said = self._said.get(name)
        if said is None:
            return "not known"
        if said.presence.status == "offline":
            return "offline"
        return said.presence.mode if said.presence.mode in MODES else "not known"

    def _age(self, name: str, now: float) -> float:
        heard = self._heard.get(name)
        return math.nan if heard is None else min(now - heard.received_s, OLDEST_S)

    def _wind(self, name: str) -> complex:
        """Of a vehicle as it says itself, else as the leader does, m/s; NaN while neither does."""
        for one in (name, self.names[0]):
            said = self._said.get(one)
            figures = {} if said is None else said.presence.figures
            if "wind_north_m_s" in figures and "wind_east_m_s" in figures:
                return complex(figures["wind_north_m_s"], figures["wind_east_m_s"])
        return complex(math.nan, math.nan)

    def describe(self) -> dict[str, object]:
        """The flight so far, as the replay reads one."""
        day, night = colours_of(self.names), colours_of(self.names, NIGHT_COLOURS)
        north, east = drawn_path(self._mission)
        time_ms = np.round(1000.0 * self.history.time_s)
        return {
            "format": FORMAT,
            "live": True,
            "mission": self._mission.name,
            "estimated": True,
            "time": encode(time_ms, Kind(unit=0.001, bits=32), in_units=True),
            "window_s": [0.0, 0.0],
            "modes": list(MODES),
            "path": {"north_m": rounded(north), "east_m": rounded(east)},
            "names": list(SERIES),
            "vehicles": [
                {
                    "name": name,
                    "leads": row == 0,
                    "slot": [float(one) for one in self._slots[row]],
                    "colours": [day[name], night[name]],
                    "series": {
                        series: encode(self.history.series(row, number), CONSOLE_KINDS[series])
                        for number, series in enumerate(SERIES)
                    },
                }
                for row, name in enumerate(self.names)
            ],
        }


def slot_of(mission: Mission, name: str) -> tuple[float, float, float]:
    """Forward, right and up of a vehicle's slot, m; the leader's is where it is."""
    follower = mission.followers_by_name.get(name)
    if follower is None:
        return 0.0, 0.0, 0.0
    return follower.slot.forward_m, follower.slot.right_m, follower.slot.up_m


def climb_between(before: Heard | None, message: LeaderMessage) -> float:
    """How fast a vehicle climbs, m/s, by its last states."""
    if before is None:
        return 0.0
    passed_s = message.time_s - before.message.time_s
    if not 0.0 < passed_s < CARRIED_S:
        return 0.0
    newest = (message.altitude_amsl - before.message.altitude_amsl) / passed_s
    newest = min(max(newest, -STEEPEST_M_S), STEEPEST_M_S)
    return before.climb + min(passed_s / CLIMB_S, 1.0) * (newest - before.climb)


def carry(heard: Heard, seconds: float) -> tuple[complex, complex]:
    """(place in m, velocity in m/s) some seconds after a state, along the turn that it flew."""
    message = heard.message
    half_turn = cmath.rect(1.0, 0.5 * message.turn_rate * seconds)
    velocity = cmath.rect(message.ground_speed, message.course) * half_turn
    return heard.place + velocity * seconds, velocity * half_turn


def drawn_path(mission: Mission) -> tuple[FloatArray, FloatArray]:
    """(north, east) of points along the path, m: once round it, or as far as the rehearsal flies along it."""
    path = path_of(mission.path)
    if math.isfinite(path.length):
        progress = path.outline(DRAWN_POINTS)
    else:
        reach_m = mission.leader.airspeed_m_s * mission.rehearsal.duration_s
        progress = np.linspace(0.0, reach_m, DRAWN_POINTS)
    places = path.at(progress)
    return places.north, places.east
