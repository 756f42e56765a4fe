"""Setpoints that real autopilots were sent, and how they followed: tests/recordings/responses.yaml."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, SteadyWind
from sitl_stub.settings import Settings
from tests.autopilots.emulated import Emulated
from vfguide.elementwise import FloatArray

RECORDINGS = Path(__file__).parents[1] / "recordings"

SYSTEM_ID = 1
EASTWARD_RAD = 0.5 * np.pi
ALTITUDE_M = 684.0
"""Of ArduPlane's flights above mean sea level; PX4's airspeeds are true ones, and it does not matter."""

LATERAL_M_S2 = 9.80665
REPORTS_US = 40_000

GUIDED: Mapping[str, tuple[int, ...]] = {"ardupilot": (15,), "px4": (4, 19)}
"""Modes in which courses are flown, as parameters of DO_SET_MODE."""


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """How an aircraft followed, at its own times: rows of s and a value."""

    course_deg: FloatArray
    """Over ground; unwrapped."""
    ground_speed_m_s: FloatArray
    airspeed_m_s: FloatArray
    """As the autopilot shows it."""
    bank_deg: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """A slice of a flight with a real autopilot."""

    name: str
    courses_deg: FloatArray
    """Setpoints: rows of s and degrees."""
    airspeeds_m_s: FloatArray
    """Setpoints: rows of s and m/s, as shown."""
    followed: Followed
    autopilot: Mapping[str, Any]
    """Settings of the emulator that has to fly the same."""
    wind_m_s: float
    """Toward the east."""
    within: Mapping[str, float]
    """Tolerances: greatest root mean squares of the differences, by the names of `Followed`."""
    settles_s: float
    """At the beginning is not compared."""


def unwrapped(rows: FloatArray) -> FloatArray:
    """Rows of s and degrees, without jumps."""
    return np.column_stack((rows[:, 0], np.unwrap(rows[:, 1], period=360.0)))


def recorded_slices() -> dict[str, Slice]:
    """All slices by name."""
    table = yaml.safe_load((RECORDINGS / "responses.yaml").read_text())
    slices = {}
    with np.load(RECORDINGS / "responses.npz") as arrays:
        for name, one in table["slices"].items():
            rows = {
                kind: arrays[f"{name}.{kind}"].astype(float)
                for kind in ("course", "speed", "flown", "airspeed", "bank")
            }
            flown = rows["flown"]
            slices[name] = Slice(
                name=name,
                courses_deg=rows["course"],
                airspeeds_m_s=rows["speed"],
                followed=Followed(
                    course_deg=unwrapped(flown[:, :2]),
                    ground_speed_m_s=flown[:, ::2],
                    airspeed_m_s=rows["airspeed"],
                    bank_deg=rows["bank"],
                ),
                autopilot=table["autopilots"][one["autopilot"]],
                wind_m_s=one["wind_m_s"],
                within=one["within"],
                settles_s=table["settles_s"],
            )
    return slices


def aircraft_at_start(recorded: Slice, **changes: object) -> Emulated:
    """The emulator as the slice begins, level and in its guided mode."""
    settings = {"airborne": True, "system_id": SYSTEM_ID, **recorded.autopilot, **changes}
    course_deg = float(recorded.followed.course_deg[0, 1]) % 360.0
    slowest, fastest = settings["airspeed_range_m_s"]
    settings["start"] = (-35.36, 149.16, ALTITUDE_M, course_deg)
    settings["airspeed_m_s"] = float(
        np.clip(recorded.followed.airspeed_m_s[0, 1], slowest, fastest)
    )
    config = Settings.of(settings).config()
    wind = SteadyWind(recorded.wind_m_s, EASTWARD_RAD)
    aircraft = Emulated(Autopilot(config, wind), SYSTEM_ID)
    mode = aircraft.command_long(mavlink.MAV_CMD_DO_SET_MODE, 1, *GUIDED[config.autopilot])
    assert aircraft.result(mode) == "ACCEPTED"
    for number in (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
    ):
        assert aircraft.interval(number, REPORTS_US) == "ACCEPTED"
    return aircraft


def send_setpoint(aircraft: Emulated, kind: str, value: float) -> None:
    """Send a course or an airspeed as companions do."""
    if aircraft.autopilot.config.autopilot == "ardupilot":
        command, limit = {
            "course": (mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, LATERAL_M_S2),
            "speed": (mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, 0.0),
        }[kind]
        aircraft.command_int(command, 0.0, value, limit, frame=mavlink.MAV_FRAME_GLOBAL)
    elif kind == "course":
        aircraft.command_long(mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, 0.0, value)
    else:
        aircraft.command_long(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0.0, value, -1.0)


def emulated(recorded: Slice, *, mirrored: bool = False, **changes: object) -> Followed:
    """How the emulator, with some settings changed, follows the setpoints of a slice, or mirrored ones."""
    aircraft = aircraft_at_start(recorded, **changes)
    side = -1.0 if mirrored else 1.0
    sent = [(time_s, "course", side * value % 360.0) for time_s, value in recorded.courses_deg]
    sent += [(time_s, "speed", value) for time_s, value in recorded.airspeeds_m_s]
    ends_s = float(recorded.followed.course_deg[-1, 0])
    for time_s, kind, value in sorted(sent):
        if time_s < ends_s:
            aircraft.advance(time_s)
            send_setpoint(aircraft, kind, value)
    aircraft.advance(ends_s)
    return heard(aircraft)


def heard(aircraft: Emulated) -> Followed:
    """How an aircraft flew by what it reported."""

    def rows(kind: str, *fields: str) -> FloatArray:
        return np.array(
            [
                (time_s, *(getattr(message, field) for field in fields))
                for time_s, message in aircraft.heard
                if message.get_type() == kind
            ],
            dtype=float,
        )

    places = rows("GLOBAL_POSITION_INT", "time_boot_ms", "vx", "vy")
    banks = rows("ATTITUDE", "time_boot_ms", "roll")
    times = 1e-3 * places[:, 1]
    course_deg = np.degrees(np.arctan2(places[:, 3], places[:, 2]))
    return Followed(
        course_deg=unwrapped(np.column_stack((times, course_deg))),
        ground_speed_m_s=np.column_stack((times, 0.01 * np.hypot(places[:, 2], places[:, 3]))),
        airspeed_m_s=rows("VFR_HUD", "airspeed"),
        bank_deg=np.column_stack((1e-3 * banks[:, 1], np.degrees(banks[:, 2]))),
    )


def apart(recorded: Slice, flown: Followed) -> dict[str, float]:
    """How far a flight is from the recorded one, root mean squares by the names of `Followed`."""
    found = {}
    for name in recorded.within:
        wanted, seen = getattr(recorded.followed, name), getattr(flown, name)
        compared = wanted[wanted[:, 0] >= recorded.settles_s]
        off = np.interp(compared[:, 0], seen[:, 0], seen[:, 1]) - compared[:, 1]
        if name == "course_deg":
            # Both are unwrapped, each from its own first one.
            off = np.remainder(off + 180.0, 360.0) - 180.0
        found[name] = float(np.sqrt(np.mean(off**2)))
    return found


def exceeded(recorded: Slice, flown: Followed) -> dict[str, tuple[float, float]]:
    """What is not within its tolerance: (root mean square, tolerance)."""
    found = apart(recorded, flown)
    return {
        name: (round(found[name], 3), within)
        for name, within in recorded.within.items()
        if not found[name] <= within
    }
