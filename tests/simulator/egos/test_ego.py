from __future__ import annotations

import logging
from collections.abc import Callable

import pytest

from rosbridge_sim.morai.messages.command_parsing import GhostPose
from rosbridge_sim.morai.messages.control import Control
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.simulator.egos.ego import CtrlMode, Ego
from rosbridge_sim.world.state.world import Body, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.simulator.sim_harness import make_store

THROTTLE = Control(Mode.PEDALS, steer=0.0, throttle=1.0, brake=0.0, speed=0.0, accel=0.0)


def an_ego() -> tuple[World, Ego]:
    world = World()
    world.spawn(Kind.EGO, Body(), name="car", x=0.0, y=0.0, uid=0)
    return world, Ego(world, Converter(make_store()), 0, CtrlMode.EXTERNAL)


def test_a_status_is_made_once_for_each_state() -> None:
    world, ego = an_ego()
    status = ego.status()
    assert ego.status() is status
    world.x[ego.row] = 5.0
    ego.forget_status()
    assert ego.status().position.x == 5.0


def test_ego_is_found_after_its_row_changed() -> None:
    world, ego = an_ego()
    world.spawn(Kind.VEHICLE, Body(), name="other", x=0.0, y=0.0)
    world.remove(0)
    world.spawn(Kind.VEHICLE, Body(), name="third", x=0.0, y=0.0)
    world.spawn(Kind.EGO, Body(), name="car", x=9.0, y=0.0, uid=0)
    assert ego.row == 2
    ego.forget_status()
    assert ego.status().position.x == 9.0


def test_gear_changes_only_at_rest() -> None:
    world, ego = an_ego()
    assert ego.shift(Gear.REVERSE) is None
    ego.control(THROTTLE)
    for _ in range(10):
        step(world)
    why = ego.shift(Gear.DRIVE)
    assert why is not None
    assert why.startswith("gear DRIVE refused")
    assert ego.gear is Gear.REVERSE
    assert ego.shift(Gear.REVERSE) is None


@pytest.mark.parametrize("change", ["teleport", "reset_controls", "shift"])
def test_refused_gear_is_logged_once_and_again_after_the_car_has_changed(
    change: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Clients ask until it works, so one line is enough; after a new start the refusal is news again."""
    caplog.set_level(logging.INFO, "rosbridge_sim")
    world, ego = an_ego()
    changes: dict[str, Callable[[], object]] = {
        "teleport": lambda: ego.teleport(GhostPose(5.0, 0.0, 0.0, 0.0, 0.0, 0.0, speed=9.0)),
        "reset_controls": ego.reset_controls,
        "shift": lambda: ego.shift(ego.gear),
    }
    world.speed[ego.row] = 9.0
    for _ in range(3):
        assert ego.shift(Gear.REVERSE) is not None
    assert [record.getMessage().split(":")[0] for record in caplog.records] == ["gear REVERSE refused"]
    changes[change]()
    for _ in range(3):
        assert ego.shift(Gear.REVERSE) is not None
    assert len(caplog.records) == 2


def test_refused_gear_is_no_part_of_the_state() -> None:
    world, ego = an_ego()
    world.speed[ego.row] = 9.0
    state = ego.save_state()
    assert ego.shift(Gear.REVERSE) is not None
    assert ego.save_state() == state


def test_only_a_change_from_client_control_releases_the_pedals() -> None:
    world, ego = an_ego()
    ego.control(THROTTLE)
    ego.set_ctrl_mode(CtrlMode.EXTERNAL)
    assert world.throttle[ego.row] == 1.0
    ego.set_ctrl_mode(CtrlMode.GAME_PAD)
    assert world.throttle[ego.row] == 0.0
    ego.control(THROTTLE)
    ego.set_ctrl_mode(CtrlMode.KEYBOARD)
    assert world.throttle[ego.row] == 1.0


def test_new_ego_has_its_lamps_off() -> None:
    _, ego = an_ego()
    ego.turn_signal = ego.emergency_signal = 1
    ego.reset_controls()
    assert ego.lamps == (0, 0)
