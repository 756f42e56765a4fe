"""Response of an autopilot from a flight for another purpose, with its uncertainty.

Such a flight has no deliberate steps of course and speed, so its own setpoints have to suffice. Nothing can
be identified where they hardly changed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from msgspec import structs

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.response import HoldResponse
from vfguide.identification.recording import Findings, HoldSamples, response_in, turn_limits
from vfguide.identification.slip import (
    LEAST_REPORTS,
    NORMAL_95,
    SLIPS_BELOW,
    Bank,
    Estimate,
    Slip,
    leg_weights,
    legs_of,
    scale_and_lead,
    turn_efficiency,
    turning,
)
from vfguide.record.flight import FlightRecord
from vfguide.record.response import VehicleResponse
from vfguide.record.vehicle import VehicleRecord
from vfguide.state import Airframe

Loop = Literal["course", "speed"]

BANDWIDTHS: dict[Loop, str] = {"course": "alpha_1_s", "speed": "beta_1_s"}

# Findings as lines for the mission file.


def profile_text(vehicle: str, findings: Findings) -> str:
    """Return the measured fields of a vehicle as YAML, to be put under its name in `vehicles`."""
    known: dict[Loop, HoldResponse | None] = {"course": findings.course, "speed": findings.speed}
    lines = [
        f"# {vehicle}, as `vfguide identify` has measured it, in bounds of 95 %.",
        f"{vehicle}:",
        *(line for loop, found in known.items() if found for line in response_lines(found, loop)),
        slip_line(findings.slip),
    ]
    return "\n".join(lines) + "\n"


def slip_line(slip: Slip | None) -> str:
    """Return the `slips` field with its uncertainty; a comment if slip is unknown."""
    if slip is None:
        return "  # slips is not known, for want of banks or of turns: leave what the mission says"
    found, lead = slip.efficiency, slip.lead
    words = (
        f"it turns {found.value:.3f} +- {found.half_width:.3f} of what its bank says, its nose leads by"
        f" {lead.value:.2f} +- {lead.half_width:.2f} s times the turn rate"
    )
    if slip.slips is None:
        return (
            f"  # slips is open: {words}; leave what the mission says, or fly again in calmer air"
        )
    return f"  slips: {str(slip.slips).lower()} # {words}"


def response_lines(found: HoldResponse, loop: Loop) -> list[str]:
    """Return the three fields of a response, with their bounds."""
    return [
        f"  {BANDWIDTHS[loop]}: {found.gain:.3f} # {found.least:.2f} to {found.greatest:.2f}",
        f"  {loop}_dead_time_s: {found.dead_time:.3f}",
        f"  {loop}_lag_s: {found.lag:.3f} # together {found.earliest:.2f} to {found.latest:.2f}",
    ]


LONGEST_S = 240.0
"""Maximum length of the fitted stretch, s; more adds little information."""

LEAST_S = 20.0
"""Minimum length of the fitted stretch, s; less has no information."""

FITTED_HZ = 10.0
"""Fitted samples per second: responses take longer than a tenth of a second."""

MODEL_SHARE = 0.15
"""Minimum relative uncertainty of a bandwidth. A steady turn shows only the sum of its inverse and the
delay, and no autopilot matches the model exactly. ArduPlane's alpha is 0.72 1/s by long steps and 0.78 to
0.84 by steady turns."""

MOST_DOUBT = 0.6
"""Relative uncertainty of a bandwidth above which no response is reported."""

LEAST_DOUBT = 0.2
"""Relative uncertainty of a bandwidth below which it counts as known well."""

LEAST_TURN = 0.1
"""Minimum range of course setpoints for an identification, rad."""

LEAST_CHANGE = 0.7
"""Minimum range of speed setpoints for an identification, m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Identified response of one loop of one vehicle."""

    vehicle: str
    loop: Loop
    response: HoldResponse | None
    """Response, None if unknown."""
    why: str
    """Why the response is unknown; empty if it is known."""
    mission: float
    """Bandwidth in the mission, 1/s."""

    @property
    def good(self) -> bool:
        """Whether the response is known well enough for flight; stricter than after deliberate steps."""
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
    """Return the course and speed responses of a vehicle to its setpoints.

    Args:
        time_s: sample times, s, evenly spaced.
        vehicle: record of the vehicle.
        guided: whether setpoints were flown, for each sample.
        airframe: airframe in the mission.
        setpoints: rows of time sent (s), course (rad) and airspeed (m/s). The setpoints in the samples are up
            to a step later, and half a step of 0.05 s is 4 % of alpha.
    """
    stretch = fitted_stretch(time_s, vehicle, guided)
    return (
        loop_answer("course", time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints),
        loop_answer("speed", time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints),
    )


def fitted_stretch(time_s: FloatArray, vehicle: VehicleRecord, guided: BoolArray) -> slice:
    """Return the beginning of the longest guided stretch with complete data; samples FITTED_HZ apart."""
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
    """Return (begin, end) of the longest run of true values; (0, 0) without any."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], known.astype(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest])


