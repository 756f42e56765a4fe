"""Scenarios drawn by one rule from common ranges, for the suite and for `vfguide bench monte-carlo`.

Each scenario has its own random generator, whose seed is its number. A draw in which `vfguide check` finds
an error is repeated. Nothing is flown, so no scenario is chosen by its result. The rule always gives the
same files.
"""

import math
from contextlib import suppress
from random import Random
from typing import Any

import yaml

from vfguide.errors import InputError
from vfguide.guidance.airframe import GRAVITY
from vfguide.mission import check_mission, parse_mission

DURATION_S = 100.0
LEAST_SPACING_M = 15.0
"""Minimum spacing of slots; starts of followers are twice as far from each other and from the leader."""
TURNING_BANK_DEG = 20.0
"""Bank of the leader at its airspeed plus the wind; aircraft in outer slots bank more."""


def drawn(number: int) -> str:
    """Draw one scenario as the text of a mission file."""
    random = Random(f"suite {number}")
    while True:
        text = yaml.safe_dump(
            draw(number, random), sort_keys=False, default_flow_style=None, width=100
        )
        with suppress(InputError):
            loaded = parse_mission(text.encode(), file=f"{number:03}.yaml")
            findings = check_mission(loaded.mission)
            if not any(one.severity == "error" for one in findings):
                return text


def draw(number: int, random: Random) -> dict[str, Any]:
    """Draw a mission, whether or not it can be flown."""
    names = [f"f{index}" for index in range(1, random.randint(1, 4) + 1)]
    plant = random.choice(["heading-hold", "course-hold", "bank", "bank", "npfg", "six-dof"])
    airspeed = random.uniform(20.0, 25.0) if plant == "six-dof" else random.uniform(14.0, 25.0)
    wind, slots = drawn_wind(random, airspeed), drawn_slots(random, len(names))
    content: dict[str, Any] = {
        "name": f"suite-{number:03}",
        "origin": {"latitude_deg": 47.397742, "longitude_deg": 8.545594, "altitude_amsl_m": 488},
        "height_above_origin_m": 120,
        "path": drawn_path(random, airspeed + wind.get("speed_m_s", 0.0)),
        "leader": {"vehicle": "leader", "airspeed_m_s": rounded(airspeed)},
        "followers": [
            {"vehicle": name, "slot": slot} for name, slot in zip(names, slots, strict=True)
        ],
        "vehicles": drawn_vehicles(random, names, plant),
        "controller": {"type": "slot"},
        "wind": wind,
        "rehearsal": {
            "duration_s": DURATION_S,
            "rate_hz": 10,
            "seed": number,
            "sensors": random.choice(["ideal", "ideal", "rtk", "sbas", "standalone"]),
            "start": drawn_start(random, names, slots),
            "emulator": drawn_emulator(random, plant),
            **drawn_link(random),
        },
    }
    return happens(content, random, names)


def drawn_wind(random: Random, airspeed: float) -> dict[str, Any]:
    """Draw calm air, or a wind of up to a third of the airspeed, and turbulence."""
    wind: dict[str, Any] = {"type": "calm"}
    if random.random() < 0.8:
        wind = {
            "type": "steady",
            "speed_m_s": rounded(random.uniform(1.0, airspeed / 3.0)),
            "toward_deg": rounded(random.uniform(0.0, 360.0)),
        }
    turbulence = random.choice(["none"] * 5 + ["light"] * 3 + ["moderate"] * 2)
    return wind if turbulence == "none" else {**wind, "turbulence": turbulence}


def drawn_path(random: Random, fastest: float) -> dict[str, Any]:
    """Draw a path with turns of moderate bank at this ground speed, m/s."""
    least = fastest**2 / (GRAVITY * math.tan(math.radians(TURNING_BANK_DEG)))
    radius = rounded(random.uniform(1.0, 2.5) * max(least, 100.0))
    course = rounded(random.uniform(0.0, 360.0))
    here = {"north_m": 0, "east_m": 0}
    turn = random.choice(["clockwise", "counterclockwise"])
    match random.choice(["line", "circle", "racetrack", "figure-eight", "waypoints"]):
        case "line":
            return {"type": "line", "point": here, "course_deg": course}
        case "circle":
            return {"type": "circle", "centre": here, "radius_m": radius, "direction": turn}
        case "racetrack":
            return {
                "type": "racetrack",
                "centre": here,
                "course_deg": course,
                "leg_m": rounded(random.uniform(2.0, 6.0) * radius),
                "radius_m": radius,
                "direction": turn,
            }
        case "figure-eight":
            return {
                "type": "figure-eight",
                "centre": here,
                "course_deg": course,
                "half_length_m": rounded(random.uniform(2.5, 4.0) * radius),
            }
    points = [here]
    for _ in range(random.randint(3, 5)):
        course += random.uniform(-80.0, 80.0)
        leg = random.uniform(4.0, 7.0) * radius
        points.append(
            {
                "north_m": round(points[-1]["north_m"] + leg * math.cos(math.radians(course))),
                "east_m": round(points[-1]["east_m"] + leg * math.sin(math.radians(course))),
            }
        )
    return {"type": "waypoints", "waypoints": points, "radius_m": radius}


