"""The gateway between the bus and a graph of ROS 2 in memory: what passes, what does not, and what is told."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarGraph
from rosbridge_sim.graph.gateway.gateway import ADVERTISED_PER_TURN, MAX_TOPICS, PERIOD, Gateway
from rosbridge_sim.graph.gateway.quality import PROFILES, Quality
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.ros2.cdr_types import CdrType, CdrTypes
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.records import replace
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import Wire, make_store
from tests.graph.participants import STRING, Somebody, text

DDS_STRING = "std_msgs::msg::dds_::String_"


class GraphInMemory:
    """A graph that remembers our endpoints, and gives the gateway what a program there does."""

    def __init__(
        self,
        policy: Policy | None = None,
        topics: Rule | None = None,
        qualities: Sequence[tuple[str, Quality]] = (),
        ros: Generation = 1,
        far: FarGraph = ROS2_GRAPH,
    ) -> None:
        self.bus = Bus(make_store(ros))
        self.refusals: list[RefusedRequest] = []
        self.bus.on_refusal = self.refusals.append
        self.types = CdrTypes(self.bus.store, make_store(2))
        self.writers: dict[str, Quality] = {}
        self.sole: set[str] = set()
        self.readers: dict[str, Quality] = {}
        self.sent: list[tuple[str, bytes]] = []
        self.has_room = True
        self.why_not = ""
        self.types_held: dict[str, tuple[str, float]] = {}
        self.now = 0.0
        self.gateway = Gateway(
            far,
            self.bus,
            self.types.find,
            self,
            policy or Policy(),
            topics=topics or Rule(),
            qualities=qualities,
        )
        self.settle()

    def settle(self) -> None:
        """Let all looks be done."""
        while self.gateway.next_due(self.now) is not None:
            self.now += PERIOD
            self.gateway.advance(self.now)

    def meet(self, topic: str, *, is_writer: bool, dds_type: str = DDS_STRING, quality: Quality | None = None) -> str:
        """Let a node on the graph publish or subscribe; return the key of its endpoint."""
        key = f"{topic} {is_writer} {dds_type} {quality}"
        endpoint = Endpoint(key, topic, dds_type, is_writer, quality or Quality(), "/planner")
        self.gateway.note_endpoints([endpoint], [], self.now)
        self.settle()
        return key

    def part(self, key: str) -> None:
        self.gateway.note_endpoints([], [key], self.now)
        self.settle()

    def say(self, topic: str, data: str) -> None:
        """Let a node publish a text."""
        self.gateway.receive(topic, self.types.find(STRING).encode(text(self.bus, data)), self.now)

    def heard(self) -> list[tuple[str, str]]:
        """The texts that nodes got."""
        return [(topic, self.types.find(STRING).decode(raw, 0).data) for topic, raw in self.sent]

    # As a `FarNode`

    def open_writer(self, topic: str, cdr_type: CdrType, quality: Quality, *, is_sole: bool) -> None:
        self._refuse(topic, cdr_type.name)
        assert topic not in self.writers
        self.writers[topic] = quality
        self.sole |= {topic} if is_sole else set()

    def open_reader(self, topic: str, cdr_type: CdrType, quality: Quality) -> None:
        self._refuse(topic, cdr_type.name)
        assert topic not in self.readers
        self.readers[topic] = quality

    def close_writer(self, topic: str) -> None:
        del self.writers[topic]
        self.types_held[topic] = self.types_held[topic][0], self.now

    def close_reader(self, topic: str) -> None:
        del self.readers[topic]
        self.types_held[topic] = self.types_held[topic][0], self.now

    def write(self, topic: str, raw: bytes) -> bool:
        self.sent.append((topic, raw))
        return self.has_room

    def _refuse(self, topic: str, kind: str) -> None:
        if self.why_not:
            raise GraphError(self.why_not)
        held, until = self.types_held.get(topic, (kind, self.now))
        assert held == kind or until < self.now, "as rclpy has it: a topic keeps its type for a moment"
        self.types_held[topic] = kind, self.now


@pytest.fixture
def graph() -> GraphInMemory:
    return GraphInMemory()


@pytest.fixture
def warned(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level(logging.INFO, "rosbridge_sim.ros2")
    return lambda: [record.getMessage() for record in caplog.records if record.name == "rosbridge_sim.ros2"]


# To the graph


def test_nodes_see_topics_of_the_bus_and_get_messages_once_they_subscribe(graph: GraphInMemory) -> None:
    car = Somebody("/car")
    topic = graph.bus.advertise(car, "/state", STRING)
    graph.settle()
    assert graph.writers == {"/state": Quality()}
    assert not topic.has_listener, "nobody reads, so nothing is encoded"
    graph.meet("/state", is_writer=False)
    assert topic.has_listener
    graph.bus.publish(car, topic, text(graph.bus, "one"), 0.0)
    assert graph.heard() == [("/state", "one")]
    assert graph.gateway.num_sent == 1


def test_a_topic_without_publisher_leaves_the_graph(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="advertise", topic="/state", type=STRING)
    graph.settle()
    assert "/state" in graph.writers
    client.says(op="unadvertise", topic="/state")
    graph.settle()
    assert not graph.writers
    assert not graph.bus.holdings(graph.gateway).subscriptions


def test_services_and_parameters_are_not_announced(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="advertise_service", service="/add", type="std_srvs/Empty")
    client.says(op="call_service", service="/rosapi/set_param", args={"name": "/speed", "value": "3"})
    client.says(op="advertise", topic="/state", type=STRING)
    graph.settle()
    assert "/add" in graph.bus.services
    assert list(graph.writers) == ["/state"]
    assert not graph.readers


def test_encoding_stops_when_the_last_reader_leaves(graph: GraphInMemory) -> None:
    topic = graph.bus.advertise(Somebody("/car"), "/state", STRING)
    key = graph.meet("/state", is_writer=False)
    graph.part(key)
    assert not topic.has_listener


def test_latched_messages_wait_for_late_nodes(graph: GraphInMemory) -> None:
    car = Somebody("/car")
    topic = graph.bus.advertise(car, "/plate", STRING, depth=1)
    graph.bus.publish(car, topic, text(graph.bus, "12 GA 3456"), 0.0)
    graph.settle()
    assert graph.writers == {"/plate": Quality(is_latched=True, depth=1)}
    assert graph.heard() == [("/plate", "12 GA 3456")]
    graph.bus.publish(car, topic, text(graph.bus, "34 NA 1"), 0.0)
    assert graph.heard()[-1] == ("/plate", "34 NA 1")


def test_dropped_messages_are_counted(graph: GraphInMemory) -> None:
    car = Somebody("/car")
    topic = graph.bus.advertise(car, "/state", STRING)
    graph.meet("/state", is_writer=False)
    graph.has_room = False
    graph.bus.publish(car, topic, text(graph.bus, "one"), 0.0)
    assert (graph.gateway.num_sent, graph.gateway.num_dropped) == (0, 1)


@pytest.mark.parametrize("name", ["/Ego-2/state", "/rosout", "/tf2_web_republisher/goal"])
def test_names_that_ros2_cannot_have_or_has_itself_stay(graph: GraphInMemory, name: str) -> None:
    graph.bus.advertise(Somebody("/car"), name, STRING)
    graph.settle()
    assert not graph.writers


# From the graph


def test_messages_of_nodes_reach_subscriptions(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="subscribe", topic="/plan", type=STRING)
    graph.settle()
    assert graph.readers == {"/plan": Quality()}
    graph.meet("/plan", is_writer=True)
    graph.say("/plan", "left")
    (frame,) = client.hears()
    assert frame["msg"] == {"data": "left"}
    assert graph.gateway.num_received == 1


def test_clients_find_what_nodes_publish_and_need_no_type(graph: GraphInMemory) -> None:
    Rosapi(graph.bus)
    graph.meet("/plan", is_writer=True)
    client = Wire(graph.bus)
    (answer,) = client.says(op="call_service", service="/rosapi/publishers", args={"topic": "/plan"})
    assert answer["values"] == {"publishers": ["/planner"]}
    (answer,) = client.says(op="call_service", service="/rosapi/node_details", args={"node": "/planner"})
    assert answer["values"] == {"subscribing": [], "publishing": ["/plan"], "services": []}
    assert not graph.readers, "nobody on the bus subscribes yet"
    client.says(op="subscribe", topic="/plan")
    graph.settle()
    graph.say("/plan", "left")
    assert [frame["msg"] for frame in client.hears()] == [{"data": "left"}]


def test_a_topic_that_nodes_publish_no_more_leaves_the_bus(graph: GraphInMemory) -> None:
    key = graph.meet("/plan", is_writer=True)
    topic = graph.bus.find_topic("/plan")
    assert topic is not None
    assert topic.publishers
    graph.part(key)
    assert not topic.publishers


def test_nothing_goes_back_to_where_it_came_from(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="advertise", topic="/chat", type=STRING)
    client.says(op="subscribe", topic="/chat")
    graph.meet("/chat", is_writer=True)
    graph.meet("/chat", is_writer=False)
    graph.say("/chat", "from a node")
    client.says(op="publish", topic="/chat", msg={"data": "from a client"})
    assert graph.heard() == [("/chat", "from a client")]


def test_the_reader_asks_for_what_all_publishers_offer(graph: GraphInMemory) -> None:
    Wire(graph.bus).says(op="subscribe", topic="/plan", type=STRING)
    first = graph.meet("/plan", is_writer=True, quality=Quality(is_latched=True))
    assert graph.readers == {"/plan": Quality(is_latched=True)}
    graph.meet("/plan", is_writer=True, quality=Quality(is_reliable=False))
    assert graph.readers == {"/plan": Quality(is_reliable=False)}
    graph.part(first)
    assert graph.readers == {"/plan": Quality(is_reliable=False)}


def test_a_message_that_does_not_fit_is_told_and_the_rest_arrives(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="subscribe", topic="/plan", type=STRING)
    graph.meet("/plan", is_writer=True)
    good = graph.types.find(STRING).encode(text(graph.bus, "left"))
    for raw in (b"\0\1\0\0\xff\xff", good):
        graph.gateway.receive("/plan", raw, graph.now)
    assert [frame["msg"] for frame in client.hears()] == [{"data": "left"}]
    (refusal,) = graph.refusals
    assert (refusal.client, refusal.subject) == ("ROS 2", "/plan")


def test_another_type_under_one_name_is_told_with_the_node(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    Wire(graph.bus).says(op="subscribe", topic="/plan", type=STRING)
    graph.bus.advertise(Somebody("/car"), "/plan", STRING)
    for _ in range(3):
        graph.part(graph.meet("/plan", is_writer=True, dds_type="std_msgs::msg::dds_::Int32_"))
    start = "/planner publishes /plan, which does not pass: the type is std_msgs::msg::dds_::Int32_"
    lines = [line for line in warned() if line.startswith(start)]
    assert len(lines) == 1


def test_a_topic_that_a_node_names_is_subscribed_to_as_such(graph: GraphInMemory) -> None:
    graph.bus.advertise(Somebody("/car"), "/map", STRING)
    graph.settle()
    topic = graph.bus.find_topic("/map")
    assert topic is not None
    assert [one.is_general for one in topic.subscriptions] == [True], "nothing is made for it alone"
    key = graph.meet("/map", is_writer=False)
    assert [one.is_general for one in topic.subscriptions] == [False]
    graph.part(key)
    assert [one.is_general for one in topic.subscriptions] == [True]


def test_a_line_about_an_endpoint_waits_for_the_name_of_its_node(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    graph.bus.advertise(Somebody("/sim"), "/clock", STRING, is_exclusive=True)
    endpoint = Endpoint("1", "/clock", DDS_STRING, True, Quality(), "", is_named=False, program="17")  # noqa: FBT003 - a field
    graph.gateway.note_endpoints([endpoint], [], graph.now)
    graph.settle()
    assert not warned()
    graph.gateway.note_endpoints([replace(endpoint, node="/gazebo", is_named=True)], [], graph.now)
    graph.settle()
    (line,) = warned()
    assert line.startswith("/gazebo (GUID 17) publishes /clock, which does not pass")


def test_a_line_about_an_endpoint_that_goes_before_its_node_has_a_name_is_told(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    graph.bus.advertise(Somebody("/sim"), "/clock", STRING, is_exclusive=True)
    endpoint = Endpoint("1", "/clock", DDS_STRING, True, Quality(), "", is_named=False, program="17")  # noqa: FBT003 - a field
    graph.gateway.note_endpoints([endpoint], [], graph.now)
    graph.settle()
    graph.gateway.note_endpoints([], ["1"], graph.now)
    graph.settle()
    assert [line.partition(" publishes")[0] for line in warned()] == ["a program (GUID 17)"]


def test_topics_of_a_second_simulator_are_one_line_with_its_guid(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    topics = [f"/t{i}" for i in range(28)]
    for topic in topics:
        graph.bus.advertise(Somebody("/sim"), topic, STRING, is_exclusive=True)
    graph.settle()
    assert graph.sole == set(topics)
    for topic in topics:  # one after the other, as a program on the network tells them
        endpoint = Endpoint(topic, topic, DDS_STRING, True, Quality(), "/sim2", program="01.bb")  # noqa: FBT003 - a field
        graph.gateway.note_endpoints([endpoint], [], graph.now)
        graph.now += PERIOD / 4
        graph.gateway.advance(graph.now)
    graph.settle()
    (line,) = warned()
    start = "/sim2 (GUID 01.bb) publishes /t0, /t1, /t2 and 25 more, which does not pass: Topic /t0 is published by"
    assert line.startswith(start)
    assert line.endswith("end or rename any other")


def test_a_topic_that_the_simulator_publishes_alone_is_not_taken_from_nodes(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    graph.bus.advertise(Somebody("/sim"), "/clock", STRING, is_exclusive=True)
    Wire(graph.bus).says(op="subscribe", topic="/clock")
    graph.meet("/clock", is_writer=True)
    assert not graph.readers
    assert any("/planner publishes /clock" in line and "/sim alone" in line for line in warned())


def test_a_part_of_the_server_takes_the_name_of_a_node(graph: GraphInMemory) -> None:
    graph.meet("/plan", is_writer=True)
    graph.bus.advertise(Somebody("/sim"), "/plan", STRING, is_exclusive=True)
    graph.settle()
    topic = graph.bus.find_topic("/plan")
    assert topic is not None
    assert graph.gateway not in topic.publishers


# Rights and limits


def test_patterns_of_access_hold_in_both_directions() -> None:
    graph = GraphInMemory(Policy(publish=Rule(deny=("/plan",)), subscribe=Rule(deny=("/secret",))))
    graph.bus.advertise(Somebody("/car"), "/secret", STRING)
    Wire(graph.bus).says(op="subscribe", topic="/plan", type=STRING)
    graph.meet("/plan", is_writer=True)
    assert not graph.writers
    assert not graph.readers
    topic = graph.bus.find_topic("/plan")
    assert topic is not None
    assert not topic.publishers


def test_topics_can_be_chosen() -> None:
    graph = GraphInMemory(topics=Rule(("/a", "/b*"), ("/bad",)))
    for name in ("/a", "/bee", "/bad", "/c"):
        graph.bus.advertise(Somebody(name), name, STRING)
    graph.settle()
    assert set(graph.writers) == {"/a", "/bee"}


def test_the_quality_of_our_publishers_can_be_chosen_by_topic() -> None:
    graph = GraphInMemory(qualities=[("/camera*", PROFILES["sensor_data"]), ("/*", PROFILES["latched"])])
    for name in ("/camera/image", "/map"):
        graph.bus.advertise(Somebody(name), name, STRING)
    graph.settle()
    assert graph.writers == {
        "/camera/image": Quality(is_reliable=False, is_latched=False, depth=5),
        "/map": Quality(is_reliable=True, is_latched=True, depth=1),
    }


def test_a_thousand_topics_of_nodes_are_enough(graph: GraphInMemory, warned: Callable[[], list[str]]) -> None:
    endpoints = [Endpoint(f"{i}", f"/t{i}", DDS_STRING, True, Quality(), "/many") for i in range(MAX_TOPICS + 5)]  # noqa: FBT003 - a field
    graph.gateway.note_endpoints(endpoints, [], 0.0)
    graph.settle()
    assert len(graph.bus.holdings(graph.gateway).published) == MAX_TOPICS
    assert sum("more than 1,000 topics" in line for line in warned()) == 1


def test_many_topics_of_nodes_are_taken_a_few_in_each_turn(graph: GraphInMemory) -> None:
    endpoints = [Endpoint(f"{i}", f"/t{i}", DDS_STRING, True, Quality(), "/many") for i in range(100)]  # noqa: FBT003 - a field
    graph.gateway.note_endpoints(endpoints, [], graph.now)
    sizes = []
    while graph.gateway.next_due(graph.now) is not None:
        graph.now += PERIOD
        graph.gateway.advance(graph.now)
        sizes.append(len(graph.bus.holdings(graph.gateway).published))
    assert max(after - before for before, after in pairwise([0, *sizes])) == ADVERTISED_PER_TURN
    assert sizes[-1] == len(endpoints)
    graph.gateway.note_endpoints([], [one.key for one in endpoints], graph.now)
    graph.settle()
    assert not graph.bus.holdings(graph.gateway).published


def test_a_refused_topic_of_a_node_holds_up_no_other_one(graph: GraphInMemory) -> None:
    graph.bus.advertise(Somebody("/sim"), "/clock", STRING, is_exclusive=True)
    many = [Endpoint(f"{i}", f"/t{i}", "x::msg::dds_::Y_", True, Quality(), "/odd") for i in range(50)]  # noqa: FBT003 - a field
    graph.gateway.note_endpoints(many, [], graph.now)
    graph.meet("/clock", is_writer=True)
    graph.meet("/plan", is_writer=True)
    assert [topic.name for topic in graph.bus.holdings(graph.gateway).published] == ["/plan"]


def test_an_endpoint_that_the_library_refuses_is_told_once_and_holds_up_nothing(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    graph.why_not = "out of resources"
    for name in ("/a", "/b", "/c"):
        graph.bus.advertise(Somebody(name), name, STRING)
    graph.settle()
    graph.why_not = ""
    graph.bus.advertise(Somebody("/d"), "/d", STRING)
    graph.settle()
    assert set(graph.writers) == {"/d"}
    assert sum("out of resources" in line for line in warned()) == 3


def test_a_message_that_nobody_waits_for_or_of_another_type_is_left_out(graph: GraphInMemory) -> None:
    graph.say("/nowhere", "left")
    client = Wire(graph.bus)
    client.says(op="subscribe", topic="/plan", type=STRING)
    graph.meet("/plan", is_writer=True)
    client.says(op="unsubscribe", topic="/plan")
    graph.part(graph.meet("/plan", is_writer=True))
    graph.bus.advertise(Somebody("/sim"), "/plan", "std_msgs/Int32", is_exclusive=True)
    graph.say("/plan", "left")
    assert (graph.gateway.num_received, client.hears()) == (0, [])


def test_a_reader_is_made_anew_when_the_type_of_its_topic_changes(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="subscribe", topic="/plan", type=STRING)
    graph.settle()
    client.says(op="unsubscribe", topic="/plan")
    other = Wire(graph.bus)
    other.says(op="subscribe", topic="/plan", type="std_msgs/Int32")
    graph.meet("/plan", is_writer=True, dds_type="std_msgs::msg::dds_::Int32_")
    assert set(graph.readers) == {"/plan"}
    int32 = graph.types.find("std_msgs/Int32")
    raw = int32.encode(Message(int32.type, int32.type.struct_type(data=5)))
    graph.gateway.receive("/plan", raw, graph.now)
    assert [frame["msg"] for frame in other.hears()] == [{"data": 5}]


def test_a_subscription_of_a_node_counts_at_once(graph: GraphInMemory) -> None:
    topic = graph.bus.advertise(Somebody("/car"), "/state", STRING)
    graph.settle()
    for is_writer in (True, False):
        endpoint = Endpoint(f"{is_writer}", "/state", DDS_STRING, is_writer, Quality(), "/planner")
        graph.gateway.note_endpoints([endpoint], [], graph.now)
        assert topic.has_listener is not is_writer


def test_topics_that_do_not_pass_are_not_subscribed_to_either() -> None:
    graph = GraphInMemory(topics=Rule(("/a",)))
    for name in ("/a", "/plan"):
        Wire(graph.bus).says(op="subscribe", topic=name, type=STRING)
    graph.settle()
    assert set(graph.readers) == {"/a"}


def test_few_topics_pass_in_each_direction_and_the_rest_is_told(
    graph: GraphInMemory, warned: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rosbridge_sim.graph.gateway.gateway.MAX_TOPICS", 2)
    for i in range(3):
        graph.bus.advertise(Somebody(f"/n{i}"), f"/w{i}", STRING)
        Wire(graph.bus).says(op="subscribe", topic=f"/r{i}", type=STRING)
    graph.settle()
    assert (len(graph.writers), len(graph.readers)) == (2, 2)
    assert warned() == [
        "more than 2 topics on the bus: the others do not pass",
        "more than 2 subscribed topics: the others do not pass",
    ]


def test_few_endpoints_are_remembered_and_those_may_change(
    graph: GraphInMemory, warned: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rosbridge_sim.graph.gateway.gateway.MAX_ENDPOINTS", 2)
    keys = [graph.meet(f"/t{i}", is_writer=True) for i in range(2)]
    assert not warned()
    changed = Endpoint(keys[0], "/u", DDS_STRING, True, Quality(), "/planner")  # noqa: FBT003 - a field
    graph.gateway.note_endpoints([changed], [], graph.now)
    graph.meet("/t2", is_writer=True)
    assert {topic.name for topic in graph.bus.holdings(graph.gateway).published} == {"/u", "/t1"}
    assert warned() == ["more than 2 endpoints of other programs: the others are not seen"]
    graph.part(keys[1])
    graph.meet("/t2", is_writer=True)
    assert {topic.name for topic in graph.bus.holdings(graph.gateway).published} == {"/u", "/t2"}


def test_type_that_ros2_does_not_have_is_told_in_both_directions(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    graph.bus.advertise(Somebody("/car"), "/boxes", "vision_msgs/BoundingBox2D")
    graph.meet("/odd", is_writer=True, dds_type="x_msgs::msg::dds_::Y_")
    graph.meet("/none", is_writer=True, dds_type="int")
    assert not graph.writers
    starts = ("/boxes does not pass: vision_msgs/BoundingBox2D has other fields", "/planner publishes /odd, which does")
    lines = warned()
    assert all(any(line.startswith(start) for line in lines) for start in starts)
    assert "/planner publishes /none, which does not pass: int is no message of ROS 2" in lines


def test_lines_about_endpoints_are_gathered_for_two_seconds(
    graph: GraphInMemory, warned: Callable[[], list[str]]
) -> None:
    endpoint = Endpoint("1", "/odd", "int", True, Quality(), "/planner")  # noqa: FBT003 - a field
    graph.gateway.note_endpoints([endpoint], [], graph.now)
    first = graph.gateway.next_due(graph.now)
    assert first is not None
    assert first <= graph.now + PERIOD
    graph.gateway.advance(first)
    told = graph.gateway.next_due(first) or 0.0
    assert told == pytest.approx(first + 2.0)
    graph.bus.advertise(Somebody("/car"), "/state", STRING)
    soon = graph.gateway.next_due(first)
    assert soon is not None
    assert soon < told, "the topic does not wait for the lines"
    graph.gateway.advance(told - 0.01)
    assert not warned()
    graph.gateway.advance(told)
    assert len(warned()) == 1


def test_nodes_that_subscribe_and_topics_that_do_not_pass_are_not_advertised_here(graph: GraphInMemory) -> None:
    graph.meet("/wish", is_writer=False)
    graph.meet("/rosout", is_writer=True)
    assert not graph.bus.holdings(graph.gateway).published
    assert "/rosout" not in graph.bus.topics


def test_quality_of_subscriptions_of_nodes_changes_no_reader_of_ours(graph: GraphInMemory) -> None:
    Wire(graph.bus).says(op="subscribe", topic="/plan", type=STRING)
    graph.meet("/plan", is_writer=True, quality=Quality(is_latched=True))
    graph.meet("/plan", is_writer=False, quality=Quality(is_reliable=False))
    assert graph.readers == {"/plan": Quality(is_latched=True)}


def test_many_topics_of_nodes_end_a_few_in_each_turn(graph: GraphInMemory) -> None:
    num = 2 * ADVERTISED_PER_TURN + 3
    endpoints = [Endpoint(f"{i}", f"/t{i}", DDS_STRING, True, Quality(), "/many") for i in range(num)]  # noqa: FBT003 - a field
    graph.gateway.note_endpoints(endpoints, [], graph.now)
    graph.settle()
    graph.gateway.note_endpoints([], [one.key for one in endpoints], graph.now)
    sizes = []
    while graph.gateway.next_due(graph.now) is not None:
        graph.now += PERIOD
        graph.gateway.advance(graph.now)
        sizes.append(len(graph.bus.holdings(graph.gateway).published))
    assert sizes == [num - ADVERTISED_PER_TURN, 3, 0]


def test_subscription_that_the_library_refuses_is_told(graph: GraphInMemory, warned: Callable[[], list[str]]) -> None:
    graph.why_not = "out of resources"
    Wire(graph.bus).says(op="subscribe", topic="/plan", type=STRING)
    graph.settle()
    assert not graph.readers
    assert warned() == ["/plan cannot be subscribed to: out of resources"]


def test_latched_messages_are_asked_for_where_the_graph_does_not_keep_them() -> None:
    graph = GraphInMemory(far=replace(ROS2_GRAPH, keeps_latched=False))
    car = Somebody("/car")
    plate, state = graph.bus.advertise(car, "/plate", STRING, depth=2), graph.bus.advertise(car, "/state", STRING)
    for topic in (plate, state):
        for data in ("12 GA 3456", "34 NA 1"):
            graph.bus.publish(car, topic, text(graph.bus, data), 0.0)
    graph.settle()
    assert graph.heard() == []
    assert not plate.has_listener
    held = graph.gateway.latched("/plate")
    assert [graph.types.find(STRING).decode(raw, 0).data for raw in held][-1:] == ["34 NA 1"]
    assert list(graph.gateway.latched("/state")) == list(graph.gateway.latched("/nowhere")) == []
    graph.gateway.leave(graph.now)
    assert list(graph.gateway.latched("/plate")) == []


def test_what_the_bus_asks_the_gateway_follows_the_patterns_of_access(graph: GraphInMemory) -> None:
    strict = GraphInMemory(Policy(publish=Rule(deny=("/plan",)), subscribe=Rule(deny=("/secret",))))
    with pytest.raises(GraphError):
        strict.gateway.check_subscribe("/secret", STRING)
    with pytest.raises(GraphError):
        strict.gateway.check_publish("/plan", STRING)
    graph.gateway.check_subscribe("/secret", STRING)
    graph.gateway.check_publish("/plan", STRING)


def test_an_internal_error_ends_all_that_passes(graph: GraphInMemory, warned: Callable[[], list[str]]) -> None:
    graph.bus.advertise(Somebody("/car"), "/state", STRING)
    graph.settle()
    graph.gateway.end(RuntimeError("a mistake of ours"))
    assert not graph.writers
    assert warned() == ["internal error; nothing passes to or from ROS 2 any more"]


def test_leaving_ends_everything(graph: GraphInMemory) -> None:
    graph.bus.advertise(Somebody("/car"), "/state", STRING)
    Wire(graph.bus).says(op="subscribe", topic="/plan", type=STRING)
    graph.meet("/plan", is_writer=True)
    graph.gateway.leave(graph.now)
    graph.gateway.leave(graph.now)
    assert not graph.writers
    assert not graph.readers
    assert graph.gateway not in graph.bus.owners()
    graph.bus.advertise(Somebody("/late"), "/late", STRING)
    assert graph.gateway.next_due(graph.now) is None


def test_messages_of_a_type_that_changed_do_not_go_to_the_old_writer(graph: GraphInMemory) -> None:
    client = Wire(graph.bus)
    client.says(op="advertise", topic="/state", type=STRING)
    graph.meet("/state", is_writer=False)
    sim = Somebody("/sim")
    topic = graph.bus.advertise(sim, "/state", "std_msgs/Int32", is_exclusive=True)
    message_type = graph.bus.store.message("std_msgs/Int32")
    graph.bus.publish(sim, topic, Message(message_type, message_type.struct_type(data=5)), 0.0)
    assert graph.sent == []
    graph.settle()
    assert set(graph.writers) == {"/state"}


def test_topics_of_an_action_here_do_not_pass_because_its_services_are_not_there() -> None:
    graph = GraphInMemory(ros=2)
    Wire(graph.bus).says(op="advertise_action", action="/fib", type="example_interfaces/action/Fibonacci")
    relay = Wire(graph.bus)
    relay.says(op="advertise", topic="/far/_action/status", type="action_msgs/msg/GoalStatusArray")
    relay.says(op="advertise", topic="/fib", type="std_msgs/msg/String")
    graph.settle()
    assert "/fib/_action/status" in graph.bus.topics
    assert set(graph.writers) == {"/far/_action/status", "/fib"}
