"""A mock on the bus: what it publishes when, its answers, its goals, and a plan that takes the place of another."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.actions import GoalOutcome
from rosbridge_sim.mock.mock_model import MockRecording
from rosbridge_sim.mock.mock_plan import MockFiles
from rosbridge_sim.mock.recorded_topics import RecordedFile, RecordedTrack
from rosbridge_sim.schema.message import Message
from tests.graph.participants import Somebody, text
from tests.mock.mock_runs import MockRun

COUNTER = "topics: {/x: {type: std_msgs/Int32, rate: 10, value: {data: {$counter: {}}}}}"


def test_topic_comes_at_its_rate_with_the_number_of_each_message() -> None:
    run = MockRun(COUNTER)
    run.listen("/x")
    run.run(0.55)
    assert [value.data for value in run.heard("/x")] == [0, 1, 2, 3, 4, 5]


def test_topic_is_made_only_while_somebody_listens() -> None:
    run = MockRun(COUNTER)
    assert run.node.next_due(run.now) is None
    run.run(1.05)
    subscription = run.listen("/x")
    run.run(0.3)
    run.bus.unsubscribe(subscription, run.now)
    run.run(0.5)
    assert run.node.next_due(run.now) is None
    assert [value.data for value in run.heard("/x")] == [11, 12, 13]
    run.listen("/x")
    run.run(0.1)
    assert run.heard("/x")[-1].data == 19


def test_messages_that_were_missed_are_left_out() -> None:
    run = MockRun(COUNTER)
    run.listen("/x")
    run.run(0.0)
    run.now += 0.75  # the loop was busy
    run.run(0.1)
    assert [value.data for value in run.heard("/x")] == [0, 7, 8]


def test_constant_message_is_one_object_that_is_encoded_once() -> None:
    run = MockRun("topics: {/x: {type: std_msgs/Int32, rate: 10, value: {data: 3}}}")
    messages: list[Message] = []
    run.bus.subscribe(run.listener, "/x", lambda _topic, message, _sender, _now: messages.append(message))
    run.run(0.25)
    assert len(messages) == 3
    assert len(set(map(id, messages))) == 1


def test_topic_without_rate_is_latched() -> None:
    run = MockRun("topics: {/map: {type: std_msgs/String, value: {data: here}}}")
    assert [message.value.data for message in run.listen("/map").topic.latched] == ["here"]
    run.run(5.0)
    assert run.heard("/map") == []


def test_expression_follows_a_topic_that_nobody_else_gets() -> None:
    run = MockRun(
        """
        topics:
          /a: {type: std_msgs/Float64, rate: 10, value: {data: {$counter: {}}}}
          /b: {type: std_msgs/Float64, rate: 10, value: {data: {$expression: "/a.data * 10"}}}
          /c: {type: std_msgs/Float64, rate: 10, value: {data: {$expression: "/b.data + /c.data"}}}
        """
    )
    run.listen("/c")
    run.run(0.35)
    assert [value.data for value in run.heard("/c")] == [0, 10, 30, 60]
    assert run.heard("/a") == []


def test_expression_follows_what_clients_publish() -> None:
    run = MockRun(
        "subscribers: {/in: std_msgs/Float64}\n"
        "topics: {/out: {type: std_msgs/Float64, rate: 10, value: {data: {$expression: /in.data * 2}}}}"
    )
    run.listen("/out")
    client = Somebody("/client")
    topic = run.bus.advertise(client, "/in", "std_msgs/Float64")
    run.run(0.05)
    run.bus.publish(client, topic, Message(topic.type, topic.type.struct_type(data=4.0)), run.now)
    run.run(0.1)
    assert [value.data for value in run.heard("/out")] == [0, 8]


def test_many_topics_are_published_in_turns() -> None:
    topics = ", ".join(f"/x{i}: {{type: std_msgs/Int32, rate: 1, value: {{data: {i}}}}}" for i in range(500))
    run = MockRun(f"topics: {{{topics}}}")
    for i in range(500):
        run.listen(f"/x{i}")
    run.run(0.5)
    assert sorted(value.data for _, value in run.listener.heard) == list(range(500))
    assert run.turns == 3


def test_answers_fit_the_request_and_come_after_their_delay() -> None:
    run = MockRun(
        """
        services:
          /enable:
            type: std_srvs/SetBool
            answers:
            - {when: {data: true}, value: {success: true, message: {$list: [one, two]}}, delay: 0.25}
            - {fail: it is off}
          /picky: {type: std_srvs/SetBool, answers: [{when: data}]}
          /plain: {type: std_srvs/Trigger}
        """
    )
    answers = run.listener.answers
    run.call("/enable", data=False)
    assert (answers[0].is_ok, answers[0].values) == (False, "it is off")
    run.call("/enable", data=True)
    run.run(0.2)
    assert len(answers) == 1
    run.call("/enable", data=True)
    run.run(0.1)
    assert run.response(1).message == "one"
    run.run(0.2)
    assert run.response(2).message == "two"
    run.call("/picky", data=False)
    assert (answers[3].is_ok, answers[3].values) == (False, "no answer of the mock fits this request")
    run.call("/plain")
    assert run.response(4).success is False


def test_response_is_computed_from_the_request() -> None:
    run = MockRun(
        "services: {/add: {type: rospy_tutorials/AddTwoInts, answers: [{value: {sum: {$expression: a + b}}}]}}"
    )
    run.call("/add", a=3, b=4)
    assert run.response(0).sum == 7


FIBONACCI = """
actions:
  /fib:
    type: actionlib_tutorials/Fibonacci
    goals:
    - {when: order < 0, outcome: rejected}
    - {when: {order: 1}, outcome: aborted, duration: 0}
    - duration: 1
      feedback: {sequence: [{$counter: {}}]}
      feedback_rate: 4
      result: {sequence: [{$expression: order}]}
