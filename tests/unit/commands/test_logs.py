"""The log of a companion, as people and as programs read it."""

import json
import logging
import os
import pty
import re
import subprocess
import sys
from contextlib import suppress

import pytest

from vfguide.commands.companion import TextFormatter

PROGRAM = """
import logging, sys
from vfguide.commands.companion import LogFormat, log_to_standard_error
log_to_standard_error(LogFormat(sys.argv[1]), "f1")
logging.getLogger("a.b").warning("link %s: lost", "mqtt", extra={"vehicle": "f1"})
"""

LINE = re.compile(r"\d\d:\d\d:\d\d\.\d{3}  f1  warning  link mqtt: lost")


def logged_to_terminal(log_format: str) -> str:
    """What a process writes whose standard error is a terminal."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", PROGRAM, log_format]
    subprocess.run(command, stderr=theirs, check=True, timeout=60.0)
    os.close(theirs)
    said = b""
    with suppress(OSError):  # the end of a terminal that no process has any more
        while data := os.read(ours, 4096):
            said += data
    os.close(ours)
    return said.decode().replace("\r\n", "\n")


def logged_to_file(log_format: str) -> str:
    """What a process writes whose standard error is a pipe."""
    command = [sys.executable, "-c", PROGRAM, log_format]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60.0)
    return done.stderr


@pytest.mark.parametrize(
    ("log_format", "readable_on_a_terminal", "readable_elsewhere"),
    [("auto", True, False), ("json", False, False), ("text", True, True)],
)
def test_a_terminal_gets_a_line_to_read_and_all_else_json_unless_it_is_chosen(
    log_format, readable_on_a_terminal, readable_elsewhere
):
    for logged, readable in (
        (logged_to_terminal, readable_on_a_terminal),
        (logged_to_file, readable_elsewhere),
    ):
        (line,) = logged(log_format).splitlines()
        if readable:
            assert LINE.fullmatch(line)
            continue
        entry = json.loads(line)
        assert entry["message"] == "link mqtt: lost"
        assert (entry["level"], entry["vehicle"], entry["logger"]) == ("warning", "f1", "a.b")


def test_what_moves_a_cursor_does_not_reach_a_terminal():
    record = logging.LogRecord(
        "a", logging.INFO, "", 0, "text \x1b[2J\r\n of a stranger", None, None
    )
    line = TextFormatter("f1").format(record)
    assert "\x1b" not in line
    assert len(line.splitlines()) == 1
    assert line.endswith("f1  info     text  [2J   of a stranger")
