"""`/sim/replay`: the position of a replay."""

from __future__ import annotations

from typing import Any

from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import FILE, NUM_FRAMES, PAUSE, PLAY, SPEED, START, STOP, replay
from tests.simulator.sim_harness import Client, SimHarness

REPLAY = "/sim/replay"
DURATION = (NUM_FRAMES - 1) * 0.02


def recorded(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings'
    """A simulator with the recording of a drive."""
    recordings = MemoryRecordings()
    first = SimHarness("crowd", start="sync", recordings=recordings)
    recordings.record(first.bus, "drive", "/Ego_topic", "/Object_topic")
    client = first.client()
    client.start()
    for _ in range(NUM_FRAMES):
        client.tick()
    harness = SimHarness("parked", recordings=recordings, **settings)
    return harness, harness.client()


def last(harness: SimHarness, client: Client) -> dict[str, Any]:
    harness.run(0.0)
    return {key: value for key, value in client.messages(REPLAY)[-1].items() if key != "header"}


def test_position_is_told_ten_times_a_second_and_stays_at_the_end() -> None:
    harness, client = recorded()
    client.listen(REPLAY)
    harness.run(0.1)
    assert last(harness, client)["state"] == "none"
    assert replay(client, PLAY, FILE, "drive")
    client.heard.clear()
    harness.run(1.0)
    told = client.messages(REPLAY)
    assert 9 <= len(told) <= 11
    assert [each["state"] for each in told] == ["playing"] * len(told)
    positions = [each["position"] for each in told]
    assert positions == sorted(positions)
    harness.run(1.0)
    assert last(harness, client) == {
        "state": "ended",
        "name": "drive",
        "duration": DURATION,
        "position": DURATION,
        "speed": 1,
        "targets": 7,
    }


def test_slider_moves_in_a_pause_and_is_told_at_once() -> None:
    harness, client = recorded(start="sync")
    client.start()
    client.listen(REPLAY)
    assert replay(client, PLAY, FILE | START | SPEED, "drive", start_time=400, replay_speed=2)
    assert last(harness, client)["position"] == 0.4
    client.tick()
    assert replay(client, PAUSE)
    assert (last(harness, client)["state"], last(harness, client)["position"]) == ("paused", 0.4)
    assert replay(client, PAUSE, START, start_time=1000)
    assert last(harness, client)["position"] == 1.0
    assert replay(client, STOP)
    assert last(harness, client)["state"] == "none"
