"""Common interface of autopilot adapters, and the stream of their setpoints.

Each autopilot has its own file. The heartbeat identifies the autopilot, but sometimes only its version tells
how to steer it: an adapter that learns more becomes a more specific one.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from itertools import compress
from math import inf, isfinite
from typing import ClassVar, Literal

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.elementwise import wrap_course
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds
from vfguide.mavlink.reports import CommandReport, ParameterReport, VersionReport
from vfguide.registry import autopilots
from vfguide.state import Hold

NAMES = {
    mavlink.MAV_AUTOPILOT_GENERIC: "a generic autopilot",
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ArduPilot",
    mavlink.MAV_AUTOPILOT_PX4: "PX4",
}
"""Names of autopilots for people."""

GLOBAL_POSITION_INT = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT

SYS_STATUS = mavlink.MAVLINK_MSG_ID_SYS_STATUS

GPS_RAW_INT = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT

BATTERY_STATUS = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS

VFR_HUD = mavlink.MAVLINK_MSG_ID_VFR_HUD
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE

HEALTH_US = 500_000
"""Interval of the autopilot's health messages, µs: a fault is found within two seconds."""

HEALTH_HZ = 2
"""Rate of a health stream, 1/s, for the same reason."""

DIGITS = 2
"""Decimals that count: 0.01 m/s of speed, which is all that ArduPlane keeps, and 0.01 degrees of course."""


def autopilot_name(autopilot: int) -> str:
    """Return the name of a MAV_AUTOPILOT."""
    return NAMES.get(autopilot, f"autopilot number {autopilot}")


def other_autopilot(autopilot: int, expected: int) -> str | None:
    """Return a message for people if the autopilot is not the expected one, otherwise None."""
    if autopilot == expected:
        return None
    return (
        f"the mission says {autopilot_name(expected)} and the vehicle is {autopilot_name(autopilot)}:"
        " not steered; write `autopilot: auto`, or what it is"
    )


autopilot = autopilots.register
"""Class decorator `@autopilot("name")` that registers the adapter of `vehicles.*.autopilot: name`."""


Px4Steering = Literal["auto", "guided-course", "position", "velocity"]
"""Way of steering a PX4: "auto" by its version, or one of the ways in `px4`."""


class AutopilotSetpoint(msgspec.Struct, frozen=True, kw_only=True):
    """Setpoint for an autopilot, with the vehicle's position at that time."""

    course: float
    """Course over ground, rad."""
    speed: float
    """Airspeed or ground speed, whichever the vehicle's hold takes, m/s."""
    altitude_amsl: float
    """Altitude, m above mean sea level."""
    latitude_deg: float
    """Latitude of the vehicle, degrees: some autopilots are given a course as a point ahead."""
    longitude_deg: float
    """Longitude of the vehicle, degrees."""


