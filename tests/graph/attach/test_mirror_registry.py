"""What the simulator has comes and goes on the far side, each thing over its connection."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.attach.connection import PROBE
from rosbridge_sim.graph.topics_services import Call
from tests.graph.attach.mirror_harness import Program, SimHarness

# What comes and goes


def test_advertisements_follow_the_topics_of_the_simulator(harness: SimHarness) -> None:
    harness.bus.advertise(harness.car, "/Ego-2/state", "std_msgs/Int32")
    pedal = harness.bus.subscribe(harness.car, "/Ego-2/pedal", lambda *_: None, type_name="std_msgs/Float64")
    harness.bus.provide(harness.car, "/Ego-2/honk", "std_srvs/Empty", lambda *_: None)
    harness.pump()
    assert "/Ego-2/honk" in harness.far.bus.services
    program = Program(harness.far)
    program.send("subscribe", topic="/Ego-2/state")
    harness.car.show("/Ego-2/state", data=2)
    harness.pump()
    assert [frame["msg"] for frame in program.received()] == [{"data": 2}]
    harness.bus.unadvertise(harness.car, "/Ego-2/state", 0.0)
    harness.bus.unsubscribe(pedal, 0.0)
    harness.bus.withdraw(harness.car, "/Ego-2/honk")
    harness.pump()
    assert "/Ego-2/honk" not in harness.far.bus.services
    assert not harness.far.bus.topics["/Ego-2/state"].publishers
    assert not harness.far.bus.topics["/Ego-2/pedal"].subscriptions
    assert "/Ego-2/state" not in [topic.name for topic in harness.bus.holdings(harness.mirror).published]


@pytest.mark.parametrize("has_connection_each", [False, True])
def test_service_renamed_during_a_call_answers_first(*, has_connection_each: bool) -> None:
    harness = SimHarness(has_connection_each=has_connection_each)
    harness.attach()
    calls: list[Call] = []
    harness.bus.provide(harness.car, "/rename", "std_srvs/SetBool", lambda call, _now: calls.append(call))
    harness.attach() if has_connection_each else harness.pump()
    program = Program(harness.far)
    program.send("call_service", service="/rename", id="1")
    program.send("call_service", service="rename", id="2")
    harness.pump()
    harness.bus.withdraw(harness.car, "/rename", answers_calls=True)
    harness.bus.provide(harness.car, "/renamed", "std_srvs/SetBool", lambda call, _now: calls.append(call))
    for call in calls:
        assert "/rename" in harness.far.bus.services
        call.answer(call.service.type.response.default())
        harness.pump()
    assert [frame["result"] for frame in program.received("service_response")] == [True, True]
    assert "/rename" not in harness.far.bus.services


def test_leaving_removes_all_advertisements_and_subscriptions(harness: SimHarness) -> None:
    harness.mirror.leave(0.0)
    harness.pump()
    assert "/honk" not in harness.far.bus.services
    assert harness.mirror not in harness.bus.owners()
    harness.bus.advertise(harness.car, "/later", "std_msgs/Int32")  # nobody looks any more
    assert harness.far.bus.find_topic("/later") is None


def test_everything_is_announced_again_after_each_loss(harness: SimHarness) -> None:
    harness.cut()
    harness.car.show("/plate", data="34 NA 5678")
    harness.far.frames.clear()
    harness.attach()
    assert harness.num_attached == 2
    assert (
        "/rosapi/services" not in [f["service"] for f in harness.far.ops("call_service")][:1]
    )  # ours are known by now
    program = Program(harness.far)
    program.send("subscribe", topic="/plate")
    program.send("call_service", service="/honk", args={})
    harness.pump()
    assert [frame["op"] for frame in program.received()] == ["publish", "service_response"]
    assert harness.far.ops("publish")[0]["msg"] == {"data": "34 NA 5678"}


# A connection for each


def test_with_a_connection_for_each_everything_has_one_of_its_own() -> None:
    harness = SimHarness(has_connection_each=True)
    names = list(harness.mirror.connections)
    assert names == ["", "topic /state", "topic /plate", "input /pedal", "service /honk"]
    harness.attach()
    assert harness.num_attached == 1
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert sorted(frame["op"] for frame in program.received()) == ["publish", "service_response"]


def test_connections_come_and_go_with_their_topics() -> None:
    harness = SimHarness(has_connection_each=True)
    looks: list[list[str]] = []
    harness.mirror.on_connections_changed = lambda: looks.append(list(harness.mirror.connections)[5:])
    harness.bus.advertise(harness.car, "/Ego-2/state", "std_msgs/Int32")
    harness.bus.unadvertise(harness.car, "/Ego-2/state", 0.0)
    assert looks == [["topic /Ego-2/state"], []]


def test_a_connection_that_ends_with_its_topic_is_no_loss() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.bus.advertise(harness.car, "/Ego-2/state", "std_msgs/Int32")
    harness.attach()
    connection = harness.mirror.connections["topic /Ego-2/state"]
    harness.bus.unadvertise(harness.car, "/Ego-2/state", 0.0)
    harness.pump()
    assert not harness.far.bus.topics["/Ego-2/state"].publishers
    harness.far.cut(harness.mirror, connection)
    harness.far.cut(harness.mirror, harness.mirror.connections["topic /state"])
    harness.far.connect(harness.mirror, harness.mirror.connections["topic /state"])
    harness.pump()
    assert harness.num_attached == 2


def test_one_connection_that_waits_delays_no_other() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.attach()
    harness.far.mute.add(PROBE)
    harness.flood(1_000)
    assert not harness.mirror.connections["topic /state"].flow_control.has_room
    program = Program(harness.far)
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert len(program.received("service_response")) == 1
