"""Formations of growing size: what they cost in lockstep in one process, and over a radio that all share.

What calls cost: the methods of a class, timed while something runs, by the processor time they take.

What one guidance step of each law costs: as called in a flight, nothing left out.
"""

import math
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from typing import Any

import numpy as np

from vfguide.companion.core import Companion
from vfguide.companion.follower_role import FollowerRole
from vfguide.errors import import_extra
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.rehearsal.radio_flight import fly_by_radio
from vfguide.lab.studies.flown import Row, article_mission, figures_of, flown_by
from vfguide.laws.base import SlotKeeper
from vfguide.mavlink.codec import Codec
from vfguide.mission.model import Mission

DURATION_S = 15.0

STEADY_FROM = 0.2
"""Share of the calls that is left out: imports and the first solutions."""

COUNTS = (4, 10, 30, 100)

FLOWN_S, QUICK_S = 20.0, 4.0

JOINED_S = 20.0
"""Until everybody is in place: what is measured is a formation, not a muster."""

ROW = 10

SPACING_M = 20.0

SHARES = {
    "companion": (Companion, "receive_mavlink"),
    "decode": (Codec, "decode"),
    "encode": (Codec, "encode"),
    "guidance": (FollowerRole, "step"),
}
"""Parts that are timed."""


@contextmanager
def calls_timed(owner: type, name: str) -> Iterator[list[float]]:
    """Processor time of every call of a method, s, as they happen; waiting for others does not count."""
    method: Callable[..., object] = getattr(owner, name)
    durations: list[float] = []

    def timed(*arguments: object, **options: object) -> object:
        began = time.thread_time()
        try:
            return method(*arguments, **options)
        finally:
            durations.append(time.thread_time() - began)

    setattr(owner, name, timed)
    try:
        yield durations
    finally:
        setattr(owner, name, method)


def step_costs(laws: Sequence[str]) -> Iterator[Row]:
    """Time a follower's step by each law, on circle-wind."""
    for law in laws:
        flown = article_mission(
            "circle-wind", {"controller": {"type": law}, "rehearsal": {"duration_s": DURATION_S}}
        )
        with calls_timed(SlotKeeper, "step") as durations:
            fly_lockstep(flown)
        steady = sorted(durations[round(STEADY_FROM * len(durations)) :])
        yield (
            law,
            {
                "calls": len(steady),
                "median_us": statistics.median(steady) * 1e6,
                "p99_us": steady[round(0.99 * (len(steady) - 1))] * 1e6,
                "max_us": steady[-1] * 1e6,
            },
        )


