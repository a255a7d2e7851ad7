"""The component of `/sim/score`, topic and service: what the driver of each ego is judged by.

The world keeps scores from the first request until its reset. A request is a subscription to the topic, a call of the
service, or `--score` at the start. Subscribers of all topics (far bridges, recorders) make no request; they get the
topic once it is there. After a reset, scores begin again at frame 0 with `--score`, or if the topic has a subscriber.

The component holds no state: the figures are columns of the world. What they mean is in `world.scoring`. The verdict
of a story is that of `Stories`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any, Final

from rosbridge_sim.graph.topics_services import Call, Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import asdict
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.world.scoring import Score, read_score

SCORE: Final = "/sim/score"

NO_TIME: Final = -1.0
"""A time to collision that there is not [s]: JSON has no infinity."""

_log = logging.getLogger("rosbridge_sim.morai")


class Scores(Component):
    """The component of scores."""

    def __init__(self, context: SimulatorContext, verdict: Callable[[], Struct], *, is_always: bool = False) -> None:
        """Publish and offer nothing yet.

        Args:
            verdict: makes the verdict of the loaded story.
            is_always: keep scores from frame 0 on, whether anybody asks or not.
        """
        self._context = context
        self._verdict = verdict
        self._is_always = is_always
        self._publisher: PeriodicPublisher | None = None
        self._make_message = context.maker("rosbridge_sim_msgs/Scores", "header scores verdict")
        self._make_score = context.maker(
            "rosbridge_sim_msgs/EgoScore",
            "unique_id since_frame distance collisions collision_ids red_lights stop_lines lane_invasions "
            "off_road_time is_off_road time_to_collision min_time_to_collision lane_offset mean_lane_offset "
            "max_lane_offset jerk max_jerk rms_jerk lateral_accel max_lateral_accel rms_lateral_accel",
        )
        context.bus.on_topic.append(self._note_subscriber)
        context.hooks.on_reset.append(self._start_if_wanted)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topics that exist once, not for each ego."""
        self._publisher = publishers.add(SCORE, "rosbridge_sim_msgs/Scores", self._message, is_shown_in_pause=True)
        self._start_if_wanted()

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide(SCORE[1:], "rosbridge_sim_msgs/Score", self._tell)

    def _note_subscriber(self, topic: Topic) -> None:
        """Keep scores from now on if a client has subscribed to this topic."""
        if self._publisher is not None and topic is self._publisher.topic:
            self._start_if_wanted()

    def _start_if_wanted(self) -> None:
        """Keep scores from this frame on if a client wants them."""
        world = self._context.world
        if world.is_scoring:
            return
        topic = None if self._publisher is None else self._publisher.topic
        subscriptions = [] if topic is None else topic.subscriptions
        if self._is_always or any(not (one.is_idle or one.is_general) for one in subscriptions):
            world.start_scoring()
            _log.info("scores are kept from frame %d on", world.frame)

    def _message(self) -> Struct | None:
        """Make the message; None while no scores are kept."""
        self._start_if_wanted()  # the world may have become one of before the first subscription
        world = self._context.world
        if not world.is_scoring:
            return None
        return self._make_message(self._context.convert.header(world.frame), self._scores(), self._verdict())

    def _tell(self, call: Call, _now: float) -> None:
        request: Any = call.request
        world = self._context.world
        message = ""
        if not world.is_scoring:
            world.start_scoring()
            message = f"scores are kept from now on, frame {world.frame}"
            _log.info("scores are kept from frame %d on", world.frame)
        scores = self._scores()
        if request.reset:
            world.reset_scores()
        call.respond(result=True, message=message, scores=scores, verdict=self._verdict())

    def _scores(self) -> list[Struct]:
        """Make the scores of all egos, in their order."""
        world, egos = self._context.world, self._context.egos
        numbers = {ego.uid: ego.index for ego in egos}
        return [self._score(ego.index, read_score(world, ego.row), numbers) for ego in egos if ego.is_there]

    def _score(self, index: int, score: Score, numbers: dict[int, int]) -> Struct:
        """Make one score.

        Args:
            numbers: by the id in the world, the number under which clients know an ego.
        """
        figures = asdict(score)  # in the order of the message
        figures["contact_ids"] = [numbers.get(uid, uid) for uid in score.contact_ids]
        for name in ("time_to_collision", "min_time_to_collision"):
            figures[name] = figures[name] if math.isfinite(figures[name]) else NO_TIME
        return self._make_score(index, *figures.values())
