"""roslib 1.4 in Chromium: a page from several origins that drives the car.

Pages of websites are not served by anybody: the browser is given their text for any URL of a host that is not
127.0.0.1, so that they have an origin such as http://localhost:3000 without a port of this machine.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlencode, urlsplit

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Frame, Page, Route, async_playwright
from playwright.async_api import Error as PlaywrightError

from tests.conftest import Serve, Simulate
from tests.support import PATIENCE, ROOT, ServerProcess, require_chromium, require_node_modules

pytestmark = [pytest.mark.client, pytest.mark.slow, pytest.mark.asyncio(loop_scope="module")]

FLAGS = (
    "--no-sandbox",  # it has none for root, and the page is ours
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # It speaks to nobody but us. The name of one website points to us: that is DNS rebinding.
    "--host-resolver-rules=MAP rebound.example 127.0.0.1, MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
    # New browsers themselves keep websites away from this machine; this one leaves it to the server, as old ones do.
    "--disable-features=LocalNetworkAccessChecks,LocalNetworkAccessChecksWebSockets",
)

FRAME = "<iframe sandbox='allow-scripts' src='/?{query}'></iframe>"
"""A page around another one, whose origin is then `null`: any website can do this."""


def files() -> dict[str, tuple[str, Path]]:
    """The page's files: path -> kind and file."""
    return {
        "/": ("text/html", ROOT / "tests" / "end_to_end" / "clients" / "page.html"),
        "/roslib.min.js": ("text/javascript", require_node_modules() / "roslib1" / "build" / "roslib.min.js"),
    }


@pytest.fixture
def site() -> Iterator[str]:
    """Where the page is."""
    known = files()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            kind, file = known.get(urlsplit(self.path).path, ("", None))
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


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    """One for all tests of this file: its start takes longer than a page."""
    async with open_browser() as browser:
        yield browser


@asynccontextmanager
async def open_browser() -> AsyncIterator[Browser]:
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=require_chromium(), args=FLAGS)
        try:
            yield browser
        finally:
            await browser.close()


@asynccontextmanager
async def page_at(url: str, folder: Path, browser: Browser) -> AsyncIterator[Page]:
    """A page in a browser, with nothing of others; if something fails, with its text, its console and a picture."""
    said: list[str] = []
    context = await browser.new_context()
    page = await context.new_page()
    page.set_default_timeout(PATIENCE * 1e3)
    await page.route(is_website, show_website)
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    try:
        await page.goto(url)
        yield page
    except (AssertionError, PlaywrightError) as error:
        picture = folder / "page.png"
        await page.screenshot(path=picture)
        text = await page.inner_text("body")
        raise AssertionError(f"{error}\nThe page is in {picture} and reads\n{text}\n\nIts console: {said}") from error
    finally:
        await context.close()


DATA = ("/map.json", "/log.json", "/metrics", "/version")
"""Paths of our server with data."""


def is_website(url: str) -> bool:
    """Whether the page's text comes from the test and not from a server."""
    parts = urlsplit(url)
    return parts.scheme == "http" and parts.hostname != "127.0.0.1" and parts.path not in {*DATA, "/healthz"}


async def show_website(route: Route) -> None:
    parts = urlsplit(route.request.url)
    if parts.path == "/frame":
        await route.fulfill(body=FRAME.format(query=parts.query), content_type="text/html")
        return
    kind, file = files()[parts.path]
    await route.fulfill(path=file, content_type=f"{kind}; charset=utf-8")


async def until(page: Page | Frame, test: str) -> None:
    """Come back once a test in the page's own words is true, where `at(id)` is the text of an element."""
    at = "(id) => document.getElementById(id).textContent"
    await page.wait_for_function(f"((at) => {test})({at})")


async def test_web_page_drives_the_car_and_shows_its_state(
    simulate: Simulate, site: str, tmp_path: Path, browser: Browser
) -> None:
    async with page_at(site + "?" + urlencode({"url": simulate().url}), tmp_path, browser) as page:
        await until(page, "at('connection') === 'open'")
        await until(page, "at('others') > 0 && at('clock') > 0")
        await page.click("#drive")
        await until(page, "at('driven') > 2")
        await page.click("#ask")
        await until(page, "at('answer') === 'rosgraph_msgs/Clock'")


