"""Logs as ArduPilot and PX4 write them, made up: a flight due north at 20 m/s."""

import math
import struct
from collections.abc import Sequence
from pathlib import Path

GPS_EPOCH_UNIX_S = 315_964_800.0
BEGIN_UNIX_S = 1_790_000_000.0
LEAP_S = 18.0
DURATION_S = 20.0
SPEED_M_S = 20.0
METRES_OF_A_DEGREE = 111_319.49


def place(time_s: float, north_m: float, east_m: float) -> tuple[float, float]:
    """(latitude, longitude) at a time of the flight of a vehicle that begins somewhere near 0° N 8° E."""
    north = north_m + SPEED_M_S * time_s
    # At the equator a degree of latitude is shorter by the earth's flattening.
    return north / (METRES_OF_A_DEGREE * (1.0 - 0.00669438)), 8.0 + east_m / METRES_OF_A_DEGREE


class DataFlash:
    """Writes ArduPilot's format: each kind of message describes itself first."""

    CODES = {"Q": "Q", "L": "i", "f": "f", "B": "B", "I": "I", "H": "H", "N": "16s"}  # noqa: RUF012

    def __init__(self) -> None:
        self.content = bytearray()
        self._types: dict[str, tuple[int, str]] = {}
        self._describe(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)

    def _describe(self, kind: int, name: str, letters: str, columns: str, length: int) -> None:
        fields = (kind, length, name.encode(), letters.encode(), columns.encode())
        self.content += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *fields)

    def add(self, name: str, letters: str, columns: str, *values: float | bytes) -> None:
        if name not in self._types:
            kind = 130 + len(self._types)
            code = "<" + "".join(self.CODES[letter] for letter in letters)
            self._types[name] = kind, code
            self._describe(kind, name, letters, columns, 3 + struct.calcsize(code))
        kind, code = self._types[name]
        self.content += bytes((0xA3, 0x95, kind)) + struct.pack(code, *values)


def write_dataflash(
    path: Path,
    system_id: int,
    *,
    boot_s: float,
    north_m: float,
    east_m: float,
    drift: float = 0.0,
    duration_s: float = DURATION_S,
    version: str = "4.5",
    weeks_off: int = 0,
) -> None:
    """A log whose clock showed `boot_s` when the flight began, and runs fast by this share.

    Before 4.1 an estimator's core has a kind of message of its own, a receiver no number, CTUN no E2T, and
    nothing tells of setpoints; in 3.9 of this writer CTUN has no airspeed either, and there is no POS.
    """
    log = DataFlash()
    log.add("PARM", "QNff", "TimeUS,Name,Value,Default", 1, b"SYSID_THISMAV", float(system_id), 1.0)
    for number in range(round(duration_s * 25) + 1):
        time_s = number / 25.0
        us = round(1e6 * (boot_s + time_s * (1.0 + drift)))
        latitude, longitude = place(time_s, north_m, east_m)
        place_e7 = (round(latitude * 1e7), round(longitude * 1e7))
        if version != "3.9":
            columns = "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"
            log.add("POS", "QLLfff", columns, us, *place_e7, 100.0, 100.0, 100.0)
        # Heading 350°, banked by 10° to the right.
        log.add("ATT", "Qff", "TimeUS,Roll,Yaw", us, 10.0, 350.0)
        if version == "4.5":
            log.add("XKF1", "QBff", "TimeUS,C,VN,VE", us, 0, SPEED_M_S, 0.0)
            log.add("XKF1", "QBff", "TimeUS,C,VN,VE", us, 1, 99.0, 99.0)
            log.add("CTUN", "Qff", "TimeUS,As,E2T", us, 20.0, 1.05)
        elif version == "4.0":
            log.add("NKF1", "Qff", "TimeUS,VN,VE", us, SPEED_M_S, 0.0)
            log.add("CTUN", "Qff", "TimeUS,Roll,Aspd", us, 10.0, 20.0)
        else:
            log.add("CTUN", "Qf", "TimeUS,Roll", us, 10.0)
            log.add("ARSP", "Qf", "TimeUS,Airspeed", us, 20.0)
        if number % 5 == 0:
            whole = BEGIN_UNIX_S + time_s - GPS_EPOCH_UNIX_S + LEAP_S
            week, seconds = divmod(whole, 604_800.0)
            fix = (3, round(1e3 * seconds), int(week) + weeks_off)
            if version == "4.5":
                log.add("GPS", "QBBIH", "TimeUS,I,Status,GMS,GWk", us, 0, *fix)
            else:
                columns = "TimeUS,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs"
                seen = (*place_e7, 100.0, SPEED_M_S, 0.0)
                log.add("GPS", "QBIHLLfff", columns, us, *fix, *seen)
        if 5.0 <= time_s <= 15.0 and version == "4.5":
            log.add("OFG", "Qff", "TimeUS,Hdg,Arsp", us, 0.1, 22.0)
    path.write_bytes(log.content)