def drawn_slots(random: Random, count: int) -> list[dict[str, float]]:
    """Draw slots behind and beside the leader, some higher or lower, with the minimum spacing."""
    taken = [(0.0, 0.0)]
    while len(taken) <= count:
        place = rounded(random.uniform(-80.0, 10.0)), rounded(random.uniform(-60.0, 60.0))
        if all(math.dist(place, other) >= LEAST_SPACING_M for other in taken):
            taken.append(place)
    return [
        {"forward_m": ahead, "right_m": right, "up_m": random.choice([0, 0, 0, 5, -5])}
        for ahead, right in taken[1:]
    ]


def drawn_vehicles(random: Random, names: list[str], plant: str) -> dict[str, Any]:
    """Draw the declarations of the aircraft: mostly only the airspeed range."""
    autopilot = "px4" if plant == "npfg" else "ardupilot"
    defaults: dict[str, Any] = {
        "autopilot": autopilot,
        "plant": plant if plant in {"heading-hold", "course-hold"} else "heading-hold",
        "airspeed_range_m_s": [16, 32] if plant == "six-dof" else [10, 34],
    }
    if random.random() < 0.5:
        defaults["alpha_1_s"] = rounded(random.uniform(0.6, 1.8))
        defaults["beta_1_s"] = rounded(random.uniform(0.4, 1.0))
    ids = {name: {"system_id": number} for number, name in enumerate(["leader", *names], start=1)}
    return {"defaults": defaults, **ids}


def drawn_emulator(random: Random, plant: str) -> dict[str, Any]:
    """Draw the true properties of the aircraft."""
    truth: dict[str, Any] = {"plant": plant}
    if plant == "six-dof":
        return truth
    truth["max_bank_deg"] = rounded(random.uniform(35.0, 50.0))
    truth["max_acceleration_m_s2"] = rounded(random.uniform(1.5, 4.0))
    truth["course_dead_time_s"] = rounded(random.uniform(0.0, 0.3))
    if plant == "bank":
        truth["guided_p"] = round(random.uniform(5000.0, 15000.0))
        truth["roll_time_s"] = rounded(random.uniform(0.2, 0.6))
        truth["turn_efficiency"] = rounded(random.uniform(0.75, 1.0))
        truth["speed_response"] = random.choice(["first-order", "tecs"])
    else:
        truth["alpha_1_s"] = rounded(random.uniform(0.5, 2.0))
    if plant == "npfg":
        truth["roll_time_s"] = rounded(random.uniform(0.2, 0.6))
        truth["speed_response"] = "px4"
    elif truth.get("speed_response") != "tecs":
        truth["beta_1_s"] = rounded(random.uniform(0.3, 1.2))
    return truth


def drawn_start(random: Random, names: list[str], slots: list[dict[str, float]]) -> dict[str, Any]:
    """Draw starts of followers up to 80 m from their slots on either axis, with twice the minimum spacing."""
    taken, starts = [(0.0, 0.0)], {}
    for name, slot in zip(names, slots, strict=True):
        place = taken[0]
        while any(math.dist(place, other) < 2.0 * LEAST_SPACING_M for other in taken):
            ahead, right = (rounded(random.uniform(-80.0, 80.0)) for _ in range(2))
            place = slot["forward_m"] + ahead, slot["right_m"] + right
        taken.append(place)
        starts[name] = {"forward_m": ahead, "right_m": right}
    return starts


def drawn_link(random: Random) -> dict[str, Any]:
    """Draw delay, jitter and loss, or in one of ten cases a shared radio with bursts."""
    if random.random() < 0.1:
        return {
            "radio": {
                "leader_hz": random.choice([5, 10]),
                "loss": rounded(random.uniform(0.0, 0.1)),
                "bursts": rounded(random.uniform(0.0, 0.05)),
            }
        }
    delay = random.choice([0.02, 0.05, 0.1, 0.2, 0.3])
    return {
        "link_delay_s": delay,
        "link_jitter_s": rounded(random.uniform(0.0, 0.5) * delay),
        "link_loss": rounded(random.choice([0.0, 0.0, 0.1, 0.3]) * random.random()),
    }


def happens(content: dict[str, Any], random: Random, names: list[str]) -> dict[str, Any]:
    """Draw an event in flight: in half of the flights none."""
    rehearsal, who = content["rehearsal"], random.choice(names)
    at_s = rounded(random.uniform(35.0, 45.0))
    event = random.choice(["nothing"] * 6 + ["companion", "link", "guidance", "leader", "order"])
    if event == "leader" and "radio" in rehearsal:
        event = "companion"
    if event in {"companion", "link", "guidance"}:
        for_s = rounded(random.uniform(5.0, 15.0))
        rehearsal["losses"] = [{"vehicle": who, "at_s": at_s, "for_s": for_s, "what": event}]
    elif event == "leader":
        content["deputies"] = names
        rehearsal["losses"] = [{"vehicle": "leader", "at_s": at_s}]
    elif event == "order" and len(names) > 1:
        shapes = ("vee", "echelon-left", "echelon-right", "line-abreast", "trail")
        order = {"shape": random.choice(shapes), "spacing_m": round(random.uniform(20.0, 40.0))}
        content["orders"] = [{"at_s": at_s, **order}]
    return content


def rounded(value: float) -> float:
    """Round a number to the digits that a person would write."""
    return round(value, 2)
