"""Alarms of a formation, each a sentence with what to do, and the history of a flight's samples."""

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

MODES = (*(mode.value for mode in Mode), "offline", "not known")
"""States that a card can show, by number."""

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
"""Series of a vehicle in a sample, with the replay's names."""

COLUMNS = {name: number for number, name in enumerate(SERIES)}

FLOWN_AS = COLUMNS["along_m"]
"""Index of the first series that refers to the formation; those before it are of the vehicle alone."""

CONSOLE_KINDS = {**KINDS, **SLOT_KINDS, "age_s": SeriesKind(unit=0.01, bits=16)}
"""Number formats of the series."""

FINE_S = 60.0
"""Age up to which all samples are kept."""

FIRST_STEP_S = 0.2
"""Shortest interval of older samples, before the capacity first runs out."""

KEPT_SHARE = 0.75
"""Largest share of the capacity in use after samples were left out."""


class History:
    """Samples of several vehicles' series, in order of time and bounded in number.

    The newest minute is kept whole if it fits, and older samples get coarser.
    """

    def __init__(self, vehicles: int, series: int, *, room: int = 8000) -> None:
        self._time_s = np.empty(room, dtype=np.float64)
        self._values = np.empty((room, vehicles, series), dtype=np.float32)
        self._count = 0
        self._step_s = FIRST_STEP_S

    @property
    def time_s(self) -> FloatArray:
        """N times, ascending."""
        return self._time_s[: self._count]

    def series(self, vehicle: int, number: int) -> FloatArray:
        """Return the N values of one series of one vehicle."""
        return self._values[: self._count, vehicle, number].astype(np.float64)

    def add(self, time_s: float, values: FloatArray) -> None:
        """Add a sample of shape (vehicles, series); it is ignored unless later than all others."""
        if self._count and time_s <= self._time_s[self._count - 1]:
            return
        if self._count == self._time_s.size:
            self._thin(time_s)
        self._time_s[self._count] = time_s
        self._values[self._count] = values
        self._count += 1

    def _thin(self, now_s: float) -> None:
        """Leave out as few older samples as make room again."""
        time_s = self.time_s
        fine = time_s > now_s - FINE_S
        # If a minute of samples exceeds half of the capacity, only the newest half stays whole.
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
"""Urgency: an alarm demands action, a note attention."""

SILENT_S = 2.0
"""Age of a state from which a vehicle counts as silent: it may be anywhere by then."""

MOST_NEAR = 4
"""Largest number of pairs named at once."""

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
"""Trouble by mode of the companion, as a sentence after the vehicle's name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """Message to the person at the console."""

    level: Level
    text: str
    """One sentence, with what to do."""
    vehicles: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """Knowledge about a vehicle."""

    name: str
    leads: bool
    mode: str | None
    """Mode of the companion; None before its first report."""
    offline: bool
    """Whether the broker has lost the companion."""
    state_age_s: float
    """Age of the newest state; infinite before the first."""
    autopilot: str
    """Mode of the autopilot; empty while unknown."""
    links_lost: int
    """Number of the vehicle's links that are down."""
    ordered_away: bool = False
    """Whether an order leaves the vehicle to its autopilot: not being steered is no trouble then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearness:
    """Two vehicles that are too close to each other."""

    first: str
    second: str
    distance_m: float

    @staticmethod
    def is_too_near(distance_m: FloatArray, wanted_m: FloatArray) -> BoolArray:
        """Compare distances with what companions keep, for the distances between slots, m.

        With an unknown slot distance (NaN) the limit is `HOLD_M`.
        """
        near: BoolArray = distance_m < np.fmin(HOLD_M, SPACING_SHARE * wanted_m)
        return near


def alarms_of(
    known: Sequence[Knowledge], near: Sequence[Nearness], *, patience: Timeouts
) -> list[Alarm]:
    """Return all alarms and notes, alarms first."""
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
    """Return level and sentence after the vehicle's name for its first trouble; empty if all is well.

    Only the first trouble is told, since the others follow from it.
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
    """Return level and sentence for the companion's mode."""
    if one.ordered_away and one.mode == Mode.WAITING.value:
        return "note", ""
    if one.mode is not None and one.mode in OF_MODES:
        level, text = OF_MODES[one.mode]
        by = f" ({one.autopilot})" if one.autopilot else ""
        return level, text.format(prediction_s=patience.prediction_s, by=by)
    if one.links_lost:
        return "note", "has lost one of its links and flies on by the other: mend it after landing."
    return "note", ""
