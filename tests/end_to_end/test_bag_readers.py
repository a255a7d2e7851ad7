"""Our bags in other readers: Debian's `rosbag`, and those of Foxglove and Lichtblick."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim import Simulator
from tests.conftest import Connect
from tests.cpu_time import run
from tests.support import miss, require_node_modules, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

CLIENTS = Path(__file__).parent / "clients"

DEBIAN = "/usr/bin/python3"
"""The Python for which Debian's packages are made, whichever one runs the tests."""

ROSBAG = """
import json, sys, rosbag
with rosbag.Bag(sys.argv[1]) as bag:
    info = bag.get_type_and_topic_info().topics
    seen = [(topic, stamp.to_nsec(), message.position.x, message.velocity.x)
            for topic, message, stamp in bag.read_messages("/Ego_topic")]
    print(json.dumps({"types": {topic: one.msg_type for topic, one in info.items()}, "seen": seen,
                      "num": sum(1 for _ in bag.read_messages())}))
"""

NUM_TICKS = 20

STAMPS = [frame * 20_000_000 for frame in range(1, NUM_TICKS + 1)]


async def record_drive(path: Path, connect: Connect) -> list[tuple[float, float]]:
    """Record a drive; where the ego was and how fast, as a subscriber heard it."""
    async with Simulator(port=0, start="sync", record=path) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic="/Ego_topic")
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.ask("/SyncModeCtrlCmd", frame=1, command={"longlCmdType": 1, "accel": 0.5, "steering": 0.05})
        for frame in range(1, NUM_TICKS + 1):
            await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame)
        heard = [await client.message("/Ego_topic") for _ in range(NUM_TICKS)]
    return [(one["position"]["x"], one["velocity"]["x"]) for one in heard]


def answer_of(*command: str) -> Any:  # noqa: ANN401 - whatever the program prints
    return json_of(run(command))


def json_of(done: subprocess.CompletedProcess[str]) -> Any:  # noqa: ANN401 - the same
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


async def test_rosbag_of_debian_reads_our_ros1_bag(tmp_path: Path, connect: Connect) -> None:
    heard = await record_drive(tmp_path / "drive.bag", connect)
    command = [DEBIAN, "-c", ROSBAG, str(tmp_path / "drive.bag")]
    done = run(command) if shutil.which(DEBIAN) else None
    if done is None or "ModuleNotFoundError" in done.stderr:
        miss("needs Debian's package python3-rosbag")
    answer = json_of(done)
    assert answer["types"]["/Ego_topic"] == "morai_msgs/EgoVehicleStatus"
    assert answer["types"]["/clock"] == "rosgraph_msgs/Clock"
    assert [(stamp_ns, (x, speed)) for _, stamp_ns, x, speed in answer["seen"]] == list(zip(STAMPS, heard, strict=True))
    assert answer["num"] > 5 * NUM_TICKS


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap"])
async def test_readers_of_foxglove_and_lichtblick_read_our_bags(tmp_path: Path, connect: Connect, name: str) -> None:
    require_node_modules()
    heard = await record_drive(tmp_path / name, connect)
    seen = answer_of(require_tool("node"), str(CLIENTS / "bag.mjs"), str(tmp_path / name))
    egos = [(int(stamp), message) for topic, stamp, message in seen if topic == "/Ego_topic"]
    assert [stamp for stamp, _ in egos] == STAMPS
    assert [(one["position"]["x"], one["velocity"]["x"]) for _, one in egos] == heard
    objects = next(message for topic, _, message in seen if topic == "/Object_topic")
    assert len(objects["npc_list"]) == objects["num_of_npcs"] > 0
    assert len(seen) > 5 * NUM_TICKS
