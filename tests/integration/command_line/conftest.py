"""The command line as a user meets it: in this process for speed, as a real process where that matters."""

import asyncio
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.kit import programs
from tests.kit.programs import Outcome, vfguide
from vfguide.cli import main
from vfguide.commands import check
from vfguide.lab.report import plots

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


@pytest.fixture
def refusal(command: Command) -> Callable[..., str]:
    """Runs a command that is refused; the one line that says why."""

    def refused(*arguments: str | Path) -> str:
        outcome = command(*arguments)
        assert (outcome.status, outcome.out) == (2, "")
        (line,) = outcome.lines
        return line

    return refused


@pytest.fixture(scope="session")
def process() -> Command:
    """Runs a command as a process of its own."""

    def run(
        *arguments: str | Path, environment: Mapping[str, str] | None = None, **options: int
    ) -> Outcome:
        environment = {**os.environ, **(environment or {})}
        return asyncio.run(vfguide(*arguments, env=environment, **options))

    return run


@pytest.fixture
def unflown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what `check` flies to tell the error to expect."""
    monkeypatch.setattr(check, "with_expectation", lambda found, *_: found)


@pytest.fixture
def unplotted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the plots, which take longer than the flight and are looked at elsewhere."""
    monkeypatch.setattr("vfguide.lab.report.page.write_report", lambda _record, _directory: None)


@pytest.fixture
def one_plot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw the tracks alone: the other plots are looked at elsewhere."""
    monkeypatch.setattr(plots, "PLOTS", plots.PLOTS[:1])


def changed(text: str, changes: Sequence[tuple[str, str]]) -> str:
    """A text with some of its words replaced by others."""
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def mission_file(text: str, name: str, directory: Path) -> MissionFile:
    """Writes a mission with changes."""

    def write(*changes: tuple[str, str], name: str = name) -> Path:
        path = directory / name
        path.write_text(changed(text, changes), encoding="utf-8")
        return path

    return write


@pytest.fixture
def alone_with(tmp_path: Path) -> MissionFile:
    return mission_file(ALONE, "alone.yaml", tmp_path)


@pytest.fixture
def pair_with(tmp_path: Path) -> MissionFile:
    return mission_file(PAIR, "pair.yaml", tmp_path)


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

    return partial(programs.elsewhere, installed, tmp_path, "-m")
