"""Transforms on request, by all three routes; the test sets time and transforms."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.actionlib import ActionlibStatus
from rosbridge_sim.graph.actions import Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.tf.buffer import Transform
from rosbridge_sim.graph.tf.web_republisher import (
    DEFAULT_TIMEOUT,
    MAX_FRAME_PAIRS,
    MAX_STREAMS,
    OWN_PAIRS,
    OWN_STREAMS,
    WebRepublisher,
)
from rosbridge_sim.graph.topics_services import Answer, Topic
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus, make_peer

FRAME = 0.02
TF = "tf2_msgs/TFMessage"


def at(x: float, turn: float = 0.0) -> Transform:
    """A place on the x axis, looking elsewhere."""
    return Transform(x, 0.0, 0.0, 0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2))


def written(parent: str, child: str, pose: Transform, secs: float = 0.0) -> dict[str, object]:
    """A transform as a client writes it."""
    x, y, z, *q = pose
    stamp = {"secs": int(secs), "nsecs": round(secs % 1 * 1e9)}
    rotation = dict(zip("xyzw", q, strict=True))
    return {
        "header": {"frame_id": parent, "stamp": stamp},
        "child_frame_id": child,
        "transform": {"translation": {"x": x, "y": y, "z": z}, "rotation": rotation},
    }


class RepublisherClient(Participant):
    """Somebody on the bus."""

    def __init__(self, scene: RepublisherFixture, name: str = "/somebody") -> None:
        self.name = name
        self.told: list[tuple[str, str]] = []
        self.heard: list[tuple[float, dict[str, Any]]] = []
        self.outcomes: list[GoalOutcome] = []
        self._scene = scene

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))

    def hear(self, _topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append((self._scene.seconds, json.loads(message.json)))

    def publish(self, *transforms: dict[str, object], topic: str = "/tf") -> None:
        bus = self._scene.bus
        channel = bus.advertise(self, topic, TF)
        value = channel.type.check({"transforms": list(transforms)}, bus.stamp_ns)
        bus.publish(self, channel, Message(channel.type, value), self._scene.now)

    def ask(self, *sources: str, target: str = "map", **fields: Any) -> str:  # noqa: ANN401 - fields of the request
        """The topic that the service gives."""
        answer = self.call(*sources, target=target, **fields)
        assert isinstance(answer.values, Message), answer.values
        name: str = answer.values.value.topic_name
        return name

    def call(self, *sources: str, target: str = "map", **fields: Any) -> Answer:  # noqa: ANN401 - the same
        answers: list[Answer] = []
        args = {"source_frames": list(sources), "target_frame": target, **fields}
        self._scene.bus.call(self, "/republish_tfs", args, answers.append, now=self._scene.now)
        return answers[0]

    def listen(self, name: str) -> None:
        """Subscribe, and hear what is latched."""
        subscription = self._scene.bus.subscribe(self, name, self.hear)
        for message in subscription.topic.latched:
            self.hear(subscription.topic, message, self, 0.0)

    def send(self, *sources: str, target: str = "map", **fields: Any) -> Goal | None:  # noqa: ANN401 - the same
        """A goal by the ROS 2 action; feedback goes where messages go."""

        def hear(message: Message) -> None:
            self.heard.append((self._scene.seconds, json.loads(message.json)))

        args = {"source_frames": list(sources), "target_frame": target, **fields}
        return self._scene.bus.actions.send(self, "/tf2_web_republisher", args, self.outcomes.append, hear)

    def leave(self) -> None:
        self._scene.bus.leave(self, self._scene.now)

    def places(self) -> list[tuple[str, float]]:
        """(source, x) of all that was told, in its order."""
        return [
            (transform["child_frame_id"], transform["transform"]["translation"]["x"])
            for _, message in self.heard
            for transform in message["transforms"]
        ]

    def times(self) -> list[float]:
        """When something was told."""
        return [seconds for seconds, _ in self.heard]


class RepublisherFixture:
    """A bus with a republisher, and somebody who publishes transforms."""

    def __init__(self) -> None:
        self.bus = make_bus()
        self.now = 1000.0
        self.is_stamp_standing = False
        self.world = RepublisherClient(self, "/world")
        self.republisher = WebRepublisher(self.bus)

    def somebody(self) -> RepublisherClient:
        return RepublisherClient(self)

    @property
    def seconds(self) -> float:
        return self.bus.time_ns / 1e9

    def _set_time(self, time_ns: int) -> None:
        self.bus.time_ns = time_ns
        if not self.is_stamp_standing:
            self.bus.stamp_ns = time_ns

    @property
    def is_awake(self) -> bool:
        """Whether transforms are published for the republisher's sake."""
        return self.bus.topics["/tf"].has_listener

    def frame(self, pose: Transform | None = None, parent: str = "map", child: str = "base_link") -> None:
        """One frame of the world: time passes, then its transform is published."""
        self._set_time(self.bus.time_ns + 20_000_000)
        self.now += FRAME
        if pose is not None:
            self.world.publish(written(parent, child, pose, self.seconds))

    def wait(self, seconds: float, *, is_clock_standing: bool = False) -> int:
        """Let time pass without a transform, with turns just when they are asked for; how many."""
        end, num = self.now + seconds, 0
        start, stamp = self.now, self.bus.time_ns
        while (due := self.republisher.next_due(self.now)) is not None and due <= end:
            self.now = max(due, self.now)
            if not is_clock_standing:
                self._set_time(stamp + round((self.now - start) * 1e9))
            self.republisher.advance(self.now)
            num += 1
            assert num < 1000, "it spins"
        self.now = end
        if not is_clock_standing:
            self._set_time(stamp + round(seconds * 1e9))
        return num


