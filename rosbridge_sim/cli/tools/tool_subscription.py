"""The subscription of a tool: messages as they come, and a clear error if none can come."""

from __future__ import annotations

from collections.abc import Mapping

from rosbridge_sim.cli.tools.sync_commands import why_silent
from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, answer_of, words
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

CLOCK = "/clock"

CLOCK_TYPES = {"rosgraph_msgs/Clock", "rosgraph_msgs/msg/Clock"}
"""Types of a clock topic, which may have another name."""


class NoTopicError(RefusedError):
    """Error: the server has no such topic."""


class Listener:
    """The messages of a topic.

    Without a given type, the topic must already exist, and a server that does not know it may not say so. So rosapi is
    asked at the same time. Messages do not wait for that answer, which may never come.

    Attributes:
        topic: its absolute name.
        clock_ns: time of the watched clock when the last message came [ns]; None before the clock's first message.
    """

    def __init__(self, bridge: Bridge, topic: str) -> None:
        """Prepare; `open` subscribes."""
        self._bridge = bridge
        self.topic = topic
        self._question: str | None = None
        self._question_ends: float | None = None
        self._complaint = ""
        self._num_messages = 0
        self._clock: str | None = None
        self.clock_ns: int | None = None

    @classmethod
    async def open(cls, bridge: Bridge, topic: str, type_name: str | None, *, throttle_ms: int = 0) -> Listener:
        """Subscribe to a topic.

        Args:
            topic: absolute name of the topic.
            type_name: its type; None means that of an existing topic.
            throttle_ms: least time between two messages [ms].
        """
        listener = cls(bridge, topic)
        kind = {} if type_name is None else {"type": type_name}
        rate = {"throttle_rate": throttle_ms} if throttle_ms else {}
        await bridge.send("subscribe", topic=topic, **kind, **rate)
        if type_name is None:
            listener._question = await bridge.send("call_service", service="/rosapi/topic_type", args={"topic": topic})
            listener._question_ends = bridge.now() + bridge.patience
        return listener

    async def watch_clock(self) -> str | None:
        """Subscribe to the server's clock, too; return its name, or None if there is none.

        Raises:
            RefusedError: there is no rosapi.
            BridgeError: it does not answer.
        """
        answer = await self._bridge.ask("topics")
        types = dict(zip(words(answer, "topics"), words(answer, "types"), strict=False))
        self._clock = clock_of(types)
        if self._clock is not None:
            await self._bridge.send("subscribe", topic=self._clock, type=types[self._clock])
        return self._clock

    async def expect(self, patience: float | None) -> Frame:
        """Return the next message.

        Args:
            patience: longest wait [s]; None means no limit.

        Raises:
            RefusedError: the topic does not exist, or no message came in time; the text has the cause, if it is known.
        """
        until = None if patience is None else self._bridge.now() + patience
        msg = await self.next(until)
        if msg is None:
            assert patience is not None, "only a wait with a limit ends without a message"
            raise await why_silent(self._bridge, self.topic, patience)
        return msg

    async def next(self, until: float | None = None) -> Frame | None:
        """Return the next message; None if none comes in time.

        Args:
            until: time of the event loop [s]; None means no limit.

        Raises:
            RefusedError: the topic does not exist.
        """
        while True:
            deadlines = [at for at in (until, self._question_ends) if at is not None]
            frame = await self._bridge.receive(min(deadlines, default=None))
            if frame is not None:
                msg = await self._judge(frame)
                if msg is not None:
                    return msg
            elif until is not None and self._bridge.now() >= until:
                return None
            else:
                self._give_up_asking()

    async def _judge(self, frame: Frame) -> Frame | None:
        """Return the message in a frame, if there is one."""
        op = frame.get("op")
        if op == "publish" and self._clock is not None and absolute(str(frame.get("topic"))) == self._clock:
            self.clock_ns = stamp_of(frame.get("msg"), "clock")
        if op == "publish" and absolute(str(frame.get("topic"))) == self.topic:
            self._num_messages += 1
            msg = frame.get("msg")
            return msg if isinstance(msg, dict) else {}
        if op == "service_response" and frame.get("id") == self._question:
            self._question = self._question_ends = None
            values = answer_of(frame).values
            if isinstance(values, dict) and values.get("type") == "" and not self._num_messages:
                raise await no_topic(self._bridge, self.topic, "; --type PKG/TYPE waits for one")
            self._complain()
        if op == "status":
            self._hear(str(frame.get("level")), str(frame.get("msg")))
        return None

    def _hear(self, level: str, text: str) -> None:
        """Handle a status message.

        An error before the first message is about this subscription, the only request so far.
        """
        if level != "error" or self._num_messages:
            note(f"the server says: {text}")
            return
        self._complaint = text
        if self._question is None:  # otherwise rosapi's answer may explain it better
            self._complain()

    def _give_up_asking(self) -> None:
        self._question = self._question_ends = None
        self._complain()
        if not self._num_messages:
            note(f"{self._bridge.silence} Waiting for messages")

    def _complain(self) -> None:
        if self._complaint:
            raise RefusedError(safe(self._complaint))


async def no_topic(bridge: Bridge, topic: str, advice: str = "") -> NoTopicError:
    """Return the error for a missing topic, with a suggestion.

    Args:
        topic: absolute name of the topic.
        advice: further text for the end of the error.
    """
    names = words(await bridge.ask("topics"), "topics")
    return NoTopicError(f"no topic {safe(topic)} here{hint(topic, names)}{advice}")


def clock_of(types: Mapping[str, str]) -> str | None:
    """Return the clock's topic; None if there is none.

    Args:
        types: name -> type of each topic.
    """
    clocks = [topic for topic, type_name in types.items() if type_name in CLOCK_TYPES]
    return CLOCK if CLOCK in types else min(clocks, default=None)


def stamp_of(msg: object, field: str) -> int:
    """Return a time in a message, in the spelling of either generation [ns]; 0 if there is none."""
    stamp = msg.get(field) if isinstance(msg, dict) else None
    if not isinstance(stamp, dict):
        return 0
    parts = [stamp.get(one, stamp.get(other, 0)) for one, other in (("secs", "sec"), ("nsecs", "nanosec"))]
    secs, nsecs = (part if isinstance(part, int) and part >= 0 else 0 for part in parts)
    return secs * 10**9 + nsecs
