"""The answers of a real autopilot, one table for the real program and for the emulator.

The tables are `tests/recordings/answers-*.yaml`. A case has `steps`, or is itself one step:

| step | what is done, and what is seen |
|---|---|
| `command`, `with`, `form`, `frame`, `z_m`, `to` | a command by its name without MAV_CMD_ |
| `select` | DO_SET_MODE, of a mode of the table |
| `answer` | with these two: the MAV_RESULT |
| `set`, `to`, `type` | PARAM_SET |
| `stream`, `course_deg`, `for_s` | a `position` 100 km away on a course, or a `velocity`, 10 times a second |
| `pass_s` | time passes |
| `mode` | that of the last heartbeat |
| `course_deg`, `within` | the course over ground |
| `airspeed_m_s`, `within` | the airspeed |
| `turns` | whether the course changes by more than 5 degrees in 3 s |
| `texts`; `texts_from`, `says` | all texts since the start; whether there was one since `texts_from` |
| `rates_hz`, `within` | how often messages come, of which none was asked for |
"""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.autopilots.emulated import Emulated
from tests.kit.wire import command_long

RECORDINGS = Path(__file__).parents[1] / "recordings"

STREAM_HZ = 10.0

FAR_M, SPEED_M_S, HEIGHT_M = 1e5, 15.0, 60.0
"""Of setpoints: so far away that the bearing stays what it is."""

TURNING_DEG, TURNING_S = 5.0, 3.0

WHOLE = frozenset(range(mavlink.MAV_PARAM_TYPE_UINT8, mavlink.MAV_PARAM_TYPE_INT64 + 1))

Step = Mapping[str, Any]


Subject = Emulated
"""An autopilot in the air as its pilot and companion have it; a real one has the same methods."""


@dataclass(frozen=True, slots=True)
class Mismatch:
    """An answer that is not the recorded one."""

    what: str
    step: object
    recorded: object
    seen: object


