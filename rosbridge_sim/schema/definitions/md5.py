"""The md5 sums by which nodes of ROS 1 compare their definitions of a type.

The sum is over the text without comments: constants, then fields, one a line, a nested message by its own sum. Source:
`genmsg/gentools.py`, `compute_md5_text`.
"""

from __future__ import annotations

from hashlib import md5

from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.definitions.typedefs import ros1_type


def message_md5(spec: MessageSpec) -> str:
    """Return the sum of a message.

    Args:
        spec: a type of a store of ROS 1.
    """
    return _sum(_text(spec, {}))


def service_md5(request: MessageSpec, response: MessageSpec) -> str:
    """Return the sum of a service.

    Args:
        request, response: types of a store of ROS 1.
    """
    sums: dict[str, str] = {}
    return _sum(_text(request, sums) + _text(response, sums))


def _sum(text: str) -> str:
    return md5(text.encode(), usedforsecurity=False).hexdigest()


def _text(spec: MessageSpec, sums: dict[str, str]) -> str:
    """Return the text of a message; `sums` are those of the nested types that came before."""
    lines = [f"{one.type} {one.name}={one.text}" for one in spec.definition.constants]
    for field_spec in spec.fields.values():
        kind, nested = ros1_type(field_spec.definition), field_spec.nested
        if nested is not None:
            if nested.name not in sums:
                sums[nested.name] = _sum(_text(nested, sums))
            kind = sums[nested.name]
        lines.append(f"{kind} {field_spec.definition.name}")
    return "\n".join(lines).strip()