def at(origin: str, url: str, path: str = "/") -> str:
    """The URL of the page at an origin, which connects to another one."""
    return f"{origin}{path}?{urlencode({'url': url})}"


async def drive(page: Page) -> None:
    await until(page, "at('connection') === 'open'")
    await page.click("#drive")
    await until(page, "at('driven') > 2")


async def refuse(page: Page | Frame) -> None:
    await until(page, "at('connection') === 'refused'")
    await until(page, "at('driven') === '0'")


def warning_of(server: ServerProcess) -> str:
    """The one warning in a server's log."""
    (line,) = [line for line in server.log.splitlines() if "refused: " in line and "WARN" in line]
    return line


@pytest.mark.parametrize("listening", ["127.0.0.1", "0.0.0.0"])  # noqa: S104 - as in a container
async def test_page_of_localhost_drives_the_car(serve: Serve, tmp_path: Path, browser: Browser, listening: str) -> None:
    port = serve("--host", listening).port
    async with page_at(at("http://localhost:3000", f"ws://localhost:{port}"), tmp_path, browser) as page:
        await drive(page)
        await page.goto(at("http://localhost:3000", f"ws://127.0.0.1:{port}"))
        await until(page, "at('connection') === 'open'")


async def test_a_page_of_another_site_is_refused_until_the_flag_names_it(
    serve: Serve, tmp_path: Path, browser: Browser
) -> None:
    server = serve()
    page_of = partial(at, "http://website.example")
    async with page_at(page_of(server.url), tmp_path, browser) as page:
        await refuse(page)
        assert "--allow-origin http://website.example " in warning_of(server)
        await page.goto(page_of(serve("--allow-origin", "http://website.example").url))
        await drive(page)


async def test_website_with_dns_rebinding_is_refused(serve: Serve, tmp_path: Path, browser: Browser) -> None:
    server = serve()
    place = f"rebound.example:{server.port}"
    async with page_at(at(f"http://{place}", f"ws://{place}"), tmp_path, browser) as page:
        await refuse(page)
        assert "--allow-host rebound.example " in warning_of(server)
        place = f"rebound.example:{serve('--allow-host', 'rebound.example').port}"
        await page.goto(at(f"http://{place}", f"ws://{place}"))
        await drive(page)


async def test_website_with_dns_rebinding_reads_no_data_over_http(
    serve: Serve, tmp_path: Path, browser: Browser
) -> None:
    read = "async (path) => { const answer = await fetch(path); return [answer.status, await answer.text()]; }"
    place = f"http://rebound.example:{serve().port}"
    async with page_at(f"{place}/", tmp_path, browser) as page:
        for path in DATA:
            status, text = await page.evaluate(read, path)
            assert (status, "--allow-host rebound.example " in text) == (403, True), path
        assert await page.evaluate(read, "/healthz") == [200, '{"status": "ok"}\n']
        await page.goto(f"http://rebound.example:{serve('--allow-host', 'rebound.example').port}/")
        for path in DATA:
            assert (await page.evaluate(read, path))[0] == 200, path


async def test_page_opened_from_disk_needs_the_origin_flag(serve: Serve, tmp_path: Path, browser: Browser) -> None:
    for _, file in files().values():
        shutil.copy(file, tmp_path)
    page_of = partial(at, (tmp_path / "page.html").as_uri(), path="")
    server = serve()
    async with page_at(page_of(server.url), tmp_path, browser) as page:
        await refuse(page)
        assert "--allow-origin null" in warning_of(server)
        await page.goto(page_of(serve("--allow-origin", "null").url))
        await drive(page)


async def test_a_sandboxed_frame_of_a_website_is_refused(serve: Serve, tmp_path: Path, browser: Browser) -> None:
    server = serve()
    async with page_at(at("http://website.example", server.url, "/frame"), tmp_path, browser) as page:
        await refuse(page.frames[1])
    assert "Origin: null" in warning_of(server)


async def test_a_page_of_another_site_that_shows_the_token_drives_the_car(
    serve: Serve, tmp_path: Path, browser: Browser
) -> None:
    server = serve(env={"ROSBRIDGE_SIM_TOKEN": "sesame"})
    place = f"rebound.example:{server.port}"
    async with page_at(at(f"http://{place}", f"ws://{place}/"), tmp_path, browser) as page:
        await refuse(page)
        await page.goto(at(f"http://{place}", f"ws://{place}/?token=sesame"))
        await drive(page)
