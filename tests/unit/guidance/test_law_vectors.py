"""A view and an action as vectors: every entry by hand, and what actions ask for."""

import math
from typing import Any

import numpy as np

from tests.kit.states import NORTHBOUND, vehicle_at
from vfguide.guidance.formation import Slot, formation_error, slot_motion
from vfguide.laws import OBSERVATION, View, motion_of, observed
from vfguide.state import Airframe

AIRFRAME = Airframe(max_bank=math.atan(2.0), max_acceleration=3.0)
"""Turns at 2 g / V."""


def view_of(**own: Any) -> View:
    """What a follower sees whose slot is at its leader's place."""
    slot, state = Slot(forward=0.0, right=0.0), vehicle_at(**own)
    motion = slot_motion(NORTHBOUND, slot)
    seen = {"state": state, "leader": NORTHBOUND, "slot": slot, "motion": motion}
    error = formation_error(motion, state)
    return View(**seen, error=error, airframe=AIRFRAME, period=0.1, held=False)


def test_an_observation_stays_within_its_bounds():
    seen = observed(view_of(north=-1e6, east=1e6, ground_speed=500.0))
    assert seen.dtype == np.float32
    assert seen.shape == (14,)
    assert all(one.low <= value <= one.high for one, value in zip(OBSERVATION, seen, strict=True))
    assert seen[:2].tolist() == [2000.0, -2000.0]


def test_an_action_that_is_too_great_or_no_number_asks_for_nothing_impossible():
    view = view_of()
    assert motion_of(view, (7.0, -7.0)) == motion_of(view, (1.0, -1.0))
    assert motion_of(view, (math.nan, math.inf)) == motion_of(view, (0.0, 1.0))
