"""Companion core: consumes bytes from the autopilot and the link, returns bytes for both.

It owns no socket and reads no clock: the caller passes in bytes and the time. Each new position report leads
at once to one guidance step and one pair of setpoints.
"""

import math
from collections import Counter

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts, Announcer, mode_sentence
from vfguide.companion.arrangements import HEARD_S, Arrangements
from vfguide.companion.authority import YOUNG_S, EngageRule, ModeAuthority, Wish
from vfguide.companion.consent import ConsentStore, FlightPhase, MemoryStore
from vfguide.companion.ground_orders import FlownFormation, GroundOrders
from vfguide.companion.guided_vehicle import GuidedVehicle
from vfguide.companion.height_keeper import LoiterHeight
from vfguide.companion.housekeeping import Housekeeping
from vfguide.companion.identity import EngageRange, VehicleIdentity
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import Outgoing, Snapshot
from vfguide.companion.roles import RoleMaker, role_of
from vfguide.companion.supervisor import Control, Mode, Objection, Situation, next_mode, obstacle
from vfguide.companion.timing import SAME_CLOCK, SharedClock, Wakefulness
from vfguide.formation.arrangement import Arrangement
from vfguide.guidance.airframe import polar
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.announcements import CRITICAL, INFO, NOTICE, WARNING
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.framing import ConnectionSigning
from vfguide.mavlink.reports import (
    AirspeedReport,
    AttitudeReport,
    BatteryReport,
    CommandReport,
    EstimatorReport,
    GpsReport,
    HeartbeatReport,
    LandedReport,
    OrderRequest,
    ParameterReport,
    PositionReport,
    RadioReport,
    Report,
    SensorsReport,
    SteeringReport,
    TextReport,
    TimeReport,
    TrafficReport,
    VersionReport,
)
from vfguide.mission.order_plan import LeaderPlace
from vfguide.state import HeardState


