"""The web page in Chromium: a test fails where the page logs an error or its security policy is broken."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import AsyncIterator, Generator, Iterator, Sequence
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

import pytest
import pytest_asyncio
from playwright.async_api import Browser, ConsoleMessage, Page, Playwright, async_playwright, expect
from playwright.async_api import TimeoutError as PlaywrightTimeoutError

from rosbridge_sim.shell.page.page_address import page_urls
from tests.conftest import Connect
from tests.support import PATIENCE, Client, ServerProcess, require_chromium

expect.set_options(timeout=PATIENCE * 1e3)  # its own 5 s are too few for a flood on a busy machine

FLAGS = (
    "--no-sandbox",  # it has none for root, and the page is ours
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-features=LocalNetworkAccessChecks,LocalNetworkAccessChecksWebSockets",  # for pages that a test makes up
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, "  # it speaks to nobody but us
    + ", ".join(f"EXCLUDE {urlsplit(url).hostname}" for url in page_urls("0.0.0.0", 0, is_tls=False)),  # noqa: S104
)

WEBGL_FLAGS = (  # WebGL without a graphics card
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",  # it would draw all else of the page, too, at a tenfold price
)
PLAIN_FLAGS = ("--disable-gpu",)

TRIES = 3
"""Chromiums that are started for one: on a busy machine some accept the connection and never answer."""

WITHOUT_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind === "webgl2" ? null : getContext.call(this, kind, ...rest);
};
"""
"""A browser without WebGL 2. The software renderer needs all processors of a small machine for one moving picture."""

SLOW_SCREEN = """
const request = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (take) => setTimeout(() => request(take), 150);
"""
"""A screen with six pictures a second: each of the map takes the software renderer 30 ms of a processor, and nobody
looks at those of the rest."""


class OpenPage(Protocol):
    """Opens a page in a new browser context."""

    async def __call__(
        self,
        server: ServerProcess | str,
        *,
        path: str = "",
        allow: tuple[str, ...] = (),
        state: str | None = "open",
        has_webgl: bool = False,
        **options: Any,  # noqa: ANN401 - those of Playwright's new_context
    ) -> Page:
        """Open the page of a server.

        Args:
            server: the server, or the URL of the page.
            path: added to the URL.
            allow: parts of console errors that are no mistake, such as those of a lost connection.
            state: the state of the connection to wait for; None waits for the load only.
            has_webgl: let the page draw the map; only for tests of the map, because it takes long.
            options: of the browser context, such as `color_scheme` and `viewport`.
        """


class Chromiums:
    """One Chromium with WebGL and one without it, each started when it is first wanted: that takes as long as a test.

    Pages of a test have contexts of their own.
    """

    def __init__(self, playwright: Playwright, folder: Path, processes: ExitStack) -> None:
        self._playwright = playwright
        self._folder = folder
        self._processes = processes
        self._num_started = 0
        self._kept: dict[bool, Browser] = {}

    async def get(self, *, has_webgl: bool) -> Browser:
        """The one with WebGL, or the one without it."""
        tries = TRIES
        while has_webgl not in self._kept:
            tries -= 1
            try:
                self._kept[has_webgl] = await self._start(WEBGL_FLAGS if has_webgl else PLAIN_FLAGS)
            except PlaywrightTimeoutError:
                if not tries:
                    raise
        return self._kept[has_webgl]

    async def _start(self, flags: Sequence[str]) -> Browser:
        # In the profile of another one it would leave to that one, and end.
        profile = self._folder / str(self._num_started)
        self._num_started += 1
        profile.mkdir()
        url = self._processes.enter_context(_chromium(profile, flags))
        return await self._playwright.chromium.connect_over_cdp(url, timeout=PATIENCE / TRIES * 1e3)


@contextmanager
def _chromium(profile: Path, flags: Sequence[str]) -> Iterator[str]:
    """A running Chromium; the URL of its debugger."""
    log = profile / "stderr.txt"
    with log.open("wb") as stderr, subprocess.Popen(
        [
            require_chromium(),
            "--headless",
            "--remote-debugging-port=0",
            f"--user-data-dir={profile}",
            *FLAGS,
            *flags,
        ],
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        start_new_session=True,
    ) as process:  # fmt: skip
        found = None
        until = time.monotonic() + PATIENCE
        while found is None and process.poll() is None and time.monotonic() < until:
            found = re.search(r"DevTools listening on (ws://\S+)\n", log.read_text(errors="replace"))
            time.sleep(0.02)
        if found is None:
            os.killpg(process.pid, signal.SIGKILL)  # or the next test would find it in its profile
        assert found is not None, f"Chromium does not start: {log.read_text(errors='replace')[-1_000:]}"
        try:
            yield found[1]
        finally:
            os.killpg(process.pid, signal.SIGTERM)  # Debian's command is a script, and Chromium its child


