"""The autopilot as a whole: bytes in, bytes out, simulation time handed in."""

import math
from collections import Counter
from collections.abc import Callable

from numpy.random import default_rng
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.angles import wrap_to_two_pi
from sitl_stub.arduplane import ArduPlane
from sitl_stub.codec import Codec, whole_number
from sitl_stub.commands import (
    COMPONENT_ARM_DISARM,
    CUSTOM_MODE_FLAG,
    PREFLIGHT_REBOOT_SHUTDOWN,
    REQUEST_MESSAGE,
    SET_MESSAGE_INTERVAL,
    Command,
    NonFiniteError,
    Result,
    arm_or_disarm,
    command_of,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.earth import moved
from sitl_stub.flight import Flight, Home
from sitl_stub.parameter_protocol import parameter_values
from sitl_stub.personality import Personality
from sitl_stub.plant import PlantState
from sitl_stub.px4 import Px4
from sitl_stub.schedule import Schedule
from sitl_stub.telemetry import (
    DEFAULT_INTERVALS_US,
    HEARTBEAT,
    POSITION_MESSAGES,
    TELEMETRY,
    WIND,
    Report,
)
from sitl_stub.triangle import ground_speed_along_m_s
from sitl_stub.truth import Truth
from sitl_stub.wind import Wind

MIN_INTERVAL_US = 10_000
"""Fastest stream: 100 Hz, what a real one still sends cleanly at its best loop rate."""

IGNORED = frozenset(
    {
        "HEARTBEAT",
        "COMMAND_ACK",
        "TIMESYNC",
        "SYSTEM_TIME",
        "PING",
        "STATUSTEXT",
        "REQUEST_DATA_STREAM",
        "MISSION_REQUEST_LIST",
        "RC_CHANNELS_OVERRIDE",
        "MANUAL_CONTROL",
    }
)
"""Ordinary traffic that changes nothing here. MISSION_REQUEST_LIST: there is no mission."""

PERSONALITIES: dict[str, Callable[[], Personality]] = {"ardupilot": ArduPlane, "px4": Px4}
"""The autopilots by the name in the configuration."""


class Autopilot:
    """One emulated autopilot with its aircraft.

    Time is simulation time in seconds from zero, kept in whole microseconds. The same configuration
    and the same bytes at the same times give the same bytes.
    """

    def __init__(self, config: AutopilotConfig, wind: Wind) -> None:
        self.counters: Counter[str] = Counter()
        """What was received and not obeyed, by reason."""
        self.system_id = config.system_id
        """MAVLink system id."""
        self._personality = PERSONALITIES[config.autopilot]()
        self._flight = Flight(
            plant=config.plant,
            wind=wind,
            state=state_at_start(config, wind.at(0.0)),
            home=Home(
                math.radians(config.latitude_deg),
                math.radians(config.longitude_deg),
                config.home_altitude_amsl_m,
            ),
            cruise_airspeed_m_s=config.airspeed_m_s,
            mode=self._personality.initial_mode,
            armed=config.armed,
        )
        self._reported_mode = self._flight.mode
        self._codec = Codec(config.system_id, self.counters)
        self._boot_us = -round(config.boot_time_s * 1e6)
        self._noise_m = config.position_noise_m
        self._random = default_rng((config.seed, config.system_id))
        self._schedule = default_schedule()
        self._commands = {
            COMPONENT_ARM_DISARM: arm_or_disarm,
            SET_MESSAGE_INTERVAL: self._set_message_interval,
            REQUEST_MESSAGE: self._request_message,
            PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            **self._personality.commands,
        }
        self._handlers: dict[str, Callable[[MAVLink_message], list[MAVLink_message]]] = {
            "COMMAND_INT": self._on_command,
            "COMMAND_LONG": self._on_command,
            "SET_MODE": self._on_set_mode,
            "PARAM_REQUEST_LIST": self._on_parameter,
            "PARAM_REQUEST_READ": self._on_parameter,
            "PARAM_SET": self._on_parameter,
            **dict.fromkeys(self._personality.setpoints, self._on_setpoint),
        }
        self._requested: list[int] = []

    @property
    def next_due_s(self) -> float:
        """The next simulation time at which anything happens by itself; infinite if nothing does.

        Up to then `advance` brings nothing, unless something is received before.
        """
        instants_us = (self._schedule.next_due_us, self._personality.deadline_us)
        return min(
            (due_us * 1e-6 for due_us in instants_us if due_us is not None), default=math.inf
        )

    def receive(self, data: bytes) -> bytes:
        """Take the frames of one datagram at the present simulation time; returns the replies.

        Whatever the bytes are, this does not raise; what is not understood is only counted.
        """
        replies: list[MAVLink_message] = []
        for message in self._codec.decode(data):
            name = message.get_type()
            handler = self._handlers.get(name)
            if handler is None:
                self.counters["ignored" if name in IGNORED else "unhandled"] += 1
            else:
                replies += handler(message)
        replies += self._notices()
        return self._codec.encode(replies)

    def advance(self, to_s: float) -> bytes:
        """Fly to simulation time `to_s`; returns the telemetry due after the last call, up to it.

        The first call also brings what is due at time zero. Each message is made at its own due
        time, however far this call goes.

        Raises:
            ValueError: `to_s` lies before the present simulation time, or is not finite.
        """
        if not math.isfinite(to_s):
            raise ValueError(f"cannot advance to {to_s!r}")
        to_us = round(to_s * 1e6)
        if to_us < self._flight.time_us:
            raise ValueError(f"cannot go back to {to_s!r} s")
        messages: list[MAVLink_message] = []
        while True:
            instants_us = (self._schedule.next_due_us, self._personality.deadline_us)
            instant_us = min(to_us, *(due_us for due_us in instants_us if due_us is not None))
            self._flight.advance(instant_us)
            self._personality.watch(self._flight)
            messages += self._notices()
            messages += self._built(self._schedule.pop_due(instant_us))
            if instant_us >= to_us:
                return self._codec.encode(messages)

    def reboot(self) -> None:
        """Start the autopilot anew, at once and in the air: the aircraft flies on meanwhile."""
        self._flight.enter(self._personality.initial_mode)
        self._boot_us = self._flight.time_us
        self._schedule = default_schedule(sent_until_us=self._flight.time_us)

    def truth(self) -> Truth:
        """The true, noise-free state now."""
        flight = self._flight
        motion, (wind_north_m_s, wind_east_m_s) = flight.motion(), flight.wind_m_s
        return Truth(
            time_s=flight.time_us * 1e-6,
            latitude_deg=math.degrees(flight.state.latitude_rad),
            longitude_deg=math.degrees(flight.state.longitude_rad),
            altitude_amsl_m=flight.state.altitude_amsl_m,
            north_m_s=motion.north_m_s,
            east_m_s=motion.east_m_s,
            down_m_s=motion.down_m_s,
            course_rad=motion.course_rad,
            ground_speed_m_s=motion.ground_speed_m_s,
            heading_rad=motion.heading_rad,
            airspeed_m_s=motion.airspeed_m_s,
            bank_rad=motion.bank_rad,
            wind_north_m_s=wind_north_m_s,
            wind_east_m_s=wind_east_m_s,
            mode=flight.mode.name,
            armed=flight.armed,
        )

    def _on_command(self, message: MAVLink_message) -> list[MAVLink_message]:
        command = command_of(message)
        handler = self._commands.get(command.number)
        if handler is None:
            result = Result.UNSUPPORTED
        else:
            try:
                result = handler(self._flight, command)
            except NonFiniteError:
                # A real one would take it and crash.
                self.counters["non-finite field"] += 1
                result = Result.DENIED
        acknowledgement = mavlink.MAVLink_command_ack_message(
            command.number,
            result,
            target_system=message.get_srcSystem(),
            target_component=message.get_srcComponent(),
        )
        requested, self._requested = self._requested, []
        return [acknowledgement, *self._built(requested)]

    def _on_set_mode(self, message: MAVLink_message) -> list[MAVLink_message]:
        if message.base_mode & CUSTOM_MODE_FLAG:
            self._personality.request_mode(self._flight, message.custom_mode)
        return []

    def _on_parameter(self, message: MAVLink_message) -> list[MAVLink_message]:
        return parameter_values(message, self._personality.parameters(self._flight))

    def _on_setpoint(self, message: MAVLink_message) -> list[MAVLink_message]:
        fault = self._personality.setpoints[message.get_type()](self._flight, message)
        if fault is not None:
            self.counters[fault] += 1
        return []

    def _set_message_interval(self, _flight: Flight, command: Command) -> Result:
        """511: param1 message id, param2 microseconds, -1 to stop, 0 for the default."""
        message_id, interval_us = map(whole_number, command.used(1, 2))
        if message_id == HEARTBEAT or message_id is None or not self._sends(message_id):
            return Result.DENIED
        interval_us = interval_us if interval_us is not None else round(command.parameters[1])
        if interval_us == 0:
            interval_us = DEFAULT_INTERVALS_US.get(message_id, -1)
        if interval_us == -1:
            self._schedule.stop(message_id)
            return Result.ACCEPTED
        if interval_us < MIN_INTERVAL_US:
            return Result.DENIED
        self._schedule.every(message_id, interval_us)
        return Result.ACCEPTED

    def _request_message(self, _flight: Flight, command: Command) -> Result:
        """512: param1 message id; the message follows the acknowledgement."""
        message_id = whole_number(*command.used(1))
        if message_id is None or not self._sends(message_id):
            return Result.DENIED
        self._requested.append(message_id)
        return Result.ACCEPTED

    def _reboot(self, _flight: Flight, command: Command) -> Result:
        """246: param1 = 1 starts the autopilot anew, in the air too; a real one wants to be forced there.

        The aircraft flies on; mode, setpoints, streams and the boot time are forgotten.
        """
        (wanted,) = command.used(1)
        if wanted != 1.0:
            return Result.DENIED
        self.reboot()
        return Result.ACCEPTED

    def _sends(self, message_id: int) -> bool:
        return message_id in TELEMETRY and (message_id != WIND or self._personality.estimates_wind)

    def _notices(self) -> list[MAVLink_message]:
        """Status texts, and a heartbeat at once when the mode has changed."""
        flight = self._flight
        texts, flight.texts = flight.texts, []
        notices = [status_text(text) for text in texts]
        if flight.mode is not self._reported_mode:
            self._reported_mode = flight.mode
            notices.append(status_text(f"Mode {flight.mode.name}"))
            notices += self._built([HEARTBEAT])
        return notices

    def _built(self, message_ids: list[int]) -> list[MAVLink_message]:
        if not message_ids:
            return []
        flight = self._flight
        latitude_rad, longitude_rad = flight.state.latitude_rad, flight.state.longitude_rad
        if self._noise_m > 0.0 and not POSITION_MESSAGES.isdisjoint(message_ids):
            latitude_rad, longitude_rad = moved(
                latitude_rad,
                longitude_rad,
                flight.state.altitude_amsl_m,
                north_m=self._noise_m * self._random.standard_normal(),
                east_m=self._noise_m * self._random.standard_normal(),
            )
        report = Report(
            round((flight.time_us - self._boot_us) * 1e-3) % 2**32,
            flight,
            flight.motion(),
            latitude_rad,
            longitude_rad,
            self._personality,
        )
        return [TELEMETRY[message_id](report) for message_id in message_ids]


def default_schedule(sent_until_us: int = -1) -> Schedule:
    """What comes unrequested after a boot, from the instant after this one."""
    schedule = Schedule(TELEMETRY, sent_until_us=sent_until_us)
    for message_id, interval_us in DEFAULT_INTERVALS_US.items():
        schedule.every(message_id, interval_us)
    return schedule


def status_text(text: str) -> MAVLink_message:
    """A STATUSTEXT of severity INFO."""
    return mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_INFO, text.encode("ascii"))


def state_at_start(config: AutopilotConfig, wind_m_s: tuple[float, float]) -> PlantState:
    """The plant's state that has the configured course over ground and airspeed in this wind."""
    course_rad = wrap_to_two_pi(config.course_rad)
    if config.plant.kind == "course-hold":
        direction_rad = course_rad
    else:
        ground_speed_m_s = ground_speed_along_m_s(course_rad, config.airspeed_m_s, *wind_m_s)
        direction_rad = wrap_to_two_pi(
            math.atan2(
                ground_speed_m_s * math.sin(course_rad) - wind_m_s[1],
                ground_speed_m_s * math.cos(course_rad) - wind_m_s[0],
            )
        )
    return PlantState(
        direction_rad,
        config.airspeed_m_s,
        "airspeed",
        math.radians(config.latitude_deg),
        math.radians(config.longitude_deg),
        config.altitude_amsl_m,
    )
