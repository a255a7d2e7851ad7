"""The recorder of `--record`: a participant of the bus that writes messages into a bag.

Without patterns it records the simulator's state and its commands: all topics that the simulator publishes or
subscribes to. A topic is only known when a client advertises or subscribes, so the bus reports both events. Each
message is stamped with simulation time.
A full disk ends the recording and nothing else. A deleted or moved file does the same, and is detected at the next
flush. The world goes on, and the log has a line about it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

from rosbridge_sim.errors import DocumentError, EncodingError, PeerError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Rule
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.bags.bag import BagGoneError
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter

MAX_TOPICS = 10_000
"""Largest number of topics in one recording. A recorded topic is never forgotten, so with `--record-topics '*'` a
client that advertises new names in a loop would fill the memory."""

FLUSH_PERIOD = 1.0
"""Time between two flushes [s]: a crash loses at most this much."""

_log = logging.getLogger("rosbridge_sim.recording")


class BagRecorder(Participant):
    """A `Participant` of the bus that writes a bag.

    Attributes:
        name: its name in rosapi's lists.
        has_failed: the recording has ended early, or without its index; the log says why.
    """

    name = "/recorder"

    def __init__(
        self,
        bus: Bus,
        writer: BagMessageWriter,
        path: Path,
        *,
        simulator: Participant | None = None,
        patterns: tuple[str, ...] = (),
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        """Start to record; `stop` ends it.

        Args:
            writer: writer for an empty bag.
            path: path of the bag, for the log.
            simulator: without patterns, its topics and commands are recorded; None records all topics.
            loop: runs the timer for flushing.
        """
        self.writer = writer
        self.has_failed = False
        self._bus = bus
        self._path = path
        self._simulator = simulator
        self._rule = Rule(patterns) if patterns else None
        self._loop = loop
        self._seen: set[Topic] = set()
        self._is_full = False  # the limit of topics is reached, and a warning was logged
        self._given_up: set[Topic] = set()
        self._is_on = True
        self._timer = loop.call_later(FLUSH_PERIOD, self._tick)
        for topic in list(bus.topics.values()):
            self._look(topic)
        bus.on_topic.append(self._look)
        _log.info("recording into %s", path)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus to the recorder."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)

    def stop(self) -> None:
        """Finish the bag. A second call does nothing."""
        if self._is_on:
            self._leave()
            self.has_failed = True
            try:
                self.writer.close()
            except BagGoneError as error:
                _log.error("the recording has ended: %s", error)
            except DocumentError as error:
                _log.error("the recording has no index: %s; `rosbridge-sim bag repair` makes one", error)
            except Exception as error:  # noqa: BLE001 - an internal error, or one of the writer
                self._bus.guard.note("the end of the recording", error)
                self.writer.abort()
            else:
                self.has_failed = False
                _log.info("recorded %d messages into %s", self.writer.num_messages, self._path)

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the recording ends, and the file stays as it is."""
        if not self._is_on:
            return
        self.has_failed = True
        _log.error(
            "the recording ended by an internal error; `rosbridge-sim bag repair` makes it readable", exc_info=error
        )
        try:
            self._leave()
        finally:
            self.writer.abort()

    # Subscribing

    def _look(self, topic: Topic) -> None:
        """Subscribe to a topic with a publisher or subscriber, if it should be recorded and is not yet."""
        if topic in self._seen or not self._is_on or not topic.is_settled or not self._is_wanted(topic):
            return
        if len(self._seen) >= MAX_TOPICS:
            if not self._is_full:
                self._is_full = True
                _log.warning(
                    "%s: new topics are not recorded, because %s topics are; choose some with --record-topics",
                    self._path,
                    MAX_TOPICS,
                )
            return
        self._seen.add(topic)  # before the subscription, because the bus reports that, too
        if self._guard(lambda: self.writer.add(topic.name, topic.type.name, is_latching=topic.is_latching), topic):
            self._bus.subscribe(self, topic.name, self._write, is_general=self._rule is None, is_recording=True)
            for message in topic.latched:
                try:
                    self._write(topic, message, self, 0.0)
                except EncodingError as error:
                    self._bus.guard.note_encoding(topic.name, error)

    def _is_wanted(self, topic: Topic) -> bool:
        if self._rule is not None:
            return self._rule.admits(topic.name)
        simulator = self._simulator
        return (
            simulator is None
            or simulator in topic.publishers
            or any(subscription.owner is simulator for subscription in topic.subscriptions)
        )

    # Writing

    def _write(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        if self._is_on:  # an earlier message of the same delivery may have ended the recording
            time_ns = self._bus.time_ns
            self._guard(lambda: self.writer.write(topic.name, message, time_ns), topic)

    def _guard(self, work: Callable[[], None], topic: Topic | None = None) -> bool:
        """Call a function; return True if it succeeded. Failures go only to the log.

        Raises:
            EncodingError: a message cannot be written because of an internal error, which its publisher must be told.
        """
        try:
            work()
        except EncodingError:
            raise
        except PeerError as error:
            if topic is not None and topic not in self._given_up:
                self._given_up.add(topic)
                _log.warning("topic %s is recorded only in part, or not at all: %s", topic.name, error)
            return False
        except DocumentError as error:
            self.has_failed = True
            self._leave()
            self.writer.abort()
            advice = "" if isinstance(error, BagGoneError) else "; `rosbridge-sim bag repair` makes it readable"
            _log.error("the recording has ended: %s%s", error, advice)
            return False
        return True

    def _tick(self) -> None:
        self._timer = self._loop.call_later(FLUSH_PERIOD, self._tick)
        try:
            self._guard(self.writer.flush)
        except Exception as error:  # noqa: BLE001 - an internal error, or one of the writer
            self._bus.guard.blame(self, error)

    def _leave(self) -> None:
        self._is_on = False
        self._timer.cancel()
        self._bus.on_topic.remove(self._look)
        self._bus.leave(self, self._loop.time())
