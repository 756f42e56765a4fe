"""Who flies: whether the autopilot obeys this companion, and whether it may be asked to.

The pilot always wins: a guided mode that was left comes back by the pilot's hand alone. Two things are not
taken for a pilot: what this companion itself asked for when it gave the vehicle back for lack of a leader,
and a reboot.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.supervisor import Mode
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.reports import CommandReport, HeartbeatReport

REBOOT_S = 5.0
"""A guided mode that was left less than this before a reboot showed was left by the reboot."""


class Engagement:
    """What the autopilot's heartbeats tell."""

    def __init__(self, adapter: AutopilotAdapter, *, allowed: bool) -> None:
        """Before the first heartbeat.

        Args:
            adapter: how to speak to the autopilot.
            allowed: whether the companion may enter the guided mode by itself, the first time.
        """
        self._adapter = adapter
        self._allowed = allowed
        self._given_back = False
        self._left_time = -math.inf
        self._stranger: str | None = None
        self._armed = False
        self._told_unarmed = False
        self.may_enter = allowed
        """Whether the guided mode may be entered now."""
        self.engaged = False
        """Whether the autopilot is in it."""
        self.as_given_back = False
        """Whether it is in the mode that it was given back in."""
        self.connected = False
        """Whether a heartbeat has come."""

    @property
    def recognised(self) -> bool:
        """Whether nothing speaks against this being the autopilot that the adapter speaks to."""
        return self._stranger is None

    def hear(self, report: HeartbeatReport, mode: Mode, now: float) -> str | None:
        """Take a heartbeat, in the supervisor's present mode; a complaint, once, about a stranger."""
        complaint, before = self._adapter.recognise(report.autopilot), self._stranger
        self._stranger = complaint
        self._armed = report.armed
        self.connected = True
        self._note_mode(report.custom_mode, mode, now)
        return complaint if complaint != before else None

    def _note_mode(self, custom_mode: int, mode: Mode, now: float) -> None:
        # Modes are numbers that mean something else to every autopilot.
        engaged = self.recognised and self._adapter.is_engaged(custom_mode)
        # Given back by this companion, the pilot has taken over once it is in any mode but that one.
        self.as_given_back = self._given_back and self._adapter.is_handed_back(custom_mode)
        if self.engaged and not engaged:
            self._left_time = now
        if not (engaged or self.as_given_back) and (self.engaged or self._given_back):
            self.may_enter = False
        if engaged and mode is not Mode.LOST:
            self._given_back = False
        self.engaged = engaged

    def hear_answer(self, report: CommandReport) -> None:
        """Take the answer to the last command of all: a change of mode that was accepted has happened."""
        accepted = report.result == mavlink.MAV_RESULT_ACCEPTED
        if accepted and report.command == mavlink.MAV_CMD_DO_SET_MODE:
            self.engaged = False

    def rebooted(self, now: float) -> None:
        """The autopilot has started anew. If it left the guided mode just now, that was no pilot."""
        if now - self._left_time <= REBOOT_S:
            self.may_enter = self._allowed
        # Its next heartbeat tells which mode it came up in: no pilot has left the one before.
        self.engaged = self._given_back = False

    def give_back(self) -> list[MAVLink_message]:
        """Messages that hand the vehicle to its autopilot, for want of anything to fly."""
        self._given_back = True
        return self._adapter.hand_back()

    def enter(self) -> tuple[list[MAVLink_message], str | None]:
        """(messages that enter the guided mode, a complaint); on the ground that is for the pilot to do."""
        if self._armed:
            self._told_unarmed = False
            return self._adapter.engage(), None
        if self._told_unarmed:
            return [], None
        self._told_unarmed = True
        return [], "the vehicle is not armed: not engaged until it is"
