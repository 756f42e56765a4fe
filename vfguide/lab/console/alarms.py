"""Alarms of a formation, each a sentence that says what to do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vfguide.companion.possibilities import SPACING_SHARE
from vfguide.companion.supervisor import Mode
from vfguide.companion.traffic import HOLD_M
from vfguide.elementwise import BoolArray, FloatArray
from vfguide.lab.report.replay import KINDS, SLOT_KINDS, SeriesKind
from vfguide.mission.model import Timeouts

# The numbers of a vehicle in each sample of the console, and the samples of a flight so far.
#
# They have a bounded room: the newest minute is kept whole, the rest coarser.

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
    "slot_north_m",
    "slot_east_m",
    "slot_altitude_m",
    "mode",
    "age_s",
)
"""The numbers of a vehicle in a sample, by the names that the replay has for them."""

COLUMNS = {name: number for number, name in enumerate(SERIES)}

FLOWN_AS = COLUMNS["along_m"]
"""The series before this one are of the vehicle alone."""

CONSOLE_KINDS = {**KINDS, **SLOT_KINDS, "age_s": SeriesKind(unit=0.01, bits=16)}
"""How they are written."""

FINE_S = 60.0
"""The newest samples, which are kept as they came, s."""

FIRST_STEP_S = 0.2
"""Shortest interval of two older samples, before the room first runs out, s."""

KEPT_SHARE = 0.75
"""Share of the room that is in use, at most, after samples have been left out."""


class History:
    """Samples of some series of some vehicles, in order of time."""

    def __init__(self, vehicles: int, series: int, *, room: int = 8000) -> None:
        """Make an empty one.

        Args:
            vehicles: how many there are.
            series: how many numbers each sample has of a vehicle.
            room: how many samples are kept at most.
        """
        self._time_s = np.empty(room, dtype=np.float64)
        self._values = np.empty((room, vehicles, series), dtype=np.float32)
        self._count = 0
        self._step_s = FIRST_STEP_S

    @property
    def time_s(self) -> FloatArray:
        """N times, ascending, s."""
        return self._time_s[: self._count]

    def series(self, vehicle: int, number: int) -> FloatArray:
        """N values of one series of one vehicle."""
        return self._values[: self._count, vehicle, number].astype(np.float64)

    def add(self, time_s: float, values: FloatArray) -> None:
        """Add a sample: (vehicles, series) values at a time later than all before; others are passed over."""
        if self._count and time_s <= self._time_s[self._count - 1]:
            return
        if self._count == self._time_s.size:
            self._thin(time_s)
        self._time_s[self._count] = time_s
        self._values[self._count] = values
        self._count += 1

    def _thin(self, now_s: float) -> None:
        """Leave older samples out, as few as possible, so that there is room again."""
        time_s = self.time_s
        fine = time_s > now_s - FINE_S
        # Samples that come faster than there is room for a minute of them are coarser from the first.
        if fine.sum() > 0.5 * time_s.size:
            fine = np.arange(time_s.size) >= 0.5 * time_s.size
        while True:
            spans = np.floor(time_s / self._step_s)
            kept = fine | (np.diff(spans, prepend=-np.inf) > 0.0)
            if kept.sum() <= KEPT_SHARE * time_s.size:
                break
            self._step_s *= 2.0
        count = int(kept.sum())
        self._time_s[:count] = time_s[kept]
        self._values[:count] = self._values[: self._count][kept]
        self._count = count


Level = Literal["alarm", "note"]
"""How pressing something is: an alarm wants a person to act, a note wants a person to look."""

SILENT_S = 2.0
"""Without a state for so long a vehicle counts as silent: it may be anywhere by then."""

MOST_NEAR = 4
"""Pairs of vehicles that are named at once."""


OF_MODES: Mapping[str, tuple[Level, str]] = {
    Mode.PREDICTING.value: (
        "alarm",
        (
            "does not hear the leader and follows its plan: mend the link within {prediction_s:g} s, then the"
            " formation breaks up by itself."
        ),
    ),
    Mode.BREAKAWAY.value: (
        "alarm",
        (
            "flies away from the others, as the leader was silent for too long: give it room, and be ready"
            " to take it over."
        ),
    ),
    Mode.LOST.value: (
        "alarm",
        (
            "was given back to its autopilot, without a leader: take it over, or mend the link and select"
            " the guided mode again."
        ),
    ),
    Mode.PILOT.value: (
        "note",
        "is flown by its pilot{by}: select the guided mode to have it join again.",
    ),
    Mode.WAITING.value: (
        "note",
        "is not steered{by}: see that it is armed and in the guided mode, and has a position.",
    ),
}
"""What is wrong with a vehicle whose companion is in a mode, after its name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """Something that the person at the console should know."""

    level: Level
    """How bad it is."""
    text: str
    """One sentence, with what to do."""
    vehicles: tuple[str, ...] = ()
    """Whom it is about."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """What is known of a vehicle."""

    name: str
    """Name of the vehicle."""
    leads: bool
    """Whether it is the leader."""
    mode: str | None
    """Mode of its companion; None before the companion has said anything."""
    offline: bool
    """Whether the broker has lost its companion."""
    state_age_s: float
    """Since its newest state came; infinite before the first."""
    autopilot: str
    """Mode of its autopilot; empty while not known."""
    links_lost: int
    """How many of its links do not stand."""
    ordered_away: bool = False
    """Whether an order leaves it to its autopilot: then it is not steered, and nothing is wrong with that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearness:
    """Two vehicles that are too near to each other."""

    first: str
    """One of them."""
    second: str
    """The other."""
    distance_m: float
    """Distance between them, m."""

    @staticmethod
    def is_too_near(distance_m: FloatArray, wanted_m: FloatArray) -> BoolArray:
        """Whether distances are below what companions keep, by the distances between their slots, m.

        Where a slot is not known (NaN) it is what companions keep of others without one.
        """
        near: BoolArray = distance_m < np.fmin(HOLD_M, SPACING_SHARE * wanted_m)
        return near