HAS_FAILED = pytest.StashKey[bool]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Note at a test whether it has failed."""
    report = yield
    item.stash[HAS_FAILED] = item.stash.get(HAS_FAILED, False) or report.failed
    return report


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the tests of the page in one event loop: Playwright belongs to a loop, and its start takes half a second."""
    for item in items:
        if item.path.parent == Path(__file__).parent and pytest_asyncio.is_async_test(item):
            item.add_marker(pytest.mark.asyncio(loop_scope="session"), append=False)


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def chromiums(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Chromiums]:
    """The browsers of all tests of this process."""
    with ExitStack() as processes:
        async with async_playwright() as playwright:
            yield Chromiums(playwright, tmp_path_factory.mktemp("chromiums"), processes)


@pytest_asyncio.fixture(loop_scope="session")
async def connect() -> AsyncIterator[Connect]:
    """Connects bare clients, in the event loop of the page's tests."""
    async with AsyncExitStack() as stack:

        async def open_client(url: str, *, is_recording: bool = False) -> Client:
            return await stack.enter_async_context(await Client.open(url, is_recording=is_recording))

        yield open_client


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """One server for all tests of the page that leave it as they found it. Its world stands still."""
    process = ServerProcess(tmp_path_factory.mktemp("server") / "log.txt", ["--start", "sync"])
    yield process
    process.stop_cleanly()


@pytest_asyncio.fixture(loop_scope="session")
async def open_page(chromiums: Chromiums, tmp_path: Path, request: pytest.FixtureRequest) -> AsyncIterator[OpenPage]:
    """Opens pages; at the end, no page may have logged an error. A failed test has pictures of them in its folder."""
    async with _pages(chromiums, tmp_path, request.node) as start:
        yield start


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def open_shared_page(
    chromiums: Chromiums, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> AsyncIterator[OpenPage]:
    """The same for pages of several tests of a file: to load one takes longer than most tests."""
    async with _pages(chromiums, tmp_path_factory.mktemp("pages"), request.node) as start:
        yield start


@asynccontextmanager
async def _pages(chromiums: Chromiums, folder: Path, node: pytest.Item | pytest.Module) -> AsyncIterator[OpenPage]:
    mistakes: list[str] = []
    pages: list[Page] = []

    async with AsyncExitStack() as contexts:

        async def start(
            server: ServerProcess | str,
            *,
            path: str = "",
            allow: tuple[str, ...] = (),
            state: str | None = "open",
            has_webgl: bool = False,
            **options: Any,  # noqa: ANN401 - see `OpenPage`
        ) -> Page:
            browser = await chromiums.get(has_webgl=has_webgl)
            sizes: dict[str, Any] = {
                "viewport": {"width": 1280, "height": 720},
                "device_scale_factor": 0.5 if has_webgl else 1.0,
            }
            context = await browser.new_context(**(sizes | options))
            contexts.push_async_callback(context.close)
            page = await context.new_page()
            page.set_default_timeout(PATIENCE * 1e3)
            await page.add_init_script(SLOW_SCREEN + ("" if has_webgl else WITHOUT_WEBGL))

            def note(text: str) -> None:
                if not any(part in text for part in allow):
                    mistakes.append(text)

            def hear(message: ConsoleMessage) -> None:
                if message.type in {"error", "warning"} and "GPU stall" not in message.text:  # the software renderer's
                    note(f"{message.type}: {message.text}")

            page.on("console", hear)
            page.on("pageerror", lambda error: note(f"exception: {error.stack or error}"))
            await page.goto((server if isinstance(server, str) else page_url(server)) + path)
            pages.append(page)
            if state is not None:
                await page.wait_for_selector(f":root[data-connection={state}]", state="attached")
            return page

        yield start
        has_failed = bool(mistakes) or node.stash.get(HAS_FAILED, False)
        for number, page in enumerate(pages):
            if has_failed and not page.is_closed():
                await page.screenshot(path=folder / f"page{number}.png")
        assert not mistakes, f"the page of {node.name} logged:\n" + "\n".join(mistakes)


def page_url(server: ServerProcess) -> str:
    """The URL of a server's page."""
    return f"http://127.0.0.1:{server.port}/"
