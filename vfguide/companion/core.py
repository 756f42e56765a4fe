"""The companion: bytes from the autopilot and from the link in, bytes for both out.

It owns no socket and reads no clock: whoever drives it hands in bytes and the time. A new position report
leads to one guidance step and one pair of setpoints at once.
"""

import math
from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.engagement import Engagement
from vfguide.companion.gate import Gate
from vfguide.companion.inquiry import Inquiry
from vfguide.companion.obedience import Obedience
from vfguide.companion.outgoing import Event, Outgoing, Snapshot
from vfguide.companion.own_vehicle import Fix, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.roles import role_of
from vfguide.companion.shared_clock import SAME_CLOCK, SharedClock
from vfguide.companion.supervisor import Mode, Situation, next_mode
from vfguide.mavlink.acknowledgements import Acknowledgements
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.announcements import heartbeat, status_text
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.reports import (
    AirspeedReport,
    CommandReport,
    HeartbeatReport,
    ParameterReport,
    PositionReport,
    Report,
    TextReport,
)
from vfguide.mavlink.setpoint_stream import SetpointStream
from vfguide.mavlink.signing import Signing
from vfguide.state import Setpoint

HEARTBEAT_S = 1.0
"""Between heartbeats, and between tries of what the autopilot has not answered to."""

ALTITUDE_S = 5.0
"""Between repetitions of the altitude."""

RATE_SHARE = 0.7
"""Below this share of the rate that was asked for, telemetry is asked for again."""