class Answers:
    """The recorded answers of one autopilot."""

    def __init__(self, name: str) -> None:
        """Load the table `answers-NAME.yaml`."""
        table = yaml.safe_load((RECORDINGS / f"answers-{name}.yaml").read_text())
        self.autopilot = name
        self.cases: list[Step] = table["cases"]
        self.parameters: dict[str, Any] = table["parameters"]
        self.version: tuple[int, int] | None = None
        """Firmware's version and capabilities, where they are recorded."""
        if "version" in table:
            self.version = table["version"], table["capabilities"]
        self._modes: dict[str, Sequence[int]] = table["modes"]
        self._form: str = table["form"]
        self._bytewise = table["whole_numbers"] == "bytewise"
        self._texts_before = 0

    def asked_of(self, subject: Subject) -> list[Mismatch]:
        """Ask all cases in their order: what is not as recorded."""
        found = []
        for case in self.cases:
            for step in case.get("steps", [case]):
                recorded, seen = self._taken(subject, step)
                if recorded != seen:
                    found.append(Mismatch(case["what"], step, recorded, seen))
        return found

    def parameters_of(self, subject: Subject) -> list[Mismatch]:
        """Read all parameters: what is not as recorded."""
        found = []
        for name, told in self.parameters.items():
            recorded = None if told == "unknown" else (self._as_sent(*told), told[1])
            seen = subject.parameter(name)
            if not same_parameter(recorded, seen):
                found.append(Mismatch("parameter", name, recorded, seen))
        return found

    def _taken(self, subject: Subject, step: Step) -> tuple[object, object]:
        """Take a step: (what is recorded, what is seen); equal where there is nothing to see."""
        if "answer" in step:
            return step["answer"], subject.answer(self._command(subject, step))
        if "set" in step:
            subject.send(self._parameter_set(subject, step))
        elif "stream" in step:
            self._stream(subject, step)
        elif "pass_s" in step:
            subject.pass_time(step["pass_s"])
        elif "texts_from" in step:
            self._texts_before = len(subject.texts())
        else:
            return self._seen(subject, step)
        return None, None

    def _seen(self, subject: Subject, step: Step) -> tuple[object, object]:
        if "mode" in step:
            return self._custom_mode(step["mode"]), subject.custom_mode()
        if "texts" in step:
            return step["texts"], list(subject.texts())
        if "says" in step:
            return step["says"], len(subject.texts()) > self._texts_before
        if "rates_hz" in step:
            return expected(step["rates_hz"], subject.rates_hz(), step["within"])
        return motion_seen(subject, step)

    def _command(self, subject: Subject, step: Step) -> MAVLink_message:
        target = step.get("to", subject.system_id)
        if "select" in step:
            number, values = mavlink.MAV_CMD_DO_SET_MODE, (1, *self._modes[step["select"]])
        else:
            number = mavlink.__dict__[f"MAV_CMD_{step['command']}"]
            values = tuple(step.get("with", ()))
        by_form = step.get("command") in BY_FORM and step.get("form", self._form) == "int"
        if not by_form:
            return command_long(number, *values, system_id=target)
        padded = (*values, *(0.0,) * (4 - len(values)))
        height_m = step.get("z_m", 0.0)
        return mavlink.MAVLink_command_int_message(
            target, 1, mavlink.MAV_FRAME_GLOBAL, number, 0, 0, *padded, 0, 0, height_m
        )

    def _parameter_set(self, subject: Subject, step: Step) -> MAVLink_message:
        sent = self._as_sent(step["to"], step["type"])
        name = step["set"].encode()
        return mavlink.MAVLink_param_set_message(subject.system_id, 1, name, sent, step["type"])

    def _as_sent(self, value: float, kind: int) -> float:
        if not (self._bytewise and kind in WHOLE):
            return value
        same_bytes: float = struct.unpack("<f", struct.pack("<i", round(value)))[0]
        return same_bytes

    def _stream(self, subject: Subject, step: Step) -> None:
        kind, course = step["stream"], math.radians(step["course_deg"])
        length, mask = (FAR_M, 0xDF8) if kind == "position" else (SPEED_M_S, 0xDC7)
        vector = length * math.cos(course), length * math.sin(course)
        place = (*vector, -HEIGHT_M) if kind == "position" else (0.0,) * 3
        velocity = (*vector, 0.0) if kind == "velocity" else (0.0,) * 3
        setpoint = mavlink.MAVLink_set_position_target_local_ned_message(
            *(0, subject.system_id, 1, mavlink.MAV_FRAME_LOCAL_NED, mask),
            *(*place, *velocity, *(0.0,) * 5),
        )
        for _ in range(round(step["for_s"] * STREAM_HZ)):
            subject.send(setpoint)
            subject.pass_time(1.0 / STREAM_HZ)

    def _custom_mode(self, name: str) -> int:
        """The mode as heartbeats tell it: PX4's have the main mode in the third byte, the sub mode in the
        fourth."""
        main, *sub = self._modes[name]
        if self.autopilot != "px4":
            return main
        return main << 16 | (sub[0] if sub else 0) << 24


BY_FORM = {
    *("GUIDED_CHANGE_HEADING", "GUIDED_CHANGE_SPEED", "GUIDED_CHANGE_ALTITUDE", "DO_REPOSITION")
}
"""Commands that companions send as COMMAND_INT where the autopilot takes it; the others are COMMAND_LONG."""


def motion_seen(subject: Subject, step: Step) -> tuple[object, object]:
    """(recorded, seen) of a step that looks at how the aircraft moves."""
    if "turns" in step:
        before_deg = subject.course_deg()
        subject.pass_time(TURNING_S)
        turned_deg = math.remainder(subject.course_deg() - before_deg, 360.0)
        return step["turns"], abs(turned_deg) > TURNING_DEG
    if "airspeed_m_s" in step:
        recorded, seen = step["airspeed_m_s"], subject.airspeed_m_s()
        return near(recorded, seen, seen - recorded, step["within"])
    recorded, seen = step["course_deg"], subject.course_deg()
    return near(recorded, seen, math.remainder(seen - recorded, 360.0), step["within"])


def same_parameter(one: tuple[float, int] | None, other: tuple[float, int] | None) -> bool:
    """Whether values and types agree; numbers travel in single precision."""
    if one is None or other is None:
        return one is other
    return one[1] == other[1] and math.isclose(one[0], other[0], rel_tol=1e-6)


def near(recorded: float, seen: float, off: float, within: float) -> tuple[float, float]:
    """(recorded, seen), equal where they are near enough."""
    return recorded, recorded if abs(off) <= within else seen


def expected(
    recorded: Mapping[str, float], seen: Mapping[str, float], within: float
) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """(recorded, seen), each number the recorded one where the two differ by this share at most."""
    close = {
        name: value if abs(seen.get(name, 0.0) / value - 1.0) <= within else seen.get(name, 0.0)
        for name, value in recorded.items()
    }
    return recorded, close
