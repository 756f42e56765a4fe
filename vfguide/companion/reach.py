"""How far from its path or slot a vehicle is taken up: who is farther away has another place in mind."""

import math

from vfguide.companion.plan import FlightPlan
from vfguide.companion.supervisor import Objection
from vfguide.frames import way_m
from vfguide.mavlink.reports import PositionReport
from vfguide.mission.place import ENGAGED_M

REACH_M, REACH_S = ENGAGED_M, 60.0
"""Nearer than this to path or slot, or so many seconds of its fastest flight, a vehicle may be engaged."""

FRAME_M = 200e3
"""Farther from the origin than this the earth is too round for the formation's plane."""


def far_words(distance: float) -> str:
    """A distance (m) in kilometres."""
    return f"{distance / 1e3:.1f} km" if distance < 100e3 else f"{distance / 1e3:,.0f} km"


class EngageRange:
    """Of one vehicle."""

    def __init__(self, plan: FlightPlan) -> None:
        self._leads = plan.leads
        self._origin = plan.frame.origin
        self._reach = max(REACH_M, REACH_S * plan.airframe.airspeed_max)
        self._away: str | None = None
        self._was_near = False

    def note(self, report: PositionReport) -> None:
        """Take a position as it was reported, whether it is believed or not."""
        place = (report.latitude_deg, report.longitude_deg)
        distance = way_m(self._origin, place)
        if distance <= FRAME_M or place == (0.0, 0.0):
            self._was_near = self._was_near or place != (0.0, 0.0)
            self._away = None
            return
        exchanged = way_m((self._origin[1], self._origin[0]), place) <= FRAME_M
        remedy = "exchange its latitude and longitude" if exchanged else "set origin in the mission"
        self._away = f"{far_words(distance)} from the mission's origin: {remedy}"

    def objection(self, distance: float) -> Objection | None:
        """Why a vehicle that is not steered is not taken up here, and what to set; None where it may be.

        Args:
            distance: from path or slot, m; infinite while not known.
        """
        # Who has been there in this flight has the right origin and another trouble.
        if self._away is not None and not self._was_near:
            return Objection(key="origin", text=self._away)
        if distance <= self._reach or math.isinf(distance):
            return None
        what = "its path" if self._leads else "its slot"
        where = f"{far_words(distance)} from {what}, engaged within {far_words(self._reach)}"
        remedy = "set the mission's origin and path" if self._leads else "see the leader's place"
        return Objection(key="reach", text=f"{where}: fly nearer, or {remedy}")
