"""Keys of an op that nobody reads. One may be misspelt: `goal` in place of `args` has an empty request carried out.

rosbridge_suite ignores such keys, and so does this server; but the client can be told.
"""

from __future__ import annotations

from typing import Final

import msgspec

from rosbridge_sim.protocol.ops import OPS, Op
from rosbridge_sim.suggestions import hint, listing

MAX_FRAME: Final = 16 * 1024
"""Frames from this length on are not looked at, because their keys are found only by reading all of it [bytes]."""

MAX_DESCRIBED: Final = 3
"""Keys of one op that are described, each by one line."""

_ENVELOPE: Final = frozenset({"op", "id", "fragment_size", "compression", "message_intervall", "png", "type"})
"""Keys that rosbridge_suite reads in every op, or that client libraries add to many."""

_IGNORED: Final[dict[str, frozenset[str]]] = {
    "advertise": frozenset({"queue_size", "queue_length", "throttle_rate"}),
    "publish": frozenset({"queue_size", "queue_length", "throttle_rate"}),
    "auth": frozenset({"mac", "client", "dest", "rand", "t", "level", "end"}),
}
"""Further keys of an op that rosbridge_suite or its rosauth reads, and this server does not."""

_KNOWN: Final = {
    kind: _ENVELOPE | _IGNORED.get(name, frozenset()) | {field.encode_name for field in msgspec.structs.fields(kind)}
    for name, kind in OPS.items()
}

_split = msgspec.json.Decoder(dict[str, msgspec.Raw]).decode


def describe_strange_keys(frame: bytes, op: Op) -> list[str]:
    """Return a line about each key of an op that nobody reads; an empty list for nearly all ops.

    Args:
        frame: JSON text of the op.
    """
    if len(frame) >= MAX_FRAME:
        return []
    try:
        keys = _split(frame).keys()
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):  # a key that is no UTF-8
        return []
    known = _KNOWN[type(op)]
    if keys <= known:  # without a set of its own, as nearly all ops are
        return []
    strange = keys - known
    name = type(op).__struct_config__.tag
    fields = [*op.__struct_fields__]
    left_out = [body for body in op.bodies if body not in keys]
    lines = []
    for key in sorted(strange)[:MAX_DESCRIBED]:
        near = hint(key, fields) or (f" (did you mean {left_out[0]}?)" if left_out else "")
        lines.append(f"{name}: nobody reads the field {listing([key])}{near or f'; there are {listing(fields)}'}")
    return lines
