"""Identification flight of a vehicle: a companion with a role that flies steps.

As in any flight, the companion decides who may steer, checks telemetry, hands back and informs the pilot.
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
"""Maximum time without valid telemetry before the flight ends, s."""

HEIGHT_M = 30.0
"""Maximum height change before the flight ends, m."""

STEERING = "identification: small steps of course and speed; leave the guided mode to take over"
"""Message to the pilot when the steps begin."""


class Stage(Enum):
    """Stage of the flight."""

    WAITING = "waiting for the guided mode"
    FLYING = "flying steps"
    DONE = "done"
    ENDED = "ended before its time"
    """Ended by the pilot, or for the reason in the events."""

    @property
    def is_over(self) -> bool:
        """Whether the flight is over."""
        return self in {Stage.DONE, Stage.ENDED}


class StepsRole(Role):
    """Role of a vehicle that flies steps and records its response."""

    def __init__(self, plan: FlightPlan, repeats: int) -> None:
        """Create a role that flies each group of steps `repeats` times, at the airframe's cruise."""
        self.stage = Stage.WAITING
        self.ended: str | None = None
        """Why the flight ended early; None unless it did."""
        self.recording = StepsRecording(plan.airframe)
        self._cruise = plan.airframe.cruise
        self._segments = segments(plan.airframe, repeats)
        self._began = self._base = self._height = self._time = math.nan
        self._counters: Counter[str] = Counter()

    @property
    def counters(self) -> Counter[str]:
        """Link counters, always empty: nothing arrives over the link."""
        return self._counters

    @property
    def progress(self) -> float:
        """Completed share of the steps, 0 to 1."""
        if self.stage is Stage.DONE:
            return 1.0
        total = sum(one.duration_s for one in self._segments)
        elapsed = self._time - self._began
        return min(max(elapsed / total, 0.0), 1.0) if math.isfinite(elapsed) else 0.0

    def end(self, why: str) -> None:
        """End the flight early."""
        if not self.stage.is_over:
            self.stage, self.ended = Stage.ENDED, why

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """Return the current setpoint; straight on before and after the steps."""
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
            # Never in place, so that the pilot hears that it is steered.
            distance=math.inf,
            lyapunov=math.nan,
            publish=None,
            height=self._height if math.isfinite(self._height) else state.height,
        )

    def _bank(self, time_s: float, data: ReportedAirData) -> Bank:
        """Return the slip data of a report, with the leg of the flight it belongs to."""
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
        """Return the segment after a time, s; None at the end."""
        for segment in self._segments:
            if elapsed_s < segment.duration_s:
                return segment
            elapsed_s -= segment.duration_s
        return None

    def retune(self, plan: FlightPlan) -> None:
        """Ignore a new response: the steps stay the same."""
        del plan

    def receive(self, data: bytes, now: float) -> None:
        """Ignore leader states: the vehicle follows nobody."""
        del data, now

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Ignore neighbours: the vehicle is alone, since the crew has cleared the sky."""
        del vehicle, data, now

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Ignore traffic: the crew has cleared the sky."""
        del report, now

    def lose_link(self, now: float) -> None:
        """Do nothing: there is no link."""
        del now

    def to_leader(self, now: float) -> bytes:
        """Return no message: the vehicle follows nobody."""
        del now
        return b""

    def leader_age(self, now: float) -> float:
        """Return 0: the vehicle needs no leader."""
        del now
        return 0.0


class Identification:
    """Flies the steps of one vehicle and records its response."""

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
        """Create a flight of the plan's vehicle, at its airframe's cruise.

        Args:
            plan: plan of the vehicle.
            adapter: adapter of its autopilot.
            engage: whether to put the autopilot into the guided mode, once in a flight.
            repeats: number of repetitions of each group of steps.
            signing: signing of the connection to the autopilot, or None.
            consent: keeps the flight's consent over restarts; by default it ends with this object.
        """
        self._role = StepsRole(plan, repeats)
        self._companion = Companion(
            # The steps are flown at the initial height, with the response that the mission declares.
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
        """Stage of the flight."""
        return self._role.stage

    @property
    def ended(self) -> str | None:
        """Why the flight ended early; None unless it did."""
        return self._role.ended

    @property
    def recording(self) -> StepsRecording:
        """Recording so far."""
        return self._role.recording

    @property
    def progress(self) -> float:
        """Completed share of the steps, 0 to 1."""
        return self._role.progress

    def obstacle(self, now: float) -> str | None:
        """Return what prevents flying now, as a message; None if nothing does."""
        return self._companion.obstacle(now)

    @property
    def released(self) -> bool:
        """Whether the flight is over and the vehicle, if steered, was seen to fly by itself."""
        return self._is_stopped and self._companion.released

    def receive(self, data: bytes, now: float) -> Outgoing:
        """Handle one datagram from the autopilot."""
        return self._watched(self._companion.receive_mavlink(data, now), now)

    def poll(self, now: float) -> Outgoing:
        """Perform periodic duties; to be called every tenth of a second or so."""
        return self._watched(self._companion.poll(now), now)

    def stop(self, now: float) -> Outgoing:
        """Stop for the operator; keep calling `receive` and `poll` until `released`."""
        self._role.end("stopped")
        return self._watched(Outgoing(), now)

    def tell(self, text: str, now: float) -> Outgoing:
        """Tell operator and pilot about something that the surrounding program found."""
        return self._companion.tell(text, now)

    def _watched(self, out: Outgoing, now: float) -> Outgoing:
        """Record and judge the flight after an output; append the final messages once it is over."""
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
        """End the flight after a step without steering, if the pilot took over or telemetry is silent."""
        mode = self._companion.snapshot.mode
        if mode is Mode.PILOT:
            self._role.end("the pilot has taken over: nothing more is sent")
        elif now - self._steered_time > SILENCE_S:
            self._role.end("nothing to steer by for 2 s: telemetry is silent, or not believed")
