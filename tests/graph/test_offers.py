"""Services and actions taken over by another participant: built-in ones never; a client that loses one is told."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from tests.graph.bus_fixture import Wire, make_bus

TRIGGER, FIBONACCI = "std_srvs/Trigger", "example_interfaces/Fibonacci"

CANCEL = "/_action/cancel_goal"


@pytest.fixture
def bus() -> Bus:
    return make_bus()


class ServerComponent(Participant):
    """A part of the server: it gives way to no client."""

    name = "/morai_sim"

    def notify(self, level: str, text: str) -> None:
        del level, text


def lost(kind: str, name: str, taker: str = "/rosbridge_websocket") -> dict[str, Any]:
    text = f"{kind} {name} is provided by {taker} from now on: this client's offer has ended"
    return {"op": "status", "level": "error", "msg": text}


def test_client_cannot_advertise_a_built_in_action(bus: Bus) -> None:
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


def test_client_cannot_advertise_the_cancel_service_of_a_built_in_action(bus: Bus) -> None:
    WebRepublisher(bus)
    (status,) = Wire(bus).says(op="advertise_service", service="/tf2_web_republisher" + CANCEL, type=TRIGGER)
    assert status["msg"].endswith("is provided by /tf2_web_republisher alone")


def test_client_that_loses_its_service_to_another_is_notified(bus: Bus) -> None:
    first, second = Wire(bus), Wire(bus)
    first.says(op="advertise_service", service="/s", type=TRIGGER)
    assert second.says(op="advertise_service", service="s", type=TRIGGER) == []
    assert first.hears() == [lost("Service", "/s")]
    assert first.peer.services._provided == {}


def test_client_that_readvertises_its_own_service_is_not_notified(bus: Bus) -> None:
    client = Wire(bus)
    for _ in range(2):
        assert client.says(op="advertise_service", service="/s", type=TRIGGER) == []
        assert client.says(op="advertise_action", action="/a", type=FIBONACCI) == []


def test_client_that_loses_its_action_is_notified_and_its_goals_fail(bus: Bus) -> None:
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


def test_client_cannot_block_an_action_by_advertising_its_cancel_service_first(bus: Bus) -> None:
    blocker, provider, caller = Wire(bus), Wire(bus), Wire(bus)
    blocker.says(op="advertise_service", service="/a" + CANCEL, type=TRIGGER)
    assert provider.says(op="advertise_action", action="/a", type=FIBONACCI) == []
    assert blocker.hears() == [lost("Service", "/a" + CANCEL)]
    assert caller.calls("/a" + CANCEL)["result"] is True


def test_component_takes_a_name_that_a_client_had_before(bus: Bus) -> None:
    part, client = ServerComponent(), Wire(bus)
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


def test_action_without_a_free_cancel_service_changes_nothing(bus: Bus) -> None:
    part, first, second = ServerComponent(), Wire(bus), Wire(bus)
    first.says(op="advertise_action", action="/a", type=FIBONACCI)
    bus.provide(part, "/a" + CANCEL, TRIGGER, lambda *_: None, is_exclusive=True)
    first.hears()
    (status,) = second.says(op="advertise_action", action="/a", type=FIBONACCI)
    assert status["msg"] == f"Service /a{CANCEL} is provided by /morai_sim alone"
    assert first.hears() == []
    assert bus.actions.by_name["/a"].owner is first.peer


def test_late_answer_of_a_replaced_provider_is_reported_and_ignored(bus: Bus) -> None:
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
