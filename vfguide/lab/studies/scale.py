"""Measure the cost of formations of growing size, in lockstep in one process and over a shared radio.

Single methods and the guidance steps of each law are measured by processor time, as called in a flight.
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
"""Share of the first calls that is left out, since it holds imports and first solutions."""

COUNTS = (4, 10, 30, 100)

FLOWN_S, QUICK_S = 20.0, 4.0

JOINED_S = 20.0
"""Flight time before the measurement, s: joining is not measured."""

ROW = 10

SPACING_M = 20.0

SHARES = {
    "companion": (Companion, "receive_mavlink"),
    "decode": (Codec, "decode"),
    "encode": (Codec, "encode"),
    "guidance": (FollowerRole, "step"),
}
"""Methods that are timed."""


@contextmanager
def calls_timed(owner: type, name: str) -> Iterator[list[float]]:
    """Collect the processor time of every call of a method, s, without waiting times."""
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
    """Time a follower's guidance step by each law, on circle-wind."""
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
    """Return one of the article's missions as fields, renamed, with a follower for each slot.

    Slots are m ahead and right of the leader; followers are of the leader's kind.
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
    """Return a mission of `count` vehicles in rows of ten on a long line in the article's wind."""
    places = [divmod(number, ROW) for number in range(1, count)]
    slots = [
        (-SPACING_M * row, SPACING_M * (place if place <= ROW // 2 else ROW // 2 - place))
        for row, place in places
    ]
    content = grown("line-wind", "bench-scale", slots)
    del content["controller"]
    leader = content["rehearsal"]["start"]["leader"] | {"north_m": 0, "east_m": 0}
    # They start in their slots: many vehicles that join at once obstruct each other.
    starts = {one["vehicle"]: {"forward_m": 0, "right_m": 0} for one in content["followers"]}
    content["rehearsal"] |= {"duration_s": duration_s, "start": {"leader": leader, **starts}}
    return Mission.model_validate(content)


def measure(count: int, duration_s: float) -> dict[str, float]:
    """Fly `count` vehicles twice: once for total times, once for the shares of the timed methods."""
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
    """Fly a mission; call `joined` after `JOINED_S`.

    Return processor time until then, and wall time and processor time from then to the end, s.
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
    """Return the peak resident memory of this process, MB."""
    try:
        import resource
    except ImportError:
        # On Windows psutil reads it.
        memory = import_extra("psutil").Process().memory_info()
        return float(getattr(memory, "peak_wset", memory.rss)) / 1e6
    scale = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / scale


def growth_exponent(results: Sequence[Mapping[str, float]]) -> float:
    """Return p of processor time ~ vehicles^p, fitted by least squares in the logarithms."""
    vehicles = [math.log(one["vehicles"]) for one in results]
    # Per second of flight, so that flights of different length compare.
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
"""Columns of the table; the last four are shares of the processor time."""


SIZES = (2, 4, 8, 12)
"""Numbers of vehicles."""

RATES_HZ = (20.0, 10.0, 5.0, 2.0)
"""Rates of the leader's states, Hz."""

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
"""Slots in m ahead and right of the leader: the article's three, then the rest of a three-column grid."""

BEHIND_M = -60
"""Start of each follower ahead of its slot, m."""


def radio_mission(size: int, seconds: float, radio: Mapping[str, float] | None = None) -> Mission:
    """Return circle-wind with `size` vehicles, over a radio with these fields if there are any."""
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
"""Number of vehicles, length of the flight in s, fields of the radio; None for a link with 0.1 s latency."""


def fly_radio(case: RadioCase) -> dict[str, float]:
    """Fly a case; return errors over its last half, channel load, and rejected messages by reason."""
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
    """Fly circle-wind first without a radio, then over a shared radio at each rate of the leader.

    Followers send their states at most as often as the leader. Names of figures end in the size.
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
    """Return table columns by formation size: mean and greatest error, leader state age, channel load."""
    return {"leader": "{case}"} | {
        f"{one} aircraft": f"{{mean_m_{one}:.3f}} / {{max_m_{one}:.2f}} / {{age_ms_{one}:.0f}}"
        f" / {{air_bytes_s_{one}:.0f}}"
        for one in sizes
    }