def grown(mission: str, name: str, slots: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """One of the article's missions as fields, with a follower of the leader's kind for each slot.

    Args:
        mission: which.
        name: what it is called.
        slots: m ahead and right of the leader.
    """
    content = article_mission(mission).model_dump(mode="json", exclude_unset=True)
    followers = [f"f{number}" for number in range(1, len(slots) + 1)]
    content["name"] = name
    content["followers"] = [
        {"vehicle": follower, "slot": {"forward_m": ahead, "right_m": right, "up_m": 0}}
        for follower, (ahead, right) in zip(followers, slots, strict=True)
    ]
    content["vehicles"] = {
        vehicle: content["vehicles"]["leader"] | {"system_id": number}
        for number, vehicle in enumerate(("leader", *followers), start=1)
    }
    return content


def crowd(count: int, duration_s: float) -> Mission:
    """So many vehicles in rows of ten on a long line in the article's wind."""
    places = [divmod(number, ROW) for number in range(1, count)]
    slots = [
        (-SPACING_M * row, SPACING_M * (place if place <= ROW // 2 else ROW // 2 - place))
        for row, place in places
    ]
    content = grown("line-wind", "bench-scale", slots)
    del content["controller"]
    leader = content["rehearsal"]["start"]["leader"] | {"north_m": 0, "east_m": 0}
    # In place: so many that join at once stand in each other's way.
    starts = {one["vehicle"]: {"forward_m": 0, "right_m": 0} for one in content["followers"]}
    content["rehearsal"] |= {"duration_s": duration_s, "start": {"leader": leader, **starts}}
    return Mission.model_validate(content)


def measure(count: int, duration_s: float) -> dict[str, float]:
    """Fly so many, twice, and measure once they are in place: the time it takes, and where it goes."""
    before = resident_mb()
    mission = crowd(count, JOINED_S + duration_s)
    joining_s, wall_s, processor_s = timed_flight(mission)
    with ExitStack() as stack:
        durations = {
            part: stack.enter_context(calls_timed(owner, name))
            for part, (owner, name) in SHARES.items()
        }

        def forget() -> None:
            for spent in durations.values():
                spent.clear()

        _, _, timed = timed_flight(mission, forget)
    rate_hz = mission.rehearsal.rate_hz
    steps = count * duration_s * rate_hz
    return {
        "vehicles": count,
        "duration_s": duration_s,
        "wall_s": wall_s,
        "processor_s": processor_s,
        "real_time_factor": duration_s / wall_s,
        "step_us": processor_s / steps * 1e6,
        "joining_step_us": joining_s / (count * JOINED_S * rate_hz) * 1e6,
        "memory_mb": resident_mb(),
        "memory_before_mb": before,
        "guidance_us": statistics.median(durations["guidance"]) * 1e6,
        **{f"{part}_share": sum(spent) / timed for part, spent in durations.items()},
    }


def timed_flight(
    mission: Mission, joined: Callable[[], None] = lambda: None
) -> tuple[float, float, float]:
    """Processor time until everybody is in place, then wall time and processor time to the end, s.

    Args:
        mission: what is flown.
        joined: called when everybody is in place.
    """
    began = time.process_time()
    wall = processor = math.nan

    def notice(now: float) -> None:
        nonlocal wall, processor
        if math.isnan(wall) and now >= JOINED_S:
            joined()
            wall, processor = time.perf_counter(), time.process_time()

    fly_lockstep(mission, progress=notice)
    return processor - began, time.perf_counter() - wall, time.process_time() - processor


def resident_mb() -> float:
    """Greatest memory of this process so far, MB."""
    try:
        import resource
    except ImportError:
        # Windows counts it for psutil.
        memory = import_extra("psutil").Process().memory_info()
        return float(getattr(memory, "peak_wset", memory.rss)) / 1e6
    scale = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / scale


def growth_exponent(results: Sequence[Mapping[str, float]]) -> float:
    """P of processor time ~ vehicles^p, fitted by least squares in the logarithms."""
    vehicles = [math.log(one["vehicles"]) for one in results]
    # Per flight second: flights of different length compare.
    times = [math.log(one["processor_s"] / one["duration_s"]) for one in results]
    return float(np.polyfit(vehicles, times, 1)[0])


def sizes(*, quick: bool) -> Iterator[tuple[str, dict[str, float]]]:
    """Fly formations of growing size, each in a fresh process of its own."""
    for count in COUNTS:
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            yield f"{count}", pool.submit(measure, count, QUICK_S if quick else FLOWN_S).result()


SCALE_COLUMNS = {
    "vehicles": "{case}",
    "times real time": "{real_time_factor:.1f}",
    "µs per vehicle and step": "{step_us:.0f}",
    "memory, MB": "{memory_mb:.0f}",
    "guidance step, µs": "{guidance_us:.0f}",
    "companion": "{companion_share:.0%}",
    "of it decode": "{decode_share:.0%}",
    "encode": "{encode_share:.0%}",
    "guidance": "{guidance_share:.0%}",
}
"""The last are shares of the whole time."""


SIZES = (2, 4, 8, 12)
"""Vehicles."""

RATES_HZ = (20.0, 10.0, 5.0, 2.0)
"""Rates of the leader's states."""

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


def radio_mission(size: int, seconds: float, radio: Mapping[str, float] | None = None) -> Mission:
    """circle-wind with so many vehicles, over a radio with these fields if there are any."""
    content = grown("circle-wind", "circle-wind", SLOTS[: size - 1])
    leader = content["rehearsal"]["start"]["leader"]
    starts = {one["vehicle"]: {"forward_m": BEHIND_M} for one in content["followers"]}
    content["rehearsal"] |= {
        "duration_s": seconds,
        "start": {"leader": leader, **starts},
        "radio": radio,
    }
    return Mission.model_validate(content)


RadioCase = tuple[int, float, Mapping[str, float] | None]
"""Vehicles, length of the flight in s, fields of its radio; None: without one, each state 0.1 s late."""


def fly_radio(case: RadioCase) -> dict[str, float]:
    """Fly a case: errors over its last half, the channel, and what members did not believe, by reason."""
    size, seconds, radio = case
    air, refused, age_s = Counter[str](), Counter[str](), math.nan
    if radio is None:
        record = fly_lockstep(radio_mission(size, seconds)).record
    else:
        flown = fly_by_radio(radio_mission(size, seconds, radio))
        record, air, refused = flown.flight.record, flown.air, flown.refused
        age_s = float(np.mean(flown.leader_age_s))
    figures = figures_of(record)
    return {
        "mean_m": figures.mean_error_m,
        "max_m": figures.max_error_m,
        "nearest_m": figures.min_separation_m,
        "age_ms": 1e3 * age_s,
        "air_bytes_s": air["bytes"] / seconds,
        "collisions": air["in collisions"],
        **refused,
    }


def radio(
    executor: Executor,
    *,
    sizes: Sequence[int] = SIZES,
    rates_hz: Sequence[float] = RATES_HZ,
    followers_hz: float = 2.5,
    loss: float = 0.0,
    bursts: float = 0.0,
    seconds: float = 120.0,
) -> Iterator[Row]:
    """Fly circle-wind over a radio that all share: first without any, then by each rate of the leader.

    Followers say their states no more often than the leader does. Names of figures end in the size.
    """
    radios: dict[str, Mapping[str, float] | None] = {"no radio, 0.1 s late": None}
    for rate_hz in rates_hz:
        rates = {"leader_hz": rate_hz, "followers_hz": min(followers_hz, rate_hz)}
        radios[f"{rate_hz:g} Hz"] = {**rates, "loss": loss, "bursts": bursts}
    for name, fields in radios.items():
        flown = [(size, seconds, fields) for size in sizes]
        figures = dict[str, float]()
        for size, found in zip(sizes, flown_by(executor, fly_radio, flown), strict=True):
            figures |= {f"{key}_{size}": value for key, value in found.items()}
        yield name, figures


def radio_columns(sizes: Sequence[int]) -> dict[str, str]:
    """Return the columns of formations of these sizes: error, greatest, age of the leader's state, load."""
    return {"leader": "{case}"} | {
        f"{one} aircraft": f"{{mean_m_{one}:.3f}} / {{max_m_{one}:.2f}} / {{age_ms_{one}:.0f}}"
        f" / {{air_bytes_s_{one}:.0f}}"
        for one in sizes
    }
