"""The two autopilots in software: how each is started, taken off and steered by its pilot."""

import math
import os
import shutil
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.autopilots.ground_station import GroundStation, message_ids
from tests.autopilots.programs import FlightError, Program, is_free, wait_for_port
from vfguide.companion.clock import Clock

TRUTH_HZ = 50.0
START_S, ARM_S, CLIMB_S, MODE_S = 60.0, 180.0, 180.0, 60.0
"""Patience with a simulator on a busy computer."""

ENOUGH_M = 10.0
"""So near to the height that was asked for counts as being up."""


ARDUPLANE_MODES = {"MANUAL": 0, "FBWA": 5, "RTL": 11, "LOITER": 12, "TAKEOFF": 13, "GUIDED": 15}

PX4_MODES = {"MANUAL": (1, 0), "OFFBOARD": (6, 0), "TAKEOFF": (4, 2), "LOITER": (4, 3)}
PX4_MODES |= {"RTL": (4, 5), "GUIDED": (4, 19)}
"""GUIDED is Guided Course, which 1.18 has; before that its pilot selects OFFBOARD."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """The air, and what is set in the autopilots."""

    wind_m_s: float = 0.0
    """Mean wind."""
    wind_from_deg: float = 270.0
    """Where it comes from, degrees clockwise from north."""
    turbulence: float = 0.0
    """ArduPlane's SIM_WIND_TURB."""
    factory: bool = False
    """Whether the parameters stay as the autopilot brings them."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Set beside the recipe's."""
    clock: Clock = field(default_factory=Clock)
    """Of the flight: slower than the computer's where that is too busy for real time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aircraft:
    """One aircraft of a flight."""

    name: str
    system_id: int
    instance: int
    """Of the simulators, which decides its ports."""
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    """Of the ground that it stands on before it takes off."""
    height_m: float
    """Above that, to which it takes off."""


class Simulator(ABC):
    """One autopilot in software."""

    has_own_pace = False
    """Whether its clock runs steadily at another pace than the computer's, even where there is time."""

    def __init__(self, program: Program, system_id: int, clock: Clock) -> None:
        self.program = program
        self._clock = clock
        self.system_id = system_id
        self._station: GroundStation | None = None

    @property
    @abstractmethod
    def companion_url(self) -> str:
        """Where a companion finds the autopilot."""

    @property
    def tcp_port(self) -> int:
        """The port at which one that has no companion is heard."""
        raise FlightError("only an ArduPlane leads without a companion here")

    @abstractmethod
    def connect(self) -> GroundStation:
        """A ground station that hears the simulator's clock and true positions."""

    @abstractmethod
    def ask_to_take_off(self) -> None:
        """Ask once for the climb to the height it was made for, before it is armed."""

    @abstractmethod
    def meet_wind(self) -> None:
        """Let the wind begin, where the aircraft has to be in the air for it."""

    @staticmethod
    @abstractmethod
    def number(mode: str) -> int:
        """A mode as heartbeats tell it, by its pilot's word for it."""

    @abstractmethod
    def select(self, mode: str) -> None:
        """Ask once for a mode, as the pilot."""

    @abstractmethod
    def glitch(self, north_m: float) -> None:
        """Let the satellite receiver be off by this; 0 ends it."""

    @property
    def station(self) -> GroundStation:
        """Its ground station."""
        if self._station is None:
            self._station = self.connect()
        return self._station

    def take_off(self) -> None:
        """Arm, and begin to climb to the height it was made for."""

        def ask() -> None:
            self.ask_to_take_off()
            self.station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

        self.station.wait(lambda: self.station.armed, "not armed", ARM_S, ask)
        self.enter("TAKEOFF")

    def enter(self, mode: str) -> None:
        """Ask for a mode until the autopilot is in it."""
        number = self.number(mode)
        self.station.wait(
            lambda: self.station.mode == number, mode, MODE_S, lambda: self.select(mode)
        )

    def close(self) -> None:
        """Hang up and end it."""
        if self._station is not None:
            self._station.close()
        self.program.stop()


