"""Sensor errors, and faults of an autopilot's reports.

GNSS position errors wander over minutes. Nearby receivers share most of the error, since satellite orbits
and clocks, ionosphere and troposphere are the same for them. The rest is their own (reflections, receiver
noise). Each part is a Gauss-Markov process.

Sizes: u-blox, ZED-F9P data sheet (CEP 1.5 m alone, 1.0 m with SBAS, 0.01 m + 1 ppm with RTK; velocity
0.05 m/s); a CEP is 1.18 standard deviations per axis. Correlation time and noise of compass, airspeed and
barometer: Beard and McLain, Small Unmanned Aircraft, chapter 7 (1100 s; 0.3 deg, 2 Pa, 10 Pa). The own part
has no published figure: with GNSS alone 0.28 m per aircraft, 0.4 m between two. The barometer's drift, the
airspeed's scale and the clock's rate have usual values.

The autopilot holds the airspeed and the height that it measures, so scale errors and drift shift the flight
itself. White noise is in the reports alone, as filters keep it from the loops.

Faults of reports are for tests and measurements of a companion with wrong input. Meanwhile the autopilot
itself flies by the truth, as one with two receivers does.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from msgspec.structs import replace
from numpy.random import Generator, default_rng

from sitl_stub.geometry import wrap_to_two_pi
from sitl_stub.plant import Motion

SensorGrade = Literal["ideal", "rtk", "sbas", "standalone"]
"""Grade of the GNSS receiver; all grades but `ideal` have the same errors in the other sensors."""

TICK_S = 1.0
"""Interval at which the wandering errors are drawn; they are interpolated linearly in between."""

SHARED_S, OWN_S = 1100.0, 60.0
"""Correlation times of the shared and the own error of receivers."""

HEADING_RAD = math.radians(0.3)
"""Standard deviation of the heading noise: an autopilot's compass, Beard and McLain."""

AIRSPEED_M_S = 0.08
"""Standard deviation of the airspeed noise: 2 Pa at 20 m/s."""

CALIBRATION = 0.02
"""Standard deviation of the airspeed sensor's scale, which is constant during a flight."""

VERTICAL = 2.0
"""Ratio of a GNSS altitude's error to a horizontal axis's: no satellite is below the horizon."""

ALTITUDE_M, DRIFTING_ALTITUDE_M, ALTITUDE_S = 0.8, 2.0, 300.0
"""Standard deviation of the altitude noise (10 Pa) and of its drift; correlation time of the drift."""

CLOCK_RATE = 20e-6
"""Standard deviation of the clock's rate error: an ordinary crystal's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grade:
    """Standard deviations of a receiver's errors, per axis."""

    shared_m: float
    """Wandering position error that all nearby receivers share."""
    own_m: float
    """Wandering position error of each receiver's own."""
    white_m: float
    velocity_m_s: float
    """White noise of the velocity."""


GRADES: dict[SensorGrade, Grade] = {
    "rtk": Grade(shared_m=0.002, own_m=0.008, white_m=0.003, velocity_m_s=0.042),
    "sbas": Grade(shared_m=0.82, own_m=0.14, white_m=0.02, velocity_m_s=0.042),
    "standalone": Grade(shared_m=1.26, own_m=0.2, white_m=0.02, velocity_m_s=0.042),
}


class GaussMarkov:
    """A first-order process with autocorrelation exp(-t / T), evaluated in the order of time."""

    def __init__(self, deviation: float, time_constant_s: float, random: Generator) -> None:
        """Draw the first value; `deviation` is in the unit of the values, `time_constant_s` is T."""
        self._keep = math.exp(-TICK_S / time_constant_s)
        self._drawn = deviation * math.sqrt(1.0 - self._keep * self._keep)
        self._random = random
        self._tick = 0
        self._before = deviation * random.standard_normal()
        self._after = self._next(self._before)

    def at(self, time_s: float) -> float:
        """Return the value at a time at most one tick before the latest one requested."""
        tick = math.floor(time_s / TICK_S)
        while self._tick < tick:
            self._tick += 1
            self._before, self._after = self._after, self._next(self._after)
        share = min(max(time_s / TICK_S - self._tick, 0.0), 1.0)
        return self._before + share * (self._after - self._before)

    def _next(self, value: float) -> float:
        return self._keep * value + self._drawn * float(self._random.standard_normal())


