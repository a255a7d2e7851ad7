"""The newer release through a real server: one flag changes the fields, the services and the default of a profile."""

from __future__ import annotations

from typing import Literal

import pytest

from rosbridge_sim import Simulator
from tests.conftest import Connect


@pytest.mark.parametrize(
    ("release", "steering", "gain"), [("22.R2", "steering", 2.511), ("26.R1", "front_steer", 0.96)]
)
async def test_releases_differ_by_one_flag_and_one_field_name(
    release: Literal["22.R2", "26.R1"], steering: str, gain: float, connect: Connect
) -> None:
    async with Simulator(port=0, start="sync", release=release) as sim:
        client = await connect(sim.url)
        assert (await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20))["result"]
        for frame in range(1, 51):
            command = {"longlCmdType": 2, "velocity": 30.0, steering: 0.1}
            assert (await client.ask("/SyncModeCtrlCmd", frame=frame, command=command))["result"]
            status = (await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame))["vehicle_status"]
        assert status["velocity"]["x"] == pytest.approx(gain, abs=0.01), "the newer one holds its speed mode back"
        assert status["heading"] > 0.0
        services = (await client.values("/rosapi/services"))["services"]
        assert ("/SyncModeAddObject" in services) == (release == "26.R1")


async def test_object_limit_default_follows_the_release(connect: Connect) -> None:
    async with Simulator(port=0, start="sync", release="26.R1") as sim:
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        for i in range(30):
            place = {"name": "Box", "position": {"x": 40.0 + i, "y": 500.0, "z": 0.0}, "frame": 0}
            assert (await client.ask("/SyncModeAddObject", **place))["result"]
        await client.subscribe("/Object_topic")
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        objects = await client.message("/Object_topic")
        assert objects["num_of_npcs"] + objects["num_of_pedestrian"] + objects["num_of_obstacle"] == 20
