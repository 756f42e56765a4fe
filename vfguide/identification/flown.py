"""How an autopilot answered on a flight that was flown for another purpose, and how sure that is.

Nobody has stepped courses and speeds: the setpoints of the flight have to do, and where they hardly changed
nothing can be told.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from msgspec import structs

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.guidance.response import HoldResponse
from vfguide.identification.learned import HoldSamples, response_in, turn_limits
from vfguide.identification.profile import response_lines, slip_line
from vfguide.identification.slip import Slip
from vfguide.record.flight import FlightRecord
from vfguide.record.response import VehicleResponse
from vfguide.record.vehicle import VehicleRecord
from vfguide.state import Airframe

LONGEST_S = 240.0
"""s of flight that are looked at: more says little more."""

LEAST_S = 20.0
"""Less says nothing."""

FITTED_HZ = 10.0
"""Samples a second that are looked at: responses take longer than a tenth of a second."""

MODEL_SHARE = 0.15
"""By which a bandwidth is uncertain at least: a steady turn shows only the sum of its inverse and the delay,
and no autopilot is quite of the model's kind. ArduPlane's alpha is 0.72 1/s by long steps and 0.78 to 0.84
by steady turns."""

MOST_DOUBT = 0.6
"""Share of a bandwidth: less certain is reported as no answer."""

LEAST_DOUBT = 0.2
"""Share of a bandwidth: what is more certain counts as known well."""

LEAST_TURN = 0.1
"""rad: courses that were asked for have to change by so much..."""

LEAST_CHANGE = 0.7
"""m/s: ... and speeds by so much, from the greatest to the least, for anything to be told."""

Loop = Literal["course", "speed"]

BANDWIDTHS: dict[Loop, str] = {"course": "alpha_1_s", "speed": "beta_1_s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """How one loop of one vehicle answered."""

    vehicle: str
    """Name of the vehicle."""
    loop: Loop
    """Which."""
    response: HoldResponse | None
    """None where nothing can be told."""
    why: str
    """Why nothing can be told; empty where something can."""
    mission: float
    """Bandwidth in the mission, 1/s."""

    @property
    def good(self) -> bool:
        """Whether it is known well enough to be flown by; without steps that takes more than with them."""
        if self.response is None:
            return False
        return self.response.doubt < LEAST_DOUBT


def flown_responses(
    time_s: FloatArray,
    vehicle: VehicleRecord,
    guided: BoolArray,
    airframe: Airframe,
    setpoints: FloatArray,
) -> tuple[Answer, Answer]:
    """How course and speed of a vehicle answered to their setpoints.

    Args:
        time_s: of the samples, s, evenly apart.
        vehicle: what it did.
        guided: whether setpoints were flown, one for each sample.
        airframe: what the mission says of it.
        setpoints: rows of when each went out (s), course in rad and airspeed in m/s. Those of the samples are
            up to a step later, and half a step of 0.05 s is 4 % of alpha.
    """
    stretch = fitted_stretch(time_s, vehicle, guided)
    return (
        loop_answer("course", time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints),
        loop_answer("speed", time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints),
    )


def fitted_stretch(time_s: FloatArray, vehicle: VehicleRecord, guided: BoolArray) -> slice:
    """The beginning of the longest guided stretch of which everything is known; samples FITTED_HZ apart."""
    known = guided.copy()
    for values in (
        vehicle.heading_rad,
        vehicle.course_rad,
        vehicle.airspeed_m_s,
        vehicle.wind_north_m_s,
        vehicle.wind_east_m_s,
        vehicle.course_setpoint_rad,
        vehicle.airspeed_setpoint_m_s,
    ):
        known &= np.isfinite(values)
    return evenly(time_s, *longest_run(known), LONGEST_S)


def longest_run(known: BoolArray) -> tuple[int, int]:
    """Where the longest run of what is true begins and ends; (0, 0) without any."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], known.astype(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest])


def evenly(time_s: FloatArray, begin: int, end: int, longest_s: float) -> slice:
    """Samples of a run, FITTED_HZ apart, for so long at most (s)."""
    if end <= begin or len(time_s) < 2:
        return slice(0, 0)
    rate = (len(time_s) - 1) / float(time_s[-1] - time_s[0])
    return slice(begin, min(end, begin + round(longest_s * rate)), max(1, round(rate / FITTED_HZ)))


def loop_answer(
    loop: Loop,
    time_s: FloatArray,
    vehicle: VehicleRecord,
    stretch: slice,
    *,
    airframe: Airframe,
    setpoints: FloatArray,
) -> Answer:
    """How one loop answered on a stretch, or why that cannot be told."""
    mission = airframe.alpha if loop == "course" else airframe.beta
    response, why = None, unknown_because(loop, time_s, vehicle, stretch)
    if not why:
        response = with_doubt(
            response_in(
                samples_of(loop, time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints)
            )
        )
        if response is None or response.doubt > MOST_DOUBT:
            response, why = None, "quite other values explain this flight as well"
    return Answer(vehicle=vehicle.name, loop=loop, response=response, why=why, mission=mission)