def heard(station: GroundStation, ask: Callable[[], None]) -> GroundStation:
    """A station once it hears its aircraft and, asked for them, true positions."""
    station.wait(lambda: station.mode is not None, "no heartbeat", START_S)
    station.wait(lambda: len(station.fixes) > 10, "no true positions", START_S, ask)
    return station


class ArduPlane(Simulator):
    """ArduPlane's SITL with its own model `plane`."""

    RECIPE: Mapping[str, float] = {
        "GUIDED_P": 12_000,
        "SCHED_LOOP_RATE": 200,
        "TECS_TIME_CONST": 2,
        "TECS_CLMB_MAX": 20,
        "TECS_SINK_MIN": 4,
    }
    """What missions/ardupilot-sitl.yaml asks for."""

    def __init__(
        self, file: Path, directory: Path, aircraft: Aircraft, conditions: Conditions
    ) -> None:
        self._port = 5760 + 10 * aircraft.instance
        self._rate_hz = TRUTH_HZ
        wanted = {
            "TKOFF_ALT": aircraft.height_m,
            "SIM_WIND_SPD": conditions.wind_m_s,
            "SIM_WIND_DIR": conditions.wind_from_deg,
            "SIM_WIND_TURB": conditions.turbulence,
            **({} if conditions.factory else self.RECIPE),
            **conditions.parameters,
        }
        if wanted.get("SCHED_LOOP_RATE", 50) < 200:
            # 50 Hz is then denied, and 25 Hz is the fastest that comes evenly.
            self._rate_hz = 25.0
        directory.mkdir(parents=True, exist_ok=True)
        defaults = directory / "formation.parm"
        defaults.write_text("".join(f"{key} {value:g}\n" for key, value in wanted.items()))
        model = model_defaults(file)
        home = f"{aircraft.latitude_deg:.7f},{aircraft.longitude_deg:.7f}"
        home += f",{aircraft.altitude_amsl_m:g},353"
        command = [
            *(str(file), "-w", "-I", str(aircraft.instance), "--serial0", "tcp:0"),
            *("--model", "plane"),
            *("--speedup", f"{conditions.clock.rate:g}", "--sysid", str(aircraft.system_id)),
            *("--home", home, "--defaults", f"{model},{defaults}"),
        ]
        program = Program(f"{aircraft.name}.arduplane", command, directory)
        super().__init__(program, aircraft.system_id, conditions.clock)

    @staticmethod
    def are_free(first: int, count: int) -> bool:
        """Whether the ports of so many instances from this one on are in no use."""
        ports = (5760 + 10 * n + k for n in range(first, first + count) for k in (0, 2, 3))
        return all(is_free(port, socket.SOCK_STREAM) for port in ports)

    @property
    def companion_url(self) -> str:
        return f"tcpout://127.0.0.1:{self._port}"

    @property
    def tcp_port(self) -> int:
        return self._port

    def connect(self) -> GroundStation:
        # The second port opens once the first was called.
        wait_for_port(self._port, self.program, START_S)
        wait_for_port(self._port + 2, self.program, START_S)
        station = GroundStation(
            self.system_id,
            lambda: socket.create_connection(("127.0.0.1", self._port + 2), START_S),
            arduplane_truth,
            self._clock,
        )

        def ask() -> None:
            station.ask_for(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, self._rate_hz)
            station.ask_for(mavlink.MAVLINK_MSG_ID_SIM_STATE, self._rate_hz)

        return heard(station, ask)

    def ask_to_take_off(self) -> None:
        self.select("TAKEOFF")

    def meet_wind(self) -> None:
        """ArduPlane stands in it from the start."""

    @staticmethod
    def number(mode: str) -> int:
        return ARDUPLANE_MODES[mode]

    def select(self, mode: str) -> None:
        self.station.set_mode(self.number(mode))

    def glitch(self, north_m: float) -> None:
        degrees = math.degrees(north_m / 6371e3)
        # Before 4.6 the first receiver had no number.
        names = ("SIM_GPS1_GLTCH_X", "SIM_GPS_GLITCH_X")

        def ask() -> None:
            for name in names:
                self.station.set_parameter(name, degrees)

        # What an earlier glitch was answered with says nothing of this one.
        ask()
        self.station.wait(
            lambda: any(name in self.station.parameters for name in names), "no glitch", MODE_S, ask
        )


