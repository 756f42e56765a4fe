"""Measurements of the true motion, with noise, faults and the airspeed as shown."""

import math

import msgspec
from msgspec.structs import replace
from numpy.random import default_rng

from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import EmulatedFlight
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.plant import Motion
from sitl_stub.sensor_errors import Faults, SensorErrors

MICROSECOND = 1e-6


class Measurement(msgspec.Struct, frozen=True):
    """All measurements of one instant."""

    motion: Motion
    latitude_rad: float
    longitude_rad: float
    altitude_error_m: float
    """Error of the measured altitude above mean sea level."""

    satellite_error_m: float
    """Error of the GNSS altitude."""


class Sensors:
    """Sensors of one flight; position noise has a random generator of its own."""

    def __init__(self, config: AutopilotConfig) -> None:
        self._config = config
        self.faults = Faults(config.faults)
        self._position_random = default_rng((config.seed, config.system_id))
        self._random = default_rng((config.seed, config.system_id, 1))
        self._errors = SensorErrors(config.sensors, seed=config.seed, system_id=config.system_id)
        self._moves = bool(
            config.velocity_noise_m_s or config.heading_noise_rad or config.airspeed_noise_m_s
        )

    @property
    def clock_rate(self) -> float:
        """Seconds of the autopilot's clock per second."""
        return 1.0 + self._errors.clock_rate

    def measure(self, flight: EmulatedFlight, *, with_position: bool) -> Measurement:
        """Measure the present state; without `with_position` the position has no errors."""
        latitude_rad, longitude_rad = flight.state.latitude_rad, flight.state.longitude_rad
        time_s = flight.time_us * MICROSECOND
        if with_position:
            north_m, east_m = self._position_error_m(time_s)
            if north_m or east_m:
                latitude_rad, longitude_rad = displace(
                    latitude_rad,
                    longitude_rad,
                    flight.state.altitude_amsl_m,
                    north_m=north_m,
                    east_m=east_m,
                )
            latitude_rad, longitude_rad = self.faults.place((latitude_rad, longitude_rad), time_s)
        motion = self.faults.motion(self._motion(flight), time_s)
        altitude_error_m = self._errors.altitude_m(time_s) + self.faults.altitude_m(time_s)
        satellite_error_m = self._errors.satellite_altitude_m(time_s)
        return Measurement(motion, latitude_rad, longitude_rad, altitude_error_m, satellite_error_m)

    def _position_error_m(self, time_s: float) -> tuple[float, float]:
        north_m, east_m = self._errors.position_m(time_s)
        off_north_m, off_east_m = self.faults.offset_m(time_s)
        north_m, east_m = north_m + off_north_m, east_m + off_east_m
        if self._config.position_noise_m > 0.0:
            north_m += self._config.position_noise_m * self._position_random.standard_normal()
            east_m += self._config.position_noise_m * self._position_random.standard_normal()
        return north_m, east_m

    def _motion(self, flight: EmulatedFlight) -> Motion:
        motion = flight.motion()
        shown_m_s = flight.shown_airspeed_m_s(motion.airspeed_m_s)
        if not (self._moves or self._errors.figures):
            return (
                motion
                if shown_m_s == motion.airspeed_m_s
                else replace(motion, airspeed_m_s=shown_m_s)
            )
        config, normal, errors = self._config, self._random.standard_normal, self._errors
        north_error_m_s, east_error_m_s = errors.velocity_m_s()
        north_m_s = motion.north_m_s + north_error_m_s + config.velocity_noise_m_s * normal()
        east_m_s = motion.east_m_s + east_error_m_s + config.velocity_noise_m_s * normal()
        heading_error_rad = errors.heading_rad() + config.heading_noise_rad * normal()
        airspeed_error_m_s = errors.airspeed_m_s() + config.airspeed_noise_m_s * normal()
        return replace(
            motion,
            north_m_s=north_m_s,
            east_m_s=east_m_s,
            course_rad=wrap_to_two_pi(math.atan2(east_m_s, north_m_s)),
            ground_speed_m_s=math.hypot(north_m_s, east_m_s),
            heading_rad=wrap_to_two_pi(motion.heading_rad + heading_error_rad),
            airspeed_m_s=max(0.0, shown_m_s + airspeed_error_m_s),
        )
