"""How a formation takes it that the companion of its leader is killed for good, in lockstep.

Errors are those of the slots behind
the leader that the deputy carries on. Followers that are in the way of the leader's aircraft, which flies on
without its companion, leave their slots for it: they have a column of their own.
"""

import re

import numpy as np

from tests.benchmarks.results import Cases
from tests.kit.missions import content_of
from vfguide.lab.rehearsal.lockstep import LockstepFlight, fly_lockstep
from vfguide.lab.report.figures import pair_separations, slot_error
from vfguide.mission import Mission

NAMES = ("line-wind", "circle-wind")
WINDS = ("none", "moderate")
LOST_S = (40.0, 47.0, 54.0)
WATCHED_S = 15.0
WAY = re.compile("keeping clear of|too near to")


def flown(
    name: str, turbulence: str, lost_s: float, *, may_stop: bool = True, **rehearsal: float
) -> LockstepFlight:
    """A flight whose leader's companion is killed at a time; see `mission_with` for the rehearsal."""
    content = content_of(name)
    content["deputies"] = [one["vehicle"] for one in content["followers"][:2]]
    content["vehicles"][content["leader"]["vehicle"]]["may_stop"] = may_stop
    content["wind"]["turbulence"] = turbulence
    loss = {"vehicle": content["leader"]["vehicle"], "at_s": lost_s}
    content["rehearsal"] |= {
        "duration_s": lost_s + WATCHED_S,
        "start": {},
        "losses": [loss],
        **rehearsal,
    }
    return fly_lockstep(Mission.model_validate(content))


def figures(flight: LockstepFlight, lost_s: float) -> tuple[float, float, float, float, float]:
    """(s until a deputy leads, greatest error before, after of who makes no way, of all, nearest; m)."""
    record = flight.record
    before, after = record.time_s < lost_s, record.time_s >= lost_s
    before &= record.time_s > lost_s - WATCHED_S
    led_s = min(
        float(record.time_s[np.isfinite(one.lead_term)].min())
        for one in record.followers
        if one.lead_term is not None and np.isfinite(one.lead_term).any()
    )
    reference, errors = record.reference, {}
    for one in record.followers:
        errors[one.name] = slot_error(reference, one).distance_m
    makes_way = {
        name
        for name, events in flight.events.items()
        if any(one.time_s >= lost_s and WAY.search(one.text) for one in events)
    }
    undisturbed = [error[after].max() for name, error in errors.items() if name not in makes_way]
    return (
        led_s - lost_s,
        max(float(error[before].max()) for error in errors.values()),
        max(undisturbed, default=float("nan")),
        max(float(error[after].max()) for error in errors.values()),
        min(float(pair.distance_m[after].min()) for pair in pair_separations(record)),
    )


def cases() -> Cases:
    """Fly each mission in each air; a flight for each moment."""
    for name in NAMES:
        for turbulence in WINDS:
            for may_stop in (True, False) if name == "line-wind" else (True,):
                found = [
                    figures(flown(name, turbulence, lost_s, may_stop=may_stop), lost_s)
                    for lost_s in LOST_S
                ]
                keys = ("led_s", "before_m", "undisturbed_m", "after_m", "nearest_m")
                never = "" if may_stop else ", `may_stop: false`"
                yield (
                    f"{name}, {turbulence}{never}",
                    {
                        key: list(each)
                        for key, each in zip(keys, zip(*found, strict=True), strict=True)
                    },
                )
