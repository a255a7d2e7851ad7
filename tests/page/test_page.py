"""The frame of the page in a browser: requests, connection and token."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.conftest import Serve
from tests.page.conftest import OpenPage

pytestmark = [pytest.mark.client, pytest.mark.slow]


async def test_page_connects_without_a_console_message(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve())
    await expect(page.get_by_text("Connected", exact=True)).to_be_visible()
