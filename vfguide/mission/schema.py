"""The JSON schema of mission files, for editors that complete and check them while they are written."""

import json

from vfguide.mission.model import Mission

SCHEMA_FILE = "mission.schema.json"
"""Name of the shipped schema; mission files beside it refer to it in their first line."""


def mission_schema() -> dict[str, object]:
    """The schema that the model of a mission file amounts to."""
    schema = Mission.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text() -> str:
    """The schema as it is shipped."""
    return json.dumps(mission_schema(), indent=2, ensure_ascii=False) + "\n"
