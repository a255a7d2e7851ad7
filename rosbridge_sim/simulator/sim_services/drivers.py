"""The component of `/sim/drivers`: who moves time, and who drives each ego.

It is for people who watch, and for programs that must not disturb others. Nothing of it decides anything, and it is no
state of the simulator: connections are not in a snapshot.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import Ego, ego_prefix
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext

DRIVERS: Final = "/sim/drivers"

_EgoFields = tuple[int, int, int, str, str, tuple[str, ...]]
"""The fields of an EgoDriver."""


class Drivers(Component):
    """The component of drivers. It holds no state."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._make = context.maker(
            "rosbridge_sim_msgs/Drivers",
            "header frame is_paused is_synchronous is_replaying master master_clients barrier_members "
            "time_step real_time_factor egos",
        )
        self._make_ego = context.maker(
            "rosbridge_sim_msgs/EgoDriver", "unique_id ctrl_mode gear driver client publishers"
        )
        context.hooks.on_leave.append(self._forget)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topic that exists once, not for each ego."""
        publishers.add(
            DRIVERS, "rosbridge_sim_msgs/Drivers", self._message, version=self._values, is_in_frames=False, depth=1
        )

    def _forget(self, participant: Participant, _now: float) -> None:
        for ego in self._context.egos:
            if ego.commander is participant:
                ego.commander = None

    def _message(self) -> Struct:
        context = self._context
        values = self._values()
        *fixed, masters, members, time_step, factor, egos = values
        return self._make(
            context.convert.header(context.world.frame),
            context.world.frame,
            *fixed,
            list(masters),
            list(members),
            time_step,
            factor,
            [self._make_ego(*fields, list(publishers)) for *fields, publishers in egos],
        )

    def _values(self) -> tuple[Any, ...]:
        """Return the fields of the message from `is_paused` on, as values that can be compared."""
        context = self._context
        sync, barrier = context.sync, context.barrier
        return (
            sync.is_paused,
            sync.is_on,
            context.scene.is_replaying,
            sync.master_id,
            _addresses(barrier.holders if barrier.is_on else sync.holders),
            tuple(barrier.status().members) if barrier.is_on else (),
            sync.step_ms if sync.is_on else 0,
            context.pacer.factor,
            tuple([self._ego_values(ego) for ego in context.egos if ego.is_there]),
        )

    def _ego_values(self, ego: Ego) -> _EgoFields:
        client = "" if ego.commander is None else ego.commander.where
        return ego.index, int(ego.ctrl_mode), int(ego.gear), ego.driver, client, self._publishers(ego)

    def _publishers(self, ego: Ego) -> tuple[str, ...]:
        """Return the addresses of the clients that advertise an ego's control."""
        context = self._context
        prefix = ego_prefix(ego.index)
        names = ("/ctrl_cmd", "/ctrl_cmd_0") if ego is context.egos.first else ("/ctrl_cmd",)
        found: dict[str, None] = {}
        for default in names:
            name = context.interfaces.name_of(InterfaceKind.SUBSCRIBER, default, prefix)
            topic = context.bus.topics.get(name)
            if topic is not None and topic.publishers:
                found |= dict.fromkeys(_addresses(topic.publishers))
        return tuple(found)


def _addresses(holders: Iterable[Any]) -> tuple[str, ...]:
    """Return the addresses of participants, each once."""
    return tuple(dict.fromkeys(holder.where for holder in holders))
