"""Base of the emulated autopilots: a subclass in a file of its own defines each of them.

`arduplane.py` and `px4.py` are two; a user's file and an installed package (entry point
`sitl_stub.autopilots`) add others.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import (
    CUSTOM_MODE_FLAG,
    Arming,
    Command,
    Handler,
    Handlers,
    Result,
    SystemStatus,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import LEAST_AIRSPEED_M_S, AutopilotMode, EmulatedFlight, by_number
from sitl_stub.loops import PlantParameters
from sitl_stub.parameters import Parameters
from sitl_stub.registry import PlugInRegistry

ONCE_A_SECOND_US = 1_000_000
"""Interval of what ArduPilot sends without a request, and of PX4's heartbeat and slow messages."""

autopilots = PlugInRegistry(
    "an autopilot", group="sitl_stub.autopilots", has=("firmware", "modes", "loops")
)
"""Autopilots by the name that `--autopilot` gives."""

personality = autopilots.register
"""Decorator: `@personality("name")` registers a class as `--autopilot name`."""


class Personality:
    """One autopilot's modes, commands, setpoints, parameters, versions and loops."""

    firmware: ClassVar[int]
    """MAV_AUTOPILOT in the heartbeat."""

    versions: ClassVar[Sequence[tuple[int, int]]] = ()
    """Major and minor of the versions that behave differently, oldest first."""

    loops: ClassVar[PlantParameters] = PlantParameters()
    """Loops of the aircraft where no plant is named."""

    max_bank_deg: ClassVar[float] = 45.0
    """Bank limit where none is given."""

    version: int = 0
    """Firmware version in AUTOPILOT_VERSION, one byte each for major, minor, patch and type."""

    capabilities: int = 2 | 4 | 8 | 8192
    """MAV_PROTOCOL_CAPABILITY bits in AUTOPILOT_VERSION: PARAM_FLOAT, MISSION_INT, COMMAND_INT, MAVLINK2."""

    unsent: frozenset[int] = frozenset()
    """Ids of the emulator's messages that this autopilot never sends."""

    unrequested: Mapping[int, int] = dict.fromkeys(
        (
            mavlink.MAVLINK_MSG_ID_HEARTBEAT,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS,
            mavlink.MAVLINK_MSG_ID_ATTITUDE,
            mavlink.MAVLINK_MSG_ID_VFR_HUD,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        ),
        ONCE_A_SECOND_US,
    )
    """Intervals in microseconds of the messages sent without a request, by message id."""

    announces_modes: bool = False
    """Whether a status text reports each change of mode."""

    refuses_unknown_parameters: bool = False
    """Whether a request of an unknown parameter gets PARAM_ERROR instead of silence."""

    answers_data_streams: bool = False
    """Whether it obeys REQUEST_DATA_STREAM."""

    modes: Sequence[AutopilotMode]
    initial_mode: AutopilotMode
    """Mode of an aircraft that starts in the air; it circles."""

    ground_mode: AutopilotMode
    mission_mode: AutopilotMode | None = None
    """Mode that flies a route; None for the initial mode."""

    parameters: Parameters
    """Parameters that a ground station reads and sets."""

    distances: ClassVar[Mapping[str, str]] = {}
    """Names of the parameters for the fields of `Navigation`."""

    limits: ClassVar[tuple[str, str, str, str] | None] = None
    """Names of the parameters of the least, greatest and cruise airspeed and of the greatest bank."""

    arming: Arming
    commands: Handlers
    """Handlers of the commands that only this autopilot knows or handles in its own way."""

    setpoints: Mapping[str, Callable[[EmulatedFlight, MAVLink_message], str | None]]
    """Handlers of setpoint messages, by name; they return what was wrong, or None."""

    def __init__(self, config: AutopilotConfig) -> None:
        """Set the modes alone: no setpoints, parameters or checks before arming."""
        del config
        self.parameters = Parameters([], "cast")
        self.arming = Arming(lambda _flight: None, refused=Result.FAILED)
        self.commands = {mavlink.MAV_CMD_DO_SET_MODE: self.set_mode}
        self.setpoints = {}

    @property
    def deadline_us(self) -> int | None:
        """Simulation time at which `watch` must be called next, in microseconds; None for never."""
        return None

    def request_mode(self, flight: EmulatedFlight, custom_mode: int) -> Result:
        """Change the mode to a number from HEARTBEAT.custom_mode."""
        mode = by_number(self.modes).get(custom_mode)
        if mode is None:
            return Result.DENIED
        if mode is not flight.mode:
            flight.enter(mode)
        return Result.ACCEPTED

    def set_mode(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 176: param2 is the number of the mode."""
        flags, custom_mode = command.used(1, 2)
        if not int(flags) & CUSTOM_MODE_FLAG or custom_mode != int(custom_mode):
            return Result.DENIED
        return self.request_mode(flight, int(custom_mode))

    def mode_command(self, custom_mode: int) -> Handler:
        """Return the handler of a command that enters a mode."""
        return lambda flight, _command: self.request_mode(flight, custom_mode)

    def value(self, name: str) -> float:
        """Return a parameter of `distances` or `limits`, in m, m/s or degrees."""
        return self.parameters[name]

    def begin(self, flight: EmulatedFlight) -> None:
        """Give the flight the distances of the parameters, at its start."""
        found = {field: self.value(name) for field, name in self.distances.items()}
        flight.navigation = replace(flight.navigation, **found)

    def changed(self, flight: EmulatedFlight, name: str) -> None:
        """Let a changed parameter take effect."""
        self.begin(flight)
        if self.limits is None:
            return
        least, greatest, cruise, bank = self.limits
        if name in {least, greatest}:
            slowest_m_s, fastest_m_s = self.value(least), self.value(greatest)
            if LEAST_AIRSPEED_M_S <= slowest_m_s <= fastest_m_s:
                flight.set_airspeed_range(slowest_m_s, fastest_m_s)
        elif name == cruise:
            flight.cruise_airspeed_m_s = max(1.0, self.value(cruise))
        elif name == bank:
            flight.set_max_bank_deg(self.value(bank))

    def hear(self, flight: EmulatedFlight, heartbeat: MAVLink_message) -> None:
        """Take another system's heartbeat, such as one of the ground station for the fail-safe."""
        del flight, heartbeat

    def system_status(self, flight: EmulatedFlight) -> SystemStatus:
        """Return MAV_STATE for the heartbeat."""
        return SystemStatus.STANDBY if flight.on_ground else SystemStatus.ACTIVE

    def watch(self, flight: EmulatedFlight) -> None:
        """Apply changes that depend on time alone, such as fail-safes."""
        del flight


def personality_of(config: AutopilotConfig) -> Personality:
    """Return the autopilot that an aircraft starts with.

    Raises:
        ValueError: the name or version is unknown; the message is one line.
    """
    kind: type[Personality] = autopilots.find(config.autopilot)
    if config.autopilot_version is not None and config.autopilot_version not in kind.versions:
        known = ", ".join(f"{major}.{minor}" for major, minor in kind.versions) or "none"
        raise ValueError(
            f"autopilot_version must be one of those of {config.autopilot}, which has {known}"
        )
    return kind(config)
