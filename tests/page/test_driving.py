"""Driving by the page where things go wrong or are rare: a killed server, a game pad, several egos, and the score."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_page import LOST
from tests.page.test_panels import begin_drive
from tests.support import PATIENCE, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

GAMEPAD = """
window.pad = { mapping: "standard", axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ value: 0 })) };
navigator.getGamepads = () => [null, window.pad];
"""
"""A game pad of the standard layout, in the place where the browser has it: no test machine has one."""

LEFT_TRIGGER, RIGHT_TRIGGER = 6, 7
"""Buttons of the standard layout (W3C, Gamepad)."""


async def test_killed_server_ends_the_drive_and_the_next_one_begins_with_pedals_up(
    tmp_path: Path, open_page: OpenPage, kept_port: int
) -> None:
    first = ServerProcess(tmp_path / "first.txt", ("--scenario", "town"), port=kept_port)
    try:
        page = await open_page(first, allow=LOST)
        await begin_drive(page)
        await page.keyboard.down("w")
        async with AsyncClient(first.url, timeout=PATIENCE) as client:
            await client.wait_for("/Ego_topic", lambda ego: ego["accel"] > 0.5)
            first.kill()
        await expect(page.get_by_text("The drive has ended, because the connection was lost.")).to_be_visible()
        second = ServerProcess(tmp_path / "second.txt", ("--scenario", "town"), port=kept_port)
        try:
            await expect(page.locator(".connection-state")).to_have_text("Connected")
            await expect(page.get_by_role("button", name="Drive by hand")).to_be_visible()
            async with AsyncClient(second.url, timeout=PATIENCE) as client:
                (driver,) = (await client.wait_for("/sim/drivers"))["egos"]
                assert driver["publishers"] == []  # W is still down, but this drive has not begun
                await begin_drive(page)
                await page.keyboard.down("w")
                await client.wait_for("/Ego_topic", lambda ego: ego["accel"] > 0.5)
        finally:
            await page.close()
            second.stop_cleanly()
    finally:
        first.kill()


async def test_game_pad_drives_and_its_triggers_are_the_pedals(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await page.evaluate(GAMEPAD)
    await begin_drive(page)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await page.evaluate(f"pad.buttons[{RIGHT_TRIGGER}].value = 0.75; pad.axes[0] = -1")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] > 0.6 and ego["wheel_angle"] > 0.0)
        await page.evaluate(f"pad.buttons[{RIGHT_TRIGGER}].value = 0; pad.buttons[{LEFT_TRIGGER}].value = 0.5")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] == 0.0 and ego["brake"] > 0.4)
        await page.evaluate("navigator.getGamepads = () => [null, null]")  # its cable is pulled
        await client.wait_for("/Ego_topic", lambda ego: ego["brake"] == 0.0)


async def test_further_ego_is_chosen_seen_and_driven_alone(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    choice = page.get_by_role("region", name="Ego").get_by_label("Ego", exact=True)
    await expect(choice).to_be_hidden()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        number = await client.spawn(is_ego=True, x=-60.0, y=-5.25)
        await choice.select_option(f"Ego {number}")
        await begin_drive(page)
        await page.keyboard.down("w")
        await client.wait_for(f"/Ego-{number}/Ego_topic", lambda ego: ego["velocity"]["x"] > 1.0)
        assert (await client.wait_for("/Ego_topic"))["accel"] == 0.0
        await client.remove(number)
        await expect(choice).to_be_hidden()  # the first one again
        await expect(page.get_by_role("button", name="Drive by hand")).to_be_visible()


async def test_score_counts_only_when_it_is_shown(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    panel = page.get_by_role("region", name="Score")
    driven = panel.locator("dl > div").filter(has_text="Driven").locator("dd")
    await expect(driven).to_be_hidden()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        topics = await client.wait_for("/sim/topics")
        assert [info["subscribers"] for info in topics["topics"] if info["name"] == "/sim/score"] == [[]]
        await panel.get_by_role("button", name="Show scores").click()
        await expect(driven).to_have_text("0.0 m")
        await client.set_object(0, speed=10.0)
        await expect(driven).not_to_have_text("0.0 m")
        await panel.get_by_role("button", name="Hide scores").click()
        await expect(driven).to_be_hidden()
