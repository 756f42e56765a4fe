"""The flight that identifies a vehicle: a companion whose part is to fly steps.

Who may steer, what is believed, how it is handed back and what the pilot hears is the companion's, as in
any flight.
"""

import math
from collections import Counter
from enum import Enum
from itertools import accumulate

from msgspec.structs import replace

from vfguide.companion.air_motion import ReportedAirData
from vfguide.companion.alerts import Event
from vfguide.companion.consent import ConsentStore
from vfguide.companion.core import Companion
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import Outgoing, Role, RoleStep
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import wrap_angle
from vfguide.identification.recording import Segment, StepsRecording, segments
from vfguide.identification.slip import Bank
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.framing import ConnectionSigning
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import Setpoint

SILENCE_S = 2.0
"""Nothing to steer by for longer ends the flight."""

HEIGHT_M = 30.0
"""So does a vehicle that climbs or sinks by more than this."""

STEERING = "identification: small steps of course and speed; leave the guided mode to take over"
"""What the pilot hears once they begin."""


class Stage(Enum):
    """How far the flight is."""

    WAITING = "waiting for the guided mode"
    """Not engaged yet."""
    FLYING = "flying steps"
    """Setpoints go out."""
    DONE = "done"
    """All steps were flown."""
    ENDED = "ended before its time"
    """By the pilot, or for what the events say."""

    @property
    def is_over(self) -> bool:
        """Whether nothing more will be flown."""
        return self in {Stage.DONE, Stage.ENDED}


class StepsRole(Role):
    """The part of a vehicle that flies steps, and records what it does."""

    def __init__(self, plan: FlightPlan, repeats: int) -> None:
        """Make one that has flown nothing yet.

        Args:
            plan: of the vehicle; its airframe's cruise is what is flown.
            repeats: how often each group of steps is flown.
        """
        self.stage = Stage.WAITING
        self.ended: str | None = None
        """Why the flight ended before its time; None while and where it did not."""
        self.recording = StepsRecording(plan.airframe)
        self._cruise = plan.airframe.cruise
        self._segments = segments(plan.airframe, repeats)
        self._began = self._base = self._height = self._time = math.nan
        self._counters: Counter[str] = Counter()

    @property
    def counters(self) -> Counter[str]:
        """Nothing comes over the link."""
        return self._counters

    @property
    def progress(self) -> float:
        """Share of the steps that is behind, 0 to 1."""
        if self.stage is Stage.DONE:
            return 1.0
        total = sum(one.duration_s for one in self._segments)
        elapsed = self._time - self._began
        return min(max(elapsed / total, 0.0), 1.0) if math.isfinite(elapsed) else 0.0

    def end(self, why: str) -> None:
        """End the flight before its time."""
        if not self.stage.is_over:
            self.stage, self.ended = Stage.ENDED, why

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """The setpoint of this moment; before and after the steps straight on."""
        state = navigated.state
        self._time = state.time_s
        if self.stage is Stage.WAITING and mode.steers:
            self.stage = Stage.FLYING
            self._began, self._base, self._height = state.time_s, state.course, state.height
        course, speed = state.course, self._cruise
        if self.stage is Stage.FLYING and mode.steers:
            segment = self._segment(state.time_s - self._began)
            if abs(state.height - self._height) > HEIGHT_M:
                self.end("the height was left")
            elif segment is None:
                self.stage = Stage.DONE
            else:
                course, speed = wrap_angle(self._base + segment.course), segment.speed
                self.recording.note(state, segment)
                if navigated.air_data is not None:
                    self.recording.banks.note(self._bank(state.time_s, navigated.air_data))
        return RoleStep(
            setpoint=Setpoint(course=course, speed=speed),
            # Never in place: the pilot hears that it is steered.
            distance=math.inf,
            lyapunov=math.nan,
            publish=None,
            height=self._height if math.isfinite(self._height) else state.height,
        )

    def _bank(self, time_s: float, data: ReportedAirData) -> Bank:
        """What a report tells of slip, and on which leg of the flight it was."""
        ends = accumulate(one.duration_s for one in self._segments)
        return Bank(
            time_s=time_s,
            leg=sum(time_s - self._began >= end for end in ends),
            heading=data.heading,
            bank=data.bank,
            airspeed=data.airspeed,
            velocity_north=data.velocity_north,
            velocity_east=data.velocity_east,
        )

    def _segment(self, elapsed_s: float) -> Segment | None:
        """What is flown after a time; None at the end."""
        for segment in self._segments:
            if elapsed_s < segment.duration_s:
                return segment
            elapsed_s -= segment.duration_s
        return None

    def retune(self, plan: FlightPlan) -> None:
        """Steps are the same by whatever response."""
        del plan

    def receive(self, data: bytes, now: float) -> None:
        """It follows nobody."""
        del data, now

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """It is alone: the crew has cleared the sky."""
        del vehicle, data, now

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """As with neighbours."""
        del report, now

    def lose_link(self, now: float) -> None:
        """It has none."""
        del now

    def to_leader(self, now: float) -> bytes:
        """It follows nobody."""
        del now
        return b""

    def leader_age(self, now: float) -> float:
        """It needs no leader."""
        del now
        return 0.0


