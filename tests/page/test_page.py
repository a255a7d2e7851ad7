"""The frame of the page in a browser: requests, token, loss of the connection, tabs, and accessibility."""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.conftest import Serve
from tests.page.conftest import OpenPage, page_url
from tests.page.prefix_proxy import PrefixProxy
from tests.shell.websocket.test_access import Certificate
from tests.support import PATIENCE, ROOT, ServerProcess, miss

pytestmark = [pytest.mark.client, pytest.mark.slow]

TOKEN = "s3cret"  # noqa: S105 - of these tests

LOOKS = (("light", 360), ("dark", 1280))
"""Colours, and widths of the window [px]: no colour depends on the width."""

MAP_SIZE = """() => {
    const box = (part) => document.querySelector(part).getBoundingClientRect();
    const [stage, timeline, header] = [".stage", ".timeline", ".header"].map(box);
    return { width: stage.width, height: stage.height - timeline.height, header: header.height };
}"""
"""Size of the map that is seen, and height of the header [px]."""

MAX_REQUESTS = 12
"""All that the page may load; the socket counts as one."""


async def test_page_connects_with_few_requests_that_all_succeed_without_webgl(
    server: ServerProcess, open_page: OpenPage
) -> None:
    page = await open_page("about:blank", state=None)
    statuses: dict[str, int] = {}
    sockets: list[str] = []
    page.on("response", lambda response: statuses.update({response.url: response.status}))
    page.on("websocket", lambda socket: sockets.append(socket.url))
    await page.goto(page_url(server), wait_until="networkidle")
    await expect(page.locator(".connection-state")).to_have_text("Connected")
    assert set(statuses.values()) == {200}, statuses
    assert sockets == [f"ws://127.0.0.1:{server.port}/"]
    assert len(statuses) + len(sockets) <= MAX_REQUESTS
    await expect(page.get_by_text("This browser has no WebGL 2")).to_be_visible()  # and the rest works


