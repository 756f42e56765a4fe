"""Identity of the vehicle before it is steered: its autopilot, other controllers, its kind and its place.

| observation | meaning |
|---|---|
| sequence numbers, boot clocks, positions or kinds alternate | two aircraft with one system id |
| two hardware numbers | the same |
| somebody else's steering message, or the autopilot's answer to one | another controller |
| a type in the heartbeat that is no fixed wing | another kind of vehicle |
| a place far from path, slot or origin | a mission for another place |

One aircraft that is heard over two links has two series of sequence numbers, but one boot clock.
"""

import math
from collections import deque

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.companion.plan import FlightPlan
from vfguide.companion.supervisor import Objection
from vfguide.frames import earth_centred, way_m
from vfguide.mavlink.announcements import name_of
from vfguide.mavlink.reports import HeartbeatReport, PositionReport, SteeringReport, VersionReport
from vfguide.mission.place import ENGAGED_M

WITHIN_S = 3.0
"""Time within which evidence of two aircraft must repeat, s."""

TIMES = 4
"""Least number of position jumps: a glitch comes and goes."""

CLOCKS_APART_S = 0.3
"""Tolerance of falling boot times, s: a message overtaken on its way causes as much."""

FALLS = 2
"""Least number of boot clock falls, or of heartbeat changes: a reboot causes one."""

QUIET_S = 10.0
"""Time without evidence after which a conflict is over, s."""

STREAM_COMMANDS = 3
"""This many within `WITHIN_S` show a controller; one outside the guided mode is from a ground station."""

SAME_PLACE_M, FASTEST_M_S = 50.0, 100.0
"""Two series of positions are one aircraft's within this distance (m) plus flight at this speed (m/s)."""

MOST_SERIES = 4
"""Number of series of sequence numbers whose newest positions are remembered."""

FIXED_WINGS = frozenset({mavlink.MAV_TYPE_FIXED_WING, *range(19, 26)})
"""MAV_TYPE values of winged aircraft; 19 to 25 take off vertically."""


class SeenPlace(msgspec.Struct, frozen=True):
    """Newest position of one series."""

    boot_time_s: float
    """Time on its own clock, s."""
    place: tuple[float, float, float]
    """Earth-centred position on the ellipsoid, m."""
    heard_s: float
    """Time of arrival, s."""


def near(one: SeenPlace, other: SeenPlace) -> bool:
    """Check whether one aircraft can have been at both, given the longer of two elapsed times."""
    passed_s = max(abs(other.boot_time_s - one.boot_time_s), abs(other.heard_s - one.heard_s))
    return math.dist(one.place, other.place) <= SAME_PLACE_M + FASTEST_M_S * passed_s


def by_one_clock(one: SeenPlace, other: SeenPlace) -> bool:
    """Check whether the boot times of two positions are those of one clock."""
    apart_s = abs(other.boot_time_s - one.boot_time_s)
    return apart_s <= abs(other.heard_s - one.heard_s) + WITHIN_S


