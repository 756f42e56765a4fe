"""What formations reach on autopilots that answer late, flown anew.

Run with `python tests/benchmarks/late_autopilots.py`.

The emulators fly ArduPlane's bank from course error and a speed hold like its TECS; the companions know of it
what `vfguide identify` would tell them.
"""

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.summary import FormationSummary
from vfguide.mission import Mission, load_mission

MISSIONS = Path(__file__).parents[2] / "missions"

STEADY = {"type": "steady", "speed_m_s": 5.0, "toward_deg": 135.0}
ARTICLE = {"type": "article"}
CALM = {"type": "calm"}

FLIGHTS = {
    "line, steady 5 m/s": ("line-wind", STEADY),
    "circle, steady 5 m/s": ("circle-wind", STEADY),
    "line, the article's wind": ("line-wind", ARTICLE),
    "circle, the article's wind": ("circle-wind", ARTICLE),
}

EMULATOR = {"plant": "bank", "guided_p": 12_000, "roll_time_s": 0.4, "speed_response": "tecs"}

PROFILE = {
    "alpha_1_s": 1.03,
    "beta_1_s": 0.55,
    "course_lag_s": 0.4,
    "speed_dead_time_s": 0.5,
    "max_acceleration_m_s2": 2.5,
}
"""12000 cdeg/rad at 20 m/s are alpha 1.03; the rest is what the emulator's holds are."""

VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "as identified": {},
    "not identified": {
        "profile": {
            "alpha_1_s": 1.2,
            "beta_1_s": 0.8,
            "course_lag_s": 0.0,
            "speed_dead_time_s": 0.0,
            "max_acceleration_m_s2": 3.0,
        }
    },
    "alpha and beta 20 % too high": {"profile": {"alpha_1_s": 1.23, "beta_1_s": 0.66}},
    "alpha and beta 20 % too low": {"profile": {"alpha_1_s": 0.82, "beta_1_s": 0.44}},
    "dead times 0.2 s longer": {"emulator": {"course_dead_time_s": 0.2, "speed_dead_time_s": 0.7}},
    "turns at 70 % of the bank's rate": {"emulator": {"turn_efficiency": 0.7}},
    "the same, identified": {
        "emulator": {"turn_efficiency": 0.7},
        "profile": {"alpha_1_s": 0.72},
    },
    "indicated airspeed, 3 % off": {
        "emulator": {"indicated_airspeed": True, "airspeed_calibration": 0.97}
    },
    "0.3 m of noise, 20 % lost": {"rehearsal": {"position_noise_m": 0.3, "link_loss": 0.2}},
}


def late(name: str, wind: dict[str, Any], changes: dict[str, dict[str, Any]]) -> Mission:
    """A shipped mission on such autopilots: 25 Hz, leader states 100 ms old."""
    content = load_mission(MISSIONS / f"{name}.yaml").model_dump(exclude_unset=True)
    content["wind"] = wind
    content["acceptance"] = {}
    content["rehearsal"] |= {"rate_hz": 25.0, "link_delay_s": 0.1, **changes.get("rehearsal", {})}
    content["rehearsal"]["emulator"] = EMULATOR | changes.get("emulator", {})
    for vehicle in content["vehicles"].values():
        vehicle.update(PROFILE | changes.get("profile", {}))
    return Mission.model_validate(content)


def fly(task: tuple[str, str]) -> FormationSummary:
    """Figures of one flight in one variant."""
    flight, variant = task
    return summarise(fly_lockstep(late(*FLIGHTS[flight], VARIANTS[variant])).record).formation


def main() -> None:
    """Fly everything on all processors and print it."""
    tasks = [(flight, variant) for variant in VARIANTS for flight in FLIGHTS]
    sys.stdout.write(f"{'mean (greatest) error, m':36}" + "".join(f"{one:>28}" for one in FLIGHTS))
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for (flight, variant), figures in zip(tasks, pool.map(fly, tasks), strict=True):
            if flight == next(iter(FLIGHTS)):
                sys.stdout.write(f"\n{variant:36}")
            sys.stdout.write(f"{figures.mean_error_m:20.3f} ({figures.max_error_m:5.2f})")
            sys.stdout.flush()
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
