"""Texts from the wire that look like HTML: the page shows them as text."""

from __future__ import annotations

import pytest
import pytest_asyncio
from playwright.async_api import Page, expect

from tests.conftest import Connect, Serve
from tests.page.conftest import OpenPage, page_url
from tests.support import ROOT, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

IMAGE = "<img src=x onerror=window.bad=1>"


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def page(server: ServerProcess, open_shared_page: OpenPage) -> Page:
    return await open_shared_page(server)


async def assert_no_image(page: Page) -> None:
    assert await page.evaluate("document.querySelectorAll('img[src=x]').length") == 0
    assert await page.evaluate("window.bad") is None


async def test_element_takes_texts_as_text_and_no_property_that_is_html(server: ServerProcess, page: Page) -> None:
    await page.route(
        f"{page_url(server)}js/**",
        lambda route: route.fulfill(
            path=ROOT / "rosbridge_sim" / "page" / route.request.url.removeprefix(page_url(server))
        ),
    )
    text, errors = await page.evaluate(
        """async (image) => {
            const { element, replaceChildren, setText } = await import("/js/widgets/dom.js");
            const node = element("div", {title: image, className: image}, image, element("p", {}, image));
            document.body.append(node);
            replaceChildren(node.querySelector("p"), image);
            setText(node.firstChild, image);
            const errors = ["innerHTML", "outerHTML", "srcdoc"].map((name) => {
                try { element("iframe", {[name]: image}); } catch (error) { return error.name; }
            });
            return [node.textContent, errors];
        }""",
        IMAGE,
    )
    assert text == IMAGE * 2
    assert errors == ["TypeError"] * 3
    await assert_no_image(page)


async def test_graph_and_log_show_what_looks_like_html_as_it_is(
    serve: Serve, open_page: OpenPage, connect: Connect
) -> None:
    server = serve("--start", "sync")
    page = await open_page(server)
    client = await connect(server.url)
    await client.send("advertise", topic=f"/{IMAGE}", type="std_msgs/String")  # refused: the log has the name
    await client.send("call_service", service=f"/{IMAGE}", args={})
    await client.send("advertise", topic="/shown", type="std_msgs/String")
    await client.settle()
    await page.get_by_role("tab", name="Graph").click()
    await page.get_by_role("searchbox", name="Search topics").fill("shown")
    await page.locator(".table-choice").filter(has_text="/shown").click()
    await client.subscribe("/sim/topics")
    await client.message_where(
        "/sim/topics", lambda msg: any(one["name"] == "/shown" and one["subscribers"] for one in msg["topics"])
    )
    await client.send("publish", topic="/shown", msg={"data": IMAGE})
    await expect(page.get_by_role("treeitem").filter(has_text=IMAGE)).to_be_visible()
    await page.get_by_role("searchbox", name="Search topics").fill(IMAGE)
    await expect(page.get_by_text("No topic matches.")).to_be_visible()
    await page.get_by_role("tab", name="Log").click()
    await expect(page.locator(".log-line").filter(has_text=f"/{IMAGE}").first).to_be_visible()
    await page.get_by_role("searchbox", name="Search", exact=True).fill(IMAGE)
    await expect(page.locator(".log-text").first).to_contain_text(IMAGE)
    await assert_no_image(page)


async def test_names_and_texts_of_another_client_enter_no_panel_as_html(
    server: ServerProcess, page: Page, connect: Connect
) -> None:
    client = await connect(server.url)
    await client.send("advertise", topic=f"/{IMAGE}", type=IMAGE, id=IMAGE)
    await client.send("advertise", topic="/a", type=IMAGE)
    await client.send("advertise", topic=f"/{IMAGE}", type="std_msgs/String")
    await client.send("publish", topic=f"/{IMAGE}", msg={"data": IMAGE})
    await client.send("publish", topic="/rosout", type="rosgraph_msgs/Log", msg={"name": IMAGE, "msg": IMAGE})
    await client.send("advertise_service", service=f"/{IMAGE}", type=IMAGE)
    await client.send("call_service", service=f"/{IMAGE}", args={})
    await client.send("subscribe", topic=f"/{IMAGE}", id=IMAGE)
    await client.send(IMAGE)
    await client.settle()
    for tab in await page.get_by_role("tab").all():
        await tab.click()
        await expect(tab).to_have_attribute("aria-selected", "true")
        await client.send("publish", topic="/rosout", type="rosgraph_msgs/Log", msg={"name": IMAGE, "msg": IMAGE})
        await client.settle()
        await assert_no_image(page)
