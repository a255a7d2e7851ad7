"""Network replay: the world follows a client that publishes `/ReplayInfo_topic`.

The client that is followed is the *source*. It is followed until it stops to publish there, leaves, or a command ends
the replay. After such a command the source is ignored until it has been silent for a while.
"""

from __future__ import annotations

import logging
from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.replays.playback import Playback
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder
from rosbridge_sim.simulator.replays.replay_info import ReplayInfoPublisher
from rosbridge_sim.simulator.replays.state_machine import REPLAY_TABLE, ReplayEffect, ReplayEvent, ReplayState
from rosbridge_sim.simulator.scene.scene_limits import MAX_ENTITIES

__all__ = ["NetworkReplay"]

SILENCE: Final = 50
"""Frames without a message after which an ignored source is heard again: its replay has ended, and the next message
begins another one. A far bridge never leaves, because many clients behind it appear as one."""

_log = logging.getLogger("rosbridge_sim.replay")


class NetworkReplay:
    """Subscriber of `/ReplayInfo_topic`: moves the world by the messages of one client."""

    def __init__(
        self,
        context: SimulatorContext,
        process: ReplayProcess,
        playback: Playback,
        info: ReplayInfoPublisher,
    ) -> None:
        """No client is followed yet.

        Args:
            process: changes its state with the messages; gets the effect IGNORE from here.
            playback: shows the messages.
            info: recognises the messages that the simulator has published itself.
        """
        self._process = process
        self._playback = playback
        self._info = info
        self._context = context
        self._source: Participant | None = None
        self._ignored: Participant | None = None
        self._ignored_at = 0  # frame of the ignored client's last message
        process.effects[ReplayEffect.IGNORE] = self._ignore

    def bind(self, bindings: SubscribersServices) -> None:
        """Subscribe.

        Args:
            bindings: take the subscription.
        """
        bindings.listen("ReplayInfo_topic", "ReplayInfo", self._hear)
        self._bindings = bindings

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
        topic, state = self._bindings.topic("ReplayInfo_topic"), self._process.state
        why = REPLAY_TABLE[state][ReplayEvent.MESSAGE].why
        if sender is self._context.participant or self._info.is_echo(message):
            return
        if not why and sender is self._ignored:
            why = "the replay was stopped"
            self._ignored_at = self._context.world.frame
        if not why and state is ReplayState.FOLLOWING and sender is not self._source:
            why = "another client replays already"
        if why:
            self._context.warnings.warn(sender, f"{topic} is ignored: {why}")
            return
        num = len(message.npc_list) + len(message.pedestrian_list) + len(message.obstacle_list)
        if num > MAX_ENTITIES:
            raise FieldError(f"{topic}: the world holds {MAX_ENTITIES:,} at most, got {num:,} objects")
        reading = RecordingBuilder(topic, self._context.convert)
        reading.take_pedals(message, (0, 0))
        reading.take_objects(message, (0, 0))
        recording = reading.finish()
        if recording.notes:
            raise FieldError(f"{topic}: {recording.notes[0]}")
        if state is ReplayState.SIMULATING:
            _log.info("%s replays a recording over %s", sender.name, topic)
        self._source = sender
        self._playback.choose(recording)
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