def model_defaults(file: Path) -> Path:
    """The defaults of ArduPilot's model `plane`: beside the program, or in the tree it was built in."""
    tree = (parent / "Tools/autotest/models/plane.parm" for parent in file.resolve().parents)
    for candidate in (file.with_name("plane.parm"), *tree):
        if candidate.exists():
            return candidate.resolve()
    raise FlightError(f"no plane.parm beside {file} nor in ArduPilot's Tools/autotest/models")


def arduplane_truth(message: MAVLink_message) -> tuple[float, ...] | None:
    """SIM_STATE as a true state; latitude and longitude are those in degE7, the older ones are floats."""
    if message.get_type() != "SIM_STATE":
        return None
    latitude, longitude = message.lat_int * 1e-7, message.lon_int * 1e-7
    return latitude, longitude, message.alt, message.vn, message.ve, message.roll


class Px4(Simulator):
    """PX4 with its own simulation in hardware's place (SIH), airframe `airplane`."""

    has_own_pace = True

    RECIPE: Mapping[str, float] = {
        "FW_THR_ASPD_MIN": 0.28,
        "FW_THR_TRIM": 0.58,
        "FW_THR_ASPD_MAX": 0.98,
        "FW_T_TAS_TC": 2,
        "NAV_DLL_ACT": 1,
        "COM_OBL_RC_ACT": 5,
    }
    """What missions/px4-sitl.yaml asks for."""

    AIRFRAME: Mapping[str, float] = {"SIH_F_T_MAX": 12, "SIH_LOC_H0": 0}
    """Without the thrust it never lifts off; started high its height begins at 0 all the same."""

    CHATTER = message_ids(
        *("ATTITUDE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"),
        *("SERVO_OUTPUT_RAW", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"),
    )
    """What ground stations of the simulation are sent 50 times a second unasked."""

    def __init__(
        self, file: Path, directory: Path, aircraft: Aircraft, conditions: Conditions
    ) -> None:
        self._instance = aircraft.instance
        self._directory = directory
        heading = math.radians(conditions.wind_from_deg)
        # Where it comes from.
        self._wind = {
            "SIH_WIND_N": conditions.wind_m_s * math.cos(heading),
            "SIH_WIND_E": conditions.wind_m_s * math.sin(heading),
        }
        wanted: dict[str, float] = {
            **self.AIRFRAME,
            "MAV_SYS_ID": aircraft.system_id,
            "MIS_TAKEOFF_ALT": aircraft.height_m,
            "SIH_LOC_LAT0": aircraft.latitude_deg,
            "SIH_LOC_LON0": aircraft.longitude_deg,
            **({} if conditions.factory else self.RECIPE),
            **conditions.parameters,
        }
        commands = link_commands(file, directory / "bin")
        environment = {
            "PX4_SIM_MODEL": "sihsim_airplane",
            "PX4_SIMULATOR": "sihsim",
            "HEADLESS": "1",
            "PX4_SIM_SPEED_FACTOR": f"{conditions.clock.rate:g}",
            **{f"PX4_PARAM_{key}": f"{value:.8g}" for key, value in wanted.items()},
        }
        command = [str(commands / "px4"), "-d", "-i", str(self._instance)]
        command.append(str(startup_scripts(file)))
        program = Program(f"{aircraft.name}.px4", command, directory, environment=environment)
        super().__init__(program, aircraft.system_id, conditions.clock)

    @staticmethod
    def are_free(first: int, count: int) -> bool:
        """Whether the ports of so many instances from this one on are in no use."""
        ports = (
            base + n
            for n in range(first, first + count)
            for base in (14_540, 14_580, 14_840, 18_570)
        )
        return all(is_free(port, socket.SOCK_DGRAM) for port in ports)

    @property
    def companion_url(self) -> str:
        # From the tenth on all instances send to one port: those get a link of their own.
        base = 14_540 if self._instance <= 9 else 14_840
        return f"udpin://127.0.0.1:{base + self._instance}"

    def connect(self) -> GroundStation:
        station = GroundStation(
            self.system_id, lambda: connected_udp(18_570 + self._instance), px4_truth, self._clock
        )

        def ask() -> None:
            station.ask_for(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, TRUTH_HZ)
            station.ask_for(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, TRUTH_HZ)
            for message_id in self.CHATTER:
                station.ask_for(message_id, -1.0)

        heard(station, ask)
        if self._instance > 9:
            arguments = ["start", "-x", "-u", str(14_880 + self._instance), "-r", "4000000"]
            arguments += ["-f", "-m", "onboard", "-o", str(14_840 + self._instance)]
            self._call("mavlink", *arguments)
        return station

    def ask_to_take_off(self) -> None:
        self.station.command(mavlink.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, *[math.nan] * 4)

    def meet_wind(self) -> None:
        """Set the wind in flight: SIH's airplane is blown about on the ground, and the estimator with it."""
        station = self.station
        for name, value in self._wind.items():
            if value:
                station.wait(
                    lambda name=name: name in station.parameters,
                    f"no {name}",
                    MODE_S,
                    lambda name=name, value=value: station.set_parameter(name, value),
                )

    @staticmethod
    def number(mode: str) -> int:
        main, sub = PX4_MODES[mode]
        return main << 16 | sub << 24

    def select(self, mode: str) -> None:
        self.station.set_mode(*PX4_MODES[mode])

    def glitch(self, north_m: float) -> None:
        raise FlightError(f"PX4's receiver cannot be put {north_m:g} m off in its simulation")

    def _call(self, command: str, *arguments: str) -> None:
        """Run one of PX4's own commands in the running program."""
        name = f"{self.program.name}.{command}"
        line = [str(self._directory / "bin" / f"px4-{command}"), "--instance", str(self._instance)]
        call = Program(name, [*line, *arguments], self._directory)
        call.start()
        gives_up = time.monotonic() + START_S
        while call.running and time.monotonic() < gives_up:
            time.sleep(0.02)
        call.stop()


def connected_udp(port: int) -> socket.socket:
    """A socket that speaks with one port of this computer."""
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.connect(("127.0.0.1", port))
    return found


def startup_scripts(file: Path) -> Path:
    """PX4's `etc`: beside `bin`, as it was built."""
    scripts = file.parent.parent / "etc"
    if not (scripts / "init.d-posix" / "rcS").exists():
        raise FlightError(f"no start-up scripts of PX4 in {scripts}")
    return scripts.resolve()


def link_commands(file: Path, directory: Path) -> Path:
    """A directory with PX4 under the names of its commands: links that not every copy of a build keeps."""
    directory.mkdir(parents=True, exist_ok=True)
    for entry in file.parent.iterdir():
        link = directory / entry.name
        with suppress(FileExistsError):
            link.symlink_to(entry.resolve() if entry.suffix == ".sh" else file.resolve())
    return directory


def px4_truth(message: MAVLink_message) -> tuple[float, ...] | None:
    """HIL_STATE_QUATERNION, which PX4 makes of its simulation's ground truth, as a true state."""
    if message.get_type() != "HIL_STATE_QUATERNION":
        return None
    w, x, y, z = message.attitude_quaternion
    bank = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    place = (message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
    return (*place, message.vx * 1e-2, message.vy * 1e-2, bank)


PROGRAMS: Mapping[str, type[ArduPlane] | type[Px4]] = {"arduplane": ArduPlane, "px4": Px4}


def find_program(kind: str, given: str | None = None) -> Path:
    """Find the autopilot's program, which a variable names if nothing is given."""
    given = given or os.environ.get(kind.upper())
    if not given:
        raise FlightError(f"set {kind.upper()} to the program, or name it with --binary")
    found = shutil.which(given) or given
    if not Path(found).is_file():
        raise FlightError(f"there is no program {given}")
    return Path(found).resolve()


def free_instances(kind: type[ArduPlane] | type[Px4], count: int) -> int:
    """The first of so many instances in a row whose ports are free."""
    for first in range(10 - count + 1):
        if kind.are_free(first, count):
            return first
    raise FlightError("the ports of all instances are in use")
