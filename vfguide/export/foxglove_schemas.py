"""Messages that Foxglove and Lichtblick draw by themselves, described as JSON Schema.

The names, fields and units of `foxglove.…` are Foxglove's well-known message types: https://docs.foxglove.dev/docs/sdk/schemas.
Only the fields that are written here are described.
"""

from typing import Any

from vfguide.export.columns import UNITS

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
TEXT: Schema = {"type": "string"}


def structure(title: str, **fields: Schema) -> Schema:
    """An object with these fields."""
    return {"title": title, "type": "object", "properties": fields}


def listing(of: Schema) -> Schema:
    """An array."""
    return {"type": "array", "items": of}


def seconds(title: str) -> Schema:
    """A time or a duration, of seconds and nanoseconds."""
    whole = {"type": "integer", "minimum": 0}
    return structure(title, sec=whole, nsec={**whole, "maximum": 999_999_999})


TIME = seconds("time")
VECTOR = structure("foxglove.Vector3", x=NUMBER, y=NUMBER, z=NUMBER)
POINT = structure("foxglove.Point3", x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = structure("foxglove.Quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = structure("foxglove.Pose", position=VECTOR, orientation=QUATERNION)
COLOUR = structure("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)

ARROW = structure(
    "foxglove.ArrowPrimitive",
    pose=POSE,
    shaft_length=NUMBER,
    shaft_diameter=NUMBER,
    head_length=NUMBER,
    head_diameter=NUMBER,
    color=COLOUR,
)
TEXT_MARK = structure(
    "foxglove.TextPrimitive",
    pose=POSE,
    billboard={"type": "boolean"},
    font_size=NUMBER,
    scale_invariant={"type": "boolean"},
    color=COLOUR,
    text=TEXT,
)
LINE = structure(
    "foxglove.LinePrimitive",
    type={"type": "integer"},
    pose=POSE,
    thickness=NUMBER,
    scale_invariant={"type": "boolean"},
    points=listing(POINT),
    color=COLOUR,
    colors=listing(COLOUR),
    indices=listing({"type": "integer", "minimum": 0}),
)
ENTITY = structure(
    "foxglove.SceneEntity",
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=seconds("duration"),
    frame_locked={"type": "boolean"},
    metadata=listing(structure("foxglove.KeyValuePair", key=TEXT, value=TEXT)),
    arrows=listing(ARROW),
    lines=listing(LINE),
    texts=listing(TEXT_MARK),
)

SCHEMAS: dict[str, Schema] = {
    "foxglove.LocationFix": structure(
        "foxglove.LocationFix",
        timestamp=TIME,
        frame_id=TEXT,
        latitude=NUMBER,
        longitude=NUMBER,
        altitude=NUMBER,
        position_covariance={**listing(NUMBER), "minItems": 9, "maxItems": 9},
        position_covariance_type={"type": "integer", "enum": [0, 1, 2, 3]},
    ),
    "foxglove.FrameTransform": structure(
        "foxglove.FrameTransform",
        timestamp=TIME,
        parent_frame_id=TEXT,
        child_frame_id=TEXT,
        translation=VECTOR,
        rotation=QUATERNION,
    ),
    "foxglove.SceneUpdate": structure(
        "foxglove.SceneUpdate",
        deletions=listing(
            structure(
                "foxglove.SceneEntityDeletion",
                timestamp=TIME,
                type={"type": "integer"},
                id=TEXT,
            )
        ),
        entities=listing(ENTITY),
    ),
    "foxglove.Log": structure(
        "foxglove.Log",
        timestamp=TIME,
        level={"type": "integer", "enum": [0, 1, 2, 3, 4, 5]},
        message=TEXT,
        name=TEXT,
        file=TEXT,
        line={"type": "integer", "minimum": 0},
    ),
    "vfguide.VehicleState": structure(
        "vfguide.VehicleState",
        timestamp=TIME,
        mode=TEXT,
        limited={"type": "boolean"},
        **{name: {"type": "number", "description": unit} for name, unit in UNITS.items()},
    ),
}
"""Every message that is written, by its name."""
