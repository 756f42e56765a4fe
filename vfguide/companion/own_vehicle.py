"""Navigation of the own vehicle: telemetry reports in, navigated states out.

RADIO_STATUS of SiK radios reports how much of their buffer is free. A full buffer drops messages, setpoints
too; so `RadioRoom` bounds what a companion sends.
"""

import math
from collections import Counter

import msgspec
from msgspec.structs import replace

from vfguide.companion.air_motion import AirMotion, ReportedAirData
from vfguide.companion.alerts import QUIET_S, Alerts
from vfguide.companion.belief import STAYED_S, Belief, Believed, Life
from vfguide.companion.delay_compensator import DelayCompensator, memory_of
from vfguide.companion.doubt import Doubt, with_remedy
from vfguide.companion.plan import FlightPlan, bearable_course
from vfguide.companion.timing import ClockWatch
from vfguide.companion.witnesses import FRESH_S, LEAST_FIX, RETURN_S
from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import polar
from vfguide.guidance.navigation import (
    ReportedMotion,
    Sample,
    VelocityError,
    first_state,
    navigate,
    navigate_blind,
    navigate_unseen,
    reach_of,
    velocity_error,
    velocity_error_at_first,
    with_right_velocity,
)
from vfguide.guidance.other_clock import CABLE, NANOSECOND, OtherClock, Reading, TimeQuestions
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import (
    AirspeedReport,
    AttitudeReport,
    BatteryReport,
    EstimatorReport,
    GpsReport,
    PositionReport,
    RadioReport,
    SensorsReport,
    TimeReport,
)
from vfguide.state import GAP_S, Setpoint, VehicleState

SHORT, FULL = 0.5, 0.2
"""Free shares of the buffer below which setpoints go at half rate, and below which little else goes."""

BELIEVED_S = 5.0
"""Time after which a radio's report is void, s: radios send one a second."""


class RadioRoom:
    """Free buffer of the radio to the autopilot; unlimited without reports."""

    def __init__(self, alerts: Alerts) -> None:
        self._alerts = alerts
        self._free, self._heard_s = 1.0, float("-inf")

    def note(self, report: RadioReport, now: float) -> None:
        """Process a radio's report, and warn the pilot if its buffer is nearly full."""
        self._free, self._heard_s = report.free, now
        if report.free < SHORT:
            sent = "setpoints at half their rate"
            if report.free < FULL:
                sent = "nothing but setpoints, warnings and heartbeats is sent"
            self._alerts.say(
                f"radio room: {sent}",
                WARNING,
                f"the radio to the autopilot is behind, {report.free:.0%} of its buffer are free: {sent};"
                " lower the rates of telemetry, or use a faster radio",
                quiet_s=QUIET_S,
            )

    def is_short(self, now: float) -> bool:
        """Check whether setpoints must go at half rate."""
        return self._free < SHORT and now - self._heard_s <= BELIEVED_S

    def is_full(self, now: float) -> bool:
        """Check whether only setpoints, warnings and heartbeats may be sent."""
        return self._free < FULL and now - self._heard_s <= BELIEVED_S


WAIT_S = 0.3
"""Jitter of reports on an ordinary link, s. A longer wait than the stamps say may come from a clock that
stood still. A stamp that is farther ahead may come from one that has leapt."""

SLIP_S = 0.1
"""Slip of the autopilot's clock, s, beyond which the filter restarts, as the time flown is unknown."""

ASK_S, MOST_OPEN = 0.5, 40
"""Interval of time requests, s, which shows a slip within a second, and the limit on open ones. So telemetry
up to 20 s late is recognised."""

MOST_BATTERIES = 10
"""Limit on batteries of a vehicle that are kept apart."""

PERIOD_SHARE = 0.1
"""Weight of the newest interval in the mean period of the loop."""


class GeodeticPlace(msgspec.Struct, frozen=True, kw_only=True):
    """Navigated position on the ellipsoid, for receivers that share no local frame."""

    latitude_deg: float
    """Latitude, degrees."""
    longitude_deg: float
    """Longitude, degrees."""
    altitude_amsl: float
    """Altitude, m above mean sea level."""


