"""How a handler of a MORAI service reads its request, answers it, and says what is wrong."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.graph.participant import Notify
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct

__all__ = ["complain", "request_of", "respond"]


def request_of(call: Call) -> Struct:
    """What is in the request; every MORAI service wraps one message."""
    request: Any = call.request
    return request.request


def respond(call: Call, response: Struct) -> None:
    """Answer with one message, wrapped as in the request."""
    call.answer(call.service.type.response.struct_type(response))


def complain(notify: Notify, text: str) -> None:
    """Tell a peer of its mistake where no answer can hold the reason."""
    notify("error", text)
