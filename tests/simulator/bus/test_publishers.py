from __future__ import annotations

import pytest

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from tests.simulator.sim_harness import Client, SimHarness, make_store, network_settings, put_egos, rates


@pytest.mark.parametrize("rate", [1.0, 7.0, 10.0, 30.0, 50.0, 60.0, 100.0, 119.88, 120.0])
def test_a_rate_is_exact_over_any_stretch(rate: float) -> None:
    feed = PeriodicPublisher("/x", "std_msgs/Int32", lambda: None)
    feed.tune(rate)
    for first in (1, 1_000_001):
        counts = [feed.num_due(frame) for frame in range(first, first + 2_500)]
        assert sum(counts) == pytest.approx(rate * 50.0, abs=1.0)
        assert set(counts) <= {int(rate // 50), int(rate // 50) + 1}


def test_ten_hertz_is_every_fifth_frame_regardless_of_subscribers() -> None:
    harness = SimHarness(network=rates({"/Ego_topic": 10.0}))
    harness.run(0.14)
    late = harness.client()
    late.listen("/Ego_topic")
    harness.run(1.0)
    frames = [message["header"]["seq"] for message in late.messages("/Ego_topic")]
    assert frames == list(range(10, 58, 5))


def test_a_hundred_hertz_sends_every_state_twice_with_its_own_stamp() -> None:
    harness = SimHarness(network=rates({"Ego_topic": 100.0}))
    client = harness.client()
    client.listen("/Ego_topic", "/Object_topic")
    harness.run(0.1)  # the last frame's second half is still to come
    frames = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    assert frames == [1, 1, 2, 2, 3, 3, 4, 4, 5]
    assert client.raw[0] == client.raw[2]
    assert len(client.messages("/Object_topic")) == 5
    harness.run(0.01)
    assert len(client.messages("/Ego_topic")) == 10


def test_repeats_divide_the_frame_evenly() -> None:
    """A client at 100 Hz expects a message every 10 ms, not after 7 ms and then 13 ms."""
    harness = SimHarness(network=rates({"Ego_topic": 100.0}))
    client = harness.client()
    client.listen("/Ego_topic")
    harness.run(0.1)
    num = len(client.messages("/Ego_topic"))
    harness.run(0.009)
    assert len(client.messages("/Ego_topic")) == num
    harness.run(0.001)
    assert len(client.messages("/Ego_topic")) == num + 1


def test_late_repeats_keep_their_order() -> None:
    harness = SimHarness(network=rates({"/Ego_topic": 120.0}))
    client = harness.client()
    client.listen("/Ego_topic")
    harness.node.advance(100.0)
    harness.node.advance(100.1)
    frames = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    assert frames == sorted(frames)
    assert frames == [1, 1, 2, 2, 3, 3, 3, 4, 4, 5]  # of frame 5 the first, whose time has come


def test_synchronous_mode_sends_every_frame_once_at_any_rate() -> None:
    for rate in (10.0, 120.0):
        harness = SimHarness(network=rates({"/Ego_topic": rate}))
        client = harness.client()
        client.start(time_step=100)
        client.listen("/Ego_topic")
        client.tick()
        client.tick()
        assert [message["header"]["seq"] for message in client.messages("/Ego_topic")] == list(range(1, 11))


def sampled(chosen: dict[str, float]) -> tuple[Publishers, Client]:
    bus = Bus(make_store())
    owner, listener = Client(bus, "/a"), Client(bus, "/b")
    items = InterfaceRegistry(owner, bus, network_settings(rates(chosen)))
    outputs = Publishers(owner, bus, items)
    make = make_store().message("std_msgs/Int32").default
    outputs.add("/five", "std_msgs/Int32", make, rate=5.0, is_sampled=True)
    outputs.add("/fast", "std_msgs/Int32", make, rate=120.0, is_sampled=True)
    outputs.add("/state", "std_msgs/Int32", make, rate=5.0)
    items.open()
    listener.listen("/five", "/fast", "/state")
    return outputs, listener


def test_sampled_topic_keeps_its_rate_in_synchronous_mode_and_comes_at_most_once_a_frame() -> None:
    outputs, listener = sampled({})
    for frame in range(1, 51):
        outputs.show_every(frame, 0.0)
    assert [len(listener.messages(topic)) for topic in ("/five", "/fast", "/state")] == [5, 50, 50]


def test_chosen_rate_overrides_the_default_rate() -> None:
    outputs, listener = sampled({"/state": 10.0})
    for frame in range(1, 51):
        outputs.show_due(frame, frame * 0.02, frame * 0.02)
    outputs.repeat(2.0)
    assert [len(listener.messages(topic)) for topic in ("/five", "/fast", "/state")] == [5, 120, 10]


def test_nothing_is_repeated_after_real_time_has_stopped() -> None:
    harness = SimHarness(network=rates({"/Ego_topic": 100.0}))
    client = harness.client()
    client.listen("/Ego_topic")
    harness.run(0.02)
    client.start()
    assert harness.node.next_due(harness.now) is None
    harness.run(1.0)
    assert len(client.messages("/Ego_topic")) == 1


@pytest.mark.parametrize("rate", [0.0, -1.0, 120.5, float("nan")])
def test_a_rate_out_of_bounds_is_refused(rate: float) -> None:
    with pytest.raises(
        DocumentError, match=r"publishers\.\"/Ego_topic\"\.rate: expected more than 0 and at most 120 Hz, got"
    ):
        SimHarness(network=rates({"/Ego_topic": rate}))


def test_failing_subscriber_does_not_stop_the_world(caplog: pytest.LogCaptureFixture) -> None:
    bus = Bus(make_store())
    owner, listener = Client(bus, "/a"), Client(bus, "/b")
    items = InterfaceRegistry(owner, bus)
    outputs = Publishers(owner, bus, items)
    outputs.add("/clock", "rosgraph_msgs/Clock", make_store().message("rosgraph_msgs/Clock").default)
    items.open()

    def complain(_topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        raise FieldError("not that one")

    bus.subscribe(listener, "/clock", complain)
    outputs.show_every(1, 0.0)
    assert "a listener of /clock refused a message: not that one" in caplog.text


# In a pause

SHOWN = ("/Ego_topic", "/Object_topic", "/IntscnTL_topic", "/GetTrafficLightStatus", "/InsnStatus")
"""Of the first ego, in its pause."""

SILENT = ("/clock", "/tf", "/gps", "/imu", "/CollisionData", "/VehicleCollisionData", "/ReplayInfo_topic")


def pause(harness: SimHarness, client: Client, *, is_paused: bool = True) -> None:
    client.now = harness.now
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=is_paused)


@pytest.fixture
def paused() -> tuple[SimHarness, Client]:
    """A world that was paused after 0.3 s, and the client that did it."""
    harness = SimHarness("crossing")
    client = harness.client()
    harness.run(0.3)
    pause(harness, client)
    return harness, client


def count_of(client: Client) -> dict[str, int]:
    """How many messages it heard, by topic."""
    return {topic: len(client.messages(topic)) for topic, _ in client.heard}


def test_states_are_shown_once_a_second_in_a_pause() -> None:
    harness = SimHarness("crossing")
    client = harness.client()
    client.listen(*SHOWN, *SILENT)
    harness.run(0.3)
    pause(harness, client)
    last = {topic: client.messages(topic)[-1] for topic in count_of(client)}
    client.heard.clear()
    harness.run(0.9)
    assert not client.heard
    harness.run(3.0)
    heard = count_of(client)
    assert heard == dict.fromkeys([topic for topic in SHOWN if topic in last], 3)
    assert {"/Ego_topic", "/Object_topic", "/IntscnTL_topic", "/GetTrafficLightStatus"} <= set(heard)
    assert all(message == last[topic] for topic, message in client.heard), "header.seq and stamp among it"


def test_new_subscriber_alone_gets_a_paused_world_at_once(paused: tuple[SimHarness, Client]) -> None:
    harness, client = paused
    client.listen("/Ego_topic", "/clock", "/tf", "/gps")
    assert harness.node.next_due(harness.now) == harness.now
    harness.run(0.0)
    late = harness.client()
    late.listen("/Ego_topic", "/Object_topic")
    harness.run(0.0)
    assert count_of(client) == {"/Ego_topic": 1}
    assert count_of(late) == {"/Ego_topic": 1, "/Object_topic": 1}
    assert late.messages("/Ego_topic")[0]["header"]["seq"] == harness.world.frame


def test_paused_world_without_subscribers_sets_no_timer(paused: tuple[SimHarness, Client]) -> None:
    harness, client = paused
    assert harness.node.next_due(harness.now) is None
    client.listen("/Ego_topic")
    harness.run(10.0)
    assert len(client.heard) == 11
    client.leave()
    assert harness.node.next_due(harness.now) is None


def test_further_egos_are_shown_in_a_pause_too() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    harness.run(0.1)
    pause(harness, client)
    client.listen("/Ego-2/Ego_topic", "/Ego-2/Object_topic")
    harness.run(0.0)
    assert set(count_of(client)) == {"/Ego-2/Ego_topic", "/Ego-2/Object_topic"}


def test_states_are_not_shown_again_once_the_pause_is_over(paused: tuple[SimHarness, Client]) -> None:
    harness, client = paused
    client.listen("/Ego_topic")
    pause(harness, client, is_paused=False)
    harness.run(2.0)
    frames = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    assert frames == list(range(frames[0], frames[0] + len(frames)))


def test_no_state_is_published_between_ticks(paused: tuple[SimHarness, Client]) -> None:
    harness, client = paused
    client.start()
    late = harness.client()
    late.listen("/Ego_topic")
    harness.run(5.0)
    assert not late.heard, "LED_PAUSED"
    pause(harness, client, is_paused=False)
    harness.run(5.0)
    assert not late.heard, "LED"
    client.tick()
    assert len(late.heard) == 1
    waiting = SimHarness(start="sync")
    late = waiting.client()
    late.listen("/Ego_topic")
    waiting.run(5.0)
    pause(waiting, late)
    waiting.run(5.0)
    assert not late.heard, "OPEN and OPEN_PAUSED"
    pause(waiting, late, is_paused=False)
    waiting.run(5.0)
    assert not late.heard, "OPEN again"


def test_recorder_gets_no_states_during_a_pause(paused: tuple[SimHarness, Client]) -> None:
    harness, client = paused
    heard: list[Topic] = []

    def note(topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        heard.append(topic)

    harness.bus.subscribe(client, "/Ego_topic", note, is_recording=True)
    harness.run(3.0)
    assert not heard
    assert harness.node.next_due(harness.now) is None


def test_failing_subscriber_in_a_pause_does_not_affect_others(paused: tuple[SimHarness, Client]) -> None:
    harness, client = paused

    def fail(_topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        raise FieldError("not this one")

    harness.bus.subscribe(client, "/Ego_topic", fail)
    late = harness.client()
    late.listen("/Ego_topic")
    harness.run(2.0)
    assert count_of(late) == {"/Ego_topic": 3}


def test_removed_ego_is_not_published_in_a_pause() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    harness.run(0.1)
    pause(harness, client)
    client.listen("/Ego-2/Ego_topic")
    harness.run(0.0)
    harness.node.reset(None, harness.now)
    client.heard.clear()
    harness.run(3.0)
    assert not client.heard