# What is told


def test_rate_counts_in_simulated_time_regardless_of_stamps() -> None:
    scene = RepublisherFixture()
    scene.is_stamp_standing = True
    client = scene.somebody()
    client.listen(client.ask("base_link", rate=10.0))
    for i in range(20):
        scene.frame(at(float(i)))
    assert len(client.heard) == 5, "once in each tenth of a second from 0.02 s to 0.40 s"


def test_answer_names_a_topic_that_has_the_known_transforms_latched() -> None:
    scene = RepublisherFixture()
    scene.frame(at(3.0, 0.5))
    scene.world.publish(written("/base_link", "/lidar", at(1.5)), topic="/tf_static")
    who = scene.somebody()
    name = who.ask("/lidar", "base_link", "nobody", target="/map", rate=10.0)
    who.listen(name)
    ((_, message),) = who.heard
    lidar, base = message["transforms"]
    assert base == {
        "header": {"seq": 0, "stamp": {"secs": 0, "nsecs": 20_000_000}, "frame_id": "map"},
        "child_frame_id": "base_link",
        "transform": written("", "", at(3.0, 0.5))["transform"],
    }
    assert lidar["child_frame_id"] == "lidar"
    shift, rotation = lidar["transform"]["translation"], lidar["transform"]["rotation"]
    assert shift == pytest.approx({"x": 3.0 + 1.5 * math.cos(0.5), "y": 1.5 * math.sin(0.5), "z": 0.0})
    assert rotation == pytest.approx({"x": 0.0, "y": 0.0, "z": math.sin(0.25), "w": math.cos(0.25)})


def test_transforms_are_looked_up_in_both_directions() -> None:
    scene = RepublisherFixture()
    scene.frame(at(3.0, math.pi / 2))
    who = scene.somebody()
    who.listen(who.ask("map", target="base_link"))
    shift = who.heard[0][1]["transforms"][0]["transform"]["translation"]
    assert shift == pytest.approx({"x": 0.0, "y": 3.0, "z": 0.0}, abs=1e-12)


def test_transform_is_sent_again_only_above_the_thresholds() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("base_link", "fixed", trans_thres=0.5, angular_thres=0.1)
    scene.world.publish(written("map", "fixed", at(7.0)), topic="/tf_static")
    for pose in (at(0.0), at(0.4), at(0.5), at(0.6), at(0.6, 0.09), at(0.6, 0.11), at(0.6, 0.2), at(0.6, 0.22)):
        scene.frame(pose)
    assert who.places() == [("fixed", 7.0), ("base_link", 0.0), *[("base_link", 0.6)] * 3]
    turns = [2 * math.asin(m["transforms"][0]["transform"]["rotation"]["z"]) for _, m in who.heard[2:]]
    assert turns == pytest.approx([0.0, 0.11, 0.22])


def test_zero_thresholds_send_every_change_and_nothing_else() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("base_link")
    for x in (0.0, 0.0, 1e-9, 1e-9, 0.0):
        scene.frame(at(x))
    assert who.places() == [("base_link", 0.0), ("base_link", 1e-9), ("base_link", 0.0)]


