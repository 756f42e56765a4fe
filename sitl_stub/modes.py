"""A flight mode of an autopilot and what the emulator flies in it."""

from collections.abc import Iterable
from typing import Literal

import msgspec


class AutopilotMode(msgspec.Struct, frozen=True):
    """One flight mode."""

    name: str
    """Name in status texts and ground stations."""

    custom_mode: int
    """The number in HEARTBEAT.custom_mode."""

    flies: Literal["commanded", "circle", "straight", "loiter", "home", "take-off"] = "straight"
    """Obeys commands; turns at a constant bank; keeps the course it had at entry; circles around the
    place of its entry, or around home; climbs, from the ground if need be, and then loiters.

    PX4's Guided Course keeps the course of its entry until it is told another.
    Neither AUTO nor a pilot's mode has a mission or a stick here, so they fly straight on.
    """


def by_number(modes: Iterable[AutopilotMode]) -> dict[int, AutopilotMode]:
    """The modes by the number on the wire."""
    return {mode.custom_mode: mode for mode in modes}
