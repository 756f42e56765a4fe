"""Missions as shipped, changed where a test wants them otherwise."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vfguide.mission import Mission, load_mission

MISSIONS = Path(__file__).parents[3] / "missions"

Change = dict[str, Any]


@pytest.fixture
def mission_with() -> Callable[..., Mission]:
    def change(name: str, **sections: Change) -> Mission:
        """The mission, with fields of its sections replaced, as valid as if its file said so."""
        content = load_mission(MISSIONS / f"{name}.yaml").model_dump(exclude_unset=True)
        for section, fields in sections.items():
            content.setdefault(section, {}).update(fields)
        return Mission.model_validate(content)

    return change
