#!/usr/bin/env python3
"""Take the pictures of the web page for README and `docs/guides/page.md`.

    python scripts/shoot_page.py [--into FOLDER] [--more | --plans]

It writes `page_town.png`, `page_chase.png` and `page_graph.png` to docs/images, or with `--plans` `page_plans.png`;
`--more` adds views that no document shows, for those who change the page: a phone, a collision, and the other tabs.
The scene is the same in each run: the built-in town with more traffic, after a drive of so many steps in synchronous
mode; for the picture of the graph the world then runs some seconds in real time, so that the topics have rates. With
`--plans` it is `loop`, where `plan_lanes.py` is about to overtake. It needs Chromium and Playwright.
The pictures are not compared by a test, because a font or a browser may change a pixel.
"""

from __future__ import annotations

import argparse
import asyncio
import io
import math
import re
import shutil
import signal
import sys
from pathlib import Path
from typing import Any, Final

from PIL import Image
from playwright.async_api import Browser, Page, ViewportSize, async_playwright, expect

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim import Simulator  # noqa: E402
from rosbridge_sim.client import AsyncClient  # noqa: E402

IMAGES: Final = ROOT / "docs" / "images"

FLAGS: Final = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""As for the page's tests: WebGL without a graphics card."""

COLOURS: Final = 256
"""Number of colours: the maximum of a PNG with a palette. The page has few colours, so one sees no difference."""

MAX_BYTES: Final = 250_000
"""Size that a picture may have at most: a page of the documentation has three of them."""

TRAFFIC: Final = (0.35, 0.75)
"""Places of the vehicles that are added, as parts of each lane's length: a busy town in which traffic still flows."""

CLEARANCE: Final = 15.0
"""Distance to what was there before: two lengths of a car, and one to brake [m]."""

STEP: Final = 25
"""Frames of a step: half a second, so that the charts have two points a second."""

CHASE_STEPS, TOWN_STEPS, GRAPH_STEPS = 96, 103, 104
"""Steps before each picture: the ego has waited behind others at a red light, and begins to turn to the right."""

RUN_MS: Final = 4_000
"""Time in real time before the picture of the graph, whose rates are counted once a second [ms]."""

WAIT_MS, WAIT_S = 300_000, 300.0
"""Longest wait for the page, and for a program [ms, s]; a software renderer on a busy machine is slow."""

LONG_LANE: Final = 30.0
"""Shorter lanes are within intersections, where no vehicle should begin [m]."""

MAX_SPAWN: Final = 100
"""Objects in one call: the most that it takes."""

AHEAD: Final = 9.0
"""Distance of the car that stands across the ego's way, for the picture of a collision [m]."""

PLANNER: Final = ROOT / "scripts" / "examples" / "plan_lanes.py"

PLAN_VIEW: Final = {"Turn to the right": 4, "Zoom in": 5}
"""Buttons of the map, and how often they are pressed, so that one sees the lanes along the picture."""

PLANS: Final[ViewportSize] = {"width": 1200, "height": 480}
WIDE: Final[ViewportSize] = {"width": 1440, "height": 720}
HIGH: Final[ViewportSize] = {"width": 1280, "height": 960}
USUAL: Final[ViewportSize] = {"width": 1280, "height": 720}
PHONE: Final[ViewportSize] = {"width": 390, "height": 844}


async def shoot(folder: Path, *, has_more: bool) -> None:
    """Write the pictures.

    Args:
        folder: where they go.
        has_more: also the views that no document shows.
    """
    async with (
        Simulator(port=0, start="sync", scenario="town") as sim,
        AsyncClient(sim.url) as client,
        async_playwright() as playwright,
    ):
        browser = await playwright.chromium.launch(
            executable_path=shutil.which("chromium-headless-shell") or shutil.which("chromium"), args=FLAGS
        )
        await _fill_town(client)
        await client.set_object(0, ctrl_mode=6)  # it drives itself
        page = await _open(browser, sim.port)
        await _step_to(page, CHASE_STEPS - 4)
        await page.emulate_media(color_scheme="dark")
        await page.locator("#map canvas").focus()
        await page.keyboard.press("c")
        await page.wait_for_selector("#map canvas[data-mesh]", state="attached")  # ground, buildings and trees
        await _step_to(page, CHASE_STEPS)
        await _save(page, folder / "page_chase.png", WIDE)

        await page.emulate_media(color_scheme="light")
        await page.locator("#map canvas").focus()
        await page.keyboard.press("c")
        await page.keyboard.press("-")
        await _step_to(page, TOWN_STEPS)
        await _save(page, folder / "page_town.png", WIDE)

        await _show_graph(page)
        await _step_to(page, GRAPH_STEPS, "Graph")
        await _run(page)
        await _save(page, folder / "page_graph.png", HIGH)
        if has_more:
            await _shoot_more(client, page, folder)
        await browser.close()


