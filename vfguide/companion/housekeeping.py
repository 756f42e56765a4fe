"""Periodic messages to the autopilot: heartbeats, telemetry requests, and queries."""

import math
from collections import Counter
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts
from vfguide.companion.authority import ModeAuthority
from vfguide.companion.guided_vehicle import GuidedVehicle
from vfguide.companion.parameter_check import ParameterCheck
from vfguide.companion.plan import FlightPlan
from vfguide.companion.supervisor import Mode, Objection
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.announcements import (
    GOOD,
    WARNING,
    Acknowledgements,
    ground_station_heartbeat,
    heartbeat,
    name_of,
    time_question,
    version_question,
)
from vfguide.mavlink.reports import CommandReport, ParameterReport

# The autopilot's answers show, on the ground already, whether it takes the commands that steer it.
#
# One without such a command says so in any mode. One that refuses each of them while its heartbeats show the
# guided mode has its own reason. Neither is steered.

UNSUPPORTED_TIMES = 2
"""Count of "unsupported" answers that is believed: a single one may be somebody else's."""

REFUSED_TIMES, REFUSED_S = 3, 3.0
"""Count of refusals in the guided mode, and their span, s: a pilot's change of mode shows sooner."""

ANSWER_S = 3.0
"""Time in which a query on the ground is answered, s."""


class Obedience:
    """Obedience of one autopilot since its start."""

    def __init__(self, adapter: AutopilotAdapter) -> None:
        self._adapter = adapter
        self._asked_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """Forget all answers, as the autopilot has restarted, maybe with other firmware."""
        self._is_known = False
        self._unsupported: Counter[int] = Counter()
        self._refused: dict[int, list[float]] = {}
        self.refusal: Objection | None = None
        """Objection to steering, with the remedy; None while nothing speaks against it."""

    def questions(self, now: float) -> list[MAVLink_message]:
        """Return commands that an autopilot on the ground outside its guided mode refuses if it has them."""
        if self._is_known:
            return []
        messages = self._adapter.steering_questions()
        if messages:
            self._asked_s = now
        return messages

    def hear(self, report: CommandReport, now: float, *, guided: bool) -> bool:
        """Process an answer; return whether the pilot needs no word of it beside `refusal`."""
        if report.command not in self._adapter.steering_commands:
            return False
        if report.result == mavlink.MAV_RESULT_UNSUPPORTED:
            self._unsupported[report.command] += 1
            if self._unsupported[report.command] == UNSUPPORTED_TIMES:
                self._refuse(report, "use firmware built with guided commands")
            return True
        self._is_known = True
        self._unsupported[report.command] = 0
        if report.result in GOOD or not guided:
            self._refused.pop(report.command, None)
            return now - self._asked_s <= ANSWER_S and report.result not in GOOD
        refused = self._refused.setdefault(report.command, [])
        refused.append(now)
        del refused[1:-REFUSED_TIMES]
        if len(refused) >= REFUSED_TIMES and now - refused[0] >= REFUSED_S:
            self._refuse(report, "see what it says, and start it anew")
        return False

    def note_mode(self, *, guided: bool) -> None:
        """Process a heartbeat's mode: outside the guided one refusals are right, and forgotten."""
        if guided:
            return
        self._refused.clear()
        if not any(times >= UNSUPPORTED_TIMES for times in self._unsupported.values()):
            self.refusal = None

    def _refuse(self, report: CommandReport, remedy: str) -> None:
        result = name_of("MAV_RESULT", report.result).removeprefix("MAV_RESULT_")
        command = name_of("MAV_CMD", report.command).removeprefix("MAV_CMD_")
        if self.refusal is not None:
            return
        text = f"the autopilot refuses {command} ({result}): {remedy}"
        self.refusal = Objection(key="refusal", text=text)


HEARTBEAT_S = 1.0
"""Interval of heartbeats, and of retries of unanswered requests, s."""

FAIL_SAFE_S = 5.0
"""Time for a hand-back before the vehicle is left to its autopilot's fail-safe, s."""

FAIL_SAFE = (
    "nothing to steer by, and it does not show that it was handed back: this companion falls silent, for the"
    " autopilot's fail-safe to act where it is set; take over"
)
"""Message to the pilot at that moment."""

VERSION_ASKS = 2
"""Limit on queries for the hardware's number: each vehicle of the same id answers."""

SILENT_ASKS, HINT_ASKS = 3, 8
"""Requests without a position after which streams are requested too, and after which the pilot is told."""

NO_STREAM = (
    "the autopilot sends no positions although it is asked: set SRx_POSITION, SRx_EXTRA2 and SRx_EXTRA1"
    " of its port (PX4: MAV_x_MODE) to the mission's rate"
)
"""Message to the pilot when no positions come."""

RATE_SHARE = 0.7
"""Share of the requested rate below which telemetry is requested again."""


