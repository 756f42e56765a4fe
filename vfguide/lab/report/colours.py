"""Colours of vehicles, the same in plots, replays and the console."""

from collections.abc import Sequence

from vfguide.record.flight import FlightRecord

LEADER_COLOUR = "#1a1a1a"

FOLLOWER_COLOURS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#e69f00",
    "#56b4e9",
    "#6f4fa0",
    "#8c564b",
    "#999933",
)
"""Colours of Okabe and Ito, which colour-blind readers can distinguish; three more for large formations."""

DAY_COLOURS = (LEADER_COLOUR, *FOLLOWER_COLOURS)
"""Colours on a light background, the leader's first."""

NIGHT_COLOURS = (
    "#f2f2f2",
    "#4da3e8",
    "#ff8a45",
    "#2fc79a",
    "#eaa0ca",
    "#f5bf3d",
    "#a5dbf7",
    "#ad92e6",
    "#cf9a8b",
    "#cfcf62",
)
"""Colours on a dark background, the leader's first."""


def colours_of(vehicles: Sequence[str], palette: Sequence[str] = DAY_COLOURS) -> dict[str, str]:
    """Return a colour for each vehicle by name; the leader comes first and has the palette's first."""
    leader, *followers = vehicles
    colours = {leader: palette[0]}
    for number, follower in enumerate(followers):
        colours[follower] = palette[1 + number % (len(palette) - 1)]
    return colours


def vehicle_colours(record: FlightRecord, palette: Sequence[str] = DAY_COLOURS) -> dict[str, str]:
    """Return the colour of each vehicle of a flight, by name."""
    return colours_of([vehicle.name for vehicle in record.vehicles], palette)