async def shoot_plans(path: Path) -> None:
    """Write what the map draws of `scripts/examples/plan_lanes.py`, while it overtakes.

    Args:
        path: of the picture.
    """
    async with (
        Simulator(port=0, start="sync", scenario="loop") as sim,
        AsyncClient(sim.url) as client,
        async_playwright() as playwright,
    ):
        chromium = shutil.which("chromium-headless-shell") or shutil.which("chromium")
        browser = await playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = await _open_page(browser, sim.port)
        await page.get_by_role("button", name="Close").first.click()  # the card
        await page.get_by_role("button", name="Hide the panels").click()
        program = await asyncio.create_subprocess_exec(
            *(sys.executable, str(PLANNER), "--url", sim.url, "--seconds", "3600"), stdout=asyncio.subprocess.DEVNULL
        )
        try:
            await client.wait_for(
                "/plan/candidates", _is_choice, type_name="visualization_msgs/MarkerArray", timeout=WAIT_S
            )
            program.send_signal(signal.SIGSTOP)  # the world stands, and its plans stay on the map
            for button, times in PLAN_VIEW.items():
                for _ in range(times):
                    await page.get_by_role("button", name=button).click()
            await _save(page, path, PLANS, part="#map canvas")
        finally:
            program.kill()
            await program.wait()
        await browser.close()


def _is_choice(candidates: dict[str, Any]) -> bool:
    """Return whether some of the planner's candidates are free, and some are not."""
    return len({marker["color"]["r"] > marker["color"]["g"] for marker in candidates["markers"]}) > 1


async def _shoot_more(client: AsyncClient, page: Page, folder: Path) -> None:
    """Write the views that no document shows."""
    await _show_tab(page, "Time")
    await page.get_by_role("button", name="Take synchronous mode").click()
    await page.locator(".header-time[data-kind=synchronous]").wait_for()
    num_steps = await _frame(page) // STEP
    for tab in ("Time", "Objects", "Log", "Code"):
        await _show_tab(page, tab)
        await _save(page, folder / f"page_{tab.lower()}.png", USUAL)
    await _show_tab(page, "Ego")
    await _save(page, folder / "page_phone.png", PHONE)
    await page.emulate_media(color_scheme="dark")
    await _save(page, folder / "page_phone_dark.png", PHONE)
    await page.emulate_media(color_scheme="light")
    scene = await client.wait_for("/sim/scene/state")
    x, y, heading = scene["x"][0], scene["y"][0], scene["heading"][0]
    await client.spawn(
        "2015_Kia_K5",
        x=x + AHEAD * math.cos(heading),
        y=y + AHEAD * math.sin(heading),
        heading_deg=math.degrees(heading) + 60.0,
    )
    await client.set_object(0, speed=10.0)
    await _step_to(page, num_steps + 3)
    await _save(page, folder / "page_collision.png", USUAL)


async def _fill_town(client: AsyncClient) -> None:
    """Put vehicles on all lanes, where nothing is near."""
    town, scene = await client.map(), await client.wait_for("/sim/scene/state")
    objects = [
        {
            "model": "2015_Kia_K5",
            "place": {"link": lane["link"], "distance": part * lane["length"]},
            "behaviour": "lane",
        }
        for lane in town["lanes"]
        for part in TRAFFIC
        if lane["length"] > LONG_LANE
    ]
    ids: list[int] = []
    for first in range(0, len(objects), MAX_SPAWN):
        ids += await client.spawn_all(objects[first : first + MAX_SPAWN])
    others = list(zip(scene["x"], scene["y"], strict=True))
    scene = await client.wait_for("/sim/scene/state")
    places = dict(zip(scene["id"], zip(scene["x"], scene["y"], strict=True), strict=True))
    await client.remove(*(one for one in ids if any(math.dist(places[one], other) < CLEARANCE for other in others)))


