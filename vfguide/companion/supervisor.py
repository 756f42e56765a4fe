"""When a companion steers and when it keeps quiet: a pure function of what it knows.

`MODES` is the whole life of a companion. What has happened is found by `event_of`, by ages and distances.
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
    """What a companion is doing."""

    WAITING = "waiting"
    """Nothing to steer by yet: no telemetry, no leader, or the autopilot is not in its guided mode."""
    JOINING = "joining"
    """Steering, still away from the slot or the path."""
    TRACKING = "tracking"
    """Steering, on the slot or the path."""
    PREDICTING = "predicting"
    """Steering by the leader as it would fly its path: nothing has been heard of it for a while."""
    BREAKAWAY = "breakaway"
    """The leader has been silent for too long: steering away from the others."""
    LOST = "lost"
    """Away from the others: the vehicle goes back to its autopilot."""
    PILOT = "pilot"
    """The pilot has taken over: silent until the guided mode comes back."""

    def __init__(self, value: str) -> None:
        """Know whether it steers: asked several times in each step."""
        self.steers = value in {"joining", "tracking", "predicting", "breakaway"}
        """Whether setpoints go out."""


class Control(Enum):
    """In whose hands a vehicle is."""

    UNKNOWN = "unknown"
    """No heartbeat of late."""
    DISARMED = "disarmed"
    """The motor is off."""
    FREE = "free"
    """Not in the guided mode, and it has not been in this flight."""
    GUIDED = "guided"
    """The autopilot obeys."""
    RETURNED = "returned"
    """The autopilot's own, as the companion handed it back."""
    PILOT = "pilot"
    """The pilot has left the guided mode, or a fail-safe has."""
    BARRED = "barred"
    """Not to be steered, whatever its mode: see the companion's objection."""


class Objection(msgspec.Struct, frozen=True, kw_only=True):
    """Why a vehicle is not steered, whatever its mode."""

    key: str
    """Its kind: pilot and log hear each once."""
    text: str
    """What is found, and what to do."""
    returns: bool = True
    """Whether a vehicle that was steered is handed back; not where somebody else steers it."""


class Situation(msgspec.Struct, frozen=True, kw_only=True):
    """What the supervisor decides by."""

    control: Control
    """In whose hands the vehicle is."""
    telemetry_age: float
    """s since the newest position; infinite before the first."""
    leader_age: float
    """s since the newest leader state was true; 0 for the leader itself, infinite before the first."""
    steered: bool
    """Whether it flies by what this companion has sent, and would go on by it."""
    distance: float
    """m from the slot, or from the path for the leader; infinite while not known."""


class ModeTimeouts(msgspec.Struct, frozen=True, kw_only=True):
    """How long each kind of silence is borne, and what counts as being in place."""

    telemetry_s: float = 1.0
    """Position reports."""
    telemetry_lost_s: float = 10.0
    """Position reports, before a vehicle that was steered is handed back."""
    leader_s: float = 0.6
    """Leader states, before the companion says that it is predicting."""
    prediction_s: float = 30.0
    """Leader states, before the formation breaks up."""
    breakaway_s: float = 25.0
    """How long each follower then flies away from the others."""
    arrived_m: float = 10.0
    """Nearer than this to slot or path is in place."""
    strayed_m: float = 20.0
    """Farther than this is not any more."""


class Happening(Enum):
    """What a situation comes to."""

    TAKEN = "taken"
    """The pilot flies, or a fail-safe."""
    UNHEARD = "unheard"
    """Nobody knows in whose hands the vehicle is."""
    RETURNED = "returned"
    """The vehicle is its autopilot's, as it was handed back, and the leader is not heard."""
    UNGUIDED = "unguided"
    """The autopilot is in no mode in which it obeys."""
    NOTHING = "nothing"
    """It obeys, and there is nothing to steer by, or to hand back."""
    NEAR = "near"
    """The leader is heard; in place."""
    BESIDE = "beside"
    """The leader is heard; in place for who was there, not for who comes."""
    AWAY = "away"
    """The leader is heard; not in place."""
    SILENT = "silent"
    """The leader has not been heard for a while."""
    APART = "apart"
    """For so long that all fly apart."""
    OVER = "over"
    """For so long that a vehicle that was steered is handed back."""


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
"""The mode that follows from a mode (rows) and what has happened (columns)."""

NEXT = transitions(MODES, Mode, Happening)


def next_mode(mode: Mode, situation: Situation, timeouts: ModeTimeouts) -> Mode:
    """The mode that follows from a mode and a situation."""
    return NEXT[mode][event_of(situation, timeouts)]


def event_of(situation: Situation, timeouts: ModeTimeouts) -> Happening:
    """What a situation comes to. An age that is no number counts as silence."""
    if situation.control is Control.GUIDED:
        sends = situation.telemetry_age <= timeouts.telemetry_s
        return leader_event(situation, timeouts) if sends else Happening.NOTHING
    if situation.control is Control.RETURNED and not situation.leader_age <= timeouts.leader_s:
        return Happening.RETURNED
    return UNGUIDED.get(situation.control, Happening.UNGUIDED)


def leader_event(situation: Situation, timeouts: ModeTimeouts) -> Happening:
    """What it comes to that the leader is heard, or is not, where the vehicle obeys."""
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
"""What a vehicle comes to that does not obey; otherwise it is in no such mode."""


def obstacle(
    timeouts: ModeTimeouts,
    *,
    telemetry_age: float,
    doubts: bool,
    fault: str | None,
    leader_age: float,
    time_known: bool,
) -> str | None:
    """What would keep a companion from steering, in words; None where nothing would.

    A leader with a companion that is heard is one whose signature, session and clock have been accepted.
    Behind one without, the formation's time shows that the others are heard.

    Args:
        timeouts: of the mission.
        telemetry_age: since the newest position report, s.
        doubts: whether that is not believed.
        fault: why no position is used, and what to do, where that is known.
        leader_age: of the newest leader state, s; 0 for the leader itself.
        time_known: whether the formation's clock is known: without it nobody is told where this vehicle is.
    """
    # Not "above": an age that is no number counts as silence.
    if not telemetry_age <= timeouts.telemetry_s:
        return fault or NOTHING_HEARD
    if doubts:
        return fault or DOUBTED
    if not leader_age <= timeouts.leader_s:
        return NO_LEADER
    if not time_known:
        return NO_TIME
    return None
