"""Model of the console: states and presences in, displayed values out. It does no input or output.

Times are seconds since the console began. Positions are metres north and east of the mission's origin,
altitudes are above mean sea level.
"""

import cmath
import math
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vfguide.companion.mission_plan import local_frame
from vfguide.elementwise import FloatArray
from vfguide.formation.arrangement import MAIN_PATH, Arrangement, Manoeuvre, flown_in_words
from vfguide.lab.console.alarms import (
    COLUMNS,
    CONSOLE_KINDS,
    FLOWN_AS,
    MODES,
    SERIES,
    Alarm,
    History,
    Knowledge,
    Nearness,
    alarms_of,
)
from vfguide.lab.rehearsal.recorder import fence_edges, limits_of, rally_points
from vfguide.lab.report.colours import NIGHT_COLOURS, colours_of
from vfguide.lab.report.replay import FORMAT, SeriesKind, encode, ground_line
from vfguide.link.codec import LeaderMessage, LinkDataError, decode
from vfguide.link.presence import BATTERY, BATTERY_VOLTAGE, LEADER_FIGURES, Presence
from vfguide.mission import Mission
from vfguide.mission.flight_path import PathShape, path_of

DRAWN_POINTS = 400


def describe_ground(mission: Mission) -> dict[str, object]:
    """Return all paths by name and the outlines (fence edges, rally points), ready for JSON."""
    rally = rally_points(mission)
    return {
        "paths": {
            name: ground_line(*drawn_path(mission, shape))
            for name, shape in mission.paths_by_name.items()
        },
        "outlines": [
            *({"kind": "fence", **ground_line(*edge)} for edge in fence_edges(mission)),
            *([{"kind": "rally", **ground_line(*rally)}] if rally[0].size else []),
        ],
    }


def drawn_path(mission: Mission, shape: PathShape) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of points once round a path, or as far along as the rehearsal flies, m."""
    path = path_of(shape)
    if math.isfinite(path.length):
        progress = path.outline(DRAWN_POINTS)
    else:
        reach_m = mission.leader.airspeed_m_s * mission.rehearsal.duration_s
        progress = np.linspace(0.0, reach_m, DRAWN_POINTS)
    places = path.at(progress)
    return places.north, places.east


CARRIED_S = 2.0
"""Longest extrapolation of a state along its turn, s; older states give no slot."""

CLIMB_S = 0.5
"""Averaging time of climb rates, s."""

STEEPEST_M_S = 20.0
"""Limit of a climb rate, m/s; a steeper step is a corrected altitude, not a climb."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateReport:
    """Newest state of a vehicle."""

    message: LeaderMessage
    place: complex
    """Position: north as real part, east as imaginary part, m."""
    climb: float
    """Climb rate, m/s, from successive altitudes: the message has none."""
    received_s: float


def climb_between(before: StateReport | None, message: LeaderMessage) -> float:
    """Return the averaged climb rate of a vehicle after a new message, m/s; 0 where it is not known."""
    if before is None:
        return 0.0
    passed_s = message.time_s - before.message.time_s
    if not 0.0 < passed_s < CARRIED_S:
        return 0.0
    newest = (message.altitude_amsl - before.message.altitude_amsl) / passed_s
    newest = min(max(newest, -STEEPEST_M_S), STEEPEST_M_S)
    return before.climb + min(passed_s / CLIMB_S, 1.0) * (newest - before.climb)


def carry(heard: StateReport, seconds: float) -> tuple[complex, complex]:
    """Extrapolate a state at its turn rate; return (position in m, velocity in m/s)."""
    message = heard.message
    half_turn = cmath.rect(1.0, 0.5 * message.turn_rate * seconds)
    velocity = cmath.rect(message.ground_speed, message.course) * half_turn
    return heard.place + velocity * seconds, velocity * half_turn


GRAVITY = 9.80665
"""Standard gravity, m/s²."""

KEPT_S = 15.0
"""Time for which the last position of a silent vehicle is shown, s."""

MOST_CHANGES = 1000
"""Maximum number of kept changes of the order or the leader."""

OLDEST_S = 300.0
"""Greatest age that is shown, s."""

STEP_S = 0.3
"""Drop of the clock offset, s, that shows that a clock was set or flight is slower than real time."""

