"""The help of every command ends with examples that it would take."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from sitl_stub import cli as emulator
from vfguide.cli import app

Command = Any  # of Typer's own Click


def commands(name: str, command: Command) -> Iterator[tuple[str, Command]]:
    """A command and those below it, by what is typed."""
    yield name, command
    for word, below in getattr(command, "commands", {}).items():
        yield from commands(f"{name} {word}", below)


ALL = {
    **dict(commands("vfguide", typer.main.get_command(app))),
    **dict(commands("sitl-stub", typer.main.get_command(emulator.app))),
}
del ALL["vfguide"]


@pytest.mark.parametrize("name", ALL)
def test_help_ends_with_examples_whose_options_there_are(name: str) -> None:
    command = ALL[name]
    examples = (command.epilog or "").replace("\\\n", " ")
    assert "Examples:" in examples
    lines = [line.strip() for line in examples.splitlines() if line.strip().startswith(name)]
    assert lines, f"no example of {name}"
    known = {word for one in command.params for word in (*one.opts, *one.secondary_opts)}
    for line in lines:
        assert set(re.findall(r"(?<!\S)--?[a-z][a-z-]*", line)) <= known
