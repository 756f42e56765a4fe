"""Live view of the console's data over Foxglove's WebSocket, with the topics of the MCAP export.

Foxglove, Lichtblick and PlotJuggler can read it. It is served on loopback alone.
"""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from foxglove import Context, start_server

from vfguide.companion.mission_plan import local_frame
from vfguide.elementwise import FloatArray
from vfguide.errors import VfguideError
from vfguide.lab.console.alarms import MODES, SERIES
from vfguide.lab.console.model import drawn_path
from vfguide.lab.export.foxglove import (
    FoxgloveTopics,
    path_line,
    put_line,
    put_scene,
    put_state,
    scene,
)
from vfguide.lab.report.colours import colours_of
from vfguide.mission import Mission

HOST = "127.0.0.1"

NAMED_OTHERWISE = {"altitude_m": "altitude_amsl_m", "age_s": "leader_age_s"}
"""Names in the export of the console's series, where they differ."""

PATH_EVERY = 50
"""Number of pictures between repeats of the path, which late clients need."""


class FoxgloveStream:
    """Converter from the console's pictures to messages."""

    def __init__(self, mission: Mission, topics: FoxgloveTopics) -> None:
        self._topics, self._frame = topics, local_frame(mission)
        self._names = (mission.leader.vehicle, *mission.followers_by_name)
        self._colours = colours_of(self._names)
        self._modes: dict[str, str] = {}
        north, east = drawn_path(mission, mission.path)
        up = mission.height_above_origin_m
        self._path = path_line(east.tolist(), north.tolist(), up)
        self._count = 0

    def show(self, values: FloatArray) -> None:
        """Send a picture of shape (vehicles, series), as the console's model samples it; NaN is unknown."""
        now_ns = time.time_ns()
        if self._count % PATH_EVERY == 0:
            path = scene("path", now_ns, lines=[self._path])
            self._topics.put("/scene/path", now_ns, path)
        self._count += 1
        rows = [dict(zip(SERIES, row, strict=True)) for row in values.tolist()]
        for name, row in zip(self._names, rows, strict=True):
            self._show_vehicle(name, row, rows[0]["course_deg"], now_ns)

    def _show_vehicle(
        self, name: str, row: dict[str, float], leader_course: float, now_ns: int
    ) -> None:
        mode = MODES[int(row["mode"])]
        if self._modes.get(name) != mode:
            self._modes[name] = mode
            put_line(self._topics, name, mode, now_ns)
        known = {NAMED_OTHERWISE.get(one, one): value for one, value in row.items()}
        north, east = known["north_m"], known["east_m"]
        if math.isfinite(north) and math.isfinite(east):
            place = self._frame.to_geodetic(north, east)
            known |= dict(zip(("latitude_deg", "longitude_deg"), place, strict=True))
        put_state(self._topics, name, known, now_ns, mode=mode)
        origin_m, slot = self._frame.altitude_m, None
        if name != self._names[0]:
            up = row["slot_altitude_m"] - origin_m
            slot = (row["slot_east_m"], row["slot_north_m"], up, leader_course)
        put_scene(
            self._topics,
            name,
            self._colours[name],
            known,
            slot=slot,
            origin_m=origin_m,
            time_ns=now_ns,
        )


@contextmanager
def foxglove_stream(mission: Mission, port: int) -> Iterator[tuple[FoxgloveStream, str]]:
    """Serve a formation for as long as the context lasts; yield (stream, address).

    Port 0 takes any free one of the loopback interface.

    Raises:
        VfguideError: the port is not available.
    """
    context = Context()
    try:
        server = start_server(name=mission.name, host=HOST, port=port, context=context)
    # The library raises its own errors for failed system calls.
    except Exception as error:
        raise VfguideError(
            f"--foxglove {port}: cannot be served ({error}); choose another port, or 0 for a free one"
        ) from error
    try:
        yield FoxgloveStream(mission, FoxgloveTopics(context)), f"ws://{HOST}:{server.port}"
    finally:
        server.stop()
