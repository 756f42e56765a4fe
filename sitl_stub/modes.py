"""Flight modes of the two autopilots and what the emulator flies in each."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Mode:
    """One flight mode."""

    name: str
    """As its status text and the ground stations call it."""

    custom_mode: int
    """The number in HEARTBEAT.custom_mode."""

    flies: Literal["commanded", "circle", "straight", "loiter", "home", "take-off"] = "straight"
    """Obeys commands; turns at a constant bank; keeps the course it had at entry; circles around the
    place of its entry, or around home; climbs, from the ground if need be, and then loiters.

    PX4's Guided Course keeps the course of its entry until it is told another.
    Neither AUTO nor a pilot's mode has a mission or a stick here, so they fly straight on.
    """


def px4_custom_mode(main: int, sub: int = 0) -> int:
    """PX4's custom_mode: main mode in the third byte, sub mode in the fourth."""
    return main << 16 | sub << 24


def by_number(modes: Iterable[Mode]) -> dict[int, Mode]:
    """The modes by the number on the wire."""
    return {mode.custom_mode: mode for mode in modes}


GUIDED = Mode("GUIDED", 15, "commanded")
LOITER = Mode("LOITER", 12, "loiter")
MANUAL = Mode("MANUAL", 0)
RTL = Mode("RTL", 11, "home")
TAKEOFF = Mode("TAKEOFF", 13, "take-off")

ARDUPLANE_MODES = by_number(
    [
        MANUAL,
        Mode("CIRCLE", 1, "circle"),
        Mode("STABILIZE", 2),
        Mode("TRAINING", 3),
        Mode("ACRO", 4),
        Mode("FBWA", 5),
        Mode("FBWB", 6),
        Mode("CRUISE", 7),
        Mode("AUTOTUNE", 8),
        Mode("AUTO", 10),
        RTL,
        LOITER,
        TAKEOFF,
        GUIDED,
    ]
)
"""ArduPlane's modes for a fixed wing, by number."""

OFFBOARD = Mode("OFFBOARD", px4_custom_mode(6), "straight")
GUIDED_COURSE = Mode("AUTO.COURSE", px4_custom_mode(4, 19), "straight")
AUTO_LOITER = Mode("AUTO.LOITER", px4_custom_mode(4, 3), "loiter")
AUTO_TAKEOFF = Mode("AUTO.TAKEOFF", px4_custom_mode(4, 2), "take-off")
AUTO_RTL = Mode("AUTO.RTL", px4_custom_mode(4, 5), "home")

PX4_MODES = by_number(
    [
        Mode("MANUAL", px4_custom_mode(1)),
        Mode("ALTCTL", px4_custom_mode(2)),
        Mode("POSCTL", px4_custom_mode(3)),
        AUTO_TAKEOFF,
        AUTO_LOITER,
        Mode("AUTO.MISSION", px4_custom_mode(4, 4)),
        AUTO_RTL,
        Mode("AUTO.LAND", px4_custom_mode(4, 6)),
        Mode("ACRO", px4_custom_mode(5)),
        OFFBOARD,
        Mode("STABILIZED", px4_custom_mode(7)),
        GUIDED_COURSE,
    ]
)
"""PX4's modes for a fixed wing, by number; Guided Course came with 1.18."""
