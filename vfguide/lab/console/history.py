"""The numbers of a vehicle in each sample of the console, and the samples of a flight so far.

They have a bounded room: the newest minute is kept whole, the rest coarser.
"""

import numpy as np

from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.lab.report.replay.data import KINDS, SLOT_KINDS, SeriesKind

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
