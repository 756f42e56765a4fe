"""Live data for Foxglove, as a client that speaks its protocol hears it."""

import asyncio
import base64
import json
import socket
import struct
from typing import Any

import jsonschema
import numpy as np
import pytest
from websockets.asyncio.client import connect

from tests.kit.foxglove import said
from tests.kit.missions import shipped
from vfguide.commands.fly import check_options
from vfguide.errors import InputError, VfguideError
from vfguide.lab.console.alarms import MODES, SERIES
from vfguide.lab.console.foxglove import foxglove_stream

MESSAGE = struct.Struct("<BIQ")
"""Head of a message: 1, subscription, ns since 1970."""


def picture() -> np.ndarray:
    """Leader 100 m north of the origin, f1 behind it; nothing is known of the others."""
    values = np.full((4, len(SERIES)), np.nan)
    known = {"altitude_m": 588.0, "course_deg": 90.0, "heading_deg": 90.0, "bank_deg": 0.0}
    own = [{"north_m": 100.0, "east_m": 0.0}, {"north_m": 120.0, "east_m": -20.0}]
    slot = {"slot_north_m": 120.0, "slot_east_m": -20.0, "slot_altitude_m": 588.0}
    for row, place in enumerate(own):
        for name, value in {**known, **place, **slot}.items():
            values[row, SERIES.index(name)] = value
    values[:, SERIES.index("mode")] = MODES.index("tracking")
    return values


async def heard_of(url: str, show: Any, topics: set[str]) -> dict[str, Any]:
    """What the newest message of each topic says, subscribed to as it is advertised."""
    found: dict[str, Any] = {}
    channels: dict[int, dict] = {}
    async with asyncio.timeout(30.0), connect(url, subprotocols=["foxglove.sdk.v1"]) as client:
        while set(found) != topics:
            show()
            try:
                heard = await asyncio.wait_for(client.recv(), 0.1)
            except TimeoutError:
                continue
            if isinstance(heard, str):
                content = json.loads(heard)
                if content["op"] == "advertise":
                    new = {one["id"]: one for one in content["channels"]}
                    channels |= new
                    asked = [{"id": number, "channelId": number} for number in new]
                    await client.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            elif heard[0] == 1:
                _, number, _ = MESSAGE.unpack_from(heard)
                channel, message = channels[number], heard[MESSAGE.size :]
                name, encoding = channel["schemaName"], channel["encoding"]
                schema = channel["schema"].encode()
                if encoding == "protobuf":
                    schema = base64.b64decode(schema)
                else:
                    jsonschema.validate(json.loads(message), json.loads(schema))
                found[channel["topic"]] = said(name, encoding, schema, message)
    return found


TOPICS = {
    *(f"/{name}/state" for name in ("leader", "f1", "f2", "f3")),
    *(f"/{name}/location" for name in ("leader", "f1")),
    *(f"/scene/{name}" for name in ("leader", "f1", "path")),
    "/tf",
}


async def test_a_client_hears_the_topics_of_the_export_and_each_message_is_what_its_schema_says():
    with foxglove_stream(shipped("line-calm"), 0) as (stream, url):
        assert url.startswith("ws://127.0.0.1:")
        found = await heard_of(url, lambda: stream.show(picture()), TOPICS)
    state = found["/f1/state"]
    assert (state["mode"], state["north_m"], state["altitude_amsl_m"]) == ("tracking", 120.0, 588.0)
    assert "north_m" not in found["/f2/state"]
    # 120 m north of the origin are 0.00108 degrees.
    assert found["/f1/location"].latitude == pytest.approx(47.397742 + 0.00108, abs=1e-5)
    assert len(found["/scene/f1"].entities[0].arrows) == 2
    assert found["/scene/path"].entities[0].lines[0].points[0].z == 100.0


def test_a_port_that_is_taken_is_told_with_the_remedy():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(VfguideError, match=rf"--foxglove {port}: .*choose another port"),
            foxglove_stream(shipped("line-calm"), port),
        ):
            pass


UNWATCHED: dict[str, Any] = {
    "live": True,
    "speedup": None,
    "links": None,
    "console": False,
    "operator": False,
    "tiles": None,
    "foxglove": None,
    "for_nothing": False,
}
"""A live flight that nobody watches."""


def test_a_map_needs_the_page_of_a_flight():
    with pytest.raises(InputError, match=r"--live --console.*; add both"):
        check_options(**UNWATCHED | {"tiles": "map.mbtiles"})
    check_options(**UNWATCHED | {"console": True, "foxglove": 0})