def alarms_of(
    known: Sequence[Knowledge], near: Sequence[Nearness], *, patience: Timeouts
) -> list[Alarm]:
    """What the person at the console should look at or do, the worst first."""
    found = [
        Alarm(
            level="alarm",
            text=f"{pair.first} and {pair.second} are {pair.distance_m:.0f} m apart:"
            " take one of them out of the formation by hand.",
            vehicles=(pair.first, pair.second),
        )
        for pair in sorted(near, key=lambda pair: pair.distance_m)[:MOST_NEAR]
    ]
    silent = all(one.state_age_s > SILENT_S for one in known)
    newest_s = min(one.state_age_s for one in known)
    if silent and newest_s < float("inf"):
        text = (
            f"No aircraft has been heard for {newest_s:.0f} s, what you see is old: keep the airspace clear"
            " and see that the link stands."
        )
        found.append(Alarm(level="alarm", text=text, vehicles=tuple(one.name for one in known)))
    for one in known:
        level, text = describe_trouble(one, patience, all_silent=silent)
        if text:
            found.append(Alarm(level=level, text=f"{one.name} {text}", vehicles=(one.name,)))
    return sorted(found, key=lambda alarm: alarm.level != "alarm")


def describe_trouble(one: Knowledge, patience: Timeouts, *, all_silent: bool) -> tuple[Level, str]:
    """How bad it is and what to do, after the vehicle's name; empty where all is well.

    The first thing alone, which the others follow from.
    """
    if one.mode is None and one.state_age_s == float("inf"):
        return "note", (
            "has not been heard yet: see that its companion runs, on this link and with keys of this mission."
        )
    if one.offline:
        return "alarm", (
            "has lost its companion, and its autopilot flies by itself: watch it, take it over by hand, then"
            " start the companion again."
        )
    if one.state_age_s > SILENT_S and not all_silent:
        heard = (
            "has sent no position yet"
            if one.state_age_s == float("inf")
            else f"has not been heard for {one.state_age_s:.0f} s"
        )
        return "alarm", f"{heard}: look for it in the sky and keep the others away from it."
    return describe_mode(one, patience)


def describe_mode(one: Knowledge, patience: Timeouts) -> tuple[Level, str]:
    """Level and text of the mode that its companion is in."""
    if one.ordered_away and one.mode == Mode.WAITING.value:
        return "note", ""
    if one.mode is not None and one.mode in OF_MODES:
        level, text = OF_MODES[one.mode]
        by = f" ({one.autopilot})" if one.autopilot else ""
        return level, text.format(prediction_s=patience.prediction_s, by=by)
    if one.links_lost:
        return "note", "has lost one of its links and flies on by the other: mend it after landing."
    return "note", ""
