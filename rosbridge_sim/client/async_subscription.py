"""A subscription of AsyncClient: messages in order, with bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

from rosbridge_sim.client.frames import Frame, Inbox

Predicate = Callable[[Frame], object]
"""Takes a message and returns true if it fits."""


class Subscriber(Protocol):
    """The client of a subscription, see `AsyncClient`."""

    async def next_of(
        self, subscription: AsyncSubscription, predicate: Predicate | None, timeout: float | None
    ) -> Frame:
        """Return the next message that fits."""

    async def unsubscribe(self, subscription: AsyncSubscription) -> None:
        """End a subscription."""


class AsyncSubscription:
    """Messages of a topic, from `AsyncClient.subscribe`.

        async with await client.subscribe("/Ego_topic") as egos:
            async for ego in egos:
                ...

    The loop ends when the subscription is closed. It raises `ConnectionLostError` when the connection ends.

    Attributes:
        topic: absolute name of the topic.
        inbox: messages that wait to be taken.
        op_id: id of the subscription on the wire.
    """

    def __init__(self, client: Subscriber, topic: str, inbox: Inbox, op_id: str) -> None:
        self.topic = topic
        self.inbox = inbox
        self.op_id = op_id
        self._client = client

    @property
    def num_dropped(self) -> int:
        """Number of messages that were dropped because more came than the subscription keeps."""
        return self.inbox.num_dropped

    async def next(self, *, timeout: float | None = None) -> Frame:
        """Return the next message.

        Args:
            timeout: longest wait [s]; None means the client's own.

        Raises:
            AnswerTimeoutError: no message in time.
            ConnectionLostError: the connection has ended.
            ClientError: the subscription was closed.
        """
        return await self._client.next_of(self, None, timeout)

    async def wait_for(self, predicate: Predicate | None = None, *, timeout: float | None = None) -> Frame:
        """Return the next message that fits; skip those before it.

        Args:
            predicate: takes a message and returns true if it fits; None accepts every message.
            timeout: longest wait [s]; None means the client's own.

        Returns:
            The message.

        Raises:
            AnswerTimeoutError: no message that fits came in time.
            ConnectionLostError: the connection has ended.
            ClientError: the subscription was closed.
        """
        return await self._client.next_of(self, predicate, timeout)

    async def take(self) -> list[Frame]:
        """Return the messages that wait, oldest first, without waiting for more."""
        return self.inbox.take()

    async def close(self) -> None:
        """End the subscription. A second call does nothing."""
        await self._client.unsubscribe(self)

    def __aiter__(self) -> Self:
        """Iterate over the messages, without a time limit."""
        return self

    async def __anext__(self) -> Frame:
        """Return the next message."""
        msg = await self.inbox.next(None)
        if msg is None:
            raise StopAsyncIteration
        return msg

    async def __aenter__(self) -> Self:
        """Return the subscription itself."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """End the subscription."""
        await self.close()
