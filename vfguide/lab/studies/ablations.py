"""Each part of the laws switched off alone, on the four missions."""

from typing import Any

from vfguide.lab.studies.article import MISSIONS
from vfguide.lab.studies.flown import Case
from vfguide.mission.controller import controller_of
from vfguide.registry import laws

ABLATIONS: dict[str, dict[str, dict[str, Any]]] = {
    "as shipped": {},
    "no slot motion": {"controller": {"type": "article"}},
    "no integral": {"controller": {"integral_s": 0.0}},
    "no rates of the slot's motion": {"controller": {"rate_feedforward": False}},
    "no wind rate": {"controller": {"wind_feedforward": False}},
    "no wind filter": {"controller": {"wind_filter_s": 0.0}},
    "no filter of the leader's rates": {"controller": {"rate_filter_s": 0.0}},
    "no delay compensation": {"controller": {"predict_leader": False}},
    "no measured leader speed (observer)": {"controller": {"leader_speed_source": "observer"}},
    "boundary layer of the article": {"controller": {"boundary_layer_factor": 0.0}},
    "no position filter": {"controller": {"position_filter_s": 0.0}},
    "no giving way": {"controller": {"give_way": False}},
}
"""Fields of the mission that switch one part off."""

QUICK_S, FULL_S = 120.0, 300.0


def parts_of(law: str) -> list[str]:
    """Names of the ablations that a law has: what is no field of its `controller:` cannot be switched off.

    Raises:
        InputError: there is no such law.
    """
    fields = controller_of({"type": laws.find(law).name})
    return [
        name
        for name, changes in ABLATIONS.items()
        if all(
            hasattr(fields, field) and (field != "type" or law == "slot")
            for field in changes.get("controller", {})
        )
    ]


def ablation_cases(law: str, *, quick: bool) -> list[Case]:
    """Every part of a law off, on every mission."""
    duration_s = QUICK_S if quick else FULL_S
    return [
        Case(
            mission=mission,
            controller=changes.get("controller", {}).get("type", law),
            changes={**changes, "rehearsal": {"duration_s": duration_s}},
            label=name,
        )
        for name in parts_of(law)
        if (changes := ABLATIONS[name]) is not None
        for mission in MISSIONS
    ]
