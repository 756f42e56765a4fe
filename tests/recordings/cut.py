"""Cuts what is kept in this directory out of whole flights with real autopilots.

    python -m tests.recordings.cut FLIGHTS

FLIGHTS holds a directory for each flight with the `.tlog.xz` of its companions and its `mission.yaml`.
Written are `responses.npz`, the slices of `responses.yaml`, and thinned telemetry logs in `flights`.
"""

import argparse
import lzma
import shutil
import struct
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.elementwise import FloatArray
from vfguide.mavlink.framing import end_of_frame, frame_at

HERE = Path(__file__).parent

FLIGHTS = {"arduplane-circle": ("leader", "f1"), "px4-line": ("leader", "f1")}
"""Flights that are kept whole, and whose logs of them."""

COURSES = frozenset({mavlink.MAV_CMD_GUIDED_CHANGE_HEADING})
SPEEDS = frozenset({mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, mavlink.MAV_CMD_DO_CHANGE_SPEED})

FLOWN_HZ, BANK_HZ = 5.0, 5.0
"""Of slices."""

KEPT_HZ = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 5.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 5.0,
    mavlink.MAVLINK_MSG_ID_WIND: 1.0,
    mavlink.MAVLINK_MSG_ID_WIND_COV: 1.0,
}
"""Of whole flights; setpoints and changes of mode are kept all."""

STAMP = struct.Struct(">Q")
"""Before each frame of a telemetry log: microseconds."""

BLOCK_S = 10.0
"""Over which the difference of two clocks is that of the report that was fastest."""


def frames(path: Path) -> Iterator[tuple[float, bytes]]:
    """(computer's time in s, frame) of a compressed telemetry log."""
    data, start = lzma.decompress(path.read_bytes()), 0
    while start < len(data):
        (stamp_us,) = STAMP.unpack_from(data, start)
        start += STAMP.size
        end = end_of_frame(data, start)
        if end is None:
            return
        yield stamp_us * 1e-6, data[start:end]
        start = end


def series(path: Path) -> dict[str, FloatArray]:
    """What was asked for and flown: rows of the computer's time, then values."""
    rows: defaultdict[str, list[tuple[float, ...]]] = defaultdict(list)
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    for time_s, content in frames(path):
        message = parser.decode(bytearray(content))
        name, values = row_of(message)
        if name:
            rows[name].append((time_s, *values))
    return {name: np.array(values) for name, values in rows.items()}


def row_of(message: MAVLink_message) -> tuple[str, tuple[float, ...]]:
    """(name of a series, the message's values); no name where the message is not of use."""
    match message.get_type(), message.get_srcComponent():
        case (("COMMAND_INT" | "COMMAND_LONG"), _) if message.command in COURSES:
            return "course", (message.param2,)
        case (("COMMAND_INT" | "COMMAND_LONG"), _) if message.command in SPEEDS:
            return "speed", (message.param2,)
        case "GLOBAL_POSITION_INT", 1:
            course_deg = np.degrees(np.arctan2(message.vy, message.vx))
            ground_speed_m_s = 0.01 * np.hypot(message.vx, message.vy)
            return "flown", (1e-3 * message.time_boot_ms, course_deg, ground_speed_m_s)
        case "ATTITUDE", 1:
            return "bank", (1e-3 * message.time_boot_ms, np.degrees(message.roll))
        case "VFR_HUD", 1:
            return "airspeed", (message.airspeed,)
    return "", ()


def autopilot_s(flown: FloatArray, computer_s: FloatArray) -> FloatArray:
    """The autopilot's clock at times of the computer's, which differ by the fastest reports' delay."""
    arrived_s, boot_s = flown[:, 0], flown[:, 1]
    blocks = np.array_split(np.arange(len(boot_s)), max(2, int(np.ptp(boot_s) / BLOCK_S)))
    fastest = [block[np.argmin((arrived_s - boot_s)[block])] for block in blocks]
    behind_s = (arrived_s - boot_s)[fastest]
    return computer_s - np.interp(computer_s, arrived_s[fastest], behind_s)


