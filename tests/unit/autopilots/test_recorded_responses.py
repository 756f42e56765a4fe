"""The emulator follows setpoints as the real autopilots did that were sent the same ones."""

from collections.abc import Mapping
from dataclasses import replace

import pytest

from tests.autopilots.responses import emulated, exceeded, recorded_slices

SLICES = recorded_slices()

QUICK = ("arduplane-turns-left", "arduplane-factory-circles", "px4-joins", "px4-factory-follows")
"""Slices that others than the recorded autopilots are tried on."""

OTHERS: Mapping[str, Mapping[str, Mapping[str, object]]] = {
    "arduplane": {
        "twice the bank for an error": {"guided_p": 24_000},
        "half the bank": {"guided_p": 2_500},
        "no slip": {"turn_efficiency": 1.0},
        "a first-order course": {"plant": "heading-hold"},
    },
    "px4": {
        "half the gain": {"alpha_1_s": 0.44},
        "0.5 s of dead time": {"course_dead_time_s": 0.56},
        "ArduPlane's course": {"plant": "bank", "guided_p": 5_000},
    },
}
"""Autopilots that are not the recorded ones."""


@pytest.mark.parametrize("name", SLICES)
def test_the_emulator_follows_as_the_real_autopilot_did(name):
    assert exceeded(SLICES[name], emulated(SLICES[name])) == {}


@pytest.mark.parametrize("name", QUICK)
def test_mirrored_courses_are_told_apart(name):
    assert "course_deg" in exceeded(SLICES[name], emulated(SLICES[name], mirrored=True))


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        pytest.param(name, changes, id=f"{name}, {what}")
        for name in QUICK
        for autopilot, others in OTHERS.items()
        for what, changes in others.items()
        if name.startswith(autopilot)
    ],
)
def test_other_autopilots_are_told_apart(name, changes):
    assert exceeded(SLICES[name], emulated(SLICES[name], **changes)) != {}


@pytest.mark.parametrize("name", QUICK)
def test_a_bank_of_the_other_sign_is_told_apart(name):
    flown = emulated(SLICES[name])
    turned = replace(flown, bank_deg=flown.bank_deg * (1.0, -1.0))
    assert "bank_deg" in exceeded(SLICES[name], turned)


@pytest.mark.parametrize("name", ["arduplane-joins", "px4-joins"])
def test_speeds_of_half_the_change_are_told_apart(name):
    recorded = SLICES[name]
    halved = recorded.airspeeds_m_s.copy()
    halved[:, 1] = 0.5 * (halved[:, 1] + halved[-1, 1])
    assert "airspeed_m_s" in exceeded(recorded, emulated(replace(recorded, airspeeds_m_s=halved)))
