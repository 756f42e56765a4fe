"""Whether an autopilot takes the commands by which it is steered: by its answers, on the ground already.

One that has no such command says so whatever its mode. One that refuses each of them while its heartbeats
show the guided mode has its own reason. Neither is steered.
"""

import math
from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.supervisor import Objection
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.announcements import GOOD, name_of
from vfguide.mavlink.reports import CommandReport

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
