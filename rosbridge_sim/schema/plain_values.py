"""Messages as plain objects: those that the library rosbags has read, and fields that a client's message lacks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import msgspec
import numpy as np

from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType


def without_unknown(value: Any, spec: MessageSpec) -> Any:  # noqa: ANN401 - objects of Python
    """Return a message of ROS 2 without the fields that its type does not have in ROS 1."""
    known = {}
    for name, part in value.items():
        name_here = spec.aliases.get(name, name)
        if name_here in spec.fields:
            nested = spec.fields[name_here].nested
            if nested is None:
                known[name] = part
            elif isinstance(part, list):
                known[name] = [without_unknown(one, nested) for one in part]
            else:
                known[name] = without_unknown(part, nested) if isinstance(part, dict) else part
    return known


def plain_message(value: Any, types: Mapping[str, Any]) -> Any:  # noqa: ANN401 - what a library has read
    """Return a message of rosbags as Python objects, as `MessageType.check` takes them.

    Args:
        value: the message, or a value in it.
        types: its types: name -> fields.
    """
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint8:
            return value.tobytes()
        return value.tolist() if value.dtype == np.bool_ else value.copy()
    if isinstance(value, list):
        return [plain_message(one, types) for one in value]
    name = getattr(value, "__msgtype__", None)
    if name is None:
        return value
    found = types[name]
    return {field: plain_message(getattr(value, field), types) for field, _ in found}


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
