"""`vfguide identify` as a process, beside an emulator that signs."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Timer

import pytest

from tests.kit.sockets import PATIENCE_S, free_port

KEY = "ab" * 32


@pytest.fixture
def emulator() -> Iterator[str]:
    """The address of an aircraft in the air."""
    place = f"127.0.0.1:{free_port()}"
    stub = (sys.executable, "-m", "sitl_stub", "--system-id", "1", "--airborne")
    process = subprocess.Popen((*stub, "--mavlink", f"udpin://{place}", "--signing-key", KEY))
    yield f"udpout://{place}"
    process.terminate()
    process.wait(PATIENCE_S)


def identify(directory: Path, address: str) -> subprocess.Popen[str]:
    (directory / "key").write_text(KEY)
    (directory / "key").chmod(0o600)
    command = (sys.executable, "-m", "vfguide", "identify", "leader", "--mission", "line-calm")
    options = ("--mavlink", address, "--engage", "--state", "state", "--signing-key-file", "key")
    process = subprocess.Popen(
        (*command, *options),
        cwd=directory,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    last_resort = Timer(PATIENCE_S, process.kill)
    last_resort.daemon = True
    last_resort.start()
    return process


def said(process: subprocess.Popen[str], words: str) -> bool:
    """Whether a process says it before it ends."""
    assert process.stderr is not None
    return any(words in line for line in process.stderr)


def test_it_hands_back_when_it_is_stopped_and_engages_once_in_a_flight(emulator, tmp_path):
    first = identify(tmp_path, emulator)
    assert said(first, "identification: small steps")
    first.send_signal(signal.SIGINT)
    _, words = first.communicate()
    assert "stopping: handing back" in words
    # It has ended since the autopilot has shown that it flies by itself.
    assert "take it by hand" not in words
    assert first.returncode == 3
    second = identify(tmp_path, emulator)
    assert said(second, "not engaged by itself, it has")
    second.send_signal(signal.SIGTERM)
    second.communicate()
    assert second.returncode == 3
