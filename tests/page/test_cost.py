"""Cost of the page for a server: none while its tab is hidden."""

from __future__ import annotations

import pytest
from playwright.async_api import Page, expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.page.test_panels import HIDE, choose_tab
from tests.support import PATIENCE, Frame

pytestmark = [pytest.mark.client, pytest.mark.slow]

SHOW = HIDE.replace("=> true", "=> false")


async def address_of(page: Page, client: AsyncClient) -> str:
    """The address of the page, as the server's topics name it: it is the only client with the ego's topic."""
    topics = await client.wait_for("/sim/topics", lambda msg: bool(subscribers(msg, "/Ego_topic")))
    (address,) = subscribers(topics, "/Ego_topic")
    assert not page.is_closed()
    return address


def subscribers(topics: Frame, name: str) -> list[str]:
    found: list[str] = next(info["subscribers"] for info in topics["topics"] if info["name"] == name)
    return found


def topics_of(topics: Frame, address: str) -> list[str]:
    """Topics with an address as a subscriber or a publisher."""
    return [info["name"] for info in topics["topics"] if address in info["subscribers"] + info["publishers"]]


def sent_messages(state: Frame) -> dict[str, int]:
    """Messages to each client, by its address."""
    return {one["address"]: one["messages_sent"] for one in state["clients"]}


@pytest.mark.parametrize("tab", ["Ego", "Graph", "Log"])
async def test_hidden_page_has_no_subscription_and_takes_them_again(
    serve: Serve, open_page: OpenPage, tab: str
) -> None:
    server = serve("--scenario", "town")
    page = await open_page(server)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        address = await address_of(page, client)
        await choose_tab(page, tab)
        before = topics_of(await client.wait_for("/sim/topics"), address)
        assert before
        await page.evaluate(HIDE)
        await client.wait_for("/sim/topics", lambda msg: not topics_of(msg, address))

        states = await client.subscribe("/sim/clients")
        before_that = -1
        while (sent := sent_messages(await states.next())[address]) != before_that:  # answers may be on their way
            before_that = sent

        await page.evaluate(SHOW)
        await client.wait_for("/sim/topics", lambda msg: set(before) <= set(topics_of(msg, address)))
        await expect(page.get_by_role("banner")).to_contain_text("Connected")
