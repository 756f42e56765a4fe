"""Motion of the own vehicle through the air, from reports of airspeed, bank angle and heading."""

import cmath
import math
from collections import Counter

import msgspec

from vfguide.companion.alerts import QUIET_S, Alerts
from vfguide.companion.belief import Belief
from vfguide.companion.plan import FlightPlan
from vfguide.elementwise import low_pass, wrap_angle
from vfguide.guidance.air_data import (
    Calibration,
    TurnEfficiency,
    agreed,
    calibrated,
    calibration_of,
    learned,
)
from vfguide.guidance.airframe import coordinated_turn_rate, polar
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import AirspeedReport, PositionReport
from vfguide.state import VehicleState

LONGEST_S = 1.0
"""Longest interval between reports over which anything is learned, s."""

AIRSPEED_FRESH_S = 2.0
"""Maximum age of an airspeed that is used, s."""

AIR_DATA_FRESH_S = 0.5
"""Maximum age of a bank angle, and of the airspeed used with it, s."""

TURN_RATE_S = 2.0
"""Time constant of the heading's turn rate, which decides how far a vehicle slips, s."""

LEAST_CALIBRATED = 5.0
"""Airspeed below which nothing is learned of its sensor, m/s."""

HEADING_ROUNDING = math.radians(1.5)
"""Tolerance on the second heading, which comes with airspeeds in whole degrees, rad."""

LEAST_AIRSPEED = 1.0
"""Floor of airspeeds, m/s: an aircraft on the ground reports 0, which cannot divide a turn rate."""


class ReportedAirData(msgspec.Struct, frozen=True, kw_only=True):
    """Air data of one moment as an autopilot reports them."""

    heading: float
    """Heading, rad."""
    bank: float
    """Bank angle, rad, positive right."""
    airspeed: float
    """Airspeed as the sensor shows it, m/s."""
    velocity_north: float
    """Velocity over ground north, m/s."""
    velocity_east: float
    """Velocity over ground east, m/s."""


