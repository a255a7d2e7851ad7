"""Our node through two libraries: rclpy, and the DDS library for topics whose types are not installed for rclpy."""

from __future__ import annotations

from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros2.cdr_types import CdrType
from rosbridge_sim.shell.ros2.rclpy_node import RclpyNode
from rosbridge_sim.shell.ros2.ros2_node import Ros2Node


class JointNode:
    """Our node; see `FarNode`. The endpoints of other programs are those that rclpy sees."""

    def __init__(self, rclpy: RclpyNode, dds: Ros2Node) -> None:
        """Join two nodes in one domain into one.

        Args:
            rclpy: takes the topics whose types are installed.
            dds: takes the others.
        """
        self._rclpy, self._dds = rclpy, dds
        self._writers: dict[str, RclpyNode | Ros2Node] = {}
        self._readers: dict[str, RclpyNode | Ros2Node] = {}
        rclpy.hide(dds.program)

    def _side(self, cdr_type: CdrType) -> RclpyNode | Ros2Node:
        return self._rclpy if self._rclpy.types.has(cdr_type.name) else self._dds

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        """See `FarNode`."""
        side = self._writers[topic] = self._side(cdr_type)
        side.open_writer(topic, cdr_type, quality, is_sole=is_sole)

    def open_reader(self, topic: str, cdr_type: CdrType, quality: Quality) -> None:
        """See `FarNode`."""
        side = self._readers[topic] = self._side(cdr_type)
        side.open_reader(topic, cdr_type, quality)

    def close_writer(self, topic: str) -> None:
        """See `FarNode`."""
        self._writers.pop(topic).close_writer(topic)

    def close_reader(self, topic: str) -> None:
        """See `FarNode`."""
        self._readers.pop(topic).close_reader(topic)

    def write(self, topic: str, raw: bytes) -> bool:
        """See `FarNode`."""
        return self._writers[topic].write(topic, raw)

    def start(self) -> None:
        """Let messages come from now on."""
        self._rclpy.start()

    def stop(self) -> None:
        """Leave the domain."""
        self._rclpy.stop()
        self._dds.stop()