def cut_slice(
    told: dict[str, FloatArray], begin_s: float, length_s: float
) -> dict[str, FloatArray]:
    """A slice of a flight by the autopilot's clock: `begin_s` after its first report, which is time 0."""
    flown = told["flown"]
    start_s = flown[0, 1] + begin_s

    def setpoints(name: str) -> FloatArray:
        times = autopilot_s(flown, told[name][:, 0]) - start_s
        first = max(int(np.searchsorted(times, 0.0)) - 1, 0)
        last = int(np.searchsorted(times, length_s))
        # What holds at the beginning is sent then.
        return np.column_stack((np.maximum(times, 0.0), told[name][:, 1]))[first:last]

    def within(times: FloatArray, values: FloatArray, rate_hz: float) -> FloatArray:
        rows = np.column_stack((times - start_s, values))
        rows = rows[(rows[:, 0] >= 0.0) & (rows[:, 0] <= length_s)]
        between_s = float(np.median(np.diff(rows[:, 0])))
        return rows[:: max(1, round(1.0 / (rate_hz * between_s)))]

    airspeed = told["airspeed"]
    return {
        "course": setpoints("course"),
        "speed": setpoints("speed"),
        "flown": within(flown[:, 1], flown[:, 2:], FLOWN_HZ),
        "bank": within(told["bank"][:, 1], told["bank"][:, 2:], BANK_HZ),
        "airspeed": within(autopilot_s(flown, airspeed[:, 0]), airspeed[:, 1:], FLOWN_HZ),
    }


def thinned(path: Path) -> bytes:
    """A telemetry log with what `KEPT_HZ` names, all setpoints, and every change of mode."""
    kept, last_s = [], defaultdict[tuple[int, int], float](lambda: -np.inf)
    for time_s, content in frames(path):
        frame = frame_at(content, 0, len(content))
        if frame.message_id in {
            mavlink.MAVLINK_MSG_ID_COMMAND_INT,
            mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        }:
            # The command's number is the field after seven numbers of four bytes.
            payload = content[10:].ljust(40, b"\0")
            (command,) = struct.unpack_from("<H", payload, 28)
            if command not in COURSES | SPEEDS | {mavlink.MAV_CMD_DO_SET_MODE}:
                continue
        elif frame.message_id not in KEPT_HZ:
            continue
        else:
            key = frame.component_id, frame.message_id
            if time_s - last_s[key] < 0.98 / KEPT_HZ[frame.message_id]:
                continue
            last_s[key] = time_s
        kept.append(STAMP.pack(round(time_s * 1e6)) + content)
    return b"".join(kept)


def main() -> None:
    """Cut everything anew."""
    parser = argparse.ArgumentParser(description=__doc__, prog="cut")
    parser.add_argument("flights", type=Path)
    source: Path = parser.parse_args().flights
    wanted = yaml.safe_load((HERE / "responses.yaml").read_text())["slices"]
    arrays = {}
    for name, one in wanted.items():
        told = series(source / one["flight"] / f"{one['vehicle']}.tlog.xz")
        for kind, rows in cut_slice(told, one["begin_s"], one["length_s"]).items():
            arrays[f"{name}.{kind}"] = rows.astype(np.float32)
    np.savez_compressed(HERE / "responses.npz", **arrays)
    for flight, vehicles in FLIGHTS.items():
        place = HERE / "flights" / flight
        place.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / flight / "mission.yaml", place / "mission.yaml")
        for vehicle in vehicles:
            log = thinned(source / flight / f"{vehicle}.tlog.xz")
            packed = lzma.compress(log, preset=9 | lzma.PRESET_EXTREME)
            (place / f"{vehicle}.tlog.xz").write_bytes(packed)


if __name__ == "__main__":
    main()
