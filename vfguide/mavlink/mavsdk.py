"""Connection kept by MAVSDK: frames in and out, offboard setpoints and modes by its plugins.

The companion sends PX4's messages as on vfguide's own connections. Messages for which MAVSDK has a call are
translated to it, others are sent unchanged, and received messages are handed on as frames. Guided Course has
no call: its commands, and a ground station's heartbeat, are sent by MavlinkDirect.

In offboard a thread of MAVSDK repeats the last setpoint every 50 ms, even while this process hangs. The
autopilot's fail-safe then sees a live stream. A watchdog here ends offboard when setpoints stop, unless the
process hangs. Prefer `autopilot: px4` for flight in offboard.

MAVSDK hands on messages of the vehicle's own system, unless they are addressed to somebody else, and without
their signatures. So no companion hears orders of ground stations, other controllers, or radios by it.

Whenever a MAVSDK instance ends, another follows. MAVSDK never reopens a serial port that was unplugged, and
does not report that: an instance that hears nothing is ended here.
"""

import asyncio
import json
import logging
import math
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink, MAVLink_message

from vfguide.errors import InputError, require
from vfguide.mavlink.address import Address, Status, reason_of
from vfguide.mavlink.codec import ATTITUDE_REPORTS, REPORTS
from vfguide.mavlink.framing import frames_of, message_in
from vfguide.mavlink.px4 import MAIN_MODE_AUTO, MAIN_MODE_OFFBOARD, SUB_MODE_LOITER

logger = logging.getLogger(__name__)

SEARCH_S = 5.0
"""Timeout of each search for an autopilot, s; heartbeats come once a second."""

DEAF_S = 15.0
"""Silence after which a MAVSDK instance is ended, s; by then companions have asked for a hand-back."""

WATCH_S = 0.25
"""Interval of the watchdog's checks, s."""

SILENCE_S = 1.0
"""Gap in offboard setpoints that ends offboard, s."""

MISTAKES = frozenset({"BIND_ERROR", "CONNECTION_URL_INVALID", "BAUDRATE_UNKNOWN"})
"""MAVSDK's results for an unusable address. Any other, such as a missing device, may pass."""

HEARD: dict[str, type[MAVLink_message]] = {
    mavlink.mavlink_map[number].msgname: mavlink.mavlink_map[number]
    for number in REPORTS | ATTITUDE_REPORTS
}
"""Messages that companions use, by MAVSDK's name."""


class ReceivedMessage(Protocol):
    """Message as MAVSDK describes it."""

    message_name: str
    """Name in the message set."""
    fields_json: str
    """Fields as JSON."""
    system_id: int
    component_id: int


class Finder(Protocol):
    """Searcher for an autopilot."""

    def first_autopilot_async(
        self, timeout_s: float, callback: Callable[[object | None], None]
    ) -> object:
        """Begin a search; the callback comes from another thread, with None when time is over."""

    def cancel_first_autopilot(self, handle: object) -> None:
        """End a search, or release one that has ended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plugins:
    """MAVSDK's plugins for one autopilot, which have no types."""

    direct: Any
    """Plugin for unchanged messages."""
    offboard: Any
    """Plugin for offboard setpoints and mode."""
    action: Any
    """Plugin for hold."""
    own: tuple[int, int]
    """System and component of MAVSDK as a sender, whatever the vehicle's are."""


