"""What an autopilot reports, in SI units."""

import msgspec


class PositionReport(msgspec.Struct, frozen=True, kw_only=True):
    """GLOBAL_POSITION_INT."""

    boot_time_s: float
    """Time of the autopilot's clock, s."""
    latitude_deg: float
    """degrees, north positive."""
    longitude_deg: float
    """degrees, east positive."""
    altitude_amsl: float
    """m above mean sea level."""
    velocity_north: float
    """Over ground, m/s."""
    velocity_east: float
    """Over ground, m/s."""
    heading: float | None
    """psi, rad: the message's hdg is yaw, not course. None where the autopilot does not know it."""
    climb_rate: float = 0.0
    """m/s, positive up."""
    series: int = 0
    """Series of numbers that its frame is one of; another may be another aircraft's."""


class TrafficReport(msgspec.Struct, frozen=True, kw_only=True):
    """ADSB_VEHICLE: another aircraft, as an ADS-B receiver hears it."""

    icao_address: int
    """ICAO address of the aircraft, 24 bits."""
    latitude_deg: float
    """degrees, north positive."""
    longitude_deg: float
    """degrees, east positive."""
    altitude_amsl: float
    """m above mean sea level; NaN where it does not say."""
    velocity: tuple[float, float] | None
    """Over ground (north, east), m/s; None where it does not say."""
    climb_rate: float
    """m/s, positive up; 0 where it does not say."""
    age_s: float
    """How long ago it was heard, s."""
    altitude_error: float = 0.0
    """By how much the altitude may be off, m: 0 of a geometric one."""


class AirspeedReport(msgspec.Struct, frozen=True, kw_only=True):
    """VFR_HUD."""

    airspeed: float
    """m/s."""
    heading: float | None = None
    """rad, in whole degrees; None where the autopilot does not know it."""


class AttitudeReport(msgspec.Struct, frozen=True, kw_only=True):
    """ATTITUDE."""

    bank: float
    """phi, rad, positive right."""


class HeartbeatReport(msgspec.Struct, frozen=True, kw_only=True):
    """HEARTBEAT of the autopilot."""

    autopilot: int
    """MAV_AUTOPILOT."""
    custom_mode: int
    """Mode, in the autopilot's own numbers."""
    armed: bool
    """Whether the motors are armed."""
    series: int = 0
    """Series of numbers that its frame is one of."""
    vehicle_type: int = 1
    """MAV_TYPE: 1 is a fixed wing."""
    status: int
    """MAV_STATE: ArduPlane is ACTIVE only while it flies, both are CRITICAL in a fail-safe."""


class LandedReport(msgspec.Struct, frozen=True, kw_only=True):
    """EXTENDED_SYS_STATE."""

    state: int
    """MAV_LANDED_STATE."""


class OrderRequest(msgspec.Struct, frozen=True, kw_only=True):
    """COMMAND_LONG with MAV_CMD_USER_1 for a companion, of a ground station: an order in numbers."""

    sender: tuple[int, int]
    """MAVLink system and component that it comes from."""
    code: float
    """param1: which order."""
    values: tuple[float, float, float]
    """param2 to param4: a spacing in metres, vehicles, or a slot; 0 where there is nothing to say."""
    confirmation: int
    """0 the first time it is sent, then rising."""


class CommandReport(msgspec.Struct, frozen=True, kw_only=True):
    """COMMAND_ACK."""

    command: int
    """MAV_CMD."""
    result: int
    """MAV_RESULT."""


class VersionReport(msgspec.Struct, frozen=True, kw_only=True):
    """AUTOPILOT_VERSION."""

    major: int
    """Major version of the autopilot's firmware; 0 where it does not know."""
    minor: int
    """Minor version of the autopilot's firmware."""
    uid: int = 0
    """Number of its hardware; 0 where it has none."""


class SteeringReport(msgspec.Struct, frozen=True, kw_only=True):
    """Somebody else steers the same vehicle: a message of its own, or the autopilot's answer to one."""

    sender: tuple[int, int]
    """MAVLink system and component of who steers."""


class TextReport(msgspec.Struct, frozen=True, kw_only=True):
    """STATUSTEXT."""

    severity: int
    """MAV_SEVERITY."""
    text: str
    """What it says."""


class ParameterReport(msgspec.Struct, frozen=True, kw_only=True):
    """PARAM_VALUE."""

    name: str
    """Name of the parameter."""
    value: float
    """The value field as a number: what ArduPilot means, and PX4 where the type is a real number."""
    whole: int | None
    """The value field's bytes as a whole number, where the type is one: what PX4 means then."""


class TimeReport(msgspec.Struct, frozen=True, kw_only=True):
    """TIMESYNC, the answer to a question."""

    stamp: int
    """The asker's own, ns."""
    autopilot_ns: int
    """The autopilot's clock when it answered, ns."""


class GpsReport(msgspec.Struct, frozen=True, kw_only=True):
    """GPS_RAW_INT."""

    fix_type: int
    """GPS_FIX_TYPE."""
    accuracy: float | None
    """Horizontal, m; None where the receiver does not say."""
    altitude_amsl: float
    """By satellites, m above mean sea level."""


class EstimatorReport(msgspec.Struct, frozen=True, kw_only=True):
    """EKF_STATUS_REPORT (ArduPilot) or ESTIMATOR_STATUS (PX4)."""

    has_position: bool
    """Whether it knows the horizontal position on earth."""
    has_velocity: bool
    """Whether it knows the horizontal velocity."""


class SensorsReport(msgspec.Struct, frozen=True, kw_only=True):
    """SYS_STATUS: whether what is present and enabled is healthy, and the battery."""

    gps: bool
    """The receiver."""
    attitude: bool
    """Attitude and heading reference."""
    battery: float | None = None
    """What is left of the battery, 0 to 1; None where the autopilot does not know."""
    battery_voltage: float | None = None
    """V; None where the autopilot does not know."""


class BatteryReport(msgspec.Struct, frozen=True, kw_only=True):
    """BATTERY_STATUS: one of the vehicle's batteries; SYS_STATUS tells of the first alone."""

    number: int
    """Which."""
    remaining: float | None
    """What is left of it, 0 to 1; None where the autopilot does not know."""
    voltage: float | None
    """V; None where the autopilot does not know."""


class RadioReport(msgspec.Struct, frozen=True, kw_only=True):
    """RADIO_STATUS of the radio on this connection."""

    free: float
    """Share of its buffer that is free, 0 to 1."""


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
