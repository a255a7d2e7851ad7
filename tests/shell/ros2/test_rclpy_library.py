"""The parts of the node by rclpy that need no rclpy. `end_to_end/test_rclpy.py` has real nodes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.shell.files.definitions import read_installed
from rosbridge_sim.shell.ros2.rclpy_library import ANSWERS_PER_PERIOD, InstalledTypes, Pacer, refusal_of


def test_a_burst_of_answers_is_spread_and_a_single_one_goes_at_once() -> None:
    timers: list[Callable[[], None]] = []
    done: list[int] = []
    pacer = Pacer(lambda _delay, work: timers.append(work))
    for i in range(2 * ANSWERS_PER_PERIOD + 1):
        pacer.do(partial(done.append, i))
    counts = [len(done)]
    while timers:
        timers.pop()()
        counts.append(len(done))
    assert counts == [ANSWERS_PER_PERIOD, 2 * ANSWERS_PER_PERIOD, *[2 * ANSWERS_PER_PERIOD + 1] * 2]
    pacer.do(partial(done.append, -1))
    assert done[-1] == -1


@pytest.mark.parametrize(
    ("response", "told"),
    [
        ({"success": False, "message": ""}, {"success": False, "message": "why"}),
        ({"success": False, "status_message": ""}, {"success": False, "status_message": "why"}),
        ({"success": False}, {"success": False}),
        ({"success": 0, "message": ""}, None),
        ({"message": ""}, None),
    ],
)
def test_a_failed_call_becomes_a_response_where_its_type_can_say_so(
    response: dict[str, object], told: dict[str, object] | None
) -> None:
    refusal = refusal_of(SimpleNamespace(**response), "why")
    assert (None if refusal is None else vars(refusal)) == told


def test_types_of_packages_that_are_not_installed_import_nothing(tmp_path: Path) -> None:
    for kind, name in (("msg", "Speed.msg"), ("srv", "Stop.srv")):
        folder = tmp_path / "own_msgs" / kind
        folder.mkdir(parents=True)
        (folder / name).write_text("float64 speed\n---\n" if kind == "srv" else "float64 speed\n")
    types = InstalledTypes(read_installed([tmp_path, tmp_path / "own_msgs"]))
    assert sorted(types.texts) == [("own_msgs", "msg", "Speed"), ("own_msgs", "srv", "Stop")]
    with pytest.raises(GraphError, match="antigravity/msg/This is not installed for ROS 2; build its package"):
        types.find("antigravity/msg/This")
    with pytest.raises(GraphError, match="own_msgs/msg/Speed cannot be used by rclpy: ModuleNotFoundError"):
        types.find("own_msgs/msg/Speed")
    assert not types.has("own_msgs/msg/Speed")


def test_earlier_folders_win_as_in_ament_prefix_path(tmp_path: Path) -> None:
    for share, text in (("overlay", "float64 speed\n"), ("base", "float32 speed\n")):
        (tmp_path / share / "own_msgs" / "msg").mkdir(parents=True)
        (tmp_path / share / "own_msgs" / "msg" / "Speed.msg").write_text(text)
    texts = read_installed([tmp_path / "overlay", tmp_path / "base"])
    assert texts["own_msgs", "msg", "Speed"] == "float64 speed\n"
