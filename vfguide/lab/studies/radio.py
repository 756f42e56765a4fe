"""`vfguide bench radio`: what a shared radio costs, against the formation's size and the leader's rate."""

from collections import Counter
from dataclasses import dataclass
from itertools import islice

import numpy as np

from vfguide.lab.rehearsal.emulated_radio import RadioQuality
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.rehearsal.radio_flight import RadioRates, fly_by_radio
from vfguide.lab.studies.flown import article_mission, figures_of
from vfguide.link.radio_schedule import Channel
from vfguide.mission.model import Mission

SIZES = (2, 4, 8, 12)
"""Vehicles."""

RATES_HZ = (20.0, 10.0, 5.0, 2.0)
"""Rates of the leader's states."""

CHANNEL = Channel(baud=57_600, air_bytes_s=4000.0)

SLOTS = (
    (-20, -20),
    (-20, 20),
    (-40, 0),
    (-20, 0),
    (-40, -20),
    (-40, 20),
    (-60, 0),
    (0, -20),
    (0, 20),
    (-60, -20),
    (-60, 20),
)
"""m ahead and right of the leader: the article's three, and the rest of a grid of three columns."""

BEHIND_M = -60
"""How far ahead of its slot each follower begins, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioCase:
    """A flight; can be handed to another process."""

    size: int
    """Vehicles."""
    leader_hz: float | None
    """Rate of the leader's states; None to fly without a radio, each state 0.1 s late."""
    followers_hz: float
    """Rate of each follower's."""
    loss: float
    """Share of packets that a receiver misses, bursts apart."""
    bursts: float
    """Share of the time in which it misses all."""
    seconds: float
    """Length of the flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioFigures:
    """What a flight came to, over its last half but for the channel."""

    mean_error_m: float
    """Distance from the slot, all followers."""
    max_error_m: float
    """The greatest."""
    min_separation_m: float
    """Least distance between any two vehicles during the whole flight."""
    leader_age_s: float
    """Mean age of the newest leader state; NaN without a radio."""
    air_bytes_s: float
    """On the air."""
    collisions: int
    """Packets that were in one."""
    refused: dict[str, int]
    """What members did not believe, by reason."""


def radio_mission(size: int, seconds: float) -> Mission:
    """circle-wind with so many vehicles."""
    followers = {f"f{number}": slot for number, slot in enumerate(islice(SLOTS, size - 1), 1)}
    content = article_mission("circle-wind").model_dump(mode="json", exclude_unset=True)
    content["followers"] = [
        {"vehicle": name, "slot": {"forward_m": ahead, "right_m": right, "up_m": 0}}
        for name, (ahead, right) in followers.items()
    ]
    content["vehicles"] = {
        name: content["vehicles"]["leader"] | {"system_id": number}
        for number, name in enumerate(("leader", *followers), start=1)
    }
    content["rehearsal"] |= {
        "duration_s": seconds,
        "start": {
            "leader": content["rehearsal"]["start"]["leader"],
            **{name: {"forward_m": BEHIND_M} for name in followers},
        },
    }
    return Mission.model_validate(content)


def fly(case: RadioCase) -> RadioFigures:
    """Fly a case."""
    mission = radio_mission(case.size, case.seconds)
    air, refused, age_s = Counter[str](), Counter[str](), float("nan")
    if case.leader_hz is None:
        record = fly_lockstep(mission).record
    else:
        flown = fly_by_radio(
            mission,
            rates=RadioRates(leader_hz=case.leader_hz, followers_hz=case.followers_hz),
            quality=RadioQuality(channel=CHANNEL, loss=case.loss, burst_share=case.bursts),
        )
        record, air, refused = flown.flight.record, flown.air, flown.refused
        age_s = float(np.mean(flown.leader_age_s))
    figures = figures_of(record)
    return RadioFigures(
        mean_error_m=figures.mean_error_m,
        max_error_m=figures.max_error_m,
        min_separation_m=figures.min_separation_m,
        leader_age_s=age_s,
        air_bytes_s=air["bytes"] / case.seconds,
        collisions=air["in collisions"],
        refused=dict(refused),
    )
