"""The drive or the replay as a message: the simulator's own `/ReplayInfo_topic`.

Clients publish on this topic too (see `network_replay`). So the publisher remembers its own messages, and recognises
them when a far bridge sends them back.
"""

from __future__ import annotations

from typing import Final

from msgspec.structs import astuple

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.object_lists import DEGREES
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.state_machine import ReplayState
from rosbridge_sim.world.geometry.planar import quaternion
from rosbridge_sim.world.state.world import Dynamics

REPLAY_INFO: Final = "/ReplayInfo_topic"

MAX_ECHOES: Final = 15_000
"""Number of own messages that are recognised when a far bridge sends them back: five minutes of them. That is longer
than a far bridge may stall before its connection is closed. Otherwise the simulator would take one for a client's
message, and follow it."""


class ReplayInfoPublisher:
    """Publisher of ReplayInfo."""

    def __init__(self, process: ReplayProcess, *, is_showing_drives: bool) -> None:
        """Nothing is published before `publish`.

        Args:
            process: tells whether a recording moves the world.
            is_showing_drives: publish a drive without a recording for every subscriber, also for those of all topics
                (far bridges, recorders). Otherwise only for those that subscribe to this topic by its name.
        """
        self._process = process
        context = self._context = process.context
        self._is_showing_drives = is_showing_drives
        self._echoes: dict[int, None] = {}  # fingerprints of own messages, oldest first
        self._make_info = context.maker(
            "morai_msgs/ReplayInfo",
            "header ego_acc ego_brake ego_steer orientation linear_acceleration angular_velocity num_of_npcs "
            "num_of_pedestrian num_of_obstacle npc_list pedestrian_list obstacle_list",
        )
        self._vector = context.maker("geometry_msgs/Vector3", "x y z")
        self._quaternion = context.maker("geometry_msgs/Quaternion", "x y z w")

    def publish(self, publishers: Publishers) -> None:
        """Advertise the topic."""
        self._publisher = publishers.add(REPLAY_INFO, "morai_msgs/ReplayInfo", self._message, is_exclusive=False)

    def is_echo(self, message: Struct) -> bool:
        """Return whether a message is one of the last that were published here.

        Returns:
            True for a message of this simulator that came back.
        """
        return _fingerprint(message) in self._echoes

    def forget(self) -> None:
        """Forget the own messages, because the world has been reset."""
        self._echoes.clear()

    def _message(self) -> Struct:
        """Make the message for subscribers other than the simulator itself; None if there are none.

        While the world follows a client's messages on this topic, only those are published.
        """
        if self._process.state is ReplayState.FOLLOWING:
            return None
        assert self._publisher.topic is not None, "it is published"
        takes_all = self._is_showing_drives or self._process.state is not ReplayState.SIMULATING
        context, subscriptions = self._context, self._publisher.topic.subscriptions
        others = [one for one in subscriptions if one.owner is not context.participant]
        if not others:
            self._publisher.not_listening = subscriptions
        if not any(not one.is_idle and (takes_all or not one.is_general) for one in others):
            return None
        world, convert, row = context.world, context.convert, context.egos.first.row
        vector = self._vector
        climb_accel = world.climb_accel.item(row) if world.dynamics == Dynamics.SINGLE_TRACK else 0.0
        info = self._make_info(
            convert.header(world.frame, "ReplayInfo"),
            world.throttle.item(row),
            world.brake.item(row),
            world.steer.item(row) * DEGREES,
            self._quaternion(*quaternion(world.roll.item(row), world.pitch.item(row), world.yaw.item(row))),
            vector(world.accel.item(row), world.lateral_accel.item(row), climb_accel),
            vector(0.0, 0.0, world.yaw_rate.item(row)),
            *convert.object_lists(world),
        )
        self._echoes[_fingerprint(info)] = None
        if len(self._echoes) > MAX_ECHOES:
            del self._echoes[next(iter(self._echoes))]
        return info


def _fingerprint(info: Struct) -> int:
    """Number that tells one ReplayInfo from another.

    The stamp alone does not: messages without a stamp all get the present one.
    """
    header = info.header
    parts = [astuple(part) for part in (header.stamp, info.orientation, info.linear_acceleration)]
    return hash((*parts, header.frame_id, info.ego_acc, info.ego_steer))
