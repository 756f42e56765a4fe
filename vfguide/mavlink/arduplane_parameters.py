"""What in ArduPlane's parameters does not fit a flight, in words: a pure function of their values.

The figures were measured on ArduPlane 4.7 in software.
"""

import math
from collections.abc import Mapping

from vfguide.guidance.limits import GRAVITY
from vfguide.mavlink.parameters import FlightNeeds, airspeed_warnings, bank_warning, first_known

NAMES = (
    *("FS_GCS_ENABL", "GUIDED_P", "SCHED_LOOP_RATE", "TECS_TIME_CONST"),
    *("AIRSPEED_MIN", "AIRSPEED_MAX", "ARSPD_FBW_MIN", "ARSPD_FBW_MAX"),
    *("ROLL_LIMIT_DEG", "LIM_ROLL_CD"),
)
"""Those that matter here; of each pair of limits the second name is the one before version 4.5."""

LEAST_GUIDED_P = 10_000.0
"""Centidegrees of bank for a radian of course error: with less, a course of 30 degrees takes over 3 s."""

MOST_TECS_TIME_CONST = 3.0
"""s: with the default of 5 a change of the demanded speed over 12 s hardly moves the aircraft."""

ALPHA_SHARE = 0.3
"""How far the mission's alpha may be from what GUIDED_P gives."""

LEAST_TURN_SHARE = 0.5
"""A vehicle that slips turns at least this much of what its bank says; the simulated plane does 0.745."""


def arduplane_warnings(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """One line for each parameter that does not fit."""
    known = dict(parameters)
    roll = first_known(known, "ROLL_LIMIT_DEG")
    if roll is None and "LIM_ROLL_CD" in known:
        roll = ("LIM_ROLL_CD (in degrees)", known["LIM_ROLL_CD"] / 100.0)
    return [
        *failsafe_warning(known),
        *course_warnings(known, needs),
        *loop_warning(known, needs),
        *speed_warning(known),
        *airspeed_warnings(
            first_known(known, "AIRSPEED_MIN", "ARSPD_FBW_MIN"),
            first_known(known, "AIRSPEED_MAX", "ARSPD_FBW_MAX"),
            needs,
        ),
        *bank_warning(roll, needs),
    ]


def failsafe_warning(parameters: Mapping[str, float]) -> list[str]:
    """ArduPlane holds commands that stop for ever; one fail-safe alone would notice."""
    if parameters.get("FS_GCS_ENABL", 1.0) != 0.0:
        return []
    return [
        (
            "FS_GCS_ENABL is 0: should this companion fall silent, the aircraft flies its last course on"
            " for ever; set it to 1, and MAV_GCS_SYSID to whose heartbeats count"
        )
    ]


def course_warnings(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """GUIDED_P decides how fast a course is taken up: alpha = GUIDED_P g / V, or less where it slips."""
    gain = parameters.get("GUIDED_P")
    if gain is None:
        return []
    alpha = math.radians(gain / 100.0) * GRAVITY / needs.airspeed
    warnings = []
    if gain < LEAST_GUIDED_P:
        warnings.append(
            f"GUIDED_P is {gain:g}: courses are taken up slowly, and a follower swings about its slot;"
            f" {LEAST_GUIDED_P:g} to 15000 is what flies well"
        )
    slowest = LEAST_TURN_SHARE * alpha if needs.slips else alpha
    # Too little for what the mission counts on, or too much.
    if alpha < (1.0 - ALPHA_SHARE) * needs.alpha or slowest > (1.0 + ALPHA_SHARE) * needs.alpha:
        warnings.append(
            f"GUIDED_P is {gain:g}, which gives alpha {alpha:.2f} 1/s at {needs.airspeed:g} m/s, and the"
            f" mission says {needs.alpha:g}: fly `vfguide identify` and take over what it finds"
        )
    return warnings


def loop_warning(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Telemetry leaves on the scheduler's ticks: other rates come unevenly, or are refused."""
    loop_hz = parameters.get("SCHED_LOOP_RATE")
    if loop_hz is None or loop_hz <= 0.0:
        return []
    ticks = loop_hz / needs.rate_hz
    if ticks < 1.25:
        return [
            (
                f"SCHED_LOOP_RATE is {loop_hz:g}: {needs.rate_hz:g} reports a second will be refused;"
                " set it to 200, or lower rehearsal.rate_hz"
            )
        ]
    if abs(ticks - round(ticks)) > 0.01 and ticks < 8.0:
        return [
            (
                f"SCHED_LOOP_RATE is {loop_hz:g}: {needs.rate_hz:g} reports a second will come unevenly;"
                f" set it to 200, or rehearsal.rate_hz to {loop_hz / math.ceil(ticks):g}"
            )
        ]
    return []


def speed_warning(parameters: Mapping[str, float]) -> list[str]:
    """TECS_TIME_CONST decides how fast the throttle follows the demanded speed."""
    time_const = parameters.get("TECS_TIME_CONST", 0.0)
    if time_const <= MOST_TECS_TIME_CONST:
        return []
    return [
        (
            f"TECS_TIME_CONST is {time_const:g}: the speed answers slowly, and hardly to what changes within"
            f" 12 s; set it to {MOST_TECS_TIME_CONST:g}, or 2 where the aircraft bears it"
        )
    ]
