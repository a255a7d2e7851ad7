"""The publisher of the plans in a recording, beside the motion that the replay shows.

It is a participant of its own, and not the simulator, because viewers draw what programs publish. A topic that somebody
publishes here already is left to them: the simulator's own topics, and those of a program that plans anew.
"""

from __future__ import annotations

import logging
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.simulator.bus.guest_publisher import GuestPublisher
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.replays.playback import Playback
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recorded_plans import RecordedPlan
from rosbridge_sim.simulator.replays.state_machine import ReplayState

__all__ = ["ReplayedPlans"]

LONGEST_NS: Final = 1_000_000_000
"""A longer way from one position to the next is a jump [ns]: then the last message of each topic is shown alone."""

_log = logging.getLogger("rosbridge_sim.replay")


class ReplayedPlans:
    """Publisher of recorded plans; the world does not know of it, and neither do snapshots."""

    def __init__(self, context: SimulatorContext, process: ReplayProcess, playback: Playback) -> None:
        """Publish nothing yet.

        Args:
            process: whether a recording moves the world.
            playback: the recording, and the position in it.
        """
        self._publisher = GuestPublisher(context.bus, "/replay")
        self._process = process
        self._playback = playback
        self._recording = Recording("")
        self._topics: list[tuple[RecordedPlan, Topic]] = []
        self._shown_ns = -LONGEST_NS

    def settle(self, now: float) -> None:
        """Publish what belongs to the position that the world shows; called after each frame and each command."""
        is_shown = self._process.state in {ReplayState.REPLAYING, ReplayState.AT_END}
        recording = self._playback.recording if is_shown else Recording("")
        if recording.plans != self._recording.plans:
            self._begin(recording, now)
        if not self._topics:
            return
        position = self._playback.shown_ns
        is_jump = not 0 <= position - self._shown_ns < LONGEST_NS
        for plan, topic in self._topics:
            raws = plan.last(position) if is_jump else plan.between(self._shown_ns, position)
            for raw in raws:
                self._publish(plan, topic, raw, now)
        self._shown_ns = position

    def _begin(self, recording: Recording, now: float) -> None:
        """Take another recording: withdraw the topics of the last one, and offer those of this one."""
        self._publisher.leave(now)
        self._recording, self._topics, self._shown_ns = recording, [], -LONGEST_NS
        for plan in recording.plans:
            topic = self._publisher.offer(plan.topic, plan.type_name)
            if topic is not None:
                self._topics.append((plan, topic))

    def _publish(self, plan: RecordedPlan, topic: Topic, raw: bytes, now: float) -> None:
        try:
            value = plan.decode(raw)
        except DocumentError as error:
            _log.warning("a message of %s in the recording is left out: %s", plan.topic, error)
        else:
            self._publisher.publish(topic, plan.type_name, value, now)
