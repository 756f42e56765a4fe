"""An autopilot that tells by its heartbeat what it is: nothing is said to it before."""

from collections.abc import Mapping

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.adapter import (
    AutopilotAdapter,
    AutopilotSetpoint,
    Vehicle,
    autopilot,
    autopilot_name,
    telemetry_at,
)
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds
from vfguide.mavlink.reports import CommandReport, ParameterReport, VersionReport
from vfguide.registry import autopilots


@autopilot("auto")
class DetectedAutopilot(AutopilotAdapter):
    """Adapter for the autopilot that is heard first. It stays with that one, and asks for nothing before."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._found: AutopilotAdapter | None = None

    @property
    def is_ready(self) -> bool:
        """What the autopilot that was found has here; False while none is."""
        return self._found is not None and self._found.is_ready

    @property
    def counts_ground_stations(self) -> bool:
        """What the autopilot that was found has here."""
        return self._found is not None and self._found.counts_ground_stations

    @property
    def streams_before_engaging(self) -> bool:
        """What the autopilot that was found has here; True while none is, since it may turn out to be so."""
        return self._found is None or self._found.streams_before_engaging

    @property
    def holds_altitude(self) -> bool:
        """What the autopilot that was found has here."""
        return self._found is not None and self._found.holds_altitude

    @property
    def keep_alive_s(self) -> float:
        """What the autopilot that was found has here."""
        return 0.0 if self._found is None else self._found.keep_alive_s

    @property
    def parts_belong_together(self) -> bool:
        """What the autopilot that was found has here."""
        return self._found is None or self._found.parts_belong_together

    @property
    def engaged_name(self) -> str:
        """What the autopilot that was found has here."""
        return "the guided mode" if self._found is None else self._found.engaged_name

    @property
    def heartbeat_shows_flight(self) -> bool:
        """What the autopilot that was found has here."""
        return self._found is not None and self._found.heartbeat_shows_flight

    @property
    def parameters(self) -> tuple[str, ...]:
        """What the autopilot that was found has here."""
        return () if self._found is None else self._found.parameters

    @property
    def steering_commands(self) -> frozenset[int]:
        """What the autopilot that was found has here."""
        return frozenset() if self._found is None else self._found.steering_commands

    def steering_questions(self) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.steering_questions()

    def recognise(self, autopilot: int) -> str | None:
        """Settle on the first autopilot that can be spoken to."""
        if self._found is not None:
            return self._found.recognise(autopilot)
        for name in autopilots.names():
            adapter: type[AutopilotAdapter] = autopilots.find(name)
            if adapter.number == autopilot:
                self._found = adapter(self._vehicle)
                return None
        return f"the vehicle is {autopilot_name(autopilot)}, which is not spoken here: not steered"

    def questions(self) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.questions()

    def hear(self, report: VersionReport | CommandReport) -> str | None:
        """What the autopilot that was found has here."""
        return None if self._found is None else self._found.hear(report)

    def parameter_value(self, report: ParameterReport) -> float:
        """What the autopilot that was found has here."""
        return report.value if self._found is None else self._found.parameter_value(report)

    def response(self, parameters: Mapping[str, float], needs: FlightNeeds) -> AutopilotResponse:
        """What the autopilot that was found has here."""
        found = self._found
        return AutopilotResponse() if found is None else found.response(parameters, needs)

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.parameter_warnings(parameters, needs)

    def parameter_faults(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.parameter_faults(parameters, needs)

    def is_engaged(self, custom_mode: int) -> bool:
        """What the autopilot that was found has here; False while none is."""
        return self._found is not None and self._found.is_engaged(custom_mode)

    def is_handed_back(self, custom_mode: int) -> bool:
        """What the autopilot that was found has here; False while none is."""
        return self._found is not None and self._found.is_handed_back(custom_mode)

    def mode_name(self, custom_mode: int) -> str:
        """The name that the autopilot that was found has for it; its number while none is."""
        return f"mode {custom_mode}" if self._found is None else self._found.mode_name(custom_mode)

    def goes_home(self, custom_mode: int) -> bool:
        """What the autopilot that was found has here; False while none is."""
        return self._found is not None and self._found.goes_home(custom_mode)

    def denies_guided(self, report: CommandReport) -> bool:
        """What the autopilot that was found has here; False while none is."""
        return self._found is not None and self._found.denies_guided(report)

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """All autopilots understand this alike."""
        return telemetry_at(self._vehicle, rate_hz)

    def engage(self) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.engage()

    def hand_back(self) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.hand_back()

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.fly(setpoint)

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.stay_ready(setpoint)

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """What the autopilot that was found has here."""
        return [] if self._found is None else self._found.hold_altitude(altitude_amsl)
