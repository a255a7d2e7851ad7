"""`/SyncModeInfo`: the state of synchronous mode, for all clients."""

from __future__ import annotations

from rosbridge_sim.morai.messages.convert import late_maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.simulator.sync.sync_table import ON
from rosbridge_sim.world.state.world import World


class SyncInfo:
    """Publisher of `/SyncModeInfo`, latched: it is updated even without subscribers."""

    def __init__(self, store: Store, world: World, sync: Sync[SceneCommand], publishers: Publishers) -> None:
        """Create the topic; nothing is published before the first `announce`.

        Args:
            world: has the frame.
        """
        self._world = world
        self._sync = sync
        self._publishers = publishers
        self._topic = publishers.keep("/SyncModeInfo", "morai_msgs/SyncModeInfo")
        self._make = late_maker(store, "morai_msgs/SyncModeInfo", "master_id status frame can_send_tick")
        self._told_frame = -1
        sync.hooks.announce = self.announce

    def announce_frame(self, now: float) -> None:
        """Publish the state if that of this frame was left out, because the frames were too many for wall time."""
        if self._told_frame != self._world.frame:
            self.announce(now)

    def announce(self, now: float, *, may_tick: bool = True) -> None:
        """Publish the current state of the mode.

        Args:
            may_tick: false within a tick, because the next tick cannot be sent before the last frame of this one.
        """
        sync = self._sync
        info = self._make(sync.master_id, sync.state in ON, self._world.frame, sync.can_send_tick and may_tick)
        self._told_frame = self._world.frame
        self._publishers.update(self._topic, info, now)
