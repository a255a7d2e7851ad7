"""The map of the page in a browser: what its pixels show, and what the pointer and the keys do."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from io import BytesIO
from typing import Final

import numpy as np
import pytest
from PIL import Image
from playwright.async_api import Page, expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.support import PATIENCE, ROOT

pytestmark = [pytest.mark.client, pytest.mark.slow]

COLOURS: Final = json.loads((ROOT / "rosbridge_sim" / "page" / "colours.json").read_text())
Pixels = np.ndarray[tuple[int, int, int], np.dtype[np.float64]]


def colour(hex_text: str) -> tuple[int, int, int]:
    return int(hex_text[1:3], 16), int(hex_text[3:5], 16), int(hex_text[5:7], 16)


async def picture(page: Page) -> Pixels:
    """The canvas as it is seen, (height, width, 3)."""
    shot = await page.locator("canvas.map-canvas").screenshot(scale="css")
    return np.asarray(Image.open(BytesIO(shot)).convert("RGB"), dtype=np.float64)


def places_of(pixels: Pixels, wanted: tuple[int, int, int], within: float = 60.0) -> np.ndarray:
    """The pixels with about a colour, (k, 2) as x and y."""
    y, x = np.nonzero(np.abs(pixels - wanted).sum(axis=-1) < within)
    return np.stack([x, y], axis=-1)


async def nothing() -> None:
    """Do nothing before a picture."""


async def until(
    page: Page, check: Callable[[Pixels], bool], before: Callable[[], Awaitable[object]] = nothing
) -> Pixels:
    """Wait until the canvas shows something; `before` each picture, do something.

    On a busy machine the browser now and then takes a picture between two drawings: all black but for the labels above.
    """
    seen = []
    try:
        async with asyncio.timeout(PATIENCE):
            while True:
                await before()
                pixels = await picture(page)
                seen.append(f"{(pixels > 0.0).any(axis=-1).mean():.2f}")
                if float(seen[-1]) > 0.5 and check(pixels):
                    return pixels
                await page.wait_for_timeout(250)  # a picture of the canvas costs as much as its drawing
    except TimeoutError:
        view = [await page.locator(f".{name}").inner_text() for name in ("scale-bar", "header-time")]
        raise AssertionError(f"waited in vain; shares that are not black: {' '.join(seen)}; {view}") from None


def ego_pixels(pixels: Pixels) -> np.ndarray:
    return places_of(pixels, colour(COLOURS["kinds"]["ego"]), within=90.0)


def middle_of_ego(pixels: Pixels) -> np.ndarray:
    """The middle of the ego as x and y; not a number where it is not drawn, which no comparison finds true."""
    found = ego_pixels(pixels)
    return found.mean(axis=0) if len(found) > 50 else np.full(2, np.nan)


def has_ego_in_the_middle(pixels: Pixels) -> bool:
    """Whether the map follows the ego: it is fitted to the whole map before."""
    height, width, _ = pixels.shape
    return bool(np.abs(middle_of_ego(pixels) - (width / 2, height / 2)).max() < 0.06 * width)


async def open_map(open_page: OpenPage, url: str, **options: object) -> Page:
    """The page, once the ego and the road are drawn."""
    page = await open_page(url, has_webgl=True, **options)  # type: ignore[arg-type]
    lane = colour(COLOURS["mapDark" if options.get("color_scheme") == "dark" else "map"]["lane"])
    await until(page, lambda pixels: len(places_of(pixels, lane, within=8.0)) > 2000)
    await page.locator(".start-card .close").click()  # it would hide a part of the map
    return page


async def coordinates(page: Page, x: float, y: float) -> str:
    """The text about the place under a point of the canvas."""
    box = await page.locator("canvas.map-canvas").bounding_box()
    assert box is not None
    left, top = round(box["x"] + x), round(box["y"] + y)  # a wheel knows whole pixels only
    await page.mouse.move(left - 1, top)
    await page.mouse.move(left, top)
    return await page.locator(".coordinates").inner_text()


async def command_full_gas(client: AsyncClient) -> None:
    """Have the ego drive to the east with each tick: a page that draws in real time would need all processors."""
    await client.start_sync(step_ms=500)  # few pictures
    command = {"longlCmdType": 1, "accel": 1.0}
    await client.ask("/SyncModeCtrlCmd", frame=client.next_frame, command=command, sensor_capture=False)


def url_of(port: int) -> str:
    return f"http://127.0.0.1:{port}/"


async def test_ego_moves_on_the_canvas(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_map(open_page, url_of(server.port))
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await command_full_gas(client)
        await expect(page.locator(".header-master")).to_be_visible()  # the layout is final
        await until(page, has_ego_in_the_middle)
        await page.keyboard.press("f")  # the map stands still
        await expect(page.get_by_role("button", name="Follow the car")).to_have_attribute("aria-pressed", "false")
        before = middle_of_ego(await until(page, has_ego_in_the_middle))
        await client.tick(6)
        after = middle_of_ego(await until(page, lambda pixels: bool(middle_of_ego(pixels)[0] > before[0] + 20)))
    assert abs(after[1] - before[1]) < 10, "it drives to the east, which is on the right"


async def test_ego_stays_in_the_middle_while_the_map_follows(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_map(open_page, url_of(server.port))
    follow = page.get_by_role("button", name="Follow the car")
    await expect(follow).to_have_attribute("aria-pressed", "true")
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await command_full_gas(client)
        await client.tick(8)
    pixels = await until(page, lambda pixels: len(ego_pixels(pixels)) > 50)
    assert abs(middle_of_ego(pixels)[0] / pixels.shape[1] - 0.5) < 0.06
    await page.mouse.move(300, 300)
    await page.mouse.down()
    await page.mouse.move(360, 320, steps=3)
    await page.mouse.up()
    await expect(follow).to_have_attribute("aria-pressed", "false")


async def test_light_has_the_colour_that_it_is_set_to(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_map(open_page, url_of(server.port))
    async with AsyncClient(server.url) as client:
        await client.start_sync()
        town = await client.map()
        near = [light for light in town["lights"] if abs(light["x"] + 110) < 30 and abs(light["y"]) < 30]
        for lamps, name in ((4, "yellow"), (1, "red"), (16, "green")):
            for light in near:
                status = lamps & light["lamps"]  # those of pedestrians have no yellow
                await client.publish(
                    "/SetTrafficLight", {"trafficLightIndex": light["name"], "trafficLightStatus": status}
                )
            await client.tick()
            others = [colour(COLOURS["signals"][other]) for other in ("yellow", "red", "green") if other != name]
            shown = colour(COLOURS["signals"][name])

            def shows(
                pixels: Pixels, shown: tuple[int, int, int] = shown, others: list[tuple[int, int, int]] = others
            ) -> bool:
                return len(places_of(pixels, shown, 30.0)) > 200 and all(
                    len(places_of(pixels, other, 30.0)) < 100 for other in others
                )

            await until(page, shows)


async def test_zoom_at_the_pointer_keeps_the_place_under_it(serve: Serve, open_page: OpenPage) -> None:
    page = await open_map(open_page, url_of(serve("--scenario", "town", "--start", "sync").port))
    await page.keyboard.press("f")
    before = await coordinates(page, 600, 150)
    scale = await page.locator(".scale-bar").inner_text()
    await page.mouse.wheel(0, 400)
    await expect(page.locator(".scale-bar")).not_to_have_text(scale)
    assert await coordinates(page, 600, 150) == before


async def test_click_selects_the_object_under_it_and_tells_what_it_does(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_map(open_page, url_of(server.port))
    async with AsyncClient(server.url) as client:
        await client.start_sync()
        await client.spawn("2015_Kia_K5", x=-80.0, y=-12.0, behaviour="stand")
        number = await client.spawn("2015_Kia_K5", x=-80.0, y=12.0, behaviour="stand")
        await client.tick()
    await page.keyboard.press("f")
    box = await page.locator("canvas.map-canvas").bounding_box()
    assert box is not None
    # The ego at -86, -5.25 is in the middle, and 8 pixels are a metre in the first picture.
    x, y = round(box["width"] / 2 + 8 * (-79 + 86)), round(box["height"] / 2 - 8 * (12.0 + 5.25))
    paper = np.array(colour(COLOURS["map"]["paper"]))
    await until(page, lambda pixels: bool(np.abs(pixels[y, x] - paper).sum() > 100))
    await page.mouse.click(box["x"] + x, box["y"] + y)
    card = page.get_by_role("region", name="Selected object")
    await expect(card.get_by_role("heading")).to_have_text(f"Vehicle {number}")
    await expect(card).to_contain_text("2015_Kia_K5")
    await expect(card).to_contain_text("stand")
    await page.keyboard.press("Escape")
    await expect(card).to_be_hidden()


async def test_objects_are_selected_by_the_keyboard(serve: Serve, open_page: OpenPage) -> None:
    page = await open_map(open_page, url_of(serve("--scenario", "town", "--start", "sync").port))
    heading = page.get_by_role("region", name="Selected object").get_by_role("heading")
    await page.keyboard.press("o")
    await expect(heading).to_have_text("Ego")
    await page.keyboard.press("o")
    await expect(heading).to_have_text("Vehicle 1")
    await page.keyboard.press("Shift+O")
    await expect(heading).to_have_text("Ego")


WATCH_COLLISIONS = """() => {
    window.isTold = false;
    new MutationObserver(() => {
        const label = document.querySelector(".map-label.contact");
        window.isTold ||= Boolean(label?.textContent.includes("Collision: Ego and Vehicle"));
    }).observe(document.body, { attributes: true, characterData: true, childList: true, subtree: true });
}"""
"""Notes a collision that is told: it is for 2.5 s, in which a busy browser may answer no question."""


async def test_collision_is_told_on_the_map_and_listed_with_both_names(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_map(open_page, url_of(server.port))
    async with AsyncClient(server.url) as client:
        await client.start_sync()
        await client.spawn("2015_Kia_K5", x=-85.0, y=-5.25, behaviour="stand")
        await page.evaluate(WATCH_COLLISIONS)
        await client.tick()
        await page.wait_for_function("() => window.isTold")
    entry = page.locator(".contact-list li")
    await expect(entry.first).to_contain_text("Ego and Vehicle")
    await page.get_by_role("button", name="Clear the list of collisions").click()
    await expect(page.locator(".contact-list")).to_be_hidden()


async def test_camera_behind_the_car_shows_sky_and_the_car(serve: Serve, open_page: OpenPage) -> None:
    page = await open_map(open_page, url_of(serve("--scenario", "town", "--start", "sync").port))
    await page.keyboard.press("c")
    await expect(page.get_by_role("button", name="Camera behind the car")).to_have_attribute("aria-pressed", "true")
    sky = np.array(colour(COLOURS["sky"]["horizon"]))
    pixels = await until(page, lambda pixels: bool(np.abs(pixels[10:60, 200] - sky).sum(axis=-1).max() < 120))
    assert len(ego_pixels(pixels)) > 3000, "the car is large"


async def test_camera_behind_the_car_shows_the_scene_that_cameras_see(serve: Serve, open_page: OpenPage) -> None:
    page = await open_map(open_page, url_of(serve("--scenario", "parking", "--start", "sync").port))
    await page.keyboard.press("c")

    def has_meadows(pixels: Pixels) -> bool:
        red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
        return bool(((green > red + 10) & (green > blue + 30)).mean() > 0.05)

    pixels = await until(page, has_meadows)
    assert len(places_of(pixels, colour(COLOURS["kinds"]["vehicle"]), within=40.0)) < 50, (
        "vehicles have colours of cars"
    )


async def test_distance_between_two_clicks_is_measured(serve: Serve, open_page: OpenPage) -> None:
    page = await open_map(open_page, url_of(serve("--scenario", "town", "--start", "sync").port))
    await page.keyboard.press("f")
    await page.keyboard.press("m")
    await page.mouse.click(200, 200)
    await page.mouse.click(360, 200)
    await expect(page.locator(".map-label.measure")).to_have_text("20 m")
    await page.keyboard.press("Escape")
    await expect(page.locator(".map-label.measure")).to_be_hidden()


DRAWN_IN_HALF_A_SECOND = """() => new Promise((resolve) => {
    window.drawn = 0;
    setTimeout(() => resolve(window.drawn), 500);
})"""


async def test_nothing_is_drawn_while_nothing_changes(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    async with AsyncClient(server.url) as client:
        await client.start_sync()
        page = await open_map(open_page, url_of(server.port))
        await page.evaluate("""() => {
            const clear = WebGL2RenderingContext.prototype.clear;
            WebGL2RenderingContext.prototype.clear = function (mask) { window.drawn += 1; clear.call(this, mask); };
        }""")
        async with asyncio.timeout(PATIENCE):
            while await page.evaluate(DRAWN_IN_HALF_A_SECOND):  # the last state may still move, or change the page
                pass
            await client.tick()
            while await page.evaluate("window.drawn") == 0:
                await page.wait_for_timeout(50)


async def test_help_lists_keys_and_colours(serve: Serve, open_page: OpenPage) -> None:
    page = await open_map(open_page, url_of(serve("--scenario", "town", "--start", "sync").port), color_scheme="dark")
    await page.get_by_role("button", name="Keys and colours").click()
    dialog = page.get_by_role("dialog", name="Map: keys and colours")
    await expect(dialog).to_contain_text("Measure a distance between two clicks")
    await expect(dialog).to_contain_text("within an intersection")
    link = dialog.get_by_role("link")
    assert (await link.get_attribute("target"), await link.get_attribute("href")) == ("_blank", "docs/guides/page")
    await page.keyboard.press("Escape")
    await expect(dialog).to_be_hidden()
    for width, height in ((720, 450), (390, 844), (844, 390)):
        await page.set_viewport_size({"width": width, "height": height})
        toolbar = await page.get_by_role("toolbar", name="Map").bounding_box()
        timeline = await page.locator(".timeline").bounding_box()
        assert toolbar is not None
        assert timeline is not None
        assert toolbar["y"] + toolbar["height"] <= timeline["y"], (width, height)


async def test_model_is_placed_where_it_is_dragged_to(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "loop", "--start", "sync")
    page = await open_page(server, has_webgl=True)
    await page.get_by_role("tab", name="Objects", exact=True).click()
    await page.get_by_label("Model", exact=True).select_option("Bus")
    canvas = page.locator("main canvas").first
    await page.locator(".drag-model", has_text="Bus").drag_to(canvas, target_position={"x": 400, "y": 500})
    await expect(page.get_by_text("Bus is object")).to_be_visible()


async def test_map_without_the_scene_says_what_the_server_denies(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "loop", "--start", "sync", "--deny-subscribe", "/sim/scene/*")
    page = await open_page(server, has_webgl=True)
    await expect(page.locator(".map-hint")).to_have_text(
        "The server does not let this page see the world: it denies /sim/scene/view."
    )
