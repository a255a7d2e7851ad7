"""A program on the graph of ROS 2 that is not ours: written with the DDS library alone, types included."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from typing import Any

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import float64, int32, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from tests.forked_workers import WORKER

PATIENCE = 20.0
"""For a loaded machine [s]; nothing here takes a second on an idle one."""

__all__ = ["Clock", "CtrlCmd", "Program", "String", "domain_of", "until"]


def domain_of(index: int) -> int:
    """A domain for one of 16 tests of a file; each process of pytest has its own sixteen."""
    return 10 + 16 * (int(os.environ.get(WORKER, "12")) % 13) + index


Time = make_idl_struct("Time", "builtin_interfaces::msg::dds_::Time_", {"sec": int32, "nanosec": uint32})
Clock = make_idl_struct("Clock", "rosgraph_msgs::msg::dds_::Clock_", {"clock": Time})
String = make_idl_struct("String", "std_msgs::msg::dds_::String_", {"data": str})
CtrlCmd = make_idl_struct(
    "CtrlCmd",
    "morai_msgs::msg::dds_::CtrlCmd_",
    {"longl_cmd_type": int32} | dict.fromkeys(("accel", "brake", "steering", "velocity", "acceleration"), float64),
)


async def until(condition: Callable[[], bool]) -> None:
    """Look every two milliseconds whether a condition holds, which no event tells."""
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110 - as above
            await asyncio.sleep(0.002)


class Heard:
    """The messages of a subscription.

    Attributes:
        offered: policies of the publisher that was there at the start.
    """

    def __init__(self) -> None:
        self.offered: list[Any] = []
        self.messages: asyncio.Queue[Any] = asyncio.Queue()

    async def next(self) -> Any:  # noqa: ANN401 - of any type
        async with asyncio.timeout(PATIENCE):
            return await self.messages.get()


class Program:
    """Publishers and subscriptions in a domain that this process has opened already."""

    def __init__(self, domain: int) -> None:
        self._participant = DomainParticipant(domain)
        self._parts: list[Any] = []

    def publish(self, topic: str, data_type: Any, *, is_reliable: bool = True) -> DataWriter[Any]:  # noqa: ANN401 - of a library
        """A publisher of a topic of ROS 2."""
        writer = DataWriter(self._participant, self._topic(topic, data_type), _qos(is_reliable=is_reliable))
        self._parts.append(writer)
        return writer

    def listen(self, topic: str, data_type: Any) -> None:  # noqa: ANN401 - as above
        """Subscribe to a topic of ROS 2, and do nothing with its messages."""
        self._parts.append(DataReader(self._participant, self._topic(topic, data_type), _qos(is_reliable=True)))

    async def subscribe(
        self,
        topic: str,
        data_type: Any,  # noqa: ANN401 - as above
        *,
        is_latched: bool = False,
        is_reliable: bool = True,
    ) -> Heard:
        """The messages of a topic of ROS 2, from now on: its publisher is known here."""
        loop = asyncio.get_running_loop()
        heard = Heard()

        def pump() -> None:
            for message in reader.take(1_000):
                if isinstance(message, data_type):
                    heard.messages.put_nowait(message)

        listener = Listener(on_data_available=lambda _reader: loop.call_soon_threadsafe(pump))
        qos = _qos(is_reliable=is_reliable, is_latched=is_latched)
        reader = DataReader(self._participant, self._topic(topic, data_type), qos, listener)
        self._parts.append(reader)
        await until(lambda: bool(reader.get_matched_publications()))
        offer = reader.get_matched_publication_data(reader.get_matched_publications()[0])
        heard.offered = list(offer.qos) if offer is not None else []
        return heard

    async def matched(self, writer: DataWriter[Any]) -> None:
        """Wait until somebody subscribes to what a publisher publishes."""
        await until(lambda: bool(writer.get_matched_subscriptions()))

    def close(self) -> None:
        for part in (*reversed(self._parts), self._participant):
            part.__del__()
        self._parts.clear()

    def _topic(self, name: str, data_type: Any) -> Topic[Any]:  # noqa: ANN401 - as above
        topic = Topic(self._participant, "rt" + name, data_type, Qos(_CDR))
        self._parts.append(topic)
        return topic


_CDR = Policy.DataRepresentation(use_cdrv0_representation=True)


def _qos(*, is_reliable: bool, is_latched: bool = False) -> Qos:
    reliability = Policy.Reliability.Reliable(0) if is_reliable else Policy.Reliability.BestEffort
    durability = Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile
    return Qos(_CDR, reliability, durability, Policy.History.KeepLast(100))