class NavigatedState(msgspec.Struct, frozen=True, kw_only=True):
    """Navigated state after a position report."""

    state: VehicleState
    """State in the local frame."""
    place: GeodeticPlace
    """Position on the ellipsoid."""
    period: float
    """Mean interval between reports, s."""
    interval: float
    """Time since the previous report, s; infinite for the first."""
    altitude_amsl: float
    """Altitude, m above mean sea level; NaN while the reported one is doubted."""
    satellite_m: float = math.nan
    """Altitude by satellites minus the altitude held by the autopilot, m; NaN while not known."""
    moved: bool = False
    """Whether the place has jumped since the previous report, so that what was learned is void."""
    steerable: bool = True
    """Whether the state is certain enough to steer by; it is published in any case."""
    delay_compensator: DelayCompensator | None = None
    """Predictor of the state at which setpoints take effect; None where they do at once."""
    air_data: ReportedAirData | None = None
    """Air data; None where heading, bank or airspeed is missing or old, or a ground speed is held."""


class SensorWatch:
    """Newest reports of a vehicle's sensors and of each of its batteries."""

    def __init__(self) -> None:
        self._batteries: dict[int, tuple[BatteryReport, float]] = {}
        self._said: tuple[SensorsReport, float] | None = None

    def note(self, report: SensorsReport, now: float) -> None:
        """Process a report on the sensors."""
        self._said = report, now

    def note_battery(self, report: BatteryReport, now: float) -> None:
        """Process a report on one battery."""
        self._batteries = {
            number: (one, when)
            for number, (one, when) in self._batteries.items()
            if now - when <= FRESH_S
        }
        if len(self._batteries) < MOST_BATTERIES or report.number in self._batteries:
            self._batteries[report.number] = report, now

    def newest(self, now: float) -> SensorsReport | None:
        """Return the newest sensors report with the emptiest battery; None if it is old."""
        if self._said is None or now - self._said[1] > FRESH_S:
            return None
        said = self._said[0]
        # With equal charge the first battery counts, so that voltage and charge are of the same one.
        known = [(said.battery, said.battery_voltage)]
        known += [
            (one.remaining, one.voltage)
            for one, when in self._batteries.values()
            if now - when <= FRESH_S
        ]
        counted = [(left, voltage) for left, voltage in known if left is not None]
        if not counted:
            return said
        left, voltage = min(counted, key=lambda one: one[0])
        return replace(said, battery=left, battery_voltage=voltage)


