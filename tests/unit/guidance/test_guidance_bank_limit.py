"""How far an aircraft banks is learned from plateaus below what is asked for, and from nothing else."""

import math
from collections.abc import Callable

import pytest

from tests.kit.flight import fly
from tests.kit.missions import shipped
from vfguide.commands.overrides import Overrides, apply_overrides, parse_settings
from vfguide.guidance.bank_limit import BankLimit, BankMoment

PERIOD = 0.1


ALPHA = 0.8


def asked(time_s: float) -> float:
    """To one side by 45 degrees for 5 s, by 12 degrees for 5 s, then to the other side, rad."""
    turn = math.radians(45.0 if time_s % 10.0 < 5.0 else 12.0)
    return turn if time_s % 20.0 < 10.0 else -turn


def limit_of(
    flown: Callable[[float], float],
    *,
    seconds: float = 40.0,
    wanted: Callable[[float], float] = asked,
) -> BankLimit:
    """What is known after some seconds of an aircraft that banks so, by what it is asked for."""
    learner, bank = BankLimit(), 0.0
    for step in range(round(seconds / PERIOD)):
        time_s = step * PERIOD
        bank += PERIOD / (0.3 + PERIOD) * (flown(wanted(time_s)) - bank)
        error = math.tan(wanted(time_s)) / ALPHA
        learner.observe(BankMoment(time_s=time_s, bank=bank, asked=error), late=0.5)
    return learner


def within(degrees: float) -> Callable[[float], float]:
    most = math.radians(degrees)
    return lambda wanted: min(max(wanted, -most), most)


def test_a_bank_that_is_never_passed_although_more_is_asked_is_its_limit():
    value = limit_of(within(25.0)).value
    assert value is not None
    assert math.degrees(value) == pytest.approx(25.0, abs=0.5)


@pytest.mark.parametrize(
    ("flown", "options"),
    [
        # One plateau is none.
        (within(25.0), {"seconds": 9.0}),
        # What follows is asked for no more than it banks, in a steady turn as well.
        (lambda wanted: wanted, {}),
        (lambda wanted: wanted, {"wanted": lambda _: 0.4}),
        # One that answers a third as fast as was thought.
        (lambda wanted: wanted / 3.0, {}),
    ],
)
def test_nothing_else_is_taken_for_a_limit(flown, options):
    assert limit_of(flown, **options).value is None


def test_a_greater_bank_ends_what_was_taken_for_a_limit():
    learner = limit_of(within(25.0))
    for step in range(60):
        learner.observe(
            BankMoment(time_s=40.0 + step * PERIOD, bank=math.radians(32.0), asked=1.0), late=0.5
        )
    assert learner.value is None


def test_an_aircraft_that_banks_less_than_its_mission_says_is_flown_by_what_it_does():
    settings = ["rehearsal.emulator.max_bank_deg=22", "rehearsal.duration_s=60", "wind.type=calm"]
    mission = apply_overrides(shipped("circle-wind"), Overrides(settings=parse_settings(settings)))
    heard = [text for text in fly(mission).texts() if text.startswith("it banks no further than")]
    assert heard
    assert len(heard) <= 4
    assert all("for the mission: max_bank_deg: 2" in text for text in heard)
