"""The panels of the page in a browser: drive, step, respect another master, and say why something is refused."""

from __future__ import annotations

import re

import pytest
from playwright.async_api import Page, expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.support import PATIENCE

pytestmark = [pytest.mark.client, pytest.mark.slow]


HIDE = """() => {
    Object.defineProperty(document, "hidden", { configurable: true, get: () => true });
    document.dispatchEvent(new Event("visibilitychange"));
}"""
"""Makes a page believe that its tab is hidden: a headless browser hides none."""


NAMES_PLANNER = re.compile(r"^planner \(127\.0\.0\.1:\d+\) is the master of synchronous mode\.$")


async def begin_drive(page: Page) -> None:
    await page.get_by_role("button", name="Drive by hand").click()
    await expect(page.locator(".driving").get_by_role("button", name="End the drive")).to_be_visible()


async def choose_tab(page: Page, name: str) -> None:
    await page.get_by_role("tab", name=name, exact=True).click()


async def test_car_moves_while_a_key_is_held_and_the_pedals_are_up_afterwards_and_when_the_page_is_lost(
    serve: Serve, open_page: OpenPage
) -> None:
    server = serve()
    page = await open_page(server)
    await begin_drive(page)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        before = await client.wait_for("/Ego_topic")
        await page.keyboard.down("ArrowUp")
        moved = await client.wait_for("/Ego_topic", lambda ego: ego["velocity"]["x"] > 2.0)
        assert moved["position"]["x"] > before["position"]["x"]
        await page.keyboard.up("ArrowUp")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] == 0.0)
        await page.keyboard.down("Space")
        await client.wait_for("/Ego_topic", lambda ego: ego["brake"] > 0.5)
        await client.wait_for("/Ego_topic", lambda ego: ego["velocity"]["x"] == 0.0)
        await page.keyboard.up("Space")
        await page.keyboard.down("w")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] > 0.5)
        await page.context.close()
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] == 0.0)


async def test_hidden_tab_ends_the_drive(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await begin_drive(page)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await page.keyboard.down("w")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] > 0.5)
        await page.evaluate(HIDE)
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] == 0.0)
    await expect(page.get_by_role("button", name="Drive by hand")).to_be_visible()


