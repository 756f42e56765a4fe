"""Make the pictures of the pages of the laws, belief, trust, orders and keeping clear anew.

python -m tests.benchmarks.pictures docs/images
"""

import cmath
import math
import sys
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from matplotlib.patches import Circle

from tests.benchmarks.impossible_reports import AT_S, stuck
from tests.kit.companion import leader_bytes
from tests.kit.flight import fly
from tests.kit.formation import Formation
from tests.kit.missions import content_of, shipped
from vfguide.companion import avoidance
from vfguide.companion.mission_plan import local_frame
from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.guidance.formation import FormationError, SlotMotion
from vfguide.guidance.path import desired_course
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
from vfguide.lab.rehearsal.aircraft import emulator_of
from vfguide.lab.report.colours import colours_of
from vfguide.lab.report.style import dress, new_figure, save_figure
from vfguide.lab.report.tracks_plot import draw_aircraft
from vfguide.laws.field import SlotGains, field_motion
from vfguide.link.codec import ENVELOPE
from vfguide.mavlink.reports import PositionReport
from vfguide.mission import Mission
from vfguide.mission.order_plan import timetable
from vfguide.paths.circle import Circle as CirclePath
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


RADIUS_M, SPEED_M_S = 60.0, 20.0
"""Of the path that is drawn, and of the slot."""

ARROWS: dict[str, Any] = {"angles": "xy", "pivot": "mid", "color": "#555555", "width": 0.004}


def fields(path: Path) -> None:
    """Draw the courses of a leader's field around its path, and a follower's motion around its slot."""
    around, beside = (figure := new_figure(10.0, 5.2)).subplots(1, 2)
    around.add_patch(Circle((0.0, 0.0), RADIUS_M, fill=False, color="#1f5fa8", linewidth=2.0))
    course = CirclePath(north=0.0, east=0.0, radius=RADIUS_M, direction=1)
    places = np.array(list(product(np.linspace(-110.0, 110.0, 15), repeat=2)))
    toward = np.array(
        [
            cmath.rect(1.0, desired_course(course.nearest(north, east), 0.05, math.pi / 2.0))
            for north, east in places
        ]
    )
    around.quiver(places[:, 1], places[:, 0], toward.imag, toward.real, **ARROWS, scale=22.0)
    dress(around, title="A leader's courses to its path", across="east, m", up="north, m")
    slot = SlotMotion(
        north=0.0, east=0.0, course=0.0, speed=SPEED_M_S, turn_rate=0.0, acceleration=0.0
    )
    places = np.array(list(product(np.linspace(-42.0, 42.0, 13), repeat=2)))
    moves = []
    for ahead, right in places:
        error = FormationError(
            along_track=-ahead, cross_track=-right, along_track_rate=0.0, cross_track_rate=0.0
        )
        wanted = field_motion(slot, error, SlotGains(k_x=0.1, k_y=0.1))
        moves.append(cmath.rect(wanted.speed, wanted.course) - SPEED_M_S)
    flown = np.array(moves)
    beside.quiver(places[:, 1], places[:, 0], flown.imag, flown.real, **ARROWS, scale=260.0)
    draw_aircraft(beside, 0.0, 0.0, 0.0, colour="#1f5fa8", size=16.0)
    title = "A follower's velocity relative to its slot"
    dress(beside, title=title, across="right of the slot, m", up="ahead of the slot, m")
    for axes in (around, beside):
        axes.set_aspect("equal")
    save_figure(figure, path)


STUCK_S = 5.0
"""For so long f1's autopilot repeats its position and velocity."""


def belief(path: Path) -> None:
    """Draw how far off f1's reports are while they repeat, and what its companion believes meanwhile."""
    mission, name = shipped("circle-wind"), "f1"
    formation = Formation(mission)
    faults = stuck("place and velocity", STUCK_S)
    formation.emulators[name].autopilot = emulator_of(mission, name, faults)
    own = formation.aircraft[name].companion._vehicle.own  # noqa: SLF001
    frame = local_frame(mission)
    rows: list[tuple[float, complex, complex, float]] = []
    take = OwnVehicle.take

    def taken(one: OwnVehicle, report: PositionReport, now: float) -> NavigatedState | None:
        navigated = take(one, report, now)
        if one is own and navigated is not None:
            said = frame.to_local(report.latitude_deg, report.longitude_deg)
            flown = complex(navigated.state.north, navigated.state.east)
            rows.append((now, complex(*said), flown, one.belief.radius))
        return navigated

    with patch.object(OwnVehicle, "take", taken):
        flight = formation.fly(AT_S + 2.0 * STUCK_S)
    time_s, *places, radius = map(np.array, zip(*rows, strict=True))
    flown = flight.vehicle(name)
    true = np.interp(time_s, flight.record.time_s, flown.north_m + 1j * flown.east_m)
    reported, believed = (np.abs(place - true) for place in places)
    axes = (figure := new_figure(8.0, 3.6)).subplots()
    axes.fill_between(time_s, radius, color="#1f5fa8", alpha=0.15, label="95 % radius")
    axes.plot(time_s, reported, color="#b0413e", label="reported")
    axes.plot(time_s, believed, color="#1f5fa8", label="believed")
    axes.set(xlim=(AT_S - 2.0, AT_S + 2.0 * STUCK_S), ylim=(0.0, 30.0))
    dress(axes, title="Position and velocity repeat for 5 s", across="time, s", up="off, m")
    axes.legend()
    save_figure(figure, path)


ENVELOPE_PARTS = (
    ("mark, scheme, kind, length", 8, "rejects other traffic"),
    ("formation", 8, "rejects other formations"),
    ("session", 8, "rejects an older run of its program"),
    ("the leader's session", 8, "rejects recordings of other flights"),
    ("sequence", 4, "rejects repeats"),
    ("time", 8, "rejects what is old"),
    ("sender", 2, "finds the key in the roster"),
)
"""Fields before a state's body, their bytes for a sender of two letters, and the use of each."""


def envelope(path: Path) -> None:
    """Draw what the bytes of f1's signed state are for."""
    body = len(leader_bytes(0.0))
    parts = [*ENVELOPE_PARTS, ("state", body, "belief judges it"), ("signature", 64, "covers all")]
    assert sum(size for _, size, _ in ENVELOPE_PARTS) == ENVELOPE.size + len("f1")
    axes = (figure := new_figure(8.0, 3.6)).subplots()
    begins = np.cumsum([0, *(size for _, size, _ in parts)])
    for row, (begin, (name, size, use)) in enumerate(zip(begins, parts, strict=False)):
        axes.barh(-row, size, left=begin, color="#1f5fa8" if name == "signature" else "#9db8d9")
        beyond = begin + size if begin < begins[-1] / 2 else begin
        side = "left" if beyond != begin else "right"
        axes.text(beyond, -row, f"  {name}, {size}: {use}  ", va="center", ha=side)
    axes.set_yticks([])
    axes.set(xlim=(0, begins[-1]))
    dress(axes, title="A signed state of f1", across="byte", up="")
    save_figure(figure, path)


if __name__ == "__main__":
    place = Path(sys.argv[1])
    fields(place / "fields.png")
    belief(place / "belief.png")
    envelope(place / "envelope.png")
    shapes(place / "shapes.png")
    keeping_clear(place / "keeping-clear.png")
