"""The component of `/sim/control_lease`: pedals are lifted when their driver is lost.

A command holds until the next one, because MORAI SIM does so. A person who drives by the keys of a page cannot send a
last command if the connection is lost. With a lease the simulator lifts the pedals then. A lease belongs to a
connection, so it is in no snapshot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Mode

SHORTEST: Final = 0.1
"""Shortest lease [s]: a page sends 30 commands a second, and a slow frame of a browser takes some of them."""

LONGEST: Final = 60.0
"""Longest lease [s]: a car without a driver has left any road by then."""


@dataclass(slots=True)
class _Lease:
    """A lease of one client for one ego.

    Attributes:
        frames: without a command, until the pedals are lifted.
        since: frame of the last command, or of the beginning of the lease.
    """

    frames: int
    since: int


class ControlLeases(Component):
    """The component of leases. Each client has at most one lease for each ego."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._leases: dict[tuple[Participant, int], _Lease] = {}
        context.hooks.after_frame.append(self._after_frame)
        context.hooks.on_leave.append(self._leave)
        context.hooks.on_reset.append(self._begin_anew)
        context.hooks.on_restore.append(self._begin_anew)

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/control_lease", "rosbridge_sim_msgs/ControlLease", self._handle)

    def _handle(self, call: Call, _now: float) -> None:
        request: Any = call.request
        caller, uid, seconds = call.caller, 0 if request.unique_id == -1 else request.unique_id, request.seconds
        why = self._why_not(uid, seconds)
        if why:
            call.explain(why, Reason.WRONG_VALUE)
        elif seconds == 0.0:
            self._leases.pop((caller, uid), None)
        else:
            # Keep the leases as few as the egos of each client are.
            self._leases = {key: lease for key, lease in self._leases.items() if self._ego(key[1]) is not None}
            self._leases[caller, uid] = _Lease(math.ceil(seconds / DT), self._context.world.frame)
            self._context.hooks.after_frame.wake(self._after_frame)
        call.respond(result=not why, message=why, client=caller.where)

    def _why_not(self, uid: int, seconds: float) -> str:
        """Return why there can be no such lease; empty if there can."""
        if self._ego(uid) is None:
            known = ", ".join(str(ego.index) for ego in self._context.egos if ego.is_there)
            return f"unique_id: expected the number of an ego ({known}), got {uid}"
        if seconds != 0.0 and not SHORTEST <= seconds <= LONGEST:
            return f"seconds: expected {SHORTEST:g} to {LONGEST:g}, or 0 for the end of the lease; got {seconds:g}"
        return ""

    def _ego(self, uid: int) -> Ego | None:
        return next((ego for ego in self._context.egos if ego.index == uid and ego.is_there), None)

    def _begin_anew(self) -> None:
        """Count from the present frame, which may be an earlier one."""
        for lease in self._leases.values():
            lease.since = self._context.world.frame

    def _after_frame(self, _now: float) -> None:
        """Lift the pedals of drivers that have been silent for too long. In synchronous mode the master decides."""
        if not self._leases:
            self._context.hooks.after_frame.rest(self._after_frame)
        if not self._context.sync.is_free:
            return
        frame = self._context.world.frame
        for (holder, uid), lease in self._leases.items():
            ego = self._ego(uid)
            if ego is None or ego.commander is not holder:
                continue
            lease.since = max(lease.since, ego.command_frame)
            if frame - lease.since >= lease.frames:
                self._lift(ego)

    def _leave(self, participant: Participant, _now: float) -> None:
        for holder, uid in [key for key in self._leases if key[0] is participant]:
            del self._leases[holder, uid]
            ego = self._ego(uid)
            if ego is not None and ego.commander is participant:
                self._lift(ego)

    def _lift(self, ego: Ego) -> None:
        """Lift the pedals; the wheels stay as they are."""
        world, row = self._context.world, ego.row
        is_pressed = world.mode.item(row) != Mode.PEDALS or world.throttle.item(row) or world.brake.item(row)
        if is_pressed and not ego.moved_by:
            command(world, row, mode=Mode.PEDALS, steer=world.steer_cmd.item(row))
