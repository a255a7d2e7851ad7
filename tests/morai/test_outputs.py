from __future__ import annotations

import pytest

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.graph.bus import Bus, Owner, Topic
from rosbridge_sim.morai.items import Items
from rosbridge_sim.morai.outputs import Feed, Outputs
from rosbridge_sim.schema.store import Message
from tests.morai.stand import Client, Stand, make_store, network_settings, rates


@pytest.mark.parametrize("rate", [1.0, 7.0, 10.0, 30.0, 50.0, 60.0, 100.0, 119.88, 120.0])
def test_a_rate_is_exact_over_any_stretch(rate: float) -> None:
    feed = Feed("/x", "std_msgs/Int32", lambda: None)
    feed.tune(rate)
    counts = [feed.num_due(frame) for frame in range(1, 50_001)]
    assert sum(counts) == pytest.approx(rate * 1_000.0, abs=1.0)
    assert set(counts) <= {int(rate // 50), int(rate // 50) + 1}


def test_ten_hertz_is_every_fifth_frame_whoever_listens_when() -> None:
    stand = Stand(network=rates({"/Ego_topic": 10.0}))
    stand.run(0.14)
    late = stand.client()
    late.listen("/Ego_topic")
    stand.run(1.0)
    frames = [message["header"]["seq"] for message in late.messages("/Ego_topic")]
    assert frames == list(range(10, 58, 5))


def test_a_hundred_hertz_sends_every_state_twice_with_its_own_stamp() -> None:
    stand = Stand(network=rates({"Ego_topic": 100.0}))
    client = stand.client()
    client.listen("/Ego_topic", "/Object_topic")
    stand.run(0.1)  # the last frame's second half is still to come
    frames = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    assert frames == [1, 1, 2, 2, 3, 3, 4, 4, 5]
    assert client.raw[0] == client.raw[2]
    assert len(client.messages("/Object_topic")) == 5
    stand.run(0.01)
    assert len(client.messages("/Ego_topic")) == 10


def test_repeats_come_in_their_order_even_when_all_is_late() -> None:
    stand = Stand(network=rates({"/Ego_topic": 120.0}))
    client = stand.client()
    client.listen("/Ego_topic")
    stand.node.advance(100.0)
    stand.node.advance(100.1)
    frames = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    assert frames == sorted(frames)
    assert frames == [1, 1, 2, 2, 3, 3, 3, 4, 4, 5]  # of frame 5 the first, whose time has come


def test_synchronous_mode_sends_every_frame_once_at_any_rate() -> None:
    for rate in (10.0, 120.0):
        stand = Stand(network=rates({"/Ego_topic": rate}))
        client = stand.client()
        client.start(time_step=100)
        client.listen("/Ego_topic")
        client.tick()
        client.tick()
        assert [message["header"]["seq"] for message in client.messages("/Ego_topic")] == list(range(1, 11))


def sampled(chosen: dict[str, float]) -> tuple[Outputs, Client]:
    bus = Bus(make_store())
    owner, listener = Client(bus, "/a"), Client(bus, "/b")
    items = Items(owner, bus, network_settings(rates(chosen)))
    outputs = Outputs(owner, bus, items)
    make = make_store().message("std_msgs/Int32").default
    outputs.add("/five", "std_msgs/Int32", make, rate=5.0, is_sampled=True)
    outputs.add("/fast", "std_msgs/Int32", make, rate=120.0, is_sampled=True)
    outputs.add("/state", "std_msgs/Int32", make, rate=5.0)
    items.open()
    listener.listen("/five", "/fast", "/state")
    return outputs, listener


def test_what_is_sampled_keeps_its_rate_in_synchronous_mode_and_comes_once_a_frame_at_most() -> None:
    outputs, listener = sampled({})
    for frame in range(1, 51):
        outputs.show_every(frame, 0.0)
    assert [len(listener.messages(topic)) for topic in ("/five", "/fast", "/state")] == [5, 50, 50]


def test_the_usual_rate_of_a_topic_gives_way_to_one_that_somebody_chose() -> None:
    outputs, listener = sampled({"/state": 10.0})
    for frame in range(1, 51):
        outputs.show_due(frame, frame * 0.02, frame * 0.02)
    outputs.repeat(2.0)
    assert [len(listener.messages(topic)) for topic in ("/five", "/fast", "/state")] == [5, 120, 10]


def test_nothing_is_repeated_after_real_time_has_stopped() -> None:
    stand = Stand(network=rates({"/Ego_topic": 100.0}))
    client = stand.client()
    client.listen("/Ego_topic")
    stand.run(0.02)
    client.start()
    assert stand.node.next_due(stand.now) is None
    stand.run(1.0)
    assert len(client.messages("/Ego_topic")) == 1


@pytest.mark.parametrize("rate", [0.0, -1.0, 120.5, float("nan")])
def test_a_rate_out_of_bounds_is_refused(rate: float) -> None:
    with pytest.raises(
        DocumentError, match=r"publishers\.\"/Ego_topic\"\.rate: expected more than 0 and at most 120 Hz; got"
    ):
        Stand(network=rates({"/Ego_topic": rate}))


def test_a_listener_that_complains_does_not_stop_the_world(caplog: pytest.LogCaptureFixture) -> None:
    bus = Bus(make_store())
    owner, listener = Client(bus, "/a"), Client(bus, "/b")
    items = Items(owner, bus)
    outputs = Outputs(owner, bus, items)
    outputs.add("/clock", "rosgraph_msgs/Clock", make_store().message("rosgraph_msgs/Clock").default)
    items.open()

    def complain(_topic: Topic, _message: Message, _sender: Owner, _now: float) -> None:
        raise FieldError("not that one")

    bus.subscribe(listener, "/clock", complain)
    outputs.show_every(1, 0.0)
    assert "a listener of /clock refused a message: not that one" in caplog.text
