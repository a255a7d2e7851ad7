"""A drive that is followed: figures of each frame, the user's own limits, and the topics that they read."""

from __future__ import annotations

import logging
from typing import Final

import numpy as np

from rosbridge_sim.campaign_runs.outcome import Outcome
from rosbridge_sim.campaigns.campaign import Campaign, names_of
from rosbridge_sim.campaigns.own_limits import OwnLimits
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.campaigns.topic_values import TopicValues
from rosbridge_sim.campaigns.trace import Trace, TraceRecorder
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World

_log = logging.getLogger("rosbridge_sim.campaign")


class WatchedDrive(Participant):
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


REACH: Final = 150.0
"""Lanes within this distance of the last place are drawn [m]."""

STEP: Final = 4.0
"""Distance of the points of a drawn lane [m]."""

MAX_LANES: Final = 60
"""Most lanes of a picture, the nearest ones."""


def find_roads(world: World, trace: Trace) -> list[list[tuple[float, float]]]:
    """Return the lines of the lanes near the last place of the ego.

    Args:
        world: has the lanes.
        trace: of at least one frame.

    Returns:
        Points (x, y) of each line [m].
    """
    x, y = trace.rows[-1][1:3]
    found: list[tuple[float, list[tuple[float, float]]]] = []
    for line in world.roads.derived(_Lines).lines:
        away = np.hypot(line[:, 0] - x, line[:, 1] - y)
        near = away <= REACH
        if near.any():
            found.append((float(away.min()), [(px, py) for px, py in line[near].round(1).tolist()]))
    return [line for _, line in sorted(found)[:MAX_LANES]]


class _Lines:
    """The lines of all lanes of a map, in steps of some metres.

    Attributes:
        lines: (k, 2) of each lane [m].
    """

    def __init__(self, roads: Roads) -> None:
        num = np.maximum((roads.length / STEP).astype(np.int64), 1) + 1
        lane = np.arange(len(roads)).repeat(num)
        place = np.arange(len(lane)) - (num.cumsum() - num).repeat(num)
        points = roads.at(lane, place / (num - 1).repeat(num) * roads.length[lane])[0]
        self.lines: list[FloatArray] = np.split(points[:, :2], num.cumsum()[:-1]) if len(roads) else []
