"""Files of the package itself."""

from __future__ import annotations

import pytest

from rosbridge_sim.packaged import read_packaged


def test_a_file_is_found_wherever_the_program_was_started(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.chdir(str(tmp_path))
    assert read_packaged("schema/definitions/ros2.msgs").startswith("=== instead std_msgs/Header\n# When")


def test_a_missing_file_is_an_error() -> None:
    with pytest.raises(FileNotFoundError):
        read_packaged("schema/definitions/ros3.msgs")
