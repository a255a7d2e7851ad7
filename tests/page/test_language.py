"""The language of the page: the browser's, and the one that its user chooses."""

from __future__ import annotations

import re

import pytest
from playwright.async_api import Page, expect

from tests.conftest import Serve
from tests.page.conftest import OpenPage, page_url
from tests.support import ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]


async def assert_language(page: Page, language: str, connected: str) -> None:
    await expect(page.locator(".connection-state")).to_have_text(connected)
    assert await page.evaluate("document.documentElement.lang") == language


async def test_page_is_in_the_language_of_the_browser_or_of_the_switch(
    server: ServerProcess, open_page: OpenPage
) -> None:
    page = await open_page(server, locale="ko-KR")
    await assert_language(page, "ko", "연결됨")
    await expect(page.get_by_role("tab", name="시간")).to_be_visible()
    await page.get_by_role("button", name="English").click()  # it loads the page anew, so the choice is kept
    await assert_language(page, "en", "Connected")
    await page.get_by_role("button", name="한국어").click()
    await assert_language(page, "ko", "연결됨")


async def test_english_page_loads_no_korean(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--start", "sync")
    page = await open_page("about:blank", state=None, locale="de-DE")
    urls: list[str] = []
    page.on("response", lambda response: urls.append(response.url))
    await page.goto(page_url(server), wait_until="networkidle")
    await assert_language(page, "en", "Connected")
    assert [url for url in urls if "_ko" in url] == []


async def test_korean_page_whose_texts_do_not_come_is_in_english(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--start", "sync")
    page = await open_page("about:blank", state=None, locale="ko-KR", allow=("Failed to load resource",))
    await page.route(re.compile("texts_ko"), lambda route: route.abort())
    await page.goto(page_url(server))
    await assert_language(page, "en", "Connected")


async def test_all_panels_of_the_korean_page_are_without_errors(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--scenario", "town", "--start", "sync"), locale="ko-KR")
    for name in ("Ego", "시간", "오브젝트", "그래프", "로그", "코드"):
        await page.get_by_role("tab", name=name, exact=True).click()
        await expect(page.get_by_role("tabpanel", name=name, exact=True)).to_be_visible()
        assert "undefined" not in await page.locator("body").inner_text()
