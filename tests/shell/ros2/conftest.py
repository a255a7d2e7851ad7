"""These tests need the DDS library, which does not exist for every system."""

from __future__ import annotations

import importlib.util
import os
import platform
import sys

import pytest

collect_ignore: list[str] = []

if importlib.util.find_spec("cyclonedds") is None:
    collect_ignore += ["test_ros2_node.py", "test_dds_library.py", "test_looking.py", "test_loopback.py"]
    exists = sys.version_info < (3, 14) and (sys.platform != "linux" or platform.machine() == "x86_64")
    if exists and os.environ.get("CI") == "true":
        raise pytest.UsageError("needs cyclonedds: pip install -e '.[ros2]' (./scripts/test does it)")
