"""The import of pyproj for latitudes and longitudes: in a thread, and no tick leaves out a message meanwhile."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.schema.message import Message
from tests.simulator.sim_harness import ManualReader, SimHarness
from tests.support import ROOT

THREADS = """
import asyncio, json, sys, threading
from websockets.asyncio.client import connect
from rosbridge_sim import Simulator

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "pyproj":
            print(threading.current_thread().name)

async def main(*ops):
    async with Simulator(port=0, standard_topics=True) as sim, connect(sim.url) as client:
        await client.send(json.dumps({"op": "subscribe", "topic": "/imu"}))
        await client.send(json.dumps({"op": "subscribe", "topic": "/Ego_topic"}))
        heard = set()
        while not heard >= {"/imu", "/Ego_topic"}:
            heard.add(json.loads(await client.recv()).get("topic"))
        assert "pyproj" not in sys.modules  # nobody has asked for a fix
        for op in ops:
            await client.send(json.dumps(op))
        message = {}
        while ops[-1]["id"] not in (message.get("id"), message.get("topic")):
            message = json.loads(await client.recv())

sys.meta_path.insert(0, Finder())
SYNC = {"request": {"user_id": "me", "start_sync_mode": True, "time_step": 20}}
STEP = {"user_id": "me", "n": 1, "topics": ["/gps"]}
"""
WAYS = {
    "gps": 'main({"op": "subscribe", "topic": "/gps", "id": "/gps"})',
    "fix": 'main({"op": "subscribe", "topic": "/fix", "id": "/fix"})',
    "step": 'main({"op": "call_service", "service": "/SyncModeCmd", "args": SYNC, "id": "a"}, '
    '{"op": "call_service", "service": "/sim/step", "args": STEP, "id": "b"})',
}


@pytest.mark.slow
@pytest.mark.parametrize("way", list(WAYS))
def test_server_imports_pyproj_at_the_first_fix_in_a_thread(way: str) -> None:
    code = f"{THREADS}\nasyncio.run({WAYS[way]})\nassert 'pyproj' in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "reading\n", "")


def in_sync(reader: ManualReader | None) -> tuple[SimHarness, list[Answer], Any]:
    """A world in synchronous mode with a listener of fixes, and a way to ask for ticks of two frames."""
    harness = SimHarness(start="sync", standard_topics=True, reader=reader)
    client, answers = harness.client(), list[Answer]()
    client.start(time_step=40)
    client.listen("/gps", "/fix", "/SyncModeInfo")

    def tick() -> None:
        request = {"user_id": "me", "frame": 0}
        harness.bus.call(client, "/SyncModeWaitForTick", {"request": request}, answers.append, now=0.0)

    return harness, answers, (client, tick)


def test_tick_waits_for_the_import_and_leaves_out_no_message() -> None:
    reader = ManualReader()
    harness, answers, (client, tick) = in_sync(reader)
    tick()
    assert (answers, client.messages("/gps"), harness.world.frame) == ([], [], 0)
    reader.hand_over()
    tick()
    assert len(answers) == 2
    assert [message["header"]["seq"] for message in client.messages("/gps")] == [1, 2, 3, 4]
    _, _, (other, other_tick) = in_sync(None)
    other_tick()
    other_tick()
    assert client.raw == other.raw


def test_step_waits_for_the_import_if_it_samples_a_fix() -> None:
    reader = ManualReader()
    harness = SimHarness(start="sync", reader=reader)
    client, answers = harness.client(), list[Answer]()
    client.start()
    args = {"user_id": "me", "n": 1, "topics": ["/gps"]}
    harness.bus.call(client, "/sim/step", args, answers.append, now=0.0)
    assert answers == []
    reader.hand_over()
    (answer,) = answers
    assert answer.is_ok
    assert isinstance(answer.values, Message)
    assert b"latitude" in answer.values.json


def test_real_time_goes_on_during_the_import_without_fixes() -> None:
    reader = ManualReader()
    harness = SimHarness(standard_topics=True, reader=reader)
    client = harness.client()
    client.listen("/gps", "/fix", "/Ego_topic")
    harness.run(0.1)
    assert (client.messages("/gps"), client.messages("/fix")) == ([], [])
    num = len(client.messages("/Ego_topic"))
    assert num > 3
    reader.hand_over(now=harness.now)
    harness.run(0.1)
    late = len(client.messages("/Ego_topic")) - num
    assert late > 3
    assert len(client.messages("/gps")) == len(client.messages("/fix")) == late


def test_topics_of_clients_begin_no_import() -> None:
    reader = ManualReader()
    harness = SimHarness(standard_topics=True, reader=reader)
    client, other = harness.client(), harness.client()
    client.send("/mine", "sensor_msgs/NavSatFix", latitude=1.0)
    other.listen("/mine", "/imu", "/Ego_topic")
    assert reader.waiting == []
    other.listen("/gps")
    assert len(reader.waiting) == 1
