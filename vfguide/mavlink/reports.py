"""Reports decoded from MAVLink messages, in SI units."""

import msgspec


class PositionReport(msgspec.Struct, frozen=True, kw_only=True):
    """GLOBAL_POSITION_INT."""

    boot_time_s: float
    """Autopilot's time since boot, s."""
    latitude_deg: float
    """Latitude, degrees, north positive."""
    longitude_deg: float
    """Longitude, degrees, east positive."""
    altitude_amsl: float
    """Altitude, m above mean sea level."""
    velocity_north: float
    """Velocity over ground to the north, m/s."""
    velocity_east: float
    """Velocity over ground to the east, m/s."""
    heading: float | None
    """Heading psi, rad: the message's hdg is yaw, not course. None if the autopilot does not know it."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up."""
    series: int = 0
    """Sequence number series of its frame; another series may be another aircraft's."""


class TrafficReport(msgspec.Struct, frozen=True, kw_only=True):
    """ADSB_VEHICLE: another aircraft, as an ADS-B receiver hears it."""

    icao_address: int
    """ICAO address, 24 bits."""
    latitude_deg: float
    """Latitude, degrees, north positive."""
    longitude_deg: float
    """Longitude, degrees, east positive."""
    altitude_amsl: float
    """Altitude, m above mean sea level; NaN if not sent."""
    velocity: tuple[float, float] | None
    """Velocity over ground (north, east), m/s; None if not sent."""
    climb_rate: float
    """Climb rate, m/s, positive up; 0 if not sent."""
    age_s: float
    """Age of the report, s."""
    altitude_error: float = 0.0
    """Greatest error of the altitude, m: 0 for a geometric one."""


class AirspeedReport(msgspec.Struct, frozen=True, kw_only=True):
    """VFR_HUD."""

    airspeed: float
    """Airspeed, m/s."""
    heading: float | None = None
    """Heading, rad, in whole degrees; None if the autopilot does not know it."""


class AttitudeReport(msgspec.Struct, frozen=True, kw_only=True):
    """ATTITUDE."""

    bank: float
    """Bank angle phi, rad, positive right."""


class HeartbeatReport(msgspec.Struct, frozen=True, kw_only=True):
    """HEARTBEAT of the autopilot."""

    autopilot: int
    """MAV_AUTOPILOT."""
    custom_mode: int
    """Mode in the autopilot's own numbers."""
    armed: bool
    """Whether the motors are armed."""
    series: int = 0
    """Sequence number series of its frame."""
    vehicle_type: int = 1
    """MAV_TYPE; 1 is a fixed wing."""
    status: int
    """MAV_STATE: ArduPlane is ACTIVE only in flight; ArduPlane and PX4 are CRITICAL in a fail-safe."""


class LandedReport(msgspec.Struct, frozen=True, kw_only=True):
    """EXTENDED_SYS_STATE."""

    state: int
    """MAV_LANDED_STATE."""


class OrderRequest(msgspec.Struct, frozen=True, kw_only=True):
    """COMMAND_LONG with MAV_CMD_USER_1, by which a ground station gives a companion an order in numbers."""

    sender: tuple[int, int]
    """MAVLink system and component of the sender."""
    code: float
    """param1: code of the order."""
    values: tuple[float, float, float]
    """param2 to param4: a spacing in metres, vehicles, or a slot; 0 if unused."""
    confirmation: int
    """0 at the first sending, then rising."""


class CommandReport(msgspec.Struct, frozen=True, kw_only=True):
    """COMMAND_ACK."""

    command: int
    """MAV_CMD."""
    result: int
    """MAV_RESULT."""


class VersionReport(msgspec.Struct, frozen=True, kw_only=True):
    """AUTOPILOT_VERSION."""

    major: int
    """Major version of the autopilot's firmware; 0 if it does not know."""
    minor: int
    """Minor version of the autopilot's firmware."""
    uid: int = 0
    """Number of its hardware; 0 if it has none."""


class SteeringReport(msgspec.Struct, frozen=True, kw_only=True):
    """Another sender steers the vehicle, by its own message or the autopilot's answer to one."""

    sender: tuple[int, int]
    """MAVLink system and component of that sender."""


class TextReport(msgspec.Struct, frozen=True, kw_only=True):
    """STATUSTEXT."""

    severity: int
    """MAV_SEVERITY."""
    text: str


class ParameterReport(msgspec.Struct, frozen=True, kw_only=True):
    """PARAM_VALUE."""

    name: str
    """Name of the parameter."""
    value: float
    """Value field as a real number: valid for ArduPilot, and for PX4 if the type is a real number."""
    whole: int | None
    """Value field's bytes as a whole number, if the type is one: valid for PX4."""


class TimeReport(msgspec.Struct, frozen=True, kw_only=True):
    """TIMESYNC that answers a question."""

    stamp: int
    """Asker's time stamp, ns."""
    autopilot_ns: int
    """Autopilot's time at the answer, ns."""


class GpsReport(msgspec.Struct, frozen=True, kw_only=True):
    """GPS_RAW_INT."""

    fix_type: int
    """GPS_FIX_TYPE."""
    accuracy: float | None
    """Horizontal accuracy, m; None if the receiver does not tell."""
    altitude_amsl: float
    """Altitude by satellites, m above mean sea level."""


class EstimatorReport(msgspec.Struct, frozen=True, kw_only=True):
    """EKF_STATUS_REPORT (ArduPilot) or ESTIMATOR_STATUS (PX4)."""

    has_position: bool
    """Whether the horizontal position on earth is known."""
    has_velocity: bool
    """Whether the horizontal velocity is known."""


class SensorsReport(msgspec.Struct, frozen=True, kw_only=True):
    """SYS_STATUS: health of what is present and enabled, and the battery."""

    gps: bool
    """Whether the GPS receiver is healthy."""
    attitude: bool
    """Whether the attitude and heading reference is healthy."""
    battery: float | None = None
    """Remaining charge, 0 to 1; None if unknown."""
    battery_voltage: float | None = None
    """Voltage, V; None if unknown."""


class BatteryReport(msgspec.Struct, frozen=True, kw_only=True):
    """BATTERY_STATUS: one of the vehicle's batteries; SYS_STATUS covers only the first."""

    number: int
    """Number of the battery."""
    remaining: float | None
    """Remaining charge, 0 to 1; None if unknown."""
    voltage: float | None
    """Voltage, V; None if unknown."""


class RadioReport(msgspec.Struct, frozen=True, kw_only=True):
    """RADIO_STATUS of the radio on this connection."""

    free: float
    """Free share of the radio's buffer, 0 to 1."""


Report = (
    PositionReport
    | AirspeedReport
    | AttitudeReport
    | HeartbeatReport
    | LandedReport
    | OrderRequest
    | CommandReport
    | SteeringReport
    | TextReport
    | ParameterReport
    | TimeReport
    | GpsReport
    | EstimatorReport
    | SensorsReport
    | BatteryReport
    | VersionReport
    | TrafficReport
    | RadioReport
)