FORMATS = {
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
    "vehicle_local_position": "uint64_t timestamp;float vx;float vy;float heading;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "airspeed_validated": "uint64_t timestamp;float true_airspeed_m_s;float calibrated_airspeed_m_s;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;",
    "fixed_wing_lateral_setpoint": "uint64_t timestamp;float course;",
    "fixed_wing_longitudinal_setpoint": "uint64_t timestamp;float equivalent_airspeed;",
}
CODES = ("<Qddf", "<Qfff", "<Qffff", "<Qff", "<QQ", "<Qf", "<Qf")


def write_ulog(
    path: Path,
    system_id: int,
    *,
    boot_s: float,
    north_m: float,
    east_m: float,
    satellites: bool = True,
) -> None:
    """The same flight as PX4 writes it; without satellite time if there are no satellites."""
    content = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", round(1e6 * boot_s)))

    def add(kind: bytes, body: bytes) -> None:
        content.extend(struct.pack("<Hc", len(body), kind) + body)

    add(b"B", bytes(40))
    for name, layout in FORMATS.items():
        add(b"F", f"{name}:{layout}".encode())
    key = b"int32_t MAV_SYS_ID"
    add(b"P", bytes((len(key),)) + key + struct.pack("<i", system_id))
    for number, name in enumerate(FORMATS):
        add(b"A", struct.pack("<BH", 0, number) + name.encode())

    def data(number: int, *values: float) -> None:
        add(b"D", struct.pack("<H", number) + struct.pack(CODES[number], *values))

    for sample in range(round(DURATION_S * 25) + 1):
        time_s = sample / 25.0
        us = round(1e6 * (boot_s + time_s))
        data(0, us, *place(time_s, north_m, east_m), 100.0)
        data(1, us, SPEED_M_S, 0.0, math.radians(-10.0))
        half = math.radians(5.0)
        data(2, us, math.cos(half), math.sin(half), 0.0, 0.0)
        data(3, us, 21.0, 20.0)
        if sample % 5 == 0:
            data(4, us, round(1e6 * (BEGIN_UNIX_S + time_s)) if satellites else 0)
        if 5.0 <= time_s <= 15.0:
            data(6, us, 22.0)
            data(5, us, 0.1)
    path.write_bytes(content)


def write_all(directory: Path, names: Sequence[str]) -> list[Path]:
    """The leader's log and its follower's, whose clocks are apart by 62.5 s, by the endings of their names.

    The follower is 27 m behind and 6 m right of the leader.
    """
    writers = {".BIN": write_dataflash, ".ulg": write_ulog}
    paths = [directory / name for name in names]
    writers[paths[0].suffix](paths[0], 1, boot_s=100.0, north_m=0.0, east_m=0.0)
    writers[paths[1].suffix](paths[1], 2, boot_s=37.5, north_m=-27.0, east_m=6.0)
    return paths
