"""Traffic picture of one vehicle: the other vehicles of its formation, and which of them could come near."""

import cmath
import math
from collections import Counter
from collections.abc import Sequence

import msgspec
import numpy as np

from vfguide.companion.alerts import Alerts
from vfguide.companion.leader_telemetry import LeaderTelemetry
from vfguide.companion.ordered_flight import LAYER_CLEAR_M, OtherSlot
from vfguide.companion.plan import STOPPED_S, OtherVehicle
from vfguide.companion.possibilities import (
    AIRSPEED_S,
    ALONG_S,
    SILENT_S,
    SPACING_SHARE,
    STANDS_S,
    WIND_S,
    IntArray,
    Sightings,
    VehiclesInSight,
    Viewpoint,
    possibilities_of,
)
from vfguide.companion.state_receiver import StateReceiver
from vfguide.companion.timing import SharedClock
from vfguide.elementwise import BoolArray, FloatArray, low_pass
from vfguide.frames import LocalFrame
from vfguide.guidance.height import altimeter_difference
from vfguide.guidance.separation import HORIZON_S, Others, in_formation, place_of, velocity_of
from vfguide.state import GAP_S, HeardState, LeaderState

JOIN_M = 11.0
"""Distance kept from a steered vehicle while away from the own slot, m."""

HOLD_M = 8.0
"""Distance kept while in the own slot, m: a vehicle that is astray keeps more, and goes round."""

ASTRAY_M = 5.0
"""Distance from its slot beyond which a follower is astray, m."""

LEADER_ASTRAY_M = 10.0
"""Beyond this, a leader avoids steered followers: they cannot know how it will turn onto its path, m."""

LATER_S = 0.3
"""A vehicle heard this much later than another shows that the link works without the other, s."""

LATE_STATE_S = 0.35
"""Lateness of a state after which its vehicle may be lost, s: no reason to leave a slot, but to begin a climb
that ends with its next state. At 20 % loss, seven states in a row are lost once an hour."""

LATE_INTERVALS = 2.5
"""Lateness in intervals of a vehicle's states, if greater; followers send five a second. In turns with slots
10 m apart, SILENT_S is too late; at 20 % loss a needless climb there reaches 1 m."""

FORGET_S = 12.0
"""Age at which a vehicle's position is too uncertain to be avoided, s."""

ABOVE_M = 30.0
"""Vehicles farther above or below are not in the way, m."""

STEPPED_M = 15.0
"""Replaces `ABOVE_M` for a steered vehicle, m: a step in height is meant to let it pass above or below."""

SOON_S = 3.0
"""Time for which a climb or descent is assumed to continue, s."""

STEPS_M = 60.0
"""Replaces `ABOVE_M` while a step in height is sought, m: covers the step and the others' moves amply."""

SAFE_M = 30.0
"""Vehicles farther away than this plus what both can fly within the horizon are ignored, m."""

CHORD_M = 0.5
"""Bound on how much shorter chords are than arcs, m: 0.2 m after 2.4 s of a 0.13 rad/s turn at 20 m/s."""

LEADER_WEIGHT = 3.0
"""Weight of the leader where not all distances can be kept: it does not make room itself."""


class Newest(msgspec.Struct, frozen=True):
    """Newest state of a vehicle, reduced to the needs of a quick check."""

    time_s: float
    place: complex
    """North + j east, m."""
    velocity: complex
    """Ground velocity, m/s."""
    turn_rate: float
    """rad/s."""
    acceleration: float
    """Magnitude along the course, m/s²."""
    steered: bool
    """Whether its companion steers it."""


UNHEARD = Newest(-math.inf, 0j, 0j, 0.0, 0.0, steered=False)
"""Placeholder of a vehicle never heard."""


