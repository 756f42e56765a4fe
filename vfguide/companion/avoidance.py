"""Separation: keep one vehicle clear of all others, in the plane and in height, whatever guidance wants.

This is the only place where that is decided, for leader and followers and for all laws alike.
"""

import cmath
import math
from collections.abc import Callable

import msgspec
import numpy as np
from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.height_beside import (
    HEIGHT_OFF_M,
    LEAST_UP_M,
    OVER_M,
    OVER_PILOT_M,
    OVER_SHARE,
    PILOTS_OFF_M_S,
    Obstacle,
    height_sense,
    neighbour_of,
    worth_in_plane,
)
from vfguide.companion.other_aircraft import TIGHT_SHARE, OtherAircraft, joined
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.companion.possibilities import DRIFT_M_S, SILENT_S, Viewpoint
from vfguide.companion.traffic import ASTRAY_M, Traffic, reaction_time
from vfguide.elementwise import BoolArray, FloatArray, wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, course_error_for, speed_range
from vfguide.guidance.height import (
    CLEAR,
    STEP_M,
    HeightTarget,
    best_step,
    clearance,
    deepest,
    heights_ahead,
)
from vfguide.guidance.separation import (
    Agility,
    Clearance,
    Others,
    OwnMotion,
    WantedMotion,
    distances,
    keep_clear,
)
from vfguide.mavlink.announcements import WARNING
from vfguide.state import Airframe, LeaderState, Setpoint, VehicleState

SLIPPING_SHARE = 0.75
"""Share of a coordinated turn rate that an uncoordinated vehicle reaches."""

BESIDE_M = 15.0
"""Vehicles slotted within this distance of the leader are not intruders, m."""

LITTLE_ROOM_M = 1.0
"""Height is used at once where no manoeuvre leaves this much beyond the floor, m."""

ROOM_M = 3.0
"""Height is used where none leaves this much for `INSISTS_S`, m: two that join come as near for a moment."""

INSISTS_S = 0.15

HELD_OFF_S = 4.0
"""Two vehicles that keep each other from their slots this long pass at two heights, s."""

LETS_GO_S = 1.0
"""Interruption that ends being held off, s."""

AROUND_LOOK_S = 0.06
"""Least interval of looking around, s: the others report their positions only every 0.1 to 0.4 s."""

REPORT_S = 0.5
"""Avoidance that lasts longer is worth a text to the pilot, s."""

EPISODE_S = 5.0
"""Time after its last reason for which a step in height is kept, and its text not repeated, s."""

ANSWER_S = 0.4
"""Time constant of approaching a heading, on top of the vehicle's delays, s."""


class AvoidanceStep(msgspec.Struct, frozen=True, kw_only=True):
    """Outcome of one avoidance step."""

    setpoint: Setpoint | None
    """Setpoint that replaces guidance's; None where guidance's is clear."""
    climb_m: float
    """Step to add to the mission's altitude, m."""


class Intent(msgspec.Struct, frozen=True, kw_only=True):
    """Motion of a vehicle if it were alone."""

    wanted: WantedMotion
    """Motion that guidance wants."""
    leader: LeaderState | None
    """Leader's state now; None for the leader itself."""
    astray: float
    """Distance from the slot, or from flying along the path, m."""
    height: HeightTarget
    """Height that guidance wants."""
    gusts: float = 0.0
    """See `Viewpoint`."""
    leaderless: bool = False
    """Whether the formation flies on without the mission's leader."""