class Housekeeping:
    """Periodic duties of a companion."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        authority: ModeAuthority,
        alerts: Alerts,
        *,
        inspect: bool,
    ) -> None:
        """Begin with nothing sent; `inspect` asks for parameters and warns of those that do not fit."""
        self._plan = plan
        self._adapter = adapter
        self._authority = authority
        self._alerts = alerts
        self._timeouts = plan.timeouts
        self._parameter_check = (
            ParameterCheck(plan, adapter) if inspect or plan.asks_response else None
        )
        self._time = -math.inf
        self._asked_for_telemetry = False
        self._return_since = math.inf
        self._version_asks = 0
        self._by_streams = self._takes_intervals = False
        self._silent_asks = 0
        self._position_s = -math.inf
        self.commands = Acknowledgements()
        """Acknowledgements of commands by any part of the companion."""
        self.obedience = Obedience(adapter)
        """Judgement on whether the autopilot takes the commands that steer it."""

    @property
    def plan(self) -> FlightPlan:
        """Flight plan, with the autopilot's own response once known where the plan asks for it."""
        return self._plan if self._parameter_check is None else self._parameter_check.plan

    def findings(self) -> list[str]:
        """Return what speaks against take-off in the autopilot's parameters."""
        return [] if self._parameter_check is None else self._parameter_check.faults()

    def retune(self, plan: FlightPlan) -> None:
        """Use another response of the same vehicle."""
        self._plan = plan
        if self._parameter_check is not None:
            self._parameter_check.plan = plan

    def hear_parameter(self, report: ParameterReport) -> None:
        """Process a parameter, whoever has asked for it."""
        if self._parameter_check is not None:
            self._parameter_check.take(report)

    def due(
        self,
        vehicle: GuidedVehicle,
        mode: Mode,
        now: float,
        *,
        stopped: bool,
        returns: Callable[[], bool],
    ) -> list[MAVLink_message]:
        """Return the messages that are due; `returns` tells whether the vehicle is to be handed back.

        A companion that has `stopped`, after its last states, makes no more requests.
        """
        authority = self._authority
        full = vehicle.own.radio.is_full(now)
        stamp = vehicle.own.questions.ask(now) if authority.connected and not full else None
        messages = [] if stamp is None else [time_question(stamp)]
        if now - self._time < HEARTBEAT_S:
            return messages
        self._time = now
        if not self._leaves_to_fail_safe(now, returns):
            messages += self._heartbeats(mode)
        if stopped:
            return messages
        silent = now - vehicle.telemetry_time > self._timeouts.telemetry_s
        slow = vehicle.interval * self._plan.rate_hz * RATE_SHARE > 1.0
        # Unrequested telemetry may have another rate, or several.
        wanted = silent or slow or not self._asked_for_telemetry
        if authority.connected and wanted and not full:
            self._asked_for_telemetry = True
            messages += self._telemetry_requests(now)
        if not silent:
            for text in self.commands.overdue(now):
                self._alerts.say("command", WARNING, text)
        if authority.connected and authority.recognised and not full:
            messages += self._questions(now)
        return messages

    def _telemetry_requests(self, now: float) -> list[MAVLink_message]:
        """Return requests for telemetry by message, or by streams where the former bring none."""
        rate_hz, bank = self._plan.rate_hz, self._plan.hears_bank
        none_came = now - self._position_s > self._timeouts.telemetry_s + HEARTBEAT_S
        # Where nothing is heard, another kind of request brings nothing.
        none_came = none_came and self._authority.silence_s(now) <= FAIL_SAFE_S
        self._silent_asks = self._silent_asks + 1 if none_came else 0
        by_message = [] if self._by_streams else self._adapter.request_telemetry(rate_hz)
        if by_message and bank:
            by_message += self._adapter.request_attitude(rate_hz)
        # A request may get lost, and some autopilots ignore it without an answer.
        by_streams = self._by_streams or self._silent_asks > SILENT_ASKS
        if self._silent_asks == HINT_ASKS:
            self._alerts.say("telemetry", WARNING, NO_STREAM)
        if not by_streams:
            return by_message
        return [*by_message, *self._adapter.request_streams(rate_hz, attitude=bank)]

    def note_position(self, now: float) -> None:
        """Note that a position has come, believed or not."""
        self._position_s = now

    def answered(self, report: CommandReport, now: float) -> None:
        """Process an answer to a command, and tell the pilot of a refusal."""
        if report.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self._takes_intervals = self._takes_intervals or report.result in GOOD
            unsupported = report.result == mavlink.MAV_RESULT_UNSUPPORTED
            self._by_streams = unsupported and not self._takes_intervals
        if report.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            # An autopilot without a hardware number, or without the query, is none the worse for it.
            return
        known = self.obedience.hear(report, now, guided=self._authority.shows_guided)
        if not known:
            self._authority.hear_answer(report, now)
        complaint = self.commands.answered(report, now)
        if complaint is not None and not known:
            self._alerts.say("command", WARNING, complaint)

    def _leaves_to_fail_safe(self, now: float, returns: Callable[[], bool]) -> bool:
        """Check whether the vehicle flies by old setpoints although it should have been handed back.

        A companion that hears no heartbeat, or is not obeyed, can then do nothing more. Its own heartbeats
        would keep off the fail-safe that the autopilot has for the loss of its companion.
        """
        authority = self._authority
        unheard = authority.silence_s(now) > self._timeouts.telemetry_lost_s
        wanted = authority.answers_for_vehicle and (unheard or returns())
        self._return_since = min(self._return_since, now) if wanted else math.inf
        if now - self._return_since <= FAIL_SAFE_S:
            return False
        self._alerts.say("fail-safe", WARNING, FAIL_SAFE)
        return True

    def _heartbeats(self, mode: Mode) -> list[MAVLink_message]:
        """Return own heartbeats, and while no pilot flies those that a ground-station fail-safe counts."""
        if self._adapter.counts_ground_stations and mode is not Mode.PILOT:
            return [heartbeat(), ground_station_heartbeat()]
        return [heartbeat()]

    def _questions(self, now: float) -> list[MAVLink_message]:
        """Return queries for what is not yet known of the autopilot."""
        messages = self._adapter.questions()
        if not messages and self._version_asks < VERSION_ASKS:
            self._version_asks += 1
            messages = [version_question(self._plan.system_id, self._plan.component_id)]
        if self._authority.shows_disarmed and not self._authority.shows_guided:
            messages += self.obedience.questions(now)
        if self._parameter_check is not None:
            messages += self._parameter_check.requests(
                lambda text: self._alerts.say("parameter", WARNING, text)
            )
        return messages
