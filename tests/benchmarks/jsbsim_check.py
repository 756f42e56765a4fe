"""The equations of the plant `six-dof` against JSBSim's, for the same airframe, surfaces and thrust.

It needs `pip install jsbsim`. JSBSim gets the airframe of `sitl_stub.rigid_body` as an aircraft of its own,
made here, over an earth that does not rotate and hardly curves. Both fly ten seconds of doublets of all
surfaces from the same state.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sitl_stub import rigid_body as craft
from sitl_stub.loops import GRAVITY_M_S2
from sitl_stub.rigid_body import (
    Body,
    Surfaces,
    accelerations,
    air_flow,
    attitude_rates,
    body_to_ground,
)
from tests.benchmarks.results import Cases

FOOT_M = 0.3048
POUND_N = 4.4482216152605
STEP_S = 1.0 / 4000.0
"""Of JSBSim, whose surfaces act a step late: at a quarter of this step both differ by a quarter."""

OUR_STEP_S = 0.0125
"""Of the emulator."""

FLIGHT_S = 10.0
EARTH_M = 6.4e8
"""So large that nothing curves in ten seconds."""

START = (24.0, 0.5, 1.4, 0.05, 0.0, -0.02, 0.2, 0.06, 1.0)
"""u, v, w (m/s), p, q, r (rad/s), bank, pitch, heading (rad)."""

THRUST_N = 8.0
NAMES = ("u", "v", "w", "p", "q", "r", "bank", "pitch", "heading")
"""States, m/s, rad/s and rad."""

STATES = (
    *((f"velocities/{axis}-fps", FOOT_M) for axis in "uvw"),
    *((f"velocities/{axis}-rad_sec", 1.0) for axis in "pqr"),
    *((f"attitude/{angle}-rad", 1.0) for angle in ("phi", "theta", "psi")),
)
"""JSBSim's names of what `NAMES` are, and its units."""


def surfaces_at(time_s: float) -> Surfaces:
    """Doublets, round ones, of one surface after the other, and of all together."""

    def doublet(began_s: float, size: float) -> float:
        elapsed = time_s - began_s
        return size * math.sin(2.0 * math.pi * elapsed) if 0.0 <= elapsed < 1.0 else 0.0

    return Surfaces(
        aileron=doublet(0.5, 0.1) + doublet(6.5, 0.05),
        elevator=-0.02 + doublet(2.5, 0.06) + doublet(6.5, 0.04),
        rudder=doublet(4.5, 0.1) + doublet(6.5, -0.05),
    )


def terms(*parts: object) -> str:
    """A product of numbers, properties and finished functions; a number alone as it is."""
    written = "".join(
        part
        if isinstance(part, str) and part.startswith("<")
        else f"<property>{part}</property>"
        if isinstance(part, str)
        else f"<value>{part!r}</value>"
        for part in parts
    )
    return written if len(parts) == 1 else f"<product>{written}</product>"


def total(*parts: str) -> str:
    """A sum of finished functions."""
    return f"<sum>{''.join(parts)}</sum>"


ALPHA, BETA, SPEED = "aero/alpha-rad", "aero/beta-rad", "velocities/vt-fps"
P, Q, R = "velocities/p-aero-rad_sec", "velocities/q-aero-rad_sec", "velocities/r-aero-rad_sec"
AILERON, ELEVATOR, RUDDER = "check/aileron", "check/elevator", "check/rudder"


