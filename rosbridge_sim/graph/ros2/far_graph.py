"""Endpoints of other programs on the graph of ROS 2, and the interface of our node there, which `shell/` provides."""

from __future__ import annotations

from typing import Protocol

from rosbridge_sim.graph.ros2.cdr_types import CdrType
from rosbridge_sim.graph.ros2.quality import Quality
from rosbridge_sim.records import Record


class Endpoint(Record):
    """A publisher or subscription of another program on the graph.

    Attributes:
        key: tells endpoints apart.
        topic: name of the topic on our bus.
        dds_type: name of its type for DDS.
        is_writer: it publishes.
        quality: what it offers or asks for.
        node: name of its node; empty if the node has not told its name.
        is_named: false if its node may still tell its name; then the endpoint will be noted again.
        program: GUID of its program, as `guid_text` writes it.
    """

    key: str
    topic: str
    dds_type: str
    is_writer: bool
    quality: Quality
    node: str
    is_named: bool = True
    program: str = ""


class FarNode(Protocol):
    """Our node on the graph of ROS 2. Names of topics are those of our bus."""

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        """Publish on a topic; other nodes see it from now on.

        Args:
            quality: what is offered.
            is_sole: its user data tells other nodes that it must be the only publisher of its topic.

        Raises:
            GraphError: the library refuses it.
        """

    def open_reader(self, topic: str, cdr_type: CdrType, quality: Quality) -> None:
        """Subscribe to a topic. Its messages go to the gateway.

        Args:
            quality: what is asked for.

        Raises:
            GraphError: the library refuses it.
        """

    def close_writer(self, topic: str) -> None:
        """Stop to publish on a topic."""

    def close_reader(self, topic: str) -> None:
        """Stop to subscribe to a topic."""

    def write(self, topic: str, raw: bytes) -> bool:
        """Send a message on a topic that has a writer. It never waits for a slow subscriber.

        Args:
            raw: the message as CDR.

        Returns:
            False if it was dropped, because too much waits for a slow subscriber already.
        """
