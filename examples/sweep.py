"""A sweep: one mission with every combination of two gains and some seeds, over all processors, as a table.

python sweep.py circle-wind
python sweep.py circle-wind tcp://host:8786

The second form spreads the flights over the machines of a Dask cluster.
"""

import sys

import vfguide

GAINS = {"controller.k_x": [0.2, 0.4], "controller.k_y": [0.15, 0.28]}
DURATION_S = 60.0
COLUMNS = (*GAINS, "seed", "mean_error_m", "max_error_m", "settle_1m_s")


def main() -> None:
    """Fly and print."""
    mission = vfguide.load_mission(sys.argv[1])
    found = vfguide.compare(
        mission,
        settings=GAINS,
        seeds=[1, 2],
        duration_s=DURATION_S,
        processes=2,
        scheduler=sys.argv[2] if len(sys.argv) > 2 else None,
    )
    print(*COLUMNS, sep="\t")
    for row in sorted(
        (one.row() for one in found), key=lambda row: float(str(row["mean_error_m"]))
    ):
        told = ("never" if row[name] is None else f"{row[name]:g}" for name in COLUMNS)
        print(*told, sep="\t")


if __name__ == "__main__":
    main()
