"""The shipped schema is the model's, and accepts what the model accepts."""

import json

import jsonschema
import pytest
import yaml

from tests.kit.missions import MISSION_FILES, MISSIONS
from vfguide.mission.schema import SCHEMA_FILE, mission_schema, schema_text


def test_the_shipped_schema_is_the_one_the_model_amounts_to():
    # python -c "from vfguide.mission.schema import *; print(schema_text(), end='')" renews it
    assert (MISSIONS / SCHEMA_FILE).read_text(encoding="utf-8") == schema_text()


def test_the_schema_is_itself_valid():
    jsonschema.Draft202012Validator.check_schema(mission_schema())


@pytest.mark.parametrize("file", MISSION_FILES, ids=lambda file: file.stem)
def test_a_shipped_mission_satisfies_the_schema_and_names_it(file):
    text = file.read_text(encoding="utf-8")
    assert text.startswith(f"# yaml-language-server: $schema={SCHEMA_FILE}\n")
    jsonschema.validate(yaml.safe_load(text), json.loads(schema_text()))


def test_the_schema_refuses_a_misspelt_field():
    mission = yaml.safe_load(MISSION_FILES[0].read_text(encoding="utf-8"))
    mission["controller"]["kapa"] = mission["controller"].pop("kappa")
    with pytest.raises(jsonschema.ValidationError, match="kapa"):
        jsonschema.validate(mission, mission_schema())


def undescribed(node: object, place: str = "") -> list[str]:
    if not isinstance(node, dict):
        return []
    fields = node.get("properties", {}).items()
    bare = [f"{place}/{name}" for name, field in fields if "description" not in field]
    inner = (undescribed(one, f"{place}/{name}") for name, one in node.items())
    return sum(inner, bare)


def test_every_field_of_the_schema_is_described():
    assert undescribed(mission_schema()) == []
