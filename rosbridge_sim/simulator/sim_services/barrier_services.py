"""The component of the barrier: `/sim/barrier/join`, `/sim/barrier/leave` and the topic `/sim/barrier`.

It reads requests, has `Barrier` decide, and tells what follows. The members tick by `/SyncModeWaitForTick`; what their
ticks do to the world is in `SyncDriver`.
"""

from __future__ import annotations

import logging
from typing import Any

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.simulator.bus.publisher_kinds import LatchedPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.sync.barrier_table import BARRIER_ID, BarrierOutcome

_log = logging.getLogger("rosbridge_sim.morai")


class BarrierServices(Component):
    """The component of the barrier. It holds no state: that is the barrier's."""

    def __init__(self, context: SimulatorContext) -> None:
        """Register with the barrier of `context`; offer nothing yet."""
        self._context = context
        self._topic: LatchedPublisher | None = None
        self._make = context.maker(
            "rosbridge_sim_msgs/Barrier",
            "frame is_paused time_step deadline_s members ticked waited_for joining leaving late_counts",
        )
        hooks = context.barrier.hooks
        hooks.tell = _tell
        hooks.warn = _warn
        hooks.announce = self._announce
        context.hooks.on_mode_change.append(self._follow_pause)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topics that exist once, not for each ego."""
        self._topic = publishers.keep("/sim/barrier", "rosbridge_sim_msgs/Barrier")
        self._announce(0.0)

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/barrier/join", "rosbridge_sim_msgs/BarrierJoin", self._join)
        bindings.provide("sim/barrier/leave", "rosbridge_sim_msgs/BarrierLeave", self._leave)

    def _join(self, call: Call, now: float) -> None:
        request: Any = call.request
        self._check_still(call)
        context, barrier = self._context, self._context.barrier
        outcome, user_id = barrier.join(request.user_id, request.time_step, request.deadline_s, call.caller, now)
        why = self._explain(call, outcome)
        if not why:
            _log.info("%r joined the barrier at frame %d, from %s", user_id, context.world.frame, call.caller.name)
        call.respond(
            result=not why,
            message=why,
            user_id=request.user_id if why else user_id,
            frame=context.world.frame,
            time_step=barrier.step_ms,
            deadline_s=barrier.deadline,
            members=barrier.status().members,
        )

    def _leave(self, call: Call, now: float) -> None:
        request: Any = call.request
        self._check_still(call)
        context, barrier = self._context, self._context.barrier
        outcome = barrier.leave(request.user_id, now)
        why = self._explain(call, outcome)
        if not why:
            _log.info("%r left the barrier at frame %d", request.user_id, context.world.frame)
        status = barrier.status()
        call.respond(
            result=not why,
            message=why,
            frame=context.world.frame,
            members=[user_id for user_id in status.members if user_id not in status.leaving],
        )

    def _check_still(self, call: Call) -> None:
        """Refuse a listener of a tick's topics that asks from within.

        Raises:
            GraphError: frames are being computed.
        """
        if self._context.stepper.is_moving:
            raise GraphError(f"{call.service.name}: a tick is in progress", reason=Reason.NOT_NOW)

    def _explain(self, call: Call, outcome: BarrierOutcome) -> str:
        """Tell the caller why it is refused, and return that; an empty text if it is not."""
        if outcome.is_accepted:
            return ""
        why = self._context.barrier.why(outcome, call.caller)
        call.explain(why, outcome.reason, "warning")
        return why

    def _follow_pause(self, now: float) -> None:
        """Publish the barrier when a pause has begun or ended."""
        topic = self._topic
        if topic is not None and topic.value is not None and topic.value.is_paused != self._context.sync.is_paused:
            self._announce(now)

    def _announce(self, now: float) -> None:
        """Publish the barrier as it is."""
        context = self._context
        if self._topic is None:
            return
        barrier = context.barrier
        step_ms, deadline = (barrier.step_ms, barrier.deadline) if barrier.is_on else (0, 0.0)
        value = self._make(context.world.frame, context.sync.is_paused, step_ms, deadline, *barrier.status())
        context.publishers.update(self._topic, value, now)


def _tell(holder: Participant, text: str) -> None:
    """Tell a member's connection what another member has done."""
    holder.remark("warning", f"{BARRIER_ID}: {text}")


def _warn(holder: Participant, text: str, reason: Reason) -> None:
    """Tell a member's connection that it is late."""
    holder.explain("warning", f"{BARRIER_ID}: {text}", reason)
