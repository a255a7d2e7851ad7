"""`record`: record topics of any rosbridge into a bag, until Ctrl-C.

Stamps are the time of `/clock`, or of a clock with another name, if the server has one, as with `use_sim_time`;
otherwise the time of day. The server decides what that clock shows (`--stamps`). Messages before the first clock
message wait for it, but not longer than to the next flush: then they have time 0, the time that `use_sim_time` gives
before the first clock message. Otherwise a recording of a world that stands would be in memory alone, and lost with
a killed recorder. New topics are searched once a second, and the bag is flushed as often.
"""

from __future__ import annotations

import asyncio
import math
import signal
import time
from pathlib import Path

import orjson

from rosbridge_sim.cli.tools.schema import DefinitionSources, open_store
from rosbridge_sim.cli.tools.sync_commands import why_standing
from rosbridge_sim.cli.tools.text import note, put_json, put_progress
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, words
from rosbridge_sim.cli.tools.tool_subscription import clock_of, stamp_of
from rosbridge_sim.cli.tools.topic import is_ros2
from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.policy import Rule
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.stop_signals import on_stop_signals
from rosbridge_sim.shell.bags.bag import generation_of, open_bag
from rosbridge_sim.shell.bags.bag_recorder import FLUSH_PERIOD
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter

MAX_WAITING_MESSAGES = 10_000
"""Messages that wait for a first clock message until the next flush; if there are more, all get time 0."""


async def _default_name(bridge: Bridge) -> str:
    """Return the name that `rosbag record` or `ros2 bag record` gives a bag, by the server's generation."""
    return time.strftime("rosbag2_%Y_%m_%d-%H_%M_%S" if await is_ros2(bridge) else "%Y-%m-%d-%H-%M-%S.bag")


async def record(
    bridge: Bridge,
    file: str | None,
    patterns: tuple[str, ...],
    sources: DefinitionSources,
    count: int | None,
    *,
    patience: float | None,
    is_json: bool,
) -> None:
    """Record until Ctrl-C, another stop signal, the server's end, or the given number of messages.

    Args:
        file: path of the new bag; None chooses a name.
        patterns: patterns of topics; empty means all.
        sources: selects the known definitions; the ROS generation is that of the bag.
        count: number of messages; None means no end.
        patience: longest wait for a message [s]; None means no limit.
        is_json: print the result as JSON on stdout, not as a line for people.

    Raises:
        DocumentError: the bag cannot be written, or its file was deleted.
        RefusedError: the connection has ended, or no message came in time; the bag is finished in any case.
    """
    path = Path(file or await _default_name(bridge))
    ros = generation_of(path)
    store = open_store(DefinitionSources(sources.release, str(ros), sources.folders))
    writer = BagMessageWriter(open_bag(path), store)
    tape = _RecordingSession(bridge, writer, Rule(patterns))
    task = asyncio.current_task()
    assert task is not None

    def stop(_number: signal.Signals) -> None:
        task.cancel()

    with on_stop_signals(stop, tape.finish):
        try:
            note(f"recording into {path}; Ctrl-C ends it")
            await tape.run(count, patience)
        except asyncio.CancelledError:
            pass  # a stop signal is the usual end
        finally:
            tape.finish()
    if is_json:
        put_json({"file": str(path), "messages": writer.num_messages, "topics": tape.num_topics})
    else:
        note(f"{path}: {writer.num_messages:,} messages on {tape.num_topics:,} topics")


