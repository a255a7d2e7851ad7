"""The first seconds at the page: the card with three ways to begin, and no value of another connection."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from playwright.async_api import expect

from rosbridge_sim.client import AsyncClient
from tests import fork_server
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_page import LOST
from tests.support import PATIENCE, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

DASH = "\u2013"


async def test_card_lets_the_ego_drive_and_goes_once_it_is_commanded(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_page(server)
    card = page.get_by_role("region", name="Ways to begin")
    await expect(card.get_by_role("heading")).to_have_text("town")
    await expect(card).to_contain_text("A town with lights and crosswalks")
    place = page.locator(".instruments .figures")
    await expect(place).to_contain_text("R1222L2")  # the lane at frame 0, though no message of the ego has come
    await expect(place).to_contain_text("-86.00, -5.25, 0.00 m")
    await expect(page.locator(".wheel-text")).to_have_text(DASH)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await card.get_by_role("button", name="Let it drive").click()
        await client.wait_for("/Ego_topic", lambda ego: ego["velocity"]["x"] > 1.0)
    await expect(card).to_be_hidden()
    await page.get_by_role("button", name="town").click()
    await expect(page.get_by_role("region", name="Scenarios", exact=True)).to_be_focused()
    await page.get_by_role("button", name="Load demo").click()
    await expect(page.get_by_role("banner").get_by_role("button", name="demo")).to_be_visible()


@pytest.mark.parametrize("start", ["run", "sync"])
async def test_first_program_drives_this_server_as_it_is(serve: Serve, open_page: OpenPage, start: str) -> None:
    env = {"ROSBRIDGE_SIM_TOKEN": "sesame"} if start == "sync" else {}
    server = serve("--scenario", "town", "--start", start, env=env)
    page = await open_page(server, state="token" if env else "open", permissions=["clipboard-write"])
    if env:
        await page.keyboard.type("sesame")
        await page.keyboard.press("Enter")
    await page.get_by_role("button", name="Copy a first program").click()
    await expect(page.locator(".start-card .notice")).to_contain_text("Copied")
    program = await page.locator(".start-card pre").inner_text()
    assert f"127.0.0.1:{server.port}" in program
    assert "sesame" not in program
    done = fork_server.run(["-c", program], env={**os.environ, **env})  # nothing else is to happen meanwhile
    assert done.returncode == 0, done.stderr
    assert max(float(line.split()[0]) for line in done.stdout.splitlines()) > 20.0, done.stdout


async def test_instruments_show_nothing_of_a_server_before_the_restart(
    tmp_path: Path, open_page: OpenPage, kept_port: int
) -> None:
    first = ServerProcess(tmp_path / "first.txt", ("--scenario", "town"), port=kept_port)
    try:
        page = await open_page(first, allow=LOST)
        async with AsyncClient(first.url, timeout=PATIENCE) as client:
            await client.set_object(0, ctrl_mode=6)
            await client.wait_for("/Ego_topic", lambda ego: ego["velocity"]["x"] > 4.0)
        await expect(page.locator(".speed-value")).not_to_have_text("0.0")
        first.kill()
        await expect(page.locator(".speed-value")).to_have_text(DASH)
        await expect(page.locator(".instruments dd").nth(3)).to_have_text(DASH)
        flags = ("--scenario", "loop", "--start", "sync", "--deny-subscribe", "/sim/scene/*")
        second = ServerProcess(tmp_path / "second.txt", flags, port=kept_port)
        try:
            await expect(page.locator(".header-frame")).to_have_text("frame 0")
            await expect(page.locator(".header-scenario")).to_be_hidden()
            await expect(page.locator(".speed-value")).to_have_text(DASH)
            await expect(page.locator(".instruments dd").nth(4)).to_have_text(DASH)
        finally:
            await page.close()
            second.stop_cleanly()
    finally:
        first.kill()


async def test_touch_in_steps_has_the_step_button_and_arrows_on_the_pads(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_page(server, has_touch=True, viewport={"width": 390, "height": 844})
    await page.get_by_role("button", name="Drive with the keys").tap()
    driving = page.locator(".driving")
    await expect(driving).to_contain_text("hold the pads, and press Step")
    assert await driving.locator(".pad").all_inner_texts() == ["◀\n▶", "▲\n▼"]
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await driving.get_by_role("button", name="Step", exact=True).tap()
        await client.wait_for("/SyncModeInfo", lambda info: info["frame"] == 1)
    await page.get_by_role("banner").get_by_role("button", name="End the drive").tap()
    await expect(driving.get_by_role("button", name="Drive by hand")).to_be_visible()