@pytest.mark.parametrize(("rate", "frames"), [(10.0, (1, 5, 10, 15, 20)), (7.0, (1, 8, 15, 22)), (50.0, range(1, 24))])
def test_rate_is_kept_in_simulated_time(rate: float, frames: range) -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("base_link", rate=rate)
    for i in range(23):
        scene.now += 7.0  # what the wall clock says does not matter
        scene.frame(at(float(i)))
    assert who.times() == pytest.approx([i * FRAME for i in frames])


def test_frame_that_appears_later_is_sent_then() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("camera", rate=1.0)
    scene.frame(at(1.0))
    assert who.heard == []
    scene.frame(at(2.0), "base_link", "camera")
    assert who.places() == [("camera", 3.0)]


def test_source_requested_twice_is_sent_once() -> None:
    scene = RepublisherFixture()
    scene.frame(at(1.0))
    who = scene.somebody()
    who.send("base_link", "/base_link")
    assert who.places() == [("base_link", 1.0)]


def test_last_change_of_an_interval_is_sent_in_the_next_one_without_new_input() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("base_link", rate=10.0)
    for x in (1.0, 2.0, 3.0):
        scene.frame(at(x))
    assert who.places() == [("base_link", 1.0)]
    scene.wait(0.2)
    assert who.places() == [("base_link", 1.0), ("base_link", 3.0)]
    assert who.times()[-1] == pytest.approx(0.1)
    assert scene.republisher.next_due(scene.now) is None


def test_nothing_is_sent_and_no_timer_spins_while_time_stands_still() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("base_link", rate=10.0)
    scene.frame(at(1.0))
    scene.frame(at(2.0))
    assert scene.wait(10.0, is_clock_standing=True) == 1
    assert scene.republisher.next_due(scene.now) is None
    for _ in range(3):
        scene.frame()
    scene.frame(at(2.0))
    assert who.places() == [("base_link", 1.0), ("base_link", 2.0)]


def test_static_frames_published_earlier_are_known() -> None:
    scene = RepublisherFixture()
    bus = make_bus()
    scene.bus = bus
    bus.advertise(scene.world, "/tf_static", TF, depth=1, key="latched")
    scene.world.publish(written("map", "house", at(4.0)), topic="/tf_static")
    scene.republisher = WebRepublisher(bus)
    who = scene.somebody()
    who.send("house")
    assert who.places() == [("house", 4.0)]


def test_invalid_transform_is_reported_to_its_sender_and_valid_ones_are_used() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("a", "b", "c")
    broken = written("map", "b", Transform(0, 0, 0, 0, 0, 0, 0))
    with pytest.raises(GraphError, match=r"map -> b: rotation \(0.0, 0.0, 0.0, 0.0\) is not an orientation"):
        scene.world.publish(written("map", "a", at(1.0)), broken, written("map", "c", at(2.0)))
    assert who.places() == [("a", 1.0), ("c", 2.0)]


# For whom others publish


def test_idle_republisher_does_not_trigger_publishing() -> None:
    scene = RepublisherFixture()
    who, other = scene.somebody(), scene.somebody()
    assert not scene.is_awake
    goal = who.send("base_link")
    assert goal is not None
    name = other.ask("base_link")
    assert scene.is_awake
    goal.cancel()
    assert scene.is_awake
    other.leave()
    assert not scene.is_awake
    assert scene.bus.topics[name].publishers == {}
    assert scene.republisher.next_due(scene.now) is None


def test_transforms_of_an_on_demand_publisher_are_dropped_when_it_pauses() -> None:
    scene = RepublisherFixture()
    scene.bus.advertise(scene.world, "/tf", TF, is_on_demand=True)
    other = scene.somebody()
    other.publish(written("map", "house", at(9.0)))  # once, and for whoever comes
    goal = other.send("base_link", "house")
    assert goal is not None
    scene.frame(at(1.0))
    goal.cancel()
    who = scene.somebody()
    who.send("base_link", "house")
    assert who.places() == [("house", 9.0)]
    scene.frame(at(5.0))
    assert who.places() == [("house", 9.0), ("base_link", 5.0)]


# Topics of one's own


def test_each_request_has_its_own_topic() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    names = [who.ask("base_link"), who.ask("base_link")]
    assert names == ["/tf2_web_republisher/tf_repub_1", "/tf2_web_republisher/tf_repub_2"]
    with pytest.raises(GraphError, match="alone"):
        scene.bus.advertise(who, names[0], "tf2_web_republisher/TFArray")


