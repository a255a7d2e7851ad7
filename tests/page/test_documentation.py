"""The documentation of the server in a browser: its policy lets all load, and nothing is wider than the window."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.conftest import Serve
from tests.page.conftest import OpenPage

pytestmark = [pytest.mark.client, pytest.mark.slow]


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
async def test_page_fits_the_window_and_its_pictures_and_links_work(
    serve: Serve, open_page: OpenPage, width: int, scheme: str
) -> None:
    server = serve("--start", "sync")
    page = await open_page(
        server, path="docs/modelling", state=None, viewport={"width": width, "height": 800}, color_scheme=scheme
    )
    is_narrow = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
    assert await page.evaluate(is_narrow)
    ground = await page.evaluate("getComputedStyle(document.querySelector('th')).backgroundColor")
    assert ground == {"light": "rgb(242, 244, 246)", "dark": "rgb(28, 35, 43)"}[scheme]
    assert await page.evaluate("[...document.images].every((one) => one.complete && one.naturalWidth > 0)")
    await page.get_by_role("link", name="All pages").click()
    await page.get_by_role("link", name="CI", exact=True).click()
    await expect(page.get_by_role("heading", level=1)).to_contain_text("CI")
    await page.locator("a[href^='../operation#']").first.click()
    await expect(page.locator(":target")).to_be_in_viewport()
