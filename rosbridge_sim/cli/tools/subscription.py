"""A subscription as a tool holds one: messages as they come, and a clear word where none can come."""

from __future__ import annotations

from rosbridge_sim.cli.tools.client import Bridge, Frame, absolute, answer_of, words
from rosbridge_sim.cli.tools.sync import why_silent
from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.shell.terminal_text import safe
from rosbridge_sim.shell.websocket.bridge_errors import RefusedError
from rosbridge_sim.suggestions import hint

__all__ = ["Listener", "no_topic"]


class Listener:
    """The messages of a topic.

    A topic without a type must be there already, and a server that does not know it may stay silent about that. So
    rosapi is asked for it at the same time; messages do not wait for the answer, and there may be none.
    """

    def __init__(self, bridge: Bridge, topic: str) -> None:
        """Nothing is asked for yet; `open` does that."""
        self._bridge = bridge
        self._topic = topic
        self._question: str | None = None
        self._question_ends: float | None = None
        self._complaint = ""
        self._num_messages = 0

    @classmethod
    async def open(cls, bridge: Bridge, topic: str, type_name: str | None, *, throttle_ms: int = 0) -> Listener:
        """Subscribe to a topic by its absolute name; with at least `throttle_ms` between two messages."""
        listener = cls(bridge, topic)
        rate = {"throttle_rate": throttle_ms} if throttle_ms else {}
        if type_name is not None:
            await bridge.send("subscribe", topic=topic, type=type_name, **rate)
            return listener
        await bridge.send("subscribe", topic=topic, **rate)
        listener._question = await bridge.send("call_service", service="/rosapi/topic_type", args={"topic": topic})
        listener._question_ends = bridge.now() + bridge.patience
        return listener

    async def expect(self, patience: float | None) -> Frame:
        """Return the next message.

        Args:
            patience: longest wait [s]; None is for ever.

        Raises:
            RefusedError: the topic cannot be had, or none came in time; the text says why, as far as it is known.
        """
        until = None if patience is None else self._bridge.now() + patience
        msg = await self.next(until)
        if msg is None:
            assert patience is not None, "there was no deadline"
            raise await why_silent(self._bridge, self._topic, patience)
        return msg

    async def next(self, until: float | None = None) -> Frame | None:
        """The next message; None if none comes until then.

        Raises:
            RefusedError: the topic cannot be had.
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
        """The message in a frame, if there is one."""
        op = frame.get("op")
        if op == "publish" and absolute(str(frame.get("topic"))) == self._topic:
            self._num_messages += 1
            msg = frame.get("msg")
            return msg if isinstance(msg, dict) else {}
        if op == "service_response" and frame.get("id") == self._question:
            self._question = self._question_ends = None
            values = answer_of(frame).values
            if isinstance(values, dict) and values.get("type") == "" and not self._num_messages:
                raise await no_topic(self._bridge, self._topic, "; --type PKG/TYPE waits for one")
            self._complain()
        if op == "status":
            self._hear(str(frame.get("level")), str(frame.get("msg")))
        return None

    def _hear(self, level: str, text: str) -> None:
        """What the server says. An error before the first message is about the one thing that it was asked for."""
        if level != "error" or self._num_messages:
            note(f"the server says: {text}")
            return
        self._complaint = text
        if self._question is None:  # else rosapi's answer may explain it better
            self._complain()

    def _give_up_asking(self) -> None:
        self._question = self._question_ends = None
        self._complain()
        if not self._num_messages:
            note(f"{self._bridge.silence} Waiting for messages")

    def _complain(self) -> None:
        if self._complaint:
            raise RefusedError(safe(self._complaint))


async def no_topic(bridge: Bridge, topic: str, advice: str = "") -> RefusedError:
    """The error that a topic is not there, with the name that was perhaps meant."""
    names = words(await bridge.ask("topics"), "topics")
    return RefusedError(f"no topic {safe(topic)} here{hint(topic, names)}{advice}")