class MavsdkChannel:
    """Channel of a connection kept by MAVSDK."""

    def __init__(self, address: Address, receive: Callable[[bytes], None], status: Status) -> None:
        """Create a channel that is not connected yet; `receive` gets whole frames from the event loop.

        Raises:
            VfguideError: MAVSDK is not installed, or another version.
        """
        require("mavsdk")
        if find_spec("mavsdk.asyncio") is None:
            raise InputError("autopilot: mavsdk needs MAVSDK 4: pip install 'vfguide[mavsdk]'")
        self._url = str(address)
        self._receive = receive
        self._status = status
        self._loop = asyncio.get_running_loop()
        self._packer = MAVLink(None)
        self._plugins: Plugins | None = None
        self._setpoint_time = math.inf
        self._heard_time = -math.inf
        self._offboard = self._opened = False

    def send(self, datagram: bytes) -> None:
        """Send what MAVSDK does not send by itself."""
        plugins = self._plugins
        if plugins is None:
            self._status.counters["dropped: not connected"] += 1
            return
        for frame in frames_of(datagram):
            message = None if frame is None else message_in(frame)
            if message is not None:
                self._say(plugins, message)

    async def visit(self) -> tuple[str, bool]:
        """Find the autopilot and listen until it is silent; return the reason, and whether it was heard.

        Raises:
            InputError: MAVSDK cannot use the address.
        """
        self._status.counters["tries"] += 1
        began = time.monotonic()
        reason = await self._one()
        return reason, self._heard_time >= began

    async def _one(self) -> str:
        """Run one MAVSDK instance; return why it ended."""
        try:
            with instance(self._url) as (mavsdk, own):
                self._opened = True
                system = await self._search(mavsdk)
                if system is None:
                    return "no autopilot heard yet"
                return await self._listen(plugins_of(system, own))
        except InputError as error:
            # An address that worked before is no mistake: something blocks it.
            if not self._opened:
                raise
            return reason_of(error)
        except (import_module("mavsdk").MavsdkError, OSError, RuntimeError, ValueError) as error:
            return reason_of(error)

    async def _listen(self, plugins: Plugins) -> str:
        """Hand on received messages until there are no more; return why it ended."""
        handle = plugins.direct.subscribe_message("", self._hear)
        self._plugins, self._heard_time = plugins, time.monotonic()
        self._status.up("by way of MAVSDK")
        try:
            while time.monotonic() - self._heard_time <= DEAF_S:
                await asyncio.sleep(WATCH_S)
                self._watch(plugins)
        finally:
            self._plugins = None
            plugins.direct.unsubscribe_message(handle)
        return "nothing is heard any more"

    async def _search(self, mavsdk: Finder) -> object | None:
        """Return the autopilot, or None if none is heard for a while."""
        found: asyncio.Future[object | None] = self._loop.create_future()

        def settle(system: object | None) -> None:
            if not found.done():
                found.set_result(system)

        def tell(system: object | None) -> None:
            """Pass the result on from a thread of MAVSDK."""
            self._loop.call_soon_threadsafe(settle, system)

        search = mavsdk.first_autopilot_async(SEARCH_S, tell)
        try:
            return await found
        finally:
            # A search that outlives its MAVSDK crashes the whole process.
            mavsdk.cancel_first_autopilot(search)

    def _watch(self, plugins: Plugins) -> None:
        """End offboard when setpoints have stopped."""
        if time.monotonic() - self._setpoint_time <= SILENCE_S:
            return
        self._setpoint_time = math.inf
        # MAVSDK takes offboard for active as soon as it has a setpoint, even while a pilot flies.
        if self._offboard and plugins.offboard.is_active():
            logger.warning("setpoints have stopped: MAVSDK is told to end offboard")
            plugins.offboard.stop_async(ignored)

    def _hear(self, heard: ReceivedMessage, _user_data: object) -> None:
        """Take a message from a thread of MAVSDK."""
        if heard.message_name in HEARD:
            self._loop.call_soon_threadsafe(self._deliver, heard)

    def _deliver(self, heard: ReceivedMessage) -> None:
        message, plugins = message_of(heard.message_name, heard.fields_json), self._plugins
        if message is None or plugins is None:
            self._status.counters["not understood"] += 1
            return
        self._heard_time = time.monotonic()
        if message.get_type() == "HEARTBEAT" and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
            self._offboard = message.custom_mode >> 16 & 0xFF == MAIN_MODE_OFFBOARD
        if target_of(message) == plugins.own:
            # Answers to MAVSDK are for the companion, whose commands it has sent.
            message.target_system = message.target_component = 0
        self._packer.srcSystem, self._packer.srcComponent = heard.system_id, heard.component_id
        try:
            frame = message.pack(self._packer)
        except struct.error:
            self._status.counters["not understood"] += 1
            return
        self._receive(frame)

    def _say(self, plugins: Plugins, message: MAVLink_message) -> None:
        """Send a message of the companion, by MAVSDK's own call if there is one."""
        mode, name = wanted_mode(message), message.get_type()
        if name == "HEARTBEAT" and message.type != mavlink.MAV_TYPE_GCS:
            return
        try:
            if name == "SET_POSITION_TARGET_LOCAL_NED":
                self._setpoint_time = time.monotonic()
                plugins.offboard.set_velocity_ned(velocity_of(message))
            elif name == "SET_POSITION_TARGET_GLOBAL_INT":
                self._setpoint_time = time.monotonic()
                plugins.offboard.set_position_global(position_of(message))
            elif mode == (MAIN_MODE_OFFBOARD, 0):
                plugins.offboard.start_async(ignored)
            elif mode == (MAIN_MODE_AUTO, SUB_MODE_LOITER):
                self._setpoint_time = math.inf
                plugins.action.hold_async(ignored)
            else:
                plugins.direct.send_message(direct_message(message))
        except import_module("mavsdk").MavsdkError as error:
            self._status.counters[f"MAVSDK: {type(error).__name__}"] += 1


@contextmanager
def instance(url: str) -> Iterator[tuple[Any, tuple[int, int]]]:
    """Yield MAVSDK, connected to an address, and its (system, component).

    Raises:
        InputError: it cannot use the address.
        MavsdkError: it cannot connect at the moment.
    """
    api = import_module("mavsdk")
    configuration = api.Configuration.create_with_component_type(
        api.ComponentType.COMPANION_COMPUTER
    )
    mavsdk = api.Mavsdk(configuration)
    try:
        result = mavsdk.add_any_connection(url)
        if result.name in MISTAKES:
            raise InputError(f"MAVLink address {url}: MAVSDK says {result.name}")
        if result != api.ConnectionResult.SUCCESS:
            raise api.MavsdkError(f"MAVSDK says {result.name}")
        yield mavsdk, (configuration.system_id, configuration.component_id)
    finally:
        mavsdk.destroy()


def plugins_of(system: object, own: tuple[int, int]) -> Plugins:
    """Return the plugins used here, with MAVSDK's own system and component."""
    return Plugins(
        direct=import_module("mavsdk.plugins.mavlink_direct").MavlinkDirect(system),
        offboard=import_module("mavsdk.plugins.offboard").Offboard(system),
        action=import_module("mavsdk.plugins.action").Action(system),
        own=own,
    )


def ignored(*_result: object) -> None:
    """Ignore a command's result, which its COMMAND_ACK tells."""


def message_of(name: str, fields_json: str) -> MAVLink_message | None:
    """Return the message that MAVSDK describes, or None if its fields do not fit."""
    kind = HEARD[name]
    try:
        fields = json.loads(fields_json)
        values = {field: fields[field] for field in kind.fieldnames if field in fields}
        for field, value in values.items():
            if isinstance(value, str):
                values[field] = value.encode("ascii", "replace")
            elif value is None:
                values[field] = math.nan
        return kind(**values)
    except (ValueError, TypeError, KeyError):
        return None


def target_of(message: MAVLink_message) -> tuple[int, int] | None:
    """Return the target system and component of a message, or None if it has none."""
    if "target_system" not in message.fieldnames:
        return None
    return message.target_system, message.target_component


def direct_message(message: MAVLink_message) -> object:
    """Describe a message for MAVSDK."""
    fields = {name: getattr(message, name) for name in message.get_fieldnames()}
    plugin = import_module("mavsdk.plugins.mavlink_direct")
    return plugin.MavlinkMessage(message.get_type(), 0, 0, 0, 0, json.dumps(fields, default=str))


def velocity_of(message: MAVLink_message) -> object:
    """Convert a velocity setpoint for MAVSDK; the yaw, which a fixed wing ignores, is the course."""
    course = math.degrees(math.atan2(message.vy, message.vx))
    kind = import_module("mavsdk.plugins.offboard").VelocityNedYaw
    return kind(message.vx, message.vy, message.vz, course)


def position_of(message: MAVLink_message) -> object:
    """Convert a position setpoint for MAVSDK; the yaw, which a fixed wing ignores, is north."""
    kind = import_module("mavsdk.plugins.offboard").PositionGlobalYaw
    above_sea = kind.AltitudeType.AMSL
    return kind(message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt, 0.0, above_sea)


def wanted_mode(message: MAVLink_message) -> tuple[int, int] | None:
    """Return PX4's main and sub mode that a message asks for, or None."""
    if getattr(message, "command", None) != mavlink.MAV_CMD_DO_SET_MODE:
        return None
    return int(message.param2), int(message.param3)
