"""Reading changes nothing: no subscription and no question leads to another state of the simulator."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import pytest

from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.world.state.world import Dynamics
from tests.simulator.sensor_rigs.test_mounted_sensors import CAMERA, LIDAR, RADAR, SCAN
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import Client, SimHarness, put_egos

NUM_FRAMES = 8

QUESTIONS: dict[str, dict[str, Any]] = {
    "/sim/score": {},
    "/sim/state_hash": {},
    "/sim/snapshot": {"id": "here"},
    "/sim/snapshots": {},
    "/sim/describe": {},
    "/sim/map": {},
    "/sim/nearest_lane": {},
    "/sim/catalogue": {},
    "/sim/real_time_factor": {"factor": -1.0},
    "/sim/sensors": {},
    "/sim/weather": {},
}
"""Services that only read, with what is asked."""


def make(*, release: str = "22.R2", dynamics: Dynamics = Dynamics.KINEMATIC) -> SimHarness:
    return SimHarness(
        "crossing",
        release=release,
        dynamics=dynamics,
        start="sync",
        sensors=(CAMERA, LIDAR, SCAN, RADAR),
        worker=AtOnceWorker(),
        sensor_noise=SensorNoise(),
        standard_topics=True,
        traffic=3,
    )


def hash_of(client: Client) -> str:
    answer = client.call("/sim/state_hash", {})
    assert isinstance(answer.values, Message)
    return str(json.loads(answer.values.json)["hash"])


def hashes(*topics: str, service: str = "", **options: Any) -> list[str]:  # noqa: ANN401 - those of `make`
    """The hash behind each frame of a drive with two egos, beside one that reads."""
    harness = make(**options)
    client, reader = harness.client(), harness.client()
    client.start()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.tick()
    reader.listen(*topics)
    found = []
    for frame in range(NUM_FRAMES):
        assert client.control(frame + 1, longlCmdType=1, accel=0.4, front_steer=0.02)
        if service and frame % 3 == 0:
            answer = reader.call(service, QUESTIONS[service])
            assert answer.is_ok, answer.values
        client.tick()
        found.append(hash_of(client))
    if "/sim/score" in topics:
        assert len(reader.messages("/sim/score")) == NUM_FRAMES, "it is a topic that says something"
    return found


@cache
def undisturbed(dynamics: Dynamics) -> list[str]:
    """The hashes of the drive of which nobody asks anything."""
    return hashes(dynamics=dynamics)


def topics(release: str) -> list[str]:
    """The topics that the simulator publishes, those of the second ego among them."""
    harness = make(release=release)
    client = harness.client()
    client.start()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.tick()
    return sorted(name for name, topic in harness.bus.topics.items() if harness.node.participant in topic.publishers)


@pytest.mark.slow
@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_no_subscription_changes_a_state_hash(release: str) -> None:
    expected = hashes(release=release)
    assert len(set(expected)) == NUM_FRAMES
    names = topics(release)
    assert {"/sim/score", "/sim/drivers", "/Object_topic", "/image_jpeg/compressed"} <= set(names)
    assert [name for name in names if hashes(name, release=release) != expected] == []


def test_all_subscriptions_together_change_no_state_hash() -> None:
    assert hashes(*topics("26.R1"), release="26.R1") == hashes(release="26.R1")


@pytest.mark.parametrize("service", QUESTIONS)
@pytest.mark.parametrize("dynamics", [Dynamics.KINEMATIC, Dynamics.SINGLE_TRACK], ids=lambda one: one.name)
def test_no_question_changes_a_state_hash(service: str, dynamics: Dynamics) -> None:
    assert hashes(service=service, dynamics=dynamics) == undisturbed(dynamics)
