"""A snapshot of one process goes on in another one, and thousands of restores leave nothing."""

from __future__ import annotations

import gc
import subprocess
import sys
import tracemalloc

import pytest

from tests.simulator.sim_harness import SimHarness
from tests.simulator.sim_services.snapshot_fixture import call, hash_of, restore, snapshot
from tests.support import ROOT

pytestmark = pytest.mark.slow

NUM_FRAMES = 40

GO_ON = f"""
import sys
from tests.simulator.sim_harness import SimHarness
from tests.simulator.sim_services.snapshot_fixture import hash_of, restore
harness = SimHarness("parked", start="sync")
client = harness.client()
client.start()
assert restore(client, sys.stdin.buffer.read()).result
for _ in range({NUM_FRAMES}):
    client.tick()
    print(hash_of(client))
"""


def test_snapshot_goes_on_to_the_same_hashes_in_another_process() -> None:
    harness = SimHarness("crossing", start="sync")
    client = harness.client()
    client.start()
    client.control(NUM_FRAMES, longlCmdType=2, velocity=40.0)
    for _ in range(10):
        client.tick()
    saved = snapshot(client)
    hashes = []
    for _ in range(NUM_FRAMES):
        client.tick()
        hashes.append(hash_of(client))
    ended = subprocess.run(
        [sys.executable, "-c", GO_ON], input=bytes(saved.data), capture_output=True, check=True, cwd=ROOT
    )
    assert ended.stdout.decode().split() == hashes
    assert len(set(hashes)) == NUM_FRAMES


def test_resets_and_restores_leave_nothing() -> None:
    harness = SimHarness("crossing", start="sync")
    client = harness.client()
    client.start()
    saved = bytes(snapshot(client, "a").data)

    def go(num: int) -> None:
        for _ in range(num):
            call(client, "/sim/snapshot", id="b")
            assert restore(client, "a").result
            client.tick()
            call(client, "/sim/reset", seed=-1)
            assert restore(client, saved).result

    tracemalloc.start()
    try:
        go(60)  # caches fill, and what replaces their first content is counted
        client.told.clear()
        gc.collect()
        num_objects, num_bytes = len(gc.get_objects()), tracemalloc.get_traced_memory()[0]
        go(40)
        client.told.clear()
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - num_bytes
        assert len(gc.get_objects()) - num_objects < 300
        assert grown < 100_000, "a quarter of what one snapshot of 11 kB each time would leave"
    finally:
        tracemalloc.stop()
