"""The own vehicle's motion through the air: reports of airspeed, bank and heading, and what they teach."""

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
"""Nothing is learned over a longer interval between two reports."""

AIRSPEED_FRESH_S = 2.0
"""An airspeed older than this is not used."""

AIR_DATA_FRESH_S = 0.5
"""A bank, or the airspeed beside it, that is older is of another moment."""

TURN_RATE_S = 2.0
"""Time constant of the nose's turn rate, which decides how far a vehicle slips."""

LEAST_CALIBRATED = 5.0
"""m/s: slower than this nothing is learned of the airspeed sensor."""

HEADING_ROUNDING = math.radians(1.5)
"""By so much the heading that comes with airspeeds, in whole degrees, differs from the other."""

LEAST_AIRSPEED = 1.0
"""m/s: an aircraft on the ground reports 0, by which no turn rate can be divided."""


class ReportedAirData(msgspec.Struct, frozen=True, kw_only=True):
    """What an autopilot measured of its motion at one moment, as it reports it."""

    heading: float
    """Where the nose points, rad."""
    bank: float
    """rad, positive right."""
    airspeed: float
    """As the sensor shows it, m/s."""
    velocity_north: float
    """Over ground, m/s."""
    velocity_east: float
    """Over ground, m/s."""


class AirMotion:
    """What one vehicle's airspeed, bank and heading reports say, and the calibration of its airspeed."""

    def __init__(
        self, plan: FlightPlan, belief: Belief, alerts: Alerts, *, calibrates: bool
    ) -> None:
        """Make one that has heard nothing yet.

        Args:
            plan: the vehicle's part of the mission.
            belief: which airspeeds can be true.
            alerts: takes what a pilot should know.
            calibrates: whether its setpoints are airspeeds, whose scale has to be learned.
        """
        self._belief, self._alerts = belief, alerts
        self.counters: Counter[str] = Counter()
        """Airspeeds that were not believed."""
        self.by_nose, self.by_path = TurnEfficiency(), TurnEfficiency()
        """What it turns of what its bank says, by two witnesses."""
        self.asked: float | None = None
        """Speed that it was told to fly, m/s; None while it is not steered."""
        self._velocity = 0j
        self._calibrates = calibrates
        # While it is not known whether it slips both are learned, of which one is right.
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
        """Go on with what is known of the vehicle by now; what was learned of it is kept."""
        self._slips = plan.surely_slips
        self._speed_s = 1.0 / plan.airframe.beta

    @property
    def turn_efficiency(self) -> TurnEfficiency:
        """What it turns of what its bank says; nothing is learned where no bank is heard."""
        return agreed(self.by_nose, self.by_path)

    @property
    def bank_heard(self) -> bool:
        """Whether the autopilot has ever told a bank."""
        return math.isfinite(self._bank_time)

    @property
    def calibration(self) -> Calibration:
        """True airspeed over the reported one; setpoints are airspeeds as the autopilot reports them."""
        return self._calibrations[self._slips]

    def note_airspeed(self, report: AirspeedReport, now: float, known: VehicleState | None) -> None:
        """Take a reported airspeed, if it can be true, and a heading.

        Args:
            report: of both.
            now: s.
            known: state of the vehicle, by which it is judged; None while not known.
        """
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
        """Velocity (north, east) through the air at a report, m/s; None where nothing shows it.

        A heading that is repeated to the digit, or missing, is replaced by the one that comes with airspeeds,
        or by the former one as the bank has turned it since. An airspeed that is old, or doubted, is replaced
        by the known one, which goes over to the one that the vehicle was told to fly.

        Args:
            report: of the position.
            known: state of the vehicle before it; None while not known.
            now: s.
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
        """(heading in rad, true airspeed in m/s) of a vehicle that has turned as its nose has."""
        if self._witness is None or self._witness_before is None:
            return known.heading, known.airspeed
        heading = known.heading + wrap_angle(self._witness[0] - self._witness_before[0])
        return heading, self._witness[1]

    def note_bank(self, bank: float, now: float) -> None:
        """Take a reported bank, rad, positive right."""
        self._bank, self._bank_time = bank, now

    def fresh_bank(self, now: float) -> float | None:
        """As reported, rad, positive right; None where none is fresh."""
        return self._bank if now - self._bank_time <= AIR_DATA_FRESH_S else None

    def data(self, report: PositionReport, now: float) -> ReportedAirData | None:
        """What a report, and the last bank and airspeed, say of the motion through the air."""
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
        """(heading in rad, true airspeed in m/s) at a report; by the wind where the autopilot tells neither.

        Args:
            report: of the position, with the velocity over ground.
            known: state of the vehicle before it, with the wind; None while not known.
            now: s.
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
            # Heading and airspeed both by the wind that is known. With a measured heading an airspeed that
            # comes from the wind would change the wind that it comes from, ever more where a compass is off.
            air_north, air_east = velocity_north - wind_north, velocity_east - wind_east
            heading, airspeed = math.atan2(air_east, air_north), math.hypot(air_north, air_east)
        return heading, max(airspeed, LEAST_AIRSPEED)

    def learn(
        self, report: PositionReport, state: VehicleState, interval: float, now: float
    ) -> None:
        """Learn from a report with a heading and an airspeed of its own.

        Args:
            report: of the position.
            state: of the vehicle by it.
            interval: since the report before, s.
            now: s.
        """
        fresh = now - self._airspeed_time <= AIRSPEED_FRESH_S
        before, self._nose = self._nose, report.heading
        velocity = complex(report.velocity_north, report.velocity_east)
        accelerated, self._velocity = velocity - self._velocity, velocity
        if report.heading is None or before is None:
            return
        flying = fresh and self._airspeed > LEAST_CALIBRATED
        if not (self._calibrates and flying and interval <= LONGEST_S):
            return
        # In a swing of the yaw the nose does not leave its direction as in a turn: that is averaged out.
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