class AirMotion:
    """Airspeed, bank angle and heading of one vehicle, with the calibration of its airspeed."""

    def __init__(
        self, plan: FlightPlan, belief: Belief, alerts: Alerts, *, calibrates: bool
    ) -> None:
        """Begin with nothing heard; `calibrates` if setpoints are airspeeds, whose scale is learned."""
        self._belief, self._alerts = belief, alerts
        self.counters: Counter[str] = Counter()
        """Count of airspeeds that were not believed."""
        self.by_nose, self.by_path = TurnEfficiency(), TurnEfficiency()
        """Turn rate over the coordinated turn rate at the reported bank, by heading and by path."""
        self.asked: float | None = None
        """Airspeed setpoint, m/s; None while not steered."""
        self._velocity = 0j
        self._calibrates = calibrates
        # Both calibrations are learned until it is known whether the vehicle slips, as one of them is right.
        kinds = (False, True) if plan.finds_slip else (plan.slips,)
        self._calibrations = {slips: calibration_of(slips=slips) for slips in kinds}
        self._airspeed = 0.0
        self._airspeed_time = -math.inf
        self._bank = 0.0
        self._bank_time = -math.inf
        self._nose: float | None = None
        self._second_heading: float | None = None
        self._witness: tuple[float, float] | None = None
        self._witness_before: tuple[float, float] | None = None
        self._witness_s = -math.inf
        self._turn_rate = 0.0
        self.retune(plan)

    def retune(self, plan: FlightPlan) -> None:
        """Use a new plan of the same vehicle; what was learned of it is kept."""
        self._slips = plan.surely_slips
        self._speed_s = 1.0 / plan.airframe.beta

    @property
    def turn_efficiency(self) -> TurnEfficiency:
        """Turn rate over the coordinated one at the reported bank; unchanged where no bank is heard."""
        return agreed(self.by_nose, self.by_path)

    @property
    def bank_heard(self) -> bool:
        """Whether the autopilot has ever reported a bank angle."""
        return math.isfinite(self._bank_time)

    @property
    def calibration(self) -> Calibration:
        """Calibration of true over reported airspeed; setpoints are airspeeds as reported."""
        return self._calibrations[self._slips]

    def note_airspeed(self, report: AirspeedReport, now: float, known: VehicleState | None) -> None:
        """Process a report of airspeed and heading; the airspeed counts if it is believed by `known`."""
        expected = None if known is None else known.airspeed / self.calibration.scale
        self._second_heading = report.heading
        fault = self._belief.take_airspeed(report.airspeed, expected, now)
        if fault is not None:
            self.counters["airspeed not believed"] += 1
            text = f"{fault}: flown by the wind known before; check the airspeed sensor"
            self._alerts.say("airspeed", WARNING, text, quiet_s=QUIET_S)
        if not self._belief.airspeed.doubted:
            self._airspeed, self._airspeed_time = report.airspeed, now

    def velocity(
        self, report: PositionReport, known: VehicleState | None, now: float
    ) -> tuple[float, float] | None:
        """Return the velocity (north, east) through the air at a report, m/s; None if nothing shows it.

        A heading that is missing, or repeated to the digit, is replaced by the one that comes with airspeeds.
        Without that, the former heading is turned by the bank. An airspeed that is old or doubted is replaced
        by the known one, which approaches the setpoint. The state `known` is the one before the report.
        """
        before, self._witness_before, self._witness = self._witness, self._witness, None
        passed_s, self._witness_s = now - self._witness_s, now
        airspeed = self.calibration.scale * self._airspeed
        if self._belief.airspeed.doubted or now - self._airspeed_time > AIRSPEED_FRESH_S:
            if known is None or math.isinf(self._airspeed_time):
                return None
            airspeed = known.airspeed
            if self.asked is not None and self._calibrates:
                asked = self.calibration.scale * self.asked
                airspeed = low_pass(airspeed, asked, min(passed_s, LONGEST_S), self._speed_s)
        airspeed = max(airspeed, LEAST_AIRSPEED)
        heading, second, bank = report.heading, self._second_heading, self.fresh_bank(now)
        if heading is None or heading == self._nose:
            if second is not None:
                off = math.inf if heading is None else abs(wrap_angle(second - heading))
                heading = second if off > HEADING_ROUNDING else heading
            elif before is not None and bank is not None:
                turn_rate = self.turn_efficiency.value * coordinated_turn_rate(bank, airspeed)
                heading = wrap_angle(before[0] + turn_rate * passed_s)
        if heading is None:
            return None
        self._witness = heading, airspeed
        return polar(airspeed, heading)

    def carried_on(self, known: VehicleState) -> tuple[float, float]:
        """Return (heading in rad, true airspeed in m/s) with the known heading turned as the nose has."""
        if self._witness is None or self._witness_before is None:
            return known.heading, known.airspeed
        heading = known.heading + wrap_angle(self._witness[0] - self._witness_before[0])
        return heading, self._witness[1]

    def note_bank(self, bank: float, now: float) -> None:
        """Note a reported bank angle, rad, positive right."""
        self._bank, self._bank_time = bank, now

    def fresh_bank(self, now: float) -> float | None:
        """Return the reported bank angle, rad, positive right; None if it is old."""
        return self._bank if now - self._bank_time <= AIR_DATA_FRESH_S else None

    def data(self, report: PositionReport, now: float) -> ReportedAirData | None:
        """Return air data of a report with the last bank and airspeed; None where incomplete or old."""
        fresh = now - min(self._bank_time, self._airspeed_time) <= AIR_DATA_FRESH_S
        if report.heading is None or not (fresh and self._calibrates):
            return None
        return ReportedAirData(
            heading=report.heading,
            bank=self._bank,
            airspeed=self._airspeed,
            velocity_north=report.velocity_north,
            velocity_east=report.velocity_east,
        )

    def heading_and_airspeed(
        self, report: PositionReport, known: VehicleState | None, now: float
    ) -> tuple[float, float]:
        """Return (heading in rad, true airspeed in m/s) at a report, by the wind where not reported.

        The state `known` is the one before the report, with the wind.
        """
        velocity_north, velocity_east = report.velocity_north, report.velocity_east
        wind_north, wind_east = (known.wind_north, known.wind_east) if known else (0.0, 0.0)
        heading = report.heading
        if heading is None:
            heading = math.atan2(velocity_east - wind_east, velocity_north - wind_north)
        calibration = self.calibration
        airspeed = calibration.scale * self._airspeed
        blown = now - self._airspeed_time > AIRSPEED_FRESH_S
        if self._slips and calibration.is_settled:
            _, wind_north, wind_east, _ = calibration.estimate
            blown = True
        if blown:
            # Take both from the known wind. An airspeed from the wind, with a measured heading, would change
            # the wind that it comes from, ever more where a compass is off.
            air_north, air_east = velocity_north - wind_north, velocity_east - wind_east
            heading, airspeed = math.atan2(air_east, air_north), math.hypot(air_north, air_east)
        return heading, max(airspeed, LEAST_AIRSPEED)

    def learn(
        self, report: PositionReport, state: VehicleState, interval: float, now: float
    ) -> None:
        """Learn from a report with heading and airspeed, the state after it, and their interval, s."""
        fresh = now - self._airspeed_time <= AIRSPEED_FRESH_S
        before, self._nose = self._nose, report.heading
        velocity = complex(report.velocity_north, report.velocity_east)
        accelerated, self._velocity = velocity - self._velocity, velocity
        if report.heading is None or before is None:
            return
        flying = fresh and self._airspeed > LEAST_CALIBRATED
        if not (self._calibrates and flying and interval <= LONGEST_S):
            return
        # Averaging removes swings in yaw, in which the nose does not leave its direction as in a turn.
        turn_rate = wrap_angle(report.heading - before) / interval
        self._turn_rate = low_pass(self._turn_rate, turn_rate, interval, TURN_RATE_S)
        if now - self._bank_time <= AIR_DATA_FRESH_S:
            airspeed = self.calibration.scale * self._airspeed
            across = (accelerated * cmath.rect(1.0, -report.heading)).imag
            self.by_nose, self.by_path = (
                learned(known, bank=self._bank, airspeed=airspeed, turn_rate=rate, period=interval)
                for known, rate in (
                    (self.by_nose, turn_rate),
                    (self.by_path, across / (interval * airspeed)),
                )
            )
        wind_rate = math.hypot(state.wind_rate_north, state.wind_rate_east)
        for slips, known in self._calibrations.items():
            self._calibrations[slips] = calibrated(
                known,
                reported_airspeed=self._airspeed,
                heading=report.heading,
                turn_rate=self._turn_rate,
                velocity_north=report.velocity_north,
                velocity_east=report.velocity_east,
                # A nose that leaves the direction of flight looks like a wind that turns with it.
                wind_rate=0.0 if slips else wind_rate,
                period=interval,
            )
