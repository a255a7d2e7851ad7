"""One mistake of a client, as the server's log and its topic `/sim/refusals` tell of it."""

from __future__ import annotations

from typing import NamedTuple

from rosbridge_sim.errors import Reason

__all__ = ["RefusedRequest"]


class RefusedRequest(NamedTuple):
    """What a client was told of something that it asked for.

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
