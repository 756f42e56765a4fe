"""Three laws in gusts: how near, how calm, and how often at a limit. A minute and more for each flight."""

import numpy as np

import vfguide
from tests.benchmarks.results import Cases
from tests.kit.missions import shipped

LAWS = ("pid", "slot", "mpc")
SEEDS = (1, 2, 3, 4)


def roll_rate_rad_s(flight: vfguide.Flight, name: str) -> float:
    """Root mean square of a roll rate over the last half of the flight."""
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    bank, time_s = flight.tracks[name].bank_rad[settled], flight.time_s[settled]
    return float(np.sqrt(np.mean(np.gradient(bank, time_s) ** 2)))


def roll_share(flight: vfguide.Flight) -> float:
    """Roll rate of the followers in parts of their leader's."""
    squares = [roll_rate_rad_s(flight, name) ** 2 for name in flight.errors]
    return float(np.sqrt(np.mean(squares))) / roll_rate_rad_s(flight, next(iter(flight.tracks)))


def greatest_roll_share(flight: vfguide.Flight) -> float:
    """Roll rate of the follower that rolls fastest in parts of its leader's."""
    rates = [roll_rate_rad_s(flight, name) for name in flight.errors]
    return max(rates) / roll_rate_rad_s(flight, next(iter(flight.tracks)))


def limited_share(flight: vfguide.Flight) -> float:
    """Share of the followers' setpoints that a limit cut, over the last half of the flight."""
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    return float(np.mean([flight.tracks[name].limited[settled].mean() for name in flight.errors]))


def height_error_m(flight: vfguide.Flight) -> float:
    """Height of the followers above their leader, root mean square over the last half of the flight."""
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    leader, *_ = flight.tracks.values()
    above = [flight.tracks[name].altitude_amsl_m - leader.altitude_amsl_m for name in flight.errors]
    return float(np.sqrt(np.mean(np.square(above)[:, settled])))


def cases() -> Cases:
    """Fly each law by some seeds."""
    metrics = [roll_share, greatest_roll_share, limited_share, height_error_m]
    for law in LAWS:
        flown = vfguide.compare(
            shipped("aerosonde-gusts"), laws=[law], seeds=SEEDS, metrics=metrics
        )
        formations = [one.summary.formation for one in flown]
        yield (
            law,
            {
                "meant_m": [one.intended_error_m for one in formations],
                "mean_m": [one.mean_error_m for one in formations],
                "roll": [one.metrics["roll_share"] for one in flown],
                "roll_greatest": [one.metrics["greatest_roll_share"] for one in flown],
                "limited_percent": [100.0 * one.metrics["limited_share"] for one in flown],
                "height_m": [one.metrics["height_error_m"] for one in flown],
            },
        )
