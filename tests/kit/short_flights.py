"""A short flight with two vehicles, by hand."""

import math

import numpy as np

from tests.kit.records import still_flight, still_vehicle
from vfguide.record.flight import FlightRecord, RecordAcceptance, RecordOrigin, VehicleRecord

ORIGIN = RecordOrigin(latitude_deg=47.0, longitude_deg=8.0, altitude_amsl_m=488.0)


def vehicle(name: str, time_s: np.ndarray, **given: object) -> VehicleRecord:
    """North at 20 m/s from the origin, 100 m above it."""
    mode = np.where(time_s < 1.0, 0, 1).astype(np.int64)
    fields = {"north_m": 20.0 * time_s, "mode": mode} | given
    return still_vehicle(name, "leader" if name == "lead" else "follower", time_s, **fields)


def short_flight(*, name: str = "f1", **given: object) -> FlightRecord:
    """A flight of 2 s with 10 samples a second; the follower is 3 m ahead of its slot, 4 m left of it."""
    time_s = np.arange(21) / 10.0
    follower = vehicle(
        name,
        time_s,
        slot_forward_m=-30.0,
        slot_right_m=10.0,
        north_m=20.0 * time_s - 27.0,
        east_m=np.full_like(time_s, 6.0),
    )
    fields = {
        "mode_names": ("joining", "tracking"),
        "path_north_m": np.array([0.0, 100.0, math.nan]),
        "path_east_m": np.zeros(3),
        "mission": "line",
        "rate_hz": 10.0,
        "wall_s": None,
        "acceptance": RecordAcceptance(),
        "origin": ORIGIN,
    }
    return still_flight(time_s, vehicle("lead", time_s), follower, **(fields | given))
