"""`vfguide keys`: make, show and replace the keys of a formation's members."""

import asyncio
import hashlib
import json
import re
from collections.abc import Sequence
from random import Random
from typing import Annotated

import typer
from rich import box
from rich.table import Table

from vfguide.commands.credentials import KeyFiles, check_flies, watched_formation
from vfguide.commands.options import (
    AsJson,
    KeyFile,
    LinkUrls,
    MissionFile,
    RosterFile,
    VehicleName,
    with_plugins,
)
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
from vfguide.link.member import ignore
from vfguide.link.opening import WatchedFormation, check_connected, watching
from vfguide.link.presence import REVOKED_KEY
from vfguide.mission import Mission, read_mission
from vfguide.system import run_watching_sockets

ALL_THERE, SOME_MISSING = 0, 1

SAY_S, LAST_S, AWAITED = 0.5, 5.0, 5.0
"""Revocations: repetition interval, s; least total time, s; and presences of each vehicle to wait for."""

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
"""Valid names of operators, usable as file name and topic."""


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
        typer.Option(metavar="NAME", help="Name of who watches and orders; default: `operator`."),
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
    made = make_keys(places, flown.name, flown.companions, operators=operator or (OPERATOR,))
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
    names = [*dict.fromkeys([*flown.companions, *roster.vehicles, *roster.operators])]
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
    complete = all(name in roster.vehicles for name in flown.companions)
    raise typer.Exit(ALL_THERE if complete and roster.formation == flown.name else SOME_MISSING)


@keys.command()
@with_plugins
def rotate(
    mission: MissionFile,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME...", help="Members whose keys are replaced; default: all."),
    ] = None,
) -> None:
    """Replace the keys of some members, or of all.

    What is signed with the old ones is refused by everybody who has the new roster.
    """
    flown = read_mission(mission).mission
    places = key_places(mission)
    roster = read_roster(places.roster)
    members = [*flown.companions, *roster.operators]
    for name in names or ():
        if name not in members:
            raise InputError(
                f"{name} is not a member of {flown.name}; its members are {', '.join(members)}"
            )
    made = make_keys(places, flown.name, flown.companions, operators=(), anew=names or members)
    # Owners of a replaced key had the radio key, too.
    tell_made(places, made, radio=make_radio_key(places, anew=True))


@keys.command()
@with_plugins
def revoke(
    mission: MissionFile,
    vehicle: VehicleName,
    *,
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
) -> None:
    """Tell a formation that flies that a vehicle's key is stolen: nobody believes it any more.

    The others keep that and pass it on; its own companion hands back to the autopilot. On the ground replace
    the key: `vfguide keys rotate`.

    Exit status: 0 all others say that they know, 1 some do not, 2 the input is wrong, 3 no link.
    """
    flown = read_mission(mission).mission
    check_flies(flown, vehicle)
    credentials = KeyFiles(mission=mission, key=key, roster=roster).of_operator()
    if credentials.key is None:
        raise InputError(
            "a key is revoked by an operator: give an operator's private key with --key"
        )
    watched = watched_formation(flown, link, credentials)
    others = [name for name in flown.companions if name != vehicle]
    unaware = run_watching_sockets(say_revoked(watched, vehicle, others))
    output = Terminal()
    for name in unaware:
        output.tell(f"{name}: has not said that it knows; see that it is heard, and say it again")
    output.tell(
        f"the key of {vehicle} is revoked: {len(others) - len(unaware)} of {len(others)} others know"
    )
    raise typer.Exit(SOME_MISSING if unaware else ALL_THERE)


async def say_revoked(watched: WatchedFormation, vehicle: str, others: Sequence[str]) -> list[str]:
    """Announce a revoked key until the others know, for some seconds at most; return those that do not know.

    Raises:
        VfguideError: no link is connected.
    """
    async with watching(watched, random=Random(), receive_reply=ignore) as (link, found):
        check_connected(link)
        slowest_s = max(carrier.presence_s for carrier in link.carriers)
        unaware = list(others)
        for _ in range(round((LAST_S + AWAITED * slowest_s) / SAY_S)):
            link.revoke(vehicle)
            await asyncio.sleep(SAY_S)
            unaware = [
                name
                for name in others
                if name not in found
                or not found[name].figures.keys() & {REVOKED_KEY, REVOKED_KEY + vehicle}
            ]
            if not unaware:
                break
        return unaware


def tell_made(places: KeyPlaces, made: Sequence[str], *, radio: bool) -> None:
    """Print which keys are new, and what to do with them."""
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
    """Return role and key state of one member."""
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
    """Return whether a member's private key is here, or what is wrong with it."""
    path = places.private(name)
    if not path.exists():
        return "no"
    try:
        key = read_private_key(path)
    except InputError as error:
        return str(error).removeprefix(f"{path}: ")
    return "yes" if public_bytes(key) == public else "not the one in the roster"


def fingerprint(public: bytes) -> str:
    """Return a hash of a public key, short enough to be compared by eye."""
    digits = hashlib.sha256(public).hexdigest()[:16]
    return " ".join(digits[start : start + 4] for start in range(0, len(digits), 4))
