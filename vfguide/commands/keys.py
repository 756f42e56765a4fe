"""`vfguide keys`: makes, shows and replaces the keys of a formation's members."""

import hashlib
import json
import re
from collections.abc import Sequence
from typing import Annotated

import typer
from rich import box
from rich.table import Table

from vfguide.commands.options import AsJson, MissionFile, with_plugins
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.link.keys import (
    OPERATOR,
    KeyPlaces,
    Roster,
    key_places,
    make_keys,
    make_radio_key,
    public_bytes,
    read_private_key,
    read_roster,
)
from vfguide.mission import Mission, read_mission

ALL_THERE, SOME_MISSING = 0, 1

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
"""What an operator may be called: also a file name and a topic."""


keys = typer.Typer(
    help="Keys by which the members of a formation know each other.",
    no_args_is_help=True,
    rich_markup_mode=None,
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
    flown = read_mission(mission).mission
    for name in operator or ():
        if not NAME.fullmatch(name) or name in flown.vehicles:
            raise InputError(
                f"--operator {name}: write a letter and up to 31 letters, digits, hyphens or underscores;"
                " no vehicle's name"
            )
    places = key_places(mission)
    made = make_keys(places, flown.name, vehicles_of(flown), operators=operator or (OPERATOR,))
    tell_made(places, made, radio=make_radio_key(places))


@keys.command()
@with_plugins
def show(mission: MissionFile, *, as_json: AsJson = False) -> None:
    """Tell who has which key.

    Exit status: 0 every vehicle is in the roster, 1 some are not, 2 there is none.
    """
    flown = read_mission(mission).mission
    places = key_places(mission)
    roster = read_roster(places.roster)
    names = [*dict.fromkeys([*vehicles_of(flown), *roster.vehicles, *roster.operators])]
    rows = {name: row_of(name, flown, roster, places) for name in names}
    output = Terminal()
    if as_json:
        output.tell(json.dumps(rows, indent=2))
    else:
        table = Table(
            "member",
            "role",
            "public key",
            "private key here",
            box=box.SIMPLE,
            title=f"{roster.formation}: {places.roster}",
            title_justify="left",
        )
        for name, row in rows.items():
            table.add_row(name, row["role"], row["fingerprint"], row["private"])
        output.print(table)
    complete = all(name in roster.vehicles for name in vehicles_of(flown))
    raise typer.Exit(ALL_THERE if complete and roster.formation == flown.name else SOME_MISSING)


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
    flown = read_mission(mission).mission
    places = key_places(mission)
    roster = read_roster(places.roster)
    members = [*vehicles_of(flown), *roster.operators]
    for name in names or ():
        if name not in members:
            raise InputError(
                f"{name} is not a member of {flown.name}; its members are {', '.join(members)}"
            )
    made = make_keys(places, flown.name, vehicles_of(flown), operators=(), anew=names or members)
    # Who had the key that is replaced had this one, too.
    tell_made(places, made, radio=make_radio_key(places, anew=True))


def vehicles_of(mission: Mission) -> list[str]:
    """Names of those who have a companion, leader first."""
    return list(mission.companions)


def tell_made(places: KeyPlaces, made: Sequence[str], *, radio: bool) -> None:
    """Say what is new, and what is to be done with it."""
    output = Terminal()
    if radio:
        output.tell(f"{places.radio}: new radio key, the same for all members that share a radio")
    if not made and not radio:
        output.tell(f"{places.roster}: everybody has a key; nothing was changed")
        return
    for name in made:
        output.tell(f"{places.private(name)}: new private key, for {name} alone")
    if made:
        output.tell(
            f"{places.roster}: new roster, for everybody; companions read it when they start"
        )


def row_of(name: str, mission: Mission, roster: Roster, places: KeyPlaces) -> dict[str, str]:
    """What is known of one member's keys."""
    if name in roster.operators:
        role = "operator"
    elif name == mission.leader.vehicle:
        role = "leader"
    else:
        role = "follower" if name in mission.vehicles else "not in the mission"
    public = roster.public(name)
    return {
        "role": role,
        "fingerprint": "missing" if public is None else fingerprint(public),
        "private": private_state(name, public, places),
    }


def private_state(name: str, public: bytes | None, places: KeyPlaces) -> str:
    """What is wrong with a member's private key, if it is here."""
    path = places.private(name)
    if not path.exists():
        return "no"
    try:
        key = read_private_key(path)
    except InputError as error:
        return str(error).removeprefix(f"{path}: ")
    return "yes" if public_bytes(key) == public else "not the one in the roster"


def fingerprint(public: bytes) -> str:
    """A public key, short enough to be compared by eye."""
    digits = hashlib.sha256(public).hexdigest()[:16]
    return " ".join(digits[start : start + 4] for start in range(0, len(digits), 4))
