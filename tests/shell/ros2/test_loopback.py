"""Packets of other machines at a server that looks for nodes of ROS 2 on its own machine."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests import fork_server

PROGRAM = Path(__file__).with_name("two_machines.py")


def may_make_namespaces() -> bool:
    if not (shutil.which("unshare") and shutil.which("ip")):
        return False
    return subprocess.run(["unshare", "-n", "true"], capture_output=True, check=False).returncode == 0


@pytest.mark.slow
@pytest.mark.skipif(not may_make_namespaces(), reason="needs Linux, iproute2 and root for a second network")
def test_packets_of_another_machine_reach_nothing_of_a_server_on_loopback() -> None:
    done = fork_server.run([PROGRAM])
    assert done.returncode == 0, done.stderr
    *ports_of_ros2, open_port = json.loads(done.stdout)
    assert ports_of_ros2 == ["refused", "refused"]
    assert open_port == "RTPS", "the cable works"
