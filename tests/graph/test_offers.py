"""Services and actions that another owner takes over: built-in ones never, and a client that loses its own is told."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from tests.graph.bus_fixture import Wire, make_bus

TRIGGER, FIBONACCI = "std_srvs/Trigger", "example_interfaces/Fibonacci"

CANCEL = "/_action/cancel_goal"


@pytest.fixture
def bus() -> Bus:
    return make_bus()


class Part:
    """A part of the server: it gives way to no client."""

    name = "/morai_sim"

    def notify(self, level: str, text: str) -> None:
        del level, text


def lost(kind: str, name: str, taker: str = "/rosbridge_websocket") -> dict[str, Any]:
    text = f"{kind} {name} is provided by {taker} from now on: this client's offer has ended"
    return {"op": "status", "level": "error", "msg": text}


def test_client_cannot_take_a_built_in_action(bus: Bus) -> None:
    republisher = WebRepublisher(bus)
    client, user = Wire(bus), Wire(bus)
    name = "/tf2_web_republisher"
    (status,) = client.says(op="advertise_action", action=name, type=FIBONACCI, id=1)
    assert (status["msg"], status["id"]) == (f"Action {name} is provided by {name} alone", 1)
    client.peer.leave(0.0)
    assert bus.actions.by_name[name].owner is republisher
    goal = {"source_frames": ["a"], "target_frame": "b"}
    assert user.says(op="send_action_goal", action=name, args=goal, id="g") == []
    (done,) = user.says(op="cancel_action_goal", action=name, id="g")
    assert done["status"] == 5


def test_client_cannot_take_the_cancelling_of_a_built_in_action(bus: Bus) -> None:
    WebRepublisher(bus)
    (status,) = Wire(bus).says(op="advertise_service", service="/tf2_web_republisher" + CANCEL, type=TRIGGER)
    assert status["msg"].endswith("is provided by /tf2_web_republisher alone")


def test_client_that_loses_its_service_to_another_is_told(bus: Bus) -> None:
    first, second = Wire(bus), Wire(bus)
    first.says(op="advertise_service", service="/s", type=TRIGGER)
    assert second.says(op="advertise_service", service="s", type=TRIGGER) == []
    assert first.hears() == [lost("Service", "/s")]
    assert first.peer.services._provided == {}


def test_client_that_offers_its_own_again_is_told_nothing(bus: Bus) -> None:
    client = Wire(bus)
    for _ in range(2):
        assert client.says(op="advertise_service", service="/s", type=TRIGGER) == []
        assert client.says(op="advertise_action", action="/a", type=FIBONACCI) == []


def test_client_that_loses_its_action_to_another_is_told_and_its_goals_fail(bus: Bus) -> None:
    first, second, caller = Wire(bus), Wire(bus), Wire(bus)
    first.says(op="advertise_action", action="/a", type=FIBONACCI)
    caller.says(op="send_action_goal", action="/a", args={"order": 1}, id="g")
    first.hears()
    assert second.says(op="advertise_action", action="/a", type=FIBONACCI) == []
    assert first.hears() == [lost("Action", "/a")]
    (end,) = caller.hears()
    assert (end["result"], end["values"]) == (False, "Action /a was unadvertised")
    first.peer.leave(0.0)
    caller.says(op="send_action_goal", action="/a", args={"order": 1}, id="h")
    assert [frame["op"] for frame in second.hears()] == ["send_action_goal"]
    assert caller.calls("/a" + CANCEL)["result"] is True


def test_client_cannot_block_anothers_action_by_offering_its_cancelling_first(bus: Bus) -> None:
    blocker, provider, caller = Wire(bus), Wire(bus), Wire(bus)
    blocker.says(op="advertise_service", service="/a" + CANCEL, type=TRIGGER)
    assert provider.says(op="advertise_action", action="/a", type=FIBONACCI) == []
    assert blocker.hears() == [lost("Service", "/a" + CANCEL)]
    assert caller.calls("/a" + CANCEL)["result"] is True


def test_client_that_had_the_name_before_cannot_keep_it_from_a_part_of_the_server(bus: Bus) -> None:
    part, client = Part(), Wire(bus)
    client.says(op="advertise_service", service="/s", type=TRIGGER)
    client.says(op="advertise_action", action="/a", type=FIBONACCI)
    client.says(op="advertise_action", action="/b", type=FIBONACCI)
    bus.provide(part, "/s", TRIGGER, lambda *_: None, is_exclusive=True)
    bus.actions.provide(part, "/a", FIBONACCI, lambda _: None, lambda _: None, is_exclusive=True)
    bus.provide(part, "/b" + CANCEL, TRIGGER, lambda *_: None, is_exclusive=True)
    assert client.hears() == [
        lost("Service", "/s", "/morai_sim"),
        lost("Action", "/a", "/morai_sim"),
        lost("Service", "/b" + CANCEL, "/morai_sim"),
    ]
    for kind, name, type_name in (("service", "/s", TRIGGER), ("action", "/a", FIBONACCI)):
        (status,) = client.says(op=f"advertise_{kind}", type=type_name, **{kind: name})
        assert status["msg"] == f"{kind.capitalize()} {name} is provided by /morai_sim alone"


def test_action_whose_cancelling_cannot_be_had_leaves_all_as_it_was(bus: Bus) -> None:
    part, first, second = Part(), Wire(bus), Wire(bus)
    first.says(op="advertise_action", action="/a", type=FIBONACCI)
    bus.provide(part, "/a" + CANCEL, TRIGGER, lambda *_: None, is_exclusive=True)
    first.hears()
    (status,) = second.says(op="advertise_action", action="/a", type=FIBONACCI)
    assert status["msg"] == f"Service /a{CANCEL} is provided by /morai_sim alone"
    assert first.hears() == []
    assert bus.actions.by_name["/a"].owner is first.peer


def test_loser_that_answers_late_is_told_and_nothing_else_happens(bus: Bus) -> None:
    first, second, caller = Wire(bus), Wire(bus), Wire(bus)
    first.says(op="advertise_service", service="/s", type=TRIGGER)
    caller.says(op="call_service", service="/s", id="c")
    (call,) = first.hears()
    second.says(op="advertise_service", service="/s", type=TRIGGER)
    assert [frame["result"] for frame in caller.hears()] == [False]
    first.hears()
    (status,) = first.says(op="service_response", service="/s", id=call["id"], result=True, values={})
    assert status["level"] == "error"
    assert (caller.hears(), second.hears()) == ([], [])
