"""`vfguide order`: words into an order, and what becomes of it in lines."""

import asyncio
from collections.abc import Sequence
from typing import get_args

from vfguide.commands.credentials import KeyFiles, watched_formation
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Action, Order, check_known
from vfguide.formation.shapes import SHAPES
from vfguide.lab.ordering import conclusion, give_order
from vfguide.mission import Mission
from vfguide.mission.order_plan import formation_of_mission

ACTIONS: tuple[Action, ...] = get_args(Action)

FLOWN, NOT_FLOWN = 0, 1

FARTHEST_M = 3000.0
"""Orders carry no slot that is farther from the leader."""

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
"""How orders are written that need more than a word."""


def order_of(words: Sequence[str], spacing: float | None) -> Order:
    """An order in words, such as `vee`, `swap f1 f2` or `slot f1=-20,10`.

    Raises:
        InputError: it is none; the text says which there are.
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
    """An order that names no follower; None where it is none."""
    if what in SHAPES:
        return Order(shape=what, spacing=spacing)
    if what in ACTIONS:
        return Order(action=what)
    if what == "spacing" and spacing is not None:
        return Order(spacing=spacing)
    return None


def named_order(what: str, names: tuple[str, ...]) -> Order | None:
    """An order about some followers; None where it is none.

    Raises:
        InputError: a slot is none.
    """
    match what:
        case "swap" if len(names) == 2:
            return Order(swap=(names[0], names[1]))
        case "slot":
            return Order(slots=dict(slot_of(text) for text in names))
        case "leave":
            return Order(leave=names)
        case "join":
            return Order(join=names)
        case _:
            return None if len(names) > 1 else named_alone(what, names[0])


def named_alone(what: str, name: str) -> Order | None:
    """An order that names one thing only; None where it is none."""
    match what:
        case "path":
            return Order(path=name)
        case "lead":
            return Order(lead=name)
        case _:
            return None


def slot_of(text: str) -> tuple[str, Point]:
    """A follower and its slot, of f1=-20,10 or f1=-20,10,15 (forward, right and up, m).

    Raises:
        InputError: it is none.
    """
    name, _, numbers = text.partition("=")
    try:
        values = [float(number) for number in numbers.split(",")]
    except ValueError:
        values = []
    # Not "beyond": a comparison with NaN is false whichever way it is put.
    if not (name and len(values) in {2, 3} and all(abs(value) <= FARTHEST_M for value in values)):
        raise InputError(
            f"slot {text}: write NAME=FORWARD,RIGHT in metres, such as f1=-20,10, no more than"
            f" {FARTHEST_M:g} m away"
        )
    return name, Point(*values)


def give(
    mission: Mission,
    order: Order,
    *,
    links: Sequence[str],
    keys: KeyFiles,
    dry_run: bool,
) -> int:
    """Rehearse an order, give it, print each vehicle's answer, and return the exit status.

    Raises:
        InputError: an address, key or order is wrong, or the order cannot be carried out.
        VfguideError: no link stands, or the formation is not heard.
    """
    check_known(order, formation_of_mission(mission))
    credentials = keys.of_operator()
    watched = watched_formation(mission, links, credentials)
    output = Terminal()
    outcome = asyncio.run(give_order(mission, order, watched, tell=output.tell, dry_run=dry_run))
    if dry_run:
        return FLOWN
    for line in conclusion(outcome):
        output.tell(line)
    return FLOWN if outcome.flown else NOT_FLOWN
