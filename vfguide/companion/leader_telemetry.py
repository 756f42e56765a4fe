"""Reception of a leader without a companion by one follower: MAVLink bytes in, its motion out.

What a companion tells over the link is inferred here: which messages to use, when they were true, whether
they can be true, turn rate and acceleration.
"""

import math
from collections.abc import Callable

from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.belief import Belief
from vfguide.companion.doubt import HeardVehicle
from vfguide.companion.plan import ForeignLeader
from vfguide.companion.witnesses import HeightWitnesses
from vfguide.frames import LocalFrame
from vfguide.guidance.airframe import bank_limited_turn_rate
from vfguide.guidance.leader_motion import (
    Observation,
    ObservedMotion,
    RateLimits,
    observed_at_first,
    observed_motion,
)
from vfguide.guidance.navigation import ReportedMotion, reach_of
from vfguide.guidance.other_clock import NANOSECOND, RADIO, OtherClock, Reading, TimeQuestions
from vfguide.mavlink.announcements import heartbeat, time_question
from vfguide.mavlink.codec import COMPANION_COMPONENT, Codec
from vfguide.mavlink.leader_messages import KINDS, Kind, LeaderCodec, LeaderReport
from vfguide.mavlink.reports import TimeReport
from vfguide.state import HeardState

BETTER_S = 3.0
"""Interval within which two messages of a kind make it regular, s; later the next best is used."""

NEVER = (-math.inf, -math.inf)
"""Times of the last two messages of a kind that was never received, s."""

LEAST_INTERVAL_S = 0.02
"""Minimum interval between messages, s: closer ones repeat the same."""

FORGOTTEN_S = 4.0
"""Silence after which turn rate and acceleration restart, s."""

STALE_S = 1.0
"""Latency of the leader's messages that is worth a text to the pilot, s."""

SAY_S = 1.0
"""Interval of heartbeats and time requests, s."""

OPEN = 8
"""Limit on open time requests."""

STAMPED_BY_AUTOPILOT: frozenset[Kind] = frozenset(
    {"GLOBAL_POSITION_INT", "GLOBAL_POSITION_INT_COV", "HIGH_LATENCY2"}
)
"""Messages stamped with the clock by which autopilots answer time requests. Programs beside them send
FOLLOW_TARGET. Their clocks may be seconds apart from it, which would look like a delay."""

FLIES_M_S = 3.0
"""Ground speed below which it stands on the ground, or hangs from a parachute, m/s."""

OTHERS_HEARD = 10
"""Reports of another system after which the pilot is told that the leader is not heard."""

LONGEST_S = 12.0
"""Longest interval between places from which a velocity is computed, s."""


