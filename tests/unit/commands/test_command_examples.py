"""The examples at the end of each command's help."""

import shlex

import pytest
import typer

from vfguide.cli import COMMANDS, EXAMPLES, app


def commands_of(lines: tuple[str, ...]) -> list[str]:
    """Whole commands: a line that ends with a backslash goes on in the next."""
    return "\n".join(lines).replace("\\\n", " ").splitlines()


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_a_command_that_the_program_takes(name: str) -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    for line in commands_of(EXAMPLES[name]):
        program, command, *words = shlex.split(line)
        assert (program, command) == ("vfguide", name)
        # Raises where an option is not known, or one is missing; nothing is run.
        assert group.commands[name].make_context(name, words).params


def test_every_command_for_people_has_one() -> None:
    # `emulate` is started by the containers and by `fly --live`.
    assert set(EXAMPLES) == {one.__name__ for one in COMMANDS} - {"emulate"}
