"""`vfguide keys`: makes, shows and replaces the keys of a formation's members."""

import hashlib
import json
import re
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.table import Table

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
from vfguide.mission import Mission

ALL_THERE, SOME_MISSING = 0, 1

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
"""What an operator may be called: also a file name and a topic."""


def vehicles_of(mission: Mission) -> list[str]:
    """Names of those who have a companion, leader first."""
    return list(mission.companions)


def make(mission: Mission, file: Path, operators: Sequence[str]) -> None:
    """Make the keys that are missing.

    Raises:
        InputError: a name is none, or the roster is another formation's.
    """
    for name in operators:
        if not NAME.fullmatch(name) or name in mission.vehicles:
            raise InputError(
                f"--operator {name}: write a letter and up to 31 letters, digits, hyphens or underscores;"
                " no vehicle's name"
            )
    places = key_places(file)
    made = make_keys(places, mission.name, vehicles_of(mission), operators=operators or (OPERATOR,))
    tell_made(places, made, radio=make_radio_key(places))


def rotate(mission: Mission, file: Path, names: Sequence[str]) -> None:
    """Replace the keys of some members, or of all.

    Raises:
        InputError: there are no keys yet, or one of them is no member.
    """
    places = key_places(file)
    roster = read_roster(places.roster)
    members = [*vehicles_of(mission), *roster.operators]
    for name in names:
        if name not in members:
            raise InputError(
                f"{name} is not a member of {mission.name}; its members are {', '.join(members)}"
            )
    made = make_keys(
        places, mission.name, vehicles_of(mission), operators=(), anew=tuple(names) or members
    )
    # Who had the key that is replaced had this one, too.
    tell_made(places, made, radio=make_radio_key(places, anew=True))


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


def show(mission: Mission, file: Path, *, as_json: bool) -> int:
    """Print who has which key, and return the exit status.

    Raises:
        InputError: there is no roster.
    """
    places = key_places(file)
    roster = read_roster(places.roster)
    names = [*dict.fromkeys([*vehicles_of(mission), *roster.vehicles, *roster.operators])]
    rows = {name: row_of(name, mission, roster, places) for name in names}
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
    complete = all(name in roster.vehicles for name in vehicles_of(mission))
    return ALL_THERE if complete and roster.formation == mission.name else SOME_MISSING


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
