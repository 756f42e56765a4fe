"""Make the pictures of the pages of orders and of keeping clear anew.

python -m tests.benchmarks.pictures docs/images
"""

import cmath
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from matplotlib.patches import Circle

from tests.kit.flight import fly
from tests.kit.missions import content_of, shipped
from vfguide.companion import avoidance
from vfguide.guidance.separation import (
    TIMES,
    WANTED,
    Agility,
    Clearance,
    ComplexArray,
    Manoeuvres,
    Others,
    OwnMotion,
    WantedMotion,
    closest_approaches,
    keep_clear,
    manoeuvres_between,
    own_tracks,
)
from vfguide.lab.report.colours import colours_of
from vfguide.lab.report.style import dress, new_figure, save_figure
from vfguide.lab.report.tracks_plot import draw_aircraft
from vfguide.mission import Mission
from vfguide.mission.order_plan import timetable
from vfguide.suite import with_law


def shapes(path: Path) -> None:
    """Draw from where to where each follower flies by the orders of the mission `shapes`."""
    mission = shipped("shapes")
    colours = colours_of([mission.leader.vehicle, *mission.followers_by_name])
    figure = new_figure(10.0, 6.4)
    panels = figure.subplots(2, 3).flat
    for axes, (order, _), timed in zip(panels, timetable(mission), mission.orders, strict=False):
        draw_aircraft(axes, 0.0, 0.0, 0.0, colour=colours[mission.leader.vehicle], size=16.0)
        for one in order.places:
            colour, begin, end = colours[one.vehicle], one.begin, one.end
            axes.plot([begin.right, end.right], [begin.forward, end.forward], color=colour)
            axes.plot([begin.right], [begin.forward], "o", color=colour, alpha=0.5)
            draw_aircraft(axes, end.right, end.forward, 0.0, colour=colour, size=16.0)
        title = f"{timed.order.shape}, {order.time_s:.0f} s, in {order.duration_s:.0f} s"
        dress(axes, title=title, across="right of the leader, m", up="ahead, m")
        axes.set_aspect("equal", adjustable="datalim")
    save_figure(figure, path)


CROWDED, STEP = 28, 322
"""Scenario of the suite in which five join within 80 m, and the step of keeping clear that is drawn."""

DRAWN_S, CIRCLES_S, AROUND_M = 4.0, 1.0, 65.0
"""Of each track, between two circles, and around the vehicle."""


def keeping_clear(path: Path) -> None:
    """Draw a step of a flight in which one of several that join makes way for another."""
    content = content_of(with_law(CROWDED, "slot"))
    content["rehearsal"] |= {"duration_s": 12.0, "losses": []}
    steps: list[tuple[OwnMotion, WantedMotion, Others, Agility, Clearance]] = []

    def kept(*step: Any, **side: float) -> Clearance:
        clear = keep_clear(*step, **side)
        steps.append((*step, clear))
        return clear

    with patch.object(avoidance, "keep_clear", kept):
        fly(Mission.model_validate(content))
    own, wanted, others, agility, clear = steps[STEP]
    figure = new_figure(6.4, 6.4)
    axes = figure.subplots()
    shown = TIMES <= DRAWN_S

    def tracks_of(manoeuvres: Manoeuvres) -> ComplexArray:
        return own_tracks(own, wanted, manoeuvres, agility)

    def draw(track: ComplexArray, **look: Any) -> None:
        axes.plot((track - own.place).imag, (track - own.place).real, **look)

    possible = tracks_of(manoeuvres_between(agility.speed_min, agility.speed_max))
    nearest = closest_approaches(possible, others).min(axis=2)
    for track, keeps in zip(possible, (nearest >= others.keep).all(axis=1), strict=True):
        draw(track[shown], color="#9bbf85" if keeps else "#dcb0b0", linewidth=0.7)
    for track, until_s, keep in zip(others.tracks, others.horizon_s, others.keep, strict=True):
        looked_at = shown & (until_s >= TIMES)
        draw(track[looked_at], color="#1f5fa8", linewidth=1.4)
        for place in (track - own.place)[looked_at & (TIMES % CIRCLES_S == 0.0)]:
            circle = Circle((place.imag, place.real), keep, fill=False, color="#1f5fa8", alpha=0.3)
            axes.add_patch(circle)
    draw(tracks_of(WANTED)[0][shown], color="#444444", linestyle="--")
    flown = Manoeuvres(turn=np.array([clear.turn]), airspeed=np.array([clear.airspeed]))
    draw(tracks_of(flown)[0][shown], color="#1b5e20", linewidth=2.6)
    heading = cmath.phase(own.air_velocity)
    draw_aircraft(axes, 0.0, 0.0, heading, colour="#1b5e20", size=16.0)
    dress(axes, title="The next 4 s", across="east, m", up="north, m")
    axes.set(xlim=(-AROUND_M, AROUND_M), ylim=(-AROUND_M, AROUND_M), aspect="equal")
    save_figure(figure, path)


if __name__ == "__main__":
    place = Path(sys.argv[1])
    shapes(place / "shapes.png")
    keeping_clear(place / "keeping-clear.png")
