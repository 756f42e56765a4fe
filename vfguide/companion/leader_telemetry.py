"""A leader without a companion, as one follower hears it: MAVLink bytes in, its motion out.

What a leader's companion tells of itself over the link is found out here: which of the messages to go by,
when they were true, whether they can be true, turn rate and acceleration.
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
"""Two messages of a kind within this, and it comes again and again; after it the next best is followed."""

NEVER = (-math.inf, -math.inf)
"""When the last two messages of a kind came that has not come."""

LEAST_INTERVAL_S = 0.02
"""Messages that come closer than this say the same twice."""

FORGOTTEN_S = 4.0
"""After a longer silence the rates start anew."""

STALE_S = 1.0
"""A leader that is heard later than this is worth a text to the pilot."""

SAY_S = 1.0
"""Interval of heartbeats for it, and of questions."""

OPEN = 8
"""Questions that an answer is awaited for."""

STAMPED_BY_AUTOPILOT: frozenset[Kind] = frozenset(
    {"GLOBAL_POSITION_INT", "GLOBAL_POSITION_INT_COV", "HIGH_LATENCY2"}
)
"""What autopilots send with the clock that they answer questions by. FOLLOW_TARGET is sent by programs beside
them, whose clocks may be seconds apart from it: that would look like a delay."""

FLIES_M_S = 3.0
"""Over ground: slower than this it stands on the ground, or hangs from a parachute."""

OTHERS_HEARD = 10
"""Reports of another system, before it is told that the leader is not heard."""

LONGEST_S = 12.0
"""From one place to the next, where velocities are not told: a longer way says nothing of the course."""


class LeaderTelemetry(HeardVehicle):
    """The newest motion of one aircraft."""

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
        """Make it, with nothing heard yet.

        Args:
            leader: who is listened for, and what it can do.
            frame: the formation's local frame.
            alerts: takes what a pilot should know.
            moved_s: for how long reports from where it cannot be have to agree before they are believed.
            system_id: of one's own vehicle.
            beside: finds what there is beside the altitude of a state.
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
        """Take a datagram; whether it had a newer motion that can be true."""
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
        """Tell the pilot when others are heard there, and it is not: most likely its number is another."""
        for system_id, count in self._codec.others.most_common(1):
            if count >= OTHERS_HEARD:
                self._complained = True
                self.tell(
                    f"is not heard, system {system_id} is: see whether leader.system_id and the connection"
                    " are right"
                )

    def say(self, now: float) -> bytes:
        """What it is told, now and then: that somebody listens, and a question for its time."""
        if now - self._said_s < SAY_S:
            return b""
        self._said_s = now
        messages = [heartbeat()]
        if self._leader.system_id is not None and (stamp := self._questions.ask(now)) is not None:
            messages.append(time_question(stamp))
        return self._voice.encode(messages)

    def _answer(self, report: TimeReport, now: float) -> None:
        """It says what its clock shows."""
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
        """When a report was true; None where that cannot be known, or it says nothing new."""
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
                # A receiver that repeats a position says nothing new about where the aircraft is now.
                self.counters["repeated"] += 1
                return None
            self._unstamped = place
        if not reading.is_newer:
            self.counters["not newer"] += 1
            return None
        return reading

    def _tell_of_stamps(self, kind: Kind, fault: str | None) -> None:
        """Tell the pilot of stamps that tell no time, and that they do again."""
        if self.turns(f"stamps of {kind}", holds=fault is not None):
            self.tell(
                "sends time stamps that tell time again: followed by them, nothing to do"
                if fault is None
                else f"sends time stamps that {fault}: followed by when its messages arrive, later by"
                " what they are under way; set its clock, or leader.least_delay_s"
            )

    def _has_better(self, kind: Kind, now: float) -> bool:
        """Whether another kind of message is to be followed: the best that comes again and again."""
        coming = [one for one in KINDS if now - self._heard_s.get(one, NEVER)[0] <= BETTER_S]
        return bool(coming) and coming[0] != kind

    def _begin(self, kind: Kind, *, restarted: bool) -> None:
        """From here on times are on another clock: nothing before them says how long ago it was."""
        self._kind, self._place, self._motion = kind, None, None
        self.belief.forget()
        if restarted:
            self.tell("has another clock, as after a restart: followed by that from now on")

    def _tell_of_lateness(self, age_s: float) -> None:
        """Tell the pilot when it is heard late, and when it is not any more."""
        if not 0.5 * STALE_S <= age_s <= STALE_S and self.turns("late", holds=age_s > STALE_S):
            self.tell(
                f"is heard {age_s:.1f} s late: its turns show by that later; see to the radio"
                if age_s > STALE_S
                else "is heard in time again: nothing to do"
            )

    def _flies(self, speed: float) -> bool:
        """Whether it flies, which the pilot is told of."""
        stands = speed < FLIES_M_S
        if self.turns("stands", holds=stands):
            self.tell(
                f"does not fly (less than {FLIES_M_S:g} m/s over ground): not followed until it does"
                if stands
                else "flies: followed, nothing to do"
            )
        return not stands

    def _judge(self, report: LeaderReport, reading: Reading, slip_s: float) -> bool:
        """Whether a report can be true, after those before and what its clock has lost since, s."""
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
            # The formation flies as it does, and is no surer of any other leader.
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
        """The velocity of a report that tells none: as observed a moment ago, else from the place before."""
        if self._motion is not None:
            state = self._motion.state
            age_s = reading.stamp_s - state.time_s
            if age_s <= FORGOTTEN_S:
                course = state.course + state.turn_rate * age_s
                return state.ground_speed * math.cos(course), state.ground_speed * math.sin(course)
            # Nobody knows which turns it has flown since.
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
        """What is known of the motion after a report that is believed."""
        seen = Observation(
            time_s=motion.time_s,
            north=motion.north,
            east=motion.east,
            velocity=report.velocity,
        )
        before = self._motion
        if before is None or not 0.0 < motion.time_s - before.state.time_s <= FORGOTTEN_S:
            course = math.atan2(motion.velocity_east, motion.velocity_north)
            return observed_at_first(seen, course, motion.speed)
        return observed_motion(before, seen, self._limits, self._leader.rate_filter_s)
