"""`/sim/score`, topic and service: when scores begin, for whom, and what the wire says."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos


def scores_of(client: Client, *, reset: bool = False) -> dict[str, Any]:
    """The response of the service."""
    answer = client.call("/sim/score", {"reset": reset})
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def in_sync(scenario: str = "crossing", **settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings'
    harness = SimHarness(scenario, start="sync", **settings)
    client = harness.client()
    client.start()
    return harness, client


def ticks(client: Client, num: int) -> None:
    for _ in range(num):
        client.tick()


def drive(client: Client) -> None:
    assert client.control(0, longlCmdType=2, velocity=36.0)


def test_first_call_begins_to_keep_scores_and_says_so() -> None:
    harness, client = in_sync()
    drive(client)
    ticks(client, 10)
    assert not harness.world.is_scoring
    first = scores_of(client)
    assert (first["result"], first["message"]) == (True, "scores are kept from now on, frame 10")
    assert [(one["unique_id"], one["since_frame"], one["distance"]) for one in first["scores"]] == [(0, 10, 0.0)]
    before = harness.world.x[0]
    ticks(client, 10)
    second = scores_of(client)
    assert second["message"] == ""
    assert second["scores"][0]["distance"] == pytest.approx(harness.world.x[0] - before)


def test_subscription_begins_to_keep_scores_and_topic_says_what_the_service_says() -> None:
    harness, client = in_sync()
    ticks(client, 3)
    client.listen("/sim/score")
    assert harness.world.is_scoring
    drive(client)
    ticks(client, 4)
    heard = client.messages("/sim/score")
    assert [message["header"]["seq"] for message in heard] == [4, 5, 6, 7]
    assert heard[-1]["scores"] == scores_of(client)["scores"]
    assert heard[-1]["scores"][0]["since_frame"] == 3


def test_subscription_to_all_topics_does_not_begin_scores_and_gets_them_later() -> None:
    harness, client = in_sync()
    heard: list[Message] = []

    def hear(_topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        heard.append(message)

    harness.bus.subscribe(harness.client(), "/sim/score", hear, is_general=True)
    ticks(client, 2)
    assert not harness.world.is_scoring
    assert heard == []
    scores_of(client)
    ticks(client, 2)
    assert len(heard) == 2


def test_scores_from_the_start_are_kept_without_a_question_and_after_a_reset() -> None:
    harness, client = in_sync(score=True)
    ticks(client, 5)
    first = harness.world.digest()
    assert scores_of(client)["scores"][0]["since_frame"] == 0
    client.call("/sim/reset", {"seed": -1})
    assert harness.world.is_scoring
    ticks(client, 5)
    assert harness.world.digest() == first


def test_reset_of_the_world_ends_scores_unless_a_subscriber_is_there() -> None:
    harness, client = in_sync()
    scores_of(client)
    ticks(client, 2)
    client.call("/sim/reset", {"seed": -1})
    assert not harness.world.is_scoring
    client.listen("/sim/score")
    ticks(client, 2)
    client.call("/sim/reset", {"seed": -1})
    ticks(client, 1)
    assert client.messages("/sim/score")[-1]["scores"][0]["since_frame"] == 0
    assert client.messages("/sim/score")[-1]["header"]["seq"] == 1


def test_reset_of_scores_answers_what_was_counted_until_then() -> None:
    _, client = in_sync()
    scores_of(client)
    drive(client)
    ticks(client, 50)
    last = scores_of(client, reset=True)["scores"][0]
    assert last["distance"] > 0.5
    anew = scores_of(client)["scores"][0]
    assert (anew["since_frame"], anew["distance"], anew["max_jerk"]) == (50, 0.0, 0.0)


def test_further_egos_have_scores_under_their_numbers() -> None:
    harness, client = in_sync("parked")
    scores_of(client)
    ticks(client, 2)
    places = {f"global_position_{axis}": [0.0, 0.0] for axis in "xyz"}
    egos = put_egos(0, 5) | places
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **egos)
    ticks(client, 1)
    scores = scores_of(client)["scores"]
    assert [(one["unique_id"], one["since_frame"], one["collision_ids"]) for one in scores] == [
        (0, 0, [5]),
        (5, 2, [0]),
    ]
    assert [one["time_to_collision"] for one in scores] == [0.0, 0.0]
    assert harness.world.is_scoring


def test_scenario_load_keeps_scores_and_counts_a_new_ego_from_there() -> None:
    _, client = in_sync()
    client.listen("/sim/score")
    ticks(client, 3)
    client.send("/ScenarioLoad", "morai_msgs/ScenarioLoad", file_name="elsewhere", **ALL)
    ticks(client, 2)
    score = client.messages("/sim/score")[-1]["scores"][0]
    assert score["since_frame"] == 3
    assert score["off_road_time"] == 0.0


def test_time_to_collision_that_there_is_not_is_minus_one() -> None:
    _, client = in_sync("parked")
    scores_of(client)
    ticks(client, 1)
    score = scores_of(client)["scores"][0]
    assert (score["time_to_collision"], score["min_time_to_collision"]) == (-1.0, -1.0)


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_both_releases_have_scores(release: str) -> None:
    harness = SimHarness("crossing", start="sync", release=release)
    client = harness.client()
    client.start()
    client.listen("/sim/score")
    client.tick()
    assert len(client.messages("/sim/score")) == 1


def test_scores_are_shown_in_a_pause() -> None:
    harness = SimHarness("crossing", score=True)
    client = harness.client()
    harness.run(0.1)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    client.listen("/sim/score")
    harness.run(1.5)
    assert client.messages("/sim/score")


def test_wrong_request_is_refused_and_begins_nothing() -> None:
    harness, client = in_sync()
    answer = client.call("/sim/score", {"reset": "yes"})
    assert not answer.is_ok
    assert "reset" in str(answer.values)
    assert not harness.world.is_scoring


def test_scores_begun_while_nobody_listens_are_told_by_current_messages() -> None:
    harness, client = in_sync()
    assert "/sim/score" not in {topic.name for topic, _ in harness.node.context.publishers.current()}
    assert not harness.world.is_scoring
    scores_of(client)
    assert "/sim/score" in {topic.name for topic, _ in harness.node.context.publishers.current()}


def test_topic_that_is_turned_off_leaves_the_service() -> None:
    _, client = in_sync(network={"publishers": {"/sim/score": {"on": False}}})
    assert scores_of(client)["scores"][0]["unique_id"] == 0
    assert scores_of(client)["result"]