class VehicleIdentity:
    """Identity of one vehicle, as its companion hears it."""

    def __init__(self, system_id: int) -> None:
        self._system_id = system_id
        self._kind: tuple[int, int, bool] | None = None
        self._series: deque[int] = deque(maxlen=MOST_SERIES)
        self._returned: deque[float] = deque(maxlen=FALLS)
        self._fell: deque[float] = deque(maxlen=FALLS)
        self._before: SeenPlace | None = None
        self._uid: tuple[int, float] = (0, -math.inf)
        self._two_s = self._two_numbers_s = self._same_s = -math.inf
        self._jumped: deque[float] = deque(maxlen=TIMES)
        self._places: dict[int, SeenPlace] = {}
        self._steered: deque[float] = deque(maxlen=STREAM_COMMANDS)
        self._other: tuple[int, int] | None = None
        self._other_s = -math.inf

    def note_heartbeat(self, report: HeartbeatReport, now: float) -> None:
        """Take the kind of vehicle; one that alternates is two vehicles."""
        kind = report.vehicle_type, report.autopilot, report.armed
        if self._kind is not None and kind != self._kind:
            self._note_fall(now)
        self._kind = kind
        series = report.series
        if self._series and series != self._series[-1] and series in self._series:
            self._returned.append(now)
            if len(self._returned) == FALLS and now - self._returned[0] <= WITHIN_S:
                self._two_numbers_s = now
        self._series.append(series)

    def note_version(self, report: VersionReport, now: float) -> None:
        """Take the hardware number; another one at the same time is another aircraft."""
        if report.uid == 0:
            return
        before, self._uid = self._uid, (report.uid, now)
        if before[0] not in {0, report.uid} and now - before[1] <= WITHIN_S:
            self._two_s = now

    def note_position(self, report: PositionReport, now: float) -> None:
        """Take a position with its boot time, and compare it with the one before.

        One boot clock and one place in two series of numbers are those of one aircraft over two links.
        """
        place = earth_centred(report.latitude_deg, report.longitude_deg, 0.0)
        seen = SeenPlace(report.boot_time_s, place, now)
        before, self._before = self._before, seen
        if before is not None and seen.boot_time_s < before.boot_time_s - CLOCKS_APART_S:
            self._note_fall(now)
        elif before is not None and not near(before, seen):
            self._jumped.append(now)
            if len(self._jumped) == TIMES and now - self._jumped[0] <= WITHIN_S:
                self._two_s = now
        self._places.pop(report.series, None)
        self._places[report.series] = seen
        if len(self._places) > MOST_SERIES:
            del self._places[next(iter(self._places))]
        if len(self._places) > 1:
            others = [one for series, one in self._places.items() if series != report.series]
            recent = [one for one in others if now - one.heard_s <= WITHIN_S]
            if any(near(one, seen) and by_one_clock(one, seen) for one in recent):
                self._same_s = now

    def _note_fall(self, now: float) -> None:
        """Note a change that a reboot causes once, and two aircraft repeatedly."""
        self._fell.append(now)
        if len(self._fell) == FALLS and now - self._fell[0] <= WITHIN_S:
            self._two_s = now

    def note_steering(self, report: SteeringReport, now: float, *, guided: bool) -> None:
        """Take a steering message of somebody else; `guided`: heartbeats show the guided mode."""
        self._steered.append(now)
        lasts = len(self._steered) == STREAM_COMMANDS and now - self._steered[0] <= WITHIN_S
        if guided or lasts:
            self._other, self._other_s = report.sender, now

    def objection(self, now: float) -> Objection | None:
        """Return why the vehicle must not be steered, and the remedy; None without an objection."""
        kind = mavlink.MAV_TYPE_FIXED_WING if self._kind is None else self._kind[0]
        if kind not in FIXED_WINGS:
            name = name_of("MAV_TYPE", kind).removeprefix("MAV_TYPE_")
            text = f"the vehicle is no fixed wing (MAV_TYPE {kind}, {name}): see --mavlink"
            return Objection(key="type", text=text, returns=False)
        numbers_s = -math.inf if now - self._same_s <= QUIET_S else self._two_numbers_s
        if now - max(self._two_s, numbers_s) <= QUIET_S:
            text = (
                f"two aircraft speak as system {self._system_id}: switch one off, or set its SYSID_THISMAV"
                " (PX4: MAV_SYS_ID)"
            )
            return Objection(key="two", text=text)
        if self._other is not None and now - self._other_s <= QUIET_S:
            system_id, component_id = self._other
            text = (
                f"component {component_id} of system {system_id} steers this vehicle, too: stop it"
            )
            return Objection(key="controller", text=text, returns=False)
        return None


REACH_M, REACH_S = ENGAGED_M, 60.0
"""Engaging is allowed within this distance of path or slot (m), or so many seconds of fastest flight."""

FRAME_M = 200e3
"""Distance from the origin beyond which the earth is too round for the formation's plane, m."""


def far_words(distance: float) -> str:
    """Return a distance (m) in kilometres."""
    return f"{distance / 1e3:.1f} km" if distance < 100e3 else f"{distance / 1e3:,.0f} km"


class EngageRange:
    """Whether one vehicle is near enough to its path or slot, and to the origin, to be engaged."""

    def __init__(self, plan: FlightPlan) -> None:
        self._leads = plan.leads
        self._origin = plan.frame.origin
        self._reach = max(REACH_M, REACH_S * plan.airframe.airspeed_max)
        self._away: str | None = None
        self._was_near = False

    def note(self, report: PositionReport) -> None:
        """Take a position as reported, whether it is believed or not."""
        if self._was_near:
            # A vehicle that was near it in this flight has the right origin and another trouble.
            return
        place = (report.latitude_deg, report.longitude_deg)
        distance = way_m(self._origin, place)
        if distance <= FRAME_M or place == (0.0, 0.0):
            self._was_near = place != (0.0, 0.0)
            self._away = None
            return
        exchanged = way_m((self._origin[1], self._origin[0]), place) <= FRAME_M
        remedy = "exchange its latitude and longitude" if exchanged else "set origin in the mission"
        self._away = f"{far_words(distance)} from the mission's origin: {remedy}"

    def objection(self, distance: float) -> Objection | None:
        """Return why a vehicle must not be engaged at this distance (m) from path or slot; None if it may."""
        if self._away is not None:
            return Objection(key="origin", text=self._away)
        if distance <= self._reach or math.isinf(distance):
            return None
        what = "its path" if self._leads else "its slot"
        where = f"{far_words(distance)} from {what}, engaged within {far_words(self._reach)}"
        remedy = "set the mission's origin and path" if self._leads else "see the leader's place"
        return Objection(key="reach", text=f"{where}: fly nearer, or {remedy}")
