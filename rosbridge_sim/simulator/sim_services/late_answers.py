"""Answers of services: mistakes of a request, and results that a reader finds later."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from rosbridge_sim.errors import DocumentError, GraphError, PeerError, Reason
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.reading import answering

T = TypeVar("T")


def failing(handle: Callable[[Call, float], None]) -> Callable[[Call, float], None]:
    """Return a handler that ends a call with `result: false` if its request has a mistake."""

    def handle_or_fail(call: Call, now: float) -> None:
        try:
            handle(call, now)
        except PeerError as error:
            call.fail(error)

    return handle_or_fail


def answer_or_fail(
    call: Call, found: T | DocumentError, answer: Callable[[T], None], reason: Reason | None = None
) -> None:
    """Answer a call that still waits, or have it fail where the reader found an error."""
    if call.is_done:
        return
    if isinstance(found, DocumentError):
        call.fail(GraphError(str(found), reason=reason))
    else:
        answer(found)


class LateAnswers:
    """Calls that wait for the reader of a simulator.

    Attributes:
        num_waiting: calls that wait now.
    """

    def __init__(self, context: SimulatorContext) -> None:
        """Begin without calls."""
        self.num_waiting = 0
        self._context = context

    def find(
        self, call: Call, work: Callable[[], T], answer: Callable[[T], None], now: float, reason: Reason | None = None
    ) -> None:
        """Answer a call with what the reader finds.

        Args:
            work: see `Reader.read`.
            answer: answers the call with the result of `work`.
            reason: why the call fails if `work` raises a DocumentError.
        """

        def then(found: T | DocumentError, _now: float) -> None:
            self.num_waiting -= 1
            answer_or_fail(call, found, answer, reason)

        self.num_waiting += 1
        self._context.reader.read(work, answering(call.refuse, then), now)