class AutopilotAdapter(ABC):
    """Builder of messages for one kind of autopilot.

    An adapter sends nothing itself. It remembers what the autopilot is, and nothing of the flight. A subclass
    with `@autopilot("name")` is registered as `vehicles.*.autopilot: name`.
    """

    name: ClassVar[str]
    """Name in a mission; set by `@autopilot`."""

    number: ClassVar[int | None] = None
    """MAV_AUTOPILOT of the autopilots that the adapter fits; None for any."""

    by_mavsdk: ClassVar[bool] = False
    """Whether MAVSDK keeps the connection."""

    rehearsed_as: ClassVar[str] = "ardupilot"
    """Name of the emulated autopilot that flies the vehicle in a rehearsal."""

    def __init__(self, vehicle: "Vehicle") -> None:
        """Create an adapter for a vehicle, of whose autopilot it has heard nothing yet."""
        self._vehicle = vehicle

    def become(self, kind: "type[AutopilotAdapter]") -> None:
        """Become a more specific adapter, and keep what was heard of the autopilot."""
        self.__class__ = kind

    @property
    def is_ready(self) -> bool:
        """Whether enough is known of the autopilot to engage and steer it."""
        return True

    @property
    def counts_ground_stations(self) -> bool:
        """Whether only the silence of a ground station can tell the autopilot that a companion has died."""
        return False

    @property
    def streams_before_engaging(self) -> bool:
        """Whether setpoints must arrive before the autopilot can be engaged."""
        return False

    @property
    def holds_altitude(self) -> bool:
        """Whether `hold_altitude` is obeyed; otherwise the altitude of engaging is kept."""
        return False

    @property
    def keep_alive_s(self) -> float:
        """Longest time between repetitions of unchanged setpoints, s."""
        return 0.5

    @property
    def parts_belong_together(self) -> bool:
        """Whether each course setpoint cancels the speed, so that both must be sent together."""
        return False

    @property
    @abstractmethod
    def engaged_name(self) -> str:
        """Name of the mode that obeys setpoints, as ground stations show it."""

    @property
    def heartbeat_shows_flight(self) -> bool:
        """Whether the heartbeat of an armed vehicle is ACTIVE only in the air."""
        return False

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that `parameter_warnings` uses."""
        return ()

    @property
    def steering_commands(self) -> frozenset[int]:
        """Numbers of the commands that steering needs."""
        return frozenset()

    def steering_questions(self) -> list[MAVLink_message]:
        """Return commands whose refusal outside the guided mode shows whether the autopilot has them."""
        return []

    def recognise(self, autopilot: int) -> str | None:
        """Return None if the adapter fits this MAV_AUTOPILOT, otherwise a message for people."""
        return None if self.number is None else other_autopilot(autopilot, self.number)

    def questions(self) -> list[MAVLink_message]:
        """Return questions to answer before the autopilot can be steered; call once a second."""
        return []

    def hear(self, report: VersionReport | CommandReport) -> str | None:
        """Take an answer of the autopilot; return a sentence for the operator if it decides the steering."""
        del report
        return None

    def parameter_value(self, report: ParameterReport) -> float:
        """Return the value in a report as this autopilot packs it."""
        return report.value

    def response(self, parameters: Mapping[str, float], needs: FlightNeeds) -> AutopilotResponse:
        """Return the vehicle's response by these parameters; its fields are None where they do not tell."""
        del parameters, needs
        return AutopilotResponse()

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Return the mismatches of parameters and flight, one line each; some parameters may be missing."""
        del parameters, needs
        return []

    def parameter_faults(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Return the mismatches with which the vehicle should not take off, the worst first."""
        del parameters, needs
        return []

    @abstractmethod
    def is_engaged(self, custom_mode: int) -> bool:
        """Check whether the autopilot obeys setpoints in this mode."""

    @abstractmethod
    def is_handed_back(self, custom_mode: int) -> bool:
        """Check whether `hand_back` leads to this mode."""

    def mode_name(self, custom_mode: int) -> str:
        """Return the name of a mode, as ground stations show it."""
        return f"mode {custom_mode}"

    def goes_home(self, custom_mode: int) -> bool:
        """Check whether a vehicle in this mode returns or lands."""
        del custom_mode
        return False

    def denies_guided(self, report: CommandReport) -> bool:
        """Check whether this answer says that the autopilot is not in its guided mode."""
        del report
        return False

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Return requests for position and airspeed at this rate."""
        return telemetry_at(self._vehicle, rate_hz)

    def request_streams(self, rate_hz: float, *, attitude: bool) -> list[MAVLink_message]:
        """Return requests for the same by streams, where the autopilot cannot send single messages."""
        return data_streams(self._vehicle, rate_hz, attitude=attitude)

    def request_attitude(self, rate_hz: float) -> list[MAVLink_message]:
        """Return requests for ATTITUDE at this rate, where the bank angle is of interest."""
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return [command_long(self._vehicle, command, ATTITUDE, round(1e6 / rate_hz))]

    @abstractmethod
    def engage(self) -> list[MAVLink_message]:
        """Return commands to enter the mode that obeys setpoints."""

    @abstractmethod
    def hand_back(self) -> list[MAVLink_message]:
        """Return commands to leave that mode for a loiter that the autopilot flies by itself."""

    def loiter_at(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Return commands to loiter at another altitude (m above mean sea level) after handing back.

        ArduPlane 4.7 and PX4 1.18 take DO_CHANGE_ALTITUDE there.
        """
        command = mavlink.MAV_CMD_DO_CHANGE_ALTITUDE
        return [command_long(self._vehicle, command, altitude_amsl, mavlink.MAV_FRAME_GLOBAL)]

    @abstractmethod
    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return commands to hold a course over ground and a speed."""

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return messages that an autopilot needs before it can be engaged; they change nothing."""
        del setpoint
        return []

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Return commands to hold an altitude, m above mean sea level."""
        del altitude_amsl
        return []


class UnknownAutopilot(AutopilotAdapter):
    """Adapter of an autopilot too little known to be steered, which may become any other adapter."""

    is_ready = False
    streams_before_engaging = True
    keep_alive_s = 0.0
    parts_belong_together = True

    def is_engaged(self, custom_mode: int) -> bool:
        """Return False: this companion cannot engage it."""
        del custom_mode
        return False

    def is_handed_back(self, custom_mode: int) -> bool:
        """Return False: this companion cannot hand it back."""
        del custom_mode
        return False

    def engage(self) -> list[MAVLink_message]:
        """Return nothing."""
        return []

    def hand_back(self) -> list[MAVLink_message]:
        """Return nothing."""
        return []

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return nothing."""
        del setpoint
        return []


