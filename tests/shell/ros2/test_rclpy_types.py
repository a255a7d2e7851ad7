"""The installed types, as far as they need no rclpy. `end_to_end/test_rclpy.py` has real nodes."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.shell.files.definitions import read_installed
from rosbridge_sim.shell.ros2.rclpy_types import InstalledTypes


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