def test_new_subscriber_of_a_topic_gets_all_known_transforms() -> None:
    scene = RepublisherFixture()
    scene.world.publish(written("map", "house", at(9.0)), topic="/tf_static")
    first, second = scene.somebody(), scene.somebody()
    name = first.ask("house", "base_link")
    for x in (1.0, 2.0):
        scene.frame(at(x))
    first.listen(name)
    assert first.places() == [("house", 9.0), ("base_link", 2.0)]
    scene.frame(at(3.0))
    assert first.places()[2:] == [("base_link", 3.0)]
    second.listen(name)
    scene.frame(at(4.0))
    assert second.places()[-2:] == [("house", 9.0), ("base_link", 4.0)]


@pytest.mark.parametrize(("asked", "seconds"), [({"secs": 2, "nsecs": 0}, 2.0), (None, DEFAULT_TIMEOUT)])
def test_topic_without_subscribers_ends_after_its_time_out(asked: dict[str, int] | None, seconds: float) -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    name = who.ask("base_link", timeout=asked)
    scene.wait(seconds - 0.1)
    assert scene.bus.topics[name].publishers
    scene.wait(0.4)
    assert not scene.bus.topics[name].publishers
    assert not scene.is_awake
    assert scene.republisher.next_due(scene.now) is None


def test_subscribed_topic_stays_until_its_time_out_after_the_last_subscriber() -> None:
    scene = RepublisherFixture()
    who, other = scene.somebody(), scene.somebody()
    name = who.ask("base_link", timeout={"secs": 1, "nsecs": 500_000_000})
    who.listen(name)
    scene.wait(60.0)
    other.listen(name)
    who.leave()
    scene.wait(60.0)
    assert scene.bus.topics[name].publishers
    other.leave()
    scene.wait(1.0)
    assert scene.bus.topics[name].publishers
    scene.wait(1.0)
    assert not scene.bus.topics[name].publishers


# Goals


def test_a_goal_of_ros_2_gets_feedback_until_it_is_cancelled() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    goal = who.send("base_link")
    assert goal is not None
    scene.frame(at(1.0))
    goal.cancel()
    scene.frame(at(2.0))
    assert who.places() == [("base_link", 1.0)]
    (outcome,) = who.outcomes
    assert (outcome.is_ok, outcome.status) == (True, GoalStatus.CANCELED)
    goal.cancel()
    assert len(who.outcomes) == 1


def test_goal_of_a_client_that_left_ends_without_messages() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    who.send("base_link")
    who.leave()
    scene.frame(at(1.0))
    assert (who.heard, who.outcomes) == ([], [])
    assert not scene.is_awake


def test_roslib_1_client_subscribes_by_the_action_topics_of_ros_1() -> None:
    scene = RepublisherFixture()
    peer, outbox = make_peer(scene.bus)

    def send(**op: object) -> None:
        peer.receive(json.dumps(op).encode(), scene.now)

    def received() -> list[dict[str, Any]]:
        return [json.loads(frame.decode()) for frame in outbox.take(2**40) if isinstance(frame, bytes)]

    base = "/tf2_web_republisher"
    send(op="advertise", topic=f"{base}/goal", type="tf2_web_republisher/TFSubscriptionActionGoal")
    send(op="advertise", topic=f"{base}/cancel", type="actionlib_msgs/GoalID")
    send(op="subscribe", topic=f"{base}/feedback", type="tf2_web_republisher/TFSubscriptionActionFeedback")
    request = {"source_frames": ["base_link"], "target_frame": "map", "angular_thres": 2, "trans_thres": 0.01}
    goal = {"goal_id": {"stamp": {"secs": 0, "nsecs": 0}, "id": "goal_1"}, "goal": {**request, "rate": 10}}
    send(op="publish", topic=f"{base}/goal", msg=goal)
    scene.frame(at(1.0))
    (frame,) = received()
    assert frame["topic"] == f"{base}/feedback"
    assert frame["msg"]["status"]["goal_id"]["id"] == "goal_1"
    assert frame["msg"]["status"]["status"] == ActionlibStatus.ACTIVE
    (transform,) = frame["msg"]["feedback"]["transforms"]
    assert transform["transform"]["translation"] == {"x": 1.0, "y": 0.0, "z": 0.0}
    send(op="publish", topic=f"{base}/cancel", msg={"id": "goal_1"})
    for i in range(10):
        scene.frame(at(float(i)))
    assert received() == []
    assert not scene.is_awake


