"""The options of `vfguide keys`."""

from typing import Annotated

import typer

from vfguide.commands.shared_options import AsJson, MissionFile, with_plugins
from vfguide.mission import read_mission

# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.

keys = typer.Typer(
    help="Keys by which the members of a formation know each other.", no_args_is_help=True
)


@keys.command()
@with_plugins
def make(
    mission: MissionFile,
    *,
    operator: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Who watches and orders; `operator` if absent."),
    ] = None,
) -> None:
    """Make a key pair for each member that has none, and the roster of public keys.

    The roster is MISSION with the ending .roster: the same file goes to everybody. Private keys are in the
    directory with the ending .keys: each goes to its own computer alone.
    """
    from vfguide.commands.keys import make as make_keys

    make_keys(read_mission(mission).mission, mission, operator or [])


@keys.command()
@with_plugins
def show(mission: MissionFile, *, as_json: AsJson = False) -> None:
    """Tell who has which key.

    Exit status: 0 every vehicle is in the roster, 1 some are not, 2 there is none.
    """
    from vfguide.commands.keys import show as show_keys

    raise typer.Exit(show_keys(read_mission(mission).mission, mission, as_json=as_json))


@keys.command()
@with_plugins
def rotate(
    mission: MissionFile,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME...", help="Members whose keys are replaced; all if absent."),
    ] = None,
) -> None:
    """Replace the keys of some members, or of all.

    What is signed with the old ones is refused by everybody who has the new roster.
    """
    from vfguide.commands.keys import rotate as rotate_keys

    rotate_keys(read_mission(mission).mission, mission, names or [])
