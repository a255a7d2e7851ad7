"""A recorded drive, and a simulator with a client that can replay it."""

from __future__ import annotations

import pytest

from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import FILE, INFO, NUM_FRAMES, PLAY, replay, steer_frames
from tests.simulator.sim_harness import Client, SimHarness


@pytest.fixture(scope="module")
def recordings() -> MemoryRecordings:
    """A drive in the crowd, recorded; and the same as ReplayInfo alone."""
    recordings = MemoryRecordings()
    harness = SimHarness(start="sync", recordings=recordings)
    client = harness.client()
    client.start()
    recordings.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
    steer_frames(client, NUM_FRAMES)
    harness = SimHarness("parked", start="sync", recordings=recordings)
    client = harness.client()
    client.start()
    recordings.record(harness.bus, "info", INFO)
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(NUM_FRAMES):
        client.tick()
    recordings.messages["empty"] = []
    return recordings


@pytest.fixture
def harness(recordings: MemoryRecordings) -> SimHarness:
    return SimHarness("parked", start="sync", recordings=recordings)


@pytest.fixture
def client(harness: SimHarness) -> Client:
    client = harness.client()
    client.start()
    return client
