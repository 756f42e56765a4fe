"""KML and KMZ: tracks with time, for Google Earth and QGroundControl."""

import math
from pathlib import Path

import numpy as np
import simplekml

from vfguide.lab.export.columns import begin_of, geodetic, moment, origin_of
from vfguide.lab.report.colours import vehicle_colours
from vfguide.record.flight import FlightRecord

MOST_POINTS = 100_000
"""Points of all tracks together, at most: viewers draw no more smoothly."""

FINEST_STEP_S = 0.2


def write_earth(record: FlightRecord, path: Path, *, compressed: bool) -> None:
    """Write a flight as KML, or as KMZ if it is to be compressed.

    Raises:
        OSError: it cannot be written.
        InputError: the record does not say where on the earth it was flown.
    """
    origin, begin = origin_of(record), begin_of(record)
    document = simplekml.Kml(name=printable(record.mission))
    latitude, longitude = geodetic(origin, record.path_north_m, record.path_east_m)
    height = float(np.nanmean(record.leader.altitude_amsl_m)) if known_height(record) else 0.0
    known = np.isfinite(latitude) & np.isfinite(longitude)
    line = document.newlinestring(
        name="path",
        coords=[
            (east, north, height)
            for east, north in zip(longitude[known].tolist(), latitude[known].tolist(), strict=True)
        ],
        altitudemode=simplekml.AltitudeMode.absolute,
    )
    line.style.linestyle.color = simplekml.Color.hexa("bdbdbdff")
    line.style.linestyle.width = 2
    stride = choose_stride(record)
    for vehicle in record.vehicles:
        latitude, longitude = geodetic(origin, vehicle.north_m, vehicle.east_m)
        altitude = vehicle.altitude_amsl_m
        known = np.isfinite(latitude) & np.isfinite(longitude) & np.isfinite(altitude)
        shown = np.flatnonzero(known)[::stride]
        track = document.newgxtrack(
            name=printable(vehicle.name), altitudemode=simplekml.AltitudeMode.absolute
        )
        track.newwhen([moment(begin + time_s) for time_s in record.time_s[shown].tolist()])
        track.newgxcoord(
            list(
                zip(
                    longitude[shown].round(8).tolist(),
                    latitude[shown].round(8).tolist(),
                    altitude[shown].round(2).tolist(),
                    strict=True,
                )
            )
        )
        colour = vehicle_colours(record)[vehicle.name].removeprefix("#")
        track.style.linestyle.color = simplekml.Color.hexa(f"{colour}ff")
        track.style.linestyle.width = 3
    if compressed:
        document.savekmz(str(path))
    else:
        document.save(str(path))


def known_height(record: FlightRecord) -> bool:
    """Whether the leader's height was ever known."""
    return bool(np.any(np.isfinite(record.leader.altitude_amsl_m)))


def choose_stride(record: FlightRecord) -> int:
    """Every which sample is shown."""
    samples = record.time_s.size
    step_s = record.duration_s / max(samples - 1, 1)
    finest = FINEST_STEP_S / step_s if step_s > 0.0 else 1.0
    return max(1, math.floor(finest), math.ceil(samples * len(record.vehicles) / MOST_POINTS))


def printable(text: str) -> str:
    """A name without the characters that XML cannot hold."""
    return "".join(one if one.isprintable() else " " for one in text)
