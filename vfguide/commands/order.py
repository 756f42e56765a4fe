"""`vfguide order`: parse an order, give it, and print its outcome."""

from collections.abc import Sequence
from typing import Annotated, get_args

import typer

from vfguide.commands.credentials import KeyFiles, watched_formation
from vfguide.commands.options import Insecure, KeyFile, LinkUrls, MissionFile, RosterFile
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.formation.arrangement import SHAPES, Point
from vfguide.formation.orders import Action, Order, check_known
from vfguide.lab.ordering import conclusion, give_order
from vfguide.mission import read_mission
from vfguide.mission.order_plan import formation_of_mission
from vfguide.system import run_watching_sockets

ACTIONS: tuple[Action, ...] = get_args(Action)

FLOWN, NOT_FLOWN = 0, 1

FARTHEST_M = 3000.0
"""Greatest distance of a slot from the leader in an order."""

KNOWN = (
    f"{', '.join(SHAPES)}; spacing; swap A B; slot NAME=FORWARD,RIGHT; leave NAME; join NAME;"
    " path NAME; lead NAME;"
    f" {', '.join(ACTIONS)}"
)


USAGE = {
    "spacing": "spacing --spacing M",
    "swap": "swap A B",
    "slot": "slot NAME=FORWARD,RIGHT",
    "leave": "leave NAME",
    "join": "join NAME",
    "path": "path NAME",
    "lead": "lead NAME",
}
"""Usage of the orders that need more than one word."""


def order(
    mission: MissionFile,
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="WHAT",
            help="A shape (vee, echelon-left, echelon-right, line-abreast, trail, diamond, finger-four);"
            " spacing; swap A B; slot NAME=FORWARD,RIGHT; leave NAME; join NAME; path NAME;"
            " lead NAME; hold; resume; abort.",
        ),
    ],
    *,
    link: LinkUrls,
    spacing: Annotated[
        float | None,
        typer.Option(metavar="M", min=1.0, max=1000.0, help="Distance between neighbours, m."),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Rehearse the order from the present state, and give none."),
    ] = False,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
) -> None:
    """Order a formation that flies to change: rehearsed first, then agreed on by all vehicles.

    Exit status: 0 flown by all (or rehearsed), 1 not flown, 2 the input is wrong or the order cannot be
    carried out, 3 no link, or the formation is not heard.
    """
    wanted = order_of(what, spacing)
    flown = read_mission(mission).mission
    check_known(wanted, formation_of_mission(flown))
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    watched = watched_formation(flown, link, keys.of_operator())
    output = Terminal()
    outcome = run_watching_sockets(
        give_order(flown, wanted, watched, tell=output.tell, dry_run=dry_run)
    )
    if dry_run:
        raise typer.Exit(FLOWN)
    for line in conclusion(outcome):
        output.tell(line)
    raise typer.Exit(FLOWN if outcome.flown else NOT_FLOWN)


def order_of(words: Sequence[str], spacing: float | None) -> Order:
    """Parse an order such as `vee`, `swap f1 f2` or `slot f1=-20,10`.

    Raises:
        InputError: it is no order; the text says which there are.
    """
    what, names = words[0] if words else "", tuple(words[1:])
    if spacing is not None and what not in {*SHAPES, "spacing"}:
        raise InputError("--spacing: goes with a shape or with `spacing`; leave it out")
    order = named_order(what, names) if names else plain_order(what, spacing)
    if order is None and what in USAGE:
        raise InputError(
            f"{' '.join(words)}: is not complete, or too much; write"
            f" `vfguide order MISSION {USAGE[what]} --link URL`"
        )
    if order is None:
        raise InputError(f"{' '.join(words) or 'nothing'}: is no order; there are {KNOWN}")
    return order


def plain_order(what: str, spacing: float | None) -> Order | None:
    """Return an order without names; None where it is none."""
    if what in SHAPES:
        return Order(shape=what, spacing=spacing)
    if what in ACTIONS:
        return Order(action=what)
    if what == "spacing" and spacing is not None:
        return Order(spacing=spacing)
    return None


def named_order(what: str, names: tuple[str, ...]) -> Order | None:
    """Return an order with the names of followers, a path or a leader; None where it is none.

    Raises:
        InputError: a slot is malformed.
    """
    order = None
    match what, names:
        case "swap", (first, second):
            order = Order(swap=(first, second))
        case "slot", _:
            order = Order(slots=dict(slot_of(text) for text in names))
        case "leave", _:
            order = Order(leave=names)
        case "join", _:
            order = Order(join=names)
        case "path", (name,):
            order = Order(path=name)
        case "lead", (name,):
            order = Order(lead=name)
    return order


def slot_of(text: str) -> tuple[str, Point]:
    """Parse a follower's slot: f1=-20,10 or f1=-20,10,15 (forward, right and up, m).

    Raises:
        InputError: it is malformed, or too far away.
    """
    name, _, numbers = text.partition("=")
    try:
        values = [float(number) for number in numbers.split(",")]
    except ValueError:
        values = []
    # Written so that NaN fails: its comparisons are all false.
    if not (name and len(values) in {2, 3} and all(abs(value) <= FARTHEST_M for value in values)):
        raise InputError(
            f"slot {text}: write NAME=FORWARD,RIGHT in metres, such as f1=-20,10, no more than"
            f" {FARTHEST_M:g} m away"
        )
    return name, Point(*values)
