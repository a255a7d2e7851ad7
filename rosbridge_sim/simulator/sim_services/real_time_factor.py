"""The component of `/sim/real_time_factor`: how fast the world runs while real time moves it.

The factor is no state of the world: a reset and a restore leave it. Headers that have the time of day allow 1 alone,
since stamps that do not follow the world's time would be wrong for every program that compares two of them.
"""

from __future__ import annotations

import logging
from typing import Any

from rosbridge_sim.errors import FieldError, GraphError, PeerError, Reason
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.real_time import set_real_time_factor
from rosbridge_sim.simulator.kernel.real_time_pacer import why_no_factor

_log = logging.getLogger("rosbridge_sim.morai")


class RealTimeFactor(Component):
    """The component of the real-time factor. It holds no state: that is the pacer's."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/real_time_factor", "rosbridge_sim_msgs/RealTimeFactor", self._handle)

    def _handle(self, call: Call, now: float) -> None:
        request: Any = call.request
        context, factor, why = self._context, request.factor, ""
        if not factor < 0.0:
            try:
                self._check(factor)
            except PeerError as error:
                why = str(error)
                call.explain(why, error.reason)
            else:
                if factor != context.pacer.factor:
                    set_real_time_factor(context, factor, now)
                    _log.info("real-time factor %g, set by %s", factor, call.caller.name)
        measured = context.pacer.measure(now) if context.sync.is_free and context.pacer.is_started else 0.0
        call.respond(result=not why, message=why, factor=context.pacer.factor, measured=measured)

    def _check(self, factor: float) -> None:
        """Check whether a factor can be had now.

        Raises:
            FieldError: it is none.
            GraphError: the mode or the stamps stand in the way.
        """
        why = why_no_factor(factor)
        if why:
            raise FieldError(f"factor: {why}; a negative number only asks")
        if self._context.sync.is_on:
            text = "synchronous mode is on, where ticks move the world: set the factor after its end"
            raise GraphError(text, reason=Reason.NOT_NOW)
        if self._context.time.is_wall and factor != 1.0:
            text = f"factor: expected 1, because stamps are the time of day (--stamps); got {factor:g}"
            raise FieldError(text)
