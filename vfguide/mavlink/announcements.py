"""Heartbeats and texts of a companion, and messages for people about refused or unanswered commands."""

import math
from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.reports import CommandReport

INFO: int = mavlink.MAV_SEVERITY_INFO
NOTICE: int = mavlink.MAV_SEVERITY_NOTICE
CRITICAL: int = mavlink.MAV_SEVERITY_CRITICAL
WARNING: int = mavlink.MAV_SEVERITY_WARNING

CHUNK = 50
"""Characters in one STATUSTEXT."""

MOST_CHUNKS = 6
"""Maximum number of parts of a text: a telemetry radio carries a few hundred bytes a second."""

SILENCE_S = 3.0
"""Time after which a repeated command without any answer counts as not heard, s."""

QUIET_S = 10.0
"""Time after which a repeated refusal is told again, s."""

MOST_REFUSALS = 64
"""Maximum number of kinds of refusals told: more is noise."""

GOOD = frozenset({mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS})

REASONS: dict[tuple[int, int], str] = {
    (mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, mavlink.MAV_RESULT_FAILED): (
        "not in GUIDED, or an airspeed outside AIRSPEED_MIN to AIRSPEED_MAX"
    ),
    (mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, mavlink.MAV_RESULT_DENIED): (
        "a ground speed, which it does not hold"
    ),
    (mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, mavlink.MAV_RESULT_FAILED): "not in GUIDED",
    (mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, mavlink.MAV_RESULT_DENIED): (
        "not in Guided Course, or a course that it does not take"
    ),
    (mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, mavlink.MAV_RESULT_UNSUPPORTED): (
        "this firmware was built without guided commands"
    ),
    (mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, mavlink.MAV_RESULT_FAILED): "not in GUIDED",
    (mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_RESULT_DENIED): (
        "outside its airspeeds, or a kind of speed that it does not hold"
    ),
    (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_TEMPORARILY_REJECTED): (
        "it has no such mode or cannot fly it now; offboard wants setpoints first, at 2 Hz or more"
    ),
    (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_DENIED): (
        "it has no such mode, or no position to fly it by"
    ),
    (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_FAILED): (
        "it is not ready for that mode: no position, or not armed"
    ),
    (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED): (
        "asked for streams instead; should they not come, set SRx_POSITION, SRx_EXTRA2 and SRx_EXTRA1"
    ),
    (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_RESULT_DENIED): (
        "faster than its loop: raise SCHED_LOOP_RATE, or lower rehearsal.rate_hz"
    ),
}
"""Usual causes by command and result."""


ASKING = frozenset({mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE})
"""Commands by which nothing flies: their result may come otherwise, or not be needed."""


def status_texts(text: str, severity: int, number: int) -> list[MAVLink_message]:
    """Return the STATUSTEXT messages of a text, for ground stations that listen to the vehicle.

    Args:
        text: the text; characters outside ASCII become question marks.
        severity: MAV_SEVERITY.
        number: number of the text, 1 to 65535, by which ground stations join the parts of a long one.
    """
    content = text.encode("ascii", "replace")
    if len(content) <= CHUNK:
        return [mavlink.MAVLink_statustext_message(severity, content)]
    content = content[: MOST_CHUNKS * CHUNK - 1]
    # A part that is not full ends the text, so a text that fills its last part is followed by an empty one.
    starts = range(0, len(content) + 1, CHUNK)
    return [
        mavlink.MAVLink_statustext_message(severity, content[start : start + CHUNK], number, chunk)
        for chunk, start in enumerate(starts)
    ]


def named_value(name: str, value: float, time_s: float) -> MAVLink_message:
    """Return a NAMED_VALUE_FLOAT, which ground stations plot by its name.

    Args:
        name: at most 10 ASCII characters.
        value: finite.
        time_s: time of validity on the sender's clock, s; the field wraps around after 49 days.
    """
    return mavlink.MAVLink_named_value_float_message(
        round(time_s * 1e3) % 2**32, name.encode("ascii"), value
    )


def time_question(stamp: int) -> MAVLink_message:
    """Return a TIMESYNC that asks for the autopilot's time; the answer returns the stamp (ns)."""
    return mavlink.MAVLink_timesync_message(0, stamp)


def version_question(system_id: int, component_id: int) -> MAVLink_message:
    """Return a REQUEST_MESSAGE for AUTOPILOT_VERSION, which contains the hardware's number."""
    wanted = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    return mavlink.MAVLink_command_long_message(
        system_id, component_id, request, 0, wanted, *(0.0,) * 6
    )


def heartbeat() -> MAVLink_message:
    """Return the HEARTBEAT of an onboard computer."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )


def ground_station_heartbeat() -> MAVLink_message:
    """Return the HEARTBEAT of a ground station, the only one whose end some autopilots notice."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


class Acknowledgements:
    """Commands that await answers, and their refusals."""

    def __init__(self) -> None:
        self._waiting: dict[int, float] = {}
        self._silent: set[int] = set()
        self._refused: dict[tuple[int, int], float] = {}

    def sent(self, messages: Iterable[MAVLink_message], now: float) -> None:
        """Note the commands among messages that are sent now (s)."""
        for message in messages:
            command = message.get_msgId() in {
                mavlink.MAVLINK_MSG_ID_COMMAND_INT,
                mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
            }
            if command and message.command != mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._waiting.setdefault(message.command, now)

    def answered(self, report: CommandReport, now: float) -> str | None:
        """Take an answer; return a message for the operator if it is a refusal not told lately."""
        self._waiting.pop(report.command, None)
        self._silent.discard(report.command)
        if report.result in GOOD:
            return None
        key = (report.command, report.result)
        if key not in self._refused and len(self._refused) >= MOST_REFUSALS:
            return None
        before = self._refused.get(key, -math.inf)
        self._refused[key] = now
        return refusal(*key) if now - before > QUIET_S else None

    def overdue(self, now: float) -> list[str]:
        """Return messages about commands that were never answered, each once until it is."""
        found = [
            command
            for command, since in self._waiting.items()
            if now - since > SILENCE_S and command not in self._silent
        ]
        self._silent.update(found)
        return [
            f"autopilot does not answer {name_of('MAV_CMD', command)} for {SILENCE_S:g} s:"
            " check the companion's uplink, and whether its firmware has it"
            for command in found
        ]


def refusal(command: int, result: int) -> str:
    """Describe a refusal for people."""
    answer = name_of("MAV_RESULT", result).removeprefix("MAV_RESULT_")
    text = f"autopilot answers {name_of('MAV_CMD', command)}: {answer}"
    reason = REASONS.get((command, result))
    text = text if reason is None else f"{text} ({reason})"
    return text if command in ASKING else f"{text}; be ready to take over"


def name_of(group: str, number: int) -> str:
    """Return the name of an entry of a MAVLink enumeration, or its number if it has none."""
    entry = mavlink.enums[group].get(number)
    return str(number) if entry is None else str(entry.name)
