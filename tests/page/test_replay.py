"""Replays by the page: a recording of the server is played, held, and taken to another place by the slider."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_panels import choose_tab
from tests.support import PATIENCE, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]


async def record(folder: Path) -> None:
    """Write a drive of four seconds as `drive.mcap`."""
    server = ServerProcess(folder / "record.txt", ("--start", "sync", "--record", str(folder / "drive.mcap")))
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync(user_id="recorder")
        await client.step(200, commands={0: {"longlCmdType": 1, "accel": 0.8}})
    server.stop_cleanly()


async def test_slider_takes_a_replay_to_another_place(serve: Serve, open_page: OpenPage, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    await record(data)
    server = serve("--data-dir", str(data))
    page = await open_page(server)
    await choose_tab(page, "Time")
    slider = page.get_by_role("slider", name="Position in the recording")
    await expect(slider).to_be_disabled()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.real_time_factor(0.1)  # or it may have ended before it is held
        await page.get_by_role("button", name="Play", exact=True).click()
        await page.get_by_role("button", name="Hold", exact=True).click()
        held = await client.wait_for("/sim/replay", lambda replay: replay["state"] == "paused")
        assert held["name"] == "drive.mcap"
        await expect(page.get_by_role("button", name="Hold", exact=True)).to_have_attribute("aria-disabled", "true")
        await slider.fill("3.0")
        sought = await client.wait_for("/sim/replay", lambda replay: abs(replay["position"] - 3.0) < 0.1)
        assert sought["state"] == "paused"
        far = (await client.wait_for("/Ego_topic"))["position"]["x"]
        await slider.fill("0.5")
        await client.wait_for("/sim/replay", lambda replay: abs(replay["position"] - 0.5) < 0.1)
        await client.wait_for("/Ego_topic", lambda ego: ego["position"]["x"] < far - 1.0)
        await expect(page.get_by_text("0.5 / 4.0 s")).to_be_visible()
        faster = {"sim_process_status": 2, "replay_option": 8, "replay_speed": 3}
        await client.call("/Morai_SimProc", {"request": faster})
        await expect(page.get_by_label("Speed", exact=True)).to_have_value("3")  # another client has set it
        await page.get_by_role("button", name="End", exact=True).click()
        await client.wait_for("/sim/replay", lambda replay: replay["state"] == "none")
    await expect(slider).to_be_disabled()