class KeepClear:
    """Separation of one vehicle from all others."""

    def __init__(self, plan: FlightPlan, traffic: Traffic, alerts: Alerts | None = None) -> None:
        self._plan = plan
        self._traffic = traffic
        self._alerts = alerts or Alerts()
        foreign = plan.foreign_leader
        self.aircraft = OtherAircraft(
            plan.frame,
            distance_m=plan.traffic_m,
            followed=None if foreign is None else foreign.icao_address,
        )
        """Aircraft outside the formation."""
        self._looked_s = -math.inf
        self._clear: Clearance | None = None
        self._climb_m = 0.0
        self.height_sense = 0
        """Announced direction of leaving the own height, see `HeardState.height_sense`."""
        self._stepped_s = self._begun_s = -math.inf
        self._tight_since = math.inf
        self._held_s = self._held_since_s = -math.inf
        self._changed_since = math.inf
        self._changed_s = -math.inf

    def retune(self, plan: FlightPlan) -> None:
        """Go on with another response of the same vehicle."""
        self._plan = plan

    def step(
        self,
        navigated: NavigatedState,
        turn_rate: float,
        intent: Callable[[], Intent],
        *,
        steered: bool,
    ) -> AvoidanceStep:
        """Check the wanted motion, and change it if it would come too near to another vehicle.

        `steered` tells whether the vehicle flies by the result, so that its pilot should hear of it.
        """
        now, clear = navigated.state.time_s, self._clear
        aim = None
        if not 0.0 <= now - self._looked_s < AROUND_LOOK_S - 0.5 * navigated.period:
            self._looked_s, aim = now, intent()
            self._clear = clear = self._look_around(navigated, turn_rate, aim, steered=steered)
            up = navigated.altitude_amsl - self._plan.frame.altitude_m - aim.height.height
            self.height_sense = height_sense(self._climb_m - up)
        if clear is None or not clear.changed:
            return AvoidanceStep(setpoint=None, climb_m=self._climb_m)
        setpoint = setpoint_of(
            clear,
            (aim or intent()).wanted,
            own_motion(navigated.state, turn_rate, self._plan.airframe),
            self._agility(navigated),
            self._plan.airframe,
        )
        return AvoidanceStep(setpoint=setpoint, climb_m=self._climb_m)

    def _agility(self, navigated: NavigatedState) -> Agility:
        return agility_of(
            navigated.state, self._plan.airframe, slips=self._plan.slips, period=navigated.period
        )

    def _look_around(
        self, navigated: NavigatedState, turn_rate: float, aim: Intent, *, steered: bool
    ) -> Clearance | None:
        """Choose manoeuvre and height step; return None where no vehicle can come near. See `step`."""
        state, airframe = navigated.state, self._plan.airframe
        wind = complex(state.wind_north, state.wind_east)
        here = Viewpoint(
            time_s=state.time_s,
            place=complex(state.north, state.east),
            velocity=cmath.rect(state.ground_speed, state.course),
            wanted=aim.wanted.velocity,
            altitude_amsl=navigated.altitude_amsl,
            wind=wind if cmath.isfinite(wind) else 0j,
            climb_rate=state.climb_rate,
            astray=aim.astray,
            reaction_s=reaction_time(airframe.course_dead_time + airframe.course_lag),
            gusts=aim.gusts,
        )
        own = own_motion(state, turn_rate, airframe)
        found = self._obstacles(here, aim)
        over = self._step_over(here, own, aim, navigated, found)
        if found is None:
            if not over:
                self._step_to(self._height_for(here, own, aim, navigated, None), here)
            self._report(None, 0.0, state.time_s)
            return None
        others, those = found
        agility = self._agility(navigated)
        if any(one.over_m for one in those) and math.isfinite(here.altitude_amsl):
            heights = self._heights_ahead(here, aim)
            others = replace(others, worth=worth_in_plane(heights, others, those))
        side = 0.0 if self._clear is None else self._clear.turn
        clear = keep_clear(own, aim.wanted, others, agility, side=side)
        # In close slots, with nothing to change, two may stay nearer than this for ever.
        room_m = math.inf
        if clear.changed:
            # Slots count from the leader's height: a vehicle in one would climb and descend with it.
            leads = aim.leader is None
            beside = np.array([leads and one.slots_apart_m <= BESIDE_M for one in those])
            least = np.array([one.least_m for one in those])
            room_m = float(np.where(beside, np.inf, clear.nearest - least).min())
        near = those[int(clear.wanted_nearest.argmin())]
        cramped = self._is_tight(room_m, state.time_s)
        held = clear.changed and near.makes_room and aim.leader is not None
        tight = self._is_held_off(aim, state.time_s, held=held) or cramped
        if tight or not over:
            self._stepped_s = state.time_s if tight else self._stepped_s
            flown = clear if cramped else None
            climb_m = self._height_for(here, own, aim, navigated, flown, begins=tight)
            self._step_to(climb_m, here)
        # A late vehicle is reported only once it is silent.
        silent = over and self._stepped_s == state.time_s
        told = None
        if steered and clear.changed:
            told = near
        elif steered and silent:
            told = next((one for one in those if one.over_m > 0.0), None)
        step_m = self._climb_m if tight or silent else 0.0
        self._report(told, step_m, state.time_s, turns=clear.changed)
        return clear

    def _step_to(self, climb_m: float, here: Viewpoint) -> None:
        """Set the height step, and note when it began."""
        if climb_m != self._climb_m:
            self._climb_m, self._begun_s = climb_m, here.time_s

    def _step_over(
        self,
        here: Viewpoint,
        own: OwnMotion,
        aim: Intent,
        navigated: NavigatedState,
        found: tuple[Others, list[Obstacle]] | None,
    ) -> bool:
        """Pass a silent vehicle in height if the wanted way leads near it; return whether it does.

        A late vehicle is not silent yet: a step for it ends with its next state.
        """
        if aim.leader is None:
            return False
        late = self._traffic.late(here.time_s, leader=self._plan.foreign_leader is None)
        agility = self._agility(navigated)
        over = leads_over(own, aim, found, agility)
        if over:
            self._stepped_s = here.time_s
        elif late is not None:
            over = leads_over(own, aim, self._obstacles(here, aim, late=late), agility)
        if over:
            climb_m = self._height_for(here, own, aim, navigated, None, over=True, late=late)
            self._step_to(climb_m, here)
        return over

    def _heights_ahead(self, here: Viewpoint, aim: Intent) -> FloatArray:
        """Return the own heights at `TIMES` with the current step, m above mean sea level."""
        goal = self._plan.frame.altitude_m + aim.height.height + self._climb_m
        return heights_ahead(
            here.altitude_amsl,
            here.climb_rate,
            HeightTarget(height=goal, climb_rate=aim.height.climb_rate, ahead=goal),
            self._plan.airframe,
            begun_s=here.time_s - self._begun_s,
        )

    def _obstacles(
        self, here: Viewpoint, aim: Intent, *, heights: bool = False, late: BoolArray | None = None
    ) -> tuple[Others, list[Obstacle]] | None:
        """Return the tracks of all that may come near, and the vehicle of each; None without any."""
        found = self._traffic.possibilities(here, aim.leader, heights=heights, late=late)
        those = []
        if found is not None:
            lost_for = self._traffic.lost_for(here.time_s, late=late)
            for row, floor in zip(found[1], found[0].floor, strict=True):
                vehicle = self._traffic.vehicle_of(row)
                altitude, climb_rate = self._traffic.height_of(row, here.time_s)
                makes_room = self._traffic.is_steered(row, here.time_s)
                lost_s, slots_apart_m = float(lost_for[row]), self._traffic.slots_apart(row)
                lost = math.isfinite(lost_s)
                taken = aim.leaderless and self._traffic.is_taken(row, here.time_s)
                over_m = min(OVER_PILOT_M if taken else OVER_M, OVER_SHARE * slots_apart_m)
                grown_m = DRIFT_M_S * max(lost_s - SILENT_S, 0.0) if lost else 0.0
                those.append(
                    Obstacle(
                        name=vehicle.name,
                        least_m=float(floor),
                        # Slots in layers may be above each other: then height alone counts.
                        least_up_m=max(float(floor), LEAST_UP_M),
                        altitude_amsl=altitude,
                        climb_rate=climb_rate,
                        under=self._plan.rank > vehicle.rank,
                        makes_room=makes_room,
                        sense=self._traffic.sense_of(row) if makes_room else 0,
                        slots_apart_m=slots_apart_m if makes_room else math.inf,
                        over_m=over_m if taken or lost else 0.0,
                        height_off_m=HEIGHT_OFF_M + grown_m,
                        height_off_m_s=PILOTS_OFF_M_S if taken else 0.0,
                    )
                )
        near = self.aircraft.nearby(here, lambda: self._traffic.places(here))
        if near is None:
            return None if found is None else (found[0], those)
        for name, altitude in zip(near.names, near.altitudes, strict=True):
            those.append(
                Obstacle(
                    name=name,
                    least_m=TIGHT_SHARE * self._plan.traffic_m,
                    least_up_m=STEP_M,
                    altitude_amsl=altitude,
                    climb_rate=aim.height.climb_rate,
                    under=True,
                    makes_room=False,
                )
            )
        return joined(None if found is None else found[0], near.others), those

    def _report(
        self, obstacle: Obstacle | None, climb_m: float, now: float, *, turns: bool = False
    ) -> None:
        """Tell the pilot what is done about a vehicle; None: nothing is done."""
        if obstacle is None:
            self._changed_since = math.inf
            return
        if now - self._changed_s > EPISODE_S:
            self._alerts.forget("separation")
        self._changed_s = now
        self._changed_since = min(self._changed_since, now)
        if now - self._changed_since < REPORT_S and climb_m == 0.0:
            return
        other = obstacle.name
        place = "path" if self._plan.leads else "slot"
        doing = f"keeping clear of {other}, off its {place} until that is past"
        if climb_m != 0.0:
            step = f"{'climbing' if climb_m > 0.0 else 'descending'} {abs(climb_m):.0f} m"
            doing = f"keeping clear of {other}, {step} until that is past"
            if turns:
                doing = f"too near to {other}, turning away and {step}"
        self._alerts.say(
            f"separation: {doing}",
            WARNING,
            f"{doing}; watch {other}, be ready to take over",
            quiet_s=math.inf,
        )

    def _is_tight(self, room_m: float, now: float) -> bool:
        """Check whether the plane is not enough: the best manoeuvre leaves this room (m) beyond the floor."""
        if room_m >= ROOM_M:
            self._tight_since = math.inf
            return False
        self._tight_since = min(self._tight_since, now)
        return room_m < LITTLE_ROOM_M or now - self._tight_since >= INSISTS_S

    def _is_held_off(self, aim: Intent, now: float, *, held: bool) -> bool:
        """Check whether two have blocked each other for so long that this one should leave its height."""
        if not held or aim.astray <= ASTRAY_M:
            return False
        if now - self._held_s > LETS_GO_S:
            self._held_since_s = now
        self._held_s = now
        return now - self._held_since_s >= HELD_OFF_S

    def _height_for(
        self,
        here: Viewpoint,
        own: OwnMotion,
        aim: Intent,
        navigated: NavigatedState,
        clear: Clearance | None,
        *,
        begins: bool = False,
        over: bool = False,
        late: BoolArray | None = None,
    ) -> float:
        """Return the step in height (m) to all others; it stays for a while once the plane is enough.

        `clear` is the manoeuvre in the plane, None for the wanted motion. `begins`: the plane is not enough
        now. `over`: pass a vehicle in height whatever room the plane leaves. `late` vehicles count as silent.
        """
        if self._climb_m == 0.0 and not (begins or over):
            return 0.0
        found = self._obstacles(here, aim, heights=True, late=late)
        if found is None:
            return self._climb_m if here.time_s - self._stepped_s <= EPISODE_S else 0.0
        others, those = found
        distance, closest_s = distances(own, aim.wanted, clear, others, self._agility(navigated))
        origin, wanted = self._plan.frame.altitude_m, aim.height
        up = here.altitude_amsl - origin - wanted.height
        if math.isnan(up):
            up = self._climb_m
        neighbours = [
            neighbour_of(
                one,
                # A step outlasts the predicted tracks: two that change places come nearer.
                distance=min(float(way), one.slots_apart_m),
                in_s=float(in_s),
                height=one.altitude_amsl - origin - wanted.height,
                climb_rate=one.climb_rate - wanted.climb_rate,
                own_height=up,
                own_climb_rate=float(navigated.state.climb_rate) - wanted.climb_rate,
                own_sense=self.height_sense,
            )
            for one, way, in_s in zip(those, distance, closest_s, strict=True)
        ]
        past = here.time_s - self._stepped_s > EPISODE_S and not over
        if past and clearance(0.0, neighbours) >= CLEAR:
            return 0.0
        down = -deepest(min(self._plan.height, wanted.height + up))
        if over and self._climb_m == 0.0:
            best = max((STEP_M, down), key=lambda step: clearance(step, neighbours))
            return best if clearance(best, neighbours) >= clearance(0.0, neighbours) else 0.0
        under = those[int(distance.argmin())].under
        steps = (0.0, STEP_M, down) if under else (0.0, down, STEP_M)
        return best_step(self._climb_m, steps, neighbours)


