"""JSON schema of mission files, for editors that complete and check them."""

import json

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import ModelSchema

from vfguide.mission.flight_path import shape_model
from vfguide.mission.model import Mission
from vfguide.mission.quantity import Section, field_meanings
from vfguide.registry import autopilots, emulated_autopilots, laws, paths, plants

SCHEMA_FILE = "mission.schema.json"
"""Name of the shipped schema; mission files beside it refer to it in their first line."""


class DescribedSchema(GenerateJsonSchema):
    """Generator of a schema that describes each field by the docstring below it."""

    def model_schema(self, schema: ModelSchema) -> JsonSchemaValue:
        """Return the schema of one section."""
        made = super().model_schema(schema)
        section: type[Section] = schema["cls"]
        for name, meaning in field_meanings(section).items():
            if name in made.get("properties", {}):
                made["properties"][name].setdefault("description", meaning)
        return made


def mission_schema() -> dict[str, object]:
    """Return the schema of a mission file, with vfguide's own paths and laws."""
    schema = Mission.model_json_schema(schema_generator=DescribedSchema)
    controller = schema["$defs"]["Controller"]["properties"]
    controller["type"]["enum"] = list(laws.own)
    for name in laws.own:
        gains = laws.find(name).Gains.model_json_schema(schema_generator=DescribedSchema)
        for field, described in gains["properties"].items():
            known = controller.setdefault(field, described)
            if known.get("default") != described.get("default"):
                # The default differs between laws.
                controller[field] = {key: one for key, one in known.items() if key != "default"}
        schema["$defs"][gains["title"]] = gains
        group = f"Gains of `{name}`, for when the mission is flown by it."
        controller[name] = {"$ref": f"#/$defs/{gains['title']}", "description": group}
    schema["$defs"]["Vehicle"]["properties"]["autopilot"]["enum"] = list(autopilots.own)
    defaults = {key: one for key, one in schema["$defs"]["Vehicle"].items() if key != "required"}
    schema["$defs"]["VehicleDefaults"] = defaults | {
        "title": "VehicleDefaults",
        "description": "What every vehicle has that does not say otherwise.",
    }
    vehicles = schema["properties"]["vehicles"]
    ((pattern, vehicle),) = vehicles["patternProperties"].items()
    vehicles["patternProperties"] = {pattern.replace("^", "^(?!defaults$)", 1): vehicle}
    vehicles["properties"] = {
        "defaults": {
            "$ref": "#/$defs/VehicleDefaults",
            "description": "What every vehicle has that does not say otherwise.",
        }
    }
    for section in ("Emulator", "EmulatedAircraft"):
        emulated = schema["$defs"][section]["properties"]
        emulated["plant"]["anyOf"][0]["enum"] = list(plants.own)
        emulated["autopilot"]["anyOf"][0]["enum"] = list(emulated_autopilots.own)
    del schema["$defs"]["PathShape"]
    mapping = {}
    for name in paths.own:
        shape = shape_model(name).model_json_schema(schema_generator=DescribedSchema)
        # Shared definitions do not belong to the path alone.
        schema["$defs"] |= shape.pop("$defs", {}) | {shape["title"]: shape}
        mapping[name] = f"#/$defs/{shape['title']}"
    kinds = {
        "discriminator": {"mapping": mapping, "propertyName": "type"},
        "oneOf": [{"$ref": place} for place in mapping.values()],
        "title": "Path",
    }
    path, others = schema["properties"]["path"], schema["properties"]["paths"]
    schema["properties"]["path"] = {"description": path["description"], **kinds}
    others["patternProperties"] = dict.fromkeys(others["patternProperties"], kinds)
    # A leader without a companion needs no path, vehicle or airspeed; see `consistency`.
    leader = schema["$defs"]["Leader"]
    leader["anyOf"] = [{"required": leader.pop("required")}, {"required": ["follows"]}]
    schema["required"].remove("path")
    own = {"description": "Of a leader with a companion.", "not": {"required": ["follows"]}}
    schema["if"] = {"properties": {"leader": own}}
    schema["then"] = {"required": ["path"]}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text() -> str:
    """Return the schema as shipped."""
    return json.dumps(mission_schema(), indent=2, ensure_ascii=False) + "\n"
