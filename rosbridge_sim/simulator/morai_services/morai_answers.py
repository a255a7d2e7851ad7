"""The message in a request of a MORAI service."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct


def request_of(call: Call) -> Struct:
    """Return the message inside a request; every MORAI service wraps one message.

    Returns:
        The struct of the request's only field.
    """
    request: Any = call.request
    return request.request
