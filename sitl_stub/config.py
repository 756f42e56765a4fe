"""What one emulated aircraft is: the fields that options and a flight share, and its start."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from sitl_stub.loops import PlantParameters
from sitl_stub.route import Route
from sitl_stub.sensor_errors import Fault, SensorGrade

UNIT = re.compile(r"_(1_s|m_s2|m_s|deg|hz|m|s)$")
"""The end of a field's name that its option does without."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class OptionError(ValueError):
    """An option's value cannot be used; the message is one line."""


@dataclass(frozen=True, slots=True)
class Option:
    """How a field is an option of the command."""

    metavar: str | None = None
    """What its value looks like."""
    name: str | None = None
    """Without dashes; None: the field's name without its unit."""
    shown: str | None = None
    """Its default in the help, where that is neither numbers nor a word."""


class AircraftOptions(BaseModel):
    """What options say of an aircraft and its flight takes as it is."""

    model_config = ConfigDict(
        arbitrary_types_allowed=True, extra="forbid", frozen=True, use_attribute_docstrings=True
    )

    system_id: Annotated[int, Field(ge=1, le=255), Option("N")]
    """MAVLink system id, 1 to 255. Required."""

    component_id: Annotated[int, Field(ge=1, le=255), Option("N")] = 1
    """MAVLink component of its autopilot, 1 to 255."""

    vehicle_type: Annotated[int, Field(ge=0, le=255), Option("N")] = 1
    """MAV_TYPE in its heartbeat: 1 a fixed wing, 2 a quadrotor."""

    uid: Annotated[int, Field(ge=0, lt=2**64), Option("N")] = 0
    """Hardware number in AUTOPILOT_VERSION, which counts up with --count; 0: none."""

    autopilot: Annotated[str, Option("NAME")] = "ardupilot"
    """Autopilot to emulate: ardupilot, px4, or one of --plugin."""

    airspeed_m_s: Annotated[float, Option("M_S")] = 20.0
    """Airspeed where none is commanded, m/s."""

    climb_m_s: Annotated[float, Option("M_S")] = 0.0
    """Climb rate at a start in the air, positive up."""

    ready_after_s: Annotated[NotNegative, Option("S")] = 0.0
    """Time until its sensors have settled and it can be armed, s."""

    position_noise_m: Annotated[NotNegative, Option("M")] = 0.0
    """Standard deviation of reported positions, m."""

    velocity_noise_m_s: Annotated[NotNegative, Option("M_S")] = 0.0
    """Standard deviation of reported velocities over ground, m/s."""

    airspeed_noise_m_s: Annotated[NotNegative, Option("M_S")] = 0.0
    """Standard deviation of reported airspeeds, m/s."""

    sensors: Annotated[SensorGrade, Option()] = "ideal"
    """Grade of its GNSS receiver; all but ideal have usual errors in the other sensors, too."""

    indicated_airspeed: Annotated[bool, Option()] = False
    """Report and obey indicated airspeeds instead of true ones."""

    airspeed_calibration: Annotated[float, Field(ge=0.5, le=2.0), Option("X")] = 1.0
    """Ratio of the shown to the right airspeed."""

    loop_rate_hz: Annotated[float | None, Field(ge=10.0, le=1000.0), Option("HZ")] = None
    """Rate of the scheduler on whose ticks telemetry leaves; default: exactly on time."""

    old_parameter_names: Annotated[bool, Option()] = False
    """Name parameters as ArduPlane before 4.5, such as ARSPD_FBW_MIN."""

    icao_address: Annotated[int, Field(ge=0, lt=2**24), Option("N")] = 0
    """Address of its transponder, for ADSB_VEHICLE."""

    boot_time_s: Annotated[float, Field(ge=0.0, le=1e9), Option("S")] = 0.0
    """Time since boot that its clock shows at the start, s."""

    seed: Annotated[int, Field(ge=0, lt=2**63), Option("N")] = 0
    """Seed of everything random."""

    @classmethod
    def of(cls, values: Mapping[str, object]) -> Self:
        """One of these values.

        Raises:
            OptionError: a value is wrong; the message is one line.
        """
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            cause = first.get("ctx", {}).get("error")
            field = str(first["loc"][0]) if first["loc"] else ""
            known = field in cls.model_fields and option_of(cls, field) is not None
            name = f"--{option_name(cls, field)}" if known else field
            told = f"{first['msg'][0].lower()}{first['msg'][1:]}"
            told = "is missing; see sitl-stub --help" if first["type"] == "missing" else told
            said = str(cause or f"{name}: {told}")
            raise OptionError(said) from error


class AutopilotConfig(AircraftOptions):
    """One emulated aircraft at the start of its flight: in the air, in a loiter, or on the ground."""

    autopilot_version: tuple[int, int] | None = None
    """Major and minor of the version whose manners it has; None: the newest that is known here."""

    plant: PlantParameters
    """How it flies."""

    latitude_deg: Annotated[float, Field(ge=-89.0, le=89.0)]
    """Start position; home is on the ground below it."""

    longitude_deg: Finite
    """Start position."""

    altitude_amsl_m: Finite
    """Start altitude."""

    home_altitude_amsl_m: Finite
    """Altitude of the ground at home."""

    course_rad: Finite
    """Start course over ground."""

    heading_noise_rad: NotNegative = 0.0
    """Standard deviation of white noise on reported headings."""

    faults: tuple[Fault, ...] = ()
    """What is wrong with its reports, and when."""

    airborne: bool = True
    """Whether the flight begins in the air; else it stands on the ground, `armed` or not."""

    armed: bool = True
    """Whether it is armed at the start."""

    route: Route | None = None
    """Flown from the start on, in AUTO; None: it circles until it is told what to do."""

    streams: tuple[tuple[int, int], ...] | None = None
    """Numbers of the messages that it sends without having been asked, beside its heartbeat, and their
    intervals in microseconds; None: what its autopilot sends."""

    @model_validator(mode="after")
    def _can_begin(self) -> Self:
        """See that it begins at an airspeed that it flies."""
        plant = self.plant
        if not plant.airspeed_min_m_s <= self.airspeed_m_s <= plant.airspeed_max_m_s:
            raise ValueError(f"airspeed_m_s {self.airspeed_m_s!r} is outside the plant's range")
        return self


def option_of(model: type[BaseModel], field: str) -> Option | None:
    """How a field of a model is an option, if it is."""
    metadata = model.model_fields[field].metadata
    return next((one for one in metadata if isinstance(one, Option)), None)


def option_name(model: type[BaseModel], field: str) -> str:
    """The name of a field's option, without dashes."""
    option = option_of(model, field)
    return (option and option.name) or UNIT.sub("", field).replace("_", "-")
