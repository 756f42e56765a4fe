"""What differs between autopilots, behind one interface; one file for each of them."""

from collections.abc import Mapping
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.parameters import FlightNeeds
from vfguide.mavlink.reports import ParameterReport
from vfguide.state import Hold

GLOBAL_POSITION_INT = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
VFR_HUD = mavlink.MAVLINK_MSG_ID_VFR_HUD


class AutopilotAdapter(Protocol):
    """How one kind of autopilot wants to be spoken to. Makes messages; sends and remembers nothing."""

    @property
    def streams_before_engaging(self) -> bool:
        """Whether setpoints have to arrive before the autopilot lets itself be engaged."""

    @property
    def holds_altitude(self) -> bool:
        """Whether `hold_altitude` can be obeyed; if not, the altitude of engaging is kept."""

    @property
    def keep_alive_s(self) -> float:
        """Longest time between repetitions of setpoints that have not changed, s."""

    @property
    def parts_belong_together(self) -> bool:
        """Whether each course setpoint cancels the speed, so that neither may be sent without the other."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that `parameter_warnings` wants to know."""

    def recognise(self, autopilot: int) -> str | None:
        """None if this adapter can speak to this MAV_AUTOPILOT, or else what is wrong, in words."""

    def parameter_value(self, report: ParameterReport) -> float:
        """The value in a report, in the way in which this autopilot packs it."""

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What in the autopilot's parameters does not fit the flight, one line each.

        Args:
            parameters: those of `parameters` that were answered; an autopilot may not know them all.
            needs: what the mission expects of the vehicle.
        """

    def is_engaged(self, custom_mode: int) -> bool:
        """Whether the autopilot obeys setpoints in this mode."""

    def is_handed_back(self, custom_mode: int) -> bool:
        """Whether this is the mode that `hand_back` leads to."""

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Ask for position and airspeed at this rate."""

    def engage(self) -> list[MAVLink_message]:
        """Enter the mode in which setpoints are obeyed."""

    def hand_back(self) -> list[MAVLink_message]:
        """Leave it for a loiter that the autopilot flies by itself."""

    def fly(self, course: float, speed: float) -> list[MAVLink_message]:
        """Hold a course over ground (rad) and a speed (m/s), the one that the vehicle's hold is of."""

    def stay_ready(self, course: float, speed: float) -> list[MAVLink_message]:
        """What an autopilot that is not engaged has to hear so that it can be; it changes nothing."""

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Hold an altitude, m above mean sea level."""


class Vehicle:
    """Address of an autopilot and the declared facts that its messages need."""

    __slots__ = ("component_id", "hold", "lateral_acceleration", "system_id")

    def __init__(
        self, *, system_id: int, component_id: int, hold: Hold, lateral_acceleration: float
    ) -> None:
        """Collect the facts.

        Args:
            system_id: MAVLink system.
            component_id: MAVLink component of the autopilot.
            hold: what its speed loop acts on.
            lateral_acceleration: g tan(phi_max), m/s²: what a turn may take.
        """
        self.system_id = system_id
        self.component_id = component_id
        self.hold = hold
        self.lateral_acceleration = lateral_acceleration


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


def telemetry_at(vehicle: Vehicle, rate_hz: float) -> list[MAVLink_message]:
    """SET_MESSAGE_INTERVAL for the two messages that guidance lives on."""
    interval_us = round(1e6 / rate_hz)
    command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    return [
        command_long(vehicle, command, message_id, interval_us)
        for message_id in (VFR_HUD, GLOBAL_POSITION_INT)
    ]


def set_mode(vehicle: Vehicle, main_mode: int, sub_mode: int = 0) -> MAVLink_message:
    """MAV_CMD_DO_SET_MODE with a custom mode."""
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return command_long(vehicle, mavlink.MAV_CMD_DO_SET_MODE, custom, main_mode, sub_mode)
