"""A short flight with two vehicles, by hand."""

import math
from dataclasses import replace

import numpy as np

from vfguide.record.flight import FlightRecord, RecordAcceptance, RecordOrigin, VehicleRecord
from vfguide.record.vehicle import SERIES

ORIGIN = RecordOrigin(latitude_deg=47.0, longitude_deg=8.0, altitude_amsl_m=488.0)


def vehicle(name: str, time_s: np.ndarray, **given: object) -> VehicleRecord:
    """North at 20 m/s from the origin, 100 m above it."""
    series = {one: np.zeros_like(time_s) for one in SERIES}
    series |= {
        "north_m": 20.0 * time_s,
        "altitude_amsl_m": np.full_like(time_s, 588.0),
        "ground_speed_m_s": np.full_like(time_s, 20.0),
    }
    made = VehicleRecord(
        name=name,
        role="leader" if name == "lead" else "follower",
        system_id=1,
        slot_forward_m=0.0,
        slot_right_m=0.0,
        mode=np.where(time_s < 1.0, 0, 1).astype(np.int64),
        limited=np.zeros(time_s.shape, dtype=np.bool_),
        **series,
    )
    return replace(made, **given)  # type: ignore[arg-type]


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
    record = FlightRecord(
        time_s=time_s,
        vehicles=(vehicle("lead", time_s), follower),
        mode_names=("joining", "tracking"),
        path_north_m=np.array([0.0, 100.0, math.nan]),
        path_east_m=np.array([0.0, 0.0, 0.0]),
        mission="line",
        controller="slot",
        plant="heading-hold",
        wind="calm",
        mode="lockstep",
        rate_hz=10.0,
        seed=1,
        duration_s=2.0,
        wall_s=None,
        acceptance=RecordAcceptance(),
        origin=ORIGIN,
    )
    return replace(record, **given)  # type: ignore[arg-type]
