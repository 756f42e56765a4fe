"""The examples at the end of each command's help."""

import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import typer

import sitl_stub.cli
from vfguide.cli import COMMANDS as SUMMARIES
from vfguide.cli import EXAMPLES, loaded, with_usual_port

Command = Any  # of Typer's own Click


def typed_as(name: str, command: Command) -> Iterator[tuple[str, Command]]:
    """A command, and those of a group, by what is typed."""
    yield name, command
    for word, one in getattr(command, "commands", {}).items():
        yield from typed_as(f"{name} {word}", one)


COMMANDS = {typed: one for name in SUMMARIES for typed, one in typed_as(name, loaded(name))}


def lines_of(epilog: str) -> list[str]:
    """Whole commands: a line that ends with a backslash goes on in the next."""
    lines = epilog.replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.startswith("  ")]


@pytest.mark.parametrize("name", COMMANDS)
def test_an_example_is_a_command_that_the_program_takes(name):
    lines = lines_of(COMMANDS[name].epilog or "")
    assert lines
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "vfguide"
        # The example of a group may be one of a command below it.
        typed = max((one for one in COMMANDS if " ".join(words).startswith(one)), key=len)
        assert typed.startswith(name)
        # Raises where an option is not known, or one is missing; nothing is run.
        rest = words[len(typed.split()) :]
        assert COMMANDS[typed].make_context(typed, rest).params


@pytest.mark.parametrize("name", SUMMARIES)
def test_the_list_of_commands_says_what_the_help_of_each_begins_with(name):
    first, _, _ = COMMANDS[name].help.partition("\n\n")
    assert " ".join(first.split()) == SUMMARIES[name]


def test_no_example_is_of_a_command_that_is_not_there():
    assert set(EXAMPLES) == set(COMMANDS)


def test_examples_of_the_emulator_are_taken_too():
    command = typer.main.get_command(sitl_stub.cli.app)
    lines = lines_of(command.epilog or "")
    assert lines
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "sitl-stub"
        assert command.make_context(program, words).params


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["--foxglove"], ["--foxglove", "8765"]),
        (["--foxglove", "m.yaml"], ["--foxglove", "8765", "m.yaml"]),
        (["--foxglove", "0", "m.yaml"], ["--foxglove", "0", "m.yaml"]),
        (["--foxglove", "--link", "udp://a:1"], ["--foxglove", "8765", "--link", "udp://a:1"]),
        (["m.yaml", "--link", "8765"], ["m.yaml", "--link", "8765"]),
    ],
)
def test_foxglove_has_a_usual_port(typed, meant):
    assert with_usual_port(typed) == meant
