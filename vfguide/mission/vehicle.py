"""Vehicles of a mission file."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from vfguide.mission.consistency import DEFAULT_AIRSPEED_RANGE_M_S
from vfguide.mission.quantity import Duration, Gain, Number, Section, Speed, Switch, known_in
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
    """An aircraft: its address, autopilot and capabilities."""

    system_id: Annotated[int, Field(strict=True, ge=1, le=255)]
    """MAVLink system id, 1 to 254, unique; 255 is a ground station's, which may lead."""

    component_id: Annotated[int, Field(strict=True, ge=1, le=255)] = 1
    """MAVLink component id of its autopilot."""

    autopilot: Annotated[str, AfterValidator(known_in(autopilots))] = "ardupilot"
    """Autopilot, which defines setpoints and modes. `auto` detects it from its heartbeat; `mavsdk` is PX4
    through MAVSDK."""

    px4_steering: Literal["auto", "guided-course", "position", "velocity"] = "auto"
    """Steering of a PX4. `auto`: Guided Course from 1.18 on, positions ahead in offboard on 1.15 to 1.17,
    velocities before. If the companion dies, NAV_DLL_ACT stops the aircraft in Guided Course (0, its
    default: nothing), and COM_OBL_RC_ACT in offboard."""

    plant: Literal["course-hold", "heading-hold"] = "heading-hold"
    """Variables of the two first-order holds: course and ground speed, or heading and airspeed."""

    alpha_1_s: Annotated[Gain, Field(le=20.0)] = 1.2
    """alpha of the article: bandwidth of the course (or heading) hold, 1/s."""

    beta_1_s: Annotated[Gain, Field(le=20.0)] = 0.8
    """beta of the article: bandwidth of the speed hold, 1/s."""

    airspeed_range_m_s: AirspeedRange = DEFAULT_AIRSPEED_RANGE_M_S
    """Minimum and maximum airspeed setpoint, m/s."""

    max_bank_deg: Annotated[Number, Field(ge=1.0, le=80.0)] = DEFAULT_MAX_BANK_DEG
    """Maximum bank, degrees; limits the turn rate to g·tan(bank)/speed."""

    course_dead_time_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Dead time from a course setpoint to the first turn, s; `vfguide identify` measures it."""

    course_lag_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Time constant of the turn rate after the dead time, which is the roll's, s; 0 for none."""

    speed_dead_time_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Dead time from a speed setpoint to the first change of speed, s."""

    speed_lag_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Time constant of the acceleration after the dead time, s."""

    speed_hold: SpeedHold | None = None
    """Type of the speed hold; if absent, the autopilot's. `total-energy`: by throttle and pitch, as in
    ArduPlane's and PX4's TECS. It oscillates if setpoints respond to the measured speed at once. They
    therefore follow the slot's speed, at most as fast as beta allows."""

    slips: Switch | Literal["auto"] | None = None
    """Whether the nose leaves the direction of flight in turns, as in an aircraft without coordination. Wind
    and air direction are then found slowly from the ground velocity. `auto`: assumed to slip until flight
    shows that it does not. If absent: as `auto` where no response is declared, else assumed not to slip
    until flight shows it."""

    may_stop: Switch = True
    """Whether it may come to a standstill in the air, as under a parachute or in a hanging simulator.
    Followers of such a leader keep clear of the place where it fell silent; one right behind leaves its slot
    for it."""

    response: Literal["declared", "auto"] | None = None
    """Initial source of the response; flight corrects both. By default `declared` where alpha_1_s or
    beta_1_s is given, else `auto`. `auto`: alpha and beta come from the autopilot's parameters (ArduPlane's
    GUIDED_P and TECS_TIME_CONST; PX4's NPFG_PERIOD, NPFG_DAMPING, FW_T_TAS_TC and FW_THR_*), and limits are
    the tighter of its own and these. Declared values apply until the parameters arrive, and where they are
    missing."""

    engage_from: tuple[EngageMode, ...] = ("LOITER", "HOLD")
    """Modes from which `--engage` takes the vehicle, once in a flight and in the air: ArduPlane's LOITER,
    CRUISE, FBWB, TAKEOFF; PX4's HOLD, POSITION, ALTITUDE, TAKEOFF."""

    climb_range_m_s: ClimbRange = (-3.0, 4.0)
    """Maximum descent rate, negative, and climb rate sustained at cruise, m/s."""

    height_delay_s: Annotated[Duration, Field(gt=0.0, le=20.0)] = 2.0
    """Lag of the height behind a setpoint that climbs steadily, s, by which setpoints lead. An ArduPlane's
    is TECS_HDEM_TCONST plus 0.3 s."""

    max_acceleration_m_s2: Annotated[Number, Field(ge=0.01, le=50.0)] = 3.0
    """Maximum acceleration along the flight path, either way, m/s²."""

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