def with_doubt(found: HoldResponse | None) -> HoldResponse | None:
    """Return a response no surer than a flight without steps can tell."""
    if found is None:
        return None
    return structs.replace(
        found,
        least=min(found.least, (1.0 - MODEL_SHARE) * found.gain),
        greatest=max(found.greatest, (1.0 + MODEL_SHARE) * found.gain),
    )


def unknown_because(loop: Loop, time_s: FloatArray, vehicle: VehicleRecord, stretch: slice) -> str:
    """Why nothing can be told of a loop; empty where something can."""
    lasts_s = float(np.ptp(time_s[stretch])) if len(time_s[stretch]) else 0.0
    if lasts_s == 0.0:
        return "the record holds no setpoints of it with their answers"
    if lasts_s < LEAST_S:
        return f"{lasts_s:.0f} s of setpoints and answers are too short"
    told = vehicle.course_setpoint_rad if loop == "course" else vehicle.airspeed_setpoint_m_s
    asked = told[stretch]
    if loop == "course" and float(np.ptp(np.unwrap(asked))) < LEAST_TURN:
        return "hardly any other course was asked for"
    if loop == "speed" and float(np.ptp(asked)) < LEAST_CHANGE:
        return "hardly any other speed was asked for"
    return ""


def samples_of(
    loop: Loop,
    time_s: FloatArray,
    vehicle: VehicleRecord,
    stretch: slice,
    *,
    airframe: Airframe,
    setpoints: FloatArray,
) -> HoldSamples:
    """What was asked for and what was seen on a stretch."""
    ground = airframe.hold == "course-hold"
    times, course = time_s[stretch], loop == "course"
    speed = (vehicle.ground_speed_m_s if ground else vehicle.airspeed_m_s)[stretch]
    # From the one that holds at the first sample on.
    known = setpoints[np.all(np.isfinite(setpoints), axis=1)]
    first = max(int(np.searchsorted(known[:, 0], times[0], side="right")) - 1, 0)
    asked = known[first : int(np.searchsorted(known[:, 0], times[-1], side="right"))]
    if not course:
        limit = np.full(len(times), airframe.max_acceleration)
        return HoldSamples(
            time_s=times, value=speed, limit=limit, setpoint_s=asked[:, 0], setpoint=asked[:, 2]
        )
    return HoldSamples(
        time_s=times,
        value=vehicle.course_rad[stretch],
        turned=np.unwrap((vehicle.course_rad if ground else vehicle.heading_rad)[stretch]),
        limit=turn_limits(airframe, speed),
        setpoint_s=asked[:, 0],
        setpoint=np.unwrap(asked[:, 1]),
    )


def answer_sentence(answer: Answer) -> str:
    """What was found of one loop, in words."""
    head = f"{answer.vehicle}: {answer.loop}"
    remedy = "fly `vfguide identify` to know it"
    if answer.response is None:
        return f"{head}: cannot be told, {answer.why}; {remedy}"
    known = answer.response
    name = "alpha" if answer.loop == "course" else "beta"
    found = (
        f"{head}: {name} {known.gain:.2f} 1/s, probably within {known.least:.2f} to {known.greatest:.2f},"
        f" {known.late:.2f} s late ({known.earliest:.2f} to {known.latest:.2f})"
    )
    if not answer.good:
        return f"{found}: not known well enough to fly by; {remedy}"
    if known.least <= answer.mission <= known.greatest:
        return f"{found}: known well; the mission's {answer.mission:.2f} fits"
    return f"{found}: known well; the mission says {answer.mission:.2f}"


def with_responses(
    record: FlightRecord, answers: Sequence[Answer], slips: Mapping[str, Slip]
) -> FlightRecord:
    """Return a flight with what it shows of how its vehicles answered.

    Args:
        record: of the flight.
        answers: of all loops of all vehicles.
        slips: by vehicle, of those of whom it is known.
    """
    found: dict[str, dict[str, Any]] = {}
    for one in answers:
        if one.response is not None:
            known = one.response
            found.setdefault(one.vehicle, {}).update(
                {
                    BANDWIDTHS[one.loop]: known.gain,
                    f"{one.loop}_dead_time_s": known.dead_time,
                    f"{one.loop}_lag_s": known.lag,
                    f"{one.loop}_spread": known.spread,
                }
            )
    for name, slip in slips.items():
        turns = {"slips": slip.slips, "turn_efficiency": slip.efficiency.value}
        found.setdefault(name, {}).update(turns)
    return replace(
        record,
        vehicles=tuple(
            replace(one, response=VehicleResponse(**found[one.name])) if one.name in found else one
            for one in record.vehicles
        ),
    )


def flown_profile(answers: Sequence[Answer], slips: Mapping[str, Slip]) -> str:
    """The fields that are known well, as YAML to be put under each vehicle's name in `vehicles`.

    Args:
        answers: of all loops of all vehicles.
        slips: by vehicle, of those of whom it is known.
    """
    lines: list[str] = []
    for name in dict.fromkeys((*(answer.vehicle for answer in answers), *slips)):
        known = [one for one in answers if one.vehicle == name and one.good]
        if known or name in slips:
            lines.append(f"{name}:  # bounds are for 95 %")
        for one in known:
            if one.response is not None:
                lines += response_lines(one.response, BANDWIDTHS[one.loop], one.loop)
        if name in slips:
            lines.append(slip_line(slips[name]))
    return "\n".join(lines)