def aerodynamics() -> str:
    """Forces and moments by the coefficients. Lift is linear: the doublets stay clear of the stall."""
    pressure = 0.5 * craft.AIR_KG_M3 * craft.WING_M2 * FOOT_M**2 / POUND_N
    half_chord, half_span = craft.CHORD_M / 2.0 / FOOT_M, craft.SPAN_M / 2.0 / FOOT_M
    by_speed = f"<quotient><value>1</value><property>{SPEED}</property></quotient>"
    wing = total(terms(craft.LIFT_0), terms(craft.LIFT_ALPHA, ALPHA))
    lift = total(
        wing, terms(craft.LIFT_Q, half_chord, Q, by_speed), terms(craft.LIFT_ELEVATOR, ELEVATOR)
    )
    drag = total(
        terms(craft.DRAG_PARASITIC),
        terms(craft.INDUCED, wing, wing),
        terms(craft.DRAG_ELEVATOR, f"<abs><property>{ELEVATOR}</property></abs>"),
    )
    side = total(
        terms(craft.SIDE_BETA, BETA),
        terms(craft.SIDE_AILERON, AILERON),
        terms(craft.SIDE_RUDDER, RUDDER),
    )
    sine, cosine = (f"<{name}><property>{ALPHA}</property></{name}>" for name in ("sin", "cos"))
    forward = total(terms(lift, sine), terms(-1.0, drag, cosine))
    downward = total(terms(-1.0, lift, cosine), terms(-1.0, drag, sine))
    span_ft, chord_ft = craft.SPAN_M / FOOT_M, craft.CHORD_M / FOOT_M
    rolling, yawing = (
        total(
            terms(getattr(craft, f"{name}_BETA"), BETA),
            terms(getattr(craft, f"{name}_P"), half_span, P, by_speed),
            terms(getattr(craft, f"{name}_R"), half_span, R, by_speed),
            terms(getattr(craft, f"{name}_AILERON"), AILERON),
            terms(getattr(craft, f"{name}_RUDDER"), RUDDER),
        )
        for name in ("ROLL", "YAW")
    )
    pitching = total(
        terms(craft.PITCH_0),
        terms(craft.PITCH_ALPHA, ALPHA),
        terms(craft.PITCH_Q, half_chord, Q, by_speed),
        terms(craft.PITCH_ELEVATOR, ELEVATOR),
    )

    def axis(name: str, arm: float, content: str) -> str:
        function = f'<function name="check/{name}">{terms(pressure * arm, SPEED, SPEED, content)}</function>'
        return f'<axis name="{name}">{function}</axis>'

    forces = (("X", 1.0, forward), ("Y", 1.0, side), ("Z", 1.0, downward))
    moments = (("ROLL", span_ft, rolling), ("PITCH", chord_ft, pitching), ("YAW", span_ft, yawing))
    return "".join(axis(*one) for one in (*forces, *moments))


def aircraft() -> str:
    """The airframe as JSBSim reads it."""
    origin = "<x>0</x><y>0</y><z>0</z>"
    locations = "".join(
        f'<location name="{name}" unit="M">{origin}</location>'
        for name in ("AERORP", "EYEPOINT", "VRP")
    )
    properties = "".join(
        f'<property value="0">{name}</property>' for name in (AILERON, ELEVATOR, RUDDER)
    )
    return (
        '<?xml version="1.0"?><fdm_config name="check" version="2.0" release="ALPHA">'
        f'<metrics><wingarea unit="M2">{craft.WING_M2}</wingarea><wingspan unit="M">{craft.SPAN_M}</wingspan>'
        f'<chord unit="M">{craft.CHORD_M}</chord>{locations}</metrics>'
        '<mass_balance negated_crossproduct_inertia="false">'
        f'<ixx unit="KG*M2">{craft.JX}</ixx><iyy unit="KG*M2">{craft.JY}</iyy>'
        f'<izz unit="KG*M2">{craft.JZ}</izz><ixz unit="KG*M2">{craft.JXZ}</ixz>'
        f'<emptywt unit="KG">{craft.MASS_KG}</emptywt><location name="CG" unit="M">{origin}</location>'
        "</mass_balance><ground_reactions/>"
        '<external_reactions><force name="thrust" frame="BODY">'
        f'<location unit="M">{origin}</location><direction><x>1</x><y>0</y><z>0</z></direction></force>'
        f'</external_reactions><propulsion/><flight_control name="check">{properties}</flight_control>'
        f"<aerodynamics>{aerodynamics()}</aerodynamics></fdm_config>"
    )


