"""Transition tables from a state (rows) and an event (columns), written as the docs print them."""

from enum import Enum
from typing import TypeVar

State = TypeVar("State", bound=Enum)
Event = TypeVar("Event", bound=Enum)


def transitions(
    table: str, states: type[State], events: type[Event]
) -> dict[State, dict[Event, State]]:
    """Read a Markdown table whose cells are values of these states and events.

    Raises:
        ValueError: a cell names no state or event, one of them is missing, or a row is too short or long.
    """
    header, _, *rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()
    ]
    columns = [events(name) for name in header[1:]]
    found = {
        states(name): dict(zip(columns, map(states, cells), strict=True)) for name, *cells in rows
    }
    if set(columns) != set(events) or set(found) != set(states):
        raise ValueError("a table of states lacks a row or a column")
    return found
