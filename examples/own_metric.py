"""A figure of one's own: how calmly followers fly, by which laws are compared beside how accurately.

python own_metric.py circle-wind

A metric is a function of a flight. It is worked out where the flight was flown, and only its figure travels.
"""

import sys

import numpy as np

import vfguide

DURATION_S = 60.0


def roll_rate_deg_s(flight: vfguide.Flight) -> float:
    """Root mean square of the followers' roll rates over the last half of the flight, degrees a second."""
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    rates = [
        np.gradient(flight.tracks[name].bank_rad[settled], flight.time_s[settled])
        for name in flight.errors
    ]
    return float(np.degrees(np.sqrt(np.mean(np.square(rates)))))


def main() -> None:
    """Compare three laws by it."""
    mission = vfguide.load_mission(sys.argv[1])
    laws = ["slot", "article", "pid"]
    for one in vfguide.compare(
        mission, laws=laws, metrics=[roll_rate_deg_s], duration_s=DURATION_S
    ):
        error = one.summary.formation.mean_error_m
        print(f"{one.law}: {error:.3f} m, {one.metrics['roll_rate_deg_s']:.1f} degrees a second")


if __name__ == "__main__":
    main()
