"""One mistake of a client, as the server's log and its topic `/sim/refusals` tell of it."""

from __future__ import annotations

from typing import NamedTuple

from rosbridge_sim.errors import Reason
from rosbridge_sim.protocol import ops

__all__ = ["RefusedRequest", "refusal_of"]

_SUBJECTS = ("topic", "service", "action")
"""Fields of an op that name what it is about; an op has one of them at most."""


class RefusedRequest(NamedTuple):
    """A refused request, and what the client was told.

    Attributes:
        client: its address.
        reason: the kind of mistake.
        op: the op that it is about; empty where a frame holds none, and for what is told later.
        subject: the topic, service or action that the op names, as the client spells it; may be empty.
        text: as the client was told, whole.
    """

    client: str
    reason: Reason
    op: str
    subject: str
    text: str


def refusal_of(client: str, reason: Reason, text: object, op: ops.Op | None) -> RefusedRequest:
    """Return the mistake that an op is.

    Args:
        client: its address.
        reason: the kind of mistake.
        text: what the client was told.
        op: what it is about; None where that is not known.
    """
    name = "" if op is None else str(type(op).__struct_config__.tag)
    subject = next((getattr(op, field) for field in _SUBJECTS if hasattr(op, field)), "")
    return RefusedRequest(client, reason, name, str(subject), text if isinstance(text, str) else repr(text))
