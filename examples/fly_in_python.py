"""Flying from Python: one flight with its data as NumPy arrays, a law of one's own, and a comparison.

python examples/fly_in_python.py missions/circle-wind.yaml
"""

import sys

import numpy as np
from own_law import Pursuit  # the file beside this one

import vfguide


def main() -> None:
    """Fly and print."""
    mission = vfguide.load_mission(sys.argv[1])
    flight = vfguide.fly(mission, duration_s=40.0, settings={"controller.k_x": 0.3})
    print(f"mean error over the last half: {flight.summary.formation.mean_error_m:.3f} m")

    # Arrays have one entry for each sample of flight.time_s.
    for name, error in flight.errors.items():
        settled = flight.time_s[np.flatnonzero(error.distance_m > 1.0)[-1]]
        speed = flight.tracks[name].airspeed_m_s
        print(
            f"{name}: within 1 m after {settled:.1f} s, at {speed.min():.1f} to {speed.max():.1f} m/s"
        )

    for one in vfguide.compare(mission, laws=["slot", Pursuit], seeds=[1], duration_s=40.0):
        print(f"{one.law}, seed {one.seed}: {one.summary.formation.mean_error_m:.3f} m")


if __name__ == "__main__":
    main()
