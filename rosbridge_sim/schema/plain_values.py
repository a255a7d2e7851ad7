"""Messages that the library rosbags has read, as the plain objects that `MessageType.check` takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rosbridge_sim.schema.definitions.message_spec import MessageSpec


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