class LeaderTelemetry(HeardVehicle):
    """Newest motion of a leader without a companion."""

    def __init__(
        self,
        leader: ForeignLeader,
        frame: LocalFrame,
        alerts: Alerts | None = None,
        *,
        moved_s: float,
        system_id: int,
        beside: Callable[[HeardState], HeightWitnesses] | None = None,
    ) -> None:
        """Begin with nothing heard; `beside` finds witnesses of an altitude.

        Reports from an impossible place must agree for `moved_s`, s, before they are believed.
        """
        super().__init__(
            Belief(reach_of(leader.airframe), moved_s=moved_s), alerts, "the leader", beside
        )
        self._leader = leader
        self._frame = frame
        self._codec = LeaderCodec(system_id=leader.system_id, icao_address=leader.icao_address)
        self.counters = self._codec.counters
        self._voice = Codec(system_id, COMPANION_COMPONENT)
        self._said_s = -math.inf
        self._questions = TimeQuestions(every_s=0.0, most_open=OPEN)
        self._clocks: dict[Kind, OtherClock] = {}
        self._heard_s: dict[Kind, tuple[float, float]] = {}
        self._kind: Kind | None = None
        self._reading: Reading | None = None
        airframe = leader.airframe
        self._limits = RateLimits(
            turn_rate=bank_limited_turn_rate(airframe.max_bank, airframe.airspeed_min),
            acceleration=2.0 * airframe.max_acceleration,
        )
        self._place: ReportedMotion | None = None
        self._unstamped: tuple[float, float] | None = None
        self._motion: ObservedMotion | None = None
        self._complained = False

    def take(self, data: bytes, now: float) -> bool:
        """Process a datagram; return whether it had a newer motion that is believed."""
        believed = False
        for report in self._codec.decode(data):
            if isinstance(report, TimeReport):
                self._answer(report, now)
            else:
                believed |= self._take(report, now)
        if self.newest is None and not self._complained:
            self._complain_of_others()
        return believed

    def _complain_of_others(self) -> None:
        """Tell the pilot if only another system is heard: most likely the configured number is wrong."""
        for system_id, count in self._codec.others.most_common(1):
            if count >= OTHERS_HEARD:
                self._complained = True
                self.tell(
                    f"is not heard, system {system_id} is: see whether leader.system_id and the connection"
                    " are right"
                )

    def say(self, now: float) -> bytes:
        """Return a heartbeat, and a time request, when they are due."""
        if now - self._said_s < SAY_S:
            return b""
        self._said_s = now
        messages = [heartbeat()]
        if self._leader.system_id is not None and (stamp := self._questions.ask(now)) is not None:
            messages.append(time_question(stamp))
        return self._voice.encode(messages)

    def _answer(self, report: TimeReport, now: float) -> None:
        asked_s = self._questions.answered(report.stamp)
        if asked_s is not None:
            for kind, clock in self._clocks.items():
                if kind in STAMPED_BY_AUTOPILOT:
                    clock.answer(asked_s, report.autopilot_ns * NANOSECOND, now)

    def _take(self, report: LeaderReport, now: float) -> bool:
        reading = self._read(report, now)
        if reading is None:
            return False
        self._heard_s[report.kind] = self._heard_s.get(report.kind, NEVER)[1], now
        if self._has_better(report.kind, now):
            self.counters["a better message comes"] += 1
            return False
        slip_s = reading.slip_s(self._reading) if report.kind == self._kind else 0.0
        restarted = reading.leap_s != 0.0 or slip_s > RADIO.late_s
        if restarted or report.kind != self._kind:
            self._begin(report.kind, restarted=restarted)
        self._reading = reading
        self._tell_of_lateness(now - reading.time_s)
        return self._judge(report, reading, slip_s)

    def _read(self, report: LeaderReport, now: float) -> Reading | None:
        """Return when a report was true; None if that cannot be known, or it says nothing new."""
        place = report.latitude_deg, report.longitude_deg
        clock = self._clocks.get(report.kind)
        if clock is None:
            clock = OtherClock(RADIO, least_way_s=self._leader.least_delay_s)
            self._clocks[report.kind] = clock
        if report.stamp_s is None:
            time_s = now - report.age_s - clock.least_way_s
            reading: Reading | None = Reading(time_s=time_s, stamp_s=time_s, read_s=now)
        else:
            reading = clock.read(report.stamp_s, now, place)
            self._tell_of_stamps(report.kind, clock.fault)
        if reading is None:
            self.counters["time stamp not believed"] += 1
            return None
        if report.stamp_s is None or clock.fault is not None:
            if place == self._unstamped:
                # A receiver that repeats a position says nothing new about the aircraft's place now.
                self.counters["repeated"] += 1
                return None
            self._unstamped = place
        if not reading.is_newer:
            self.counters["not newer"] += 1
            return None
        return reading

    def _tell_of_stamps(self, kind: Kind, fault: str | None) -> None:
        if self.turns(f"stamps of {kind}", holds=fault is not None):
            self.tell(
                "sends time stamps that tell time again: followed by them, nothing to do"
                if fault is None
                else f"sends time stamps that {fault}: followed by when its messages arrive, later by"
                " what they are under way; set its clock, or leader.least_delay_s"
            )

    def _has_better(self, kind: Kind, now: float) -> bool:
        """Check whether a better kind of message arrives regularly."""
        coming = [one for one in KINDS if now - self._heard_s.get(one, NEVER)[0] <= BETTER_S]
        return bool(coming) and coming[0] != kind

    def _begin(self, kind: Kind, *, restarted: bool) -> None:
        """Begin anew with times on another clock, to which earlier times have no relation."""
        self._kind, self._place, self._motion = kind, None, None
        self.belief.forget()
        if restarted:
            self.tell("has another clock, as after a restart: followed by that from now on")

    def _tell_of_lateness(self, age_s: float) -> None:
        if not 0.5 * STALE_S <= age_s <= STALE_S and self.turns("late", holds=age_s > STALE_S):
            self.tell(
                f"is heard {age_s:.1f} s late: its turns show by that later; see to the radio"
                if age_s > STALE_S
                else "is heard in time again: nothing to do"
            )

    def _flies(self, speed: float) -> bool:
        """Check whether the leader flies, and tell the pilot of changes."""
        stands = speed < FLIES_M_S
        if self.turns("stands", holds=stands):
            self.tell(
                f"does not fly (less than {FLIES_M_S:g} m/s over ground): not followed until it does"
                if stands
                else "flies: followed, nothing to do"
            )
        return not stands

    def _judge(self, report: LeaderReport, reading: Reading, slip_s: float) -> bool:
        """Check whether a report can be true after those before; `slip_s` is its clock's loss since, s."""
        north, east = self._frame.to_local(report.latitude_deg, report.longitude_deg)
        velocity = report.velocity or self._velocity_between(north, east, reading)
        if velocity is None:
            return False
        motion = ReportedMotion(reading.stamp_s, north, east, *velocity)
        if self._place is not None and motion.time_s - self._place.time_s < LEAST_INTERVAL_S:
            self.counters["not newer"] += 1
            return False
        self._place = motion
        said = HeardState(
            time_s=reading.time_s,
            north=north,
            east=east,
            course=math.atan2(velocity[1], velocity[0]),
            ground_speed=motion.speed,
            acceleration=0.0,
            turn_rate=0.0,
            turn_acceleration=0.0,
            altitude_amsl=report.altitude_amsl,
            height=report.altitude_amsl - self._frame.altitude_m,
            climb_rate=report.climb_rate,
            # The formation follows it in any case, and no other leader is better known.
            steered=True,
        )
        believed = self.believe(motion, said, max(slip_s, 0.0))
        if believed is None:
            return False
        if not self._flies(motion.speed):
            self.counters["not flying"] += 1
            return False
        self._motion = self._observed(report, motion)
        state = self._motion.state
        self.newest = replace(
            believed,
            north=state.north,
            east=state.east,
            course=state.course,
            ground_speed=state.ground_speed,
            acceleration=state.acceleration,
            turn_rate=state.turn_rate,
            turn_acceleration=state.turn_acceleration,
        )
        return True

    def _velocity_between(
        self, north: float, east: float, reading: Reading
    ) -> tuple[float, float] | None:
        """Return the velocity for a report without one: as last observed, else between places; or None."""
        if self._motion is not None:
            state = self._motion.state
            age_s = reading.stamp_s - state.time_s
            if age_s <= FORGOTTEN_S:
                course = state.course + state.turn_rate * age_s
                return state.ground_speed * math.cos(course), state.ground_speed * math.sin(course)
            # The turns that it has flown since are not known.
            self._motion = None
        before = self._place
        interval_s = math.inf if before is None else reading.stamp_s - before.time_s
        if before is None or not LEAST_INTERVAL_S <= interval_s <= LONGEST_S:
            if interval_s > LONGEST_S:
                self.belief.forget()
            self._place = ReportedMotion(reading.stamp_s, north, east, 0.0, 0.0)
            return None
        return (north - before.north) / interval_s, (east - before.east) / interval_s

    def _observed(self, report: LeaderReport, motion: ReportedMotion) -> ObservedMotion:
        """Return the observed motion after a report that is believed."""
        seen = Observation(
            time_s=motion.time_s, north=motion.north, east=motion.east, velocity=report.velocity
        )
        before = self._motion
        if before is None or not 0.0 < motion.time_s - before.state.time_s <= FORGOTTEN_S:
            course = math.atan2(motion.velocity_east, motion.velocity_north)
            return observed_at_first(seen, course, motion.speed)
        return observed_motion(before, seen, self._limits, self._leader.rate_filter_s)
