"""The log on standard error: lines to read on a terminal, JSON lines for programs elsewhere."""

import json
import logging
import sys
from datetime import UTC, datetime
from enum import StrEnum

STANDARD = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}
"""What every log record has; the rest came with `extra`."""


class LogFormat(StrEnum):
    """How the log is written."""

    AUTO = "auto"
    """As text where standard error is a terminal, else as JSON."""
    JSON = "json"
    """One JSON object on each line."""
    TEXT = "text"
    """One short line for each entry: time of day, vehicle, level, message."""


class JsonFormatter(logging.Formatter):
    """Time, level, logger and message, then whatever else the record carries."""

    def format(self, record: logging.LogRecord) -> str:
        """One line."""
        content: dict[str, object] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        content |= {key: value for key, value in vars(record).items() if key not in STANDARD}
        if record.exc_info:
            content["exception"] = self.formatException(record.exc_info)
        return json.dumps(content, default=str)


class TextFormatter(logging.Formatter):
    """Time of day where this computer stands, vehicle, level and message."""

    def __init__(self, vehicle: str) -> None:
        """Write for a vehicle, of which most records say nothing.

        Args:
            vehicle: its name.
        """
        super().__init__()
        self._vehicle = vehicle

    def format(self, record: logging.LogRecord) -> str:
        """One line, and below it those of a traceback, if there is one."""
        when = datetime.fromtimestamp(record.created, UTC).astimezone()
        clock = when.isoformat(timespec="milliseconds")[11:23]
        # What others have sent may be in a message: nothing that moves a cursor goes to a terminal.
        message = "".join(one if one.isprintable() else " " for one in record.getMessage())
        line = f"{clock}  {self._vehicle}  {record.levelname.lower():7}  {message}"
        return f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line


def log_to_standard_error(log_format: LogFormat, vehicle: str) -> None:
    """Send every log record of this process to standard error.

    Args:
        log_format: how each is written.
        vehicle: which this process is for.
    """
    readable = log_format is LogFormat.TEXT or (
        log_format is LogFormat.AUTO and sys.stderr.isatty()
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(TextFormatter(vehicle) if readable else JsonFormatter())
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
