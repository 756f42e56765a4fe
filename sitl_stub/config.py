"""What one emulated aircraft starts with."""

import math
from typing import get_args

import msgspec

from sitl_stub.aircraft import PlantParameters
from sitl_stub.route import Route
from sitl_stub.sensor_errors import Fault, SensorGrade


class AutopilotConfig(msgspec.Struct, frozen=True, kw_only=True):
    """One emulated aircraft at the start of its flight: in the air, in a loiter, or on the ground."""

    system_id: int
    """MAVLink system id, 1 to 255."""

    component_id: int = 1
    """MAVLink component of its autopilot, 1 to 255."""

    vehicle_type: int = 1
    """MAV_TYPE in its heartbeat: 1 is a fixed wing, 2 a quadrotor."""

    uid: int = 0
    """Hardware number in AUTOPILOT_VERSION; 0: it has none."""

    autopilot: str = "ardupilot"
    """Name of the autopilot that it behaves as."""

    autopilot_version: tuple[int, int] | None = None
    """Major and minor of the version whose manners it has; None: the newest that is known here."""

    plant: PlantParameters
    """How it flies."""

    latitude_deg: float
    """Start position; home is on the ground below it."""

    longitude_deg: float
    """Start position."""

    altitude_amsl_m: float
    """Start altitude."""

    home_altitude_amsl_m: float
    """Altitude of the ground at home."""

    course_rad: float
    """Start course over ground."""

    airspeed_m_s: float
    """Start airspeed; also what it flies whenever no speed is commanded."""

    climb_m_s: float = 0.0
    """Climb rate at a start in the air, positive up."""

    position_noise_m: float = 0.0
    """Standard deviation, per horizontal axis, of white noise on reported positions."""

    velocity_noise_m_s: float = 0.0
    """Standard deviation, per horizontal axis, of white noise on reported ground velocities."""

    heading_noise_rad: float = 0.0
    """Standard deviation of white noise on reported headings."""

    airspeed_noise_m_s: float = 0.0
    """Standard deviation of white noise on reported airspeeds."""

    sensors: SensorGrade = "ideal"
    """How good the sensors are, beside the noise given here."""

    faults: tuple[Fault, ...] = ()
    """What is wrong with its reports, and when."""

    seed: int = 0
    """Seed of all noise; the system id is mixed in, so that one seed serves a formation."""

    indicated_airspeed: bool = False
    """Whether airspeeds that are commanded, limited and reported are indicated ones."""

    airspeed_calibration: float = 1.0
    """What the airspeed sensor shows in parts of what it should."""

    loop_rate_hz: float | None = None
    """Rate of the scheduler on whose ticks telemetry leaves; None: telemetry leaves exactly on time."""

    airborne: bool = True
    """Whether the flight begins in the air; else it stands on the ground, `armed` or not."""

    ready_after_s: float = 0.0
    """Simulation time from which on it lets itself be armed: sensors have to settle first."""

    old_parameter_names: bool = False
    """ArduPlane's parameters by the names they had before 4.5."""

    armed: bool = True
    """Whether it is armed at the start."""

    boot_time_s: float = 0.0
    """time_boot_ms at simulation time zero, in seconds."""

    route: Route | None = None
    """Flown from the start on, in AUTO; None: it circles until it is told what to do."""

    streams: tuple[tuple[int, int], ...] | None = None
    """Numbers of the messages that it sends without having been asked, beside its heartbeat, and their
    intervals in microseconds; None: what its autopilot sends."""

    icao_address: int = 0
    """ICAO address of its transponder, 24 bits, for ADSB_VEHICLE."""

    def __post_init__(self) -> None:
        """Refuse a start that cannot be flown.

        Raises:
            ValueError: a field is out of its range; the message names it.
        """
        self._check_numbers()
        if not 1 <= self.system_id <= 255:
            raise ValueError(f"system_id must be 1 to 255, not {self.system_id!r}")
        if abs(self.latitude_deg) > 89.0:
            raise ValueError("latitude_deg must be within 89 degrees: poles are not flown")
        if self.sensors not in get_args(SensorGrade):
            wanted = ", ".join(get_args(SensorGrade))
            raise ValueError(f"sensors must be one of {wanted}, not {self.sensors!r}")
        plant = self.plant
        if not plant.airspeed_min_m_s <= self.airspeed_m_s <= plant.airspeed_max_m_s:
            raise ValueError(f"airspeed_m_s {self.airspeed_m_s!r} is outside the plant's range")
        if not 0.5 <= self.airspeed_calibration <= 2.0:
            raise ValueError(
                f"airspeed_calibration must be 0.5 to 2, not {self.airspeed_calibration!r}"
            )
        if self.loop_rate_hz is not None and not 10.0 <= self.loop_rate_hz <= 1000.0:
            raise ValueError(f"loop_rate_hz must be 10 to 1000, not {self.loop_rate_hz!r}")

    def _check_numbers(self) -> None:
        for name, value, most in (
            ("component_id", self.component_id, 255),
            ("vehicle_type", self.vehicle_type + 1, 256),
            ("uid", self.uid + 1, 2**64),
        ):
            if not 1 <= value <= most:
                raise ValueError(f"{name} is out of its range")
        for name in (
            "latitude_deg",
            "longitude_deg",
            "altitude_amsl_m",
            "home_altitude_amsl_m",
            "course_rad",
        ):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite")
        for name in (
            "position_noise_m",
            "velocity_noise_m_s",
            "heading_noise_rad",
            "airspeed_noise_m_s",
            "ready_after_s",
            "boot_time_s",
        ):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and not negative")
