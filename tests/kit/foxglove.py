"""What messages for Foxglove say: JSON, or Protobuf with its schema beside it."""

import json
from typing import Any

from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory


def said(name: str, encoding: str, schema: bytes, data: bytes) -> Any:
    """Read a message.

    Args:
        name: of its schema.
        encoding: `json` or `protobuf`.
        schema: a JSON schema, or a set of Protobuf's file descriptors.
        data: the message.
    """
    if encoding == "json":
        return json.loads(data)
    decoder = DecoderFactory().decoder_for(encoding, Schema(1, schema, encoding, name))
    assert decoder is not None
    return decoder(data)
