"""Aircraft outside the formation, as the own autopilot reports them by ADS-B, and where they may come.

Anybody with a transmitter can send such reports: they are hostile input. Impossible ones are counted and not
used, and the number of remembered aircraft is bounded. A false report at worst has the effect of a true one:
the vehicle goes round the aircraft. Members of the formation that appear by ADS-B are known by their own
states, and are not kept clear of twice. An address is judged as a member's when it is first heard.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence

import msgspec
import numpy as np
from msgspec.structs import replace

from vfguide.companion.possibilities import Viewpoint
from vfguide.frames import LocalFrame
from vfguide.guidance.separation import BEGINNINGS, HORIZON_S, Others, arc
from vfguide.mavlink.reports import TrafficReport

MOST_AIRCRAFT = 32
"""Greatest number of remembered aircraft; beyond it the farthest is forgotten."""

STALE_S = 8.0
"""Age at which a report says too little, s: at 60 m/s the aircraft has flown half a kilometre since."""

FASTEST_M_S = 350.0
"""Ground speed, reported or from report to report, above which it is no aircraft, m/s."""

JUMP_M = 300.0
"""Tolerance of a position, m; its time may be off by a second."""

FARTHEST_M = 50e3
"""Distance beyond which aircraft are ignored, m."""

MEMBER_M, MEMBER_M_S = 75.0, 8.0
"""Greatest difference of position (m) and velocity (m/s) from those that a member states of itself, for the
report to be the member's. That is 3 s of 20 m/s, and a receiver's error."""

TURN_M_S2 = 5.0
"""Acceleration of a member since an older report, m/s² (27° of bank): widens `MEMBER_M` and `MEMBER_M_S`."""

FRESH_S = 1.5
"""Age up to which a report's velocity also tells whose it is, s; ages are known to whole seconds."""

VERDICT_S = 60.0
"""Time for which a verdict on an address is remembered after its last report, s. To be judged anew, all its
reports must contradict the verdict for as long: a stranger 5 m/s faster passes in half of it."""

MOST_VERDICTS = 4 * MOST_AIRCRAFT
"""Greatest number of remembered verdicts; beyond it the one unheard for longest is forgotten."""

ABOVE_M = 60.0
"""Aircraft farther above or below throughout the horizon are not in the way, m."""

UNSURE_M_S = 5.0
"""Distance added for each second of a report's age, m/s."""

TIGHT_SHARE = 0.6
"""Share of the distance to keep below which height is used, where no manoeuvre in the plane leaves more."""

WEIGHT = 2.0
"""Weight where not all distances can be kept: the aircraft does not know of the formation."""


class Sighting(msgspec.Struct, frozen=True, kw_only=True):
    """Newest report of an aircraft."""

    time_s: float
    """Time of validity, s on the own clock."""
    place: complex
    """North + j east, m."""
    velocity: complex
    """Ground velocity, m/s."""
    tells_velocity: bool
    """Whether the velocity was reported; else it is derived from two reports, or 0."""
    altitude_amsl: float
    """m above mean sea level; NaN where unknown."""
    altitude_error: float
    """Greatest error of the altitude, m."""
    climb_rate: float
    """m/s, positive up."""

    def at(self, now: float) -> complex:
        """Return the position after straight flight until now, m."""
        return self.place + self.velocity * (now - self.time_s)


class AircraftVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """Whether an address belongs to the formation; times on the own clock."""

    member: bool
    sure: bool
    """Whether a reported velocity decided it, fresh for a member; else the first sure report decides."""
    heard_s: float
    """When a report was last judged, s."""
    borne_out_s: float
    """When a report last agreed, s."""


class NearbyAircraft(msgspec.Struct, frozen=True, kw_only=True):
    """Aircraft that may come near."""

    names: tuple[str, ...]
    altitudes: tuple[float, ...]
    """m above mean sea level; NaN where not exactly known."""
    others: Others
    """Predicted tracks, one row per aircraft."""


