"""Frame rate and script time of the web page with many objects, in Chromium with its software renderer.

A server of its own runs the built-in town with so many vehicles more, which drive along all lanes. The page draws the
whole picture again and again, because they move. The script time of a frame is measured around the functions that the
page gives to `requestAnimationFrame`, and around its messages. Other programs on the machine make the rate wrong.

    python -m scripts.bench.page [--objects 1000] [--seconds 10]

It exits with code 1 below 20 frames a second, or above 4 ms of script time a frame (median).
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.async_api import Page, async_playwright

from rosbridge_sim.client import AsyncClient
from scripts.bench.program import SERVER, machine, running

LEAST_RATE = 20.0
"""Frames a second that the page must reach."""

MOST_SCRIPT = 4.0
"""Median of the script time of a frame that the page may need [ms]."""

WARM_UP = 3.0
"""Time before the measurement [s]: the map is loaded and the code is compiled."""

FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")

SPAWN = 100
"""Objects in one call: the most that it takes."""

PROBE = """
(() => {
  const probe = (window.__probe = { frames: [], messages: [], start: 0 });
  const request = window.requestAnimationFrame.bind(window);
  let frame = 0;
  let spent = 0;
  window.requestAnimationFrame = (take) => request((now) => {
    const begin = performance.now();
    take(now);
    spent += performance.now() - begin;
    if (now !== frame) { probe.frames.push(spent); frame = now; spent = 0; }
  });
  const setter = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage").set;
  Object.defineProperty(WebSocket.prototype, "onmessage", {
    set(take) {
      setter.call(this, take && ((event) => {
        const begin = performance.now();
        take(event);
        probe.messages.push(performance.now() - begin);
      }));
    },
  });
})();
"""
"""Notes the time of each frame's functions and of each message [ms]."""


async def main() -> int:
    """Measure the three views, and print them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--objects", type=int, default=1000, help="objects in the town [%(default)s]")
    parser.add_argument("--seconds", type=float, default=10.0, help="time of each measurement [%(default)s]")
    arguments = parser.parse_args()
    print(machine())
    is_good = True
    with (
        tempfile.TemporaryDirectory() as folder,
        (Path(folder) / "log").open("wb") as log,
        running((*SERVER, "--scenario", "town"), log) as program,
    ):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))  # the browser draws on all cores
        await spawn(program.port, arguments.objects)
        async with async_playwright() as playwright:
            browser = await playwright.chromium.launch(
                executable_path=shutil.which("chromium-headless-shell") or shutil.which("chromium"), args=FLAGS
            )
            for view, key in (("above", ""), ("whole map", "0"), ("behind the car", "c")):
                page = await browser.new_page(viewport={"width": 1280, "height": 720})
                await page.add_init_script(PROBE)
                await page.goto(f"http://127.0.0.1:{program.port}/")
                await page.wait_for_selector(":root[data-connection=open]", state="attached")
                await page.wait_for_timeout(1e3)
                if key:
                    await page.keyboard.press(key)
                await page.wait_for_timeout(1e3 * WARM_UP)
                is_good &= report(view, await measure(page, arguments.seconds))
                await page.close()
            await browser.close()
    return 0 if is_good else 1


async def spawn(port: int, num_objects: int) -> None:
    """Fill the town with vehicles that drive along all lanes."""
    async with AsyncClient(f"ws://127.0.0.1:{port}") as client:
        town = await client.map()
        places = [
            (lane["link"], along)
            for lane in town["lanes"]
            if lane["length"] > 30.0
            for along in range(4, math.floor(lane["length"]), 7)
        ]
        objects = [
            {"model": "2015_Kia_K5", "place": {"link": link, "distance": float(along)}, "behaviour": "lane"}
            for link, along in (places * (1 + num_objects // len(places)))[:num_objects]
        ]
        for first in range(0, num_objects, SPAWN):
            await client.spawn_all(objects[first : first + SPAWN])


async def measure(page: Page, seconds: float) -> dict[str, Any]:
    """Return the frames of a time: their script times, those of messages, and the time [ms]."""
    await page.evaluate("__probe.frames.length = __probe.messages.length = 0; __probe.start = performance.now()")
    await page.wait_for_timeout(1e3 * seconds)
    text = await page.evaluate("JSON.stringify({...__probe, time: performance.now() - __probe.start})")
    result: dict[str, Any] = json.loads(text)
    return result


def report(view: str, found: dict[str, Any]) -> bool:
    """Print the figures of a view; return true if they are within the bounds."""
    frames, messages = sorted(found["frames"]), sorted(found["messages"])
    rate = 1e3 * len(frames) / found["time"]
    script = frames[len(frames) // 2] if frames else math.inf
    high = frames[int(0.95 * len(frames))] if frames else math.inf
    message = messages[len(messages) // 2] if messages else math.nan
    print(
        f"{view:16} {rate:6.1f} frames/s   script a frame {script:5.2f} ms median, {high:5.2f} ms of 95 %   "
        f"a message {message:5.2f} ms, {1e3 * len(messages) / found['time']:.1f} a second"
    )
    return rate >= LEAST_RATE and script <= MOST_SCRIPT


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
