"""The companion's own vehicle, as far as telemetry tells: reports in, navigated states out."""

import math
from dataclasses import dataclass

from vfguide.angles import wrap_angle
from vfguide.companion.boot_clock import BootClock
from vfguide.companion.foresight import SLIPPING, Foresight
from vfguide.companion.plan import FlightPlan
from vfguide.guidance.airspeed_calibration import Calibration, calibrated, calibration_of
from vfguide.guidance.low_pass import low_pass
from vfguide.guidance.navigation import Sample, first_state, navigate, navigate_blind
from vfguide.guidance.wind_triangle import airspeed_for_ground_velocity
from vfguide.mavlink.reports import PositionReport
from vfguide.state import Setpoint, VehicleState

GAP_S = 1.0
"""After a silence longer than this the filter starts anew."""

AIRSPEED_FRESH_S = 2.0
"""An airspeed older than this is not used."""

PERIOD_SHARE = 0.1
"""Weight of the newest interval in the mean period of the loop."""


TURN_RATE_S = 2.0
"""Time constant of the nose's turn rate, which decides how far a vehicle slips."""

LEAST_CALIBRATED = 5.0
"""m/s: slower than this nothing is learned of the airspeed sensor."""

LEAST_AIRSPEED = 1.0
"""m/s: an aircraft on the ground reports 0, by which no turn rate can be divided."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The navigated position on the ellipsoid, for those who share no local frame."""

    latitude_deg: float
    """degrees."""
    longitude_deg: float
    """degrees."""
    altitude_amsl: float
    """m above mean sea level."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """A report, navigated."""

    state: VehicleState[float]
    """In the local frame."""
    place: Place
    """On the ellipsoid."""
    period: float
    """Mean interval between reports, s."""
    interval: float
    """Since the report before, s; infinite for the first."""
    rebooted: bool
    """Whether the autopilot has started anew since the report before."""
    foresight: Foresight | None = None
    """Where the vehicle will be when setpoints take effect; None where they do at once."""


class OwnVehicle:
    """Navigation of one vehicle."""

    def __init__(self, plan: FlightPlan) -> None:
        self._frame = plan.frame
        self._filters = plan.settings.filters
        # Only the leader's law has an observer; a follower has nothing to fly by without its speed.
        self._blind = plan.leads and plan.settings.speed_source == "observer"
        self._nominal_period = 1.0 / plan.rate_hz
        self._clock = BootClock()
        self._airspeed = 0.0
        self._airspeed_time = -math.inf
        # Whoever holds a ground speed is told nothing in terms of the airspeed.
        self._calibrates = plan.airframe.hold == "heading-hold" and not self._blind
        self._calibration = calibration_of(slips=plan.slips)
        self._slips = plan.slips
        self._nose: float | None = None
        self._turn_rate = 0.0
        self._state: VehicleState[float] | None = None
        self._period = self._nominal_period
        memory = SLIPPING if plan.slips else None
        self._foresight = Foresight(plan.airframe, memory=memory) if plan.airframe.lags else None

    @property
    def calibration(self) -> Calibration:
        """True airspeed over the reported one; autopilots are told airspeeds of the kind that they report."""
        return self._calibration

    def note_setpoint(self, setpoint: Setpoint[float] | None, now: float) -> None:
        """A setpoint has gone out; None: the vehicle is not steered."""
        if self._foresight is None:
            return
        if setpoint is None:
            self._foresight.forget()
        else:
            self._foresight.note(setpoint, now)

    def note_airspeed(self, airspeed: float, now: float) -> None:
        """Take an airspeed report."""
        self._airspeed = airspeed
        self._airspeed_time = now

    def take(self, report: PositionReport, now: float) -> Fix | None:
        """What a position report leads to; None where it is not newer than the one before."""
        rebooted = self._clock.rebooted(report.boot_time_s, now)
        if rebooted:
            self._clock.reset()
            self._state = None
        time_s = self._clock.shared_time(report.boot_time_s, now)
        previous = self._state
        if previous is not None and time_s <= previous.time_s:
            return None
        sample = self._sample(report, time_s, now)
        interval = math.inf if previous is None else time_s - previous.time_s
        if previous is None or interval > GAP_S:
            self._period = self._nominal_period
            state = first_state(sample)
        else:
            self._period += PERIOD_SHARE * (interval - self._period)
            step = navigate_blind if self._blind else navigate
            state = step(previous, sample, self._filters)
        self._state = state
        self._calibrate(report, interval, now)
        if self._foresight is not None:
            self._foresight.observe(state)
        latitude, longitude = self._frame.shifted(
            report.latitude_deg,
            report.longitude_deg,
            state.north - sample.north,
            state.east - sample.east,
        )
        place = Place(
            latitude_deg=latitude, longitude_deg=longitude, altitude_amsl=report.altitude_amsl
        )
        return Fix(
            state=state,
            place=place,
            period=self._period,
            interval=interval,
            rebooted=rebooted,
            foresight=self._foresight,
        )

    def _calibrate(self, report: PositionReport, interval: float, now: float) -> None:
        """Learn from a report with a heading and an airspeed of its own."""
        fresh = now - self._airspeed_time <= AIRSPEED_FRESH_S
        before, self._nose = self._nose, report.heading
        state = self._state
        if report.heading is None or before is None or state is None:
            return
        flying = fresh and self._airspeed > LEAST_CALIBRATED
        if not (self._calibrates and flying and interval <= GAP_S):
            return
        # In a swing of the yaw the nose does not leave its direction as in a turn: that is averaged out.
        turn_rate = wrap_angle(report.heading - before) / interval
        self._turn_rate = low_pass(self._turn_rate, turn_rate, interval, TURN_RATE_S)
        # A nose that leaves the direction of flight looks like a wind that turns with it.
        wind_rate = 0.0 if self._slips else math.hypot(state.wind_rate_north, state.wind_rate_east)
        self._calibration = calibrated(
            self._calibration,
            reported_airspeed=self._airspeed,
            heading=report.heading,
            turn_rate=self._turn_rate,
            velocity_north=report.velocity_north,
            velocity_east=report.velocity_east,
            wind_rate=wind_rate,
            period=interval,
        )

    def _sample(self, report: PositionReport, time_s: float, now: float) -> Sample[float]:
        """The report in the local frame, with airspeed and heading from the wind where it has none."""
        north, east = self._frame.to_local(report.latitude_deg, report.longitude_deg)
        velocity_north, velocity_east = report.velocity_north, report.velocity_east
        known = self._state
        wind_north, wind_east = (known.wind_north, known.wind_east) if known else (0.0, 0.0)
        heading = report.heading
        if heading is None:
            heading = math.atan2(velocity_east - wind_east, velocity_north - wind_north)
        airspeed = self._calibration.scale * self._airspeed
        if now - self._airspeed_time > AIRSPEED_FRESH_S:
            airspeed = airspeed_for_ground_velocity(
                math.hypot(velocity_north, velocity_east),
                math.atan2(velocity_east, velocity_north),
                wind_north,
                wind_east,
            )
        if self._slips and self._calibration.is_settled:
            _, wind_north, wind_east, _ = self._calibration.estimate
            air_north, air_east = velocity_north - wind_north, velocity_east - wind_east
            heading, airspeed = math.atan2(air_east, air_north), math.hypot(air_north, air_east)
        return Sample(
            time_s=time_s,
            north=north,
            east=east,
            velocity_north=velocity_north,
            velocity_east=velocity_east,
            heading=heading,
            airspeed=max(airspeed, LEAST_AIRSPEED),
        )
