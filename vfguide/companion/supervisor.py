"""Decision on when a companion steers, as a pure function of its knowledge.

`MODES` is the whole life of a companion. `event_of` finds what has happened from ages and distances.
"""

import math
from enum import Enum

import msgspec

from vfguide.transitions import transitions

NOTHING_HEARD = "no position from the autopilot: check --mavlink and the autopilot's stream"
DOUBTED = "the autopilot's position is doubted: see what its pilot is told"
NO_TIME = "the formation's time is not known: see that its timekeeper's companion runs; check link and keys"
NO_LEADER = "the leader is not heard: see that its companion runs, or it sends; check link and keys"


class Mode(Enum):
    """Activity of a companion."""

    WAITING = "waiting"
    """Nothing to steer by: no telemetry, no leader, or the autopilot is not in its guided mode."""
    JOINING = "joining"
    """Steering, still away from the slot or the path."""
    TRACKING = "tracking"
    """Steering, on the slot or the path."""
    PREDICTING = "predicting"
    """Steering by the leader as predicted along its path, as it has been silent for a while."""
    BREAKAWAY = "breakaway"
    """Steering away from the others, as the leader has been silent for too long."""
    LOST = "lost"
    """Away from the others, and handed back to the autopilot."""
    PILOT = "pilot"
    """Silent until the guided mode comes back, as the pilot has taken over."""

    def __init__(self, value: str) -> None:
        """Compute once whether the mode steers, as each step asks several times."""
        self.steers = value in {"joining", "tracking", "predicting", "breakaway"}
        """Whether setpoints are sent."""


class Control(Enum):
    """Party that controls a vehicle."""

    UNKNOWN = "unknown"
    """Unknown: no recent heartbeat."""
    DISARMED = "disarmed"
    """Nobody: the vehicle is disarmed."""
    FREE = "free"
    """Pilot or autopilot, and the right to engage by itself is not spent in this flight."""
    GUIDED = "guided"
    """Companion: the autopilot is in its guided mode."""
    RETURNED = "returned"
    """Autopilot, to which the companion has handed the vehicle back."""
    PILOT = "pilot"
    """Pilot or a fail-safe, after which only the pilot may engage the guided mode."""
    BARRED = "barred"
    """Not the companion, in any mode: see its objection."""


class Objection(msgspec.Struct, frozen=True, kw_only=True):
    """Reason why a vehicle is not steered in any mode."""

    key: str
    """Kind, of which pilot and log hear once."""
    text: str
    """Finding and remedy."""
    returns: bool = True
    """Whether a steered vehicle is handed back; not if somebody else steers it."""


class Situation(msgspec.Struct, frozen=True, kw_only=True):
    """Input of the supervisor's decision."""

    control: Control
    """Party that controls the vehicle."""
    telemetry_age: float
    """Time since the newest position, s; infinite before the first."""
    leader_age: float
    """Age of the newest leader state, s; 0 for the leader itself, infinite before the first."""
    steered: bool
    """Whether the vehicle flies by this companion's setpoints, and would go on by them."""
    distance: float
    """Distance from the slot, or for the leader from the path, m; infinite while not known."""


class ModeTimeouts(msgspec.Struct, frozen=True, kw_only=True):
    """Longest tolerated silences, s, and distances that count as in place, m."""

    telemetry_s: float = 1.0
    """Position reports, s."""
    telemetry_lost_s: float = 10.0
    """Position reports, before a steered vehicle is handed back, s."""
    leader_s: float = 0.6
    """Leader states, before the companion reports that it is predicting, s."""
    prediction_s: float = 30.0
    """Leader states, before the formation breaks up, s."""
    breakaway_s: float = 25.0
    """Time for which each follower then flies away from the others, s."""
    arrived_m: float = 10.0
    """Distance from slot or path up to which a vehicle arrives in place, m."""
    strayed_m: float = 20.0
    """Distance from slot or path up to which a vehicle in place remains so, m."""


