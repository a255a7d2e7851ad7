"""Network replay: the world follows a client that publishes `/ReplayInfo_topic`.

The client that is followed is the *source*. It is followed until it stops to publish there, leaves, or a command ends
the replay. After such a command the source is ignored until it has been silent for a while.
"""

from __future__ import annotations

import logging
from collections.abc import Generator
from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import BodyLimits
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder
from rosbridge_sim.simulator.replays.replay_info import ReplayInfoPublisher
from rosbridge_sim.simulator.replays.state_machine import REPLAY_TABLE, ReplayEffect, ReplayEvent, ReplayState

SILENCE: Final = 50
"""Frames without a message after which an ignored source is heard again: its replay has ended, and the next message
begins another one. A far bridge never leaves, because many clients behind it appear as one."""

MAX_OBJECTS: Final = 10_000
"""Most objects in one message, as many as one step of the world is made for: to decode them takes 25 ms."""

MANY_OBJECTS: Final = 2_000
"""More objects are read in turns of their own: 10,000 take 25 ms to put together, and as long to check."""

_LIMITS: Final = BodyLimits(
    num_bytes=6 * 2**20, containers=5 * MAX_OBJECTS + 100, texts=24 * MAX_OBJECTS, values=24 * MAX_OBJECTS
)
"""Of a message with as many: each has 0.5 kB, 5 objects, 22 names and texts, and 20 values."""

_log = logging.getLogger("rosbridge_sim.replay")


class NetworkReplay:
    """Subscriber of `/ReplayInfo_topic`: moves the world by the messages of one client."""

    def __init__(self, process: ReplayProcess, info: ReplayInfoPublisher) -> None:
        """No client is followed yet.

        Args:
            process: changes its state with the messages; gets the effect IGNORE from here.
            info: recognises the messages that the simulator has published itself.
        """
        self._process, self._context = process, process.context
        self._info = info
        self._source: Participant | None = None
        self._ignored: Participant | None = None
        self._ignored_at = 0  # frame of the ignored client's last message
        process.effects[ReplayEffect.IGNORE] = self._ignore

    def bind(self, bindings: SubscribersServices) -> None:
        """Subscribe."""
        bindings.listen("ReplayInfo_topic", "ReplayInfo", self._hear, limits=_LIMITS)
        self._bindings = bindings

    @property
    def is_ignoring(self) -> bool:
        """True while a client's messages are ignored, because its replay was ended by a command."""
        return self._ignored is not None

    def settle(self, now: float) -> None:
        """End the replay if the source has stopped to publish; called after each frame."""
        if self._process.state is ReplayState.FOLLOWING and not self._publishes(self._source):
            self._lose(now)
        if self._ignored is not None:
            is_silent = self._context.world.frame - self._ignored_at >= SILENCE
            self._ignored = None if is_silent or not self._publishes(self._ignored) else self._ignored

    def on_leave(self, owner: Participant, now: float) -> None:
        """End the replay of a source that has left the bus.

        Args:
            owner: the participant that has left.
        """
        if owner is self._source and self._process.state is ReplayState.FOLLOWING:
            self._lose(now)
        if owner is self._ignored:
            self._ignored = None

    def resume(self) -> None:
        """Follow the client that publishes now, because a snapshot was taken while one was followed.

        The same one as before, where that is still there. With none the replay ends behind the next frame.
        """
        if self._publishes(self._source):
            return
        topic = self._context.bus.find_topic(self._bindings.topic("ReplayInfo_topic"))
        others = [] if topic is None else [one for one in topic.publishers if one is not self._context.participant]
        self._source = next(iter(others), None)

    def forget(self) -> None:
        """Ignore no client any longer, because the world has been reset."""
        self._ignored = None

    def _hear(self, message: Struct, sender: Participant, now: float) -> None:
        """Move the world by a client's message.

        Raises:
            FieldError: too many objects, or a number that is not finite or out of range. Nothing has changed.
        """
        if sender is self._context.participant or self._info.is_echo(message) or self._is_ignored(sender):
            return
        topic = self._bindings.topic("ReplayInfo_topic")
        num = len(message.npc_list) + len(message.pedestrian_list) + len(message.obstacle_list)
        if num > MAX_OBJECTS:
            raise FieldError(f"{topic}: expected at most {MAX_OBJECTS:,} objects in one message, got {num:,}")
        parts = self._follow(message, sender, topic, now)
        if num > MANY_OBJECTS:
            self._context.late_work.do(parts, sender, topic)
        else:
            for _ in parts:
                pass

    def _is_ignored(self, sender: Participant) -> bool:
        """Return whether messages of a client are ignored now; it is warned if so."""
        state = self._process.state
        why = REPLAY_TABLE[state][ReplayEvent.MESSAGE].why
        if not why and sender is self._ignored:
            why = "the replay was stopped"
            self._ignored_at = self._context.world.frame
        if not why and state is ReplayState.FOLLOWING and sender is not self._source:
            why = "another client replays already"
        if why:
            self._context.warnings.warn(sender, f"{self._bindings.topic('ReplayInfo_topic')} is ignored: {why}")
        return bool(why)

    def _follow(self, message: Struct, sender: Participant, topic: str, now: float) -> Generator[None, None, None]:
        """Read a message and move the world by it, in parts; see `LateWork`."""
        reading = RecordingBuilder(topic, self._context.convert)
        reading.take_pedals(message, (0, 0))
        reading.take_objects(message, (0, 0))
        yield
        recording = reading.finish()
        if recording.notes:
            raise FieldError(f"{topic}: {recording.notes[0]}")
        yield
        self._context.interfaces.check_open()  # the world may have failed meanwhile
        if self._is_ignored(sender):  # a command, or another client, may have come before
            return
        if self._process.state is ReplayState.SIMULATING:
            _log.info("%s replays a recording over %s", sender.name, topic)
        self._source = sender
        self._process.playback.choose(recording)
        self._process.happen(ReplayEvent.MESSAGE, now)

    def _publishes(self, owner: Participant | None) -> bool:
        """Return whether a client still publishes what it replays."""
        topic = self._context.bus.find_topic(self._bindings.topic("ReplayInfo_topic"))
        return topic is not None and owner in topic.publishers

    def _lose(self, now: float) -> None:
        name = "a client of the snapshot" if self._source is None else self._source.name
        _log.info("%s publishes no ReplayInfo any longer: the replay has ended", name)
        self._source = None
        self._process.happen(ReplayEvent.LOST, now)

    def _ignore(self, now: float) -> None:
        del now
        self._ignored, self._source = self._source, None
        self._ignored_at = self._context.world.frame
