"""What the console knows of a formation over Foxglove's WebSocket: the topics of the MCAP export, live.

Foxglove, Lichtblick and PlotJuggler read it. Served on loopback alone.
"""

import json
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from foxglove import Channel, Context, start_server

from vfguide.companion.mission_plan import local_frame
from vfguide.elementwise import FloatArray
from vfguide.errors import VfguideError
from vfguide.lab.console.alarms import MODES, SERIES
from vfguide.lab.console.model import drawn_path
from vfguide.lab.export.columns import UNITS
from vfguide.lab.export.foxglove import (
    FRAME,
    SCHEMAS,
    Message,
    arrow_at,
    attitude,
    colour_of,
    label_at,
    path_line,
    put_line,
    scene,
    stamp,
)
from vfguide.lab.report.colours import colours_of
from vfguide.mission import Mission

HOST = "127.0.0.1"

NAMED_OTHERWISE = {"altitude_m": "altitude_amsl_m", "age_s": "leader_age_s"}
"""Series of the console by the names that the export has for them."""

PATH_EVERY = 50
"""Pictures from one path to the next: who comes later sees it, too."""


class LiveTopics:
    """Sends messages by topic; makes each topic when it first comes."""

    def __init__(self, context: Context) -> None:
        """Send to whoever listens in this context."""
        self._context = context
        self._channels: dict[str, Channel] = {}

    def put(self, topic: str, schema: str, time_ns: int, message: Message) -> None:
        """Send one message."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = Channel(topic, schema=SCHEMAS[schema], context=self._context)
            self._channels[topic] = channel
        channel.log(json.dumps(message, allow_nan=False).encode(), log_time=time_ns)


class FoxgloveStream:
    """Makes messages of the console's pictures."""

    def __init__(self, mission: Mission, topics: LiveTopics) -> None:
        """Have shown nothing yet.

        Args:
            mission: of the formation.
            topics: what takes the messages.
        """
        self._topics, self._frame = topics, local_frame(mission)
        self._names = (mission.leader.vehicle, *mission.followers_by_name)
        self._colours = colours_of(self._names)
        self._modes: dict[str, str] = {}
        north, east = drawn_path(mission, mission.path)
        up = mission.height_above_origin_m
        self._path = path_line(east.tolist(), north.tolist(), up)
        self._count = 0

    def show(self, values: FloatArray) -> None:
        """Send a picture: (vehicles, series), as the console's model samples it; NaN is not known."""
        now_ns = time.time_ns()
        if self._count % PATH_EVERY == 0:
            path = scene("path", now_ns, lines=[self._path])
            self._topics.put("/scene/path", "foxglove.SceneUpdate", now_ns, path)
        self._count += 1
        rows = [dict(zip(SERIES, row, strict=True)) for row in values.tolist()]
        for name, row in zip(self._names, rows, strict=True):
            self._show_vehicle(name, row, rows[0]["course_deg"], now_ns)

    def _show_vehicle(
        self, name: str, row: dict[str, float], leader_course: float, now_ns: int
    ) -> None:
        put, mode = self._topics.put, MODES[int(row["mode"])]
        if self._modes.get(name) != mode:
            self._modes[name] = mode
            put_line(self._topics, name, mode, now_ns)
        known = {NAMED_OTHERWISE.get(one, one): value for one, value in row.items()}
        north, east, altitude = (known[one] for one in ("north_m", "east_m", "altitude_amsl_m"))
        placed = all(math.isfinite(one) for one in (north, east, altitude))
        if placed:
            place = self._frame.to_geodetic(north, east)
            known |= dict(zip(("latitude_deg", "longitude_deg"), place, strict=True))
        numbers = {
            one: value for one, value in known.items() if one in UNITS and math.isfinite(value)
        }
        time_of = {"timestamp": stamp(now_ns)}
        put(f"/{name}/state", "vfguide.VehicleState", now_ns, {**time_of, "mode": mode, **numbers})
        if not placed:
            return
        fix: Message = {
            **time_of,
            "frame_id": name,
            "latitude": numbers["latitude_deg"],
            "longitude": numbers["longitude_deg"],
            "altitude": altitude,
            "position_covariance": [0.0] * 9,
            "position_covariance_type": 0,
        }
        put(f"/{name}/location", "foxglove.LocationFix", now_ns, fix)
        heading, up = row["heading_deg"], altitude - self._frame.altitude_m
        bank = numbers.get("bank_deg", 0.0)
        transform: Message = {
            **time_of,
            "parent_frame_id": FRAME,
            "child_frame_id": name,
            "translation": {"x": east, "y": north, "z": up},
            "rotation": dict(zip("xyzw", attitude(heading, bank), strict=True)),
        }
        put("/tf", "foxglove.FrameTransform", now_ns, transform)
        colour = self._colours[name]
        arrow = arrow_at(east, north, up, heading, colour_of(colour, 1.0))
        if arrow is None:
            return
        slot = None
        if name != self._names[0]:
            slot = arrow_at(
                row["slot_east_m"],
                row["slot_north_m"],
                row["slot_altitude_m"] - self._frame.altitude_m,
                leader_course,
                colour_of(colour, 0.3),
            )
        label = label_at(arrow, name, colour)
        message = scene(name, now_ns, arrows=[arrow, *([slot] if slot else [])], texts=[label])
        put(f"/scene/{name}", "foxglove.SceneUpdate", now_ns, message)


@contextmanager
def foxglove_stream(mission: Mission, port: int) -> Iterator[tuple[FoxgloveStream, str]]:
    """Serve a formation as long as the context lasts; yields (what takes pictures, the address).

    Args:
        mission: of the formation.
        port: on loopback; 0 for any free one.

    Raises:
        VfguideError: the port is not to be had.
    """
    context = Context()
    try:
        server = start_server(name=mission.name, host=HOST, port=port, context=context)
    # The library raises errors of its own for what the system refuses.
    except Exception as error:
        raise VfguideError(
            f"--foxglove {port}: cannot be served ({error}); choose another port, or 0 for a free one"
        ) from error
    try:
        yield FoxgloveStream(mission, LiveTopics(context)), f"ws://{HOST}:{server.port}"
    finally:
        server.stop()
