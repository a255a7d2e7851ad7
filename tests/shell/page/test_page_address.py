"""The address of the page, and the browser that opens it."""

from __future__ import annotations

import sys
import threading
import webbrowser
from collections.abc import Iterator
from ipaddress import ip_address
from urllib.parse import urlsplit

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.shell.page.page_address import has_desktop, open_browser, page_urls
from tests.support import PATIENCE


@pytest.mark.parametrize(
    ("host", "url"),
    [
        ("127.0.0.1", "http://127.0.0.1:9090/"),
        ("localhost", "http://localhost:9090/"),
        ("sim.lab.example", "http://sim.lab.example:9090/"),
        ("::1", "http://[::1]:9090/"),
    ],
)
def test_page_is_where_the_server_listens(host: str, url: str) -> None:
    assert page_urls(host, 9090, is_tls=False) == (url,)
    assert page_urls(host, 9090, is_tls=True) == (url.replace("http:", "https:"),)


@pytest.mark.parametrize(("host", "here"), [("0.0.0.0", "127.0.0.1"), ("::", "::1")])  # noqa: S104 - what is tested
def test_address_that_is_every_address_is_replaced_by_usable_ones(host: str, here: str) -> None:
    urls = [urlsplit(url) for url in page_urls(host, 9090, is_tls=False)]
    assert urls[0].hostname == here
    for url in urls[1:]:  # a machine without a network has none
        assert not ip_address(str(url.hostname)).is_unspecified
        assert not ip_address(str(url.hostname)).is_loopback


def test_desktop_is_known_by_its_display() -> None:
    assert has_desktop("darwin", {})
    assert has_desktop("win32", {})
    assert has_desktop("linux", {"DISPLAY": ":0"})
    assert has_desktop("linux", {"WAYLAND_DISPLAY": "wayland-0"})
    assert not has_desktop("linux", {"TERM": "xterm", "DISPLAY": ""})


class Browser(webbrowser.BaseBrowser):
    """A browser that notes what it is to open, and is slow."""

    def __init__(self) -> None:
        super().__init__("noting")
        self.urls: list[str] = []
        self.may_end = threading.Event()
        self.is_called = threading.Event()
        self.succeeds = True

    def open(self, url: str, new: int = 0, autoraise: bool = True) -> bool:  # noqa: ARG002, FBT001, FBT002 - the base's
        self.urls.append(url)
        self.is_called.set()
        return self.may_end.wait(PATIENCE) and self.succeeds


@pytest.fixture
def browser(monkeypatch: pytest.MonkeyPatch) -> Iterator[Browser]:
    browser = Browser()
    monkeypatch.setattr(webbrowser, "_browsers", {"noting": [None, browser]})
    monkeypatch.setattr(webbrowser, "_tryorder", ["noting"])
    monkeypatch.setenv("DISPLAY", ":0")
    yield browser
    browser.may_end.set()


async def test_browser_is_opened_and_not_waited_for(browser: Browser) -> None:
    async with Simulator(port=0, open=True) as sim:
        assert browser.is_called.wait(PATIENCE)
        assert browser.urls == [sim.page_url] == [f"http://127.0.0.1:{sim.port}/"]


def join_browser() -> None:
    for thread in threading.enumerate():
        if thread.name == "browser":
            thread.join(PATIENCE)


def test_want_of_a_browser_is_one_warning(browser: Browser, caplog: pytest.LogCaptureFixture) -> None:
    browser.succeeds = False
    browser.may_end.set()
    open_browser("http://127.0.0.1:9090/")
    join_browser()
    (record,) = caplog.records
    assert record.getMessage() == "--open: no browser could be started; open http://127.0.0.1:9090/ yourself"


@pytest.mark.skipif(sys.platform in {"win32", "darwin"}, reason="there is always a desktop")
def test_want_of_a_desktop_is_one_warning(
    browser: Browser, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    open_browser("http://127.0.0.1:9090/")
    assert not browser.urls
    assert "there is no desktop here" in caplog.text