# Requests that are none


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"target": ""}, "needs a name"),
        ({"target": "x" * 300}, "at most 256"),
        ({"rate": -1.0}, "rate: expected 0 or more, got -1.0"),
        ({"rate": math.nan}, "rate: expected 0 or more, got nan"),
        ({"trans_thres": -0.5}, "trans_thres: expected 0 or more"),
        ({"angular_thres": math.inf}, "angular_thres: expected 0 or more"),
        ({"source": ""}, "needs a name"),
    ],
)
def test_malformed_request_is_refused(fields: dict[str, Any], text: str) -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    source = fields.pop("source", "base_link")
    answer = who.call(source, **fields)
    assert not answer.is_ok
    assert text in str(answer.values)
    assert who.send(source, **fields) is None
    assert not who.outcomes[0].is_ok
    assert text in str(who.outcomes[0].values)
    assert not scene.is_awake


def test_the_number_of_requests_is_bounded_for_each_and_for_all() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    for _ in range(OWN_STREAMS):
        who.ask("base_link")
    refusal = str(who.call("base_link").values)
    assert "At most 100 requests" in refusal
    assert "of yours" in refusal
    assert scene.somebody().call(*(f"f{i}" for i in range(OWN_PAIRS))).is_ok
    assert not scene.somebody().call(*(f"f{i}" for i in range(OWN_PAIRS + 1))).is_ok
    for _ in range(MAX_STREAMS // OWN_STREAMS):
        other = scene.somebody()
        answers = [other.call("base_link") for _ in range(OWN_STREAMS)]
    assert "in all" in str(answers[-1].values)
    who.leave()
    assert scene.somebody().call("base_link").is_ok
    assert MAX_FRAME_PAIRS >= MAX_STREAMS


def test_extreme_rates_give_valid_timers() -> None:
    scene = RepublisherFixture()
    who = scene.somebody()
    for rate in (1e-45, 3e38):
        who.send("base_link", rate=rate)
    for x in (1.0, 2.0, 3.0):
        scene.frame(at(x))
    due = scene.republisher.next_due(scene.now)
    assert due is not None
    assert scene.now < due <= scene.now + 3600.0
    assert len(who.places()) == 4


def test_too_many_transforms_are_refused_before_they_are_read() -> None:
    scene = RepublisherFixture()
    sender, asker = RepublisherClient(scene), RepublisherClient(scene)
    name = asker.ask("a")
    asker.listen(name)
    good = written("map", "a", at(1.0))
    with pytest.raises(GraphError, match="expected at most 1000 transforms"):
        sender.publish(*[good] * 1_001)
    assert asker.places() == []
    sender.publish(good)
    assert asker.places() == [("a", 1.0)]


def test_too_many_requested_frames_are_refused_before_they_are_read() -> None:
    scene = RepublisherFixture()
    answer = RepublisherClient(scene).call(*[""] * (MAX_FRAME_PAIRS + 1))
    assert (answer.is_ok, answer.values) == (
        False,
        f"source_frames: expected at most {MAX_FRAME_PAIRS}, got {MAX_FRAME_PAIRS + 1}",
    )


def test_first_subscriber_does_not_get_its_latched_message_twice() -> None:
    """The flaw: between two slots what was told was forgotten, and told once more in the next slot, moved or not."""
    for num_frames in range(6):
        scene = RepublisherFixture()
        scene.frame(at(40.0))
        client = scene.somebody()
        name = client.ask("base_link", rate=10.0, trans_thres=0.1)
        scene.frame(at(40.0))
        for _ in range(num_frames):
            scene.frame(at(40.0))
        client.listen(name)
        for _ in range(30):
            scene.frame(at(40.0))
        assert client.places() == [("base_link", 40.0)], f"{num_frames} frames later"


def test_second_subscriber_gets_all_transforms() -> None:
    """Also where the first one leaves in the middle of a slot, and what is latched is a part."""
    for num_frames in range(12):
        scene = RepublisherFixture()
        client, late = scene.somebody(), scene.somebody()
        name = client.ask("base_link", "post", rate=10.0, trans_thres=0.1)
        client.listen(name)
        scene.world.publish(written("map", "post", at(40.0)))
        for i in range(10):
            scene.frame(at(float(i)))
        subscription = scene.bus.holdings(client).subscriptions
        scene.bus.unsubscribe(next(iter(subscription)), scene.now)
        for i in range(num_frames):
            scene.frame(at(10.0 + i))
        late.listen(name)
        for i in range(12):
            scene.frame(at(40.0 + i))
        assert {source for source, _ in late.places()} == {"base_link", "post"}, f"{num_frames} frames later"
