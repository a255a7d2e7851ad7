"""Services between the bus and a graph of ROS 2 in memory: what passes in each direction, and what is refused."""

from __future__ import annotations

import logging

import pytest

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarService, FarServiceType, OnReply
from rosbridge_sim.graph.gateway.node_services import PATIENCE, NodeServices
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Policy, Rule, is_allowed
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.ros2.cdr_types import CdrTypes
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.graph.topics_services import Answer, Call
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_store
from tests.graph.participants import Somebody, YieldingParticipant

SET_BOOL = "std_srvs/SetBool"


class ServicesInMemory:
    """Services between a bus and nodes that remember their calls."""

    def __init__(self, policy: Policy | None = None, *, for_guests_alone: bool = False) -> None:
        self.bus = Bus(make_store())
        self.refusals: list[RefusedRequest] = []
        self.bus.on_refusal = self.refusals.append
        self.types = CdrTypes(self.bus.store, make_store(2))
        self.asked: list[tuple[str, bytes, OnReply]] = []
        self.answers: list[Answer] = []

        def is_offered(_name: str, owner: Participant) -> bool:
            return owner.is_guest or not for_guests_alone

        self.services = NodeServices(ROS2_GRAPH, self.bus, self.types.find_service, policy or Policy(), self.call)
        self.services.is_offered = is_offered

    def call(self, name: str, service: FarServiceType, request: bytes, call: Call, on_reply: OnReply) -> None:
        assert call.service.type.name == service.request.type.name.removesuffix("Request")
        self.asked.append((name, request, on_reply))

    def ask(self, name: str, args: dict[str, object], now: float = 0.0) -> None:
        self.bus.call(Somebody(), name, args, self.answers.append, now=now)

    def cdr(self, *, is_request: bool, **fields: object) -> bytes:
        service = self.types.find_service(SET_BOOL)
        part = service.request if is_request else service.response
        return part.encode(Message(part.type, part.type.struct_type(**fields)))


def test_a_client_s_call_reaches_a_node_and_its_answer_comes_back() -> None:
    one = ServicesInMemory()
    one.services.set_foreign([FarService("/lights", SET_BOOL, "/robot")])
    one.ask("lights", {"data": True})
    ((name, request, on_reply),) = one.asked
    assert (name, request) == ("/lights", one.cdr(is_request=True, data=True))
    on_reply(True, one.cdr(is_request=False, success=True, message="on"))  # noqa: FBT003 - see `OnReply`
    (answer,) = one.answers
    assert answer.is_ok
    assert isinstance(answer.values, Message)
    assert answer.values.json == b'{"success":true,"message":"on"}'


@pytest.mark.parametrize(
    ("is_ok", "body", "why"),
    [
        (False, b"no power", "no power"),
        (True, b"\x00\x01\x00", "std_srvs/SetBoolResponse: the bytes are not a message of this type"),
    ],
)
def test_a_node_s_failure_and_its_broken_answer_fail_the_call(is_ok: bool, body: bytes, why: str) -> None:  # noqa: FBT001 - a column
    one = ServicesInMemory()
    one.services.set_foreign([FarService("/lights", SET_BOOL)])
    one.ask("/lights", {})
    one.asked[0][2](is_ok, body)
    assert not one.answers[0].is_ok
    assert str(one.answers[0].values).replace("msg/", "").startswith(why)


@pytest.mark.parametrize("node", ["", "/robot"])
def test_a_node_that_calls_gets_no_denied_topic_in_an_answer(node: str) -> None:
    """As `/sim/step` would give it; the graph of ROS 2 names no callers."""
    one = ServicesInMemory(Policy(subscribe=Rule(deny=("/secret",))))
    told: list[bool] = []

    def handle(call: Call, _now: float) -> None:
        told.append(is_allowed(call.caller.check_subscribe, "/secret", "std_msgs/String"))
        call.answer({"success": True, "message": ""})

    one.bus.provide(YieldingParticipant(), "/lights", SET_BOOL, handle)
    one.services.call(node, "/lights", one.cdr(is_request=True, data=True), lambda *_: None, now=0.0)
    assert told == [False]