class Traffic:
    """Other vehicles of a formation; for a follower, the leader among them."""

    def __init__(
        self,
        others: Sequence[OtherVehicle],
        frame: LocalFrame,
        clock: SharedClock,
        alerts: Alerts | None = None,
    ) -> None:
        self.vehicles = tuple(others)
        self._rows = {one.name: row for row, one in enumerate(others)}
        self._receivers = {
            one.name: StateReceiver(frame, clock, alerts, whose=one.name)
            for one in others
            if not one.leads
        }
        self._arranged: Sequence[OtherSlot] | None = None
        self._link_lost_s = -math.inf
        self._stopped_s = min((one.stopped_s for one in others if one.leads), default=STOPPED_S)
        self._leader_s = -math.inf if any(one.leads for one in others) else math.inf
        # One row per vehicle, then one per vehicle for a reported position that is not believed.
        count = len(others)
        self._heard = Sightings(2 * count)
        self._newest = [UNHEARD] * count
        # Per vehicle, s: interval of states; newest at the last call of `late`; deadline of the next.
        self._interval_s, self._seen_s = [0.0] * count, [math.nan] * count
        self._due_s = [math.inf] * count
        self._believed, self._doubted_s = self._heard.rows(0, count), -math.inf
        self._carried_s, self._wind = math.inf, 0j
        self._shown_more = np.zeros(count)
        self.satellite_m = math.nan
        """Own satellite altitude less own held altitude, m; NaN while unknown."""
        self._slot = np.array([complex(one.slot.forward, one.slot.right) for one in others] * 2)
        self._heard.offset[:] = self._slot
        self._slot_rate = np.zeros(2 * count, dtype=np.complex128)
        self._above = np.full(2 * count, ABOVE_M)
        self._spacing = np.array([one.spacing for one in others] * 2)
        self._widest: list[float] = (SPACING_SHARE * self._spacing).tolist()
        self._least = np.array([one.least_m for one in others] * 2)
        self._speed_answer_s = np.array([one.speed_answer_s for one in others] * 2)
        self._turning = np.array([one.lateral_acceleration for one in others] * 2)
        self._may_stop = np.array([one.leads and one.may_stop for one in others] + [False] * count)
        self._leads = np.array([one.leads for one in others] + [False] * count, dtype=bool)
        self._weight = np.array([LEADER_WEIGHT if one.leads else 1.0 for one in others] * 2)

    @property
    def counters(self) -> Counter[str]:
        """States of other vehicles that were not used, counted by reason."""
        total: Counter[str] = Counter()
        for receiver in self._receivers.values():
            total += receiver.counters
        return total

    def arrange(self, slots: Sequence[OtherSlot] | None) -> None:
        """Take the ordered slots, in the order of the vehicles; None keeps the present ones."""
        if slots is None or slots is self._arranged:
            return
        self._arranged = slots
        self._slot[:] = [one.slot for one in slots] * 2
        self._slot_rate[:] = [one.rate for one in slots] * 2
        self._spacing[:] = [one.spacing for one in slots] * 2
        self._widest = (SPACING_SHARE * self._spacing).tolist()
        self._above[:] = [LAYER_CLEAR_M if one.layered else ABOVE_M for one in slots] * 2

    def receive(self, vehicle: str, data: bytes, now: float) -> HeardState | None:
        """Take a new state of another follower; return None for a stranger's, or one that is not used."""
        receiver = self._receivers.get(vehicle)
        if receiver is None:
            return None
        taken = receiver.take(data, now)
        self.note(vehicle, receiver)
        return receiver.newest if taken else None

    def unheard(self) -> list[str]:
        """Return the names of followers never heard: nobody can keep clear of them."""
        return [name for name, receiver in self._receivers.items() if receiver.newest is None]

    def lose_link(self, now: float) -> None:
        """Note that the link is disconnected now."""
        self._link_lost_s = now

    def note(
        self,
        vehicle: str,
        receiver: StateReceiver | LeaderTelemetry,
        elsewhere: HeardState | None = None,
    ) -> None:
        """Take the newest state of a vehicle, or both positions where it may be.

        `elsewhere` is a conflicting position told by other vehicles; None without a conflict.
        """
        row = self._rows.get(vehicle)
        if row is None:
            return
        doubted_row = row + len(self.vehicles)
        if receiver.doubted is not None:
            reported, carried = receiver.doubted
            self._note(doubted_row, reported)
            self._note(row, carried)
        elif receiver.newest is not None:
            self._note(row, receiver.newest)
            if elsewhere is not None:
                self._note(doubted_row, elsewhere)
            elif self._doubted_s > -math.inf:
                self._heard.time[doubted_row] = -np.inf
                self._doubted_s = float(self._heard.time[len(self.vehicles) :].max())

    def _note(self, row: int, state: HeardState) -> None:
        known = self._heard
        interval_s = state.time_s - float(known.time[row])
        place, velocity = place_of(state), cmath.rect(state.ground_speed, state.course)
        if row < len(self.vehicles):
            self._interval_s[row] = interval_s
            self._compare_altimeters(row, state, interval_s)
            self._newest[row] = Newest(
                state.time_s,
                place,
                velocity,
                state.turn_rate,
                abs(state.acceleration),
                steered=state.steered,
            )
        airspeed = abs(velocity - self._wind)
        if interval_s > SILENT_S:
            known.since[row], known.airspeed[row] = state.time_s, airspeed
        else:
            before = float(known.airspeed[row])
            known.airspeed[row] = low_pass(before, airspeed, max(interval_s, 0.0), AIRSPEED_S)
        known.time[row] = state.time_s
        if row >= len(self.vehicles):
            self._doubted_s = max(self._doubted_s, state.time_s)
        known.wind[row], known.carried[row], known.run[row] = self._wind, 0j, np.nan
        known.place[row] = place
        known.ahead[row] = cmath.rect(1.0, state.course)
        known.speed[row], known.acceleration[row] = state.ground_speed, state.acceleration
        known.turn_rate[row] = state.turn_rate
        known.altitude[row] = state.altitude_amsl + self._shown_more[row % len(self.vehicles)]
        known.climb_rate[row] = state.climb_rate
        known.steered[row] = state.steered
        known.held[row] = cmath.rect(1.0, state.course_setpoint)
        known.sense[row] = state.height_sense
        if self._leads[row]:
            self._leader_s = state.time_s

    def _compare_altimeters(self, row: int, state: HeardState, interval_s: float) -> None:
        """Learn by how much the own altimeter reads higher than another vehicle's at the same height."""
        if 0.0 < interval_s <= GAP_S and math.isfinite(state.altitude_amsl):
            differ = state.satellite_m - self.satellite_m
            shown_more = altimeter_difference(float(self._shown_more[row]), differ, interval_s)
            self._shown_more[row] = shown_more

    def shown_more(self, vehicle: str) -> float:
        """Return how much higher the own altimeter reads than a vehicle's at the same height, m."""
        row = self._rows.get(vehicle)
        return 0.0 if row is None else float(self._shown_more[row])

    def late(self, now: float, *, leader: bool = True) -> BoolArray | None:
        """Return a mask of vehicles whose next state is overdue, None without any; call often."""
        for row, one in enumerate(self._newest):
            if one.time_s != self._seen_s[row]:
                # The state has arrived since the last call.
                late_s = max(LATE_STATE_S, LATE_INTERVALS * self._interval_s[row])
                self._due_s[row], self._seen_s[row] = now + late_s, one.time_s
        if min(self._due_s, default=math.inf) >= now:
            return None
        late = np.zeros_like(self._leads)
        for row, one in enumerate(self._newest):
            late[row] = self._due_s[row] < now <= one.time_s + SILENT_S
        if not leader:
            late &= ~self._leads
        return late if late.any() else None

    def vehicle_of(self, row: int) -> OtherVehicle:
        """Return the vehicle of a row."""
        return self.vehicles[row % len(self.vehicles)]

    def height_of(self, row: int, now: float) -> tuple[float, float]:
        """Return (altitude AMSL in m, climb rate in m/s), extrapolated for at most `SILENT_S`."""
        rate = float(self._heard.climb_rate[row])
        carried_s = min(now - float(self._heard.time[row]), SILENT_S)
        return float(self._heard.altitude[row]) + rate * carried_s, rate

    def sense_of(self, row: int) -> int:
        """Return which way a vehicle is leaving its height, see `HeardState.height_sense`."""
        return int(self._heard.sense[row])

    def is_steered(self, row: int, now: float) -> bool:
        """Check whether a vehicle is heard to be steered by its companion."""
        heard = self._heard
        return bool(heard.steered[row] and now - heard.time[row] <= SILENT_S)

    def lost_for(self, now: float, *, late: BoolArray | None = None) -> FloatArray:
        """Return how long (s) vehicles with a presumably dead companion are silent; NaN for all others."""
        age = now - self._heard.time
        known = age <= FORGET_S
        quiet, linked = self._quiet(age, known, late=late)
        lost: FloatArray = np.where(known & quiet & linked & self._heard.steered, age, np.nan)
        return lost

    def _quiet(
        self, age: FloatArray, known: BoolArray, *, late: BoolArray | None
    ) -> tuple[BoolArray, BoolArray]:
        """Return (silent, link has worked without it) for each vehicle, by the age of its state, s."""
        # A leader publishes each of its reports: its silence shows sooner.
        quiet = age > np.where(self._leads, min(self._stopped_s, SILENT_S), SILENT_S)
        if late is not None:
            quiet |= late
        return quiet, self._works_for(known & quiet, LATER_S if late is None else 0.0)

    def is_taken(self, row: int, now: float) -> bool:
        """Check whether a vehicle is the leader, and is heard to be steered by no companion."""
        heard = self._heard
        silent = now - heard.time[row] > SILENT_S
        return bool(self._leads[row] and not heard.steered[row] and not silent)

    def slots_apart(self, row: int) -> float:
        """Return the least horizontal distance of a vehicle's slot from the own one in the near future, m."""
        return float(self._spacing[row])

    def places(self, here: Viewpoint) -> list[tuple[complex, complex]]:
        """Return (position in m, velocity in m/s) of vehicles heard recently, extrapolated to now."""
        age = here.time_s - self._believed.time
        recent = np.flatnonzero(age <= FORGET_S)
        if not recent.size:
            return []
        age[age > FORGET_S] = 0.0
        place, velocity = self._believed.propagate(age, here.wind)
        return [(complex(place[row]), complex(velocity[row])) for row in recent]

    def possibilities(
        self,
        here: Viewpoint,
        leader: LeaderState | None,
        *,
        heights: bool = False,
        late: BoolArray | None = None,
    ) -> tuple[Others, IntArray] | None:
        """Return predicted tracks of vehicles that could come near, and their rows; None without any.

        Args:
            here: the own vehicle.
            leader: its leader's state at the same time; None for the leader itself. Unless astray, a leader
                leaves it to steered vehicles to keep clear.
            heights: whether a step in height is sought: then all vehicles count that it may lead to.
            late: vehicles to be taken for silent already, see `late`.
        """
        is_clear = not heights and late is None and self.is_clear(here, leader)
        self._carry(here, glance=is_clear)
        if is_clear:
            return None
        age = here.time_s - self._heard.time
        known = age <= FORGET_S
        quiet, linked = self._quiet(age, known, late=late)
        silent = (age > SILENT_S) | (quiet & linked)
        believed = self._heard.steered
        held = np.where(believed & ~silent, np.minimum(self._above, STEPPED_M), self._above)
        above = STEPS_M if heights else held
        height = self._heard.altitude - here.altitude_amsl
        # Vehicles that converge in height are in the way sooner.
        closing = np.maximum(-np.sign(height) * (self._heard.climb_rate - here.climb_rate), 0.0)
        known &= ~(np.abs(height) - SOON_S * np.nan_to_num(closing) > above)
        alone = known & ~(believed & ~silent)
        if leader is None:
            # A leader that hears no vehicle is deaf itself: steered vehicles keep clear of it.
            alone &= ~believed | linked
            if heights or here.astray > LEADER_ASTRAY_M:
                alone |= known & believed & ~silent
        if not (alone if leader is None else known).any():
            return None
        age[~known] = 0.0
        place, velocity = self._heard.propagate(age, here.wind)
        kept = np.minimum(kept_berth(here.astray), SPACING_SHARE * self._spacing)
        keep = np.maximum(kept, self._least)
        reach = np.abs(velocity) + max(abs(here.wanted), abs(here.velocity))
        near = alone & (np.abs(place - here.place) < SAFE_M + HORIZON_S * reach)
        drift = astray = np.zeros(len(age))
        if leader is not None:
            offset, relative = in_formation(place, velocity, leader)
            self._heard.offset[~silent] = offset[~silent]
            self._heard.drift[~silent] = np.abs(relative)[~silent]
            drift = self._heard.drift
            astray = np.where(silent, drift, np.abs(relative - self._slot_rate))
            own_place, own_drift = in_formation(here.place, here.velocity, leader)
            _, wanted_drift = in_formation(here.place, here.wanted, leader)
            room = np.abs(self._heard.offset - own_place) - keep
            fastest = drift + max(abs(own_drift), abs(wanted_drift))
            near |= known & ~alone & (room < ALONG_S * fastest)
        stopped = known & believed & self._may_stop & (age > self._stopped_s) & linked
        near |= stopped & (
            np.abs(self._heard.place - here.place) < SAFE_M + STANDS_S * abs(here.velocity)
        )
        rows = np.flatnonzero(near)
        if not rows.size:
            return None
        seen = VehiclesInSight(
            row=rows,
            age=age[rows],
            silent=silent[rows],
            stopped=stopped[rows],
            heard_at=self._heard.place[rows],
            believed=believed[rows],
            place=place[rows],
            velocity=velocity[rows],
            held=self._heard.held[rows],
            wind=self._heard.wind[rows],
            carried=self._heard.carried[rows],
            velocity_heard=(self._heard.speed * self._heard.ahead)[rows],
            acceleration=self._heard.acceleration[rows],
            speed_answer_s=self._speed_answer_s[rows],
            airspeed=self._heard.flies[rows],
            run=self._heard.run[rows],
            offset=self._heard.offset[rows],
            turn_rate=self._heard.turn_rate[rows],
            lateral_acceleration=self._turning[rows],
            keep=keep[rows],
            spacing=self._spacing[rows],
            slot=self._slot[rows],
            slot_rate=self._slot_rate[rows],
            drift=astray[rows],
            weight=self._weight[rows],
            # If all are silent, this vehicle is deaf: the others fly on as before.
            linked=linked[rows],
        )
        return possibilities_of(seen, here, leader)

    def _carry(self, here: Viewpoint, *, glance: bool) -> None:
        """Let the wind carry silent vehicles; skipped where a quick check finds none silent."""
        passed_s = here.time_s - self._carried_s
        self._carried_s, self._wind = here.time_s, here.wind
        fresh = all(here.time_s - one.time_s <= WIND_S for one in self._newest)
        if glance and fresh and passed_s >= 0.0:
            self._believed.run.fill(np.nan)
            return
        heard = self._heard if self._doubted_s > -math.inf else self._believed
        heard.carry(here.time_s - heard.time, here, max(0.0, passed_s))

    def _works_for(self, missing: BoolArray, later_s: float) -> BoolArray:
        """Check for each missing vehicle whether the link works: another was heard throughout its silence.

        False where the link was known to be lost meanwhile, or is just back: after a broker's restart
        vehicles reconnect one by one.
        """
        works = np.zeros(len(missing), dtype=bool)
        heard = self._heard
        for row in np.flatnonzero(missing):
            last_s = heard.time[row]
            heard_all_the_time = (heard.since <= last_s) & (heard.time > last_s + later_s)
            works[row] = last_s > self._link_lost_s and heard_all_the_time.any()
        return works

    def is_clear(self, here: Viewpoint, leader: LeaderState | None) -> bool:
        """Check quickly for the usual case: all others are heard and steered, and none can come near."""
        now = here.time_s
        if now - self._leader_s > self._stopped_s or self._doubted_s >= now - FORGET_S:
            return False
        if any(not one.steered or now - one.time_s > SILENT_S for one in self._newest):
            return False
        if leader is None and here.astray > LEADER_ASTRAY_M:
            return False
        if leader is None:
            return True
        place_led, velocity_led, turn = place_of(leader), velocity_of(leader), 1j * leader.turn_rate
        back, berth = cmath.rect(1.0, -leader.course), kept_berth(here.astray)
        own = velocity_led + turn * (here.place - place_led)
        own_drift = max(abs(here.velocity - own), abs(here.wanted - own))
        for row, one in enumerate(self._newest):
            age = now - one.time_s
            half_turn = cmath.rect(1.0, 0.5 * one.turn_rate * age)
            velocity = one.velocity * half_turn
            place = one.place + velocity * age
            away = place - place_led
            drift = abs(velocity * half_turn - velocity_led - turn * away)
            # Error of neglecting accelerations, and of chords in place of arcs.
            left_out = one.acceleration * age * (ALONG_S + age) + CHORD_M
            kept = max(min(berth, self._widest[row]), self.vehicles[row].least_m)
            room = abs(place - here.place) - kept
            if room < ALONG_S * (drift + own_drift) + left_out:
                return False
            self._heard.drift[row], self._heard.offset[row] = drift, away * back
        return True


def kept_berth(astray: float) -> float:
    """Return the distance to keep where slots allow it, by the distance from the own slot, m."""
    share = min(max(astray / ASTRAY_M, 0.0), 1.0)
    return HOLD_M + (JOIN_M - HOLD_M) * share


def reaction_time(delay_s: float) -> float:
    """Return how far ahead the hardest turns of others are predicted, by the own delay, s.

    States heard are half a second old. The own turn begins after its delay and has to undo what both cost.
    """
    return 1.5 + 2.0 * delay_s