class OwnVehicle:
    """Navigation of the own vehicle."""

    def __init__(self, plan: FlightPlan, alerts: Alerts | None = None) -> None:
        self._alerts = alerts or Alerts()
        self._frame = plan.frame
        self._filters = plan.settings.filters
        # Only the leader's law has an observer; a follower cannot fly without its speed.
        self._blind = plan.leads and plan.settings.speed_source == "observer"
        self._nominal_period = 1.0 / plan.rate_hz
        # The fastest report over a cable takes no time worth mentioning.
        self._clock = OtherClock(CABLE, least_way_s=0.0)
        self._clock_watch = ClockWatch(self._clock, self._alerts)
        self.questions = TimeQuestions(every_s=ASK_S, most_open=MOST_OPEN)
        """Time requests to the autopilot."""
        self.belief = Belief(reach_of(plan.airframe), moved_s=STAYED_S)
        """Belief in the own motion."""
        self._doubt = Doubt(self._alerts)
        self.radio = RadioRoom(self._alerts)
        """Capacity of the radio to the autopilot."""
        self._held, self._held_s = math.nan, -math.inf
        self._satellite_m, self._satellite_s = math.nan, -math.inf
        self._through_air_s = 0.0
        self._reading: Reading | None = None
        self._refusal: str | None = None
        self._refusal_s = -math.inf
        self._passed_s = 0.0
        self.reboots = 0
        """Count of the autopilot's restarts, by its boot time."""
        self._counters: Counter[str] = Counter()
        self.sensors = SensorWatch()
        """Sensors and batteries as the autopilot reports them."""
        # An autopilot that holds a ground speed is sent no airspeed.
        self.air = AirMotion(
            plan,
            self.belief,
            self._alerts,
            calibrates=plan.airframe.hold == "heading-hold" and not self._blind,
        )
        """Motion through the air, by the autopilot's sensors."""
        self._state: VehicleState | None = None
        self._velocity_error: VelocityError | None = None
        self._period = self._nominal_period
        self._delay_compensator: DelayCompensator | None = None
        self.retune(plan)

    def retune(self, plan: FlightPlan) -> None:
        """Use another response of the same vehicle; what was learned of it is kept."""
        self.air.retune(plan)
        airframe = plan.airframe
        memory = memory_of(
            slips=plan.slips,
            speed_hold=airframe.speed_hold,
            course_bandwidth=plan.softness.course * bearable_course(plan),
        )
        if airframe.is_ideal:
            self._delay_compensator = None
        elif self._delay_compensator is None:
            self._delay_compensator = DelayCompensator(airframe, memory=memory)
        else:
            self._delay_compensator.retune(airframe, memory)

    @property
    def course_offset(self) -> float:
        """Reported course minus believed course, rad: the autopilot's course hold acts on the former."""
        error = self._velocity_error
        if error is None:
            return 0.0
        sample = error.sample
        right = with_right_velocity(sample, error)
        return wrap_angle(
            math.atan2(sample.velocity_east, sample.velocity_north)
            - math.atan2(right.velocity_east, right.velocity_north)
        )

    def fault(self, now: float) -> str | None:
        """Return why no position is used, with the remedy; None if no reason is known.

        The autopilot's reports on its receiver and estimator take precedence over what its positions show.
        """
        said = self.belief.word.fault(now)
        if said is None and now - self._refusal_s <= RETURN_S:
            said = self._refusal
        return None if said is None else with_remedy(said)

    def note_setpoint(self, setpoint: Setpoint | None, now: float) -> None:
        """Note a setpoint that was sent; None if the vehicle is not steered."""
        self.air.asked = None if setpoint is None else setpoint.speed
        if self._delay_compensator is None:
            return
        if setpoint is None:
            self._delay_compensator.forget()
        else:
            self._delay_compensator.note(setpoint, now)

    def take(self, report: PositionReport, now: float) -> NavigatedState | None:
        """Return the navigated state of a position report; None if it is not newer, or not believed."""
        at = report.latitude_deg, report.longitude_deg
        reading, before = self._clock.read(report.boot_time_s, now, at), self._reading
        if reading is None:
            self._counters["boot time not believed"] += 1
            return None
        self._clock_watch.note(now)
        if reading.leap_s < 0.0:
            self.reboots += 1
            self._state = before = None
            self.belief.forget()
        previous, time_s = self._state, reading.time_s
        if not reading.is_newer:
            return None
        self._reading = reading
        sample = self._sample(report, time_s, now)
        believed = self._believe(report, sample, reading, before)
        self._doubt.note(believed, self.belief, now)
        if not believed.leads:
            self._refusal, self._refusal_s = believed.reason, now
            return None
        late = previous is not None and time_s <= previous.time_s
        if late or (previous is None and not believed.is_reported):
            return None
        interval = math.inf if previous is None else time_s - previous.time_s
        altitude = self._judge_altitude(report.altitude_amsl, reading.stamp_s)
        self._held, self._held_s = altitude, now
        used = replace(sample, height=altitude - self._frame.altitude_m)
        if not believed.by_place:
            used = replace(used, north=believed.north, east=believed.east)
        if previous is not None and not believed.by_velocity:
            state = self._through_air(previous, used, by_place=believed.by_place)
        else:
            state = self._by_report(used, believed, reading.slip_s(before))
            self.air.learn(report, state, interval, now)
        self._state = state
        if self._delay_compensator is not None:
            self._delay_compensator.observe(state)
        return NavigatedState(
            state=state,
            place=self._place(report, state, is_reported=believed.is_reported),
            period=self._period,
            interval=interval,
            altitude_amsl=altitude,
            satellite_m=self._satellite_m if now - self._satellite_s <= FRESH_S else math.nan,
            moved=believed.moved is not None,
            steerable=believed.life is not Life.DOUBTED,
            delay_compensator=self._delay_compensator,
            air_data=self.air.data(report, now) if believed.by_velocity else None,
        )

    def _by_report(self, sample: Sample, believed: Believed, slipped_s: float) -> VehicleState:
        """Return the state by the reported velocity and the believed place."""
        previous = self._state
        interval = math.inf if previous is None else sample.time_s - previous.time_s
        longest = max(interval, self._through_air_s)
        fresh = longest > GAP_S or believed.moved is not None or slipped_s > SLIP_S
        self._through_air_s = 0.0
        sample = self._with_right_velocity(sample, fresh=fresh, carried=not believed.by_place)
        if previous is None or fresh:
            self._period = self._nominal_period
            if math.isnan(sample.height):
                sample = replace(sample, height=0.0 if previous is None else previous.height)
            return first_state(sample)
        self._period += PERIOD_SHARE * (interval - self._period)
        step = navigate_blind if self._blind else navigate
        return step(previous, sample, self._filters)

    def _through_air(
        self, previous: VehicleState, sample: Sample, *, by_place: bool
    ) -> VehicleState:
        """Return the state by heading and airspeed, and by the place if it is believed."""
        self._through_air_s += sample.time_s - previous.time_s
        heading, airspeed = self.air.carried_on(previous)
        sample = replace(sample, heading=heading, airspeed=airspeed)
        if math.isnan(sample.height) and not by_place:
            sample = replace(sample, height=previous.height)
        if by_place:
            return navigate_blind(previous, sample, self._filters, by_course=False)
        return navigate_unseen(previous, sample, self._filters)

    def _with_right_velocity(self, sample: Sample, *, fresh: bool, carried: bool) -> Sample:
        """Return a sample with the velocity that its positions show, if the mission asks for it.

        A fresh filter restarts. A carried place was integrated from velocities and shows nothing of them.
        """
        time_constant, error = self._filters.velocity_s, self._velocity_error
        if time_constant == 0.0:
            return sample
        if fresh or carried or error is None or sample.time_s - error.sample.time_s > GAP_S:
            error = velocity_error_at_first(sample)
        else:
            error = velocity_error(error, sample, time_constant)
        self._velocity_error = error
        return with_right_velocity(sample, error)

    def _judge_altitude(self, altitude_amsl: float, time_s: float) -> float:
        """Return a reported altitude, m, or NaN while it is doubted; tell the pilot of changes."""
        height = self.belief.height
        before = height.doubted
        altitude = height.judge(altitude_amsl, time_s)
        if height.doubted is not before:
            self._alerts.say(
                "altitude",
                WARNING,
                "the altitude steps: not believed, the others are kept clear of at every height;"
                " check the barometer"
                if height.doubted
                else "the altitude is believed again, nothing to do",
            )
        return altitude

    def note(
        self,
        report: AirspeedReport
        | AttitudeReport
        | TimeReport
        | GpsReport
        | EstimatorReport
        | SensorsReport
        | BatteryReport
        | RadioReport,
        now: float,
    ) -> None:
        """Process a report other than a position."""
        match report:
            case AirspeedReport():
                # The state is believed, whatever reports are doubted.
                self.air.note_airspeed(report, now, self._state)
            case AttitudeReport():
                self.air.note_bank(report.bank, now)
            case TimeReport():
                asked_s = self.questions.answered(report.stamp)
                if asked_s is not None:
                    self._clock.answer(asked_s, report.autopilot_ns * NANOSECOND, now)
                    self._clock_watch.note(now)
            case BatteryReport():
                self.sensors.note_battery(report, now)
            case RadioReport():
                self.radio.note(report, now)
            case _:
                if isinstance(report, SensorsReport):
                    self.sensors.note(report, now)
                elif isinstance(report, GpsReport):
                    self._note_satellites(report, now)
                self.belief.word.take(report, now)

    def _note_satellites(self, report: GpsReport, now: float) -> None:
        """Compare the altitude by satellites with the one that the autopilot holds."""
        if self._state is None or now - self._held_s > GAP_S or report.fix_type < LEAST_FIX:
            return
        held = self._held + self._state.climb_rate * (now - self._held_s)
        self._satellite_m, self._satellite_s = report.altitude_amsl - held, now

    @property
    def counters(self) -> Counter[str]:
        """Reports that were not used, by reason."""
        return self._counters + self._doubt.counters + self.air.counters

    def _believe(
        self, report: PositionReport, sample: Sample, reading: Reading, before: Reading | None
    ) -> Believed:
        """Test a position report against everything known."""
        state, velocity = self._state, (sample.velocity_north, sample.velocity_east)
        if self._blind and state is not None:
            # An unused velocity cannot be wrong, and does not show where the vehicle goes.
            velocity = polar(state.ground_speed, state.course)
        self._passed_s += passed_s(before, reading)
        motion = ReportedMotion(
            time_s=self._passed_s,
            north=sample.north,
            east=sample.east,
            velocity_north=velocity[0],
            velocity_east=velocity[1],
        )
        slack_s = reading.slip_s(before)
        if before is not None:
            waited_s = reading.read_s - before.read_s
            waited_s -= reading.stamp_s - before.stamp_s
            slack_s = max(slack_s, waited_s if waited_s > WAIT_S else 0.0)
        place = (report.latitude_deg, report.longitude_deg)
        fault = self.belief.word.fault(reading.read_s)
        if state is None and place == (0.0, 0.0):
            fault = "a position of 0, 0"
        air = None if self._blind else self.air.velocity(report, state, reading.read_s)
        return self.belief.take(motion, air=air, fault=fault, slack_s=slack_s)

    def _place(
        self, report: PositionReport, state: VehicleState, *, is_reported: bool
    ) -> GeodeticPlace:
        if is_reported:
            north, east = self._frame.to_local(report.latitude_deg, report.longitude_deg)
            latitude, longitude = self._frame.shifted(
                report.latitude_deg, report.longitude_deg, state.north - north, state.east - east
            )
        else:
            latitude, longitude = self._frame.to_geodetic(state.north, state.east)
        # The others judge a doubted altitude by themselves.
        doubted = self.belief.height.doubted
        altitude = report.altitude_amsl if doubted else self._frame.altitude_m + state.height
        return GeodeticPlace(latitude_deg=latitude, longitude_deg=longitude, altitude_amsl=altitude)

    def _sample(self, report: PositionReport, time_s: float, now: float) -> Sample:
        """Return the report in the local frame, with heading and airspeed by the wind where it has none."""
        north, east = self._frame.to_local(report.latitude_deg, report.longitude_deg)
        velocity_north, velocity_east = report.velocity_north, report.velocity_east
        heading, airspeed = self.air.heading_and_airspeed(report, self._state, now)
        return Sample(
            time_s=time_s,
            north=north,
            east=east,
            velocity_north=velocity_north,
            velocity_east=velocity_east,
            heading=heading,
            airspeed=airspeed,
            climb_rate=report.climb_rate,
        )


def passed_s(before: Reading | None, reading: Reading) -> float:
    """Return the time that a vehicle can have flown since the previous reading, s; 0 for the first.

    Boot times show it unless they leap ahead, as no report is read before it was true.
    """
    if before is None:
        return 0.0
    told_s = reading.stamp_s - before.stamp_s
    return min(told_s, reading.read_s - before.time_s + WAIT_S)
