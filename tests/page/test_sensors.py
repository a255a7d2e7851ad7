"""Cameras and lidars on the page: pictures with boxes, and points on the map, while they are shown."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Coroutine
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_map import Pixels, open_map, places_of, until, url_of
from tests.support import PATIENCE, ServerProcess

pytest.importorskip("moderngl")
pytest.importorskip("embreex")
pytest.importorskip("simplejpeg")

pytestmark = [pytest.mark.client, pytest.mark.slow]

CAMERAS = """
[[camera]]
width = 160
height = 120
x = 1.8
z = 2
pitch = 7
antialiasing = false

[[camera]]
frame_id = "Left"
width = 80
height = 60
yaw = 70
z = 2
antialiasing = false
"""

LIDAR = """
[[lidar3d]]
x = 2
z = 1.28
"""

IMAGE, BOXES, POINTS = "/image_jpeg/compressed", "/image_jpeg/boxes", "/lidar3D"

OF_ASPHALT = (38, 103, 221)
"""Colour of a point with the intensity of asphalt."""


@pytest.fixture
def serve_with(serve: Serve, tmp_path: Path) -> Callable[..., ServerProcess]:
    """Starts a town in synchronous mode, with sensors."""

    def start(sensors: str, scenario: str = "town") -> ServerProcess:
        path = tmp_path / "sensors.toml"
        path.write_text(sensors)
        return serve("--scenario", scenario, "--start", "sync", "--sensors", str(path), "--no-dressing")

    return start


async def press(page: Page, name: str) -> None:
    await page.get_by_role("button", name=f"{name} cameras and lidars").click()


async def num_subscribers(client: AsyncClient) -> list[int]:
    return [
        len((await client.call("/rosapi/subscribers", {"topic": topic}))["subscribers"]) for topic in (IMAGE, BOXES)
    ]


async def tick_until(client: AsyncClient, expectation: Coroutine[object, object, None]) -> None:
    """Move the world until an expectation of the page holds."""
    done = asyncio.ensure_future(expectation)
    while not done.done():
        await client.tick(5)  # three pictures
        await asyncio.wait([done], timeout=0.2)
    await done


async def test_cameras_of_one_topic_are_shown_apart_with_boxes_and_only_while_they_are_looked_at(
    serve_with: Callable[..., ServerProcess], open_page: OpenPage
) -> None:
    server = serve_with(CAMERAS, "demo")
    page = await open_page(server)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync()
        assert await num_subscribers(client) == [0, 0]
        await press(page, "Show")
        cards = page.locator(".sensor-card")
        await expect(cards).to_have_count(2)
        await expect(cards.locator(".sensor-waiting").first).to_have_text("Comes with the next step.")
        for _ in range(2):  # each keeps its own
            for name, size in (("Camera", "160 . 120 pixels"), ("Left", "80 . 60 pixels")):
                card = cards.filter(has=page.get_by_text(name, exact=True))
                await card.scroll_into_view_if_needed()
                await tick_until(client, expect(card.get_by_text(re.compile(size))).to_be_visible())
        await expect(cards.locator(".sensor-waiting:visible")).to_have_count(0)
        ahead = cards.first.locator("canvas.sensor-boxes")
        await cards.first.scroll_into_view_if_needed()
        await tick_until(client, expect(ahead).to_have_attribute("data-boxes", re.compile("[1-9]")))
        painted = "canvas => canvas.getContext('2d').getImageData(0, 0, 160, 120).data.some((value) => value > 0)"
        assert await ahead.evaluate(painted)
        assert await num_subscribers(client) == [1, 1]
        await press(page, "Hide")
        await expect(cards).to_have_count(0)
        while await num_subscribers(client) != [0, 0]:
            await client.tick()


async def test_server_without_cameras_and_lidars_is_told_with_its_flag(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town", "--start", "sync"))
    await press(page, "Show")
    await expect(page.get_by_text("Start the server with --sensors teaching")).to_be_visible()


async def test_points_of_a_lidar_are_on_the_map_while_it_is_shown(
    serve_with: Callable[..., ServerProcess], open_page: OpenPage
) -> None:
    server = serve_with(LIDAR)
    page = await open_map(open_page, url_of(server.port))
    for _ in range(4):
        await page.get_by_role("button", name="Zoom in").click()

    def num(pixels: Pixels) -> int:
        return len(places_of(pixels, OF_ASPHALT, 30.0))

    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync(step_ms=100)  # a turn of the lidar
        await until(page, lambda pixels: num(pixels) < 100, client.tick)
        await press(page, "Show")
        await expect(page.get_by_text("velodyne: Comes with the next step.")).to_be_visible()
        await until(page, lambda pixels: num(pixels) > 500, client.tick)
        await expect(page.get_by_text("The points of velodyne are on the map.")).to_be_visible()
        await press(page, "Hide")
        await until(page, lambda pixels: num(pixels) < 100, client.tick)
