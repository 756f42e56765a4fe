"""What a route takes from the rest of its mission: the origin of coordinates, and how tightly it may turn.

Reads plain data, as `consistency` does, since a path is looked at while the rest may still have faults.
"""

import math
from collections.abc import Iterator, Mapping

from vfguide.guidance.airframe import GRAVITY
from vfguide.mission.consistency import (
    DEFAULT_AIRSPEED_RANGE_M_S,
    airspeed_range,
    group,
    listed,
    number,
)
from vfguide.mission.place import MissionFrame
from vfguide.mission.vehicle import DEFAULT_MAX_BANK_DEG
from vfguide.registry import paths

BANK_SHARE = 2.0 / 3.0
"""Share of a vehicle's bank limit that is used on a turn whose radius the mission does not give: the rest is
for gusts, and for the way back into the slot."""

SPARE_M_S = 1.0
"""Airspeed that a slot on such a turn leaves at either end of its vehicle's range."""

WIDEST_M = 2000.0
"""A slot that takes a wider turn than this takes another mission."""

ARTICLE_WIND_M_S = 8.0
"""The article's wind at its strongest."""


def with_frame(data: object) -> object:
    """A mission, given as plain data, whose paths know what they need of the rest; anything else as it is."""
    if not isinstance(data, Mapping):
        return data
    frame = frame_of(data)
    if frame is None:
        return data
    framed = {"path": _framed(data["path"], frame)} if "path" in data else {}
    others = data.get("paths")
    if isinstance(others, Mapping):
        framed["paths"] = {name: _framed(path, frame) for name, path in others.items()}
    return {**data, **framed}


def _framed(path: object, frame: MissionFrame) -> object:
    if isinstance(path, Mapping) and takes_frame(path.get("type")):
        return {**path, "frame": frame}
    return path


def takes_frame(kind: object) -> bool:
    """Whether a kind of path asks for it."""
    known = isinstance(kind, str) and kind in paths.own
    return known and "frame" in paths.find(str(kind)).Shape.model_fields


def frame_of(data: Mapping[str, object]) -> MissionFrame | None:
    """What a path takes from a mission; None where that does not say it, or not rightly."""
    origin = group(data, "origin")
    values = [
        number(origin.get(name)) for name in ("latitude_deg", "longitude_deg", "altitude_amsl_m")
    ]
    height = number(data.get("height_above_origin_m", 100.0))
    latitude, longitude, altitude = values
    if latitude is None or longitude is None or altitude is None or height is None:
        return None
    if abs(latitude) > 85.0 or abs(longitude) > 180.0:
        return None
    return MissionFrame(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=altitude,
        height_above_origin_m=height,
        radius_m=least_radius(data),
    )


def least_radius(data: Mapping[str, object]) -> float:
    """Radius (m, whole) of turns that every vehicle of the formation flies with something to spare.

    At the leader's ground speed V in the strongest wind from behind, a slot y metres outside flies
    V (1 + y / R) and needs a bank of atan(V² (1 + y / R) / (g R)); its airspeed is about that of the leader
    plus or minus V y / R.
    """
    airspeed = number(group(data, "leader").get("airspeed_m_s")) or 20.0
    speed = airspeed + wind_speed(group(data, "wind"))
    radius = 1.0
    for vehicle, aside in slots(data):
        bank = math.radians(number(vehicle.get("max_bank_deg")) or DEFAULT_MAX_BANK_DEG)
        acceleration = GRAVITY * math.tan(max(min(bank, 1.4), 0.01) * BANK_SHARE)
        tight = speed * speed / acceleration
        # R² - tight R - tight y = 0
        radius = max(radius, 0.5 * (tight + math.sqrt(tight * tight + 4.0 * tight * aside)))
        lowest, highest = airspeed_range(vehicle) or DEFAULT_AIRSPEED_RANGE_M_S
        for room in (airspeed - lowest, highest - airspeed):
            if aside > 0.0:
                radius = max(radius, aside * speed / max(room - SPARE_M_S, 0.1))
    return float(math.ceil(min(radius, WIDEST_M)))


def slots(data: Mapping[str, object]) -> Iterator[tuple[Mapping[str, object], float]]:
    """(vehicle, distance of its slot aside from the leader in m) of the leader and all followers."""
    vehicles = group(data, "vehicles")
    yield group(vehicles.get(str(group(data, "leader").get("vehicle")))), 0.0
    for one in listed(data.get("followers")):
        aside = number(group(one, "slot").get("right_m"))
        yield group(vehicles.get(str(group(one).get("vehicle")))), abs(aside or 0.0)


def wind_speed(wind: Mapping[str, object]) -> float:
    """Greatest speed of the mean wind, m/s."""
    if wind.get("type") == "article":
        return ARTICLE_WIND_M_S
    return max(number(wind.get("speed_m_s")) or 0.0, 0.0)
