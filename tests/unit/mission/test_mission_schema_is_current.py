"""The shipped schema is the model's, and accepts what the model accepts."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from vfguide.mission.schema import SCHEMA_FILE, mission_schema, schema_text

FOLDER = Path(__file__).parents[3] / "missions"
MISSIONS = sorted(FOLDER.glob("*.yaml"))


def test_the_shipped_schema_is_the_one_the_model_amounts_to():
    # python -c "from vfguide.mission.schema import *; print(schema_text(), end='')" renews it
    assert (FOLDER / SCHEMA_FILE).read_text(encoding="utf-8") == schema_text()


def test_the_schema_is_itself_valid():
    jsonschema.Draft202012Validator.check_schema(mission_schema())


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_a_shipped_mission_satisfies_the_schema_and_names_it(file):
    text = file.read_text(encoding="utf-8")
    assert text.startswith(f"# yaml-language-server: $schema={SCHEMA_FILE}\n")
    jsonschema.validate(yaml.safe_load(text), json.loads(schema_text()))


def test_the_schema_refuses_a_misspelt_field():
    mission = yaml.safe_load(MISSIONS[0].read_text(encoding="utf-8"))
    mission["controller"]["kapa"] = mission["controller"].pop("kappa")
    with pytest.raises(jsonschema.ValidationError, match="kapa"):
        jsonschema.validate(mission, mission_schema())


def test_every_field_of_the_schema_is_described():
    def undescribed(node: object, place: str = "") -> list[str]:
        if not isinstance(node, dict):
            return []
        properties = node.get("properties", {})
        bare = [
            f"{place}/{name}" for name, field in properties.items() if "description" not in field
        ]
        return bare + [
            one for name, inner in node.items() for one in undescribed(inner, f"{place}/{name}")
        ]

    assert undescribed(mission_schema()) == []
