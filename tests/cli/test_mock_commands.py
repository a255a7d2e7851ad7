"""`rosbridge-sim mock check`: mistakes with their lines, and the content of a good file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rosbridge_sim.cli.command_table import TOOLS

ROBOT = """
topics:
  /odom: {type: nav_msgs/Odometry, rate: 50}
services:
  /enable: {type: std_srvs/SetBool}
transforms: [{parent: odom, child: base_link}]
"""


def test_good_file_is_summed_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    assert TOOLS["mock"](["check", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: good: 1 topics, 1 services, 1 transforms\n"


def test_mistakes_of_all_files_are_told_with_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text(ROBOT)
    bad.write_text(ROBOT.replace("Odometry", "Odometri").replace("SetBool", "SetBol"))
    assert TOOLS["mock"](["check", str(bad), str(good), str(tmp_path / "none.yaml")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("bad.yaml:3: topics./odom.type: ")
    assert lines[1].endswith("(did you mean SetBool?)")
    assert lines[3] == f"{tmp_path / 'none.yaml'}: cannot be read: No such file or directory"


def test_json_has_mistakes_or_content(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.yaml"
    path.write_bytes(b"topics: \xff")
    assert TOOLS["mock"](["check", "--json", str(path)]) == 1
    assert json.loads(capsys.readouterr().out) == {
        "file": str(path),
        "mistakes": ["robot.yaml: expected a text in UTF-8, got byte 0xff"],
        "content": {},
    }