async def test_tab_that_is_hidden_while_a_drive_begins_does_not_drive(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town"))
    button = page.get_by_role("button", name="Drive by hand")
    await expect(button).to_be_enabled()  # or the click would only say why it cannot be
    await button.evaluate(f"button => {{ button.click(); ({HIDE})(); }}")  # the answers of the server come later
    await expect(page.locator(".driving .notice").get_by_text("because the page was hidden")).to_be_visible()
    await expect(button).to_be_visible()


async def test_ego_that_drives_itself_ends_the_drive_by_hand(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town"))
    await begin_drive(page)
    await page.get_by_role("button", name="Self-driving").click()
    await expect(page.locator(".driving")).to_contain_text("the control mode of the ego is now: drives itself (6)")
    await begin_drive(page)
    await expect(page.get_by_role("button", name="Program")).to_have_attribute("aria-pressed", "true")
    await expect(page.locator(".driving").get_by_role("button", name="End the drive")).to_be_visible()


async def test_end_of_a_drive_in_steps_lifts_the_pedals(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_page(server)
    await choose_tab(page, "Time")
    await page.get_by_role("button", name="Take synchronous mode").click()
    await expect(page.locator(".time-state")).to_contain_text("this page")
    await choose_tab(page, "Ego")
    await begin_drive(page)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        egos = await client.subscribe("/Ego_topic")
        await page.keyboard.down("w")
        for _ in range(5):
            await page.keyboard.press(".")
        await egos.wait_for(lambda ego: ego["accel"] > 0.0)
        await page.keyboard.press("Escape")
        await choose_tab(page, "Time")
        await page.get_by_role("button", name="Step", exact=True).click()
        await egos.wait_for(lambda ego: ego["accel"] == 0.0)


async def test_window_that_loses_the_keyboard_lifts_the_pedals(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await begin_drive(page)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await page.keyboard.down("w")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] > 0.5)
        await page.evaluate("window.dispatchEvent(new Event('blur'))")
        await client.wait_for("/Ego_topic", lambda ego: ego["accel"] == 0.0)


async def test_step_moves_the_world_by_one_frame(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_page(server)
    await choose_tab(page, "Time")
    frame = page.locator(".header-frame")
    await expect(frame).to_have_text("frame 0")
    await page.get_by_role("button", name="Step", exact=True).click()
    await expect(frame).to_have_text("frame 1")
    await expect(page.locator(".time-state")).to_contain_text("this page")
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        assert (await client.wait_for("/SyncModeInfo"))["frame"] == 1


async def test_step_of_a_paused_world_moves_it_by_the_step_alone(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await choose_tab(page, "Time")
    await page.get_by_role("button", name="Pause", exact=True).click()
    await expect(page.locator(".time-state")).to_have_text("Paused")
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        before = (await client.wait_for("/SyncModeInfo"))["frame"]
        await page.get_by_label("Steps").fill("3")
        await page.get_by_role("button", name="Step", exact=True).click()
        await client.wait_for("/SyncModeInfo", lambda info: info["frame"] == before + 3)
        await expect(page.locator(".time-state")).to_contain_text("this page")
        assert (await client.wait_for("/SyncModeInfo"))["frame"] == before + 3


async def test_keys_act_with_each_step_in_synchronous_mode_of_the_page(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_page(server)
    await choose_tab(page, "Time")
    await page.get_by_role("button", name="Take synchronous mode").click()
    await expect(page.locator(".time-state")).to_contain_text("this page")
    await choose_tab(page, "Ego")
    await begin_drive(page)
    await page.keyboard.down("w")
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        while (await client.describe(0))["speed"] == 0.0:  # a little gas does not overcome the rolling resistance
            await page.keyboard.press(".")


async def test_master_of_another_client_is_respected_and_named(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await begin_drive(page)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync(user_id="planner")
        drive = page.get_by_role("button", name="Drive by hand")
        await expect(drive).to_have_attribute("aria-disabled", "true")
        await expect(drive).to_have_attribute("title", NAMES_PLANNER)
        await choose_tab(page, "Time")
        await expect(page.locator(".time-state")).to_contain_text("planner")
        await page.get_by_role("button", name="Step", exact=True).press("Enter")
        await expect(page.get_by_text(NAMES_PLANNER).locator("visible=true")).to_be_visible()
        assert (await client.wait_for("/SyncModeInfo"))["master_id"] == "planner"


async def test_second_page_has_one_name_for_the_first_and_shows_what_is_in_force(
    serve: Serve, open_page: OpenPage
) -> None:
    server = serve("--scenario", "town")
    first, second = await open_page(server), await open_page(server)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.call("/sim/real_time_factor", {"factor": 0.3})
        await expect(second.get_by_label("Real-time factor")).to_have_value("0.3")
        for page in (first, second):
            await expect(page.locator(".header-time")).to_have_text(re.compile(r"^Running, 0\.[0-3]\d .$"))
            await expect(page.locator(".header-activity")).to_have_text("Ego: waits for a command")
            await choose_tab(page, "Time")
        await first.get_by_label("Time step [ms]").fill("100")
        await first.get_by_role("button", name="Take synchronous mode").click()
        await expect(first.locator(".header-time")).to_have_text("Synchronous, stands")  # else a step is not taken
        await choose_tab(first, "Ego")
        await begin_drive(first)
        await first.keyboard.down("w")
        await first.keyboard.press(".")
        name = re.compile(r"^\w+: another page \(127\.0\.0\.1:\d+\)$")
        await expect(second.locator(".header-driver")).to_have_text(name)
        driver = await second.locator(".header-driver").inner_text()
        await expect(second.locator(".header-master")).to_have_text(driver.replace("Driver: ", "Master: "))
        await expect(second.get_by_label("Time step [ms]")).to_have_value("100")
        await expect(second.locator(".header-time")).to_have_text("Synchronous, stands")


async def test_another_client_that_publishes_commands_is_named(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await begin_drive(page)
    warning = page.get_by_role("alert")
    await expect(warning).to_be_hidden()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.publish("/ctrl_cmd", {"longlCmdType": 1}, "morai_msgs/CtrlCmd")
        await expect(warning).to_contain_text("127.0.0.1:")
    await expect(warning).to_be_hidden()


async def test_bad_name_of_a_scenario_shows_the_reason_of_the_server(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town", "--start", "sync"))
    await choose_tab(page, "Time")
    await page.get_by_label("Name of a scenario").fill("twon")
    await page.get_by_label("Name of a scenario").press("Enter")
    await expect(page.locator(".notice[data-kind=bad]:visible")).to_contain_text("twon")


async def test_scenarios_are_listed_with_pictures_and_loaded(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town", "--start", "sync"))
    await choose_tab(page, "Time")
    row = page.get_by_role("listitem").filter(has_text="loop")
    await row.scroll_into_view_if_needed()  # a picture is asked for when its list is seen
    await expect(row.locator("img")).to_be_visible()
    await row.get_by_role("button", name="Load loop").click()
    await expect(row).to_contain_text("loaded now")


async def test_snapshot_brings_the_world_back(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--start", "sync")
    page = await open_page(server)
    await choose_tab(page, "Time")
    await page.get_by_role("button", name="Take synchronous mode").click()
    await page.get_by_label("Name", exact=True).fill("<img onerror=alert(1)>")
    await page.get_by_role("button", name="Save").click()
    await page.get_by_role("button", name="Step", exact=True).click()
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.wait_for("/SyncModeInfo", lambda info: info["frame"] == 1)
        await page.get_by_role("button", name="Go back to <img onerror=alert(1)>").click()
        await client.wait_for("/SyncModeInfo", lambda info: info["frame"] == 0)


async def test_keyboard_keeps_its_place_in_lists_that_change(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town", "--start", "sync"))
    await choose_tab(page, "Time")
    snapshots = page.get_by_label("Snapshots", exact=True)
    for number in (1, 2):
        await page.get_by_role("button", name="Save", exact=True).click()
        await expect(snapshots.locator("ul .row-name")).to_have_count(number)
    for left in (1, 0):
        await snapshots.get_by_role("button", name="Remove").first.focus()
        await page.keyboard.press("Enter")
        await expect(snapshots.locator("ul .row-name")).to_have_count(left)
        await expect(snapshots.locator("button:focus")).to_have_count(1)
    await page.get_by_role("button", name="Load loop").focus()
    await page.keyboard.press("Enter")
    await expect(page.get_by_text("loaded now")).to_have_count(1)
    await expect(page.get_by_text("Loaded loop.")).to_be_visible()
    await expect(page.get_by_role("button", name="Load loop")).to_be_focused()


async def test_object_is_placed_by_coordinates_and_taken_back(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town", "--start", "sync")
    page = await open_page(server)
    await choose_tab(page, "Objects")
    await page.get_by_label("Search the catalogue").fill("ioniq 5")
    form = page.get_by_role("region", name="Place an object")
    await form.get_by_text("By coordinates").click()
    for label, text in (("x, east [m]", "-60"), ("y, north [m]", "-5"), ("Heading [°]", "90")):
        await form.get_by_label(label).fill(text)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        num = len((await client.wait_for("/sim/scene/state"))["id"])
        await form.get_by_role("button", name="Place here").click()
        await client.wait_for("/sim/scene/state", lambda scene: len(scene["id"]) == num + 1)
        await page.get_by_role("button", name="Undo: Place").click()
        await client.wait_for("/sim/scene/state", lambda scene: len(scene["id"]) == num)


async def test_actions_are_shown_as_programs(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    await choose_tab(page, "Time")
    await page.get_by_role("button", name="Pause", exact=True).click()
    await choose_tab(page, "Code")
    await expect(page.get_by_label("Program", exact=True)).to_contain_text("roslibpy.Service")
    await page.get_by_role("radio", name="Shell").click()
    await expect(page.get_by_label("Program", exact=True)).to_contain_text("rosbridge-sim service call")


async def test_each_control_has_a_name_for_screen_readers(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town", "--start", "sync"))
    for tab in ("Ego", "Time", "Objects", "Code"):
        await choose_tab(page, tab)
        panel = page.get_by_role("tabpanel", name=tab)
        controls = panel.locator("button, input, select, textarea, canvas, [role=slider]")
        nameless = await controls.evaluate_all(
            """(nodes) => nodes
                .filter((node) => !(node.getAttribute("aria-label") || node.labels?.length || node.textContent.trim()))
                .map((node) => node.outerHTML)"""
        )
        assert nameless == []