async def _open(browser: Browser, port: int) -> Page:
    """Return the page as the master of synchronous mode: it steps the world, and the world waits for the pictures."""
    page = await _open_page(browser, port)
    await _show_tab(page, "Time")
    await page.get_by_label("Steps", exact=True).fill(str(STEP))
    await page.get_by_role("button", name="Take synchronous mode").click()
    return page


async def _open_page(browser: Browser, port: int) -> Page:
    """Return the page, connected."""
    context = await browser.new_context(viewport=WIDE, locale="en-GB", timezone_id="UTC")
    page = await context.new_page()
    page.set_default_timeout(WAIT_MS)
    await page.goto(f"http://127.0.0.1:{port}/")
    await page.wait_for_selector(":root[data-connection=open]", state="attached")
    return page


async def _show_tab(page: Page, name: str) -> None:
    await page.get_by_role("tab", name=name, exact=True).click()


async def _step_to(page: Page, num_steps: int, tab: str = "Ego") -> None:
    """Step until so many steps are done, each time until the page has seen it; then show a tab.

    So the charts of each run have the same points.
    """
    await _show_tab(page, "Time")
    while (now := await _frame(page)) < num_steps * STEP:
        await page.get_by_role("button", name="Step", exact=True).click()
        await expect(page.locator(".header-frame")).to_have_text(f"frame {now + STEP}", timeout=WAIT_MS)
    await _show_tab(page, tab)


async def _frame(page: Page) -> int:
    """Return the frame that the page shows."""
    return int((await page.locator(".header-frame").inner_text()).split()[1])


async def _show_graph(page: Page) -> None:
    """Show the ego's topic as a tree, with a chart of its speed."""
    await _show_tab(page, "Graph")
    await page.get_by_role("searchbox", name="Search topics").fill("ego")
    await page.locator(".table-choice").filter(has=page.get_by_text("/Ego_topic", exact=True)).click()
    tree = page.get_by_role("tree", name="Message")
    for name in ("header", "acceleration", "position"):
        await tree.get_by_role("treeitem").filter(has_text=re.compile(f"^.{name}")).first.click()
    texts = await tree.get_by_role("treeitem").all_inner_texts()
    row = next(row for row, text in enumerate(texts) if "velocity" in text)
    await tree.get_by_role("treeitem").nth(row + 1).click()  # its x


async def _run(page: Page) -> None:
    """Let the world run in real time, so that the topics have rates."""
    await _show_tab(page, "Time")
    await page.get_by_role("button", name="Run", exact=True).click()
    await _show_tab(page, "Graph")
    await page.wait_for_timeout(RUN_MS)


async def _save(page: Page, path: Path, size: ViewportSize, part: str = "body") -> None:
    """Write a picture of a part of the page with a palette."""
    await page.set_viewport_size(size)
    await page.mouse.move(0, 0)
    await page.wait_for_timeout(2_000)  # the map moves between two messages, and the camera swings
    picture = Image.open(io.BytesIO(await page.locator(part).screenshot())).convert("RGB")
    file = io.BytesIO()
    picture.quantize(COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
    num_bytes = len(file.getvalue())
    if num_bytes > MAX_BYTES:
        raise SystemExit(f"{path}: expected at most {MAX_BYTES:,} bytes, got {num_bytes:,}; make the picture smaller")
    await asyncio.to_thread(path.write_bytes, file.getvalue())
    print(f"{path}: {num_bytes / 1000:.0f} kB")


def main() -> None:
    """Take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--into", type=Path, default=IMAGES, help="folder of the pictures [docs/images]")
    parser.add_argument("--more", action="store_true", help="also the views that no document shows")
    parser.add_argument("--plans", action="store_true", help="instead, what the map draws of plan_lanes.py")
    choice = parser.parse_args()
    if choice.plans:
        asyncio.run(shoot_plans(choice.into / "page_plans.png"))
    else:
        asyncio.run(shoot(choice.into, has_more=choice.more))


if __name__ == "__main__":
    main()
