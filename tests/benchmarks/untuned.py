"""Formations of aircraft that nobody has tuned: each in four airs, declared right, wrongly or not at all.

    make results STUDIES=untuned                                # every aircraft in every air
    python -m tests.benchmarks.untuned px4-untrimmed:rough:fast ...  # some, with words about each

Missions are as a newcomer writes them: places, speeds and slots, no gain at all. What the aircraft really
are is in `rehearsal.emulator`; what is declared is right, absent, or wrong by a factor of three either way.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from random import Random
from typing import Any

import numpy as np

from sitl_stub.autopilot import flight_at_start
from sitl_stub.loops import SpeedTarget, TurnTarget
from sitl_stub.personality import personality_of
from tests.benchmarks.results import Cases, Figures
from tests.kit.figures import tell
from tests.kit.missions import shipped
from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import GRAVITY
from vfguide.lab.rehearsal.aircraft import checked_settings
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.figures import in_window, roll_rate_rms, slot_error
from vfguide.lab.report.metrics import summarise
from vfguide.lab.studies.flown import executor_on, or_nan
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

DURATION_S = 160.0
RADIUS_M = 250.0
SLOTS = {"f1": (-25.0, -25.0), "f2": (-25.0, 25.0), "f3": (-50.0, 0.0)}
"""Metres ahead and right of the leader."""
STARTS = {"f1": (-60.0, -50.0), "f2": (-50.0, 60.0), "f3": (-80.0, 10.0)}
"""How far from their slots followers begin, m ahead and right."""

AIRS: dict[str, dict[str, Any]] = {
    "still": {"wind": {"type": "calm"}},
    "article": {"wind": {"type": "article"}},
    "rough": {
        "wind": {"type": "steady", "speed_m_s": 5, "toward_deg": 90, "turbulence": "moderate"}
    },
    "standalone": {
        "wind": {"type": "steady", "speed_m_s": 5, "toward_deg": 90},
        "rehearsal": {"sensors": "standalone", "link_delay_s": 0.3, "link_loss": 0.2},
    },
}
SMOOTH = ("still", "article")
"""Airs in which formations have to be nearest."""

DECLARED = ("right", "unknown", "fast", "slow")
WRONG_BY = 3.0

LOST_M = 50.0
"""A follower so far from its slot in the second half is lost."""
NEAR_M = 5.0
THRASHED_SHARE = 0.2
THRASHED_ROLL = 2.0
"""Parts of a lone aircraft's roll rate in the same air."""
QUIET_ROLL_RAD_S = math.radians(5.0)
"""Roll rates below this are nobody's trouble, however still the air."""

ROLL_S = 0.4
"""Lag of the roll of an aircraft whose plant has none, as the emulator's banking ones have it."""

REQUIRED_S = 60.0
"""By then all are to be within 10 m of their slots."""

