"""What differs between autopilots, behind one interface, and the stream of setpoints that goes through it.

Each autopilot has a file of its own. Which of them speaks is known by its heartbeat, and how it is steered
perhaps by its version only: an adapter that learns more of its autopilot becomes a more exact one.
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
"""What people call them."""

GLOBAL_POSITION_INT = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT

SYS_STATUS = mavlink.MAVLINK_MSG_ID_SYS_STATUS

GPS_RAW_INT = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT

BATTERY_STATUS = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS

VFR_HUD = mavlink.MAVLINK_MSG_ID_VFR_HUD
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE

HEALTH_US = 500_000
"""Between the autopilot's words of its own health: found bad within two seconds."""

HEALTH_HZ = 2
"""The same of a stream."""

DIGITS = 2
"""Decimals that count: 0.01 m/s of speed, which is all that ArduPlane keeps, 0.01 degrees of course."""


def autopilot_name(autopilot: int) -> str:
    """Name of a MAV_AUTOPILOT."""
    return NAMES.get(autopilot, f"autopilot number {autopilot}")


def other_autopilot(autopilot: int, expected: int) -> str | None:
    """None for the autopilot that is expected, or else what is wrong, in words."""
    if autopilot == expected:
        return None
    return (
        f"the mission says {autopilot_name(expected)} and the vehicle is {autopilot_name(autopilot)}:"
        " not steered; write `autopilot: auto`, or what it is"
    )


autopilot = autopilots.register
"""`@autopilot("name")` makes a class known as the adapter of `vehicles.*.autopilot: name`."""


Px4Steering = Literal["auto", "guided-course", "position", "velocity"]
"""How a PX4 is steered: by what its version has, or by one of the ways in `px4`."""


class AutopilotSetpoint(msgspec.Struct, frozen=True, kw_only=True):
    """What an autopilot is asked to fly, and where it is when it is asked."""

    course: float
    """Over ground, rad."""
    speed: float
    """The speed that the vehicle's hold takes, air or ground, m/s."""
    altitude_amsl: float
    """m above mean sea level."""
    latitude_deg: float
    """Latitude of the vehicle now, degrees: some autopilots are given a course as a point ahead."""
    longitude_deg: float
    """Longitude of the vehicle now, degrees."""


