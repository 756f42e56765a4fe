"""The flight that identifies a vehicle: bytes from its autopilot in, bytes for it out."""

import math
from dataclasses import dataclass, field
from enum import Enum

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import Event
from vfguide.companion.steering import TrackingMonitor
from vfguide.elementwise import wrap_angle
from vfguide.identification.recording import Phase, Recording, Segment, segments
from vfguide.mavlink.adapter import AutopilotAdapter, AutopilotSetpoint
from vfguide.mavlink.announcements import NOTICE, Acknowledgements, heartbeat, status_texts
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.reports import (
    AirspeedReport,
    CommandReport,
    HeartbeatReport,
    PositionReport,
    Report,
    TextReport,
    VersionReport,
)
from vfguide.state import Setpoint

HEARTBEAT_S = 1.0
SILENCE_S = 2.0
"""Telemetry that is silent for longer ends the flight."""

HEIGHT_M = 30.0
"""So does a vehicle that climbs or sinks by more than this."""

RATE_SHARE = 0.7
WARNING = 4


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


@dataclass(slots=True)
class Answer:
    """What a call leads to."""

    to_autopilot: bytes = b""
    """One datagram."""
    events: list[Event] = field(default_factory=list)
    """For the operator."""


class Identification:
    """Flies the steps of one vehicle, and records what it does."""

    def __init__(
        self, plan: FlightPlan, adapter: AutopilotAdapter, *, engage: bool, repeats: int
    ) -> None:
        """Make a flight that has heard nothing yet.

        Args:
            plan: of the vehicle; its airframe's cruise is what is flown.
            adapter: how to speak to its autopilot.
            engage: whether it may put the autopilot into the guided mode by itself, once.
            repeats: how often each group of steps is flown.
        """
        self.stage = Stage.WAITING
        self.recording = Recording(plan.airframe)
        self._plan = plan
        self._adapter = adapter
        self._may_engage = engage
        self._codec = Codec(plan.system_id, plan.component_id)
        self._own = OwnVehicle(plan)
        self._commands = Acknowledgements()
        self._tracking = TrackingMonitor(plan.airframe)
        self._segments = segments(plan.airframe, repeats)
        self._began = self._base = self._height = math.nan
        self._engaged = self._armed = self._connected = False
        self._stranger: str | None = None
        self._telemetry_time = self._housekeeping_time = -math.inf
        self._interval = math.inf

    @property
    def progress(self) -> float:
        """Share of the steps that is behind, 0 to 1."""
        if self.stage is Stage.DONE:
            return 1.0
        total = sum(one.duration_s for one in self._segments)
        elapsed = self._telemetry_time - self._began
        return min(max(elapsed / total, 0.0), 1.0) if math.isfinite(elapsed) else 0.0

    def receive(self, data: bytes, now: float) -> Answer:
        """Take one datagram from the autopilot."""
        answer = Answer()
        messages: list[MAVLink_message] = []
        for report in self._codec.decode(data):
            messages += self._take(report, now, answer)
        return self._answered(answer, messages, now)

    def poll(self, now: float) -> Answer:
        """What is due by time alone; to be called every tenth of a second or so."""
        answer = Answer()
        messages: list[MAVLink_message] = []
        if self.stage is Stage.FLYING and now - self._telemetry_time > SILENCE_S:
            messages = self._end("the telemetry is silent", now, answer)
        return self._answered(answer, messages, now)

    def stop(self, now: float) -> Answer:
        """The operator has had enough: hand back, if it is flying."""
        answer = Answer()
        messages: list[MAVLink_message] = []
        if self.stage is Stage.FLYING:
            messages = self._end("stopped", now, answer)
        elif self.stage is Stage.WAITING:
            self.stage = Stage.ENDED
        answer.to_autopilot = self._codec.encode(messages)
        return answer

    def _answered(self, answer: Answer, messages: list[MAVLink_message], now: float) -> Answer:
        messages += self._housekeeping(now, answer)
        self._commands.sent(messages, now)
        answer.to_autopilot = self._codec.encode(messages)
        return answer

    def _take(self, report: Report, now: float, answer: Answer) -> list[MAVLink_message]:
        match report:
            case PositionReport():
                navigated = self._own.take(report, now)
                return [] if navigated is None else self._fly(navigated, now, answer)
            case AirspeedReport():
                self._own.note_airspeed(report.airspeed, now)
            case HeartbeatReport():
                return self._note_mode(report, now, answer)
            case CommandReport():
                say(answer, now, self._commands.answered(report, now), warning=True)
                say(answer, now, self._adapter.hear(report))
            case VersionReport():
                say(answer, now, self._adapter.hear(report))
            case TextReport():
                say(
                    answer,
                    now,
                    f"autopilot: {report.text}",
                    warning=report.severity <= WARNING,
                )
        return []

    def _note_mode(
        self, report: HeartbeatReport, now: float, answer: Answer
    ) -> list[MAVLink_message]:
        self._connected, self._armed = True, report.armed
        complaint = self._adapter.recognise(report.autopilot)
        if complaint != self._stranger:
            say(answer, now, complaint, warning=True)
        self._stranger = complaint
        self._engaged = complaint is None and self._adapter.is_engaged(report.custom_mode)
        if self.stage is Stage.FLYING and not self._engaged:
            self.stage = Stage.ENDED
            say(answer, now, "the pilot has taken over: nothing more is sent", warning=True)
        return []

    def _fly(self, navigated: NavigatedState, now: float, answer: Answer) -> list[MAVLink_message]:
        """The setpoint of this moment, and a look at what the vehicle does."""
        self._telemetry_time, self._interval = now, navigated.interval
        state = navigated.state
        if self.stage is Stage.WAITING:
            if not self._engaged or self._stranger is not None:
                cruise = self._plan.airframe.cruise
                return self._adapter.stay_ready(self._asked(state.course, cruise, navigated))
            self._began, self._base = state.time_s, state.course
            self._height = navigated.place.altitude_amsl
            self.stage = Stage.FLYING
            say(answer, now, "engaged: flying the steps")
        if self.stage is not Stage.FLYING:
            return []
        if abs(navigated.place.altitude_amsl - self._height) > HEIGHT_M:
            return self._end("the height was left", now, answer)
        segment = self._segment(state.time_s - self._began)
        if segment is None:
            self.stage = Stage.DONE
            say(answer, now, "all steps flown: handing back")
            return self._adapter.hand_back()
        course = wrap_angle(self._base + segment.course)
        self.recording.note(state, segment)
        self.recording.note_setpoint(now, course, segment.speed)
        setpoint = Setpoint(course=course, speed=segment.speed, limited=False)
        if segment.phase is not Phase.SETTLE:
            say(answer, now, self._tracking.watch(state, setpoint), warning=True)
        return self._adapter.fly(self._asked(course, segment.speed, navigated))

    def _asked(self, course: float, speed: float, navigated: NavigatedState) -> AutopilotSetpoint:
        """A course and a speed at the height at which the flight began."""
        began = math.isfinite(self._height)
        return AutopilotSetpoint(
            course=course,
            speed=speed,
            altitude_amsl=self._height if began else navigated.place.altitude_amsl,
            latitude_deg=navigated.place.latitude_deg,
            longitude_deg=navigated.place.longitude_deg,
        )

    def _segment(self, elapsed_s: float) -> Segment | None:
        """What is flown after a time; None at the end."""
        for segment in self._segments:
            if elapsed_s < segment.duration_s:
                return segment
            elapsed_s -= segment.duration_s
        return None

    def _end(self, why: str, now: float, answer: Answer) -> list[MAVLink_message]:
        self.stage = Stage.ENDED
        say(answer, now, f"{why}: handing back", warning=True)
        return self._adapter.hand_back()

    def _housekeeping(self, now: float, answer: Answer) -> list[MAVLink_message]:
        """Heartbeat, telemetry, and the guided mode if it may be asked for."""
        if now - self._housekeeping_time < HEARTBEAT_S:
            return []
        self._housekeeping_time = now
        messages = [heartbeat()]
        for text in self._commands.overdue(now):
            say(answer, now, text, warning=True)
        rate_hz = self._plan.rate_hz
        if self._connected and self._interval * rate_hz * RATE_SHARE > 1.0:
            messages += self._adapter.request_telemetry(rate_hz)
        if self._connected and self._stranger is None:
            messages += self._adapter.questions()
        heard = math.isfinite(self._interval) and self._stranger is None
        known = heard and self._adapter.is_ready
        if self._may_engage and known and self._armed and self.stage is Stage.WAITING:
            messages += self._adapter.engage()
            text = f"vfguide {self._plan.name}: identification"
            messages += status_texts(text, NOTICE, 1)
        return messages


def say(answer: Answer, now: float, text: str | None, *, warning: bool = False) -> None:
    """Tell the operator, if there is something to tell."""
    if text is not None:
        answer.events.append(Event(time_s=now, text=text, warning=warning))