class _RecordingSession:
    """One recording: its progress and its topics."""

    def __init__(self, bridge: Bridge, writer: BagMessageWriter, rule: Rule) -> None:
        self.num_topics = 0
        self._bridge = bridge
        self._scribe = writer
        self._rule = rule
        self._wanted: dict[str, bool] = {}  # name -> True if it is recorded; False for an unknown type
        self._clock: str | None = None  # name of the clock's topic
        self._clock_ns: int | None = None
        self._waiting: list[tuple[str, bytes]] = []

    async def run(self, count: int | None, patience: float | None) -> None:
        """Record so many messages, or without an end; see `record`."""
        look_at = self._bridge.now()
        give_up_at = math.inf if patience is None else look_at + patience
        num_before = 0
        while count is None or self._scribe.num_messages + len(self._waiting) < count:
            if self._bridge.now() >= look_at:
                self._flush()  # before the question, because a server that hangs leaves that without an answer
                self._show()
                await self._look()
                look_at = self._bridge.now() + FLUSH_PERIOD
            frame = await self._bridge.receive(min(look_at, give_up_at))
            if frame is not None:
                self._hear(frame)
            num_now = self._scribe.num_messages + len(self._waiting)
            if patience is not None and num_now > num_before:
                num_before, give_up_at = num_now, self._bridge.now() + patience
            elif patience is not None and self._bridge.now() >= give_up_at:
                text = f"no message to record within {patience:g} s"
                if not self.num_topics:
                    raise RefusedError(f"{text}: none of the wanted topics is there")
                raise RefusedError(f"{text}{await why_standing(self._bridge)}")

    def _flush(self) -> None:
        """Write everything that has come to the disk."""
        self._release(0)
        self._scribe.flush()

    def finish(self) -> None:
        """Write the waiting messages, and the bag's end."""
        self._release(0)
        self._scribe.close()
        put_progress("")

    async def _look(self) -> None:
        """Subscribe to new topics."""
        values = await self._bridge.ask("topics")
        types = dict(zip(map(absolute, words(values, "topics")), words(values, "types"), strict=False))
        if self._clock is None:
            self._clock = clock_of(types)
            if self._clock is not None and not self._rule.admits(self._clock):
                await self._bridge.send("subscribe", topic=self._clock, type=types[self._clock])
        for topic, type_name in sorted(types.items(), key=lambda one: one[0] != self._clock):  # the clock comes first
            if topic in self._wanted or not self._rule.admits(topic):
                continue
            self._wanted[topic] = self._can(topic, type_name)
            if self._wanted[topic]:
                self.num_topics += 1
                await self._bridge.send("subscribe", topic=topic, type=type_name)

    def _can(self, topic: str, type_name: str) -> bool:
        """Return True if a topic can be written; otherwise print why not."""
        try:
            self._scribe.add(topic, type_name)
        except PeerError as error:
            note(f"{topic} is not recorded: {error}; --schema-path names folders with definitions")
            return False
        return True

    def _hear(self, frame: Frame) -> None:
        if frame.get("op") == "status" and frame.get("level") == "error":
            note(f"the server says: {frame.get('msg')}")
        if frame.get("op") != "publish":
            return
        topic, msg = absolute(str(frame.get("topic"))), frame.get("msg")
        if topic == self._clock:
            self._clock_ns = stamp_of(msg, "clock")
            self._release(self._clock_ns)
        if self._wanted.get(topic):
            body = orjson.dumps(msg)
            if self._clock is not None and self._clock_ns is None:
                self._waiting.append((topic, body))
                if len(self._waiting) >= MAX_WAITING_MESSAGES:
                    self._release(0)
            else:
                self._write(topic, body, time.time_ns() if self._clock_ns is None else self._clock_ns)

    def _release(self, stamp_ns: int) -> None:
        """Write the messages that have waited for the clock."""
        waiting, self._waiting = self._waiting, []
        for topic, body in waiting:
            self._write(topic, body, stamp_ns)

    def _write(self, topic: str, body: bytes, stamp_ns: int) -> None:
        try:
            self._scribe.write_json(topic, body, stamp_ns)
        except PeerError as error:
            self._wanted[topic] = False
            note(f"{topic} is not recorded any more: {error}")

    def _show(self) -> None:
        """Show the progress, for people."""
        at = "" if self._clock_ns is None else f"{self._clock_ns / 1e9:.1f} s, "
        size = self._scribe.num_bytes / 1e6
        put_progress(f"{at}{self._scribe.num_messages:,} messages, {size:,.1f} MB  (Ctrl-C ends it) ")