SIX_DOF_ALPHA_1_S, SIX_DOF_GUIDED_P, SIX_DOF_SPEED_M_S = 0.93, 12_000.0, 22.0
"""What `missions/aerosonde-gusts.yaml` declares of it, at this gain and speed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UntunedAircraft:
    """One kind of aircraft: what it really is, and what somebody may say of it."""

    name: str
    """For the command line."""
    emulator: dict[str, Any]
    """What flies, as in `rehearsal.emulator`."""
    cruise_m_s: float = 20.0
    """Airspeed of the leader."""
    alpha_1_s: float = 1.0
    """Its true course response, 1/s."""
    beta_1_s: float = 0.8
    """Its true speed response, 1/s, or what is nearest to it."""
    known: dict[str, Any] = field(default_factory=dict)
    """What else somebody declares who knows it all."""
    autopilot: str = "ardupilot"
    """Name in the mission."""

    @property
    def truth(self) -> dict[str, Any]:
        """`rehearsal.emulator` with all that would be as declared otherwise."""
        truth = {"alpha_1_s": self.alpha_1_s, "beta_1_s": self.beta_1_s}
        return {**truth, "max_acceleration_m_s2": 3.0, "max_bank_deg": 45.0, **self.emulator}

    def declared(self, how: str) -> dict[str, Any]:
        """Fields of `vehicles.defaults` beside the limits."""
        if how == "unknown":
            return {}
        if how == "right":
            return {"alpha_1_s": self.alpha_1_s, "beta_1_s": self.beta_1_s, **self.known}
        factor = WRONG_BY if how == "fast" else 1.0 / WRONG_BY
        return {
            "alpha_1_s": round(min(self.alpha_1_s * factor, 20.0), 3),
            "beta_1_s": round(self.beta_1_s * factor, 3),
        }


def hold(
    name: str,
    alpha: float,
    beta: float,
    *,
    cruise: float = 20.0,
    late: float = 0.0,
    plant: str = "heading-hold",
) -> UntunedAircraft:
    """Make an aircraft whose holds of course and speed are of first order, both so many seconds late."""
    known = {"plant": plant, "course_dead_time_s": late, "speed_dead_time_s": late}
    truth = known | {"alpha_1_s": alpha, "beta_1_s": beta, "speed_response": "first-order"}
    return UntunedAircraft(
        name=name, emulator=truth, cruise_m_s=cruise, alpha_1_s=alpha, beta_1_s=beta, known=known
    )


def banking(
    name: str,
    guided_p: float,
    roll_s: float,
    efficiency: float,
    *,
    cruise: float = 20.0,
    late: float = 0.0,
    beta: float | None = None,
) -> UntunedAircraft:
    """Make an ArduPlane: bank by GUIDED_P, and a speed by total energy unless a beta is given."""
    truth = {
        "plant": "bank",
        "guided_p": round(guided_p),
        "roll_time_s": roll_s,
        "turn_efficiency": efficiency,
        "course_dead_time_s": late,
    }
    known: dict[str, Any] = {"course_dead_time_s": late, "course_lag_s": roll_s}
    known["slips"] = efficiency < 1.0
    if beta is None:
        truth["speed_response"] = "tecs"
        known |= {"speed_hold": "total-energy", "speed_dead_time_s": 0.5}
    else:
        truth |= {"beta_1_s": beta, "speed_dead_time_s": late}
        known["speed_dead_time_s"] = late
    alpha = efficiency * math.radians(0.01 * guided_p) * GRAVITY / cruise
    return UntunedAircraft(
        name=name,
        emulator=truth,
        cruise_m_s=cruise,
        alpha_1_s=round(alpha, 3),
        beta_1_s=0.55 if beta is None else beta,
        known=known,
    )


def px4(
    name: str, alpha: float, roll_s: float, *, cruise: float = 18.0, trimmed: bool
) -> UntunedAircraft:
    """Make a PX4: bank by its course law, and one of its speed holds."""
    late = 0.06
    return UntunedAircraft(
        name=name,
        emulator={
            "plant": "npfg",
            "alpha_1_s": alpha,
            "roll_time_s": roll_s,
            "roll_delay_s": 0.2,
            "course_dead_time_s": late,
            "speed_response": "px4" if trimmed else "px4-untrimmed",
        },
        cruise_m_s=cruise,
        alpha_1_s=alpha,
        beta_1_s=1.0 if trimmed else 0.5,
        known={
            "course_dead_time_s": late,
            "course_lag_s": roll_s + 0.2,
            "speed_hold": "total-energy",
        },
        autopilot="px4",
    )


def rigid(name: str, guided_p: float, *, cruise: float = 22.0) -> UntunedAircraft:
    """Make a rigid body."""
    alpha = SIX_DOF_ALPHA_1_S * guided_p / SIX_DOF_GUIDED_P * SIX_DOF_SPEED_M_S / cruise
    return UntunedAircraft(
        name=name,
        emulator={"plant": "six-dof", "guided_p": round(guided_p), "max_acceleration_m_s2": 2.0},
        cruise_m_s=cruise,
        alpha_1_s=round(alpha, 3),
        known={"course_lag_s": 0.35, "max_acceleration_m_s2": 2},
    )


ALL = (
    hold("lively", 4.0, 2.0),
    hold("sluggish", 0.3, 0.2, cruise=14.0),
    hold("late", 1.2, 0.8, late=0.35),
    hold("course-hold", 0.8, 0.5, cruise=25.0, late=0.2, plant="course-hold"),
    banking("arduplane", 5_000.0, 0.4, 0.745),
    banking("quick-to-bank", 20_000.0, 0.2, 1.0, cruise=30.0, beta=1.0),
    banking("slow-to-bank", 3_000.0, 0.8, 0.85, cruise=16.0),
    banking("late-to-bank", 12_000.0, 0.4, 1.0, late=0.4),
    px4("px4-untrimmed", 0.88, 0.4, trimmed=False),
    px4("px4-trimmed", 1.5, 0.25, cruise=15.0, trimmed=True),
    rigid("six-dof", 12_000.0),
    rigid("six-dof-soft", 5_000.0, cruise=25.0),
)

AIRCRAFT = {one.name: one for one in ALL}
"""All of them by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UntunedFlight:
    """What is flown; can be handed to another process."""

    aircraft: str
    """One of `AIRCRAFT`."""
    air: str
    """One of `AIRS`."""
    declared: str
    """One of `DECLARED`."""
    seed: int = 1
    """Of turbulence, sensors and link."""
    duration_s: float = DURATION_S
    """Length of the flight."""

    def mission(self) -> Mission:
        """Write the mission as a newcomer does, and the truth below `rehearsal.emulator`."""
        aircraft, air = AIRCRAFT[self.aircraft], AIRS[self.air]
        cruise = aircraft.cruise_m_s
        speeds = [16.0, 32.0] if aircraft.emulator["plant"] == "six-dof" else None
        vehicle = {
            "autopilot": aircraft.autopilot,
            "airspeed_range_m_s": speeds or [round(0.6 * cruise, 1), round(1.4 * cruise, 1)],
            **aircraft.declared(self.declared),
        }
        starts = {
            name: {"forward_m": ahead, "right_m": right} for name, (ahead, right) in STARTS.items()
        }
        starts["leader"] = {"north_m": 30, "east_m": 0, "course_deg": 270}
        return Mission.model_validate(
            {
                "name": "untuned",
                "origin": shipped("circle-wind").origin.model_dump(),
                "path": {"type": "circle", "centre": {"north_m": RADIUS_M}, "radius_m": RADIUS_M},
                "leader": {"vehicle": "leader", "airspeed_m_s": cruise},
                "followers": [
                    {"vehicle": name, "slot": {"forward_m": ahead, "right_m": right, "up_m": 0}}
                    for name, (ahead, right) in SLOTS.items()
                ],
                "vehicles": {
                    name: {"system_id": number, **vehicle}
                    for number, name in enumerate(["leader", *SLOTS], start=1)
                },
                "controller": {"type": "slot"},
                "wind": air["wind"],
                "rehearsal": {
                    "duration_s": self.duration_s,
                    "seed": self.seed,
                    "emulator": aircraft.truth,
                    "start": starts,
                    **air.get("rehearsal", {}),
                },
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What a flight came to, over its second half."""

    flight: UntunedFlight
    """Which flight."""
    mean_error_m: float
    """Mean distance of all followers from their slots."""
    max_error_m: float
    """The greatest."""
    settle_10m_s: float
    """After which all stayed within 10 m; infinite: never."""
    min_separation_m: float
    """Of the whole flight."""
    limited: float
    """Share of the time at a limit, of the vehicle with the most."""
    roll_rate_rad_s: float
    """Root mean square, of the vehicle with the most."""
    lone_roll_rate_rad_s: float
    """The same of a lone aircraft that holds its course in this air."""
    restless: str
    """Vehicle with the greatest roll rate."""
    handed_back: tuple[str, ...]
    """Vehicles that are not steered at the end."""

    @property
    def lost(self) -> bool:
        """Whether a follower was lost, or handed back."""
        return not self.max_error_m < LOST_M or bool(self.handed_back)

    @property
    def near(self) -> bool:
        """Whether two came too near each other."""
        return self.min_separation_m < NEAR_M

    @property
    def thrashed(self) -> bool:
        """Whether a vehicle was flown at its limits, or rolled more than the air asks for."""
        quiet = max(QUIET_ROLL_RAD_S, THRASHED_ROLL * self.lone_roll_rate_rad_s)
        return self.limited > THRASHED_SHARE or self.roll_rate_rad_s > quiet

    def words(self) -> str:
        """Tell the flight in one line."""
        one = self.flight
        flags = "".join(
            f" {word.upper()}" for word in ("near", "lost", "thrashed") if getattr(self, word)
        )
        back = f" handed back: {', '.join(self.handed_back)}" if self.handed_back else ""
        return (
            f"{one.aircraft:16} {one.air:11} {one.declared:8} mean {self.mean_error_m:7.2f} m,"
            f" max {self.max_error_m:6.1f}, within 10 m after {self.settle_10m_s:4.0f} s,"
            f" limits {self.limited:4.0%}, roll {math.degrees(self.roll_rate_rad_s):5.1f} deg/s"
            f" ({self.restless}; alone {math.degrees(self.lone_roll_rate_rad_s):.1f}),"
            f" nearest {self.min_separation_m:4.1f} m{flags}{back}"
        )


def judge(flight: UntunedFlight) -> Judged:
    """Fly it and judge it."""
    return judged(flight, fly_lockstep(flight.mission()).record)


def judged(flight: UntunedFlight, record: FlightRecord) -> Judged:
    """Judge what was flown."""
    summary, window = summarise(record), in_window(record)
    rolls = {
        one.name: rolled(flight.aircraft, record.time_s[window], one.bank_rad[window])
        for one in record.vehicles
    }
    steered = {"joining", "tracking", "predicting"}
    settled = summary.formation.settle_10m_s
    errors = [slot_error(record.reference, one).distance_m[window] for one in record.followers]
    restless = max(rolls, key=lambda name: rolls[name])
    return Judged(
        flight=flight,
        mean_error_m=float(np.mean(errors)),
        max_error_m=float(np.max(errors)),
        settle_10m_s=math.inf if settled is None else settled,
        min_separation_m=or_nan(summary.formation.min_separation_m),
        limited=max(or_nan(one.limited_fraction) for one in summary.vehicles.values()),
        roll_rate_rad_s=rolls[restless],
        lone_roll_rate_rad_s=lone_roll_rate(flight.aircraft, flight.air, flight.seed),
        restless=restless,
        handed_back=tuple(
            one.name for one in record.vehicles if record.mode_names[one.mode[-1]] not in steered
        ),
    )


@cache
def lone_roll_rate(aircraft: str, air: str, seed: int, duration_s: float = 60.0) -> float:
    """Fly one aircraft straight on by its own autopilot, and return its roll rate, rms in rad/s."""
    mission = UntunedFlight(aircraft=aircraft, air=air, declared="right", seed=seed).mission()
    settings = checked_settings(mission, "leader")
    config = settings.config().model_copy(update={"course_rad": 0.0})
    flight = flight_at_start(config, settings.air(), personality_of(config))
    flight.hold_turn(TurnTarget("course", 0.0))
    flight.hold_speed(SpeedTarget("airspeed", config.airspeed_m_s))
    rate_hz = mission.rehearsal.rate_hz
    times, banks = np.arange(round(duration_s * rate_hz)) / rate_hz, []
    for time_s in times:
        flight.advance(round(time_s * 1e6))
        banks.append(flight.motion().bank_rad)
    flown = times >= 10.0
    return rolled(aircraft, times[flown], np.array(banks)[flown])


def rolled(aircraft: str, time_s: FloatArray, bank_rad: FloatArray) -> float:
    """Return the roll rate, rms in rad/s.

    A hold of first order has no roll: the bank of its turn rate jumps with each setpoint. An aircraft
    that follows it with a lag is taken instead.
    """
    if AIRCRAFT[aircraft].emulator["plant"] in {"heading-hold", "course-hold"}:
        banks = [float(bank_rad[0])]
        for step_s, bank in zip(np.diff(time_s), bank_rad[1:], strict=True):
            share = 1.0 - math.exp(-step_s / ROLL_S)
            banks.append(banks[-1] + share * (float(bank) - banks[-1]))
        bank_rad = np.array(banks)
    return or_nan(roll_rate_rms(time_s, bank_rad))


def flights() -> list[UntunedFlight]:
    """Every aircraft in every air, by a declaration that is drawn."""
    return [
        UntunedFlight(
            aircraft=one, air=air, declared=Random(f"declared 1 {one} {air}").choice(DECLARED)
        )
        for one in AIRCRAFT
        for air in AIRS
    ]


def figures_of(all_judged: Sequence[Judged]) -> Figures:
    """Return what all flights came to."""
    smooth = [one.mean_error_m for one in all_judged if one.flight.air in SMOOTH]
    rough = [one.mean_error_m for one in all_judged if one.flight.air not in SMOOTH]
    settled = [one.settle_10m_s for one in all_judged]
    return {
        "flights": len(all_judged),
        **{
            what: sum(getattr(one, what) for one in all_judged)
            for what in ("lost", "near", "thrashed")
        },
        "late": sum(one > REQUIRED_S for one in settled),
        "settle_s": float(np.median(settled)),
        "smooth_m": max(smooth, default=math.nan),
        "smooth_median_m": float(np.median(smooth)) if smooth else math.nan,
        "rough_m": max(rough, default=math.nan),
        "rough_median_m": float(np.median(rough)) if rough else math.nan,
    }


def cases() -> Cases:
    """Fly them all."""
    with executor_on() as executor:
        yield "twelve aircraft, 160 s each", figures_of(list(executor.map(judge, flights())))


def main() -> None:
    """Fly some by their names, and tell of each."""
    for word in sys.argv[1:]:
        aircraft, air, declared = word.split(":")
        tell(judge(UntunedFlight(aircraft=aircraft, air=air, declared=declared)).words())


if __name__ == "__main__":
    main()
