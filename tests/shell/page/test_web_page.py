"""The web page over HTTP: files with their headers, and the answer to programs that want no HTML."""

from __future__ import annotations

import asyncio
import gzip
import io
import json
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

import pytest

from rosbridge_sim import Simulator, __version__
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.serving import _run
from rosbridge_sim.shell.page import web_page
from rosbridge_sim.shell.page.module_joining import JoinError
from rosbridge_sim.shell.page.web_page import PATHS, page_source
from tests.support import PATIENCE

TOKEN = "s3cret"  # noqa: S105 - of these tests

BROWSER = "Accept: text/html,application/xhtml+xml,*/*;q=0.8"


class Answer(NamedTuple):
    """An answer."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:  # noqa: ANN401 - whatever it has
        return json.loads(self.body)


async def get(sim: Simulator, path: str, *headers: str, method: str = "GET") -> Answer:
    async with asyncio.timeout(PATIENCE):
        reader, writer = await asyncio.open_connection("127.0.0.1", sim.port)
        writer.write("\r\n".join([f"{method} {path} HTTP/1.1", "Host: localhost", *headers, "", ""]).encode())
        head, _, body = (await reader.read()).partition(b"\r\n\r\n")
        writer.close()
        await writer.wait_closed()
    first, *lines = head.decode().split("\r\n")
    return Answer(int(first.split()[1]), dict(line.split(": ", 1) for line in lines), body)


@pytest.fixture(scope="module")
def sim() -> Iterator[Simulator]:
    """A server whose page is read alone."""
    with Simulator(port=0, start="sync") as sim:
        yield sim


@pytest.fixture
async def new_sim() -> AsyncIterator[Simulator]:
    """A server that nobody has asked yet."""
    async with Simulator(port=0, world=False) as sim:
        yield sim


source_of = cache(page_source)


@pytest.mark.parametrize("path", PATHS)
async def test_each_file_has_its_type_and_a_strict_policy(sim: Simulator, path: str) -> None:
    name, kind = PATHS[path]
    answer = await get(sim, path, BROWSER)
    assert (answer.status, answer.headers["Content-Type"], answer.body) == (200, kind, source_of(name))
    assert answer.headers["Content-Length"] == str(len(answer.body))
    policy = dict(part.strip().split(" ", 1) for part in answer.headers["Content-Security-Policy"].split(";"))
    assert policy == {
        "default-src": "'none'",
        "script-src": "'self'",
        "style-src": "'self'",
        "img-src": "'self' data: blob:",
        "connect-src": "'self'",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert answer.headers["Referrer-Policy"] == "no-referrer"


async def test_query_does_not_change_the_file(sim: Simulator) -> None:
    assert (await get(sim, "/?x=1", BROWSER)).body == (await get(sim, "/", BROWSER)).body


async def test_no_other_file_of_the_package_is_served(sim: Simulator) -> None:
    for path in ("/js/main.js", "/package.json", "/../version.py", "/colours.json", "/index.html", "//page.css"):
        assert (await get(sim, path, BROWSER)).status == 404, path


@pytest.mark.parametrize("encoding", ["gzip", "br, GZIP;q=0.5", "identity", "gzip;q=0", "gzip; q=0.000", ""])
async def test_file_is_compressed_for_those_who_take_it(sim: Simulator, encoding: str) -> None:
    answer = await get(sim, "/page.js", f"Accept-Encoding: {encoding}")
    is_compressed = encoding in {"gzip", "br, GZIP;q=0.5"}
    assert answer.headers.get("Content-Encoding") == ("gzip" if is_compressed else None)
    assert "Accept-Encoding" in answer.headers["Vary"]
    assert (gzip.decompress(answer.body) if is_compressed else answer.body) == source_of("js/main.js")


@pytest.mark.parametrize("encoding", ["gzip", "identity"])
async def test_browser_that_has_a_file_gets_only_that_word(sim: Simulator, encoding: str) -> None:
    headers = [f"Accept-Encoding: {encoding}"]
    etag = (await get(sim, "/page.css", *headers)).headers["ETag"]
    answer = await get(sim, "/page.css", f'If-None-Match: "x", W/{etag}', *headers)
    assert (answer.status, answer.body, answer.headers["ETag"]) == (304, b"", etag)
    assert "Content-Length" not in answer.headers
    assert "Content-Security-Policy" in answer.headers
    assert (await get(sim, "/page.css", 'If-None-Match: "x"', *headers)).status == 200
    assert (await get(sim, "/icon.svg", *headers)).headers["ETag"] != etag


async def test_compressed_file_has_another_etag(sim: Simulator) -> None:
    answers = [await get(sim, "/page.css", f"Accept-Encoding: {name}") for name in ("gzip", "identity")]
    assert answers[0].headers["ETag"] != answers[1].headers["ETag"]


@pytest.mark.parametrize("path", ["/page.css", "/"])
async def test_head_gets_the_headers_alone(sim: Simulator, path: str) -> None:
    for accept in (BROWSER, "Accept: */*"):
        whole, head = [await get(sim, path, accept, method=method) for method in ("GET", "HEAD")]
        assert (head.status, head.body) == (200, b"")
        assert head.headers | {"Date": ""} == whole.headers | {"Date": ""}


@pytest.mark.parametrize("path", ["/page.css", "/"])
async def test_other_methods_are_refused(sim: Simulator, path: str) -> None:
    for accept in (BROWSER, "Accept: */*"):
        answer = await get(sim, path, accept, method="POST")
        assert (answer.status, answer.headers["Allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize("accept", ["", "Accept: */*", "Accept: application/json", "Accept: text/html;q=0, */*"])
async def test_program_that_wants_no_html_gets_name_version_and_links(sim: Simulator, accept: str) -> None:
    answer = await get(sim, "/", *filter(None, [accept]))
    assert (answer.status, answer.headers["Content-Type"]) == (200, "application/json")
    assert "Accept" in answer.headers["Vary"]
    assert answer.json == {
        "name": "rosbridge-sim",
        "version": __version__,
        "protocol": "rosbridge v2.0",
        "links": {
            "socket": "./",
            "page": "./",
            "docs": "docs/",
            "types": "types/",
            "map": "map.json",
            "log": "log.json",
            "metrics": "metrics",
            "healthz": "healthz",
            "version": "version",
        },
    }
    for link in ("docs", "types", "map", "log", "metrics", "healthz", "version"):
        assert (await get(sim, f"/{answer.json['links'][link]}")).status == 200


async def test_files_need_no_token_and_the_version_does() -> None:
    async with Simulator(port=0, token=TOKEN) as sim:
        for path in PATHS:
            assert (await get(sim, path, BROWSER)).status == 200
        assert "version" not in (await get(sim, "/")).json
        assert (await get(sim, "/", f"Authorization: Bearer {TOKEN}")).json["version"] == __version__


async def test_without_the_page_everybody_gets_the_links() -> None:
    async with Simulator(port=0, page=False) as sim:
        assert not {"page", "docs"} & (await get(sim, "/", BROWSER)).json["links"].keys()
        for path in ("/page.js", "/docs/"):
            assert (await get(sim, path)).status == 404
        assert sim.page_url == ""


async def test_named_pages_may_show_it_in_a_frame() -> None:
    origins = ("https://*.school.example", "http://localhost:8000")
    async with Simulator(port=0, page_frame_ancestors=origins) as sim:
        policy = (await get(sim, "/", BROWSER)).headers["Content-Security-Policy"]
    assert policy.endswith("; frame-ancestors https://*.school.example http://localhost:8000")


@pytest.mark.parametrize(
    "origin", ["*", "'self'", "https://a.example;script-src *", "https://a/b", "a.example", "https://"]
)
def test_frame_ancestor_that_is_no_origin_is_refused(origin: str) -> None:
    with pytest.raises(DocumentError, match="expected origins of web pages, such as"):
        Simulator(page_frame_ancestors=origin)


async def test_failure_to_read_the_page_is_logged_and_tried_again(
    new_sim: Simulator, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise JoinError("js/main.js:1: no")

    with monkeypatch.context() as patch:
        patch.setattr(web_page, "page_files", fail)
        answer = await get(new_sim, "/page.js")
    assert (answer.status, new_sim.num_bugs) == (500, 1)
    assert "js/main.js:1: no" in caplog.text
    assert (await get(new_sim, "/page.js")).status == 200


async def test_failure_to_prepare_the_page_is_told_at_the_first_request(
    new_sim: Simulator, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise JoinError("js/main.js:1: no")

    with monkeypatch.context() as patch:
        patch.setattr(web_page, "page_files", fail)
        await new_sim.prepare_page()
        assert new_sim.num_bugs == 0
        assert (await get(new_sim, "/page.js")).status == 500
    assert (await get(new_sim, "/page.js")).status == 200
    assert "never retrieved" not in caplog.text


async def test_page_is_ready_when_the_server_says_that_it_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    web_page.page_files.cache_clear()
    num_made = []

    class Output(io.StringIO):
        def write(self, text: str) -> int:
            num_made.append(web_page.page_files.cache_info().currsize)
            serving.cancel()
            return super().write(text)

    output = Output()
    monkeypatch.setattr(sys, "stdout", output)
    serving = asyncio.ensure_future(_run(Simulator(port=0)))
    with suppress(asyncio.CancelledError):
        await serving
    assert output.getvalue().startswith("rosbridge-sim listening on ws://")
    assert num_made[0] == 1


async def test_open_needs_a_page() -> None:
    for options in ({"page": False}, {"listen": False, "attach": "ws://127.0.0.1:1"}):
        with pytest.raises(DocumentError, match="open: expected a server that listens and has its page"):
            await Simulator(port=0, open=True, **options).start()