class Happening(Enum):
    """Event in the life of a companion."""

    TAKEN = "taken"
    """The pilot or a fail-safe flies the vehicle."""
    UNHEARD = "unheard"
    """It is not known who controls the vehicle."""
    RETURNED = "returned"
    """The autopilot has the vehicle after a hand-back, and the leader is not heard."""
    UNGUIDED = "unguided"
    """The autopilot is in no mode in which it obeys."""
    NOTHING = "nothing"
    """The autopilot obeys, and there is nothing to steer by, or to hand back."""
    NEAR = "near"
    """The leader is heard, and the vehicle is in place."""
    BESIDE = "beside"
    """The leader is heard; the vehicle is in place if it was before, and not if it is joining."""
    AWAY = "away"
    """The leader is heard, and the vehicle is not in place."""
    SILENT = "silent"
    """The leader has been silent for a while."""
    APART = "apart"
    """The leader has been silent for so long that all fly apart."""
    OVER = "over"
    """The leader has been silent for so long that a steered vehicle is handed back."""


MODES = """
|            | taken | unheard | returned | unguided | nothing | near     | beside   | away    | silent     | apart     | over |
| ---------- | ----- | ------- | -------- | -------- | ------- | -------- | -------- | ------- | ---------- | --------- | ---- |
| waiting    | pilot | waiting | waiting  | waiting  | waiting | tracking | joining  | joining | predicting | breakaway | lost |
| joining    | pilot | waiting | waiting  | waiting  | waiting | tracking | joining  | joining | predicting | breakaway | lost |
| tracking   | pilot | waiting | waiting  | waiting  | waiting | tracking | tracking | joining | predicting | breakaway | lost |
| predicting | pilot | waiting | waiting  | waiting  | waiting | tracking | joining  | joining | predicting | breakaway | lost |
| breakaway  | pilot | waiting | waiting  | waiting  | waiting | tracking | joining  | joining | predicting | breakaway | lost |
| lost       | pilot | lost    | lost     | waiting  | waiting | tracking | joining  | joining | predicting | breakaway | lost |
| pilot      | pilot | pilot   | waiting  | waiting  | waiting | tracking | joining  | joining | predicting | breakaway | lost |
"""  # noqa: E501 - a table
"""Next mode by present mode (rows) and event (columns)."""

NEXT = transitions(MODES, Mode, Happening)


def next_mode(mode: Mode, situation: Situation, timeouts: ModeTimeouts) -> Mode:
    """Return the next mode."""
    return NEXT[mode][event_of(situation, timeouts)]


def event_of(situation: Situation, timeouts: ModeTimeouts) -> Happening:
    """Return the event of a situation; an age of NaN counts as silence."""
    if situation.control is Control.GUIDED:
        sends = situation.telemetry_age <= timeouts.telemetry_s
        return leader_event(situation, timeouts) if sends else Happening.NOTHING
    if situation.control is Control.RETURNED and not situation.leader_age <= timeouts.leader_s:
        return Happening.RETURNED
    return UNGUIDED.get(situation.control, Happening.UNGUIDED)


def leader_event(situation: Situation, timeouts: ModeTimeouts) -> Happening:
    """Return the event of an obedient vehicle by the leader's age and the distance."""
    age = situation.leader_age
    if age <= timeouts.leader_s:
        if situation.distance <= timeouts.arrived_m:
            return Happening.NEAR
        return Happening.BESIDE if situation.distance <= timeouts.strayed_m else Happening.AWAY
    if age <= timeouts.prediction_s:
        return Happening.SILENT
    if age <= timeouts.prediction_s + timeouts.breakaway_s:
        return Happening.APART
    return Happening.OVER if situation.steered and math.isfinite(age) else Happening.NOTHING


UNGUIDED = {Control.PILOT: Happening.TAKEN, Control.UNKNOWN: Happening.UNHEARD}
"""Events of vehicles that do not obey; UNGUIDED for any other control."""


def obstacle(
    timeouts: ModeTimeouts,
    *,
    telemetry_age: float,
    doubts: bool,
    fault: str | None,
    leader_age: float,
    time_known: bool,
) -> str | None:
    """Return what would keep a companion from steering, or None.

    A leader with a companion is only heard once its signature, session and clock are accepted. Behind one
    without, the formation's time shows that the others are heard. Without that time nobody is told where this
    vehicle is. Ages are in s, 0 for the leader's own; `fault` explains a doubted or missing position.
    """
    # An age of NaN counts as silence.
    if not telemetry_age <= timeouts.telemetry_s:
        return fault or NOTHING_HEARD
    if doubts:
        return fault or DOUBTED
    if not leader_age <= timeouts.leader_s:
        return NO_LEADER
    if not time_known:
        return NO_TIME
    return None
