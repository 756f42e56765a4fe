"""The whole autopilot: bytes in, bytes out, simulation time as an argument."""

import math
from collections import Counter
from collections.abc import Callable, Iterable

from msgspec.structs import astuple
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.air import Air, AirData, AirPlace, Wind
from sitl_stub.codec import EmulatorCodec, Signing
from sitl_stub.commands import (
    CUSTOM_MODE_FLAG,
    MISSION_MESSAGES,
    Command,
    NonFiniteError,
    Result,
    command_of,
    mission_reply,
    ping_reply,
    status_text,
    timesync_reply,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import EmulatedFlight
from sitl_stub.geometry import Home, ground_speed_along_m_s, wrap_to_two_pi
from sitl_stub.loops import TurnTarget
from sitl_stub.messages import POSITION_MESSAGES, TELEMETRY, ReportedInstant
from sitl_stub.parameters import ParameterServer
from sitl_stub.personality import Personality, personality_of
from sitl_stub.plant import Motion, PlantState
from sitl_stub.sensor_errors import Fault, SensorErrors
from sitl_stub.sensors import Sensors
from sitl_stub.streams import Streams


class Truth(Motion, frozen=True, kw_only=True):
    """True, noise-free state of one aircraft: its motion, position and wind."""

    time_s: float
    latitude_deg: float
    """Geodetic."""

    longitude_deg: float
    altitude_amsl_m: float
    wind_north_m_s: float
    """Velocity of the air toward north."""

    wind_east_m_s: float
    """Velocity of the air toward east."""

    mode: str
    """Name of the flight mode, such as GUIDED or AUTO.LOITER."""

    armed: bool
    """Whether the autopilot reports that it is armed."""


def truth_of(flight: EmulatedFlight) -> Truth:
    """Return the true state of a flight now."""
    wind_north_m_s, wind_east_m_s = flight.wind_m_s
    return Truth(
        *astuple(flight.motion()),
        time_s=flight.time_us * 1e-6,
        latitude_deg=math.degrees(flight.state.latitude_rad),
        longitude_deg=math.degrees(flight.state.longitude_rad),
        altitude_amsl_m=flight.state.altitude_amsl_m,
        wind_north_m_s=wind_north_m_s,
        wind_east_m_s=wind_east_m_s,
        mode=flight.mode.name,
        armed=flight.armed,
    )


IGNORED = frozenset(
    {
        "COMMAND_ACK",
        "SYSTEM_TIME",
        "STATUSTEXT",
        "NAMED_VALUE_FLOAT",
        "MISSION_ACK",
        "RADIO_STATUS",
        "RC_CHANNELS_OVERRIDE",
        "MANUAL_CONTROL",
    }
)
"""Ordinary traffic that has no effect here."""


def flight_at_start(
    config: AutopilotConfig, air: Wind | Air, personality: Personality
) -> EmulatedFlight:
    """Return the flight as configured, with the distances of the autopilot's parameters."""
    air = air if isinstance(air, Air) else Air(air)
    errors = SensorErrors(config.sensors, seed=config.seed, system_id=config.system_id)
    # Calibration errors affect the flight itself: the autopilot controls the airspeed that it measures.
    calibration = config.airspeed_calibration * errors.calibration
    air_data = AirData(config.indicated_airspeed, calibration)
    airspeed_m_s = config.airspeed_m_s / air_data.shown_per_true(config.altitude_amsl_m)
    if config.airborne:
        state = state_in_the_air(config, airspeed_m_s, air_at_start(config, air).at(0.0))
    else:
        state = state_on_the_ground(config)
    flight = EmulatedFlight(
        plant=config.plant,
        air=air,
        state=state,
        home=Home(
            math.radians(config.latitude_deg),
            math.radians(config.longitude_deg),
            config.home_altitude_amsl_m,
        ),
        cruise_airspeed_m_s=config.airspeed_m_s,
        mode=personality.initial_mode if config.airborne else personality.ground_mode,
        armed=config.armed,
        on_ground=not config.airborne,
        air_data=air_data,
        altitude_drift_m=errors.altitude_drift_m,
    )
    personality.begin(flight)
    if config.route is not None:
        flight.enter(personality.mission_mode or personality.initial_mode)
        flight.follow(config.route)
    return flight


def air_at_start(config: AutopilotConfig, air: Air) -> Wind:
    """Return the wind at the start."""
    return air.near(
        AirPlace(
            math.radians(config.latitude_deg),
            math.radians(config.longitude_deg),
            config.altitude_amsl_m,
            config.altitude_amsl_m - config.home_altitude_amsl_m,
        )
    )


def state_in_the_air(
    config: AutopilotConfig, airspeed_m_s: float, wind_m_s: tuple[float, float]
) -> PlantState:
    """Return the plant's state with the configured course over ground and airspeed in this wind."""
    course_rad = wrap_to_two_pi(config.course_rad)
    if config.plant.kind == "course-hold":
        direction_rad = course_rad
    else:
        ground_speed_m_s = ground_speed_along_m_s(course_rad, airspeed_m_s, *wind_m_s)
        direction_rad = wrap_to_two_pi(
            math.atan2(
                ground_speed_m_s * math.sin(course_rad) - wind_m_s[1],
                ground_speed_m_s * math.cos(course_rad) - wind_m_s[0],
            )
        )
    return PlantState(
        direction_rad,
        airspeed_m_s,
        "airspeed",
        math.radians(config.latitude_deg),
        math.radians(config.longitude_deg),
        config.altitude_amsl_m,
        climb_m_s=config.climb_m_s,
    )


def state_on_the_ground(config: AutopilotConfig) -> PlantState:
    """Return the state of standing at home with the nose along the configured course."""
    return PlantState(
        wrap_to_two_pi(config.course_rad),
        0.0,
        "airspeed",
        math.radians(config.latitude_deg),
        math.radians(config.longitude_deg),
        config.home_altitude_amsl_m,
    )


Replies = list[MAVLink_message]


class Autopilot:
    """One emulated autopilot with its aircraft.

    Time is simulation time in seconds from zero, kept in whole microseconds. The same configuration
    and the same bytes at the same times give the same bytes.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        air: Wind | Air,
        *,
        signing: Signing | None = None,
        unix_time: Callable[[], float] | None = None,
    ) -> None:
        """Put the aircraft at its start.

        Args:
            config: initial configuration.
            air: wind, or air with turbulence, gusts and shear.
            signing: signs outgoing messages; unsigned incoming messages are then dropped.
            unix_time: clock of the signatures, s; None for simulation time.
        """
        self.counters: Counter[str] = Counter()
        """Numbers of received messages that were not obeyed, by reason."""
        self.config = config
        self.system_id = config.system_id
        self._personality = personality_of(config)
        self._personality.arming.ready_from_us = round(config.ready_after_s * 1e6)
        self._flight = flight_at_start(config, air, self._personality)
        self._reported_mode = self._flight.mode
        self._codec = EmulatorCodec(
            config.system_id, self.counters, signing, component_id=config.component_id
        )
        self._unix_time = unix_time or (lambda: self._flight.time_us * 1e-6)
        self._boot_us = -round(config.boot_time_s * 1e6)
        self._sensors = Sensors(config)
        chosen = None if config.streams is None else dict(config.streams)
        self._streams = Streams(self._personality, config.loop_rate_hz, chosen)
        self._parameter_server = ParameterServer(
            self._personality.parameters,
            refuses_unknown=self._personality.refuses_unknown_parameters,
        )
        self._commands = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._personality.arming.handle,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._personality.arming.report,
            mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            **self._streams.commands,
            **self._personality.commands,
        }
        self._handlers: dict[str, Callable[[MAVLink_message], Replies]] = {
            "COMMAND_INT": self._on_command,
            "COMMAND_LONG": self._on_command,
            "SET_MODE": self._on_set_mode,
            "HEARTBEAT": self._on_heartbeat,
            "TIMESYNC": self._on_timesync,
            "PING": ping_reply,
            "PARAM_REQUEST_LIST": self._on_parameter_list,
            "PARAM_REQUEST_READ": self._parameter_server.read,
            "PARAM_SET": self._on_parameter_set,
            "REQUEST_DATA_STREAM": self._on_data_stream,
            "SETUP_SIGNING": self._on_setup_signing,
            **dict.fromkeys(MISSION_MESSAGES, mission_reply),
            **dict.fromkeys(self._personality.setpoints, self._on_setpoint),
        }

    @property
    def next_due_s(self) -> float:
        """Next simulation time at which anything happens without input; infinite if nothing does.

        Until then `advance` returns nothing, unless something is received before.
        """
        return min((due_us * 1e-6 for due_us in self._instants_us()), default=math.inf)

    def receive(self, data: bytes) -> bytes:
        """Take the frames of one datagram at the present simulation time; return the replies.

        No input raises an error; messages that are not understood are only counted.
        """
        replies: Replies = []
        for message in self._codec.decode(data, self._unix_time()):
            name = message.get_type()
            handler = self._handlers.get(name)
            if handler is None:
                self.counters["ignored" if name in IGNORED else "unhandled"] += 1
            else:
                replies += handler(message)
        replies += self._notices()
        return self._codec.encode(replies, self._unix_time())

    def advance(self, to_s: float) -> bytes:
        """Fly to simulation time `to_s`; return the telemetry that fell due since the last call.

        The first call includes the telemetry due at time zero. Each message is made at its own due time,
        however far this call goes.

        Raises:
            ValueError: `to_s` lies before the present simulation time, or is not finite.
        """
        if not math.isfinite(to_s):
            raise ValueError(f"cannot advance to {to_s!r}")
        to_us = round(to_s * 1e6)
        if to_us < self._flight.time_us:
            raise ValueError(f"cannot go back to {to_s!r} s")
        messages: Replies = []
        while True:
            instant_us = min(to_us, *self._instants_us())
            self._flight.advance(instant_us)
            self._personality.watch(self._flight)
            messages += self._notices()
            messages += self._built(self._streams.schedule.pop_due(instant_us))
            messages += self._parameter_server.next_part(instant_us)
            if instant_us >= to_us:
                return self._codec.encode(messages, self._unix_time())

    def reboot(self) -> None:
        """Restart the autopilot at once; an aircraft in the air flies on."""
        flight, modes = self._flight, self._personality
        if flight.on_ground:
            flight.set_armed(armed=False)
        mode = modes.ground_mode if flight.on_ground else modes.initial_mode
        modes.request_mode(flight, mode.custom_mode)
        self._boot_us = flight.time_us
        self._streams.restart(flight.time_us)

    def hold_bank(self, bank_rad: float) -> None:
        """Hold a bank angle (rad) until the next command, as by a pilot's stick or jammed surfaces."""
        self._flight.hold_turn(TurnTarget("bank", bank_rad))

    def inject(self, fault: Fault) -> None:
        """Add a fault to the reports."""
        self._sensors.faults.add(fault)

    @property
    def custom_mode(self) -> int:
        """Number of the present mode, as in the heartbeats."""
        return self._flight.mode.custom_mode

    def truth(self) -> Truth:
        """Return the true, noise-free state now."""
        return truth_of(self._flight)

    def _since_boot_us(self) -> int:
        """Return the time on the autopilot's own clock."""
        time_us = self._flight.time_us
        lost_us = round(self._sensors.faults.lost_s(time_us * 1e-6) * 1e6)
        return round((time_us - self._boot_us) * self._sensors.clock_rate) - lost_us

    def _instants_us(self) -> Iterable[int]:
        instants_us = (
            self._streams.schedule.next_due_us,
            self._personality.deadline_us,
            self._parameter_server.due_us,
        )
        return [due_us for due_us in instants_us if due_us is not None]

    def _on_command(self, message: MAVLink_message) -> Replies:
        command = command_of(message)
        handler = self._commands.get(command.number)
        if handler is None:
            result = Result.UNSUPPORTED
        else:
            try:
                result = handler(self._flight, command)
            except NonFiniteError:
                # A real autopilot would take it and crash.
                self.counters["non-finite field"] += 1
                result = Result.DENIED
        acknowledgement = mavlink.MAVLink_command_ack_message(
            command.number,
            result,
            target_system=message.get_srcSystem(),
            target_component=message.get_srcComponent(),
        )
        replies = [acknowledgement]
        for wanted in self._streams.take_requested():
            replies += self._built([wanted]) if isinstance(wanted, int) else wanted
        return replies

    def _on_set_mode(self, message: MAVLink_message) -> Replies:
        if message.base_mode & CUSTOM_MODE_FLAG:
            self._personality.request_mode(self._flight, message.custom_mode)
        return []

    def _on_heartbeat(self, message: MAVLink_message) -> Replies:
        self._personality.hear(self._flight, message)
        self.counters["ignored"] += 1
        return []

    def _on_timesync(self, message: MAVLink_message) -> Replies:
        return timesync_reply(message, self._since_boot_us() * 1000)

    def _on_parameter_list(self, _message: MAVLink_message) -> Replies:
        return self._parameter_server.request_list(self._flight.time_us)

    def _on_parameter_set(self, message: MAVLink_message) -> Replies:
        name, replies = self._parameter_server.write(message)
        if name is not None:
            self._personality.changed(self._flight, name)
        return replies

    def _on_data_stream(self, message: MAVLink_message) -> Replies:
        if self._personality.answers_data_streams:
            self._streams.request_data_stream(message)
        return []

    def _on_setup_signing(self, message: MAVLink_message) -> Replies:
        """Change the signing key while disarmed; a key of only zeros ends the signing."""
        if self._flight.armed:
            return []
        key = bytes(message.secret_key)
        self._codec.signing = Signing(key) if any(key) else None
        return []

    def _on_setpoint(self, message: MAVLink_message) -> Replies:
        fault = self._personality.setpoints[message.get_type()](self._flight, message)
        if fault is not None:
            self.counters[fault] += 1
        return []

    def _reboot(self, _flight: EmulatedFlight, command: Command) -> Result:
        """Handle 246: param1 = 1 restarts the autopilot, in the air too, where a real one needs force.

        The aircraft flies on; mode, setpoints, streams and the boot time are forgotten.
        """
        (wanted,) = command.used(1)
        if wanted != 1.0:
            return Result.DENIED
        self.reboot()
        return Result.ACCEPTED

    def _notices(self) -> Replies:
        """Return status texts, and a heartbeat at once when the mode has changed."""
        flight = self._flight
        texts, flight.texts = flight.texts, []
        notices = [status_text(text) for text in texts]
        if flight.mode is not self._reported_mode:
            self._reported_mode = flight.mode
            if self._personality.announces_modes:
                notices.append(status_text(f"Mode {flight.mode.name}"))
            notices += self._built([mavlink.MAVLINK_MSG_ID_HEARTBEAT])
        return notices

    def _built(self, message_ids: list[int]) -> Replies:
        if not message_ids:
            return []
        flight = self._flight
        with_position = not POSITION_MESSAGES.isdisjoint(message_ids)
        report = ReportedInstant(
            round(self._since_boot_us() * 1e-3) % 2**32,
            flight,
            self.config,
            self._sensors.measure(flight, with_position=with_position),
            self._personality,
            self._personality.arming.is_ready(flight),
        )
        return [TELEMETRY[message_id](report) for message_id in message_ids]