"""


class GoalSender:
    """A client of the action in memory."""

    def __init__(self, run: MockRun, order: int) -> None:
        self.outcomes: list[GoalOutcome] = []
        self.feedback: list[Any] = []
        goal_type = run.bus.store.action("actionlib_tutorials/Fibonacci").goal
        goal = Message(goal_type, goal_type.struct_type(order=order))
        self.goal = run.bus.actions.send(
            run.listener, "/fib", goal, self.outcomes.append, lambda message: self.feedback.append(message.value)
        )


def test_goal_has_feedback_and_its_result() -> None:
    run = MockRun(FIBONACCI)
    sender = GoalSender(run, 5)
    run.run(0.9)
    assert [list(each.sequence) for each in sender.feedback] == [[0], [1], [2], [3]]
    assert sender.outcomes == []
    run.run(0.2)
    (outcome,) = sender.outcomes
    assert (outcome.status, list(outcome.values.value.sequence)) == (4, [5])  # type: ignore[union-attr]


def test_goal_is_rejected_aborted_or_cancelled() -> None:
    run = MockRun(FIBONACCI)
    rejected, aborted, cancelled = GoalSender(run, -1), GoalSender(run, 1), GoalSender(run, 9)
    assert rejected.outcomes[0].values == "Action /fib: the mock rejects this goal"
    run.run(0.1)
    assert [outcome.status for outcome in aborted.outcomes] == [6]
    assert cancelled.goal is not None
    cancelled.goal.cancel()
    run.run(0.01)
    assert [outcome.status for outcome in cancelled.outcomes] == [5]
    run.run(5.0)
    assert len(cancelled.outcomes) == 1


def test_goal_that_is_cancelled_before_its_first_turn_ends() -> None:
    run = MockRun(FIBONACCI)
    sender = GoalSender(run, 9)
    assert sender.goal is not None
    sender.goal.cancel()
    run.run(0.0)
    assert [outcome.status for outcome in sender.outcomes] == [5]


def test_action_of_ros_1_has_the_topics_of_actionlib() -> None:
    run = MockRun(FIBONACCI)
    assert {"/fib/goal", "/fib/cancel", "/fib/status", "/fib/feedback", "/fib/result"} <= run.bus.topics.keys()
    run.listen("/fib/status")
    run.run(0.5)
    assert 2 <= len(run.heard("/fib/status")) <= 3
    hooks = len(run.bus.on_topic), len(run.bus.on_leave)
    run.node.load(run.plan(FIBONACCI), run.now)
    assert (len(run.bus.on_topic), len(run.bus.on_leave)) == hooks


def test_parameters_are_set() -> None:
    run = MockRun("parameters: {/robot: {name: x, wheels: [1, 2]}, speed: 3.5}")
    assert run.bus.parameters.text("/robot") == '{"name":"x","wheels":[1,2]}'
    assert run.bus.parameters.text("/speed") == "3.5"


def test_new_plan_begins_anew_and_keeps_subscribers() -> None:
    run = MockRun(COUNTER)
    run.listen("/x")
    run.run(0.35)
    run.node.load(
        run.plan(COUNTER.replace("rate: 10", "rate: 5").replace("/x:", "/y: {type: std_msgs/Bool}, /x:")), run.now
    )
    run.run(0.45)
    assert [value.data for value in run.heard("/x")] == [0, 1, 2, 3, 0, 1, 2]
    assert run.node in run.bus.topics["/y"].publishers
    run.node.load(run.plan("{}"), run.now)
    run.run(1.0)
    assert len(run.heard("/x")) == 7


def test_plan_whose_name_is_taken_changes_nothing() -> None:
    run = MockRun(COUNTER)
    run.listen("/x")
    run.bus.advertise(Somebody("/owner"), "/taken", "std_msgs/Bool", is_exclusive=True)
    with pytest.raises(DocumentError, match="the mock cannot be offered: Topic /taken is published by /owner alone"):
        run.node.load(run.plan(COUNTER.replace("/x:", "/taken: {type: std_msgs/Bool}, /x:")), run.now)
    run.run(0.05)
    assert [value.data for value in run.heard("/x")] == [0]


def test_hook_changes_messages_and_responses_and_a_failing_one_changes_none(caplog: pytest.LogCaptureFixture) -> None:
    def hook(name: str, values: dict[str, Any], request: dict[str, Any] | None) -> dict[str, Any] | None:
        if name == "/x":
            return {"data": values["data"] + 100}
        if request is not None:
            return {"message": f"for {request['data']}"}
        if name == "/bad":
            raise OSError("no")
        return {"data": "of another type"} if name == "/wrong" else None

    run = MockRun(
        COUNTER.removesuffix("}")
        + ", /bad: {type: std_msgs/Bool, rate: 10}, /wrong: {type: std_msgs/Bool, rate: 10}}"
        + "\nservices: {/s: {type: std_srvs/SetBool}}",
        hook,
    )
    for name in ("/x", "/bad", "/wrong"):
        run.listen(name)
    run.run(0.15)
    assert [value.data for value in run.heard("/x")] == [100, 101]
    assert [value.data for value in run.heard("/bad") + run.heard("/wrong")] == [False] * 4
    assert [record.getMessage()[:40] for record in caplog.records if "hook" in record.getMessage()] == [
        "the hook failed for /bad, which stays as",
        "the hook failed for /wrong, which stays ",
    ]
    run.call("/s", data=True)
    assert run.response(0).message == "for True"


class Recorded(MockFiles):
    """A recording of two topics."""

    def record(self, _recording: MockRecording, _others: object) -> RecordedFile:
        header = {"seq": 77, "stamp": {"sec": 1, "nanosec": 2}, "frame_id": "map"}
        points = RecordedTrack(
            "/p",
            "geometry_msgs/PointStamped",
            [0, 400_000_000],
            [b"1", b"2"],
            lambda raw: {"header": dict(header), "point": {"x": float(raw), "y": 0.0, "z": 0.0}},
        )
        words = RecordedTrack("/w", "std_msgs/String", [200_000_000], [b"x"], lambda _raw: {"data": 1})
        return RecordedFile(1_000_000_000, (points, words))


def test_recording_is_looped_with_new_stamps_and_one_that_does_not_fit_ends(caplog: pytest.LogCaptureFixture) -> None:
    run = MockRun("recordings: [{file: a.mcap}]", files=Recorded())
    assert run.node.next_due(run.now) is None
    run.run(3.1)
    run.listen("/p")
    run.listen("/w")
    run.run(2.0)
    points = run.heard("/p")
    assert [point.point.x for point in points] == [2, 1, 2, 1]
    assert [point.header.seq for point in points] == [7, 8, 9, 10]
    assert [point.header.stamp.secs for point in points] == [103, 104, 104, 105]
    assert points[0].header.frame_id == "map"
    assert run.heard("/w") == []
    assert (
        len([record for record in caplog.records if "/w: the recording is played no more" in record.getMessage()]) == 1
    )


def test_failure_of_the_mock_ends_it_alone() -> None:
    run = MockRun(COUNTER)
    run.listen("/x")
    run.node.end(ValueError("a bug"))
    assert run.node.next_due(run.now) is None
    assert run.node not in run.bus.topics["/x"].publishers
    client = Somebody("/client")
    topic = run.bus.advertise(client, "/other", "std_msgs/String")
    run.listen("/other")
    run.bus.publish(client, topic, text(run.bus, "on"), run.now)
    assert [value.data for value in run.heard("/other")] == ["on"]


def test_expression_over_its_own_last_message_drives_a_robot() -> None:
    run = MockRun(
        """
        subscribers: {/cmd_vel: geometry_msgs/Twist}
        topics:
          /x: {type: std_msgs/Float64, rate: 50, value: {data: {$expression: /x.data + 0.02 * /cmd_vel.linear.x}}}
        """
    )
    run.listen("/x")
    client = Somebody("/client")
    topic = run.bus.advertise(client, "/cmd_vel", "geometry_msgs/Twist")
    run.bus.publish(client, topic, Message(topic.type, topic.type.check({"linear": {"x": 3}}, 0)), run.now)
    run.run(1.99)
    assert run.heard("/x")[-1].data == pytest.approx(6.0)