def leads_over(
    own: OwnMotion, aim: Intent, found: tuple[Others, list[Obstacle]] | None, agility: Agility
) -> bool:
    """Check whether the wanted motion leads near to a silent vehicle."""
    if found is None:
        return False
    others, those = found
    over = np.array([one.over_m for one in those])
    if not over.any():
        return False
    return bool((distances(own, aim.wanted, None, others, agility)[0] < over).any())


def own_motion(state: VehicleState, turn_rate: float, airframe: Airframe) -> OwnMotion:
    """Return the start of a vehicle's tracks, in still air if it holds course and ground speed."""
    if airframe.hold == "course-hold":
        air, wind = cmath.rect(state.ground_speed, state.course), 0j
    else:
        wind = complex(state.wind_north, state.wind_east)
        air = cmath.rect(state.ground_speed, state.course) - wind
    return OwnMotion(
        place=complex(state.north, state.east), air_velocity=air, wind=wind, turn_rate=turn_rate
    )


def agility_of(state: VehicleState, airframe: Airframe, *, slips: bool, period: float) -> Agility:
    """Return how fast a vehicle answers now; a setpoint goes out with the next report (`period`, s)."""
    speed_min, speed_max = speed_range(state, airframe)
    held = state.ground_speed if airframe.hold == "course-hold" else state.airspeed
    share = SLIPPING_SHARE if slips else 1.0
    return Agility(
        turn_rate=share * bank_limited_turn_rate(airframe.max_bank, max(held, 1.0)),
        acceleration=airframe.max_acceleration,
        turn_delay=airframe.course_dead_time + airframe.course_lag + period,
        speed_delay=airframe.speed_dead_time + airframe.speed_lag + period,
        alpha=airframe.alpha,
        beta=airframe.beta,
        speed_min=speed_min,
        speed_max=speed_max,
    )


def setpoint_of(
    clear: Clearance, wanted: WantedMotion, own: OwnMotion, agility: Agility, airframe: Airframe
) -> Setpoint:
    """Return the setpoint that turns the vehicle onto a manoeuvre's heading, within its bank limit."""
    air = wanted.velocity - own.wind
    ahead = (own.turn_rate - wanted.turn_rate) * agility.turn_delay
    flown = cmath.phase(own.air_velocity)
    error = wrap_angle(cmath.phase(air) + clear.turn - flown - ahead)
    rate = wanted.turn_rate + error / (agility.turn_delay + ANSWER_S)
    limit = bank_limited_turn_rate(airframe.max_bank, max(abs(own.air_velocity), 1.0))
    rate = min(max(rate, -limit), limit)
    speed = abs(air) if math.isnan(clear.airspeed) else clear.airspeed
    return Setpoint(
        course=cmath.phase(own.velocity)
        + course_error_for(rate, max(abs(own.air_velocity), 1.0), airframe),
        speed=min(max(speed, agility.speed_min), agility.speed_max),
        turn_limited=True,
    )
