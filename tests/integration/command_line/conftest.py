"""The command line as a user meets it: in this process for speed, as a real process where that matters."""

import asyncio
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from vfguide.cli import main
from vfguide.commands import check

ALONE = """\
name: alone
origin: {latitude_deg: 47.4, longitude_deg: 8.5, altitude_amsl_m: 488}
path: {type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 150}
leader: {vehicle: one, airspeed_m_s: 20}
vehicles:
  one: {system_id: 1}
"""
"""A leader by itself: as soon flown as read."""

PAIR = """\
name: pair
origin: {latitude_deg: 47.4, longitude_deg: 8.5, altitude_amsl_m: 488}
path: {type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 150, gain: 0.015}
leader: {vehicle: lead, airspeed_m_s: 20}
followers:
  - {vehicle: wing, slot: {forward_m: -20, right_m: 20}}
vehicles:
  defaults: {alpha_1_s: 1.2, beta_1_s: 0.8}
  lead: {system_id: 1}
  wing: {system_id: 2}
rehearsal:
  duration_s: 20
  position_noise_m: 0.1
  start: {wing: {forward_m: -5, right_m: 5}}
acceptance: {mean_error_m: 1, settle_10m_s: 15}
"""
"""Two aircraft, the follower nearly in its slot: well within its acceptance after 20 s."""


PATIENCE_S = 120.0
"""For a process that hangs; no test waits for it."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a command ended."""

    status: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        return self.err.splitlines()


Command = Callable[..., Outcome]
MissionFile = Callable[..., Path]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Runs a command in this process."""

    def run(*arguments: str | Path) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["vfguide", *(str(one) for one in arguments)])
        monkeypatch.setattr(sys, "excepthook", sys.excepthook)
        monkeypatch.setattr(os, "cpu_count", lambda: 1)
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return Outcome(int(ended.value.code or 0), captured.out, captured.err)

    return run


@pytest.fixture(scope="session")
def process() -> Command:
    """Runs a command as a process of its own."""

    def run(
        *arguments: str | Path,
        environment: Mapping[str, str] | None = None,
        stdout: int = asyncio.subprocess.PIPE,
        stderr: int = asyncio.subprocess.PIPE,
    ) -> Outcome:
        async def ended() -> Outcome:
            command = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "vfguide"),
                *(str(one) for one in arguments),
                stdout=stdout,
                stderr=stderr,
                env={**os.environ, **(environment or {})},
            )
            async with asyncio.timeout(PATIENCE_S):
                out, err = await command.communicate()
            return Outcome(command.returncode or 0, (out or b"").decode(), (err or b"").decode())

        outcome = asyncio.run(ended())
        assert "Traceback" not in outcome.err
        return outcome

    return run


@pytest.fixture
def unflown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what `check` flies to tell the error to expect."""
    monkeypatch.setattr(check, "with_expectation", lambda found, *_: found)


def changed(text: str, changes: Sequence[tuple[str, str]]) -> str:
    """A text with some of its words replaced by others."""
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@pytest.fixture
def alone_with(tmp_path: Path) -> MissionFile:
    """Writes the mission of a leader by itself, with changes."""

    def write(*changes: tuple[str, str], name: str = "alone.yaml") -> Path:
        path = tmp_path / name
        path.write_text(changed(ALONE, changes), encoding="utf-8")
        return path

    return write


@pytest.fixture
def pair_with(tmp_path: Path) -> MissionFile:
    """Writes the mission of two aircraft, with changes."""

    def write(*changes: tuple[str, str], name: str = "pair.yaml") -> Path:
        path = tmp_path / name
        path.write_text(changed(PAIR, changes), encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def flown(process: Command, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A flight of the pair, flown once for all tests that look at what it left."""
    place = tmp_path_factory.mktemp("flown")
    mission = place / "pair.yaml"
    mission.write_text(PAIR, encoding="utf-8")
    directory = place / "out"
    outcome = process("fly", mission, "--json", "--out", directory)
    return SimpleNamespace(outcome=outcome, directory=directory)


Elsewhere = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def elsewhere(tmp_path: Path, installed: Path) -> Elsewhere:
    """Runs `python -m PROGRAM ...` of the installed wheel in a directory that holds nothing else."""

    def start(program: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        environment = {key: value for key, value in os.environ.items() if key != "VFGUIDE_PLUGINS"}
        return subprocess.run(
            [installed, "-m", program, *map(str, arguments)],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    return start
