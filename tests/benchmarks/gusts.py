"""Three laws in gusts: how near, how calm, and how often at a limit. A minute and more for each flight."""

import math

import vfguide
from tests.benchmarks.results import Cases
from tests.kit.missions import shipped

LAWS = ("pid", "slot", "mpc")
SEEDS = (1, 2, 3, 4)


def rolls(flight: vfguide.Flight) -> list[float]:
    """Roll rate of each follower over the last half of the flight, in parts of its leader's."""
    leader, *followers = (
        one.roll_rate_rad_s or math.nan for one in flight.summary.vehicles.values()
    )
    return [rate / leader for rate in followers]


def roll_share(flight: vfguide.Flight) -> float:
    """Roll rate of the followers in parts of their leader's, root mean square."""
    return math.hypot(*rolls(flight)) / math.sqrt(len(flight.errors))


def greatest_roll_share(flight: vfguide.Flight) -> float:
    """Roll rate of the follower that rolls fastest in parts of its leader's."""
    return max(rolls(flight))


def limited_share(flight: vfguide.Flight) -> float:
    """Share of the followers' setpoints that a limit cut, over the last half of the flight."""
    _, *followers = (one.limited_fraction or 0.0 for one in flight.summary.vehicles.values())
    return math.fsum(followers) / len(followers)


def cases() -> Cases:
    """Fly each law by some seeds."""
    metrics = [roll_share, greatest_roll_share, limited_share]
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
            },
        )
