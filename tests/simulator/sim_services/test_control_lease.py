"""`/sim/control_lease`: pedals are lifted when their driver is lost."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.state.world import Mode
from tests.simulator.sim_harness import Client, SimHarness

LEASE = "/sim/control_lease"
COMMAND = "morai_msgs/CtrlCmd"


def driven(**fields: float) -> tuple[SimHarness, Client]:
    harness = SimHarness("crossing")
    driver = harness.client()
    driver.send("/ctrl_cmd", COMMAND, **({"longlCmdType": 1, "accel": 0.5, "steering": 0.1} | fields))
    return harness, driver


def pedals(harness: SimHarness) -> tuple[int, float, float, float]:
    """Mode, throttle, brake and wheels of the first ego."""
    world, row = harness.node.context.world, harness.node.context.egos.first.row
    columns = (world.mode, world.throttle, world.brake, world.steer_cmd)
    mode, throttle, brake, steer = (column.item(row) for column in columns)
    return int(mode), throttle, brake, steer


PRESSED = (Mode.PEDALS, 0.5, 0.0, 0.1)
LIFTED = (Mode.PEDALS, 0.0, 0.0, 0.1)


def lease(client: Client, **request: Any) -> dict[str, Any]:  # noqa: ANN401 - fields of the request
    answer = client.call(LEASE, request)
    assert isinstance(answer.values, Message)
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def test_pedals_stay_without_a_lease() -> None:
    harness, driver = driven()
    driver.leave()
    harness.run(2.0)
    assert pedals(harness) == PRESSED


def test_pedals_are_lifted_when_the_driver_disconnects_and_wheels_stay() -> None:
    harness, driver = driven()
    assert lease(driver, unique_id=0, seconds=60.0)["result"]
    harness.run(1.0)
    assert pedals(harness) == PRESSED
    driver.leave()
    assert pedals(harness) == LIFTED


def test_pedals_are_lifted_when_the_driver_is_silent() -> None:
    harness, driver = driven()
    lease(driver, seconds=0.5)
    harness.run(0.45)
    assert pedals(harness) == PRESSED
    driver.send("/ctrl_cmd", COMMAND, longlCmdType=1, accel=0.5, steering=0.1)
    harness.run(0.45)
    assert pedals(harness) == PRESSED, "the second command counts anew"
    harness.run(0.1)
    assert pedals(harness) == LIFTED


@pytest.mark.parametrize("command", [{"longlCmdType": 2, "velocity": 30.0}, {"longlCmdType": 3, "acceleration": 1.0}])
def test_speed_and_acceleration_end_as_well(command: dict[str, float]) -> None:
    harness, driver = driven(**command)
    lease(driver, seconds=0.1)
    harness.run(0.3)
    assert pedals(harness) == LIFTED


def test_command_of_another_client_is_left_alone() -> None:
    harness, driver = driven()
    lease(driver, seconds=0.5)
    other = harness.client()
    other.send("/ctrl_cmd", COMMAND, longlCmdType=1, accel=0.5, steering=0.1)
    harness.run(2.0)
    driver.leave()
    assert pedals(harness) == PRESSED


def test_lease_can_end() -> None:
    harness, driver = driven()
    lease(driver, seconds=0.5)
    assert lease(driver, unique_id=-1, seconds=0.0)["result"]
    harness.run(2.0)
    assert pedals(harness) == PRESSED


def test_time_of_synchronous_mode_does_not_count() -> None:
    harness, driver = driven()
    lease(driver, seconds=0.5)
    driver.start(time_step=1000)
    driver.tick()
    assert pedals(harness) == PRESSED


def test_reset_and_restored_frames_begin_the_lease_anew() -> None:
    harness, driver = driven()
    harness.run(1.0)
    driver.call("/sim/reset", {"seed": -1})
    driver.send("/ctrl_cmd", COMMAND, longlCmdType=1, accel=0.5, steering=0.1)
    lease(driver, seconds=0.5)
    harness.run(0.4)
    assert pedals(harness) == PRESSED
    harness.run(0.2)
    assert pedals(harness) == LIFTED


@pytest.mark.parametrize(
    ("request_fields", "text"),
    [
        ({"unique_id": 7, "seconds": 1.0}, "unique_id: expected the number of an ego (0), got 7"),
        ({"unique_id": -5, "seconds": 1.0}, "unique_id: expected the number of an ego (0), got -5"),
        ({"seconds": 0.05}, "seconds: expected 0.1 to 60, or 0 for the end of the lease; got 0.05"),
        ({"seconds": float("nan")}, "seconds: expected 0.1 to 60, or 0 for the end of the lease; got nan"),
        ({"seconds": -1.0}, "seconds: expected 0.1 to 60, or 0 for the end of the lease; got -1"),
    ],
)
def test_impossible_lease_is_refused_and_says_why(request_fields: dict[str, float], text: str) -> None:
    harness, driver = driven()
    answer = lease(driver, **request_fields)
    assert (answer["result"], answer["message"]) == (False, text)
    driver.leave()
    assert pedals(harness) == PRESSED
