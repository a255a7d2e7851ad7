"""A drive that is followed: figures of each frame, the user's own limits, and the topics that they read."""

from __future__ import annotations

import logging

from rosbridge_sim.campaign_runs.outcome import Outcome
from rosbridge_sim.campaign_runs.roads_around import find_roads
from rosbridge_sim.campaigns.campaign import Campaign, names_of
from rosbridge_sim.campaigns.own_limits import OwnLimits
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.campaigns.topic_values import TopicValues
from rosbridge_sim.campaigns.trace import TraceRecorder
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.state.world import World

_log = logging.getLogger("rosbridge_sim.campaign")


class WatchedDrive:
    """One drive, followed frame by frame.

    Attributes:
        name: as a node of the bus.
        outcome: of the drive, so far.
    """

    name = "/campaign"

    def __init__(self, campaign: Campaign, run: Run) -> None:
        own = OwnLimits(campaign.limits)
        self._topics = TopicValues(campaign.fields)
        self._recorder = TraceRecorder(campaign.document.seconds, campaign.end_when, names_of(run), own, self._topics)
        self._heard: set[str] = set()
        self.outcome = Outcome(self._recorder.trace, own)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)

    def listen(self, bus: Bus) -> None:
        """Subscribe to the topics of the campaign's expressions, now or when they are there.

        Args:
            bus: of the simulator; it calls from now on.
        """
        if not self._topics.topics:
            return
        for topic in list(bus.topics.values()):
            self._look(bus, topic)
        bus.on_topic.append(lambda topic: self._look(bus, topic))

    def _look(self, bus: Bus, topic: Topic) -> None:
        if topic.name not in self._topics.topics or topic.name in self._heard or not topic.is_settled:
            return
        self._heard.add(topic.name)  # before the subscription, because the bus reports that, too
        bus.subscribe(self, topic.name, self._take_message)
        for message in topic.latched:
            self._topics.take(topic.name, message.value)

    def _take_message(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self._topics.take(topic.name, message.value)

    def take(self, world: World) -> bool:
        """Note a frame; return whether the drive has ended."""
        try:
            return self._recorder.take(world)
        except DocumentError as error:
            self.outcome.error = str(error)
            return True

    def finish(self, world: World) -> None:
        """Note the state at the end.

        Args:
            world: after its last frame.
        """
        outcome = self.outcome
        outcome.state_hash = world.digest()
        if outcome.trace.rows:
            outcome.roads = find_roads(world, outcome.trace)