async def test_page_says_that_it_loads_before_its_program_has_come(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page("about:blank", state=None, allow=("Failed to load resource",))
    await page.route("**/page.js", lambda route: route.abort())
    await page.goto(page_url(serve("--start", "sync")))
    await expect(page.get_by_text("Loading …")).to_be_visible()


async def test_page_may_be_called_by_each_own_name_without_a_flag(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--host", "0.0.0.0", "--start", "sync")  # noqa: S104 - as in a container
    await open_page(f"http://localhost:{server.port}/")
    (line,) = [line for line in server.log.splitlines() if "the page is at " in line]
    urls = [word.rstrip(",") for word in line.split() if word.startswith("http://")]
    assert urls[0] == f"http://127.0.0.1:{server.port}/"
    for url in urls:
        await open_page(url)


async def test_page_works_behind_a_proxy_that_strips_a_prefix(serve: Serve, open_page: OpenPage) -> None:
    async with PrefixProxy(serve("--start", "sync").port, "/lab/sim") as proxy:
        for url in (proxy.url, proxy.url + "?x=1#y"):
            page = await open_page(url)
            await page.close()  # before the proxy, which it would miss
        assert proxy.num_refused == 0


async def test_page_of_a_server_with_a_certificate_speaks_wss(
    serve: Serve, open_page: OpenPage, tmp_path: Path
) -> None:
    certificate = Certificate(tmp_path)
    server = serve("--certfile", certificate.certfile, "--keyfile", certificate.keyfile)
    page = await open_page("about:blank", state=None, ignore_https_errors=True)  # no authority knows it
    sockets: list[str] = []
    page.on("websocket", lambda socket: sockets.append(socket.url))
    await page.goto(f"https://127.0.0.1:{server.port}/")
    await expect(page.locator(".connection-state")).to_have_text("Connected")
    await expect(page.locator(".header-frame")).to_have_text(re.compile(r"frame [1-9]"))
    assert sockets == [f"wss://127.0.0.1:{server.port}/"]


@pytest.mark.parametrize("is_named", [False, True])
async def test_only_a_named_page_may_show_it_in_a_frame(serve: Serve, open_page: OpenPage, *, is_named: bool) -> None:
    server = serve("--start", "sync", *(("--page-frame-ancestors", "http://127.0.0.1:8000") if is_named else ()))
    page = await open_page("about:blank", state=None, allow=("frame-ancestors",))
    outer = f'<!doctype html><iframe src="{page_url(server)}" width="900" height="600"></iframe>'
    await page.route("http://127.0.0.1:8000/", lambda route: route.fulfill(body=outer, content_type="text/html"))
    await page.goto("http://127.0.0.1:8000/")
    connected = page.frames[1].locator(".connection-state", has_text="Connected")
    if is_named:
        await expect(connected).to_be_visible()
    else:
        assert await connected.count() == 0


# The token

NOTE_ANSWERS = """() => {
    window.answers = [];
    const answer = document.getElementById("token-answer");
    new MutationObserver(() => answer.checkVisibility() && answers.push(answer.textContent))
        .observe(answer, { characterData: true, childList: true, subtree: true });
}"""
"""Notes what the page says of a token: the first of it is seen for half a second, in which a look may not come."""


async def test_page_asks_for_the_token_and_keeps_it_for_this_tab_alone(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--start", "sync", env={"ROSBRIDGE_SIM_TOKEN": TOKEN})
    page = await open_page(server, state="token")
    await expect(page.get_by_label("Token", exact=True).locator("input")).to_be_focused()
    await page.evaluate(NOTE_ANSWERS)
    await page.keyboard.type("wrong")
    await page.keyboard.press("Enter")
    await expect(page.get_by_text("The token is wrong.")).to_be_visible()
    assert await page.evaluate("answers") == ["The server checks the token …", "The token is wrong."]
    await page.keyboard.type(TOKEN)  # the wrong one is selected
    await page.keyboard.press("Enter")
    await expect(page.locator(".connection-state")).to_have_text("Connected")
    await expect(page.locator(".token-form")).to_be_hidden()
    assert TOKEN not in page.url
    assert await page.evaluate("localStorage.length") == 0
    assert await page.evaluate("document.cookie") == ""
    assert TOKEN not in await page.content()
    await page.reload()
    await expect(page.locator(".connection-state")).to_have_text("Connected")
    other = await page.context.new_page()
    await other.goto(page_url(server))
    await expect(other.locator(".token-form")).to_be_visible()
    assert TOKEN not in server.log


async def test_token_that_is_no_longer_right_is_asked_for_again(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--start", "sync", env={"ROSBRIDGE_SIM_TOKEN": TOKEN}), state="token")
    await page.evaluate("sessionStorage.setItem('rosbridge-sim token', 'an older one')")
    await page.reload()
    await expect(page.get_by_text("The token is wrong.")).to_be_visible()
    assert await page.evaluate("sessionStorage.length") == 0


# The connection

LOST = ("WebSocket connection to", "ERR_CONNECTION_REFUSED")


async def test_killed_server_is_noticed_and_survived(tmp_path: Path, open_page: OpenPage, kept_port: int) -> None:
    server = ServerProcess(tmp_path / "first.txt", port=kept_port)
    try:
        page = await open_page(server, allow=LOST)
        banner = page.locator(".banner")
        assert await banner.get_attribute("aria-live") == "polite"
        await expect(banner).to_be_hidden()
        server.kill()
        await expect(banner).to_contain_text("The connection is lost")
        await expect(banner).to_contain_text(re.compile(r"The map shows the state of [1-9]\d* s ago\.$"))
        await expect(page.locator(".connection-state")).to_be_hidden()  # one place tells it
        await expect(page.locator(".timeline .slider-row output")).to_have_text("last state")
        second = ServerProcess(tmp_path / "second.txt", port=kept_port)
        try:
            await expect(banner).to_contain_text("Connected again")
            await expect(page.locator(".connection-state")).to_have_text("Connected")
            await expect(banner).to_be_hidden()
        finally:
            second.stop_cleanly()
    finally:
        server.kill()


async def test_server_that_no_longer_answers_is_told_and_its_answer_ends_that(
    serve: Serve, open_page: OpenPage
) -> None:
    server = serve("--start", "sync")
    page = await open_page(server)
    banner = page.get_by_text("does not answer")
    os.kill(server.pid, signal.SIGSTOP)
    try:
        await expect(banner).to_be_visible(timeout=PATIENCE * 1e3)
        await expect(page.locator(".connection-state")).to_be_hidden()
        await expect(page.locator(".header-time")).to_have_text("")
    finally:
        os.kill(server.pid, signal.SIGCONT)
    await expect(banner).to_be_hidden()
    await expect(page.locator(".connection-state")).to_have_text("Connected")


# Tabs, widths, colours and assistive technology


async def test_tabs_follow_the_keys_of_their_pattern(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--start", "sync"))
    ego = page.get_by_role("tab", name="Ego")
    await ego.focus()
    for key, name in (
        ("ArrowRight", "Time"),
        ("End", "Code"),
        ("ArrowRight", "Ego"),
        ("ArrowLeft", "Code"),
        ("Home", "Ego"),
    ):
        await page.keyboard.press(key)
        tab = page.get_by_role("tab", name=name)
        await expect(tab).to_be_focused()
        await expect(tab).to_have_attribute("aria-selected", "true")
        await expect(page.get_by_role("tabpanel", name=name)).to_be_visible()
        assert await page.get_by_role("tabpanel").count() == 1


@pytest.mark.parametrize(("width", "height", "num_lines"), [(1280, 720, 1), (720, 450, 1), (390, 844, 2)])
async def test_map_has_its_share_of_small_windows_on_all_tabs_until_the_server_stops(
    serve: Serve, open_page: OpenPage, width: int, height: int, num_lines: int
) -> None:
    server = serve()
    page = await open_page(server, allow=LOST, viewport={"width": width, "height": height})
    await page.get_by_role("button", name="Let it drive").click()
    await expect(page.locator(".timeline")).to_be_visible()
    await expect(page.locator(".header-activity")).to_have_text("Ego: drives")  # "waits for a command" is a line more
    sizes = [await page.evaluate(MAP_SIZE)]
    for tab in ("Time", "Objects", "Graph", "Log", "Code"):
        await page.get_by_role("tab", name=tab).click()
        sizes.append(await page.evaluate(MAP_SIZE))
    assert len({(one["width"], one["height"]) for one in sizes}) == 1, sizes
    assert sizes[0]["height"] >= 0.4 * height
    assert sizes[0]["width"] >= 0.5 * width
    assert sizes[0]["header"] <= 10 + 27 * num_lines
    shown = await page.locator(".header-values, .header-panel").locator("> :visible").all_inner_texts()
    assert shown[1].startswith("Running, ")
    assert shown[-1] == "한국어"
    server.stop()
    await expect(page.locator(".banner")).to_contain_text("The connection is lost")


async def test_first_key_leads_past_the_map(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--start", "sync"))
    await page.keyboard.press("Tab")
    link = page.get_by_role("link", name="Skip to the controls")
    await expect(link).to_be_focused()
    await expect(link).to_be_in_viewport()
    await page.keyboard.press("Enter")
    await expect(page.locator("#controls")).to_be_focused()


@pytest.mark.parametrize(("scheme", "width"), LOOKS)
async def test_page_has_no_serious_fault_of_accessibility(
    server: ServerProcess, open_page: OpenPage, scheme: str, width: int
) -> None:
    page = await open_page(server, color_scheme=scheme, viewport={"width": width, "height": 720})
    assert await faults_of(page) == []
    assert await page.evaluate("document.documentElement.scrollWidth") <= width


async def test_question_for_the_token_has_no_serious_fault_of_accessibility(serve: Serve, open_page: OpenPage) -> None:
    page = await open_page(serve("--start", "sync", env={"ROSBRIDGE_SIM_TOKEN": TOKEN}), state="token")
    assert await faults_of(page) == []


async def faults_of(page: Page) -> list[str]:
    """Serious faults that axe finds: its rule, and the elements."""
    path = ROOT / "tests" / "page" / "node_modules" / "axe-core" / "axe.min.js"
    if not path.is_file():
        miss("needs axe-core: npm ci --prefix tests/page (./scripts/test does it)")
    if not await page.evaluate("'axe' in window"):
        await page.evaluate(path.read_text("utf-8"))
    found: dict[str, Any] = await page.evaluate("axe.run({resultTypes: ['violations']})")
    return [
        f"{fault['id']}: {[node['html'][:200] for node in fault['nodes']]}"
        for fault in found["violations"]
        if fault["impact"] in {"serious", "critical"}
    ]