@autopilot("auto")
class DetectedAutopilot(UnknownAutopilot):
    """Adapter that becomes that of the first autopilot heard, and asks for nothing before."""

    engaged_name = "the guided mode"

    def recognise(self, autopilot: int) -> str | None:
        """Become the adapter of this autopilot, if there is one."""
        for name in autopilots.names():
            adapter: type[AutopilotAdapter] = autopilots.find(name)
            if adapter.number == autopilot:
                self.become(adapter)
                adapter.__init__(self, self._vehicle)
                return None
        return f"the vehicle is {autopilot_name(autopilot)}, which is not spoken here: not steered"


class Vehicle:
    """Address of an autopilot, and facts of the mission that its messages need."""

    __slots__ = ("component_id", "hold", "lateral_acceleration", "px4_steering", "system_id")

    def __init__(
        self,
        *,
        system_id: int,
        component_id: int,
        hold: Hold,
        lateral_acceleration: float,
        px4_steering: Px4Steering = "auto",
    ) -> None:
        """Collect the facts.

        Args:
            system_id: MAVLink system.
            component_id: MAVLink component of the autopilot.
            hold: kind of speed that its speed loop holds.
            lateral_acceleration: greatest lateral acceleration in a turn, g tan(phi_max), m/s².
            px4_steering: way of steering if it is a PX4.
        """
        self.system_id = system_id
        self.component_id = component_id
        self.hold = hold
        self.lateral_acceleration = lateral_acceleration
        self.px4_steering = px4_steering


def command_long(vehicle: Vehicle, command: int, *parameters: float) -> MAVLink_message:
    """Return a COMMAND_LONG to a vehicle; unused parameters are 0."""
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(
        vehicle.system_id, vehicle.component_id, command, 0, *padded
    )


def command_int(
    vehicle: Vehicle, command: int, *parameters: float, altitude: float = 0.0
) -> MAVLink_message:
    """Return a COMMAND_INT to a vehicle with the altitude above mean sea level; unused parameters are 0."""
    padded = (*parameters, *(0.0,) * (4 - len(parameters)))
    frame = mavlink.MAV_FRAME_GLOBAL
    return mavlink.MAVLink_command_int_message(
        vehicle.system_id, vehicle.component_id, frame, command, 0, 0, *padded, 0, 0, altitude
    )


def telemetry_at(
    vehicle: Vehicle, rate_hz: float, *, estimator: int | None = None
) -> list[MAVLink_message]:
    """Return SET_MESSAGE_INTERVAL commands for position and airspeed at this rate.

    With `estimator`, the autopilot's message about its estimator, messages about quality are included.
    """
    interval_us = round(1e6 / rate_hz)
    health_us = max(HEALTH_US, interval_us)
    intervals = [(VFR_HUD, interval_us), (GLOBAL_POSITION_INT, interval_us)]
    if estimator is not None:
        health = (SYS_STATUS, GPS_RAW_INT, BATTERY_STATUS, estimator)
        intervals += [(number, health_us) for number in health]
    command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    return [command_long(vehicle, command, *wanted) for wanted in intervals]