GREATEST_OF_LEADER = (OLDEST_S, 1e6, 1e6, 50e3, 10.0, 500.0, 10.0)
"""Greatest credible magnitudes of `LEADER_FIGURES`, reported by followers of a leader without a companion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceReport:
    """Newest presence of a vehicle."""

    presence: Presence
    received_s: float
    warned_s: float
    """Time at which its last warning was new; NaN before the first."""


class FormationModel:
    """Formation as known to a listener that hears every vehicle."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._frame = local_frame(mission)
        self.names = (mission.leader.vehicle, *mission.followers_by_name)
        """Vehicle names, leader first."""
        self.history = History(len(self.names), len(SERIES))
        self.counters: Counter[str] = Counter()
        """Messages that were not used, by reason."""
        self._rows = {name: row for row, name in enumerate(self.names)}
        self._slots = np.array([slot_of(mission, name) for name in self.names])
        self._lead: StateReport | None = None
        self._leads = self.names[0]
        self._number = 0
        self._order: Arrangement | None = None
        self._path = MAIN_PATH
        self._flown: deque[dict[str, object]] = deque(maxlen=MOST_CHANGES)
        self._heard: dict[str, StateReport] = {}
        self._said: dict[str, PresenceReport] = {}
        self._offset_s: float | None = None
        self._near: tuple[Nearness, ...] = ()
        self._note_flown()

    @property
    def heard_anything(self) -> bool:
        """Whether any vehicle has been heard."""
        return bool(self._heard or self._said)

    def take_state(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state message of a vehicle; count it where it cannot be decoded."""
        if vehicle not in self._rows:
            return
        try:
            message = decode(data)
        except LinkDataError:
            self.counters["no state"] += 1
            return
        self._heard[vehicle] = self._heard_of(self._heard.get(vehicle), message, now)
        leader = self._heard.get(self.names[0])
        foreign = self._mission.leader.is_foreign
        if (
            vehicle == self.names[0]
            or foreign
            or leader is None
            or now - leader.received_s > CARRIED_S
        ):
            self._note_clock(message.time_s - now)

    def _heard_of(
        self, before: StateReport | None, message: LeaderMessage, now: float
    ) -> StateReport:
        place = complex(*self._frame.to_local(message.latitude_deg, message.longitude_deg))
        climb = climb_between(before, message)
        return StateReport(message=message, place=place, climb=climb, received_s=now)

    def take_presence(self, vehicle: str, presence: Presence, now: float) -> None:
        """Take the presence of a vehicle."""
        if vehicle not in self._rows:
            return
        before = self._said.get(vehicle)
        warned_s = math.nan if before is None else before.warned_s
        if presence.warning and (before is None or presence.warning != before.presence.warning):
            warned_s = now
        if self._mission.leader.is_foreign:
            self._take_foreign_leader(presence, now)
        self._said[vehicle] = PresenceReport(presence=presence, received_s=now, warned_s=warned_s)

    def take_lead(self, data: bytes, now: float) -> None:
        """Take the leader state that a deputy publishes while it leads in the leader's place."""
        self._lead = self._heard_of(self._lead, decode(data), now)

    def take_order(self, number: int, order: Arrangement | None, *, leads: str) -> None:
        """Take the leader's name and the order flown: number 0 before the first, None where not heard."""
        self._number, self._order, self._leads = number, order, leads
        # The path flown before is the best guess while the order is not known.
        if order is not None:
            self._path = order.path
        self._note_flown()

    def _note_flown(self) -> None:
        flies, times = self.flies(), self.history.time_s
        if not self._flown or {**self._flown[-1], **flies} != self._flown[-1]:
            self._flown.append({"t": float(times[-1]) if times.size else 0.0, **flies})

    def _take_foreign_leader(self, presence: Presence, now: float) -> None:
        """Take a follower's report of a leader without a companion, where it is the newest of all."""
        found = [presence.figures.get(name, math.nan) for name in LEADER_FIGURES]
        # Written so that NaN, which compares false, is not sound.
        sound = all(abs(one) <= most for one, most in zip(found, GREATEST_OF_LEADER, strict=True))
        if self._offset_s is None or not sound:
            return
        age_s, north, east, altitude, course, speed, turn_rate = found
        before, heard_s = self._heard.get(self.names[0]), now - max(age_s, 0.0)
        if before is not None and heard_s <= before.received_s:
            return
        message = LeaderMessage(
            sequence=0,
            time_s=heard_s + self._offset_s,
            latitude_deg=0.0,
            longitude_deg=0.0,
            altitude_amsl=altitude,
            course=course,
            ground_speed=speed,
            acceleration=0.0,
            turn_rate=turn_rate,
            turn_acceleration=0.0,
        )
        self._heard[self.names[0]] = StateReport(
            message=message,
            place=complex(north, east),
            climb=climb_between(before, message),
            received_s=heard_s,
        )

    def _note_clock(self, offset_s: float) -> None:
        """Update the offset from the own clock to the formation's; the message with least latency counts."""
        known = self._offset_s
        if known is None or offset_s > known or known - offset_s > STEP_S:
            self._offset_s = offset_s
        else:
            self._offset_s = known + 0.02 * (offset_s - known)

    def sample(self, now: float) -> FloatArray:
        """Add this moment's values to the history; return them as (vehicles, series), NaN where not known."""
        values = np.full((len(self.names), len(SERIES)), math.nan)
        carried: dict[int, tuple[complex, complex]] = {}
        for row, name in enumerate(self.names):
            values[row, -2:] = MODES.index(self._mode(name)), self._age(name, now)
            heard = self._heard.get(name)
            if heard is None or now - heard.received_s > KEPT_S:
                continue
            carried_s = self._carried_s(heard, now)
            place, velocity = carry(heard, carried_s)
            fresh = now - heard.received_s <= CARRIED_S
            if fresh:
                carried[row] = place, velocity
            numbers = self._numbers(name, heard.message, place, velocity, fresh=fresh)
            values[row, :FLOWN_AS] = numbers
            values[row, COLUMNS["altitude_m"]] += heard.climb * carried_s
        slots = self._slots_at(now)
        self._reckon_slots(values, slots, carried, now)
        self._near = self._nearness(values, slots, sorted(carried))
        self.history.add(now, values)
        return values

    def _carried_s(self, heard: StateReport, now: float) -> float:
        passed_s = now + (self._offset_s or 0.0) - heard.message.time_s
        # Negative where a vehicle's messages have less latency than the leader's.
        return min(max(passed_s, -CARRIED_S), CARRIED_S)

    def _slots_at(self, now: float) -> FloatArray:
        """Return forward, right and up of all slots, m, shape (vehicles, 3); NaN where not known."""
        if self._number == 0:
            return self._slots
        slots = np.full_like(self._slots, math.nan)
        slots[0] = 0.0
        order = self._order
        if order is None or order.flown is Manoeuvre.ABORT:
            return slots
        time_s = now + (self._offset_s or 0.0)
        for name in order.vehicles & self._rows.keys():
            slot, (up, _) = order.slot(name, time_s), order.height(name, time_s)
            slots[self._rows[name]] = slot.forward, slot.right, up
        return slots

    def _numbers(
        self, name: str, message: LeaderMessage, place: complex, velocity: complex, *, fresh: bool
    ) -> list[float]:
        """Return the first `FLOWN_AS` values of `SERIES`: those of the vehicle alone."""
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
        ]

    def _reference(
        self, values: FloatArray, carried: Mapping[int, tuple[complex, complex]], now: float
    ) -> tuple[complex, complex, float] | None:
        """Return (position in m, velocity in m/s, altitude in m) of the reference of all slots, if known."""
        lead = self._lead
        if self._leads != self.names[0]:
            if lead is None or now - lead.received_s > CARRIED_S:
                return None
            carried_s = self._carried_s(lead, now)
            altitude = lead.message.altitude_amsl + lead.climb * carried_s
            return *carry(lead, carried_s), altitude
        if 0 not in carried:
            return None
        return *carried[0], float(values[0, COLUMNS["altitude_m"]])

    def _reckon_slots(
        self,
        values: FloatArray,
        slots: FloatArray,
        carried: Mapping[int, tuple[complex, complex]],
        now: float,
    ) -> None:
        """Fill in slot positions and the offsets to them, m, ahead and right along the leader's course."""
        reference = self._reference(values, carried, now)
        if reference is None:
            return
        led, velocity, altitude = reference
        ahead = cmath.rect(1.0, cmath.phase(velocity))
        first = COLUMNS["slot_north_m"]
        for row, (forward, right, up) in enumerate(slots.tolist()):
            if not row or math.isnan(forward):
                continue
            slot = led + complex(forward, right) * ahead
            values[row, first : first + 3] = slot.real, slot.imag, altitude + up
            if row in carried:
                off = (slot - carried[row][0]) / ahead
                values[row, FLOWN_AS : FLOWN_AS + 2] = off.real, off.imag

    def _nearness(
        self, values: FloatArray, slots: FloatArray, rows: list[int]
    ) -> tuple[Nearness, ...]:
        """Return the pairs of vehicles that are too near each other, of the vehicles in some rows."""
        places, slots = values[rows, :3], slots[rows]
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

    def flies(self) -> dict[str, object]:
        """Return the vehicle that leads, the order and the path, ready for JSON."""
        succeeded = self._leads != self.names[0]
        return {
            "leads": self._leads,
            "succeeded": succeeded,
            "number": self._number,
            "order": flown_in_words(self._number, self._order),
            "path": self._path,
        }

    def cards(self, now: float) -> list[dict[str, object]]:
        """Return the card of each vehicle, ready for JSON, without the numbers that are in the samples."""
        alarms: dict[str, str] = {}
        for alarm in self.alarms(now):
            for name in alarm.vehicles:
                if alarms.get(name) != "alarm":
                    alarms[name] = alarm.level
        return [self._card(name, alarms.get(name, "good"), now) for name in self.names]

    def _card(self, name: str, level: str, now: float) -> dict[str, object]:
        said, leads = self._said.get(name), name == self._leads
        if said is None:
            unknown = {"autopilot": "", "warning": "", "hears_s": None, "signed": None}
            unknown |= {"battery_percent": None, "battery_v": None}
            return {"level": level, "leads": leads, **unknown}
        presence = said.presence
        hears_ms = presence.figures.get("leader_age_ms_last")
        return {
            "level": level,
            "leads": leads,
            "autopilot": presence.autopilot,
            "warning": presence.warning,
            "warned_s": None if math.isnan(said.warned_s) else round(now - said.warned_s),
            "hears_s": None if hears_ms is None or leads else round(hears_ms * 1e-3, 2),
            "signed": presence.signed,
            BATTERY: presence.figures.get(BATTERY),
            BATTERY_VOLTAGE: presence.figures.get(BATTERY_VOLTAGE),
        }

    def alarms(self, now: float) -> list[Alarm]:
        """Return the alarms for the person at the console, worst first."""
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
            ordered_away=self._is_ordered_away(name),
            links_lost=0 if said is None else int(said.presence.figures.get("links_lost", 0.0)),
        )

    def _is_ordered_away(self, name: str) -> bool:
        order = self._order
        if order is None:
            return False
        return order.flown is Manoeuvre.ABORT or (
            name != self.names[0] and name not in order.vehicles
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
        """Return the wind that a vehicle reports, or else the leader, m/s; NaN where neither does."""
        for one in (name, self.names[0]):
            said = self._said.get(one)
            figures = {} if said is None else said.presence.figures
            if "wind_north_m_s" in figures and "wind_east_m_s" in figures:
                return complex(figures["wind_north_m_s"], figures["wind_east_m_s"])
        return complex(math.nan, math.nan)

    def describe(self) -> dict[str, object]:
        """Return the flight so far in the format of the replay, ready for JSON."""
        day, night = colours_of(self.names), colours_of(self.names, NIGHT_COLOURS)
        time_ms = np.round(1000.0 * self.history.time_s)
        return {
            "format": FORMAT,
            "live": True,
            "mission": self._mission.name,
            "estimated": True,
            "time": encode(time_ms, SeriesKind(unit=0.001, bits=32), in_units=True),
            "window_s": [0.0, 0.0],
            "modes": list(MODES),
            "ground": describe_ground(self._mission),
            "flown": list(self._flown),
            "names": list(SERIES),
            "vehicles": [
                {
                    "name": name,
                    "leads": row == 0,
                    "slot": [float(one) for one in self._slots[row]],
                    "colours": [day[name], night[name]],
                    "limits": limits_of(self._mission.vehicles[name]).describe(),
                    "series": {
                        series: encode(self.history.series(row, number), CONSOLE_KINDS[series])
                        for number, series in enumerate(SERIES)
                    },
                }
                for row, name in enumerate(self.names)
            ],
        }


def slot_of(mission: Mission, name: str) -> tuple[float, float, float]:
    """Return forward, right and up of a vehicle's slot, m; zeros for the leader."""
    follower = mission.followers_by_name.get(name)
    if follower is None:
        return 0.0, 0.0, 0.0
    return follower.slot.forward_m, follower.slot.right_m, follower.slot.up_m
