"""The simulator's topics and services under other names, switched off, and exchanged while it runs."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError, TypeNameError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topics_services import Answer, Call
from rosbridge_sim.loose_types import JsonValue, Struct
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from tests.simulator.sim_harness import Client, SimHarness, make_store, network_settings, put_egos

INT, TRIGGER = "std_msgs/Int32", "std_srvs/Trigger"


class PartOfServer(Participant):
    """An owner that gives way to no other."""

    def __init__(self, name: str) -> None:
        self.name = name

    def notify(self, level: str, text: str) -> None:
        pass


class RegistryFixture:
    """A publisher, a topic that is kept, a subscriber and two services of an owner, and somebody else."""

    def __init__(self, **tables: JsonValue) -> None:
        self.bus = Bus(make_store())
        self.owner, self.client = PartOfServer("/sim"), Client(self.bus, "/client")
        self.items = InterfaceRegistry(self.owner, self.bus, network_settings(tables))
        self.outputs = Publishers(self.owner, self.bus, self.items)
        self.outputs.add("/out", INT, self.count)
        self.kept = self.outputs.keep("/news", INT)
        self.bindings = SubscribersServices(self.items)
        self.bindings.listen("in", INT, lambda value, _sender, _now: self.taken.append(value.data))
        self.bindings.provide("ask", TRIGGER, self.keep)
        self.bindings.provide("tell", TRIGGER, self.keep)
        self.frame = 0
        self.taken: list[int] = []
        self.calls: list[Call] = []

    def count(self) -> Struct:
        return make_store().message(INT).struct_type(self.frame)

    def keep(self, call: Call, _now: float) -> None:
        self.calls.append(call)

    def show(self) -> None:
        self.frame += 1
        self.outputs.show_due(self.frame, self.frame * 0.02, self.frame * 0.02)
        self.outputs.update(self.kept, self.count(), 0.0)

    def change(self, **tables: JsonValue) -> None:
        settings = network_settings(tables)
        self.items.check(settings)
        self.items.change(settings, 0.0)

    def names(self) -> set[str]:
        """Of all that the owner has on the bus."""
        topics = self.bus.topics.values()
        out = {t.name for t in topics if self.owner in t.publishers}
        into = {t.name for t in topics if any(s.owner is self.owner for s in t.subscriptions)}
        return out | into | {s.name for s in self.bus.services.values() if s.owner is self.owner}


def opened(**tables: JsonValue) -> RegistryFixture:
    rig = RegistryFixture(**tables)
    assert rig.names() == set(), "nothing is there before all is known"
    rig.items.open()
    return rig


OTHERS = {
    "publishers": {"/out": {"name": "/o", "rate": 25}, "/news": {"name": "/n"}},
    "subscribers": {"/in": {"name": "/i"}},
    "services": {"/ask": {"name": "/a"}, "/tell": {"on": False}},
}


def test_interfaces_have_their_default_names_without_settings() -> None:
    assert opened().names() == {"/out", "/news", "/in", "/ask", "/tell"}


def test_interfaces_have_the_names_of_the_settings() -> None:
    rig = opened(**OTHERS)
    assert rig.names() == {"/o", "/n", "/i", "/a"}
    rig.client.listen("/o", "/n")
    rig.show()
    rig.show()
    rig.client.send("/i", INT, data=5)
    assert rig.client.heard == [("/n", {"data": 1}), ("/o", {"data": 2}), ("/n", {"data": 2})], "/o has 25 Hz"
    assert rig.taken == [5]
    assert (rig.bindings.topic("in"), rig.bindings.service("ask")) == ("/i", "/a")


def test_listing_has_every_interface_with_its_settings() -> None:
    listed = [(one.kind, one.default, one.name, one.is_on, one.rate) for one in opened(**OTHERS).items.listing()]
    assert listed == [
        (InterfaceKind.PUBLISHER, "/out", "/o", True, 25.0),
        (InterfaceKind.PUBLISHER, "/news", "/n", True, None),
        (InterfaceKind.SUBSCRIBER, "/in", "/i", True, None),
        (InterfaceKind.SERVICE, "/ask", "/a", True, None),
        (InterfaceKind.SERVICE, "/tell", "/tell", False, None),
    ]


# While it runs


def test_change_of_settings_renames_all_interfaces_and_back() -> None:
    rig = opened()
    rig.client.listen("/out", "/news")
    rig.show()
    rig.change(**OTHERS)
    assert rig.names() == {"/o", "/n", "/i", "/a"}
    rig.client.listen("/o", "/n")
    rig.show()
    rig.client.send("/in", INT, data=4)
    rig.client.send("/i", INT, data=5)
    rig.change()
    assert rig.names() == {"/out", "/news", "/in", "/ask", "/tell"}
    rig.show()
    assert rig.client.heard == [
        ("/out", {"data": 1}),
        ("/news", {"data": 1}),
        ("/o", {"data": 2}),
        ("/n", {"data": 2}),
        ("/news", {"data": 2}),  # what is kept is said again under the name that it comes back to
        ("/out", {"data": 3}),
        ("/news", {"data": 3}),
    ]
    assert rig.taken == [5]


def test_latched_message_moves_to_the_new_name() -> None:
    rig = opened()
    rig.show()
    rig.change(**OTHERS)
    topic = rig.bus.find_topic("/n")
    assert topic is not None
    assert [json.loads(message.json) for message in topic.latched] == [{"data": 1}]
    rig.change(publishers={"/news": {"on": False}})
    rig.show()
    rig.change()
    topic = rig.bus.find_topic("/news")
    assert topic is not None
    assert [json.loads(message.json) for message in topic.latched] == [{"data": 2}], "news from while it was off"


def test_pending_call_is_answered_after_its_service_was_renamed() -> None:
    rig = opened()
    answers: list[Answer] = []
    rig.bus.call(rig.client, "/ask", {}, answers.append, now=0.0)
    rig.change(**OTHERS)
    assert answers == []
    (call,) = rig.calls
    call.answer(call.service.type.response.default())
    assert [answer.is_ok for answer in answers] == [True]
    rig.bus.call(rig.client, "/ask", {}, answers.append, now=0.0)
    assert (answers[1].is_ok, answers[1].values) == (False, "Service /ask does not exist")


def test_removed_service_refuses_its_pending_calls() -> None:
    rig = opened()
    answers: list[Answer] = []
    rig.bus.call(rig.client, "/ask", {}, answers.append, now=0.0)
    rig.bindings.release(0.0)
    assert [answer.is_ok for answer in answers] == [False]
    assert rig.names() == {"/out", "/news"}
    rig.change(**OTHERS | {"services": {}, "subscribers": {}})
    assert rig.names() == {"/o", "/n"}


def test_repeats_move_with_a_renamed_topic() -> None:
    rig = opened(publishers={"/out": {"rate": 100}})
    rig.client.listen("/out")
    rig.show()
    rig.change(publishers={"/out": {"rate": 100, "name": "/o"}})
    rig.client.listen("/o")
    rig.outputs.repeat(1.0)
    assert rig.client.heard == [("/out", {"data": 1}), ("/o", {"data": 1})]
    rig.show()
    rig.change(publishers={"/out": {"on": False}})
    rig.outputs.repeat(1.0)
    assert len(rig.client.heard) == 3


def test_renamed_topic_leaves_nothing_under_its_old_name() -> None:
    rig = opened()
    rig.client.listen("/out")
    rig.show()
    rig.change(**OTHERS)
    assert rig.bus.find_topic("/news") is None
    assert rig.bus.find_topic("/in") is None
    out = rig.bus.find_topic("/out")
    assert out is not None
    assert (out.publishers, len(out.subscriptions)) == ({}, 1), "who listens there may go on waiting"


def test_topics_of_different_types_can_swap_names_with_subscribers() -> None:
    rig = RegistryFixture()
    rig.outputs.add("/text", "std_msgs/String", lambda: None)
    rig.items.open()
    swapped = {"/text": {"name": "/out"}, "/out": {"name": "/text"}}
    rig.change(publishers=swapped)
    assert [rig.bus.topics[name].type.name for name in ("/text", "/out")] == [INT, "std_msgs/String"]
    rig.bus.subscribe(rig.client, "/text", lambda *_: None, type_name=INT)
    rig.change(publishers={"/text": {"name": "/text"}})
    assert [rig.bus.topics[name].type.name for name in ("/text", "/out")] == ["std_msgs/String", INT]
    assert [level for level, text in rig.client.told if f"asks for {INT}" in text] == ["error"]


def test_topics_can_swap_names() -> None:
    rig = opened()
    rig.change(services={"/ask": {"name": "/tell"}, "/tell": {"name": "/ask"}})
    assert rig.names() == {"/out", "/news", "/in", "/ask", "/tell"}
    rig.bus.call(rig.client, "/tell", {}, lambda _answer: None, now=0.0)
    assert rig.bindings.service("ask") == "/tell"
    assert rig.calls[0].service.name == "/tell"


def test_subscriber_may_change_the_settings_during_a_frame() -> None:
    rig = opened()

    def hear(*_: object) -> None:
        rig.change(**OTHERS)

    rig.bus.subscribe(rig.client, "/out", hear)
    rig.show()
    rig.show()
    assert rig.names() == {"/o", "/n", "/i", "/a"}


CHOICES = st.fixed_dictionaries(
    {},
    optional={
        "name": st.sampled_from(["/out", "/news", "/in", "/ask", "/tell", "/x", "/y", "/z", "/theirs"]),
        "on": st.booleans(),
    },
)

TABLES = st.fixed_dictionaries(
    {},
    optional={
        "publishers": st.dictionaries(st.sampled_from(["/out", "/news"]), CHOICES),
        "subscribers": st.dictionaries(st.just("/in"), CHOICES),
        "services": st.dictionaries(st.sampled_from(["/ask", "/tell"]), CHOICES),
    },
)


@given(st.lists(TABLES, max_size=5))
def test_any_sequence_of_changes_ends_with_the_last_valid_settings(changes: list[dict[str, Any]]) -> None:
    rig = opened()
    rig.bus.advertise(rig.client, "/theirs", "std_msgs/String")
    rig.bus.provide(rig.client, "/theirs", TRIGGER, lambda *_: None)
    wanted = rig.names()
    for tables in changes:
        with suppress(DocumentError):
            rig.change(**tables)
            wanted = {item.name for item in rig.items.listing() if item.is_on}
        assert rig.names() == wanted
        rig.show()
    with suppress(DocumentError):
        rig.change()
    rig.bus.leave(rig.client, 0.0)
    rig.change()
    rig.bus.expire(1_000.0)
    assert set(rig.bus.topics) == {"/out", "/news", "/in"}
    assert set(rig.bus.services) == {"/ask", "/tell"}


# Mistakes


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (
            {"publishers": {"/oup": {}}},
            'publishers."/oup": the simulator has no such publisher (did you mean /out?)',
        ),
        ({"services": {"/in": {}}}, 'services."/in": the simulator has no such service; /in is a subscriber'),
        ({"services": {"/zzz": {}}}, 'services."/zzz": the simulator has no such service'),
        (
            {"publishers": {"/news": {"rate": 5}}},
            'publishers."/news": expected no rate: it is published only when it changes',
        ),
        (
            {"services": {"/ask": {"name": "/x"}, "/tell": {"name": "/x"}}},
            'services."/tell": expected different names for /ask and /tell; got /x for both',
        ),
        (
            {"services": {"/ask": {"name": "/tell"}}},
            'services."/ask": expected different names for /ask and /tell; got /tell for both',
        ),
        (
            {"subscribers": {"/in": {"name": "/out"}}},
            'subscribers."/in": expected different names for /out and /in; got /out for both',
        ),
        (
            {"publishers": {"/Ego-2/out": {"name": "/Ego-2/in"}}},
            'publishers."/Ego-2/out": expected different names for /Ego-2/out and /Ego-2/in; got /Ego-2/in for both',
        ),
        (
            {"publishers": {"/Ego-2/out": {"name": "/out"}}},
            'publishers."/Ego-2/out": expected different names for /out and /Ego-2/out; got /out for both',
        ),
    ],
)
def test_invalid_settings_are_refused_at_the_start_and_later(tables: dict[str, Any], said: str) -> None:
    rig = RegistryFixture(**tables)
    with pytest.raises(DocumentError) as caught:
        rig.items.open()
    assert str(caught.value) == said
    running = opened()
    with pytest.raises(DocumentError):
        running.change(**tables)
    assert running.names() == {"/out", "/news", "/in", "/ask", "/tell"}


def test_topic_service_and_disabled_service_may_share_a_name() -> None:
    off = {"/tell": {"name": "/ask", "on": False}}
    assert opened(subscribers={"/in": {"name": "/ask"}}, services=off).names() == {"/out", "/news", "/ask"}


def test_a_publisher_and_a_subscriber_of_one_default_name_share_it() -> None:
    rig = RegistryFixture()
    rig.bindings.listen("out", INT, lambda *_: None)
    rig.items.open()
    both = {"publishers": {"/out": {"name": "/o"}}, "subscribers": {"/out": {"name": "/o"}}}
    rig.change(**both)
    assert rig.names() == {"/o", "/news", "/in", "/ask", "/tell"}


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"services": {"/ask": {"name": "/theirs"}}}, "service /theirs is provided by /other"),
        ({"publishers": {"/out": {"name": "/numbers"}}}, "topic /numbers is published by /other"),
        ({"subscribers": {"/in": {"name": "/texts"}}}, "already established with type std_msgs/String"),
        ({"publishers": {"/news": {"name": "/texts"}}}, "topic /texts is published by /other"),
        ({"publishers": {"/news": {"name": "/heard"}}}, "already established with type std_msgs/String"),
    ],
)
def test_name_of_another_component_is_refused_and_nothing_changes(tables: dict[str, Any], said: str) -> None:
    rig = opened()
    other = PartOfServer("/other")
    rig.bus.provide(other, "/theirs", TRIGGER, lambda *_: None)
    rig.bus.advertise(other, "/numbers", INT)
    rig.bus.advertise(other, "/texts", "std_msgs/String")
    rig.bus.subscribe(other, "/heard", lambda *_: None, type_name="std_msgs/String")
    with pytest.raises(DocumentError, match=said):
        rig.change(**tables | {"services": {"/tell": {"on": False}} | tables.get("services", {})})
    assert rig.names() == {"/out", "/news", "/in", "/ask", "/tell"}


def test_name_is_taken_from_a_client_that_is_notified() -> None:
    rig = opened()
    rig.bus.provide(rig.client, "/theirs", TRIGGER, lambda *_: None)
    rig.bus.advertise(rig.client, "/numbers", INT)
    rig.bus.advertise(rig.client, "/texts", "std_msgs/String")
    rig.bus.subscribe(rig.client, "/heard", lambda *_: None, type_name="std_msgs/String")
    rig.change(
        services={"/ask": {"name": "/theirs"}},
        publishers={"/out": {"name": "/numbers"}, "/news": {"name": "/heard"}},
        subscribers={"/in": {"name": "/texts"}},
    )
    assert rig.names() == {"/numbers", "/heard", "/texts", "/theirs", "/tell"}
    assert sorted(rig.client.lost) == [("service", "/theirs"), ("topic", "/numbers"), ("topic", "/texts")]
    assert len(rig.client.told) == 4
    rig.show()
    assert rig.client.heard == [], "its listener asks for another type"


def test_topic_with_client_publishers_can_become_an_input() -> None:
    rig = opened()
    rig.client.send("/numbers", INT, data=1)
    rig.change(subscribers={"/in": {"name": "/numbers"}})
    rig.client.send("/numbers", INT, data=2)
    assert rig.taken == [2]


def test_name_of_a_rosapi_service_is_refused_at_the_start() -> None:
    rig = RegistryFixture(services={"/ask": {"name": "/rosapi/topics"}})
    Rosapi(rig.bus)
    with pytest.raises(DocumentError, match=r'^services."/ask": service /rosapi/topics is provided by /rosapi$'):
        rig.items.open()


def test_type_missing_in_a_release_has_no_interface_and_its_settings_are_ignored() -> None:
    rig = RegistryFixture(services={"/new": {"name": "/n"}}, publishers={"/newer": {"rate": 5}})
    rig.bindings.provide("new", "OnlyThereSrv", rig.keep, is_everywhere=False)
    rig.items.add(PeriodicPublisher("/newer", "morai_msgs/OnlyThere", rig.count), is_everywhere=False)
    rig.items.open()
    assert rig.names() == {"/out", "/news", "/in", "/ask", "/tell"}
    rig.show()
    with pytest.raises(TypeNameError):
        rig.bindings.provide("newest", "OnlyThereSrv", rig.keep)


# The simulator's own


def test_car_is_driven_under_custom_names() -> None:
    harness = SimHarness(
        network={
            "publishers": {"/Ego_topic": {"name": "/car/state"}, "/SyncModeInfo": {"name": "/mode"}},
            "subscribers": {"/ctrl_cmd": {"name": "/car/drive"}, "/ctrl_cmd_0": {"on": False}},
            "services": {"/SyncModeCmd": {"name": "/lead"}, "/sim/reset": {"on": False}},
        }
    )
    client = harness.client()
    client.listen("/car/state", "/mode")
    client.send("/car/drive", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=30.0)
    harness.run(1.0)
    assert client.messages("/car/state")[-1]["velocity"]["x"] > 1.0
    assert client.ask("/lead", user_id="me", start_sync_mode=True)["result"] is True
    assert client.messages("/mode")[-1]["master_id"] == "me"
    for gone in ("/SyncModeCmd", "/sim/reset"):
        assert client.refused(gone) == f"Service {gone} does not exist"
    client.send("/car/drive", "morai_msgs/CtrlCmd")
    assert client.told == [("warning", "/car/drive is ignored in synchronous mode: use /SyncModeCtrlCmd")]


def test_disabled_interface_is_not_listed_and_its_name_is_free() -> None:
    harness = SimHarness(
        network={"publishers": {"/Ego_topic": {"on": False}}, "services": {"/Service_MoraiSL": {"on": False}}}
    )
    assert harness.bus.find_topic("/Ego_topic") is None
    assert "/Service_MoraiSL" not in harness.bus.services
    client = harness.client()
    client.send("/Ego_topic", "std_msgs/Int32", data=1)
    harness.bus.provide(client, "/Service_MoraiSL", TRIGGER, lambda *_: None)


def test_further_ego_has_the_first_egos_names_under_its_prefix() -> None:
    harness = SimHarness(
        network={
            "publishers": {"/Ego_topic": {"name": "/my/ego"}, "/Ego-3/Ego_topic": {"name": "/third"}},
            "subscribers": {"/lamps": {"on": False}},
            "services": {"/SyncModeCmd": {"name": "/my/lead"}},
        }
    )
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2, 3))
    client.listen("/Ego-2/my/ego", "/third")
    harness.run(0.02)
    assert [name for name, _ in client.heard] == ["/Ego-2/my/ego", "/third"]
    assert client.ask("/Ego-3/my/lead", user_id="me", start_sync_mode=True)["result"] is True
    for name in ("/Ego-2/Ego_topic", "/Ego-3/my/ego", "/Ego-2/lamps", "/Ego-2/SyncModeCmd"):
        assert harness.bus.find_topic(name) is None
        assert name not in harness.bus.services


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_every_interface_of_a_release_can_be_renamed_and_disabled(release: str) -> None:
    def names(harness: SimHarness) -> set[str]:
        topics = harness.bus.topics.values()
        mine = {
            t.name
            for t in topics
            if harness.node.participant in t.publishers
            or any(s.owner is harness.node.participant for s in t.subscriptions)
        }
        return mine | set(harness.bus.services)

    usual = SimHarness(release=release)
    items = list(usual.node.interfaces.listing())
    assert {item.name for item in items} == names(usual)
    renamed: dict[str, Any] = {kind.value: {} for kind in InterfaceKind}
    off: dict[str, Any] = {kind.value: {} for kind in InterfaceKind}
    for item in items:
        renamed[item.kind.value][item.default] = {"name": f"/{item.kind.value}{item.default}"}
        off[item.kind.value][item.default] = {"on": False}
    assert names(SimHarness(release=release, network=renamed)) == {f"/{item.kind.value}{item.name}" for item in items}
    silent = SimHarness(release=release, network=off)
    silent.run(0.1)
    assert (names(silent), silent.world.frame) == (set(), 5)


def test_settings_of_one_release_work_with_the_other() -> None:
    for one, other in (("22.R2", "26.R1"), ("26.R1", "22.R2")):
        whole: dict[str, dict[str, Any]] = {kind.value: {} for kind in InterfaceKind}
        for item in SimHarness(release=one).node.interfaces.listing():
            whole[item.kind.value][item.default] = {"name": item.name, "on": item.is_on}
        SimHarness(release=other, network=whole)


def test_reset_keeps_the_network_settings() -> None:
    harness = SimHarness(network={"services": {"/sim/reset": {"name": "/again"}}})
    client = harness.client()
    assert client.call("/again", {"seed": 3}).is_ok
    assert "/again" in harness.bus.services