class OtherAircraft:
    """Aircraft outside the formation."""

    def __init__(
        self, frame: LocalFrame, *, distance_m: float, followed: int | None = None
    ) -> None:
        """Begin with none seen.

        Args:
            frame: the formation's local frame.
            distance_m: distance to keep from each, m; 0 ignores them.
            followed: ICAO address of the formation's leader, which is kept clear of as a leader.
        """
        self._frame = frame
        self._distance_m = distance_m
        self._followed = followed
        self._known: dict[int, Sighting] = {}
        self._unjudged: set[int] = set()
        self._verdicts: dict[int, AircraftVerdict] = {}
        self._here = 0j
        self.counters: Counter[str] = Counter()
        """Reports that were not used, counted by reason."""

    def take(self, report: TrafficReport, now: float) -> None:
        """Take a report of the own autopilot, received at a time of the own clock, s."""
        if self._distance_m <= 0.0 or report.icao_address == self._followed:
            return
        self._forget(now)
        north, east = self._frame.to_local(report.latitude_deg, report.longitude_deg)
        place, time_s = complex(north, east), now - report.age_s
        velocity = None if report.velocity is None else complex(*report.velocity)
        if velocity is not None and abs(velocity) > FASTEST_M_S:
            self.counters["traffic: too fast"] += 1
            return
        if abs(place - self._here) > FARTHEST_M:
            self.counters["traffic: far away"] += 1
            return
        before = self._known.get(report.icao_address)
        if before is not None:
            passed_s = time_s - before.time_s
            if abs(place - before.place) > JUMP_M + FASTEST_M_S * max(passed_s, 0.0):
                # If instead the earlier report was wrong, it is forgotten once stale, and this one believed.
                self.counters["traffic: cannot have got there"] += 1
                return
            if velocity is None:
                moved = place != before.place and passed_s > 0.0
                velocity = (place - before.place) / passed_s if moved else before.velocity
        elif len(self._known) >= MOST_AIRCRAFT and not self._makes_room(place):
            self.counters["traffic: too many"] += 1
            return
        if velocity is not None and abs(velocity) > FASTEST_M_S:
            velocity = 0j
        self._known[report.icao_address] = Sighting(
            time_s=time_s,
            place=place,
            velocity=velocity or 0j,
            tells_velocity=report.velocity is not None,
            altitude_amsl=report.altitude_amsl,
            altitude_error=report.altitude_error,
            climb_rate=report.climb_rate,
        )
        self._unjudged.add(report.icao_address)

    def nearby(
        self, here: Viewpoint, members: Callable[[], Sequence[tuple[complex, complex]]]
    ) -> NearbyAircraft | None:
        """Return aircraft that may come near in the horizon; `members` are (position m, velocity m/s) now."""
        self._here = here.place
        if not self._known:
            return None
        self._forget(here.time_s)
        self._judge(here, members)
        found = [
            (address, one)
            for address, one in self._known.items()
            if not self._verdicts[address].member and self._matters(one, here)
        ]
        if not found:
            return None
        ages = np.array([here.time_s - one.time_s for _, one in found])
        places = np.array([one.at(here.time_s) for _, one in found], dtype=np.complex128)
        velocities = np.array([one.velocity for _, one in found], dtype=np.complex128)
        keep = self._distance_m + UNSURE_M_S * ages
        count = len(found)
        return NearbyAircraft(
            names=tuple(f"aircraft {address:06X}" for address, _ in found),
            altitudes=tuple(
                one.altitude_amsl if one.altitude_error == 0.0 else math.nan for _, one in found
            ),
            others=Others(
                tracks=arc(places[:, None], velocities[:, None], 0.0),
                horizon_s=np.full(count, HORIZON_S),
                keep=keep,
                floor=np.full(count, self._distance_m),
                weight=np.full(count, WEIGHT),
                passes=np.zeros(count),
                margin=np.zeros((count, len(BEGINNINGS))),
            ),
        )

    def _judge(
        self, here: Viewpoint, members: Callable[[], Sequence[tuple[complex, complex]]]
    ) -> None:
        """Judge all aircraft reported since the last call: nearby, a stranger may look like a member."""
        if not self._unjudged:
            return
        now = here.time_s
        formation = [(here.place, here.velocity), *members()]
        for address in self._unjudged:
            found = verdict_on(self._known[address], now, formation)
            before = self._verdicts.pop(address, None)
            if before is None and len(self._verdicts) >= MOST_VERDICTS:
                # Verdicts are ordered by when they were last heard.
                del self._verdicts[next(one for one in self._verdicts if one not in self._known)]
            self._verdicts[address] = found if before is None else revised(before, found)
        self._unjudged.clear()

    def _matters(self, one: Sighting, here: Viewpoint) -> bool:
        """Check whether an aircraft may come within the distance and the same height within the horizon."""
        above = abs(one.altitude_amsl - here.altitude_amsl) - HORIZON_S * abs(one.climb_rate)
        if above > ABOVE_M + one.altitude_error:
            return False
        reach = abs(one.velocity) + max(abs(here.velocity), abs(here.wanted))
        room = self._distance_m + UNSURE_M_S * STALE_S + HORIZON_S * reach
        return abs(one.at(here.time_s) - here.place) < room

    def _forget(self, now: float) -> None:
        for address, one in list(self._known.items()):
            # Sightings in the future precede a step back of the own clock.
            if not -STALE_S <= now - one.time_s <= STALE_S:
                self._drop(address)
        for address, verdict in list(self._verdicts.items()):
            if address not in self._known and not 0.0 <= now - verdict.heard_s <= VERDICT_S:
                del self._verdicts[address]

    def _drop(self, address: int) -> None:
        del self._known[address]
        self._unjudged.discard(address)

    def _makes_room(self, place: complex) -> bool:
        """Forget the farthest aircraft if it is farther than a position (m); return whether it was."""
        farthest = max(self._known, key=lambda one: abs(self._known[one].place - self._here))
        if abs(self._known[farthest].place - self._here) <= abs(place - self._here):
            return False
        self._drop(farthest)
        return True


