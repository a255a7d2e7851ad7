"""Lock step without ticks: after each frame real time waits for a command."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from tests.simulator.sensor_rigs.test_mounted_sensors import CAMERA, IMAGE
from tests.simulator.sensors.analytic_makers import ManualWorker
from tests.simulator.sim_harness import Client, SimHarness, put_egos

ACKERMANN = "ackermann_msgs/AckermannDriveStamped"
LONG = 5.0
DEADLINE = 1.0


def in_lock_step(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - as SimHarness
    harness = SimHarness(command_deadline=DEADLINE, standard_topics=True, **settings)
    return harness, harness.client()


def step(harness: SimHarness, client: Client) -> None:
    """Command the ego, and let a little real time pass."""
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", accel=0.5)
    harness.run(0.02)


def command_with_stamp(harness: SimHarness, client: Client, frame: int) -> None:
    header = {"stamp": {"secs": frame // 50, "nsecs": frame % 50 * 20_000_000}, "frame_id": ""}
    client.send("/ackermann_cmd", ACKERMANN, header=header, drive={"speed": 5.0})
    harness.run(0.02)


def test_each_frame_waits_for_a_command_that_came_after_its_topics() -> None:
    harness, client = in_lock_step()
    harness.run(DEADLINE / 2)
    assert harness.world.frame == 0
    for frame in range(1, 6):
        step(harness, client)
        harness.run(DEADLINE / 2)
        assert harness.world.frame == frame


def test_frames_are_no_faster_than_real_time() -> None:
    harness, client = in_lock_step()
    harness.run(0.0)
    for _ in range(100):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", accel=0.5)
        harness.run(0.001)
    assert harness.world.frame == 5


def test_as_fast_as_possible_is_as_fast_as_commands_come_and_publishes_every_frame() -> None:
    harness, client = in_lock_step(real_time_factor=0.0)
    client.listen("/odom", "/clock", "/SyncModeInfo")
    client.heard.clear()
    for _ in range(100):
        client.send("/cmd_vel", "geometry_msgs/Twist", linear={"x": 1.0})
        harness.run(0.0)
    assert harness.world.frame == 100
    assert len(client.messages("/odom")) == len(client.messages("/clock")) == 100


def test_a_stamp_must_be_that_of_the_frame() -> None:
    harness, client = in_lock_step()
    command_with_stamp(harness, client, 0)
    assert harness.world.frame == 1
    harness.run(0.1)
    command_with_stamp(harness, client, 3)
    assert harness.world.frame == 1
    command_with_stamp(harness, client, 1)
    assert harness.world.frame == 2
    command_with_stamp(harness, client, 0)  # a stamp of 0 is none
    assert harness.world.frame == 3


def test_a_command_of_another_frame_is_followed_all_the_same() -> None:
    harness, client = in_lock_step()
    command_with_stamp(harness, client, 500)
    harness.run(LONG)
    assert harness.world.speed[0] > 0.0


def test_at_the_deadline_the_last_command_holds_which_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    harness, client = in_lock_step()
    step(harness, client)
    with caplog.at_level(logging.WARNING):
        harness.run(3 * DEADLINE + 0.1)
    assert harness.world.frame == 4
    assert harness.world.speed[0] > 0.0
    (line,) = caplog.messages
    assert line == (
        "no command for ego 0 came within 1 s of the frame at 0.02 s; the last command holds, and each frame waits as"
        " long"
    )


def test_a_wrong_stamp_is_named_at_the_deadline(caplog: pytest.LogCaptureFixture) -> None:
    harness, client = in_lock_step()
    command_with_stamp(harness, client, 500)
    with caplog.at_level(logging.WARNING):
        harness.run(DEADLINE)
    assert "The last command has header.stamp 10.00 s: copy the stamp" in caplog.text


def test_a_long_wait_is_no_stall_and_is_not_made_up_for_without_commands(caplog: pytest.LogCaptureFixture) -> None:
    harness, client = in_lock_step()
    step(harness, client)
    harness.run(0.9)
    with caplog.at_level(logging.WARNING):
        step(harness, client)
        harness.run(0.1)
    assert harness.world.frame == 2
    assert not caplog.messages


def test_every_ego_that_was_commanded_is_waited_for() -> None:
    harness, client = in_lock_step()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    step(harness, client)
    assert harness.world.frame == 1
    client.send("/Ego-2/ctrl_cmd", "morai_msgs/CtrlCmd", accel=0.5)
    step(harness, client)
    assert harness.world.frame == 2
    harness.run(0.1)
    step(harness, client)
    assert harness.world.frame == 2
    client.send("/Ego-2/ctrl_cmd", "morai_msgs/CtrlCmd", accel=0.5)
    harness.run(0.02)
    assert harness.world.frame == 3


def test_an_ego_that_no_client_may_command_is_not_waited_for() -> None:
    harness, _ = in_lock_step(start_mode="keyboard")
    harness.run(0.2)
    assert harness.world.frame == 10


def test_ticks_do_not_wait() -> None:
    harness, client = in_lock_step()
    harness.run(0.0)
    client.start()
    for _ in range(5):
        assert client.tick()["tick_status"]
    assert harness.world.frame == 5


def test_commands_of_before_a_reset_are_not_those_of_the_new_frame() -> None:
    harness, client = in_lock_step()
    step(harness, client)
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", accel=0.5)
    harness.node.reset(None, harness.now)
    harness.run(0.5)
    assert harness.world.frame == 0
    step(harness, client)
    assert harness.world.frame == 1


def test_the_next_frame_waits_for_the_pictures_of_the_last_one() -> None:
    worker = ManualWorker()
    harness, client = in_lock_step(sensors=(CAMERA,), worker=worker)
    client.listen(IMAGE)
    step(harness, client)
    step(harness, client)
    assert len(worker.jobs) == 1
    frame = harness.world.frame
    step(harness, client)
    harness.run(2 * DEADLINE)
    assert harness.world.frame == frame
    worker.finish(harness.now)
    assert len(client.messages(IMAGE)) == 1
    harness.run(0.0)
    assert harness.world.frame == frame + 1


def test_without_lock_step_nothing_waits() -> None:
    harness = SimHarness()
    harness.run(0.2)
    assert harness.world.frame == 10
