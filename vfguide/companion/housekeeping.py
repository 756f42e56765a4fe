"""What goes to the autopilot by time: heartbeats, requests for telemetry, and questions about it."""

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

# Whether an autopilot takes the commands by which it is steered: by its answers, on the ground already.
#
# One that has no such command says so whatever its mode. One that refuses each of them while its heartbeats
# show the guided mode has its own reason. Neither is steered.

UNSUPPORTED_TIMES = 2
"""Answers that a command is not supported: a single one may be somebody else's."""

REFUSED_TIMES, REFUSED_S = 3, 3.0
"""Refusals in the guided mode, and over how long: a pilot who leaves it shows in a heartbeat sooner."""

ANSWER_S = 3.0
"""An answer to a question on the ground comes within this, s."""


class Obedience:
    """Of one autopilot, since it was started."""

    def __init__(self, adapter: AutopilotAdapter) -> None:
        self._adapter = adapter
        self._asked_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """Note that the autopilot has started anew: its firmware may be another one."""
        self._is_known = False
        self._unsupported: Counter[int] = Counter()
        self._refused: dict[int, list[float]] = {}
        self.refusal: Objection | None = None
        """Why it cannot be steered, and what to do; None where nothing shows that."""

    def questions(self, now: float) -> list[MAVLink_message]:
        """Commands that an autopilot on the ground and outside its guided mode refuses, if it has them."""
        if self._is_known:
            return []
        messages = self._adapter.steering_questions()
        if messages:
            self._asked_s = now
        return messages

    def hear(self, report: CommandReport, now: float, *, guided: bool) -> bool:
        """Take an answer; returns whether nobody has to be told of it, beside what `refusal` says.

        Args:
            report: the answer.
            now: s.
            guided: whether heartbeats show the guided mode.
        """
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
        """Take a heartbeat: in another mode commands are refused rightly, and may be tried again later."""
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
"""Interval of heartbeats, and of tries of what the autopilot has not answered to."""

FAIL_SAFE_S = 5.0
"""For so long a vehicle is to be handed back before it is left to its autopilot's fail-safe."""

FAIL_SAFE = (
    "nothing to steer by, and it does not show that it was handed back: this companion falls silent, for the"
    " autopilot's fail-safe to act where it is set; take over"
)
"""What the pilot hears then."""

VERSION_ASKS = 2
"""How often the number of its hardware is asked for: whoever shares its name answers, too."""

SILENT_ASKS, HINT_ASKS = 3, 8
"""After so many requests without a position streams are asked for as well, and the pilot hears of it."""

NO_STREAM = (
    "the autopilot sends no positions although it is asked: set SRx_POSITION, SRx_EXTRA2 and SRx_EXTRA1"
    " of its port (PX4: MAV_x_MODE) to the mission's rate"
)
"""What the pilot hears then."""

RATE_SHARE = 0.7
"""Below this share of the rate that was asked for, telemetry is asked for again."""


class Housekeeping:
    """Of one companion."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        authority: ModeAuthority,
        alerts: Alerts,
        *,
        inspect: bool,
    ) -> None:
        """Make one that has sent nothing yet.

        Args:
            plan: of the vehicle.
            adapter: how to speak to its autopilot.
            authority: who may steer.
            alerts: takes what the pilot should know.
            inspect: whether to ask for the autopilot's parameters and warn of what does not fit the flight.
        """
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
        """Of commands that were sent, by whatever part of the companion."""
        self.obedience = Obedience(adapter)
        """Whether the autopilot takes the commands by which it is steered."""

    @property
    def plan(self) -> FlightPlan:
        """With what the autopilot said of itself, once it has and where it is asked for."""
        return self._plan if self._parameter_check is None else self._parameter_check.plan

    def findings(self) -> list[str]:
        """What of the autopilot's parameters speaks against taking off."""
        return [] if self._parameter_check is None else self._parameter_check.faults()

    def retune(self, plan: FlightPlan) -> None:
        """Keep another response of the same vehicle."""
        self._plan = plan
        if self._parameter_check is not None:
            self._parameter_check.plan = plan

    def hear_parameter(self, report: ParameterReport) -> None:
        """Take a parameter, asked for by whomever."""
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
        """What is to be sent now.

        Args:
            vehicle: that is guided.
            mode: of the companion.
            now: s.
            stopped: whether the companion has said its last words: then nothing is asked any more.
            returns: tells whether the vehicle is to be handed back.
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
        # What comes unasked may have another rate, or its parts each their own.
        if authority.connected and (silent or slow or not self._asked_for_telemetry):
            self._asked_for_telemetry = True
            messages += self._telemetry_requests(now)
        if not silent:
            for text in self.commands.overdue(now):
                self._alerts.say("command", WARNING, text)
        if authority.connected and authority.recognised and not full:
            messages += self._questions(now)
        return messages

    def _telemetry_requests(self, now: float) -> list[MAVLink_message]:
        """What asks for telemetry: message by message, or by streams where that brings none."""
        rate_hz, bank = self._plan.rate_hz, self._plan.hears_bank
        none_came = now - self._position_s > self._timeouts.telemetry_s + HEARTBEAT_S
        # Where nothing at all is heard another way of asking brings nothing.
        none_came = none_came and self._authority.silence_s(now) <= FAIL_SAFE_S
        self._silent_asks = self._silent_asks + 1 if none_came else 0
        by_message = [] if self._by_streams else self._adapter.request_telemetry(rate_hz)
        if by_message and bank:
            by_message += self._adapter.request_attitude(rate_hz)
        # A request may get lost; an autopilot may also ignore it without an answer.
        by_streams = self._by_streams or self._silent_asks > SILENT_ASKS
        if self._silent_asks == HINT_ASKS:
            self._alerts.say("telemetry", WARNING, NO_STREAM)
        if not by_streams:
            return by_message
        return [*by_message, *self._adapter.request_streams(rate_hz, attitude=bank)]

    def note_position(self, now: float) -> None:
        """Take that a position has come, whether it is believed or not."""
        self._position_s = now

    def answered(self, report: CommandReport, now: float) -> None:
        """Take an answer to a command, and tell the pilot of a refusal."""
        if report.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self._takes_intervals = self._takes_intervals or report.result in GOOD
            unsupported = report.result == mavlink.MAV_RESULT_UNSUPPORTED
            self._by_streams = unsupported and not self._takes_intervals
        if report.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            # Who has no number, or cannot be asked for it, is none the worse for it.
            return
        known = self.obedience.hear(report, now, guided=self._authority.shows_guided)
        if not known:
            self._authority.hear_answer(report, now)
        complaint = self.commands.answered(report, now)
        if complaint is not None and not known:
            self._alerts.say("command", WARNING, complaint)

    def _leaves_to_fail_safe(self, now: float, returns: Callable[[], bool]) -> bool:
        """Whether a vehicle flies on by old setpoints although it should have been handed back.

        Nothing more can be done then by a companion that hears no heartbeat, or is not obeyed. Its own
        heartbeats would keep off the fail-safe that the autopilot has for the loss of its companion.
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
        """Of this companion; while no pilot flies also of what the autopilot's fail-safe counts."""
        if self._adapter.counts_ground_stations and mode is not Mode.PILOT:
            return [heartbeat(), ground_station_heartbeat()]
        return [heartbeat()]

    def _questions(self, now: float) -> list[MAVLink_message]:
        """What is not known of the autopilot yet."""
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
