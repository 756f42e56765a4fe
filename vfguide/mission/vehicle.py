"""Vehicles of a mission file."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from vfguide.mission.consistency import DEFAULT_AIRSPEED_RANGE_M_S
from vfguide.mission.quantity import (
    Duration,
    Gain,
    Number,
    Section,
    Speed,
    Switch,
    known_in,
)
from vfguide.registry import autopilots
from vfguide.state import SpeedHold

DEFAULT_MAX_BANK_DEG = 45.0
"""Default bank limit, degrees."""


def _ascending(airspeed_range: tuple[float, float]) -> tuple[float, float]:
    lowest, highest = airspeed_range
    if lowest >= highest:
        kind = "airspeed_range"
        message = "the lowest airspeed comes first and must be below the highest"
        raise PydanticCustomError(kind, message)
    return airspeed_range


EngageMode = Literal["LOITER", "CRUISE", "FBWB", "TAKEOFF", "HOLD", "POSITION", "ALTITUDE"]
"""Mode names of ground stations, except modes that return, land or fly a mission."""

Climb = Annotated[Number, Field(ge=-30.0, le=30.0)]


def _sink_and_climb(climb_range: tuple[float, float]) -> tuple[float, float]:
    lowest, highest = climb_range
    if not lowest < 0.0 < highest:
        kind = "climb_range"
        message = "the fastest descent comes first and is negative, the fastest climb is above 0"
        raise PydanticCustomError(kind, message)
    return climb_range


ClimbRange = Annotated[tuple[Climb, Climb], AfterValidator(_sink_and_climb)]

AirspeedRange = Annotated[tuple[Speed, Speed], AfterValidator(_ascending)]


class Vehicle(Section):
    """One aircraft: its address, its autopilot and what it can do."""

    system_id: Annotated[int, Field(strict=True, ge=1, le=255)]
    """MAVLink system id, 1 to 254, different for each vehicle; ground stations have 255, and one may lead."""

    component_id: Annotated[int, Field(strict=True, ge=1, le=255)] = 1
    """MAVLink component id of its autopilot."""

    autopilot: Annotated[str, AfterValidator(known_in(autopilots))] = "ardupilot"
    """Which autopilot flies it; decides how setpoints and modes are spoken. `auto` finds out from its
    heartbeat, `mavsdk` is PX4 spoken to by way of MAVSDK."""

    px4_steering: Literal["auto", "guided-course", "position", "velocity"] = "auto"
    """How a PX4 is steered. `auto`: Guided Course from 1.18 on, positions ahead in offboard on 1.15 to 1.17,
    velocities before. What stops the aircraft when its companion dies is NAV_DLL_ACT in Guided Course (0, its
    default: nothing), COM_OBL_RC_ACT in offboard."""

    plant: Literal["course-hold", "heading-hold"] = "heading-hold"
    """What its two first-order holds act on: course and ground speed, or heading and airspeed."""

    alpha_1_s: Annotated[Gain, Field(le=20.0)] = 1.2
    """alpha of the article: bandwidth of the course (or heading) hold, 1/s."""

    beta_1_s: Annotated[Gain, Field(le=20.0)] = 0.8
    """beta of the article: bandwidth of the speed hold, 1/s."""

    airspeed_range_m_s: AirspeedRange = DEFAULT_AIRSPEED_RANGE_M_S
    """Lowest and highest airspeed it may be asked for, m/s."""

    max_bank_deg: Annotated[Number, Field(ge=1.0, le=80.0)] = DEFAULT_MAX_BANK_DEG
    """Steepest bank, degrees; limits the turn rate to g·tan(bank)/speed."""

    course_dead_time_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """From a course setpoint to the first turn, s; `vfguide identify` measures it."""

    course_lag_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Time constant with which the turn rate then follows, that of the roll, s; 0 where it is at once."""

    speed_dead_time_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """From a speed setpoint to the first change of speed, s."""

    speed_lag_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Time constant with which the acceleration then follows, s."""

    speed_hold: SpeedHold | None = None
    """How the speed hold answers; absent: as the autopilot says.

    `total-energy`: by throttle and pitch, as ArduPlane's and PX4's TECS does,
    which swings where setpoints answer the measured speed at once; they follow the slot's speed instead, at
    most as fast as beta lets them."""

    slips: Switch | Literal["auto"] | None = None
    """Whether its nose leaves the direction of flight in turns, as that of an aircraft without coordination
    does: wind and direction through the air are then found from the ground velocity, slowly. `auto`: flown as
    one that does, until its banks and turns have shown in flight that it does not; absent: the same where
    no response is declared, else flown as one that does not, until they have shown that it does."""

    may_stop: Switch = True
    """Whether it may come to a standstill in the air, as under a parachute or in a simulator that hangs.
    Followers of a leader that may keep clear of the place where it fell silent; one right behind leaves its
    slot for it."""

    response: Literal["declared", "auto"] | None = None
    """Where its response is first taken from; flight corrects both. Absent: `declared` where alpha_1_s or
    beta_1_s is given, else `auto`.

    `auto`: alpha and beta are what the autopilot's own parameters give (ArduPlane's GUIDED_P and
    TECS_TIME_CONST; PX4's NPFG_PERIOD, NPFG_DAMPING, FW_T_TAS_TC and FW_THR_*), limits the tighter of its own
    and these. What is declared counts until it has told, and where its parameters do not tell."""

    engage_from: tuple[EngageMode, ...] = ("LOITER", "HOLD")
    """Modes out of which `--engage` takes the vehicle, once in a flight and in the air: ArduPlane's LOITER,
    CRUISE, FBWB, TAKEOFF; PX4's HOLD, POSITION, ALTITUDE, TAKEOFF."""

    climb_range_m_s: ClimbRange = (-3.0, 4.0)
    """Fastest descent, negative, and fastest climb that it keeps up at cruise, m/s."""

    height_delay_s: Annotated[Duration, Field(gt=0.0, le=20.0)] = 2.0
    """By how much its height lags behind a setpoint that climbs steadily, s: setpoints lead by this. An
    ArduPlane's is TECS_HDEM_TCONST and 0.3 s."""

    max_acceleration_m_s2: Annotated[Number, Field(ge=0.01, le=50.0)] = 3.0
    """Fastest change of speed along the flight path, either way, m/s²."""

    @property
    def declares_response(self) -> bool:
        """Whether the mission gives the bandwidth of a hold."""
        return not self.model_fields_set.isdisjoint({"alpha_1_s", "beta_1_s"})

    @property
    def asks_response(self) -> bool:
        """Whether the response is read from the autopilot's parameters before it is steered."""
        return self.response == "auto" or (self.response is None and not self.declares_response)

    @property
    def emulated_autopilot(self) -> str:
        """Name of the emulated autopilot that flies the vehicle in a rehearsal."""
        return str(autopilots.find(self.autopilot).rehearsed_as)

    @property
    def by_mavsdk(self) -> bool:
        """Whether MAVSDK keeps the connection to the vehicle."""
        return bool(autopilots.find(self.autopilot).by_mavsdk)