def evenly(time_s: FloatArray, begin: int, end: int, longest_s: float) -> slice:
    """Return a slice of a run with samples FITTED_HZ apart, limited to `longest_s` (s)."""
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
    """Return the response of one loop on a stretch, or why it is unknown."""
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
    """Widen a response's bounds to the minimum uncertainty of a flight without steps."""
    if found is None:
        return None
    return structs.replace(
        found,
        least=min(found.least, (1.0 - MODEL_SHARE) * found.gain),
        greatest=max(found.greatest, (1.0 + MODEL_SHARE) * found.gain),
    )


def unknown_because(loop: Loop, time_s: FloatArray, vehicle: VehicleRecord, stretch: slice) -> str:
    """Return why a loop cannot be identified; empty if it can."""
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
    """Return the setpoints and measurements of a stretch."""
    ground = airframe.hold == "course-hold"
    times, course = time_s[stretch], loop == "course"
    speed = (vehicle.ground_speed_m_s if ground else vehicle.airspeed_m_s)[stretch]
    # Begin with the setpoint that is active at the first sample.
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
    """Describe the finding about one loop."""
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
    """Return a flight record with the identified responses and known slips of its vehicles."""
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
    """Return the well-known fields as YAML, to be put under each vehicle's name in `vehicles`."""
    lines: list[str] = []
    for name in dict.fromkeys((*(answer.vehicle for answer in answers), *slips)):
        known = [one for one in answers if one.vehicle == name and one.good]
        if known or name in slips:
            lines.append(f"{name}:  # bounds are for 95 %")
        for one in known:
            if one.response is not None:
                lines += response_lines(one.response, one.loop)
        if name in slips:
            lines.append(slip_line(slips[name]))
    return "\n".join(lines)


# Turn efficiency of a vehicle, from a flight for another purpose.
#
# Without deliberate straight legs, an attitude error cannot be told from slip if all turns went one way. The
# interval therefore includes the effect of half a degree.

LEG_S = 8.0
"""Length of a leg, s: several yaw oscillations, but short enough for some legs in a minute."""

ROLL_ERROR = math.radians(0.5)
"""Attitude error, rms, as estimators have it in a turn, rad."""

FLYING_SHARE = 0.8
"""Share of the minimum airspeed below which a vehicle stands, rolls or lands."""