def data_streams(vehicle: Vehicle, rate_hz: float, *, attitude: bool) -> list[MAVLink_message]:
    """Return REQUEST_DATA_STREAM messages at this rate, for autopilots without SET_MESSAGE_INTERVAL."""
    rate = max(round(rate_hz), 1)
    streams = [
        (mavlink.MAV_DATA_STREAM_POSITION, rate),
        (mavlink.MAV_DATA_STREAM_EXTRA2, rate),
        (mavlink.MAV_DATA_STREAM_EXTENDED_STATUS, min(HEALTH_HZ, rate)),
    ]
    if attitude:
        streams.append((mavlink.MAV_DATA_STREAM_EXTRA1, rate))
    return [
        mavlink.MAVLink_request_data_stream_message(
            vehicle.system_id, vehicle.component_id, stream, hertz, 1
        )
        for stream, hertz in streams
    ]


def set_mode(vehicle: Vehicle, main_mode: int, sub_mode: int = 0) -> MAVLink_message:
    """Return MAV_CMD_DO_SET_MODE with a custom mode."""
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return command_long(vehicle, mavlink.MAV_CMD_DO_SET_MODE, custom, main_mode, sub_mode)


def compass_degrees(course: float) -> float:
    """Convert rad to degrees in [0, 360), as 360 is denied, even after rounding to single precision."""
    return round(math.degrees(wrap_course(course)), 3) % 360.0


Kind = tuple[int, int]
Content = tuple[object, ...]


class SetpointStream:
    """Filter of setpoint messages that remembers what an autopilot was last told."""

    def __init__(self, adapter: AutopilotAdapter) -> None:
        """Create a stream that has sent nothing; the adapter tells what is repeated and kept together."""
        self._adapter = adapter
        self._content: dict[Kind, Content] = {}
        self._sent: dict[Kind, float] = {}
        self._passed_over = False

    def reset(self) -> None:
        """Forget what was sent, since the autopilot has left the mode in which it was told."""
        self._content.clear()
        self._sent.clear()

    def due(
        self, messages: Sequence[MAVLink_message], now: float, *, halved: bool = False
    ) -> list[MAVLink_message]:
        """Return a setpoint's messages that are due now (s); with `halved`, of every other setpoint only."""
        # Never so rarely that an autopilot takes the stream for lost.
        fresh = 0.0 <= now - max(self._sent.values(), default=-inf) < self._adapter.keep_alive_s
        self._passed_over = halved and fresh and not self._passed_over
        if self._passed_over:
            return []
        kinds = [kind_of(message) for message in messages]
        contents = [content_of(message) for message in messages]
        due = [self._is_due(*one, now) for one in zip(kinds, contents, strict=True)]
        if any(due) and self._adapter.parts_belong_together:
            due = [True] * len(due)
        for kind, content in compress(zip(kinds, contents, strict=True), due):
            self._content[kind], self._sent[kind] = content, now
        return list(compress(messages, due))

    def _is_due(self, kind: Kind, content: Content, now: float) -> bool:
        if self._content.get(kind) != content:
            return True
        # After a clock was set back, the last sending lies ahead.
        return not 0.0 <= now - self._sent[kind] < self._adapter.keep_alive_s


def kind_of(message: MAVLink_message) -> Kind:
    """Return the kind of a message: a newer message of the same kind replaces it."""
    return message.id, getattr(message, "command", 0)


def content_of(message: MAVLink_message) -> Content:
    """Return the fields of a message, rounded to the decimals that count."""
    values = vars(message)
    fields = [values[name] for name in message.fieldnames]
    return tuple(
        [round(one, DIGITS) if type(one) is float and isfinite(one) else one for one in fields]
    )
