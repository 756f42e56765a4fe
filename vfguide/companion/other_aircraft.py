"""Aircraft that are not of the formation, as the own autopilot reports them by ADS-B: where they may come.

Anybody with a transmitter can send such reports: they are hostile input. One that cannot be is counted and
not used, and no more aircraft are kept in mind than can matter; the worst that a false one does is what a
true one does, too: the vehicle goes round it. Members of the formation that appear by ADS-B are known by
their own states, and not kept clear of twice; which address is a member's is judged when it is first heard.
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
"""That are kept in mind; of more the one that is farthest away is forgotten."""

STALE_S = 8.0
"""A report that is older says too little: at 60 m/s it has flown half a kilometre since."""

FASTEST_M_S = 350.0
"""Over ground: what says that it is faster, or moves faster from report to report, is no aircraft."""

JUMP_M = 300.0
"""A place may be off by so much, and its time by a second."""

FARTHEST_M = 50e3
"""What is farther away is not looked at."""

MEMBER_M, MEMBER_M_S = 75.0, 8.0
"""A report this near to where a member of the formation says it is, and whose velocity differs by less, is of
that member: 3 s of 20 m/s, and a receiver's error."""

TURN_M_S2 = 5.0
"""A member may have turned as hard since an older report, with 27° of bank: so much more may be between."""

FRESH_S = 1.5
"""A report that is younger, of which whole seconds are known, tells by its velocity, too, whose it is."""

VERDICT_S = 60.0
"""For so long an address is remembered after its last report as a member's or a stranger's. As long all its
reports have to speak against that before it is judged anew: a stranger 5 m/s faster passes in half of it."""

MOST_VERDICTS = 4 * MOST_AIRCRAFT
"""That are remembered; of more the one that was not heard for the longest is forgotten."""

ABOVE_M = 60.0
"""Who is farther above or below, and stays so within the horizon, is not in the way."""

UNSURE_M_S = 5.0
"""So much more distance is kept for each second that a report is old."""

TIGHT_SHARE = 0.6
"""Of the distance to be kept: where no manoeuvre in the plane leaves more, height is used as well."""

WEIGHT = 2.0
"""What it counts where not all distances can be kept: it does not know of the formation."""


class Sighting(msgspec.Struct, frozen=True, kw_only=True):
    """What was reported last of an aircraft."""

    time_s: float
    """When it was true, s on one's own clock."""
    place: complex
    """North + j east, m."""
    velocity: complex
    """Over ground, m/s."""
    tells_velocity: bool
    """Whether the report did, else it is that between two reports, or 0."""
    altitude_amsl: float
    """m above mean sea level; NaN where it is not known."""
    altitude_error: float
    """By how much the altitude may be off, m."""
    climb_rate: float
    """m/s, positive up."""

    def at(self, now: float) -> complex:
        """Where it is if it has flown straight on, m."""
        return self.place + self.velocity * (now - self.time_s)


class AircraftVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """Whether an address is of the formation, on one's own clock."""

    member: bool
    """Not a stranger."""
    sure: bool
    """By a velocity, and of a member by a fresh one: else the first report that is sure decides."""
    heard_s: float
    """When it was last judged by a report, s."""
    borne_out_s: float
    """When a report last agreed with it, s."""


class NearbyAircraft(msgspec.Struct, frozen=True, kw_only=True):
    """Those who may come near."""

    names: tuple[str, ...]
    """Of each, as people read them."""
    altitudes: tuple[float, ...]
    """Of each, m above mean sea level; NaN where not known to the metre."""
    others: Others
    """What each may do, a row for each."""


class OtherAircraft:
    """Aircraft that are not of the formation."""

    def __init__(
        self, frame: LocalFrame, *, distance_m: float, followed: int | None = None
    ) -> None:
        """Begin with none seen.

        Args:
            frame: the formation's local frame.
            distance_m: to be kept from each; 0 to look at none.
            followed: ICAO address of the one that leads the formation, which is kept clear of as a leader.
        """
        self._frame = frame
        self._distance_m = distance_m
        self._followed = followed
        self._known: dict[int, Sighting] = {}
        self._unjudged: set[int] = set()
        self._verdicts: dict[int, AircraftVerdict] = {}
        self._here = 0j
        self.counters: Counter[str] = Counter()
        """Reports that were not used, by reason."""

    def take(self, report: TrafficReport, now: float) -> None:
        """Take a report of the own autopilot, at a time of one's own clock, s."""
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
                # One that was wrong before is forgotten once it is stale, and this one then believed.
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
        """Those who may come near within the horizon; None where there is none.

        Args:
            here: the vehicle that looks around.
            members: finds (place in m, velocity in m/s) of the others of its formation, now.
        """
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
        """Judge what was reported since the last time. See `nearby`.

        All are judged, also those far away: near the vehicle a stranger may look like a member.
        """
        if not self._unjudged:
            return
        now = here.time_s
        formation = [(here.place, here.velocity), *members()]
        for address in self._unjudged:
            found = verdict_on(self._known[address], now, formation)
            before = self._verdicts.pop(address, None)
            if before is None and len(self._verdicts) >= MOST_VERDICTS:
                # Each goes to the end when it is heard.
                del self._verdicts[next(one for one in self._verdicts if one not in self._known)]
            self._verdicts[address] = found if before is None else revised(before, found)
        self._unjudged.clear()

    def _matters(self, one: Sighting, here: Viewpoint) -> bool:
        """Whether it may come within the distance, and into the same height, within the horizon."""
        above = abs(one.altitude_amsl - here.altitude_amsl) - HORIZON_S * abs(one.climb_rate)
        if above > ABOVE_M + one.altitude_error:
            return False
        reach = abs(one.velocity) + max(abs(here.velocity), abs(here.wanted))
        room = self._distance_m + UNSURE_M_S * STALE_S + HORIZON_S * reach
        return abs(one.at(here.time_s) - here.place) < room

    def _forget(self, now: float) -> None:
        for address, one in list(self._known.items()):
            # What was seen in the future was seen before the own clock was set back.
            if not -STALE_S <= now - one.time_s <= STALE_S:
                self._drop(address)
        for address, verdict in list(self._verdicts.items()):
            if address not in self._known and not 0.0 <= now - verdict.heard_s <= VERDICT_S:
                del self._verdicts[address]

    def _drop(self, address: int) -> None:
        del self._known[address]
        self._unjudged.discard(address)

    def _makes_room(self, place: complex) -> bool:
        """Forget the farthest, if it is farther away than this place (m); whether one was forgotten."""
        farthest = max(self._known, key=lambda one: abs(self._known[one].place - self._here))
        if abs(self._known[farthest].place - self._here) <= abs(place - self._here):
            return False
        self._drop(farthest)
        return True


def verdict_on(
    one: Sighting, now: float, members: Sequence[tuple[complex, complex]]
) -> AircraftVerdict:
    """Whether what was seen is one of the formation, by (place in m, velocity in m/s) of all of them, now.

    They are compared where they were when the report was true, as far as they may have turned since.
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
    """A verdict after one more report, which alone would come to `found`."""
    if found.sure and not before.sure:
        return found
    if before.member == found.member:
        return replace(found, sure=before.sure)
    if found.heard_s - before.borne_out_s > VERDICT_S:
        return found
    return replace(before, heard_s=found.heard_s)


def joined(first: Others | None, second: Others) -> Others:
    """What two groups may do, the first's rows before the second's."""
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