class Companion:
    """Companion of one vehicle."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        *,
        engage: bool,
        consent: ConsentStore | None = None,
        clock: SharedClock = SAME_CLOCK,
        inspect: bool = False,
        signing: ConnectionSigning | None = None,
        sends_target: bool = False,
        ground_orders: GroundOrders | None = None,
        greeting_s: float = 0.0,
        role: RoleMaker = role_of,
    ) -> None:
        """Make a companion that has heard nothing yet.

        Args:
            plan: the vehicle's part of the mission.
            adapter: autopilot-specific protocol.
            engage: whether the companion may enter the guided mode by itself, once per flight.
            consent: keeps the flight's consent over restarts; by default it is lost with this object.
            clock: clock shared by the formation; the companion's own by default.
            inspect: whether to read the autopilot's parameters and warn of values unfit for the flight.
            signing: MAVLink signing of the connection to the autopilot; None if it is not signed.
            sends_target: whether a leader sends FOLLOW_TARGET.
            ground_orders: orders that ground stations may request; None to ignore requests.
            greeting_s: time after the leader is first heard to wait for all other vehicles before joining, s.
            role: factory of the vehicle's role; the plan's own by default.
        """
        self._adapter = adapter
        self._phase = FlightPhase(
            adapter,
            airspeed_min=plan.airframe.airspeed_min,
            altitude_amsl=plan.altitude_amsl,
            ground_amsl=plan.frame.altitude_m,
        )
        self._alerts = Alerts()
        self._authority = ModeAuthority(
            adapter,
            EngageRule(allowed=engage, modes=plan.engage_from),
            consent or MemoryStore(),
            self._phase,
            self._alerts,
        )
        self._announcer = Announcer(plan.name, self._alerts)
        self._wakefulness = Wakefulness()
        self._old_datagrams = 0
        self._timeouts = plan.timeouts
        self.ground_orders = ground_orders
        """Requests from ground stations; None where they are ignored."""
        self._codec = Codec(
            plan.system_id,
            plan.component_id,
            signing=signing,
            takes_orders=self.ground_orders is not None,
            hears_attitude=plan.hears_bank,
        )
        self._clock = clock
        self._arrangements = Arrangements(plan, clock, self._alerts)
        self._vehicle = GuidedVehicle(
            plan,
            adapter,
            self._authority,
            clock,
            self._arrangements,
            alerts=self._alerts,
            sends_target=sends_target,
            role=role,
        )
        self._mode = Mode.WAITING
        self._objected: Objection | None = None
        self._reach = EngageRange(plan)
        self._identity = VehicleIdentity(plan.system_id)
        self._idle_since = self._leader_since = math.inf
        self._greeting_s = greeting_s
        self._stopped = self._leaving = False
        self._stands_back = ""
        self._loiter_height = LoiterHeight(plan, adapter)
        self._housekeeping = Housekeeping(
            plan, adapter, self._authority, self._alerts, inspect=inspect
        )

    @property
    def flight_mode(self) -> str:
        """Autopilot mode, by the name that ground stations use."""
        return self._authority.mode_name()

    @property
    def wind(self) -> tuple[float, float] | None:
        """Wind (north, east) used for guidance, m/s; None while unknown."""
        return self._vehicle.wind

    def sensors(self, now: float) -> SensorsReport | None:
        """Return the newest sensor and battery report; None if it is too old."""
        return self._vehicle.own.sensors.newest(now)

    @property
    def snapshot(self) -> Snapshot:
        """Mode, setpoint and formation state after the last step."""
        return Snapshot(
            mode=self._mode,
            setpoint=self._vehicle.steering.setpoint,
            lyapunov=self._vehicle.lyapunov,
            slot=self._vehicle.slot,
            left=self._arrangements.flight.has_left,
            path=self._arrangements.flight.path,
            lead=self._vehicle.role.lead if self._mode.steers else None,
            response=self._vehicle.response,
        )

    @property
    def counters(self) -> Counter[str]:
        """Received data that was not used, counted by reason."""
        own = self._vehicle.own.counters + Counter({"old when it was read": self._old_datagrams})
        own += self._arrangements.counters
        return (
            self._codec.counters
            + self._vehicle.role.counters
            + self._vehicle.steering.counters
            + own
        )

    @property
    def arrangement(self) -> Arrangement | None:
        """Arrangement being flown; None for the mission's own slots."""
        return self._arrangements.flight.flown

    def misses_order(self, now: float) -> bool:
        """Check whether the others fly by an order that is not known here."""
        return self._arrangements.waits(now)

    def formation_at(self, then_s: float, now: float) -> FlownFormation:
        """Return the formation, as far as it is known here, at a time of the own clock (s)."""
        leader = self._arrangements.leader
        place = None
        if leader is not None and now - leader.time_s <= HEARD_S:
            ahead_s = then_s - leader.time_s
            run_north, run_east = polar(leader.ground_speed * ahead_s, leader.course)
            place = LeaderPlace(
                leader.north + run_north,
                leader.east + run_east,
                leader.course,
                height=leader.height + leader.climb_rate * ahead_s,
                climb_rate=leader.climb_rate,
            )
        return FlownFormation(
            number=self._arrangements.number,
            flown=self.arrangement,
            holder="" if self.leadership is None else self.leadership[0],
            leader=place,
        )

    def awaits(self, number: int) -> bool:
        """Check whether this companion has agreed to an order that is not decided yet."""
        return self._arrangements.awaits(number)

    def receive_link(self, data: bytes, now: float) -> None:
        """Take a leader state from the link, or a datagram of a leader without a companion."""
        self._vehicle.role.receive(data, now)

    def lose_link(self, now: float) -> None:
        """Note that the link is disconnected now."""
        self._vehicle.role.lose_link(now)

    def stand_back(self, now: float, why: str) -> Outgoing:
        """Stop steering for a reason found on the link; with an empty reason, steer again."""
        if why == self._stands_back:
            return Outgoing()
        self._stands_back = why
        silent = (
            "the other companion of this name is silent: this one goes on; see that there is one"
        )
        return self.tell(why or silent, now)

    def receive_lead(self, vehicle: str, data: bytes, now: float) -> None:
        """Take from the link a leader state by which the named vehicle leads."""
        self._vehicle.role.receive_lead(vehicle, data, now)

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take the state of the named follower from the link."""
        self._vehicle.role.receive_neighbour(vehicle, data, now)

    def receive_order(
        self, data: bytes, signed: bytes, now: float, *, repeated: bool = False
    ) -> None:
        """Take an operator's order, original or repeated, with its signed form for repetition to others."""
        self._arrangements.receive_order(data, signed, now, repeated=repeated)

    def receive_reply(self, vehicle: str, data: bytes, now: float) -> None:
        """Take another vehicle's answer to an order, or an operator's question for the order being flown."""
        self._arrangements.receive_reply(vehicle, data, now)

    def receive_mavlink(self, data: bytes, now: float) -> Outgoing:
        """Take one datagram from the autopilot; a position report yields setpoints."""
        out = self.answer(data, now)
        at_once = out.to_autopilot
        self.settle(out, now)
        out.to_autopilot = at_once + out.to_autopilot
        return out

    def answer(self, data: bytes, now: float) -> Outgoing:
        """Decode one datagram and return only urgent output, above all setpoints.

        Call `settle` once these bytes have been sent; the two halves make up `receive_mavlink`. If the result
        is empty, the next `poll` can replace `settle`: a heartbeat that shows another mode yields output.
        """
        out = Outgoing()
        messages: list[MAVLink_message] = []
        if self._is_waking(now):
            self._old_datagrams += 1
        elif self._stopped:
            messages += self._hear_out(data, now)
        else:
            for report in self._codec.decode(data):
                if isinstance(report, OrderRequest):
                    messages += self._take_request(report, now, out)
                    continue
                if not isinstance(report, HeartbeatReport):
                    self._authority.note_life(now)
                messages += self._take(report, now, out)
        out.to_autopilot = self._encode(messages, now)
        out.events += self._alerts.heard(now)
        return out

    def settle(self, out: Outgoing, now: float) -> None:
        """Complete `answer` with periodic output; `out` is updated in place, with new bytes to send."""
        self._finish([], now, out)

    def poll(self, now: float) -> Outgoing:
        """Return the output that time alone makes due; call some ten times a second while nothing arrives."""
        out = Outgoing()
        self._is_waking(now)
        return self._finish([], now, out)

    def tell(self, text: str, now: float, *, warning: bool = True) -> Outgoing:
        """Tell operator and pilot of a finding of the surrounding program."""
        self._alerts.say("program", WARNING if warning else INFO, text)
        return self._finish([], now, Outgoing())

    def stop(self, now: float) -> Outgoing:
        """Stop guidance for good; keep passing in bytes and calling `poll` until `released`.

        A steered vehicle is handed back in answer to the next heartbeats that show the guided mode.
        """
        out = Outgoing()
        # An autopilot that was steered holds its last setpoint, also while it waits for the next.
        if self._authority.answers_for_vehicle and not self._stopped:
            self._alerts.say("mode", NOTICE, "stopping: handing back", told=False)
            self._leaving = True
            self._alerts.show_mode("stopping, handing back to the autopilot; watch that it does")
        if not self._stopped:
            out.share(self._vehicle.role.leave())
        self._stopped = True
        self._mode = Mode.WAITING
        return self._finish([], now, out)

    @property
    def released(self) -> bool:
        """Whether a vehicle that was steered until the stop is seen to fly by itself, or none was."""
        return not (self._leaving and self._authority.answers_for_vehicle)

    def _hear_out(self, data: bytes, now: float) -> list[MAVLink_message]:
        """Decode only what shows after the stop whether the autopilot has taken over."""
        messages: list[MAVLink_message] = []
        for report in self._codec.decode(data):
            if isinstance(report, OrderRequest):
                continue
            if isinstance(report, HeartbeatReport):
                self._authority.hear(report, now)
                messages += self._command_mode(now)
                continue
            self._authority.note_life(now)
            if isinstance(report, CommandReport):
                self._authority.hear_answer(report, now)
            elif isinstance(report, TimeReport):
                self._vehicle.own.note(report, now)
        return messages

    def _is_waking(self, now: float) -> bool:
        """Check whether input was buffered during a hang of this process; it must not be used then."""
        hung_s = self._wakefulness.note_call(now)
        if hung_s:
            self._authority.forget()
            self._vehicle.telemetry_time = -math.inf
            self._alerts.say(
                "computer",
                WARNING,
                f"this companion stood still for {hung_s:.0f} s, and steers again by what it hears"
                " from now on; check the load of its computer",
            )
        return self._wakefulness.is_waking(now)

    def _finish(self, messages: list[MAVLink_message], now: float, out: Outgoing) -> Outgoing:
        """Add periodic messages and texts for the pilot, in one datagram with the rest."""
        if not self._stopped:
            self._follow_orders(now, out)
            self._change_mode(now)
        messages += self._housekeeping.due(
            self._vehicle,
            self._mode,
            now,
            stopped=self._stopped,
            returns=lambda: self._wish(now) is Wish.RETURN,
        )
        self._vehicle.adopt(self._housekeeping.plan)
        self._authority.note_store()
        out.events += self._alerts.heard(now)
        messages += self._announcer.due(now)
        short = self._vehicle.own.radio.is_short(now)
        if self._authority.connected and not self._stopped and not short:
            messages += self._vehicle.plotted.due(self._mode, now)
        out.to_autopilot = self._encode(messages, now)
        out.to_leader = self._vehicle.role.to_leader(now)
        return out

    def _follow_orders(self, now: float, out: Outgoing) -> None:
        arrangements = self._arrangements
        arrangements.step(now)
        out.replies, out.repeats = arrangements.to_say()
        if arrangements.returns_to_formation():
            self._authority.renew()

    def leader_age(self, now: float) -> float:
        """Return the age of the newest leader state, s; 0 for the leader.

        Infinite before the first, and without a slot to steer by: standing back, ordered away, order unknown.
        """
        if self._stands_back or self._arrangements.flight.has_left or self._arrangements.waits(now):
            return math.inf
        return self._vehicle.role.leader_age(now)

    @property
    def order_number(self) -> int:
        """Number of the newest order that is flown or certain to be; 0 before the first."""
        return self._arrangements.number

    @property
    def foreign_leader(self) -> HeardState | None:
        """Newest state of a leader without a companion, on the own clock; None for any other leader."""
        return self._vehicle.role.foreign_leader

    @property
    def leadership(self) -> tuple[str, int] | None:
        """Known leader and its term; None where the mission names no deputies."""
        return self._vehicle.role.leadership

    def obstacle(self, now: float) -> str | None:
        """Return the reason that would keep the companion from steering now; None if there is none."""
        if self._stands_back:
            return self._stands_back
        objected = self.objection(now)
        if objected is not None:
            return objected.text
        return self._arrangements.obstacle(now) or obstacle(
            self._timeouts,
            telemetry_age=now - self._vehicle.telemetry_time,
            doubts=self._vehicle.own.belief.doubts,
            fault=self._vehicle.own.fault(now),
            leader_age=self.leader_age(now),
            time_known=math.isfinite(self._clock.from_own(now)),
        )

    def objection(self, now: float) -> Objection | None:
        """Return why the vehicle is not steered in any mode, and the remedy; None without a known reason."""
        refusal = self._identity.objection(now) or self._housekeeping.obedience.refusal
        if refusal is not None or self._mode.steers:
            return refusal
        known = now - self._vehicle.telemetry_time <= self._timeouts.telemetry_s
        distance = self._vehicle.distance if known else math.inf
        return self._reach.objection(distance)

    @property
    def findings(self) -> list[str]:
        """Findings in the autopilot's parameters that speak against taking off, the worst first."""
        return self._housekeeping.findings()

    def _encode(self, messages: list[MAVLink_message], now: float) -> bytes:
        self._housekeeping.commands.sent(messages, now)
        return self._codec.encode(messages)

    def _take_request(
        self, request: OrderRequest, now: float, out: Outgoing
    ) -> list[MAVLink_message]:
        """Answer a ground station's request at once; the surrounding program gives the order."""
        if self.ground_orders is None:
            return []
        messages, order = self.ground_orders.take(request, now)
        if order is not None:
            out.requested.append(order)
        return messages

    def _take(self, report: Report, now: float, out: Outgoing) -> list[MAVLink_message]:
        match report:
            case PositionReport():
                return self._take_position(report, now, out)
            case (
                AirspeedReport()
                | AttitudeReport()
                | TimeReport()
                | GpsReport()
                | EstimatorReport()
                | SensorsReport()
                | BatteryReport()
                | RadioReport()
            ):
                self._vehicle.own.note(report, now)
            case HeartbeatReport():
                self._identity.note_heartbeat(report, now)
                self._warn("autopilot", self._authority.hear(report, now))
                self._housekeeping.obedience.note_mode(guided=self._authority.shows_guided)
                self._change_mode(now)
                return self._command_mode(now) + self._loiter_height_due(now)
            case TrafficReport() | LandedReport() | SteeringReport():
                self._note(report, now)
            case CommandReport():
                self._housekeeping.answered(report, now)
                self._loiter_height.answered(report)
                self._warn("autopilot", self._adapter.hear(report))
            case VersionReport():
                self._identity.note_version(report, now)
                steered = self._adapter.hear(report)
                if steered is not None:
                    self._alerts.say("autopilot", INFO, steered, told=False)
            case ParameterReport():
                self._housekeeping.hear_parameter(report)
            case TextReport():
                text = f"autopilot: {report.text}"
                self._alerts.say("autopilot", report.severity, text, told=False)
        return []

    def _warn(self, key: str, text: str | None) -> None:
        if text is not None:
            self._alerts.say(key, WARNING, text)

    def _note(self, report: TrafficReport | LandedReport | SteeringReport, now: float) -> None:
        """Handle reports that need no reply."""
        if isinstance(report, SteeringReport):
            guided = self._authority.shows_guided
            self._identity.note_steering(report, now, guided=guided)
            return
        if isinstance(report, TrafficReport):
            self._vehicle.role.receive_traffic(report, now)
        else:
            self._phase.hear_landed(report, now)

    def _take_position(
        self, report: PositionReport, now: float, out: Outgoing
    ) -> list[MAVLink_message]:
        """Run one guidance step if the position is plausible; return the messages for the autopilot."""
        found = self._vehicle.learn(now)
        if found is not None:
            self._housekeeping.retune(found)
        self._reach.note(report)
        self._identity.note_position(report, now)
        self._authority.note_uptime(report.boot_time_s)
        self._housekeeping.note_position(now)
        reboots = self._vehicle.own.reboots
        navigated = self._vehicle.own.take(report, now)
        if self._vehicle.own.reboots > reboots:
            self._authority.rebooted()
            self._housekeeping.obedience.forget()
        if self._vehicle.own.belief.doubts:
            self._phase.doubt_position()
        elif navigated is not None:
            self._phase.hear_position(report, navigated.state, now)
        if navigated is None:
            return []
        step = self._vehicle.step(navigated, self._mode, now, out)
        self._change_mode(now)
        return [] if step is None else self._vehicle.steer(step, navigated, self._mode, now, out)

    def _change_mode(self, now: float) -> None:
        """Let the supervisor choose the mode; announce a change and reset the steering for it."""
        control = self._authority.control(now)
        if self._vehicle.plan.asks_response:
            # Do not steer by a response that the autopilot's parameters are about to replace.
            control = Control.UNKNOWN
        if self._object(now):
            control = Control.BARRED
        situation = Situation(
            control=control,
            telemetry_age=now - self._vehicle.telemetry_time,
            leader_age=self.leader_age(now),
            steered=self._authority.answers_for_vehicle,
            distance=self._vehicle.distance,
        )
        before, self._mode = self._mode, next_mode(self._mode, situation, self._timeouts)
        if self._mode.steers or control is not Control.GUIDED:
            self._idle_since = now
        self._announcer.watch(self._mode, control, lambda: self._sentence(situation, now), now)
        if self._mode is before:
            return
        text = f"{before.value} -> {self._mode.value}"
        self._alerts.say("mode", NOTICE, text, about="mode", told=False)
        if not before.steers:
            self._vehicle.steering.begin()
        if self._mode.steers is not before.steers:
            self._vehicle.steering.reset()

    def _object(self, now: float) -> bool:
        """Check whether an objection forbids steering; pilot and log hear of each kind once."""
        before, self._objected = self._objected, self.objection(now)
        found = self._objected
        if found is not None:
            # The figures in an objection may change: to the reader it is still the same one.
            if before is None or before.key != found.key:
                text = f"not steered: {found.text}"
                self._alerts.say("objection", CRITICAL, text, told=False)
                self._alerts.show_mode(text)
            return True
        if before is None:
            return False
        guided = self._adapter.engaged_name
        self._alerts.say("objection", NOTICE, f"may be steered again: select {guided}")
        return False

    def _sentence(self, situation: Situation, now: float) -> str:
        if self._objected is not None:
            return f"not steered: {self._objected.text}"
        flight_mode, guided = self._authority.mode_name(), self._adapter.engaged_name
        # Only a heartbeat known to be current is answered with a command.
        returns = situation.steered and math.isfinite(self._vehicle.own.questions.greatest_age(now))
        returns_s = self._timeouts.telemetry_lost_s if returns else None
        return mode_sentence(self._mode, situation.control, flight_mode, guided, returns_s)

    def _command_mode(self, now: float) -> list[MAVLink_message]:
        """Return the mode commands that answer the heartbeat just heard."""
        wish, age_s = self._wish(now), self._vehicle.own.questions.greatest_age(now)
        if self._wakefulness.is_stale(now - age_s):
            age_s = math.inf
        commands = self._authority.commands(wish, now, age_s=age_s)
        told = self._stopped or self._arrangements.flight.has_left or self._objected is not None
        if commands and wish is Wish.RETURN and self._mode is Mode.WAITING and not told:
            self._alerts.say(
                "hand-back",
                WARNING,
                "nothing to steer by: handed back to the autopilot, watch that it loiters;"
                f" select {self._adapter.engaged_name} once position and leader are heard",
            )
        return commands

    def _loiter_height_due(self, now: float) -> list[MAVLink_message]:
        """Return the command for the own loiter height, once an ordered loiter shows in a heartbeat."""
        control = self._authority.control(now)
        young = self._vehicle.own.questions.greatest_age(now) <= YOUNG_S
        return self._loiter_height.due(
            up=self._arrangements.own_up(now),
            order=self._arrangements.flight.loiters_by,
            returned=control is Control.RETURNED and young,
            engaged=control is Control.GUIDED,
            altitude_amsl=self._vehicle.altitude,
        )

    def _wish(self, now: float) -> Wish:
        if self._stopped:
            return Wish.RETURN if self._leaving else Wish.NONE
        if self._stands_back:
            # The other companion may steer this very vehicle.
            return Wish.RETURN if self._vehicle.has_steered else Wish.NONE
        if self._objected is not None:
            return Wish.RETURN if self._objected.returns else Wish.NONE
        lost_s = self._timeouts.telemetry_lost_s
        deaf = now - max(self._vehicle.telemetry_time, self._wakefulness.since) > lost_s
        # For example, this companion has replaced one that steered, and hears no leader.
        idle = self._authority.answers_for_vehicle and now - self._idle_since > lost_s
        longest_s = self._timeouts.prediction_s + self._timeouts.breakaway_s
        gone = longest_s < self._vehicle.role.leader_age(now) < math.inf
        gone = gone or self._arrangements.flight.has_left
        if gone or self._vehicle.is_given_up(now) or deaf or idle:
            return Wish.RETURN
        adapter = self._adapter
        ready = adapter.is_ready and (self._vehicle.is_ready or not adapter.streams_before_engaging)
        followable = self.leader_age(now) <= self._timeouts.leader_s
        heard = now - self._vehicle.telemetry_time <= self._timeouts.telemetry_s
        informed = followable and heard and math.isfinite(self._vehicle.interval)
        informed = informed and not self._awaits_others(now)
        waiting = self._mode in {Mode.WAITING, Mode.PILOT}
        return Wish.STEER if waiting and ready and informed else Wish.NONE

    def _awaits_others(self, now: float) -> bool:
        """Check whether a vehicle that was never heard, which cannot be kept clear of, may soon be."""
        if self._vehicle.role.leader_age(now) < math.inf:
            self._leader_since = min(self._leader_since, now)
        return now - self._leader_since < self._greeting_s and bool(self._vehicle.role.unheard())
