"""Schedule of periodic messages, and messages that are requested once.

A message is due at exact multiples of its interval, so that nothing drifts. PROTOCOL_VERSION and
AVAILABLE_MODES are in MAVLink's common set, but not in pymavlink's dialect for ArduPilot.
"""

import struct
from collections.abc import Iterable, Mapping, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink, MAVLink_message

from sitl_stub.codec import whole_number
from sitl_stub.commands import Command, Handler, Handlers, Result
from sitl_stub.flight import AutopilotMode, EmulatedFlight
from sitl_stub.messages import TELEMETRY
from sitl_stub.personality import Personality

PROTOCOL_VERSION = 300

AVAILABLE_MODES = 435

MAVLINK_2 = 200
"""MAVLink 2.0 in PROTOCOL_VERSION; 100 is the oldest version that is understood."""

MIN_INTERVAL_US = 10_000
"""Shortest interval without a scheduler: 100 Hz."""

LONGEST_INTERVAL_US = 2**31 - 1
"""Longest interval that MESSAGE_INTERVAL can report: 36 minutes."""

LOOP_SHARE = 0.8
"""Ratio of the fastest stream's rate to the scheduler's loop rate: ArduPilot denies more."""

DATA_STREAMS: Mapping[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_WIND,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""Messages of the ArduPilot streams that older ground stations request."""

ON_REQUEST: Mapping[int, int] = {
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: PROTOCOL_VERSION,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAV_CMD_GET_HOME_POSITION: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
}


class Schedule:
    """Periodic messages by id, in whole microseconds of simulation time.

    Messages due at the same instant come in the order of the ids given at the start. With a tick longer
    than a microsecond they leave at the first tick at which they are due, as a scheduler's tasks do: 50 ms
    on ticks of 20 ms come 40 and 60 ms apart.
    """

    def __init__(self, order: Iterable[int], *, sent_until_us: int = -1, tick_us: int = 1) -> None:
        self._rank = {message_id: rank for rank, message_id in enumerate(order)}
        self._intervals_us: dict[int, int] = {}
        self._due_us: dict[int, int] = {}
        self._sent_until_us = sent_until_us
        self._tick_us = tick_us
        self.next_due_us: int | None = None
        """Next instant at which a message is due; None while nothing is scheduled."""

    def every(self, message_id: int, interval_us: int) -> None:
        """Schedule a message at each multiple of the interval from now on."""
        self._intervals_us[message_id] = interval_us
        self._due_us[message_id] = (self._sent_until_us // interval_us + 1) * interval_us
        self._due_us = dict(sorted(self._due_us.items(), key=lambda item: self._rank[item[0]]))
        self._look_ahead()

    def stop(self, message_id: int) -> None:
        """Stop sending a message."""
        self._due_us.pop(message_id, None)
        self._look_ahead()

    def interval_us(self, message_id: int) -> int | None:
        """Return the interval of a message; None if it is not sent."""
        return self._intervals_us[message_id] if message_id in self._due_us else None

    def pop_due(self, instant_us: int) -> list[int]:
        """Return the ids due up to and including an instant, and schedule their next times."""
        self._sent_until_us = instant_us
        if self.next_due_us is None or instant_us < self.next_due_us:
            return []
        tick_us = instant_us // self._tick_us * self._tick_us
        due = [message_id for message_id, due_us in self._due_us.items() if due_us <= tick_us]
        for message_id in due:
            interval_us = self._intervals_us[message_id]
            self._due_us[message_id] = (instant_us // interval_us + 1) * interval_us
        self._look_ahead()
        return due

    def _look_ahead(self) -> None:
        first_us = min(self._due_us.values(), default=None)
        if first_us is not None:
            first_us = -(-first_us // self._tick_us) * self._tick_us
        self.next_due_us = first_us


class ExtraMessage(MAVLink_message):  # type: ignore[misc] # pymavlink is not typed
    """A message given by its id, the extra byte of its checksum, and its payload."""

    def __init__(self, message_id: int, name: str, crc_extra: int, payload: bytes) -> None:
        super().__init__(message_id, name)
        self._extra = crc_extra
        self._content = payload

    def pack(self, mav: MAVLink) -> bytes:
        """Return the frame."""
        packed: bytes = self._pack(mav, self._extra, self._content)
        return packed


def protocol_version() -> MAVLink_message:
    """Return PROTOCOL_VERSION: MAVLink 1 and 2; no hashes of specification and library."""
    payload = struct.pack("<HHH16x", MAVLINK_2, 100, MAVLINK_2)
    return ExtraMessage(PROTOCOL_VERSION, "PROTOCOL_VERSION", 217, payload)


def available_modes(modes: Sequence[AutopilotMode], index: int) -> list[MAVLink_message]:
    """Return AVAILABLE_MODES of the mode with an index (from 1), or of all modes for 0."""
    numbers = range(1, len(modes) + 1) if index == 0 else range(index, index + 1)
    messages: list[MAVLink_message] = []
    for number in numbers:
        if 1 <= number <= len(modes):
            mode = modes[number - 1]
            name = mode.name.encode("ascii")
            payload = struct.pack("<IIBBB35s", mode.custom_mode, 0, len(modes), number, 0, name)
            messages.append(ExtraMessage(AVAILABLE_MODES, "AVAILABLE_MODES", 134, payload))
    return messages


Wanted = int | list[MAVLink_message]
"""Id of a telemetry message, or complete messages."""


class Streams:
    """Message schedule of one autopilot, and the commands that change it."""

    def __init__(
        self,
        personality: Personality,
        loop_rate_hz: float | None,
        chosen: Mapping[int, int] | None = None,
    ) -> None:
        """Make the schedule at a boot.

        Args:
            personality: autopilot whose messages are sent.
            loop_rate_hz: of the scheduler, if any.
            chosen: intervals (us) of unrequested messages beside the heartbeat; None for the personality's.
        """
        self._personality = personality
        self._fastest_us = MIN_INTERVAL_US
        self._tick_us = 1
        if loop_rate_hz is not None:
            self._tick_us = round(1e6 / loop_rate_hz)
            self._fastest_us = round(1e6 / (LOOP_SHARE * loop_rate_hz))
        sent = personality.unrequested
        if chosen is not None:
            heartbeat = mavlink.MAVLINK_MSG_ID_HEARTBEAT
            sent = {heartbeat: sent[heartbeat], **chosen}
        self._unrequested = sent
        self.schedule = self._defaults(-1)
        self._requested: list[Wanted] = []

    @property
    def commands(self) -> Handlers:
        """Handlers of the commands about messages."""
        return {
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self.set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self.get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self.request,
            **{number: self.request_of(wanted) for number, wanted in ON_REQUEST.items()},
        }

    def take_requested(self) -> list[Wanted]:
        """Return, once, what follows the acknowledgement of the present command."""
        requested, self._requested = self._requested, []
        return requested

    def restart(self, now_us: int) -> None:
        """Forget all requests, as a reboot does."""
        self.schedule = self._defaults(now_us)

    def set_interval(self, _flight: EmulatedFlight, command: Command) -> Result:
        """Handle 511: param1 message id, param2 microseconds, -1 to stop, 0 for the default."""
        message_id, interval_us = map(whole_number, command.used(1, 2))
        if (
            message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
            or message_id is None
            or not self._sends(message_id)
        ):
            return Result.DENIED
        interval_us = interval_us if interval_us is not None else round(command.parameters[1])
        if interval_us == 0:
            interval_us = self._unrequested.get(message_id, -1)
        if interval_us == -1:
            self.schedule.stop(message_id)
            return Result.ACCEPTED
        if interval_us < self._fastest_us:
            return Result.DENIED
        self.schedule.every(message_id, min(interval_us, LONGEST_INTERVAL_US))
        return Result.ACCEPTED

    def get_interval(self, _flight: EmulatedFlight, command: Command) -> Result:
        """Handle 510: param1 message id; MESSAGE_INTERVAL follows, -1 us for a message that is not sent."""
        message_id = whole_number(*command.used(1))
        if message_id is None or not 0 <= message_id <= 65_535:
            return Result.DENIED
        never, unknown = -1, 0
        known = self._sends(message_id)
        interval_us = self.schedule.interval_us(message_id) or never if known else unknown
        self._requested.append([mavlink.MAVLink_message_interval_message(message_id, interval_us)])
        return Result.ACCEPTED

    def request(self, _flight: EmulatedFlight, command: Command) -> Result:
        """Handle 512: param1 message id; the message follows the acknowledgement."""
        message_id = whole_number(*command.used(1))
        if message_id == PROTOCOL_VERSION:
            self._requested.append([protocol_version()])
        elif message_id == AVAILABLE_MODES:
            index = whole_number(command.parameters[1])
            modes = self._personality.modes
            if index is None or not 0 <= index <= len(modes):
                return Result.DENIED
            self._requested.append(available_modes(modes, index))
        elif message_id is not None and self._sends(message_id):
            self._requested.append(message_id)
        else:
            return Result.DENIED
        return Result.ACCEPTED

    def request_of(self, message_id: int) -> Handler:
        """Return the handler of a command that requests one specific message."""

        def handle(flight: EmulatedFlight, command: Command) -> Result:
            return self.request(flight, Command(command.number, (message_id, 0, 0, 0), 0, 0))

        return handle

    def request_data_stream(self, message: MAVLink_message) -> None:
        """Handle REQUEST_DATA_STREAM, ArduPilot's older way: one stream, or all, at a rate in Hz."""
        rate_hz = message.req_message_rate if message.start_stop else 0
        interval_us = max(self._fastest_us, round(1e6 / rate_hz)) if rate_hz else 0
        wanted = message.req_stream_id
        everything = wanted == mavlink.MAV_DATA_STREAM_ALL
        for stream, message_ids in DATA_STREAMS.items():
            for message_id in message_ids if everything or stream == wanted else ():
                if not interval_us:
                    self.schedule.stop(message_id)
                elif self._sends(message_id):
                    self.schedule.every(message_id, interval_us)

    def _sends(self, message_id: int) -> bool:
        return message_id in TELEMETRY and message_id not in self._personality.unsent

    def _defaults(self, sent_until_us: int) -> Schedule:
        """Return the schedule after a boot, from the instant after `sent_until_us`."""
        schedule = Schedule(TELEMETRY, sent_until_us=sent_until_us, tick_us=self._tick_us)
        for message_id, interval_us in self._unrequested.items():
            schedule.every(message_id, interval_us)
        return schedule
