"""Tables of states, as they are written and read, and how long a retry waits."""

from enum import Enum

import pytest

from vfguide.system import retry_delay
from vfguide.transitions import transitions


class Lamp(Enum):
    """States."""

    ON = "on"
    OFF = "off"


class Switch(Enum):
    """Events."""

    PRESS = "press"
    BREAK = "break"


TABLE = """
|     | press | break |
| --- | ----- | ----- |
| on  | off   | off   |
| off | on    | off   |
"""


def test_a_table_is_read_by_rows_and_columns():
    assert transitions(TABLE, Lamp, Switch) == {
        Lamp.ON: {Switch.PRESS: Lamp.OFF, Switch.BREAK: Lamp.OFF},
        Lamp.OFF: {Switch.PRESS: Lamp.ON, Switch.BREAK: Lamp.OFF},
    }


@pytest.mark.parametrize(
    "table",
    [
        TABLE.replace("| off | on    | off   |", ""),
        TABLE.replace("| off | on    | off   |", "| off | on    |"),
        TABLE.replace("| off | on    | off   |", "| off | on    | dim   |"),
        TABLE.replace("press", "kick"),
        "|     | press |\n| --- | --- |\n| on | off |\n| off | on |",
    ],
    ids=["a row", "a cell", "a state", "an event", "a column"],
)
def test_a_table_that_lacks_something_or_has_something_else_is_refused(table):
    with pytest.raises(ValueError, match=r"lacks|valid|shorter"):
        transitions(table, Lamp, Switch)


@pytest.mark.parametrize("failures", [1, 3, 8])
def test_chance_takes_away_up_to_half(failures):
    whole = retry_delay(failures, 1.0)
    assert retry_delay(failures, 0.0) == pytest.approx(0.5 * whole)
    assert retry_delay(failures, 0.5) == pytest.approx(0.75 * whole)


@pytest.mark.parametrize("failures", [-1, 0])
def test_no_failure_waits_as_long_as_one(failures):
    assert retry_delay(failures, 0.3) == retry_delay(1, 0.3)