def planet() -> str:
    """An earth without rotation, whose gravity is the emulator's."""
    axes = "".join(
        f'<{name} unit="M">{EARTH_M}</{name}>' for name in ("semimajor_axis", "semiminor_axis")
    )
    return (
        f'<?xml version="1.0"?><planet name="still">{axes}'
        '<rotation_rate unit="RAD/SEC">0.0</rotation_rate>'
        f'<GM unit="M3/SEC2">{GRAVITY_M_S2 * EARTH_M**2}</GM><J2>0.0</J2></planet>'
    )


def by_jsbsim(times_s: Sequence[float]) -> list[tuple[float, ...]]:
    """States at these times."""
    try:
        import jsbsim
    except ImportError:
        sys.exit("jsbsim is not installed: pip install jsbsim")
    with TemporaryDirectory() as place:
        home = Path(place, "aircraft", "check")
        home.mkdir(parents=True)
        (home / "check.xml").write_text(aircraft())
        (home / "planet.xml").write_text(planet())
        jsbsim.FGJSBBase().debug_lvl = 0
        flight: Any = jsbsim.FGFDMExec(place)
        flight.set_debug_level(0)
        flight.load_planet(str(home / "planet.xml"), useAircraftPath=False)
        flight.load_model("check")
    flight.set_property_value("simulation/gravity-model", 0)
    flight.set_dt(STEP_S)
    flight["ic/h-sl-ft"] = 1000.0
    begins = ("u-fps", "v-fps", "w-fps", "p-rad_sec", "q-rad_sec", "r-rad_sec")
    begins += ("phi-rad", "theta-rad", "psi-true-rad")
    for name, value, (_, scale) in zip(begins, START, STATES, strict=True):
        flight[f"ic/{name}"] = value / scale
    flight["external_reactions/thrust/magnitude"] = THRUST_N / POUND_N
    flight.run_ic()
    found = []
    for time_s in times_s:
        while flight.get_sim_time() < time_s - STEP_S / 2.0:
            surfaces = surfaces_at(flight.get_sim_time())
            for name, value in zip((AILERON, ELEVATOR, RUDDER), surfaces, strict=True):
                flight[name] = value
            flight.run()
        found.append(tuple(flight[name] * scale for name, scale in STATES))
    return found


def by_us(times_s: Sequence[float]) -> list[tuple[float, ...]]:
    """The same by the emulator's equations, with its step and its midpoint rule."""
    body = Body(*START, THRUST_N, 24.0, 0.0, 0.0)

    def rates(at: Body, time_s: float) -> Body:
        flow = air_flow(at, body_to_ground(at), (0.0, 0.0))
        acceleration = accelerations(at, flow, surfaces_at(time_s))
        return Body(*acceleration, *attitude_rates(at), 0.0, 0.0, 0.0, 0.0)

    def moved(at: Body, by: Body, span_s: float) -> Body:
        return Body(*(value + span_s * rate for value, rate in zip(at, by, strict=True)))

    found, now = [], 0.0
    for time_s in times_s:
        while now < time_s - OUR_STEP_S / 2.0:
            middle = moved(body, rates(body, now), OUR_STEP_S / 2.0)
            body = moved(body, rates(middle, now + OUR_STEP_S / 2.0), OUR_STEP_S)
            now += OUR_STEP_S
        found.append(tuple(body[: len(NAMES)]))
    return found


def cases() -> Cases:
    """Fly both, and tell by how much they part."""
    times_s = [0.1 * step for step in range(round(FLIGHT_S / 0.1) + 1)]
    theirs, ours = by_jsbsim(times_s), by_us(times_s)
    for first, unit in enumerate(("velocities, m/s", "rates, rad/s", "angles, rad")):
        parted = [
            difference(a[index], b[index], NAMES[index])
            for a, b in zip(theirs, ours, strict=True)
            for index in range(3 * first, 3 * first + 3)
        ]
        yield unit, {"apart": max(parted)}


def difference(one: float, other: float, name: str) -> float:
    """How far two values are apart; angles round the circle."""
    off = one - other
    return abs(math.remainder(off, 2.0 * math.pi) if name in {"bank", "pitch", "heading"} else off)
