"""The companion: bytes from the autopilot and from the link in, bytes for both out.

It owns no socket and reads no clock: whoever drives it hands in bytes and the time. A new position report
leads to one guidance step and one pair of setpoints at once.
"""

import math
from collections import Counter
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.inquiry import Inquiry
from vfguide.companion.obedience import Obedience
from vfguide.companion.own_vehicle import Fix, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.roles import role_of
from vfguide.companion.shared_clock import SAME_CLOCK, SharedClock
from vfguide.companion.supervisor import Mode, Situation, next_mode
from vfguide.mavlink.acknowledgements import Acknowledgements
from vfguide.mavlink.adapter import AutopilotAdapter
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

REBOOT_S = 5.0
"""A guided mode that was left less than this before a reboot showed was left by the reboot."""

RATE_SHARE = 0.7
"""Below this share of the rate that was asked for, telemetry is asked for again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something an operator should know."""

    time_s: float
    """When."""
    text: str
    """What, in one line."""
    warning: bool = False
    """Whether it is something to worry about."""


@dataclass(slots=True)
class Outgoing:
    """What a call leads to."""

    to_autopilot: bytes = b""
    """One datagram."""
    to_link: list[bytes] = field(default_factory=list)
    """Own states."""
    steered: bool = False
    """Whether the vehicle is steered: the setpoint goes to the autopilot unless that has it already."""
    events: list[Event] = field(default_factory=list)
    """In the order in which they happened."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """What the companion did last, for records."""

    mode: Mode
    """Of the supervisor."""
    setpoint: Setpoint[float] | None
    """The last that was sent."""
    lyapunov: float
    """W, m²; NaN for the leader."""


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
        self._engages = engage
        self._may_engage = engage
        self._patience = plan.patience
        self._codec = Codec(plan.system_id, plan.component_id, signing=signing)
        self._own = OwnVehicle(plan)
        self._role = role_of(plan, clock)
        self._mode = Mode.WAITING
        self._engaged = False
        self._given_back = False
        self._connected = False
        self._left_time = -math.inf
        self._telemetry_time = -math.inf
        self._interval = math.inf
        self._distance = math.inf
        self._housekeeping_time = -math.inf
        self._altitude_time = -math.inf
        self._setpoint: Setpoint[float] | None = None
        self._lyapunov = math.nan
        self._ready = False
        self._unflyable_time = math.inf
        self._own_counters: Counter[str] = Counter()
        self._stream = SetpointStream(adapter)
        self._commands = Acknowledgements()
        self._inquiry = Inquiry(plan, adapter) if inspect else None
        self._obedience = Obedience(plan.airframe, plan.altitude_amsl)
        self._stranger: str | None = None
        self._armed = False
        self._told_unarmed = False

    @property
    def snapshot(self) -> Snapshot:
        """What it did last."""
        return Snapshot(mode=self._mode, setpoint=self._setpoint, lyapunov=self._lyapunov)

    @property
    def counters(self) -> Counter[str]:
        """What arrived and was not used, by reason."""
        return self._codec.counters + self._role.counters + self._own_counters

    def receive_link(self, data: bytes, now: float) -> None:
        """Take a leader state from the link."""
        self._role.receive(data, now)

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take the state of another follower, of this name, from the link."""
        self._role.receive_neighbour(vehicle, data, now)

    def receive_mavlink(self, data: bytes, now: float) -> Outgoing:
        """Take one datagram from the autopilot; setpoints go out with a position report."""
        out = Outgoing()
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
        """The last words: a vehicle that is being steered goes back to its autopilot."""
        out = Outgoing()
        if self._mode.steers:
            out.events.append(Event(time_s=now, text="stopping: handing back"))
            out.to_autopilot = self._codec.encode(self._adapter.hand_back())
        self._mode, self._may_engage = Mode.WAITING, False
        return out

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
                self._armed = report.armed
                self._recognise(report.autopilot, now, out)
                self._note_mode(report.custom_mode, now)
                return self._change_mode(now, out)
            case CommandReport():
                warn(out, now, self._commands.answered(report, now))
            case ParameterReport():
                if self._inquiry is not None:
                    self._inquiry.take(report)
            case TextReport():
                worrying = report.severity <= mavlink.MAV_SEVERITY_WARNING
                text = f"autopilot: {report.text}"
                out.events.append(Event(time_s=now, text=text, warning=worrying))
        return []

    def _recognise(self, autopilot: int, now: float, out: Outgoing) -> None:
        """Whether this is an autopilot that the adapter speaks to; if not, say so once."""
        complaint = self._adapter.recognise(autopilot)
        if complaint != self._stranger:
            warn(out, now, complaint)
        self._stranger = complaint

    def _note_mode(self, custom_mode: int, now: float) -> None:
        """Whether the autopilot obeys; a guided mode that was left comes back by the pilot's hand alone.

        Except where this companion has left it itself, for lack of a leader: then the pilot has taken over
        once the autopilot is in any mode but the one that it was given back in.
        """
        self._connected = True
        # Modes are numbers that mean something else to every autopilot.
        engaged = self._stranger is None and self._adapter.is_engaged(custom_mode)
        as_given_back = self._given_back and self._adapter.is_handed_back(custom_mode)
        if self._engaged and not engaged:
            self._left_time = now
        if not (engaged or as_given_back) and (self._engaged or self._given_back):
            self._may_engage = False
        if engaged and self._mode is not Mode.LOST:
            self._given_back = False
        self._engaged = engaged

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
        setpoint = self._flyable(step.setpoint, now, out)
        self._own.note_setpoint(setpoint if self._mode.steers else None, now)
        if setpoint is None:
            return messages
        self._ready = True
        if self._mode.steers:
            self._setpoint, self._lyapunov = setpoint, step.lyapunov
            messages += self._steer(setpoint, now)
            out.steered = True
            warn(out, now, self._obedience.watch(fix.state, setpoint))
            if not self._adapter.holds_altitude:
                warn(out, now, self._obedience.watch_altitude(fix.place.altitude_amsl))
        elif self._mode is not Mode.LOST and self._stranger is None:
            ready = self._adapter.stay_ready(setpoint.course, self._reported(setpoint.speed))
            messages += self._stream.due(ready, now)
        return messages

    def _flyable(
        self, setpoint: Setpoint[float] | None, now: float, out: Outgoing
    ) -> Setpoint[float] | None:
        """The setpoint if it is finite and within the vehicle's limits; if not, none and an event."""
        if setpoint is None or is_flyable(setpoint, self._plan):
            self._unflyable_time = math.inf
            return setpoint
        self._own_counters["setpoint not flyable"] += 1
        if math.isinf(self._unflyable_time):
            self._unflyable_time = now
            text = f"guidance asks for what cannot be flown: {setpoint}"
            out.events.append(Event(time_s=now, text=text, warning=True))
        return None

    def _start_anew(self, now: float, out: Outgoing) -> None:
        """The autopilot has rebooted and forgotten everything.

        If it left the guided mode just now, that was the reboot and no pilot.
        """
        out.events.append(Event(time_s=now, text="the autopilot has rebooted", warning=True))
        if now - self._left_time <= REBOOT_S:
            self._may_engage = self._engages
        if self._may_engage:
            self._mode = Mode.WAITING
        # Its next heartbeat tells which mode it came up in: no pilot has left the one before.
        self._engaged = self._given_back = False

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
            engaged=self._engaged,
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
            self._given_back = True
            messages += self._adapter.hand_back()
        return messages

    def _housekeeping(self, now: float, out: Outgoing) -> list[MAVLink_message]:
        """Heartbeat, and whatever the autopilot still has to be asked for."""
        if now - self._housekeeping_time < HEARTBEAT_S:
            return []
        self._housekeeping_time = now
        messages = [heartbeat()]
        silent = now - self._telemetry_time > self._patience.telemetry_s
        slow = self._interval * self._plan.rate_hz * RATE_SHARE > 1.0
        if self._connected and (silent or slow):
            messages += self._adapter.request_telemetry(self._plan.rate_hz)
        if not silent:
            for text in self._commands.overdue(now):
                warn(out, now, text)
        if self._connected and self._inquiry is not None and self._stranger is None:
            messages += self._inquiry.requests(lambda text: warn(out, now, text))
        ready = self._ready or not self._adapter.streams_before_engaging
        followable = self._role.leader_age(now) <= self._patience.leader_s
        informed = followable and math.isfinite(self._interval)
        waiting = self._mode is Mode.WAITING and not self._engaged
        if self._may_engage and waiting and ready and informed and self._stranger is None:
            messages += self._engage(now, out)
        # An autopilot holds its last setpoint: one that gets no other is better off by itself.
        nothing_to_fly = now - self._unflyable_time > HEARTBEAT_S
        if self._engaged and (self._mode is Mode.LOST or nothing_to_fly):
            messages += self._adapter.hand_back()
        return messages

    def _engage(self, now: float, out: Outgoing) -> list[MAVLink_message]:
        """Enter the guided mode; on the ground that is for the pilot to do."""
        if self._armed:
            self._told_unarmed = False
            return self._adapter.engage()
        if not self._told_unarmed:
            self._told_unarmed = True
            warn(out, now, "the vehicle is not armed: not engaged until it is")
        return []


def warn(out: Outgoing, now: float, text: str | None) -> None:
    """An event to worry about, if there is one."""
    if text is not None:
        out.events.append(Event(time_s=now, text=text, warning=True))


def is_flyable(setpoint: Setpoint[float], plan: FlightPlan) -> bool:
    """Whether a setpoint is finite and its speed one that the vehicle may be asked for.

    The laws see to both; this is the gate behind which nothing depends on them.
    """
    if not (math.isfinite(setpoint.course) and math.isfinite(setpoint.speed)):
        return False
    airframe = plan.airframe
    if airframe.hold == "course-hold":
        return setpoint.speed > 0.0
    return airframe.airspeed_min <= setpoint.speed <= airframe.airspeed_max


def status_text(text: str) -> MAVLink_message:
    """STATUSTEXT, for ground stations that listen to the vehicle; longer than 50 characters is cut."""
    return mavlink.MAVLink_statustext_message(
        mavlink.MAV_SEVERITY_NOTICE, text.encode("ascii", "replace")[:50]
    )


def heartbeat() -> MAVLink_message:
    """HEARTBEAT of an onboard computer."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )
