"""What goes wrong with an autopilot's reports while the aircraft flies on: for tests and measurements.

The autopilot itself flies by the truth meanwhile, as one with two receivers does: what is measured is what
becomes of a companion that is told the wrong thing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from sitl_stub.motion import Motion

FaultKind = Literal["offset", "frozen", "zero", "velocity", "airspeed", "clock"]

Place = tuple[float, float]
"""Latitude and longitude, rad."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that is wrong for a while."""

    kind: FaultKind
    """`offset`: positions are `north`, `east` metres off. `frozen`: positions stay as they were. `zero`:
    latitude and longitude are 0. `velocity`: the ground velocity is `north`, `east` m/s. `airspeed`: it is
    `north` m/s. `clock`: the autopilot's clock loses `north` seconds, evenly over the time."""

    start_s: float
    """Simulation time of its beginning."""

    length_s: float
    """How long it lasts; may be infinite."""

    north: float = 0.0
    """See `kind`."""

    east: float = 0.0
    """See `kind`."""

    def __post_init__(self) -> None:
        """Refuse what is no fault.

        Raises:
            ValueError: the kind is unknown, or a number is out of its range.
        """
        sound = math.isfinite(self.start_s + self.north + self.east) and self.start_s >= 0.0
        if self.kind not in get_args(FaultKind) or not sound or not self.length_s > 0.0:
            raise ValueError(f"{self} is no fault")

    def is_on(self, time_s: float) -> bool:
        """Whether it is present at a simulation time."""
        return 0.0 <= time_s - self.start_s < self.length_s

    def lost_s(self, time_s: float) -> float:
        """What the clock has lost by a simulation time, s."""
        if self.kind != "clock" or time_s <= self.start_s:
            return 0.0
        return self.north * min((time_s - self.start_s) / self.length_s, 1.0)


class Faults:
    """The faults of one autopilot, present and to come."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._faults = list(faults)
        self._frozen: Place | None = None

    def add(self, fault: Fault) -> None:
        """One more."""
        self._faults.append(fault)

    def lost_s(self, time_s: float) -> float:
        """What the clock has lost by a simulation time, s."""
        return sum(fault.lost_s(time_s) for fault in self._faults) if self._faults else 0.0

    def offset_m(self, time_s: float) -> tuple[float, float]:
        """(north, east) in m by which positions are off."""
        present = [one for one in self._faults if one.kind == "offset" and one.is_on(time_s)]
        return sum(one.north for one in present), sum(one.east for one in present)

    def place(self, place: Place, time_s: float) -> Place:
        """The position as it is reported."""
        if not self._faults:
            return place
        kinds = {one.kind for one in self._faults if one.is_on(time_s)}
        if "frozen" not in kinds:
            self._frozen = place
        return (0.0, 0.0) if "zero" in kinds else self._frozen or place

    def motion(self, motion: Motion, time_s: float) -> Motion:
        """The motion as it is reported."""
        for fault in self._faults:
            if not fault.is_on(time_s):
                continue
            if fault.kind == "airspeed":
                motion = motion._replace(airspeed_m_s=fault.north)
            elif fault.kind == "velocity":
                motion = motion._replace(
                    north_m_s=fault.north,
                    east_m_s=fault.east,
                    ground_speed_m_s=math.hypot(fault.north, fault.east),
                )
        return motion
