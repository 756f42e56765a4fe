"""Parameters of an autopilot, the MAVLink protocol for them, and PX4's own parameters.

Values are kept until the emulator ends. Ground stations load the list before they show a vehicle.
"""

import math
import struct
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from enum import IntEnum
from typing import Literal

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.config import AutopilotConfig

LIST_INTERVAL_US = 20_000

LIST_BURST = 10
"""Parameters of a list that are sent at a time: few, so that datagrams stay short and links breathe."""

HASH_CHECK = "_HASH_CHECK"
"""PX4's checksum of all parameters, requested instead of the list; setting it stops a list."""

NO_INDEX, NO_PARAMETER = 65_535, -1

NPFG_DAMPING = 0.7
"""Damping with which NPFG_PERIOD gives the plant's alpha: 4 pi NPFG_DAMPING / NPFG_PERIOD."""

TRIMMED, UNTRIMMED = (2.0, 0.28, 0.58, 0.98), (5.0, 0.0, 0.6, 0.0)
"""FW_T_TAS_TC, FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX: trimmed for PX4's simulated airplane, and
PX4's defaults."""


class ParameterType(IntEnum):
    """MAV_PARAM_TYPE, as far as these autopilots use it."""

    UINT32 = 5
    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


BITS: Mapping[ParameterType, int] = {
    ParameterType.INT8: 8,
    ParameterType.INT16: 16,
    ParameterType.INT32: 32,
}

Encoding = Literal["cast", "bytewise"]
"""Encoding of integers in PARAM_VALUE's float: ArduPilot converts them, PX4 copies their bytes."""


class Parameter(msgspec.Struct, frozen=True):
    """One parameter, with a name of up to 16 characters and the value at the start."""

    name: str
    kind: ParameterType
    default: float


def real(name: str, default: float) -> Parameter:
    """Return a floating-point parameter."""
    return Parameter(name, ParameterType.REAL32, default)


def int8(name: str, default: int) -> Parameter:
    """Return a parameter of 8 bits."""
    return Parameter(name, ParameterType.INT8, default)


def int16(name: str, default: int) -> Parameter:
    """Return a parameter of 16 bits."""
    return Parameter(name, ParameterType.INT16, default)


def int32(name: str, default: int) -> Parameter:
    """Return a parameter of 32 bits."""
    return Parameter(name, ParameterType.INT32, default)


def whole_if_possible(name: str, default: float) -> Parameter:
    """Return an integer parameter as on the real autopilot, or a float if the value is not whole."""
    whole = default == round(default)
    return Parameter(name, ParameterType.INT16 if whole else ParameterType.REAL32, default)


class Parameters(Mapping[str, float]):
    """All parameters of one autopilot; the index of a parameter is that of its name in sorted order."""

    def __init__(self, parameters: Iterable[Parameter], encoding: Encoding) -> None:
        self.encoding = encoding
        self._parameters = {one.name: one for one in sorted(parameters, key=lambda one: one.name)}
        self._values = {
            name: stored(one.kind, one.default) for name, one in self._parameters.items()
        }
        self.names = tuple(self._parameters)

    def __getitem__(self, name: str) -> float:
        """Return the value of a parameter."""
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names in the order of their indices."""
        return iter(self.names)

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.names)

    def kind(self, name: str) -> ParameterType:
        """Return the type of a parameter."""
        return self._parameters[name].kind

    def set(self, name: str, value: float) -> bool:
        """Store a value, rounded and clamped to its type; return False if it is not finite."""
        if not math.isfinite(value):
            return False
        self._values[name] = stored(self.kind(name), value)
        return True

    def encoded(self, name: str) -> float:
        """Return the value as PARAM_VALUE carries it."""
        value = self._values[name]
        if self.encoding == "cast" or self.kind(name) is ParameterType.REAL32:
            return value
        return float_of_bytes(struct.pack("<i", int(value)))

    def decoded(self, name: str, value: float) -> float:
        """Return the value that a PARAM_SET carries for a parameter; it may be anything."""
        if self.encoding == "cast" or self.kind(name) is ParameterType.REAL32:
            return value
        (number,) = struct.unpack("<i", struct.pack("<f", value))
        return float(number)

    def checksum(self) -> float:
        """Return PX4's _HASH_CHECK: a float whose bytes are a checksum of all names and values."""
        content = "".join(f"{name}={value!r}\n" for name, value in self._values.items())
        return float_of_bytes(struct.pack("<I", zlib.crc32(content.encode("ascii"))))


def stored(kind: ParameterType, value: float) -> float:
    """Convert a finite value to a type: single precision, or a whole number within the type's bounds."""
    if kind is ParameterType.REAL32:
        greatest = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
        bounded = max(-greatest, min(greatest, value))
        return float(struct.unpack("<f", struct.pack("<f", bounded))[0])
    half = 2 ** (BITS[kind] - 1)
    return float(max(-half, min(half - 1, round(value))))


def float_of_bytes(four: bytes) -> float:
    """Return the single-precision float that has these bytes, least significant first."""
    value: float = struct.unpack("<f", four)[0]
    return value


