"""How much a vehicle turned of what its bank said on a flight that was flown for another purpose.

No straight legs were flown on purpose, so that an attitude that is off cannot be told from a slip where all
turns went one way: what half a degree of it would do is part of the interval.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.guidance.airframe import GRAVITY
from vfguide.identification.flown import LONGEST_S, evenly, longest_run
from vfguide.identification.slip import (
    LEAST_REPORTS,
    LEAST_TURNS,
    NORMAL_95,
    SLIPS_BELOW,
    Bank,
    Estimate,
    Slip,
    leg_weights,
    legs_of,
    scale_and_lead,
    turning,
)
from vfguide.record.vehicle import VehicleRecord
from vfguide.state import Airframe

LEG_S = 8.0
"""s of a leg: several times as long as a swing of the yaw, and short enough for some in a minute."""

ROLL_ERROR = math.radians(0.5)
"""rad by which attitudes are off, rms, as estimators have it in a turn."""

FLYING_SHARE = 0.8
"""Share of the least airspeed: what is slower stands, rolls or lands."""

Slips = bool | Literal["auto"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipAnswer:
    """Whether one vehicle slips."""

    vehicle: str
    """Name of the vehicle."""
    slip: Slip | None
    """None where nothing can be told."""
    why: str
    """Why nothing can be told; empty where something can."""
    mission: Slips
    """What the mission says."""


def flown_slip(
    time_s: FloatArray,
    vehicle: VehicleRecord,
    guided: BoolArray,
    airframe: Airframe,
    mission: Slips,
) -> SlipAnswer:
    """What a flight tells of a vehicle's turns.

    Args:
        time_s: of the samples, s, evenly apart.
        vehicle: what it did.
        guided: whether setpoints were flown, one for each sample; where none ever was, all of the flight is
            looked at.
        airframe: what the mission says of it.
        mission: what the mission says of its slip.
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
    """The longest stretch in the air of which all is known, cut into legs."""
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
    """Turned over what the bank says, with all that makes it uncertain; None where too little was turned.

    Args:
        reports: of the flight.
        scale: true airspeed over the reported one.
    """
    legs = turning(legs_of(reports, scale.value))
    if len(legs) < LEAST_TURNS:
        return None
    from scipy.special import stdtrit

    by_bank = np.array([leg.by_bank for leg in legs])
    turned = np.array([leg.turned for leg in legs])
    lasts_s = np.array([leg.lasts_s for leg in legs])
    weights = leg_weights(by_bank) ** 2
    whole = float(weights @ by_bank**2)
    share = float(weights @ (by_bank * turned)) / whole
    rest = turned - share * by_bank
    degrees = len(legs) - 1
    scatter = math.sqrt(float(weights @ rest**2) / degrees / whole)
    airspeed = scale.value * float(np.mean([one.airspeed for one in reports]))
    # What was turned to the left and to the right by an attitude that is off cancels.
    one_sided_s = abs(float(weights @ (by_bank * lasts_s))) / whole
    half_width = math.hypot(
        float(stdtrit(degrees, 0.975)) * scatter,
        share * scale.half_width / scale.value,
        share * one_sided_s * NORMAL_95 * ROLL_ERROR * GRAVITY / airspeed,
    )
    return Estimate(value=share, half_width=half_width)


def slip_sentence(answer: SlipAnswer) -> str:
    """What was found, in words."""
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
    """By vehicle, what a mission may be told of it."""
    return {
        one.vehicle: one.slip
        for one in answers
        if one.slip is not None and one.slip.slips is not None
    }
