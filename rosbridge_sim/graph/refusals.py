"""A mistake of a client, as reported in the server's log and on the topic `/sim/refusals`."""

from __future__ import annotations

from typing import NamedTuple

from rosbridge_sim.errors import Reason
from rosbridge_sim.protocol import ops

_SUBJECTS = ("topic", "service", "action")
"""Fields of an op that name its topic, service or action; an op has at most one of them."""


class RefusedRequest(NamedTuple):
    """A refused request, and the text that the client was sent.

    Attributes:
        client: network address of the client.
        reason: kind of mistake.
        op: name of the op; empty if the frame holds no op, or for a mistake found later.
        subject: topic, service or action in the op as the client spells it; may be empty.
        text: the whole text that the client was sent.
    """

    client: str
    reason: Reason
    op: str
    subject: str
    text: str


def refusal_of(client: str, reason: Reason, text: object, op: ops.Op | None) -> RefusedRequest:
    """Return the record of a mistake.

    Args:
        text: text that the client was sent.
        op: the wrong op; None if it is not known.
    """
    name = "" if op is None else str(type(op).__struct_config__.tag)
    subject = next((getattr(op, field) for field in _SUBJECTS if hasattr(op, field)), "")
    return RefusedRequest(client, reason, name, str(subject), text if isinstance(text, str) else repr(text))
