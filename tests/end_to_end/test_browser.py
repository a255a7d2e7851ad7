"""roslib 1.4 in Chromium: a page, served by the test, that shows what it hears."""

from __future__ import annotations

import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlencode, urlsplit

import pytest
from playwright.async_api import Error as PlaywrightError
from playwright.async_api import Page, async_playwright

from tests.conftest import Serve, Simulate
from tests.support import PATIENCE, ROOT, require_node_modules, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

FLAGS = (
    "--no-sandbox",  # it has none for root, and the page is ours
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # it speaks to nobody but us
)


@pytest.fixture
def site() -> Iterator[str]:
    """Where the page is."""
    files = {
        "/": ("text/html", ROOT / "tests" / "end_to_end" / "clients" / "page.html"),
        "/roslib.min.js": ("text/javascript", require_node_modules() / "roslib1" / "build" / "roslib.min.js"),
    }

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            kind, file = files.get(urlsplit(self.path).path, ("", None))
            if file is None:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.end_headers()
            self.wfile.write(file.read_bytes())

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        serving = threading.Thread(target=server.serve_forever, args=(0.01,))
        serving.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        serving.join()


@asynccontextmanager
async def page_at(url: str, folder: Path) -> AsyncIterator[Page]:
    """A page in a browser; if something fails, with its text, its console and a picture of it."""
    said: list[str] = []
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=require_tool("chromium"), args=FLAGS)
        page = await browser.new_page()
        page.set_default_timeout(PATIENCE * 1e3)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        try:
            await page.goto(url)
            yield page
        except (AssertionError, PlaywrightError) as error:
            picture = folder / "page.png"
            await page.screenshot(path=picture)
            text = await page.inner_text("body")
            raise AssertionError(
                f"{error}\nThe page is in {picture} and reads\n{text}\n\nIts console: {said}"
            ) from error
        finally:
            await browser.close()


async def until(page: Page, test: str) -> None:
    """Come back once a test in the page's own words is true, where `at(id)` is the text of an element."""
    at = "(id) => document.getElementById(id).textContent"
    await page.wait_for_function(f"((at) => {test})({at})")


async def test_a_page_drives_the_car_and_shows_it(simulate: Simulate, site: str, tmp_path: Path) -> None:
    async with page_at(site + "?" + urlencode({"url": simulate().url}), tmp_path) as page:
        await until(page, "at('connection') === 'open'")
        await until(page, "at('others') > 0 && at('clock') > 0")
        await page.click("#drive")
        await until(page, "at('driven') > 2")
        await page.click("#ask")
        await until(page, "at('answer') === 'rosgraph_msgs/Clock'")


async def test_a_page_of_strangers_is_shown_the_door(serve: Serve, site: str, tmp_path: Path) -> None:
    url = serve("--allow-origin", "https://example.org").url
    async with page_at(site + "?" + urlencode({"url": url}), tmp_path) as page:
        await until(page, "at('connection') === 'refused'")
        await until(page, "at('driven') === '0'")
