"""What the inner loops hold: one target each for turn, speed and height."""

import math
from typing import Literal

import msgspec
from msgspec.structs import replace

SpeedKind = Literal["airspeed", "ground-speed"]


class TurnTarget(msgspec.Struct, frozen=True):
    """What the lateral loop holds."""

    hold: Literal["course", "heading", "bank"]
    """Course over ground, heading of the nose, or a constant bank (positive right)."""

    angle_rad: float
    """The course, heading or bank held."""

    max_acceleration_m_s2: float = math.inf
    """Lateral acceleration limit of a course or heading; the bank limit holds as well."""


class SpeedTarget(msgspec.Struct, frozen=True):
    """What the speed loop holds. `ground-speed` needs the course-hold plant."""

    kind: SpeedKind
    """Which speed."""

    speed_m_s: float
    """The speed itself, m/s."""

    max_acceleration_m_s2: float = math.inf
    """Limit of its change; the plant's own limit holds as well."""


class AltitudeTarget(msgspec.Struct, frozen=True):
    """What the height loop holds."""

    altitude_amsl_m: float
    """Altitude above mean sea level."""

    max_climb_rate_m_s: float = math.inf
    """Limit of climb and descent; the plant's own limit holds as well."""


class Targets(msgspec.Struct, frozen=True):
    """What the inner loops hold at one moment."""

    turn: TurnTarget
    """Lateral."""

    speed: SpeedTarget
    """Longitudinal."""

    height: AltitudeTarget
    """Vertical."""


def in_true_height(targets: Targets, drift_m: float) -> Targets:
    """What a plant holds for a loop whose altitude shows so much too much."""
    if drift_m == 0.0:
        return targets
    true_m = targets.height.altitude_amsl_m - drift_m
    return replace(targets, height=replace(targets.height, altitude_amsl_m=true_m))