Slips = bool | Literal["auto"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipAnswer:
    """Identified slip of one vehicle."""

    vehicle: str
    slip: Slip | None
    """Slip, None if unknown."""
    why: str
    """Why the slip is unknown; empty if it is known."""
    mission: Slips
    """Slip in the mission."""


def flown_slip(
    time_s: FloatArray,
    vehicle: VehicleRecord,
    guided: BoolArray,
    airframe: Airframe,
    mission: Slips,
) -> SlipAnswer:
    """Return the slip of a vehicle in its turns while guided, or in the whole flight if it never was.

    The sample times (s) are evenly spaced.
    """
    reports = reports_of(time_s, vehicle, guided, airframe)
    slip, why = None, ""
    if len(reports) < LEAST_REPORTS:
        why = "the record holds too little of its bank, airspeed, heading and velocity"
    else:
        scale, lead = scale_and_lead(reports)
        found = turned_share(reports, scale)
        if found is None:
            why = "it hardly turned"
        else:
            slip = Slip(efficiency=found, lead=lead)
    return SlipAnswer(vehicle=vehicle.name, slip=slip, why=why, mission=mission)


def reports_of(
    time_s: FloatArray, vehicle: VehicleRecord, guided: BoolArray, airframe: Airframe
) -> list[Bank]:
    """Return the longest stretch in the air with complete data, cut into legs."""
    known = vehicle.airspeed_m_s >= FLYING_SHARE * airframe.airspeed_min
    if guided.any():
        known &= guided
    for values in (
        vehicle.heading_rad,
        vehicle.bank_rad,
        vehicle.ground_speed_m_s,
        vehicle.course_rad,
    ):
        known &= np.isfinite(values)
    chosen = evenly(time_s, *longest_run(known), LONGEST_S)
    times = time_s[chosen]
    course, ground_speed = vehicle.course_rad[chosen], vehicle.ground_speed_m_s[chosen]
    rows = zip(
        times.tolist(),
        ((times - times[0]) // LEG_S).astype(int).tolist() if len(times) else (),
        vehicle.heading_rad[chosen].tolist(),
        vehicle.bank_rad[chosen].tolist(),
        vehicle.airspeed_m_s[chosen].tolist(),
        (ground_speed * np.cos(course)).tolist(),
        (ground_speed * np.sin(course)).tolist(),
        strict=True,
    )
    return [
        Bank(
            time_s=when,
            leg=leg,
            heading=heading,
            bank=bank,
            airspeed=airspeed,
            velocity_north=north,
            velocity_east=east,
        )
        for when, leg, heading, bank, airspeed, north, east in rows
    ]


def turned_share(reports: list[Bank], scale: Estimate) -> Estimate | None:
    """Return the turn efficiency with its full uncertainty; None with too few turns.

    `scale` is the ratio of true to reported airspeed.
    """
    legs = turning(legs_of(reports, scale.value))
    found = turn_efficiency(legs, has_straight=False)
    if found is None:
        return None
    by_bank = np.array([leg.by_bank for leg in legs])
    lasts_s = np.array([leg.lasts_s for leg in legs])
    weighted = leg_weights(by_bank) ** 2 * by_bank
    airspeed = scale.value * float(np.mean([one.airspeed for one in reports]))
    # The effect of an attitude error cancels between left and right turns.
    one_sided_s = abs(float(weighted @ lasts_s)) / float(weighted @ by_bank)
    half_width = math.hypot(
        found.half_width,
        found.value * scale.half_width / scale.value,
        found.value * one_sided_s * NORMAL_95 * ROLL_ERROR * GRAVITY / airspeed,
    )
    return replace(found, half_width=half_width)


def slip_sentence(answer: SlipAnswer) -> str:
    """Describe the finding about slip."""
    head, remedy = f"{answer.vehicle}: slip", "fly `vfguide identify` to know it"
    if answer.slip is None:
        return f"{head}: cannot be told, {answer.why}; {remedy}"
    found, slips = answer.slip.efficiency, answer.slip.slips
    low, high = max(found.value - found.half_width, 0.0), found.value + found.half_width
    words = (
        f"{head}: it turns {found.value:.2f} of what its bank says, probably within"
        f" {low:.2f} to {high:.2f}"
    )
    if slips is None:
        return f"{words}: open, since below {SLIPS_BELOW:g} it slips; {remedy}"
    verdict = "it slips" if slips else "it does not slip"
    said = str(answer.mission).lower()
    fits = answer.mission in {slips, "auto"}
    return f"{words}: {verdict}; the mission's slips: {said} {'fits' if fits else 'does not fit'}"


def known_slips(answers: Sequence[SlipAnswer]) -> dict[str, Slip]:
    """Return the known slips by vehicle."""
    return {
        one.vehicle: one.slip
        for one in answers
        if one.slip is not None and one.slip.slips is not None
    }
