"""How precise a formation will be: flown for a minute, from its slots, in all that the mission declares."""

import os
from collections.abc import Callable

from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.metrics import summarise
from vfguide.mission.finding import Finding
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import FollowerStart, LeaderStart, Start
from vfguide.mission.starts import path_beginning

FLOWN_S = 60.0
"""Its second half counts, as of every flight: time enough for the leader to come onto its path."""


def expected_precision(
    mission: Mission, stop: Callable[[], bool] = lambda: False
) -> Finding | None:
    """What formation error to expect of a mission, against what it asks for; None where it was stopped.

    Args:
        mission: with a follower at least, and without an error that `check_mission` finds.
        stop: asked before each step whether to end here.

    Raises:
        VfguideError: a library of its law is not installed, or a process died.
    """
    flight = fly_rehearsal(from_the_slots(mission), processes=os.cpu_count() or 1, stop=stop)
    if flight.interrupted:
        return None
    formation = summarise(flight.record).formation
    error, asked = formation.mean_error_m, mission.acceptance.mean_error_m
    if error is None or formation.p95_error_m is None:
        message = "the rehearsal of a minute measured no formation error"
        return Finding("warning", ("followers",), message, "see why: vfguide fly")
    message = (
        f"expect {error:.2f} m of mean formation error, 95 % of the time below"
        f" {formation.p95_error_m:.2f} m: flown for {FLOWN_S:.0f} s in {conditions_in_words(mission)};"
        " an aircraft that answers otherwise adds to it"
    )
    if asked is not None and error > asked:
        message += f"; acceptance.mean_error_m is {asked:g}"
        remedy = "see where it comes from: vfguide fly"
        return Finding("warning", ("acceptance", "mean_error_m"), message, remedy)
    return Finding("note", ("followers",), message)


def from_the_slots(mission: Mission) -> Mission:
    """A mission of a minute in which everybody begins in place."""
    begin = path_beginning(mission.path)
    places: dict[str, object] = {name: FollowerStart() for name in mission.followers_by_name}
    places["leader"] = LeaderStart(
        north_m=begin.north_m, east_m=begin.east_m, course_deg=begin.course_deg
    )
    start = Start.model_validate(places)
    rehearsal = mission.rehearsal.model_copy(update={"duration_s": FLOWN_S, "start": start})
    return mission.model_copy(update={"rehearsal": rehearsal})


def conditions_in_words(mission: Mission) -> str:
    """What the rehearsal of a mission holds."""
    rehearsal, wind = mission.rehearsal, mission.wind
    words = ["calm air" if wind.type == "calm" else f"{wind.type} wind"]
    words += [f"{wind.turbulence} turbulence"] * (wind.turbulence != "none")
    words += ["gusts"] * bool(wind.gusts)
    words.append(f"{rehearsal.sensors} sensors")
    noise = rehearsal.position_noise_m
    words += [f"{noise:g} m of position noise"] * (noise > 0.0)
    radio = rehearsal.radio
    if radio is None:
        words.append(f"leader states {rehearsal.link_delay_s:g} s old")
        words += [f"{rehearsal.link_loss:.0%} of them lost"] * (rehearsal.link_loss > 0.0)
    else:
        words.append(f"a radio with {radio.leader_hz:g} leader states a second")
        words += [f"{radio.loss:.0%} of its packets lost"] * (radio.loss > 0.0)
    return f"{', '.join(words)}, with vehicles as declared"