class SensorErrors:
    """Errors of one aircraft's sensors; all are zero for `ideal` ones."""

    def __init__(self, grade: SensorGrade, *, seed: int, system_id: int) -> None:
        """Draw the constant errors of an aircraft; the seed is the formation's."""
        self.figures = GRADES.get(grade)
        """Standard deviations; None for sensors without errors."""
        if self.figures is None:
            self.calibration, self.clock_rate = 1.0, 0.0
            return
        own = default_rng((seed, system_id, 0x67_70_73))
        self._random = default_rng((seed, system_id, 0x77_68_69))
        # Without a system id in its seed: every process of a formation draws the same.
        shared = default_rng((seed, 0x67_70_73))
        self._wandering = [
            (
                GaussMarkov(self.figures.shared_m, SHARED_S, shared_axis),
                GaussMarkov(self.figures.own_m, OWN_S, own_axis),
            )
            for shared_axis, own_axis in zip(shared.spawn(2), own.spawn(2), strict=True)
        ]
        self._altitude = GaussMarkov(DRIFTING_ALTITUDE_M, ALTITUDE_S, own.spawn(1)[0])
        self._satellite = (
            GaussMarkov(VERTICAL * self.figures.shared_m, SHARED_S, shared.spawn(1)[0]),
            GaussMarkov(VERTICAL * self.figures.own_m, OWN_S, own.spawn(1)[0]),
        )
        self.calibration = 1.0 + CALIBRATION * float(own.standard_normal())
        """Ratio of shown to correct airspeed."""
        self.clock_rate = CLOCK_RATE * float(own.standard_normal())
        """Relative rate error of the autopilot's clock, positive if it is fast."""

    def position_m(self, time_s: float) -> tuple[float, float]:
        """Return the error (north, east) of a reported position."""
        if self.figures is None:
            return 0.0, 0.0
        (north, own_north), (east, own_east) = self._wandering
        return (
            north.at(time_s) + own_north.at(time_s) + self._white(self.figures.white_m),
            east.at(time_s) + own_east.at(time_s) + self._white(self.figures.white_m),
        )

    def altitude_drift_m(self, time_s: float) -> float:
        """Return the error of the altitude that the autopilot holds."""
        return 0.0 if self.figures is None else self._altitude.at(time_s)

    def altitude_m(self, time_s: float) -> float:
        """Return the error of a reported altitude."""
        if self.figures is None:
            return 0.0
        return self.altitude_drift_m(time_s) + self._white(ALTITUDE_M)

    def satellite_altitude_m(self, time_s: float) -> float:
        """Return the error of the GNSS altitude, which no barometer corrects."""
        if self.figures is None:
            return 0.0
        return sum(part.at(time_s) for part in self._satellite)

    def velocity_m_s(self) -> tuple[float, float]:
        """Return the error (north, east) of a reported velocity."""
        if self.figures is None:
            return 0.0, 0.0
        size = self.figures.velocity_m_s
        return self._white(size), self._white(size)

    def heading_rad(self) -> float:
        """Return the error of a reported heading."""
        return 0.0 if self.figures is None else self._white(HEADING_RAD)

    def airspeed_m_s(self) -> float:
        """Return the error of a reported airspeed."""
        return 0.0 if self.figures is None else self._white(AIRSPEED_M_S)

    def _white(self, deviation: float) -> float:
        return deviation * float(self._random.standard_normal())


FaultKind = Literal[
    "offset",
    "drift",
    "noise",
    "frozen",
    "zero",
    "velocity",
    "held",
    "airspeed",
    "altitude",
    "clock",
]

