"""What differs between the autopilots, behind one interface."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import Arming, Handlers, Result, SystemStatus
from sitl_stub.flight import Flight
from sitl_stub.modes import Mode
from sitl_stub.parameters import Parameters


class Personality(Protocol):
    """One autopilot's modes, commands, setpoints and parameters."""

    @property
    def firmware(self) -> int:
        """MAV_AUTOPILOT in the heartbeat."""
        ...

    @property
    def version(self) -> int:
        """Version of the firmware whose manners it has, as AUTOPILOT_VERSION says it."""
        ...

    @property
    def capabilities(self) -> int:
        """MAV_PROTOCOL_CAPABILITY bits in AUTOPILOT_VERSION."""
        ...

    @property
    def unsent(self) -> frozenset[int]:
        """Messages that only the other autopilot sends."""
        ...

    @property
    def unrequested(self) -> Mapping[int, int]:
        """Messages that come without having been asked for, with their intervals in microseconds."""
        ...

    @property
    def announces_modes(self) -> bool:
        """Whether a status text tells of each change of mode."""
        ...

    @property
    def refuses_unknown_parameters(self) -> bool:
        """Whether PARAM_ERROR answers for a parameter that does not exist, and not silence."""
        ...

    @property
    def modes(self) -> Sequence[Mode]:
        """The flight modes it has."""
        ...

    @property
    def initial_mode(self) -> Mode:
        """The mode of an aircraft that is already in the air: it circles."""
        ...

    @property
    def ground_mode(self) -> Mode:
        """The mode of an aircraft that stands on the ground."""
        ...

    @property
    def parameters(self) -> Parameters:
        """What a ground station reads and sets."""
        ...

    @property
    def arming(self) -> Arming:
        """Its checks before arming."""
        ...

    @property
    def commands(self) -> Handlers:
        """Handlers of the commands that only this autopilot knows, or knows in its own way."""
        ...

    @property
    def setpoints(self) -> Mapping[str, Callable[[Flight, MAVLink_message], str | None]]:
        """Handlers of the setpoint messages it obeys; they tell what was wrong, or None."""
        ...

    @property
    def deadline_us(self) -> int | None:
        """When `watch` has to look next, in simulation time; None for never."""
        ...

    def begin(self, flight: Flight) -> None:
        """Give the flight the distances of the parameters, at its start."""
        ...

    def changed(self, flight: Flight, name: str) -> None:
        """Let a parameter that was set take effect."""
        ...

    def request_mode(self, flight: Flight, custom_mode: int) -> Result:
        """A mode change by the number that HEARTBEAT and SET_MODE carry."""
        ...

    def hear(self, flight: Flight, heartbeat: MAVLink_message) -> None:
        """Take notice of another's heartbeat: fail-safes count those of the ground station."""
        ...

    def system_status(self, flight: Flight) -> SystemStatus:
        """MAV_STATE in the heartbeat."""
        ...

    def watch(self, flight: Flight) -> None:
        """Look for what the passing of time alone changes."""
        ...
