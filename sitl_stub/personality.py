"""What differs between the autopilots, behind one interface."""

from collections.abc import Callable, Mapping
from typing import Protocol

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import Handlers, Result
from sitl_stub.flight import Flight
from sitl_stub.modes import Mode


class Personality(Protocol):
    """One autopilot's modes, commands, setpoints and parameters."""

    @property
    def firmware(self) -> int:
        """MAV_AUTOPILOT in the heartbeat."""
        ...

    @property
    def capabilities(self) -> int:
        """MAV_PROTOCOL_CAPABILITY bits in AUTOPILOT_VERSION."""
        ...

    @property
    def estimates_wind(self) -> bool:
        """Whether it sends WIND."""
        ...

    @property
    def initial_mode(self) -> Mode:
        """The mode of an aircraft that is already in the air: it circles."""
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

    def request_mode(self, flight: Flight, custom_mode: int) -> Result:
        """A mode change by the number that HEARTBEAT and SET_MODE carry."""
        ...

    def watch(self, flight: Flight) -> None:
        """Look for what the passing of time alone changes."""
        ...

    def parameters(self, flight: Flight) -> dict[str, float]:
        """The parameters a companion looks at before a flight."""
        ...
