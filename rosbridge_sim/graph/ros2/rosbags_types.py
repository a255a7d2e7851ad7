"""Message types in the form of rosbags, which reads CDR and computes ROS 2's hash of a type.

rosbags can read definition texts, but its parser takes tens of milliseconds for each type, and the types are parsed
already.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

from rosbags.interfaces import Nodetype

from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.definitions.names import ros2_names, spelled

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Fielddefs, Typesdict

_TIMES: Final = {"time": "builtin_interfaces/msg/Time", "duration": "builtin_interfaces/msg/Duration"}

_TIME_FIELDS: Final[Fielddefs] = [("sec", (Nodetype.BASE, ("int32", 0))), ("nanosec", (Nodetype.BASE, ("uint32", 0)))]


def types_in(spec: MessageSpec) -> Typesdict:
    """Return a type and all types in it, by the names of ROS 2: `pkg/msg/Type` -> no constants, and the fields.

    Args:
        spec: a type of a store of ROS 2.
    """
    return {name: ([], found) for name, found in _types_in(spec)}


def _types_in(spec: MessageSpec) -> Iterator[tuple[str, Fielddefs]]:
    names = {name: other for other, name in ros2_names(spec.fields).items()}
    yield (
        spelled(spec.name, "msg", 2),
        [(names.get(name, name), _described(field)) for name, field in spec.fields.items()],
    )
    for field in spec.fields.values():
        if field.nested is not None:
            yield from _types_in(field.nested)
        elif field.definition.type in _TIMES:
            yield _TIMES[field.definition.type], _TIME_FIELDS


def _described(field: FieldSpec) -> Any:  # noqa: ANN401 - rosbags' types have no name for it
    """Return the type of a field."""
    one = field.definition
    base: tuple[Nodetype, object]
    if field.nested is not None:
        base = (Nodetype.NAME, spelled(field.nested.name, "msg", 2))
    elif one.type in _TIMES:
        base = (Nodetype.NAME, _TIMES[one.type])
    else:
        base = (Nodetype.BASE, (one.type, one.max_chars or 0))
    if one.array is None:
        return base
    return (Nodetype.ARRAY if one.array and not one.is_bounded else Nodetype.SEQUENCE, (base, one.array))