class Companion:
    """One vehicle's companion."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        *,
        engage: bool,
        clock: SharedClock = SAME_CLOCK,
        inspect: bool = False,
        signing: Signing | None = None,
    ) -> None:
        """Make a companion that has heard nothing yet.

        Args:
            plan: its vehicle's part of the mission.
            adapter: how to speak to its autopilot.
            engage: whether it may put the autopilot into the guided mode by itself, the first time.
            clock: the formation's; this companion's own if absent.
            inspect: whether to ask for the autopilot's parameters and warn of what does not fit the flight.
            signing: of the connection to the autopilot, if it is signed.
        """
        self._plan = plan
        self._adapter = adapter
        self._engagement = Engagement(adapter, allowed=engage)
        self._patience = plan.patience
        self._codec = Codec(plan.system_id, plan.component_id, signing=signing)
        self._own = OwnVehicle(plan)
        self._role = role_of(plan, clock)
        self._mode = Mode.WAITING
        self._telemetry_time = -math.inf
        self._interval = math.inf
        self._distance = math.inf
        self._housekeeping_time = -math.inf
        self._altitude_time = -math.inf
        self._setpoint: Setpoint[float] | None = None
        self._lyapunov = math.nan
        self._ready = False
        self._stopped = self._leaving = False
        self._gate = Gate(plan)
        self._stream = SetpointStream(adapter)
        self._commands = Acknowledgements()
        self._inquiry = Inquiry(plan, adapter) if inspect else None
        self._obedience = Obedience(plan.airframe, plan.altitude_amsl)

    @property
    def snapshot(self) -> Snapshot:
        """What it did last."""
        return Snapshot(mode=self._mode, setpoint=self._setpoint, lyapunov=self._lyapunov)

    @property
    def counters(self) -> Counter[str]:
        """What arrived and was not used, by reason."""
        return self._codec.counters + self._role.counters + self._gate.counters

    def receive_link(self, data: bytes, now: float) -> None:
        """Take a leader state from the link."""
        self._role.receive(data, now)

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take the state of another follower, of this name, from the link."""
        self._role.receive_neighbour(vehicle, data, now)

    def receive_mavlink(self, data: bytes, now: float) -> Outgoing:
        """Take one datagram from the autopilot; setpoints go out with a position report."""
        out = Outgoing()
        if self._stopped:
            self._hear_out(data, now)
            return out
        messages: list[MAVLink_message] = []
        for report in self._codec.decode(data):
            messages += self._take(report, now, out)
        messages += self._housekeeping(now, out)
        out.to_autopilot = self._encode(messages, now)
        return out

    def poll(self, now: float) -> Outgoing:
        """What is due by time alone; to be called every tenth of a second or so while nothing arrives."""
        out = Outgoing()
        messages = self._change_mode(now, out)
        messages += self._housekeeping(now, out)
        out.to_autopilot = self._encode(messages, now)
        return out

    def stop(self, now: float) -> Outgoing:
        """The last words, to be repeated until `released`: what is steered goes back to its autopilot.

        From here on nothing is guided any more; what the autopilot says is heard for its answer alone.
        """
        out = Outgoing()
        # An autopilot that was steered holds its last setpoint, also while it waits for the next.
        if self._mode.steers or (self._engagement.engaged and self._setpoint is not None):
            if not self._leaving:
                out.events.append(Event(time_s=now, text="stopping: handing back"))
            self._leaving = True
        self._stopped = True
        self._mode, self._engagement.may_enter = Mode.WAITING, False
        if not self.released:
            out.to_autopilot = self._codec.encode(self._adapter.hand_back())
        return out

    @property
    def released(self) -> bool:
        """Whether a vehicle that was steered until the stop is seen to fly by itself, or none was."""
        return not (self._leaving and self._engagement.engaged)

    def _hear_out(self, data: bytes, now: float) -> None:
        """After the last words: has the autopilot taken over?"""
        for report in self._codec.decode(data):
            if isinstance(report, HeartbeatReport):
                self._engagement.hear(report, self._mode, now)
            elif isinstance(report, CommandReport):
                self._engagement.hear_answer(report)

    def leader_age(self, now: float) -> float:
        """Age of the newest leader state, s; 0 for the leader, infinite before the first."""
        return self._role.leader_age(now)

    def _encode(self, messages: list[MAVLink_message], now: float) -> bytes:
        """One datagram, whose commands wait for their answers from now on."""
        self._commands.sent(messages, now)
        return self._codec.encode(messages)

    def _take(self, report: Report, now: float, out: Outgoing) -> list[MAVLink_message]:
        match report:
            case PositionReport():
                fix = self._own.take(report, now)
                return [] if fix is None else self._guide(fix, now, out)
            case AirspeedReport():
                self._own.note_airspeed(report.airspeed, now)
            case HeartbeatReport():
                out.warn(self._engagement.hear(report, self._mode, now), now)
                return self._change_mode(now, out)
            case CommandReport():
                out.warn(self._commands.answered(report, now), now)
            case ParameterReport():
                if self._inquiry is not None:
                    self._inquiry.take(report)
            case TextReport():
                worrying = report.severity <= mavlink.MAV_SEVERITY_WARNING
                text = f"autopilot: {report.text}"
                out.events.append(Event(time_s=now, text=text, warning=worrying))
        return []

    def _guide(self, fix: Fix, now: float, out: Outgoing) -> list[MAVLink_message]:
        """One guidance step, and what it sends."""
        self._telemetry_time = now
        self._interval = fix.interval
        if fix.rebooted:
            self._start_anew(now, out)
        step = self._role.step(fix, self._mode)
        self._distance = step.distance
        if step.publish is not None:
            out.to_link.append(step.publish)
        messages = self._change_mode(now, out)
        setpoint, complaint = self._gate.pass_on(step.setpoint, now)
        out.warn(complaint, now)
        self._own.note_setpoint(setpoint if self._mode.steers else None, now)
        if setpoint is None:
            return messages
        self._ready = True
        if self._mode.steers:
            self._setpoint, self._lyapunov = setpoint, step.lyapunov
            messages += self._steer(setpoint, now)
            out.steered = True
            out.warn(self._obedience.watch(fix.state, setpoint), now)
            if not self._adapter.holds_altitude:
                out.warn(self._obedience.watch_altitude(fix.place.altitude_amsl), now)
        elif self._mode is not Mode.LOST and self._engagement.recognised:
            ready = self._adapter.stay_ready(setpoint.course, self._reported(setpoint.speed))
            messages += self._stream.due(ready, now)
        return messages

    def _start_anew(self, now: float, out: Outgoing) -> None:
        """The autopilot has rebooted and forgotten everything."""
        out.warn("the autopilot has rebooted", now)
        self._engagement.rebooted(now)
        if self._engagement.may_enter:
            self._mode = Mode.WAITING

    def _steer(self, setpoint: Setpoint[float], now: float) -> list[MAVLink_message]:
        """Messages that carry a setpoint, and now and then the altitude."""
        flown = self._adapter.fly(setpoint.course, self._reported(setpoint.speed))
        messages = self._stream.due(flown, now)
        if now - self._altitude_time >= ALTITUDE_S:
            self._altitude_time = now
            messages += self._adapter.hold_altitude(self._plan.altitude_amsl)
        return messages

    def _reported(self, speed: float) -> float:
        """A speed (m/s) as the autopilot's own sensor would show it, within the vehicle's limits."""
        airframe = self._plan.airframe
        if airframe.hold == "course-hold":
            return speed
        shown = speed / self._own.calibration.scale
        return min(max(shown, airframe.airspeed_min), airframe.airspeed_max)

    def _change_mode(self, now: float, out: Outgoing) -> list[MAVLink_message]:
        """Follow the supervisor; hand the vehicle back when the leader is lost."""
        situation = Situation(
            engaged=self._engagement.engaged,
            given_back=self._engagement.as_given_back,
            telemetry_age=now - self._telemetry_time,
            leader_age=self._role.leader_age(now),
            distance=self._distance,
        )
        before, self._mode = self._mode, next_mode(self._mode, situation, self._patience)
        if self._mode is before:
            return []
        out.events.append(Event(time_s=now, text=f"{before.value} -> {self._mode.value}"))
        if not before.steers:
            self._altitude_time = -math.inf
        if self._mode.steers is not before.steers:
            self._stream.reset()
            self._obedience.reset()
        messages = [status_text(f"vfguide {self._plan.name}: {self._mode.value}")]
        if self._mode is Mode.LOST:
            messages += self._engagement.give_back()
        return messages

    def _housekeeping(self, now: float, out: Outgoing) -> list[MAVLink_message]:
        """Heartbeat, and whatever the autopilot still has to be asked for."""
        if now - self._housekeeping_time < HEARTBEAT_S:
            return []
        self._housekeeping_time = now
        messages = [heartbeat()]
        silent = now - self._telemetry_time > self._patience.telemetry_s
        slow = self._interval * self._plan.rate_hz * RATE_SHARE > 1.0
        engagement = self._engagement
        if engagement.connected and (silent or slow):
            messages += self._adapter.request_telemetry(self._plan.rate_hz)
        if not silent:
            for text in self._commands.overdue(now):
                out.warn(text, now)
        if engagement.connected and engagement.recognised and self._inquiry is not None:
            messages += self._inquiry.requests(lambda text: out.warn(text, now))
        if self._may_enter(now):
            entering, complaint = engagement.enter()
            messages += entering
            out.warn(complaint, now)
        if engagement.engaged and (self._mode is Mode.LOST or self._gate.closed(now)):
            messages += self._adapter.hand_back()
        elif engagement.engaged and now - self._telemetry_time > self._patience.telemetry_lost_s:
            # It flies on along its last course; whether it hears this nobody knows.
            messages += engagement.give_back()
        return messages

    def _may_enter(self, now: float) -> bool:
        """Whether the guided mode is to be entered: it may be, and there is something to fly."""
        engagement = self._engagement
        waiting = self._mode is Mode.WAITING and not engagement.engaged
        ready = self._ready or not self._adapter.streams_before_engaging
        followable = self._role.leader_age(now) <= self._patience.leader_s
        informed = followable and math.isfinite(self._interval)
        return engagement.may_enter and engagement.recognised and waiting and ready and informed
