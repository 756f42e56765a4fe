"""When a companion steers and when it keeps quiet: a pure function of what it knows.

waiting -> joining -> tracking <-> predicting -> breakaway -> lost -> waiting
and pilot, from everywhere, once the autopilot has left its guided mode by another hand than this one's

A vehicle that this companion has not steered is not given back: without a leader it waits.
"""

import math
from enum import Enum

import msgspec

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


def next_mode(mode: Mode, situation: Situation, timeouts: ModeTimeouts) -> Mode:
    """The mode that follows from a mode and a situation."""
    if situation.control is not Control.GUIDED:
        return mode_when_not_guided(mode, situation, timeouts)
    # Not "above": an age that is no number counts as silence.
    if not situation.telemetry_age <= timeouts.telemetry_s:
        return Mode.WAITING
    if not math.isfinite(situation.leader_age):
        return Mode.WAITING
    if situation.leader_age > timeouts.leader_s:
        return mode_when_leader_is_silent(situation, timeouts)
    bound = timeouts.strayed_m if mode is Mode.TRACKING else timeouts.arrived_m
    return Mode.TRACKING if situation.distance <= bound else Mode.JOINING


def mode_when_not_guided(mode: Mode, situation: Situation, timeouts: ModeTimeouts) -> Mode:
    """The autopilot does not obey: a pilot flies, it was handed back, or it never did."""
    if situation.control is Control.PILOT:
        return Mode.PILOT
    if situation.control is Control.UNKNOWN and mode in {Mode.PILOT, Mode.LOST}:
        return mode
    returned = mode is Mode.LOST and situation.control is Control.RETURNED
    return Mode.LOST if returned and not situation.leader_age <= timeouts.leader_s else Mode.WAITING


def mode_when_leader_is_silent(situation: Situation, timeouts: ModeTimeouts) -> Mode:
    """First the leader is predicted, then the formation breaks up, then every autopilot is on its own."""
    if situation.leader_age <= timeouts.prediction_s:
        return Mode.PREDICTING
    breaking_up = situation.leader_age <= timeouts.prediction_s + timeouts.breakaway_s
    if breaking_up:
        return Mode.BREAKAWAY
    return Mode.LOST if situation.steered else Mode.WAITING


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