Place = tuple[float, float]
"""Latitude and longitude, rad."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A temporary fault of the reports."""

    kind: FaultKind
    """`offset`: positions are `north`, `east` metres off. `drift`: they drift off by as many m/s, and return
    at the end. `noise`: they have white noise of `north` metres. `frozen`: positions stay as they were.
    `zero`: latitude and longitude are 0. `velocity`: the ground velocity is `north`, `east` m/s. `held`: the
    ground velocity stays as it was. `airspeed`: the airspeed is `north` m/s. `altitude`: altitudes are
    `north` metres off. `clock`: the autopilot's clock loses `north` seconds, evenly over the time."""

    start_s: float
    """Simulation time of its beginning."""

    length_s: float
    """May be infinite."""

    north: float = 0.0
    east: float = 0.0

    def __post_init__(self) -> None:
        """Check kind and ranges.

        Raises:
            ValueError: the kind is unknown, or a number is out of its range.
        """
        sound = math.isfinite(self.start_s + self.north + self.east) and self.start_s >= 0.0
        if self.kind not in get_args(FaultKind) or not sound or not self.length_s > 0.0:
            raise ValueError(f"{self} is no fault")

    def is_on(self, time_s: float) -> bool:
        """Check whether the fault is present at a simulation time."""
        return 0.0 <= time_s - self.start_s < self.length_s

    def lost_s(self, time_s: float) -> float:
        """Return the time that the clock has lost by a simulation time, s."""
        if self.kind != "clock" or time_s <= self.start_s:
            return 0.0
        return self.north * min((time_s - self.start_s) / self.length_s, 1.0)


class Faults:
    """Present and future faults of one autopilot."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._faults = list(faults)
        self._frozen: Place | None = None
        self._held: Motion | None = None
        self._random = default_rng(0x66_61_75)

    def add(self, fault: Fault) -> None:
        """Add a fault."""
        self._faults.append(fault)

    def lost_s(self, time_s: float) -> float:
        """Return the time that the clock has lost by a simulation time, s."""
        return sum(fault.lost_s(time_s) for fault in self._faults) if self._faults else 0.0

    def offset_m(self, time_s: float) -> tuple[float, float]:
        """Return the offset (north, east) of positions, m."""
        north_m = east_m = 0.0
        for one in self._faults:
            if not one.is_on(time_s):
                continue
            if one.kind == "offset":
                north_m, east_m = north_m + one.north, east_m + one.east
            elif one.kind == "drift":
                since_s = time_s - one.start_s
                north_m, east_m = north_m + since_s * one.north, east_m + since_s * one.east
            elif one.kind == "noise":
                north_m += one.north * float(self._random.standard_normal())
                east_m += one.north * float(self._random.standard_normal())
        return north_m, east_m

    def altitude_m(self, time_s: float) -> float:
        """Return the offset of altitudes, m."""
        present = [one for one in self._faults if one.kind == "altitude" and one.is_on(time_s)]
        return sum(one.north for one in present)

    def place(self, place: Place, time_s: float) -> Place:
        """Return the position as reported."""
        if not self._faults:
            return place
        kinds = {one.kind for one in self._faults if one.is_on(time_s)}
        if "frozen" not in kinds:
            self._frozen = place
        return (0.0, 0.0) if "zero" in kinds else self._frozen or place

    def motion(self, motion: Motion, time_s: float) -> Motion:
        """Return the motion as reported."""
        held = False
        for fault in self._faults:
            if not fault.is_on(time_s):
                continue
            if fault.kind == "airspeed":
                motion = replace(motion, airspeed_m_s=fault.north)
            elif fault.kind == "velocity":
                motion = replace(
                    motion,
                    north_m_s=fault.north,
                    east_m_s=fault.east,
                    course_rad=wrap_to_two_pi(math.atan2(fault.east, fault.north)),
                    ground_speed_m_s=math.hypot(fault.north, fault.east),
                )
            held |= fault.kind == "held"
        if not held or self._held is None:
            self._held = motion
        return replace(
            motion,
            north_m_s=self._held.north_m_s,
            east_m_s=self._held.east_m_s,
            course_rad=self._held.course_rad,
            ground_speed_m_s=self._held.ground_speed_m_s,
        )