class AutopilotAdapter(ABC):
    """How one kind of autopilot wants to be spoken to.

    Makes messages and sends none. It remembers what the autopilot is, and nothing of the flight. A subclass
    with `@autopilot("name")` is known as `vehicles.*.autopilot: name`.
    """

    name: ClassVar[str]
    """What a mission calls it; set by `@autopilot`."""

    number: ClassVar[int | None] = None
    """MAV_AUTOPILOT of those that this adapter can speak to."""

    by_mavsdk: ClassVar[bool] = False
    """Whether MAVSDK keeps the connection."""

    rehearsed_as: ClassVar[str] = "ardupilot"
    """Name of the emulated autopilot that flies the vehicle in a rehearsal."""

    def __init__(self, vehicle: "Vehicle") -> None:
        """Make one that has heard nothing of its autopilot.

        Args:
            vehicle: whom it speaks to.
        """
        self._vehicle = vehicle

    def become(self, kind: "type[AutopilotAdapter]") -> None:
        """Go on as the adapter that is right by what was heard of the autopilot, and keep what was heard."""
        self.__class__ = kind

    @property
    def is_ready(self) -> bool:
        """Whether enough is known of the autopilot to steer it; until then it is not engaged."""
        return True

    @property
    def counts_ground_stations(self) -> bool:
        """Whether only the silence of a ground station can tell the autopilot that a companion has died."""
        return False

    @property
    def streams_before_engaging(self) -> bool:
        """Whether setpoints have to arrive before the autopilot lets itself be engaged."""
        return False

    @property
    def holds_altitude(self) -> bool:
        """Whether `hold_altitude` can be obeyed; if not, the altitude of engaging is kept."""
        return False

    @property
    def keep_alive_s(self) -> float:
        """Longest time between repetitions of setpoints that have not changed, s."""
        return 0.5

    @property
    def parts_belong_together(self) -> bool:
        """Whether each course setpoint cancels the speed, so that neither may be sent without the other."""
        return False

    @property
    @abstractmethod
    def engaged_name(self) -> str:
        """What ground stations call the mode in which setpoints are obeyed."""

    @property
    def heartbeat_shows_flight(self) -> bool:
        """Whether a heartbeat of an armed vehicle is ACTIVE in the air only."""
        return False

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that `parameter_warnings` wants to know."""
        return ()

    @property
    def steering_commands(self) -> frozenset[int]:
        """Numbers of the commands without which it cannot be steered."""
        return frozenset()

    def steering_questions(self) -> list[MAVLink_message]:
        """Commands whose refusal outside the guided mode shows whether the autopilot has them."""
        return []

    def recognise(self, autopilot: int) -> str | None:
        """None if this adapter can speak to this MAV_AUTOPILOT, or else what is wrong, in words."""
        return None if self.number is None else other_autopilot(autopilot, self.number)

    def questions(self) -> list[MAVLink_message]:
        """What has to be asked before the autopilot can be steered; to be called once a second."""
        return []

    def hear(self, report: VersionReport | CommandReport) -> str | None:
        """Take an answer of the autopilot; one sentence for the operator where it decides the steering."""
        del report
        return None

    def parameter_value(self, report: ParameterReport) -> float:
        """The value in a report, in the way in which this autopilot packs it."""
        return report.value

    def response(self, parameters: Mapping[str, float], needs: FlightNeeds) -> AutopilotResponse:
        """How the vehicle answers by these parameters; nothing where this autopilot's do not tell."""
        del parameters, needs
        return AutopilotResponse()

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What in the autopilot's parameters does not fit the flight, one line each.

        Args:
            parameters: those of `parameters` that were answered; an autopilot may not know them all.
            needs: what the mission expects of the vehicle.
        """
        del parameters, needs
        return []

    def parameter_faults(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Those of them with which the vehicle should not take off, the worst first."""
        del parameters, needs
        return []

    @abstractmethod
    def is_engaged(self, custom_mode: int) -> bool:
        """Whether the autopilot obeys setpoints in this mode."""

    @abstractmethod
    def is_handed_back(self, custom_mode: int) -> bool:
        """Whether this is the mode that `hand_back` leads to."""

    def mode_name(self, custom_mode: int) -> str:
        """What ground stations call a mode."""
        return f"mode {custom_mode}"

    def goes_home(self, custom_mode: int) -> bool:
        """Whether a vehicle in this mode returns or lands."""
        del custom_mode
        return False

    def denies_guided(self, report: CommandReport) -> bool:
        """Whether this answer says that the autopilot is not in its guided mode."""
        del report
        return False

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Ask for position and airspeed at this rate."""
        return telemetry_at(self._vehicle, rate_hz)

    def request_streams(self, rate_hz: float, *, attitude: bool) -> list[MAVLink_message]:
        """Ask for the same where no message is sent on its own: by streams."""
        return data_streams(self._vehicle, rate_hz, attitude=attitude)

    def request_attitude(self, rate_hz: float) -> list[MAVLink_message]:
        """What asks for ATTITUDE at this rate, where the bank is of interest."""
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return [command_long(self._vehicle, command, ATTITUDE, round(1e6 / rate_hz))]

    @abstractmethod
    def engage(self) -> list[MAVLink_message]:
        """Enter the mode in which setpoints are obeyed."""

    @abstractmethod
    def hand_back(self) -> list[MAVLink_message]:
        """Leave it for a loiter that the autopilot flies by itself."""

    def loiter_at(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Loiter at another altitude (m above mean sea level), where it was handed back to its loiter.

        ArduPlane 4.7 and PX4 1.18 take DO_CHANGE_ALTITUDE there.
        """
        command = mavlink.MAV_CMD_DO_CHANGE_ALTITUDE
        return [command_long(self._vehicle, command, altitude_amsl, mavlink.MAV_FRAME_GLOBAL)]

    @abstractmethod
    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Hold a course over ground and a speed."""

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """What an autopilot that is not engaged has to hear so that it can be; it changes nothing."""
        del setpoint
        return []

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Hold an altitude, m above mean sea level."""
        del altitude_amsl
        return []


