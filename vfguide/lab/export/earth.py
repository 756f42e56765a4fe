"""Export for map programs: KML and KMZ tracks with time, and a QGroundControl plan (`.plan`).

A plan holds the leader's track as waypoints, and the rally points. Format: docs.qgroundcontrol.com, developer
guide, Plan File Format. The plan has no fence, since a record does not tell inclusion areas from exclusion
areas: the fence stays with the mission's own plan.
"""

import json
import math
from pathlib import Path

import numpy as np
import simplekml

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.errors import InputError
from vfguide.lab.export.columns import begin_of, finest_stride, geodetic, moment, origin_of
from vfguide.lab.report.colours import vehicle_colours
from vfguide.record.flight import FlightRecord

MOST_POINTS = 100_000
"""Largest number of points of all tracks together: viewers draw no more smoothly."""


def write_earth(record: FlightRecord, path: Path, *, compressed: bool) -> None:
    """Write a flight as KML, or compressed as KMZ.

    Raises:
        OSError: the file cannot be written.
        InputError: the record does not hold its geodetic origin.
    """
    origin, begin = origin_of(record), begin_of(record)
    document = simplekml.Kml(name=printable(record.mission))
    latitude, longitude = geodetic(origin, record.path_north_m, record.path_east_m)
    heights = record.leader.altitude_amsl_m
    height = float(np.nanmean(heights)) if np.isfinite(heights).any() else 0.0
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
    samples = record.time_s.size * len(record.vehicles)
    stride = max(finest_stride(record), math.ceil(samples / MOST_POINTS))
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


def printable(text: str) -> str:
    """Replace characters that XML cannot hold by spaces."""
    return "".join(one if one.isprintable() else " " for one in text)


NEAR_M = 1.0
"""Largest distance of the track from the route in space, unless that takes too many waypoints."""

MOST_WAYPOINTS = 500
"""Autopilots store some 700 waypoints."""

MOST_SAMPLES = 20_000
"""Largest number of track samples used."""

WAYPOINT, GLOBAL, ABSOLUTE = 16, 0, 2
"""MAV_CMD_NAV_WAYPOINT, MAV_FRAME_GLOBAL, and QGroundControl's number for altitudes above sea level."""

FIXED_WING, GENERIC = 1, 0
"""MAV_TYPE and MAV_AUTOPILOT."""


def write_plan(record: FlightRecord, path: Path) -> None:
    """Write the leader's track as a plan.

    Raises:
        InputError: the record does not hold its geodetic origin or a track of the leader.
        OSError: the file cannot be written.
    """
    origin, leader = origin_of(record), record.leader
    track = np.column_stack([leader.north_m, leader.east_m, leader.altitude_amsl_m])
    track = track[np.isfinite(track).all(axis=1)]
    track = track[:: max(1, -(-len(track) // MOST_SAMPLES))]
    route = track[chosen(track)] if len(track) > 1 else track
    if len(route) < 2:
        raise InputError(
            "no track of the leader is recorded: there is nothing to plan; give another flight"
        )
    latitude, longitude = geodetic(origin, route[:, 0], route[:, 1])
    places = np.column_stack([latitude.round(8), longitude.round(8), route[:, 2].round(2)]).tolist()
    # A recorded flight may know no airspeed.
    speeds = leader.airspeed_m_s
    speeds = leader.ground_speed_m_s if np.isnan(speeds).all() else speeds
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "vfguide",
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "mission": {
            "version": 2,
            "firmwareType": GENERIC,
            "vehicleType": FIXED_WING,
            "globalPlanAltitudeMode": ABSOLUTE,
            "cruiseSpeed": round(float(np.nanmedian(speeds)), 1),
            "hoverSpeed": 5,
            "plannedHomePosition": [
                origin.latitude_deg,
                origin.longitude_deg,
                origin.altitude_amsl_m,
            ],
            "items": [waypoint(number, place) for number, place in enumerate(places, 1)],
        },
        "rallyPoints": {"version": 2, "points": rally_points(record)},
    }
    path.write_text(json.dumps(plan, indent=4, allow_nan=False) + "\n", encoding="utf-8")


def waypoint(number: int, place: list[float]) -> dict[str, object]:
    """Return a mission item from its number, from 1, and latitude, longitude and altitude above sea level."""
    return {
        "type": "SimpleItem",
        "command": WAYPOINT,
        "frame": GLOBAL,
        "doJumpId": number,
        "autoContinue": True,
        "AMSLAltAboveTerrain": None,
        "Altitude": place[2],
        "AltitudeMode": ABSOLUTE,
        "params": [0, 0, 0, None, *place],
    }


def rally_points(record: FlightRecord) -> list[list[float]]:
    """Return latitude, longitude and altitude of each rally point; records lack it, so it is the origin's."""
    origin = origin_of(record)
    found: list[list[float]] = []
    for one in record.outlines:
        if one.kind == "rally":
            latitude, longitude = geodetic(origin, one.north_m, one.east_m)
            found += [
                [round(north, 8), round(east, 8), origin.altitude_amsl_m]
                for north, east in zip(latitude.tolist(), longitude.tolist(), strict=True)
            ]
    return found


def chosen(track: FloatArray) -> BoolArray:
    """Select points of a track (N points, m) for the closest route with at most `MOST_WAYPOINTS`."""
    near_m = NEAR_M
    while np.count_nonzero(kept := corners(track, near_m)) > MOST_WAYPOINTS:
        near_m *= 2.0
    return kept


def corners(track: FloatArray, near_m: float) -> BoolArray:
    """Select points so that no other is farther than `near_m` from the line between its neighbours.

    The method is that of Ramer (1972), and Douglas and Peucker (1973).
    """
    kept = np.zeros(len(track), dtype=np.bool_)
    kept[[0, -1]] = True
    spans = [(0, len(track) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        away = distances(track[first + 1 : last], track[first], track[last])
        farthest = int(np.argmax(away))
        if away[farthest] > near_m:
            middle = first + 1 + farthest
            kept[middle] = True
            spans += [(first, middle), (middle, last)]
    return kept


def distances(points: FloatArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return each point's distance from the line segment between two others, m."""
    way = end - begin
    length_2 = float(way @ way)
    share = np.clip((points - begin) @ way / length_2, 0.0, 1.0) if length_2 > 0.0 else 0.0
    away: FloatArray = np.linalg.norm(points - begin - np.multiply.outer(share, way), axis=1)
    return away
