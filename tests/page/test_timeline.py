"""Scroll back: the last two minutes of the live drive on the page, their marks, and a branch from a snapshot."""

from __future__ import annotations

import re

import pytest
from playwright.async_api import Locator, Page, expect

from rosbridge_sim.client import AsyncClient, ClientError
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_page import faults_of
from tests.support import PATIENCE, Frame

pytestmark = [pytest.mark.client, pytest.mark.slow]

FACTOR = 5.0
"""Real-time factor: ten simulated seconds pass from snapshot to snapshot."""


KEPT_ONE, KEPT_MORE = re.compile(r"^Keep snapshots \([1-9]\d*\)$"), re.compile(r"^Keep snapshots \(([2-9]|1\d)\)$")


def slider_of(page: Page) -> Locator:
    return page.get_by_role("slider", name="Place in the last two minutes")


async def seconds_of(page: Page) -> tuple[float, float]:
    """The first and the last moment that the page has [s]."""
    slider = slider_of(page)
    first, last = await slider.get_attribute("min"), await slider.get_attribute("max")
    assert first is not None
    assert last is not None
    return float(first), float(last)


DRAG = """(slider, value) => {
  slider.value = value;
  slider.dispatchEvent(new Event("input"));
  slider.dispatchEvent(new Event("change"));
}"""
"""A place that the slider's maximum may have passed when it arrives, as by a hand."""


ENDS_AT = """(seconds) => Math.abs(document.querySelector(".timeline input[type=range]").max - seconds) < 0.001"""


async def scroll_to(page: Page, seconds: float) -> None:
    await slider_of(page).evaluate(DRAG, str(seconds))


async def test_past_is_shown_with_its_age_and_a_branch_returns_the_world_to_a_snapshot(
    serve: Serve, open_page: OpenPage
) -> None:
    server = serve()
    page = await open_page(server)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await page.get_by_label("Keep snapshots").check()
        await expect(page.get_by_text(KEPT_ONE)).to_be_visible()
        snapshot, *_ = (await client.call("/sim/snapshots", {}))["snapshots"]
        await client.call("/sim/real_time_factor", {"factor": FACTOR})
        await page.get_by_role("button", name="Let it drive").click()
        await client.wait_for("/Ego_topic", lambda ego: ego["velocity"]["x"] > 5.0)
        await expect(page.get_by_text(KEPT_MORE)).to_be_visible()
        await client.call("/sim/real_time_factor", {"factor": 0.2})  # fewer pictures
        speed = page.locator(".speed-value")
        first, _ = await seconds_of(page)
        await scroll_to(page, first)
        banner = page.locator(".past-banner")
        await expect(banner).to_contain_text(re.compile(r"^\d+\.\d s ago, frame \d+You see the past\."))
        await expect(speed).to_have_text("0.0")  # the instruments and charts are those of then
        await expect(page.get_by_role("slider", name="Chart of Speed")).to_have_attribute(
            "aria-valuetext", re.compile(r"^0\.0 km/h, \d+\.\d s ago")
        )
        await expect(page.locator(".instruments dd").first).to_have_text("\u2013")  # nothing tells who drove then
        await page.get_by_role("button", name="Back to live").click()
        await expect(banner).to_be_hidden()
        await expect(page.locator(".instruments dd").first).to_have_text("drives itself")
        await scroll_to(page, first)
        await page.get_by_role("button", name="Branch here").click()
        dialog = page.get_by_role("dialog")
        await expect(dialog).to_contain_text(f"the snapshot of frame {snapshot['frame']} ")
        await dialog.get_by_role("button", name="Branch").click()
        await expect(banner).to_be_hidden()
        sync = await client.wait_for("/SyncModeInfo", lambda info: info["status"])
        assert sync["frame"] == snapshot["frame"]
        await expect(page.get_by_text(f"The world stands at frame {snapshot['frame']}.")).to_be_visible()
        # What came after is no more, once the page has the world as it stands.
        await page.wait_for_function(ENDS_AT, arg=snapshot["frame"] * 0.02)
        await page.get_by_label("Keep snapshots").uncheck()
        await expect(page.get_by_text("Keep snapshots", exact=True)).to_be_visible()  # without their number
        assert not (await client.call("/sim/snapshots", {}))["snapshots"]


async def change_lane(page: Page, client: AsyncClient) -> tuple[str, Frame]:
    """Put the ego on the lane beside its own, once the page shows that one; its own lane, and the place."""
    scene = await client.wait_for("/sim/scene/state")
    lanes = (await client.call("/sim/map", {"page": 0}))["lanes"]
    link: str = (await client.call("/sim/describe", {"id": 0}))["link"]
    [own] = [lane for lane in lanes if lane["link"] == link]
    [beside] = [lane for lane in lanes if lane["link"] == (own["left_link"] or own["right_link"])]
    await expect(page.locator(".instruments")).to_contain_text(link)
    near = min(
        range(len(beside["x"])), key=lambda i: abs(beside["x"][i] - scene["x"][0]) + abs(beside["y"][i] - scene["y"][0])
    )
    heading = float(scene["heading"][0]) * 57.29578
    moved = {"x": beside["x"][near], "y": beside["y"][near], "z": 0.0, "heading_deg": heading}
    await client.call("/sim/set", {"objects": [{"unique_id": 0, "set_place": True, "place": moved}]})
    return link, moved


async def test_lane_change_in_the_first_frame_is_marked(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "loop", "--start", "sync")
    page = await open_page(server)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync()
        await change_lane(page, client)
        await client.tick()
        await expect(page.get_by_role("button", name=re.compile("^Lane change, 0 s ago: "))).to_be_visible()


async def test_marks_lead_to_collisions_lane_changes_and_refusals(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--scenario", "loop")
    page = await open_page(server, color_scheme="dark")
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        link, moved = await change_lane(page, client)
        await client.call("/sim/spawn", {"objects": [{"model": "Box", "place": moved}]})
        with pytest.raises(ClientError):
            await client.call("/no/such/service", {})
        for name in ("Lane change", "Collision", "Refused request"):
            await expect(page.get_by_role("button", name=re.compile(f"^{name}, \\d+ s ago: ")).first).to_be_visible()
        # The mark moves with time, so a busy browser may never find it at rest for the pointer.
        await page.get_by_role("button", name=re.compile("^Lane change")).first.press("Enter")
        await expect(page.locator(".past-banner")).to_be_visible()
        assert await faults_of(page) == []
        await expect(page.locator(".instruments")).to_contain_text(link)  # two seconds before, on the lane of then
        await client.call("/sim/reset", {"seed": -1})
        await expect(page.locator(".past-banner")).to_be_hidden()  # it has not happened any more
        await expect(page.get_by_role("button", name=re.compile("^Lane change"))).to_have_count(0)
