"""The planner of `scripts/examples/`, as a user runs it: it overtakes, touches nobody, and publishes its plans."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from rosbridge_sim.client import Client
from tests.cpu_time import run
from tests.support import PATIENCE, ROOT, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

SECONDS = 20
"""Of the drive: the ego comes up to the first vehicle on its lane, and changes to the next one."""


def test_planner_overtakes_and_publishes_a_path_and_its_candidates(tmp_path: Path) -> None:
    server = ServerProcess(tmp_path / "log.txt", ("--scenario", "loop", "--start", "sync"))
    try:
        with Client(server.url, timeout=PATIENCE) as client:
            client.score(reset=True)
            paths = client.subscribe("/plan/path", "nav_msgs/Path", keep=1_000)
            candidates = client.subscribe("/plan/candidates", "visualization_msgs/MarkerArray", keep=1_000)
            client.confirm()
            command = [sys.executable, str(ROOT / "scripts" / "examples" / "plan_lanes.py")]
            done = run([*command, "--url", server.url, "--seconds", str(SECONDS)])
            assert (done.returncode, done.stderr) == (0, "")
            client.confirm()
            found, marks = paths.take(), candidates.take()
            (score,) = client.score()
    finally:
        server.stop_cleanly()
    changes = re.search(r"(\d+) lane changes, now at (\d+) km/h", done.stdout)
    assert changes is not None, done.stdout
    assert int(changes[2]) > 80
    assert len(found) == len(marks) == SECONDS * 5
    assert {len(one["markers"]) for one in marks} == {5}  # three lanes, and two ways between them
    assert all(len(one["poses"]) >= 20 and one["header"]["frame_id"] == "map" for one in found)
    assert score["collisions"] == 0
    assert score["distance"] > 300.0
    assert score["off_road_time"] == 0.0