class UnknownAutopilot(AutopilotAdapter):
    """An autopilot that is not known well enough to be steered, and that may turn out to be of any kind."""

    is_ready = False
    streams_before_engaging = True
    keep_alive_s = 0.0
    parts_belong_together = True

    def is_engaged(self, custom_mode: int) -> bool:
        """Not by this companion."""
        del custom_mode
        return False

    def is_handed_back(self, custom_mode: int) -> bool:
        """Not by this companion."""
        del custom_mode
        return False

    def engage(self) -> list[MAVLink_message]:
        """Nothing yet."""
        return []

    def hand_back(self) -> list[MAVLink_message]:
        """Nothing yet."""
        return []

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Nothing yet."""
        del setpoint
        return []


@autopilot("auto")
class DetectedAutopilot(UnknownAutopilot):
    """Becomes the adapter of the autopilot that is heard first, and asks for nothing before."""

    engaged_name = "the guided mode"

    def recognise(self, autopilot: int) -> str | None:
        """Settle on the first autopilot that can be spoken to."""
        for name in autopilots.names():
            adapter: type[AutopilotAdapter] = autopilots.find(name)
            if adapter.number == autopilot:
                self.become(adapter)
                adapter.__init__(self, self._vehicle)
                return None
        return f"the vehicle is {autopilot_name(autopilot)}, which is not spoken here: not steered"


class Vehicle:
    """Address of an autopilot and the declared facts that its messages need."""

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
            hold: what its speed loop acts on.
            lateral_acceleration: g tan(phi_max), m/s²: what a turn may take.
            px4_steering: how it is steered if it is a PX4.
        """
        self.system_id = system_id
        self.component_id = component_id
        self.hold = hold
        self.lateral_acceleration = lateral_acceleration
        self.px4_steering = px4_steering


def command_long(vehicle: Vehicle, command: int, *parameters: float) -> MAVLink_message:
    """COMMAND_LONG to a vehicle, unused parameters 0."""
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(
        vehicle.system_id, vehicle.component_id, command, 0, *padded
    )


def command_int(
    vehicle: Vehicle, command: int, *parameters: float, altitude: float = 0.0
) -> MAVLink_message:
    """COMMAND_INT to a vehicle, altitudes above mean sea level, unused parameters 0."""
    padded = (*parameters, *(0.0,) * (4 - len(parameters)))
    frame = mavlink.MAV_FRAME_GLOBAL
    return mavlink.MAVLink_command_int_message(
        vehicle.system_id, vehicle.component_id, frame, command, 0, 0, *padded, 0, 0, altitude
    )


def telemetry_at(
    vehicle: Vehicle, rate_hz: float, *, estimator: int | None = None
) -> list[MAVLink_message]:
    """SET_MESSAGE_INTERVAL for the two messages that guidance lives on, and for what tells of their quality.

    Args:
        vehicle: the vehicle.
        rate_hz: of position and airspeed, Hz.
        estimator: the message in which this autopilot tells of its estimator, if that is known.
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
    """REQUEST_DATA_STREAM, for autopilots without SET_MESSAGE_INTERVAL: positions, airspeeds and health.

    Args:
        vehicle: the vehicle.
        rate_hz: of position and airspeed, Hz.
        attitude: whether ATTITUDE is wanted as often.
    """
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
    """MAV_CMD_DO_SET_MODE with a custom mode."""
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return command_long(vehicle, mavlink.MAV_CMD_DO_SET_MODE, custom, main_mode, sub_mode)


def compass_degrees(course: float) -> float:
    """Degrees in [0, 360) for an angle in radians, also after single precision has rounded them.

    360 is denied; to a thousandth of a degree nothing below it rounds up to it.
    """
    return round(math.degrees(wrap_course(course)), 3) % 360.0


Kind = tuple[int, int]
Content = tuple[object, ...]


class SetpointStream:
    """Remembers what an autopilot was last told."""

    def __init__(self, adapter: AutopilotAdapter) -> None:
        """Make a stream that has sent nothing yet.

        Args:
            adapter: says how long a setpoint may go unrepeated, and whether its parts belong together.
        """
        self._adapter = adapter
        self._content: dict[Kind, Content] = {}
        self._sent: dict[Kind, float] = {}
        self._passed_over = False

    def reset(self) -> None:
        """Forget what was sent: the autopilot has left the mode in which it was told."""
        self._content.clear()
        self._sent.clear()

    def due(
        self, messages: Sequence[MAVLink_message], now: float, *, halved: bool = False
    ) -> list[MAVLink_message]:
        """Those of a setpoint's messages that have to be sent now (s); halved, of every other setpoint."""
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
        # A clock that was set back makes the last sending lie ahead.
        return not 0.0 <= now - self._sent[kind] < self._adapter.keep_alive_s


def kind_of(message: MAVLink_message) -> Kind:
    """What a message replaces: the one before of the same number and, for commands, the same command."""
    return message.id, getattr(message, "command", 0)


def content_of(message: MAVLink_message) -> Content:
    """The fields of a message, as finely as they matter."""
    values = vars(message)
    fields = [values[name] for name in message.fieldnames]
    return tuple(
        [round(one, DIGITS) if type(one) is float and isfinite(one) else one for one in fields]
    )
