"""A server without what POSIX systems alone have: it serves, ends well, and knows what to say.

`windows_like.py` takes these things away. What it cannot show is Windows itself.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Connect
from tests.shell.bags.bag_reading import read_bag
from tests.support import PATIENCE, ROOT, Process

pytestmark = pytest.mark.slow

PROGRAM = ["-m", "tests.shell.windows_like"]


@pytest.mark.parametrize(
    ("number", "name"), [(signal.SIGINT, "SIGINT"), (signal.SIGTERM, "SIGTERM"), (signal.SIGUSR1, "SIGBREAK")]
)
async def test_server_is_driven_and_ends_well_at_each_signal(
    tmp_path: Path, connect: Connect, number: signal.Signals, name: str
) -> None:
    bag = tmp_path / "a.bag"
    command = [*PROGRAM, "serve", "--port", "0", "--start", "sync", "--record", str(bag)]
    server = Process(tmp_path / "log.txt", command, "rosbridge-sim listening on ")
    client = await connect(server.said)
    await client.send("advertise", topic="/chat", type="std_msgs/String")
    await client.send("subscribe", topic="/chat")
    await client.send("publish", topic="/chat", msg={"data": "안녕"})
    heard = await client.take("publish", topic="/chat")
    assert heard["msg"] == {"data": "안녕"}
    assert server.stop(number) == 0
    assert f"{name}: stopping" in server.log
    assert "Traceback" not in server.log
    assert read_bag(bag)


def test_command_line_answers_and_refuses_as_elsewhere() -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *PROGRAM, *words], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False
        )

    refused = run("serve", "--prot", "1")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    listed = run("schema", "list", "morai_msgs")
    assert (listed.returncode, listed.stderr) == (0, "")
