"""Everybody back to the autopilot, each at a height of its own: the loiters' circles may cross.

An autopilot loiters at the height in which it begins to. Once its heartbeat shows that it was handed back by
an order that calls everything off, or at the end of the route, it is told another one: above the leader by
so much for each rank. That is asked of it a few times and no more. Nothing depends on it; who is in any other
mode, by its pilot's hand or its own, is told nothing.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.plan import FlightPlan
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.reports import CommandReport

TRIES = 4
"""Heartbeats that are answered with the height, as long as it is not accepted."""


class LoiterHeight:
    """Of one vehicle, once everything was called off."""

    def __init__(self, plan: FlightPlan, adapter: AutopilotAdapter) -> None:
        """Make one that has told nothing yet."""
        self._plan = plan
        self._adapter = adapter
        self._number: int | None = None
        self._tries = 0
        self._altitude = math.nan

    def due(
        self,
        *,
        up: float,
        called_off: int | None,
        returned: bool,
        engaged: bool,
        altitude_amsl: float,
    ) -> list[MAVLink_message]:
        """What a heartbeat that has just been heard is answered with.

        Args:
            up: height of its slot above the leader at the end, m.
            called_off: the number of the order with which everything ended; None where it goes on.
            returned: whether the heartbeat is young, and shows the loiter that this companion has asked for.
            engaged: whether it shows a mode in which the companion steers.
            altitude_amsl: of the vehicle, m.
        """
        if engaged:
            # Only then is the vehicle back in its slot: a further abort finds it where it loiters.
            self._altitude = math.nan
        if called_off is None or not returned:
            return []
        if called_off != self._number:
            self._number, self._tries = called_off, 0
        if not math.isfinite(self._altitude):
            self._altitude = self._own_altitude(altitude_amsl - up)
        if self._tries >= TRIES or not math.isfinite(self._altitude):
            return []
        self._tries += 1
        return self._adapter.loiter_at(self._altitude)

    def answered(self, report: CommandReport) -> None:
        """Take an answer of the autopilot."""
        accepted = report.result == mavlink.MAV_RESULT_ACCEPTED
        if report.command == mavlink.MAV_CMD_DO_CHANGE_ALTITUDE and accepted:
            self._tries = TRIES

    def _own_altitude(self, leader: float) -> float:
        """Where to loiter once the leader flies at an altitude, m: all of the formation within the fence."""
        plan = self._plan
        level = plan.altitude_amsl - plan.up
        lowest = level + min(plan.lowest - plan.height, 0.0)
        highest = level + plan.loiter_room
        return min(max(leader, lowest), highest) + plan.loiter_up
