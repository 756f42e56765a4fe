"""Measures how a real autopilot in software follows a height that climbs: its lag, and its overshoot.

    python -m tests.autopilots.height_response --program arduplane --rate 2

One aircraft flies straight on; its height setpoint rises steadily, then stays. The lag in seconds is the
vehicle's `height_delay_s`. The program is named by --binary, or by the variables ARDUPLANE and PX4.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path

import numpy as np

from tests.autopilots.formation import alone, flight_directory, load
from tests.autopilots.programs import FlightError
from tests.autopilots.simulators import Conditions, Simulator, add_program, find_program
from vfguide.companion.mission_plan import adapter_of
from vfguide.mavlink.adapter import AutopilotAdapter, AutopilotSetpoint
from vfguide.mavlink.reports import VersionReport
from vfguide.mission import Mission

PERIOD_S = 0.1
"""Between height setpoints."""

LEVEL_S, SETTLED_S = 10.0, 30.0
"""Level flight before the climb, and after it."""

LOOK_S = 8.0
"""The end of a climb, in which its lag is steady."""


def main() -> int:
    """Fly, and print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, prog="height_response")
    add = parser.add_argument
    add("--mission", type=Path, default=Path("missions/ardupilot-sitl.yaml"))
    add_program(parser)
    add("--rate", type=float, default=2.0, help="m/s, of the climb")
    add("--climb", type=float, default=60.0, help="m, up and down again")
    add("--lead", type=float, default=0.0, help="s, by which setpoints lead the wanted height")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter")
    add("--turn", type=float, default=0.0, help="rad/s, at which the course turns meanwhile")
    options = parser.parse_args()
    mission = load(options.mission, {})
    binary = find_program(options.program, options.binary)
    parameters = dict(one.split("=") for one in options.set)
    conditions = Conditions(parameters={name: float(value) for name, value in parameters.items()})
    try:
        with (
            flight_directory(None) as directory,
            alone(options.program, binary, directory, mission, conditions) as simulator,
        ):
            simulator.enter("GUIDED")
            found = measured(simulator, mission, options)
    except FlightError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(json.dumps(found, indent=2) + "\n")
    return 0


def measured(
    simulator: Simulator, mission: Mission, options: argparse.Namespace
) -> dict[str, object]:
    """Fly a climb and a descent, and compare wanted and true heights."""
    adapter = adapter_of(mission.leader_vehicle)
    if options.program == "px4":
        adapter.hear(VersionReport(major=1, minor=18))
    base = mission.origin.altitude_amsl_m + mission.height_above_origin_m
    climb_s = options.climb / options.rate
    corners_s = np.cumsum([0.0, LEVEL_S, climb_s, SETTLED_S, climb_s, SETTLED_S])
    heights_m = base + np.array([0.0, 0.0, options.climb, options.climb, 0.0, 0.0])
    began = time.monotonic()
    asked: list[tuple[float, float]] = []
    while (now_s := time.monotonic() - began) < corners_s[-1]:
        ahead_m = float(np.interp(now_s + options.lead, corners_s, heights_m))
        command(simulator, adapter, mission, now_s * options.turn, ahead_m)
        asked.append((now_s, float(np.interp(now_s, corners_s, heights_m))))
        simulator.program.check()
        time.sleep(PERIOD_S)
    track = simulator.station.track()
    true_s, true_m = track["arrival_s"] - began, track["altitude_amsl_m"]
    wanted_m = np.interp(true_s, corners_s, heights_m)
    late_m = wanted_m - true_m
    result: dict[str, object] = {"rate_m_s": options.rate, "lead_s": options.lead}
    for name, ends, sign in (("climb", 2, 1.0), ("descent", 4, -1.0)):
        steady = (true_s > corners_s[ends] - LOOK_S) & (true_s <= corners_s[ends])
        after = (true_s > corners_s[ends]) & (true_s <= corners_s[ends + 1])
        settled = (true_s > corners_s[ends + 1] - LOOK_S) & (true_s <= corners_s[ends + 1])
        result[name] = {
            "lag_s": round(sign * float(late_m[steady].mean()) / options.rate, 3),
            "lag_spread_m": round(float(late_m[steady].std()), 3),
            "overshoot_m": round(float(-(sign * late_m[after]).min()), 3),
            "level_error_m": round(float(late_m[settled].mean()), 3),
        }
    return result


def command(
    simulator: Simulator,
    adapter: AutopilotAdapter,
    mission: Mission,
    course: float,
    altitude_amsl: float,
) -> None:
    """Ask for a course, the mission's airspeed and a height."""
    setpoint = AutopilotSetpoint(
        course=math.remainder(course, math.tau),
        speed=mission.leader.airspeed_m_s,
        altitude_amsl=altitude_amsl,
        latitude_deg=mission.origin.latitude_deg,
        longitude_deg=mission.origin.longitude_deg,
    )
    for message in [*adapter.fly(setpoint), *adapter.hold_altitude(altitude_amsl)]:
        simulator.station.send(message)


if __name__ == "__main__":
    sys.exit(main())
