"""What programs publish, on the map of the page."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from playwright.async_api import Page, expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_map import nothing, open_map, places_of, until
from tests.page.test_page import faults_of
from tests.page.test_panels import choose_tab
from tests.support import PATIENCE

pytestmark = [pytest.mark.client, pytest.mark.slow]

PURPLE = (177, 23, 200)
ORANGE = (255, 128, 0)
"""Colours that nothing else of the page has."""


def line(frame: str, y: float) -> dict[str, Any]:
    """A path of 20 m along x."""
    poses = [{"pose": {"position": {"x": x, "y": y, "z": 0.0}, "orientation": {"w": 1.0}}} for x in (0.0, 20.0)]
    return {"header": {"frame_id": frame}, "poses": poses}


def marker(frame: str, y: float, colour: tuple[int, int, int]) -> dict[str, Any]:
    """A broad line of 20 m along x."""
    return {
        "header": {"frame_id": frame},
        "type": 4,
        "pose": {"orientation": {"w": 1.0}},
        "scale": {"x": 2.0},
        "color": {"r": colour[0] / 255, "g": colour[1] / 255, "b": colour[2] / 255, "a": 1.0},
        "points": [{"x": 0.0, "y": y}, {"x": 20.0, "y": y}],
    }


async def until_shown(page: Page, colour: tuple[int, int, int], again: Callable[[], Awaitable[object]]) -> None:
    """Publish, as planners do again and again, until the map has a line of a colour."""
    await until(page, lambda pixels: len(places_of(pixels, colour, within=24.0)) >= 100, again)


async def until_gone(page: Page, colour: tuple[int, int, int], again: Callable[[], Awaitable[object]]) -> None:
    """Publish until the map has nothing of a colour."""
    await until(page, lambda pixels: len(places_of(pixels, colour, within=24.0)) == 0, again)


async def test_map_draws_plans_in_the_frames_of_tf_with_a_switch_for_each(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync", "--deny-subscribe", "/secret")
    page = await open_map(open_page, server)  # type: ignore[arg-type]
    await choose_tab(page, "Objects")
    panel = page.get_by_role("region", name="What programs publish")
    await panel.scroll_into_view_if_needed()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.publish("/plan/marks", marker("base_link", 6.0, PURPLE), "visualization_msgs/Marker")
        await client.publish("/plan/lost", line("nowhere", 0.0), "nav_msgs/Path")
        await client.publish("/secret", line("map", 0.0), "nav_msgs/Path")
        box = panel.get_by_role("checkbox", name="/plan/marks")
        await expect(box).to_be_checked()
        await expect(panel.get_by_role("checkbox", name="/sim/scene/map")).not_to_be_checked()  # the simulator's own
        await client.start_sync()

        async def plan() -> None:
            await client.tick()  # the simulator tells the frames of /tf when the world moves
            await client.publish("/plan/marks", marker("base_link", 6.0, PURPLE), "visualization_msgs/Marker")
            await client.publish("/plan/lost", line("nowhere", 0.0), "nav_msgs/Path")

        await until_shown(page, PURPLE, plan)
        await expect(panel).to_contain_text("The frame nowhere has no transform to map")
        await expect(panel).to_contain_text("does not let this page subscribe")
        assert await faults_of(page) == []
        await box.uncheck()
        await until_gone(page, PURPLE, plan)
        await box.check()
        scene = await client.wait_for("/sim/scene/state")
        mark = marker("map", scene["y"][0] + 6.0, ORANGE)
        mark["pose"] |= {"position": {"x": scene["x"][0] - 10.0}}

        async def plan_in_map() -> None:
            await client.publish("/plan/marks", mark, "visualization_msgs/Marker")

        await until_shown(page, ORANGE, plan_in_map)
    await until_gone(page, ORANGE, nothing)  # the program has ended