class Identification:
    """Flies the steps of one vehicle, and records what it does."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        *,
        engage: bool,
        repeats: int,
        signing: ConnectionSigning | None = None,
        consent: ConsentStore | None = None,
    ) -> None:
        """Make a flight that has heard nothing yet.

        Args:
            plan: of the vehicle; its airframe's cruise is what is flown.
            adapter: how to speak to its autopilot.
            engage: whether it may put the autopilot into the guided mode by itself, once in a flight.
            repeats: how often each group of steps is flown.
            signing: of the connection to the autopilot, if it is signed.
            consent: keeps what was agreed for the flight over restarts; forgotten with this object if absent.
        """
        self._role = StepsRole(plan, repeats)
        self._companion = Companion(
            # It flies at the height at which it begins, by what the mission declares.
            replace(plan, asks_response=False, lead=None, lowest=-math.inf, learns=False),
            adapter,
            engage=engage,
            consent=consent,
            signing=signing,
            role=lambda *_: self._role,
        )
        self._steered_time = math.inf
        self._is_stopped = False

    @property
    def stage(self) -> Stage:
        """How far the flight is."""
        return self._role.stage

    @property
    def ended(self) -> str | None:
        """Why the flight ended before its time; None while and where it did not."""
        return self._role.ended

    @property
    def recording(self) -> StepsRecording:
        """What was flown so far."""
        return self._role.recording

    @property
    def progress(self) -> float:
        """Share of the steps that is behind, 0 to 1."""
        return self._role.progress

    def obstacle(self, now: float) -> str | None:
        """What would keep it from flying now, in words; None where nothing would."""
        return self._companion.obstacle(now)

    @property
    def released(self) -> bool:
        """Whether nothing is flown any more, and the vehicle is seen to fly by itself if it was steered."""
        return self._is_stopped and self._companion.released

    def receive(self, data: bytes, now: float) -> Outgoing:
        """Take one datagram from the autopilot."""
        return self._watched(self._companion.receive_mavlink(data, now), now)

    def poll(self, now: float) -> Outgoing:
        """What is due by time alone; to be called every tenth of a second or so."""
        return self._watched(self._companion.poll(now), now)

    def stop(self, now: float) -> Outgoing:
        """The operator has had enough; then bytes and calls of `poll` are to go on until `released`."""
        self._role.end("stopped")
        return self._watched(Outgoing(), now)

    def tell(self, text: str, now: float) -> Outgoing:
        """Tell operator and pilot something that the program around it has found."""
        return self._companion.tell(text, now)

    def _watched(self, out: Outgoing, now: float) -> Outgoing:
        """An answer, with what the flight has come to; the last words once it is over."""
        if out.steered:
            if self._steered_time == math.inf and not self.stage.is_over:
                self._add(out, self._companion.tell(STEERING, now, warning=False))
            self._steered_time = now
            setpoint = self._companion.snapshot.setpoint
            if self.stage is Stage.FLYING and setpoint is not None:
                self.recording.note_setpoint(now, setpoint.course, setpoint.speed)
        elif self.stage is Stage.FLYING:
            self._judge_silence(now)
        if not self.stage.is_over or self._is_stopped:
            return out
        self._is_stopped = True
        text = "all steps flown" if self.ended is None else self.ended
        out.events.append(Event(time_s=now, text=text, warning=self.ended is not None))
        self._add(out, self._companion.stop(now))
        return out

    def _add(self, out: Outgoing, more: Outgoing) -> None:
        out.to_autopilot += more.to_autopilot
        out.events += more.events

    def _judge_silence(self, now: float) -> None:
        """Nothing was flown by what has just arrived, or by time alone."""
        mode = self._companion.snapshot.mode
        if mode is Mode.PILOT:
            self._role.end("the pilot has taken over: nothing more is sent")
        elif now - self._steered_time > SILENCE_S:
            self._role.end("nothing to steer by for 2 s: telemetry is silent, or not believed")