def verdict_on(
    one: Sighting, now: float, members: Sequence[tuple[complex, complex]]
) -> AircraftVerdict:
    """Judge whether an aircraft is of the formation, by (position in m, velocity in m/s) of all members now.

    Members are carried back to the time of the report, with a tolerance for turns since.
    """
    age = max(now - one.time_s, 0.0)
    reach, change = MEMBER_M + 0.5 * TURN_M_S2 * age**2, MEMBER_M_S + TURN_M_S2 * age
    member = any(
        abs(one.place - (place - velocity * age)) < reach
        and (not one.tells_velocity or abs(one.velocity - velocity) < change)
        for place, velocity in members
    )
    sure = one.tells_velocity and (not member or age <= FRESH_S)
    return AircraftVerdict(member=member, sure=sure, heard_s=now, borne_out_s=now)


def revised(before: AircraftVerdict, found: AircraftVerdict) -> AircraftVerdict:
    """Return a verdict updated by one more report, whose own verdict is `found`."""
    if found.sure and not before.sure:
        return found
    if before.member == found.member:
        return replace(found, sure=before.sure)
    if found.heard_s - before.borne_out_s > VERDICT_S:
        return found
    return replace(before, heard_s=found.heard_s)


def joined(first: Others | None, second: Others) -> Others:
    """Return the tracks of two groups, the first's rows before the second's."""
    if first is None:
        return second
    return Others(
        tracks=np.concatenate([first.tracks, second.tracks]),
        horizon_s=np.concatenate([first.horizon_s, second.horizon_s]),
        keep=np.concatenate([first.keep, second.keep]),
        floor=np.concatenate([first.floor, second.floor]),
        weight=np.concatenate([first.weight, second.weight]),
        passes=np.concatenate([first.passes, second.passes]),
        margin=np.concatenate([first.margin, second.margin]),
    )