def test_calls_fail_when_the_node_goes_and_when_it_is_silent_for_too_long() -> None:
    one = ServicesInMemory()
    one.services.set_foreign([FarService("/lights", SET_BOOL)])
    one.ask("/lights", {})
    one.services.set_foreign([])
    one.services.set_foreign([FarService("/lights", SET_BOOL)])
    one.ask("/lights", {}, now=10.0)
    one.bus.expire(10.0 + PATIENCE)
    assert [answer.values for answer in one.answers] == [
        "Service /lights was unadvertised",
        "Timeout exceeded while waiting for service response",
    ]


def test_services_of_the_bus_win_over_those_of_nodes(caplog: pytest.LogCaptureFixture) -> None:
    one = ServicesInMemory()
    owner = YieldingParticipant()
    one.bus.provide(owner, "/lights", SET_BOOL, owner.keep)
    with caplog.at_level(logging.INFO):
        one.services.set_foreign([FarService("/lights", SET_BOOL), FarService("/doors", SET_BOOL)])
    assert one.bus.services["/lights"].owner is owner
    assert "/lights of ROS 2 cannot be used: a client of this server provides a service of this name" in caplog.text
    one.bus.provide(owner, "/doors", SET_BOOL, owner.keep)
    assert list(one.services.foreign) == []
    one.bus.leave(owner, 0.0)
    one.services.set_foreign([FarService("/lights", SET_BOOL)])
    assert list(one.services.foreign) == ["/lights"]


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (FarService("/a", "nobody_msgs/Thing"), "Unable to import nobody_msgs.srv"),
        (FarService("/a", SET_BOOL, hash="abc"), "std_srvs/SetBool has another definition there"),
    ],
)
def test_a_service_of_an_unknown_type_is_told_once(
    found: FarService, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    one = ServicesInMemory()
    with caplog.at_level(logging.INFO):
        one.services.set_foreign([found])
        one.services.set_foreign([found])
    assert "/a" not in one.bus.services
    assert caplog.text.count(why) == 1


def test_nodes_call_services_of_the_bus_and_get_refusals_as_text() -> None:
    one = ServicesInMemory()
    owner = Somebody()
    one.bus.provide(owner, "/lights", SET_BOOL, owner.keep)
    assert list(one.services.offered()) == ["/lights"]
    replies: list[tuple[bool, bytes]] = []
    for _ in range(2):
        one.services.call("", "/lights", one.cdr(is_request=True, data=True), lambda *told: replies.append(told), 0.0)
    owner.calls[0].answer(one.bus.store.service(SET_BOOL).response.struct_type(success=True))
    owner.calls[1].refuse("no power")
    assert replies == [(True, one.cdr(is_request=False, success=True)), (False, b"no power")]


def test_a_node_with_a_name_is_a_participant_that_leaves() -> None:
    one = ServicesInMemory()
    owner = Somebody()
    one.bus.provide(owner, "/lights", SET_BOOL, owner.keep)
    one.services.call("/robot", "/lights", one.cdr(is_request=True), lambda *_told: None, 0.0)
    assert owner.calls[0].caller is one.services.callers["/robot"]
    one.services.forget_caller("/robot", 0.0)
    assert owner.calls[0].is_done


def test_a_request_that_is_none_is_refused_and_told() -> None:
    one = ServicesInMemory()
    owner = Somebody()
    one.bus.provide(owner, "/lights", SET_BOOL, owner.keep)
    replies: list[tuple[bool, bytes]] = []
    one.services.call("/robot", "/lights", b"\x00", lambda *told: replies.append(told), 0.0)
    assert not replies[0][0]
    assert owner.calls == []
    assert [(refusal.client, refusal.subject) for refusal in one.refusals] == [("ROS 2 node /robot", "/lights")]


@pytest.mark.parametrize(
    ("policy", "for_guests_alone"),
    [(Policy(service=Rule(deny=("/lights",))), False), (Policy(), True)],
)
def test_what_nodes_must_not_call_is_neither_offered_nor_called(policy: Policy, for_guests_alone: bool) -> None:  # noqa: FBT001 - a column
    one = ServicesInMemory(policy, for_guests_alone=for_guests_alone)
    owner = Somebody()
    one.bus.provide(owner, "/lights", SET_BOOL, owner.keep)
    assert one.services.offered() == {}
    replies: list[tuple[bool, bytes]] = []
    one.services.call("", "/lights", one.cdr(is_request=True), lambda *told: replies.append(told), 0.0)
    assert not replies[0][0]
    assert owner.calls == []
    assert one.refusals[0].reason is Reason.NOT_ALLOWED


def test_denied_services_of_nodes_and_parts_of_actions_do_not_come_to_the_bus() -> None:
    one = ServicesInMemory(Policy(service=Rule(deny=("/lights",))))
    names = ("/lights", "/plan/_action/send_goal", "/rosapi/topics")
    one.services.set_foreign([FarService(name, SET_BOOL) for name in names])
    assert one.services.foreign == {}


def test_a_request_may_be_refused_before_it_leaves() -> None:
    one = ServicesInMemory()
    one.services.set_foreign([FarService("/lights", SET_BOOL)])

    def refuse(name: str, _call: Call) -> None:
        raise GraphError(f"not {name}")

    one.services.check_request = refuse
    one.ask("/lights", {})
    assert one.answers[0].values == "not /lights"
    assert one.asked == []


def test_a_service_is_told_of_the_node_that_has_it() -> None:
    one = ServicesInMemory()
    one.services.set_foreign([FarService("/lights", SET_BOOL, "/robot"), FarService("/doors", SET_BOOL)])
    assert set(one.services.nodes("any", "")) == {"/robot", ROS2_GRAPH.name}
    assert set(one.services.nodes("provider", "/lights")) == {"/robot"}
    assert set(one.services.nodes("provider", "/doors")) == {ROS2_GRAPH.name}
    assert set(one.services.nodes("provider", "/nowhere")) == set()


def test_a_service_that_is_refused_holds_up_no_other_one_and_the_same_ones_stay() -> None:
    one = ServicesInMemory()
    found = [FarService("/odd", "nobody_msgs/Thing"), FarService("/lights", SET_BOOL)]
    one.services.set_foreign(found)
    kept = one.bus.services["/lights"]
    one.ask("/lights", {})
    one.services.set_foreign(found)
    assert one.bus.services["/lights"] is kept
    assert one.answers == [], "what waits goes on"


def test_few_services_pass_in_each_direction(caplog: pytest.LogCaptureFixture) -> None:
    one = ServicesInMemory()
    one.services.most = 2
    one.services.set_foreign([FarService(f"/far{i}", SET_BOOL) for i in range(3)])
    assert list(one.services.foreign) == ["/far0", "/far1"]
    owner = Somebody()
    for i in range(2):
        one.bus.provide(owner, f"/near{i}", SET_BOOL, owner.keep)
    assert list(one.services.offered()) == ["/near0", "/near1"]
    assert not caplog.text
    one.bus.provide(owner, "/near2", SET_BOOL, owner.keep)
    assert list(one.services.offered()) == ["/near0", "/near1"]
    assert caplog.text.count("more than 2 services on the bus: the others do not pass") == 1


def test_few_callers_are_remembered_and_those_first_that_the_graph_tells_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.graph.gateway.node_services.MAX_CALLERS", 2)
    one = ServicesInMemory()
    owner = Somebody()
    one.bus.provide(owner, "/lights", SET_BOOL, owner.keep)
    for node in ("/a", "/b", "/a", "/c"):
        one.services.call(node, "/lights", one.cdr(is_request=True), lambda *_told: None, 0.0)
        one.services.callers["/a"].was_seen = True
    assert [(name, caller.name) for name, caller in one.services.callers.items()] == [("/a", "/a"), ("/c", "/c")]
    assert [call.is_done for call in owner.calls] == [False, True, False, False]
    one.services.callers["/c"].was_seen = True
    one.services.call("/d", "/lights", one.cdr(is_request=True), lambda *_told: None, 0.0)
    assert list(one.services.callers) == ["/a", "/c"]


def test_leaving_ends_everything_on_the_bus() -> None:
    one = ServicesInMemory()
    one.services.set_foreign([FarService("/lights", SET_BOOL)])
    one.services.leave(0.0)
    one.services.leave(0.0)
    assert "/lights" not in one.bus.services
    with pytest.raises(FieldError):
        one.types.find_service(SET_BOOL).request.decode(b"", 0)