class ParameterServer:
    """Answers messages about one autopilot's parameters, and sends their list in parts."""

    def __init__(self, parameters: Parameters, *, refuses_unknown: bool = False) -> None:
        """Serve parameters; `refuses_unknown` answers unknown names with PARAM_ERROR instead of silence."""
        self._parameters = parameters
        self._refuses_unknown = refuses_unknown
        self._waiting: deque[str] = deque()
        self.due_us: int | None = None
        """Time of the next part of a list; None without a list."""

    def request_list(self, now_us: int) -> list[MAVLink_message]:
        """Answer PARAM_REQUEST_LIST: return the first part, and schedule the rest."""
        self._waiting = deque(self._parameters)
        self.due_us = now_us
        first = [self._hash_check()] if self._parameters.encoding == "bytewise" else []
        return first + self.next_part(now_us)

    def next_part(self, now_us: int) -> list[MAVLink_message]:
        """Return the part of the list that is due."""
        if self.due_us is None or now_us < self.due_us:
            return []
        names = [self._waiting.popleft() for _ in range(min(LIST_BURST, len(self._waiting)))]
        self.due_us = now_us + LIST_INTERVAL_US if self._waiting else None
        return [self.value(name) for name in names]

    def read(self, message: MAVLink_message) -> list[MAVLink_message]:
        """Answer PARAM_REQUEST_READ by index or by name; an unknown index has no answer."""
        names = self._parameters.names
        if message.param_index >= 0:
            return [self.value(name) for name in names[message.param_index :][:1]]
        if message.param_id == HASH_CHECK and self._parameters.encoding == "bytewise":
            return [self._hash_check()]
        if message.param_id in self._parameters:
            return [self.value(message.param_id)]
        return self._refusal(message)

    def write(self, message: MAVLink_message) -> tuple[str | None, list[MAVLink_message]]:
        """Store a PARAM_SET; return the name, or None if nothing was stored, and the present value."""
        name = message.param_id
        if name == HASH_CHECK and self._parameters.encoding == "bytewise":
            self._waiting.clear()
            self.due_us = None
            return None, []
        if name not in self._parameters:
            return None, self._refusal(message)
        value = self._parameters.decoded(name, message.param_value)
        changed = self._parameters.set(name, value)
        return (name if changed else None), [self.value(name)]

    def value(self, name: str) -> MAVLink_message:
        """Return PARAM_VALUE of an existing parameter."""
        parameters = self._parameters
        return mavlink.MAVLink_param_value_message(
            name.encode("ascii"),
            parameters.encoded(name),
            parameters.kind(name),
            len(parameters),
            parameters.names.index(name),
        )

    def _refusal(self, message: MAVLink_message) -> list[MAVLink_message]:
        if not self._refuses_unknown:
            return []
        return [
            mavlink.MAVLink_param_error_message(
                message.get_srcSystem(),
                message.get_srcComponent(),
                message.param_id.encode("ascii", "replace"),
                NO_PARAMETER,
                mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST,
            )
        ]

    def _hash_check(self) -> MAVLink_message:
        return mavlink.MAVLink_param_value_message(
            HASH_CHECK.encode("ascii"),
            self._parameters.checksum(),
            ParameterType.UINT32,
            len(self._parameters),
            NO_INDEX,
        )


def px4_parameters(config: AutopilotConfig) -> Parameters:
    """Return the parameters at the start."""
    plant = config.plant
    time_s, slowest, middle, fastest = TRIMMED if plant.is_trimmed else UNTRIMMED
    return Parameters(
        [
            real("FW_AIRSPD_MIN", plant.airspeed_min_m_s),
            real("FW_AIRSPD_MAX", plant.airspeed_max_m_s),
            real("FW_AIRSPD_TRIM", config.airspeed_m_s),
            real("FW_AIRSPD_STALL", 0.8 * plant.airspeed_min_m_s),
            real("FW_R_LIM", math.degrees(plant.max_bank_rad)),
            real("FW_R_TC", plant.roll_time_s),
            real("FW_P_TC", 0.4),
            real("FW_P_LIM_MAX", 30.0),
            real("FW_P_LIM_MIN", -30.0),
            real("FW_T_CLMB_MAX", plant.climb_rate_max_m_s),
            real("FW_T_CLMB_R_SP", plant.climb_rate_max_m_s),
            real("FW_T_SINK_MAX", plant.sink_rate_max_m_s),
            real("FW_T_SINK_R_SP", plant.sink_rate_max_m_s),
            real("FW_T_TAS_TC", time_s),
            real("FW_THR_ASPD_MIN", slowest),
            real("FW_THR_TRIM", middle),
            real("FW_THR_ASPD_MAX", fastest),
            real("NPFG_PERIOD", 4.0 * math.pi * NPFG_DAMPING / plant.alpha_1_s),
            real("NPFG_DAMPING", NPFG_DAMPING),
            real("COM_OF_LOSS_T", 1.0),
            int32("COM_OBL_RC_ACT", 0),
            int32("COM_RC_IN_MODE", 1),
            int32("COM_DL_LOSS_T", 10),
            real("COM_DISARM_PRFLT", 10.0),
            real("COM_DISARM_LAND", 2.0),
            int32("COM_RCL_EXCEPT", 0),
            int32("COM_DLL_EXCEPT", 0),
            int32("COM_ARM_WO_GPS", 1),
            int32("NAV_DLL_ACT", 0),
            int32("NAV_RCL_ACT", 2),
            real("NAV_LOITER_RAD", 80.0),
            real("NAV_ACC_RAD", 10.0),
            real("MIS_TAKEOFF_ALT", 50.0),
            real("RTL_RETURN_ALT", 100.0),
            int32("RTL_TYPE", 0),
            int32("GF_ACTION", 2),
            int32("CBRK_SUPPLY_CHK", 0),
            int32("BAT1_N_CELLS", 3),
            int32("EKF2_GPS_CTRL", 7),
            int32("SYS_HAS_NUM_ASPD", 1),
            int32("SYS_AUTOSTART", 2100),
            int32("SYS_AUTOCONFIG", 0),
            int32("MAV_SYS_ID", config.system_id),
            int32("MAV_COMP_ID", 1),
            int32("MAV_TYPE", 1),
            int32("MAV_PROTO_VER", 0),
            int32("MAV_0_RATE", 1200),
        ],
        "bytewise",
    )
