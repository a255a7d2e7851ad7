"""More eyes: cameras, marks of motion, pictures and clips of the map, and links to a view."""

from __future__ import annotations

import asyncio
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.async_api import Page, expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage, page_url
from tests.page.test_map import COLOURS, Pixels, colour, open_map, places_of, until
from tests.page.test_page import faults_of
from tests.support import PATIENCE

pytestmark = [pytest.mark.client, pytest.mark.slow]


PICTURES = """(num) => new Promise((resolve) => {
  const next = (left) => (left > 0 ? requestAnimationFrame(() => next(left - 1)) : resolve());
  next(num);
})"""
"""Waits for so many pictures of the browser."""


def num_orange(pixels: Pixels) -> int:
    """Pixels of vectors, which are so thin that the road shines through; the ego has no green."""
    return int(np.sum((pixels[:, :, 0] - pixels[:, :, 2] > 60.0) & (pixels[:, :, 1] > 90.0)))


async def saved(page: Page, button: str) -> bytes:
    """The file that a button saves."""
    async with page.expect_download() as download:
        await page.get_by_role("button", name=button).click()
    path = await (await download.value).path()
    return await asyncio.to_thread(Path(path).read_bytes)


async def test_cameras_marks_pictures_and_clips_of_the_map(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "motorway", "--start", "sync")
    page = await open_map(open_page, page_url(server))
    await page.get_by_role("button", name="View", exact=True).click()

    async def has_sky(*, wanted: bool) -> None:
        # Nothing else of the map is as blue.
        await until(page, lambda pixels: (np.sum(pixels[:40, :, 2] - pixels[:40, :, 0] > 35.0) > 2000) == wanted)

    await has_sky(wanted=False)
    ego = colour(COLOURS["kinds"]["ego"])
    await page.get_by_label("Driver's seat").check()
    await has_sky(wanted=True)
    await until(page, lambda pixels: len(places_of(pixels, ego, 60.0)) == 0)  # the car is around the camera
    for _ in range(3):  # around the car, above the map, behind the car
        await page.locator("canvas.map-canvas").press("v")
    await expect(page.get_by_role("radio", name="Behind the car")).to_be_checked()
    await until(page, lambda pixels: len(places_of(pixels, ego, 150.0)) > 100)
    await page.get_by_label("Above the map").check()
    await has_sky(wanted=False)

    for _ in range(5):  # a vector is as wide as some pixels
        await page.get_by_role("button", name="Zoom in").click()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync()
        await client.set_object(0, speed=20.0)
        await client.tick()
        num_lamps = num_orange(await until(page, lambda pixels: len(places_of(pixels, ego, 60.0)) > 100))
        await page.get_by_label("Velocities").check()
        await until(page, lambda pixels: num_orange(pixels) > num_lamps + 100)
        await page.get_by_label("Velocities").uncheck()
        await until(page, lambda pixels: num_orange(pixels) < num_lamps + 100)
        await page.get_by_label("Time to collision").check()
        scene = await client.wait_for("/sim/scene/state")
        place = {"x": scene["x"][0], "y": scene["y"][0], "z": 0.0, "heading_deg": float(scene["heading"][0]) * 57.29578}
        await client.call("/sim/spawn", {"objects": [{"model": "Box", "place": place}]})
        await client.tick()
        await expect(page.locator(".map-label.contact").get_by_text("0.0 s")).to_be_visible()  # they touch
    with Image.open(BytesIO(await saved(page, "Save picture"))) as picture:
        assert picture.format == "PNG"
        pixels = np.asarray(picture.convert("RGB"), dtype=np.float64)
    assert len(places_of(pixels, colour(COLOURS["map"]["lane"]), 8.0)) > 1000
    await page.get_by_role("button", name="Record clip").click()
    await page.evaluate(PICTURES, 5)
    assert (await saved(page, "End the clip")).startswith(bytes.fromhex("1a45dfa3"))  # of Matroska, and so of WebM


async def test_link_is_checked_asks_for_its_scenario_and_never_has_the_token(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--start", "sync", "--scenario", "demo", "--token", "not-in-links")
    page = await open_page(server, path="?scenario=loop&camera=drone&panel=objects&token=not-in-links", state="token")
    await page.get_by_role("textbox", name="Token").fill("not-in-links")
    await page.get_by_role("button", name="Connect").click()
    await expect(page.get_by_role("tab", name="Objects")).to_have_attribute("aria-selected", "true")
    menu = page.locator(".view-menu")
    await expect(menu).to_contain_text("The link has camera=drone: expected top, chase, seat, orbit.")
    await expect(menu).to_contain_text("The link has token, which this page does not know.")
    dialog = page.get_by_role("dialog")
    await expect(dialog).to_contain_text("Load the scenario loop?")
    await expect(page.locator(".header-scenario")).to_have_text("demo")  # nothing without an answer
    await dialog.get_by_role("button", name="Load").click()
    await expect(page.locator(".header-scenario")).to_have_text("loop")
    assert await faults_of(page) == []
    await page.get_by_role("tab", name="Time").click()
    await page.get_by_role("button", name="Copy link").click()
    link = await page.locator(".view-link").text_content()
    assert link is not None
    assert link.endswith("/?scenario=loop&panel=time")
    await page.get_by_role("tab", name="Code").click()
    assert "not-in-links" not in await page.locator(".code-panel").inner_text()
