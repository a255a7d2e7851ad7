"""Helpers for handlers of MORAI services: read the request, answer it, report a mistake."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.graph.participant import Notify
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct


def request_of(call: Call) -> Struct:
    """Return the message inside a request; every MORAI service wraps one message.

    Returns:
        The struct of the request's only field.
    """
    request: Any = call.request
    return request.request


def respond(call: Call, response: Struct) -> None:
    """Answer a call with one message, wrapped as the request is.

    Args:
        call: the call; it must not have been answered.
        response: the struct of the response's only field.
    """
    call.answer(call.service.type.response.struct_type(response))


def complain(notify: Notify, text: str) -> None:
    """Report a mistake to a peer where no answer can hold the reason.

    Args:
        notify: sends a status to the peer.
        text: the mistake, on one line.
    """
    notify("error", text)
