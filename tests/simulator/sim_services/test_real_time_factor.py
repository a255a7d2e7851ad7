"""/sim/real_time_factor: the world runs faster or slower, and topics stay within 120 messages a second."""

from __future__ import annotations

import json
from itertools import count, pairwise
from typing import Any

import pytest

from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.publishers import MAX_WALL_RATE
from rosbridge_sim.simulator.kernel.real_time_pacer import MAX_FACTOR, MIN_FACTOR
from tests.simulator.sim_harness import Client, SimHarness, put_egos


def values(client: Client, **request: object) -> dict[str, Any]:
    answer = client.call("/sim/real_time_factor", request)
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    response: dict[str, Any] = json.loads(answer.values.json)
    return response


def set_factor(harness: SimHarness, client: Client, factor: float) -> None:
    client.now = harness.now
    response = values(client, factor=factor)
    assert (response["result"], response["message"], response["factor"]) == (True, "", factor)


@pytest.mark.parametrize("factor", [MIN_FACTOR, 0.5, 1.0, 2.0, 3.7, MAX_FACTOR])
def test_world_runs_as_fast_as_the_factor_says(factor: float) -> None:
    harness = SimHarness()
    client = harness.client()
    set_factor(harness, client, factor)
    harness.run(6.0 / factor)
    assert harness.world.frame == pytest.approx(300, abs=1)
    client.now = harness.now
    assert values(client, factor=-1.0)["measured"] == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize(("factor", "rate"), [(0.5, 25), (2.0, 100), (2.4, 120), (5.0, 120), (20.0, 120)])
def test_topics_count_simulated_time_and_stay_within_the_limit_of_wall_time(factor: float, rate: float) -> None:
    harness = SimHarness(network={"publishers": {"/gps": {"rate": 10}, "/imu": {"rate": 120}}})
    client = harness.client()
    set_factor(harness, client, factor)
    client.listen("/Ego_topic", "/gps", "/imu", "/clock", "/SyncModeInfo")
    harness.run(1.0)
    nums = {name: len(client.messages(name)) for name in ("/Ego_topic", "/clock", "/SyncModeInfo", "/gps", "/imu")}
    for name in ("/Ego_topic", "/clock", "/SyncModeInfo"):
        assert nums[name] == pytest.approx(rate, abs=1), name
    assert nums["/gps"] == pytest.approx(min(10 * factor, MAX_WALL_RATE), abs=1)
    assert nums["/imu"] == pytest.approx(min(120 * factor, MAX_WALL_RATE), abs=2)
    frames = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    gaps = {later - earlier for earlier, later in pairwise(frames)}
    assert max(gaps) - min(gaps) <= 1, "they are spread evenly"


def test_as_fast_as_possible_computes_frames_whenever_it_is_asked_and_ends_its_turns() -> None:
    harness = SimHarness()
    client = harness.client()
    set_factor(harness, client, 0.0)
    client.listen("/Ego_topic", "/SyncModeInfo")
    ticks = count()
    harness.node.limit_turns(lambda: next(ticks) / 1024)  # each look at the clock takes a millisecond
    for _ in range(150):
        assert (harness.node.next_due(harness.now) or 0.0) <= harness.now
        before = harness.world.frame
        harness.node.advance(harness.now)
        assert harness.world.frame - before == 4
        harness.now += 0.001
    assert harness.world.frame == 600
    for topic in ("/Ego_topic", "/SyncModeInfo"):
        assert 15 <= len(client.messages(topic)) <= 0.15 * MAX_WALL_RATE
    assert harness.node.real_time_lag(harness.now) == 0.0
    assert harness.node.context.pacer.num_stalls == 0
    client.now = harness.now
    assert values(client, factor=-1.0)["measured"] == pytest.approx(80.0, rel=0.02)
    set_factor(harness, client, 1.0)
    harness.run(1.0)
    assert harness.world.frame == pytest.approx(650, abs=1)


def test_bytes_of_the_frames_that_go_out_do_not_depend_on_the_factor() -> None:
    raws = []
    for factor in (1.0, 20.0):
        harness = SimHarness()
        client = harness.client()
        set_factor(harness, client, factor)
        client.listen("/Ego_topic", "/Object_topic")
        harness.run(4.0 / factor)
        raws.append(client.raw)
    assert set(raws[1]) <= set(raws[0])
    assert len(raws[1]) > 40


def test_latched_state_of_the_mode_is_that_of_the_last_frame_when_the_world_stops() -> None:
    harness = SimHarness()
    client = harness.client()
    set_factor(harness, client, 20.0)
    client.listen("/SyncModeInfo")
    harness.run(0.5)
    client.now = harness.now
    for what in ({"option": 8, "set_pause": True}, {"option": 8, "set_pause": False}):
        client.ask("/Service_MoraiEventCmd", **what)
        assert client.messages("/SyncModeInfo")[-1]["frame"] == harness.world.frame


@pytest.mark.parametrize("factor", [0.05, 20.5, None, 1e308])
def test_number_that_is_no_factor_is_refused(factor: float | None) -> None:
    harness = SimHarness()
    client = harness.client()
    response = values(client, factor=factor)
    assert (response["result"], response["factor"]) == (False, 1.0)
    assert response["message"].startswith("factor: expected 0.1 to 20, or 0 for as fast as possible; got ")
    assert client.told[-1][0] == "error"


def test_factor_is_set_in_free_mode_only_and_holds_after_synchronous_mode_and_a_reset() -> None:
    harness = SimHarness(real_time_factor=2.0)
    client = harness.client()
    client.now = harness.now
    client.start()
    refused = values(client, factor=3.0)
    assert (refused["result"], refused["factor"], refused["measured"]) == (False, 2.0, 0.0)
    assert refused["message"].startswith("synchronous mode is on")
    assert values(client, factor=-1.0)["result"]
    client.stop()
    client.call("/sim/reset", {"seed": -1})
    harness.run(1.0)
    assert harness.world.frame == pytest.approx(100, abs=1)


def test_stamps_of_the_time_of_day_allow_no_factor_but_one() -> None:
    harness = SimHarness(real_time_factor=4.0)
    client = harness.client()
    harness.node.use_wall_time(lambda: 10**18, harness.now)
    asked = values(client, factor=-1.0)
    assert (asked["result"], asked["factor"]) == (True, 1.0)
    refused = values(client, factor=2.0)
    assert "stamps are the time of day" in refused["message"]
    assert values(client, factor=1.0)["result"]


def test_further_ego_keeps_to_the_limit_too() -> None:
    harness = SimHarness(real_time_factor=10.0)
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.listen("/Ego-5/Ego_topic")
    harness.run(1.0)
    assert len(client.messages("/Ego-5/Ego_topic")) == pytest.approx(120, abs=2)
