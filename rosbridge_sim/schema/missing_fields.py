"""Fields that a message of a client lacks, for clients that want the protocol's warnings."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType

MAX_BODY = 16 * 1024
"""A longer message is not searched, because it is read once more for that [bytes]."""


def find_missing(message_type: MessageType | OpaqueType, body: object) -> list[str]:
    """Return the paths of the fields that an accepted message lacks. A header may be left out: it gets its stamp here.

    Elements of arrays are not searched.

    Args:
        body: JSON text, or the decoded value.
    """
    if isinstance(message_type, OpaqueType):
        return []
    if isinstance(body, (bytes, msgspec.Raw)):
        try:
            body = msgspec.json.decode(body) if len(body) < MAX_BODY else None
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):  # with the words NaN or Infinity
            return []
    return list(_missing(message_type.spec, body)) if isinstance(body, dict) else []


def _missing(spec: MessageSpec, given: dict[str, object]) -> Iterator[str]:
    names = {spec.aliases.get(name, name): value for name, value in given.items()}
    for name, field in spec.fields.items():
        nested = field.nested
        value = names.get(name)
        if spec.is_header or (nested is not None and nested.is_header):
            continue
        if value is None:
            yield name
        elif nested is not None and isinstance(value, dict):
            for inner in _missing(nested, value):
                yield f"{name}.{inner}"
