"""The page's connection by itself, in a browser and with a real server: its modules are loaded one by one."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Page

from tests.conftest import Connect
from tests.page.conftest import OpenPage, page_url
from tests.support import PATIENCE, ROOT, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

LOST = ("WebSocket connection to", "ERR_CONNECTION_REFUSED")

START = """async () => {
    const { Connection, socketUrl } = await import("/js/wire/connection.js");
    window.connection = new Connection(socketUrl(location));
    window.states = [];
    connection.onState((state) => states.push(state));
    connection.start();
}"""

ARRAY = "std_msgs/Float64MultiArray"


async def load(open_page: OpenPage, server: ServerProcess) -> Page:
    """Load an empty page of a server's origin, with the connection as the global `connection`."""
    page = await open_page("about:blank", state=None, allow=LOST)
    url = page_url(server)
    await page.route(f"{url}empty", lambda route: route.fulfill(body="<!doctype html>", content_type="text/html"))
    await page.route(
        f"{url}js/**",
        lambda route: route.fulfill(path=ROOT / "rosbridge_sim" / "page" / route.request.url.removeprefix(url)),
    )
    await page.goto(f"{url}empty")
    await run(page, START)
    await wait(page, "connection.state === 'open'")
    return page


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def page(server: ServerProcess, open_shared_page: OpenPage) -> Page:
    """One page for the tests that leave its connection open and take topics of their own."""
    return await load(open_shared_page, server)


async def run(page: Page, script: str) -> Any:  # noqa: ANN401 - whatever the script returns
    """Run a script in the page; a promise that nobody keeps fails the test."""
    async with asyncio.timeout(PATIENCE):
        return await page.evaluate(script)


async def wait(page: Page, condition: str) -> None:
    await page.wait_for_function(condition)


async def subscribe(page: Page, topic: str, options: str = "{}", kind: str = "") -> None:
    """Collect the messages of a topic in `taken[topic]`, with `takers[topic]` to end it."""
    await run(
        page,
        f"""() => {{
            window.taken ??= {{}}; window.takers ??= {{}};
            const list = taken["{topic}"] = [];
            takers["{topic}"] = connection.subscribe("{topic}", "{kind}", (message) => list.push(message), {options});
        }}""",
    )


async def names_of(page: Page, service: str, topic: str) -> Any:  # noqa: ANN401 - a list of names
    values = await run(page, f"connection.call('{service}', {{topic: '{topic}'}})")
    return next(iter(values.values()))


async def test_messages_come_as_json_or_with_typed_arrays(page: Page) -> None:
    await subscribe(page, "/a", "{encoding: 'cbor'}", ARRAY)
    await subscribe(page, "/b", "{}", ARRAY)
    for topic in ("/a", "/b"):
        assert await run(page, f"connection.publish('{topic}', '{ARRAY}', {{data: [1.5, -2]}})")
        await wait(page, f"taken['{topic}'].length === 1")
    assert await run(page, "taken['/a'][0].data instanceof Float64Array && taken['/a'][0].data[1] === -2")
    assert await run(page, "Array.isArray(taken['/b'][0].data) && taken['/b'][0].data[1] === -2")


async def test_takers_of_a_topic_share_one_subscription_and_the_last_message(
    server: ServerProcess, page: Page, connect: Connect
) -> None:
    client = await connect(server.url)
    await client.send("advertise", topic="/c", type="std_msgs/String")
    await subscribe(page, "/c", kind="std_msgs/String")
    await run(page, "connection.call('/rosapi/get_time')")  # the subscription is there then
    await client.send("publish", topic="/c", msg={"data": "x"})
    await wait(page, "taken['/c'].length === 1")
    assert await run(
        page,
        """async () => {
            const order = [];
            const second = connection.subscribe("/c", "", (message) => order.push(message.data));
            order.push("subscribed");
            await Promise.resolve();
            second.close();
            second.close();
            return order;
        }""",
    ) == ["subscribed", "x"]
    assert len(await names_of(page, "/rosapi/subscribers", "/c")) == 1
    await run(page, "takers['/c'].close()")
    assert await names_of(page, "/rosapi/subscribers", "/c") == []


async def test_slow_taker_beside_a_fast_one_gets_the_last_message(page: Page) -> None:
    await subscribe(page, "/d", kind="std_msgs/Int32")
    slow, fast = await run(
        page,
        """async () => {
            const slow = [];
            connection.subscribe("/d", "", (message) => slow.push(message.data), {throttleMs: 300});
            for (let data = 1; data <= 5; data++) {
                connection.publish("/d", "std_msgs/Int32", {data});
            }
            while (slow.at(-1) !== 5) {
                await new Promise((resolve) => setTimeout(resolve, 10));
            }
            return [slow, taken["/d"].map((message) => message.data)];
        }""",
    )
    assert fast == [1, 2, 3, 4, 5]
    assert (slow[0], slow[-1]) == (1, 5)
    assert len(slow) < 5, "all would need a machine on which each message takes longer than the throttle"


async def test_mistake_of_one_taker_takes_nothing_from_the_others(page: Page) -> None:
    assert await run(
        page,
        """async () => {
            const errors = [];
            window.addEventListener("error", (event) => { errors.push(event.message); event.preventDefault(); },
                {once: true});
            connection.subscribe("/e", "std_msgs/Int32", () => { throw new Error("a mistake"); });
            const good = await new Promise((resolve) => {
                connection.subscribe("/e", "std_msgs/Int32", resolve);
                connection.publish("/e", "std_msgs/Int32", {data: 3});
            });
            return [good.data, errors];
        }""",
    ) == [3, ["Uncaught Error: a mistake"]]


async def test_call_fails_with_the_text_of_the_server(page: Page) -> None:
    ask = "(name) => connection.call(name).catch((error) => [error.name, error.message])"
    name, text = await run(page, f"({ask})('/nothing')")
    assert name == "CallError"
    assert "/nothing" in text
    await run(page, "connection.stop()")
    name, text = await run(page, f"({ask})('/rosapi/get_time')")
    assert (name, text) == ("CallError", "The page is not connected to the server.")
    assert await run(page, "connection.publish('/x', 'std_msgs/Int32', {data: 1})") is False
    await run(page, "connection.start()")
    await wait(page, "connection.state === 'open'")


async def test_statuses_of_the_server_are_told(page: Page) -> None:
    status = await run(
        page,
        """() => new Promise((resolve) => {
            connection.onStatus(resolve);
            connection.publish("/f", "std_msgs/Int32", {data: "no number"});
        })""",
    )
    assert status["level"] == "error"
    assert "std_msgs/Int32" in status["msg"]


async def test_lost_server_fails_calls_and_comes_back_with_subscriptions_and_advertisements(
    tmp_path: Path, open_page: OpenPage, connect: Connect, kept_port: int
) -> None:
    first = ServerProcess(tmp_path / "first.txt", ["--start", "sync"], port=kept_port)
    try:
        client = await connect(first.url)
        await client.send("advertise_service", service="/slow", type="std_srvs/Trigger")
        await client.settle()
        page = await load(open_page, first)
        await subscribe(page, "/g", kind="std_msgs/Int32")
        await run(page, "connection.publish('/g', 'std_msgs/Int32', {data: 1})")
        await wait(page, "taken['/g'].length === 1")
        await run(
            page,
            """() => {
                connection.publish("/call", "std_msgs/Int32", {data: 1});
                window.answered = connection.call("/rosapi/get_time", {}, {timeoutMs: 0}).then(() => "answered",
                    (error) => error.message);
                window.failed = connection.call("/slow").catch((error) => error.message);
            }""",
        )
        assert await run(page, "answered") == "answered"
        await client.take("call_service", service="/slow")
        first.kill()
        await wait(page, "connection.state === 'lost'")
        assert await run(page, "failed") == "The connection was lost before the answer came."
        second = ServerProcess(tmp_path / "second.txt", ["--start", "sync"], port=kept_port)
        try:
            await wait(page, "connection.state === 'open'")
            assert len(await names_of(page, "/rosapi/subscribers", "/g")) == 1
            await run(page, "connection.publish('/g', 'std_msgs/Int32', {data: 2})")
            await wait(page, "taken['/g'].length === 2")
            assert len(await names_of(page, "/rosapi/publishers", "/g")) == 1
            states = await run(page, "states.join(' ')")
            assert states.startswith("connecting open lost connecting")
            assert states.endswith("connecting open")
        finally:
            await page.close()
            second.stop_cleanly()
    finally:
        first.kill()


async def test_hidden_page_has_no_subscriptions(server: ServerProcess, page: Page, connect: Connect) -> None:
    await subscribe(page, "/h", kind="std_msgs/Int32")
    assert len(await names_of(page, "/rosapi/subscribers", "/h")) == 1
    await run(page, "connection.setHidden(true)")
    await subscribe(page, "/i", kind="std_msgs/Int32")
    assert await names_of(page, "/rosapi/subscribers", "/h") == []
    assert await names_of(page, "/rosapi/subscribers", "/i") == []
    await run(page, "connection.setHidden(false)")
    assert len(await names_of(page, "/rosapi/subscribers", "/h")) == 1
    assert len(await names_of(page, "/rosapi/subscribers", "/i")) == 1
    client = await connect(server.url)
    await client.send("advertise", topic="/h", type="std_msgs/Int32")
    await client.send("publish", topic="/h", msg={"data": 4})
    await wait(page, "taken['/h'].length === 1")


async def test_advertisement_ends_on_request(page: Page) -> None:
    await run(page, "connection.publish('/j', 'std_msgs/Int32', {data: 1})")
    assert len(await names_of(page, "/rosapi/publishers", "/j")) == 1
    await run(page, "connection.unadvertise('/j'); connection.unadvertise('/j')")
    assert await names_of(page, "/rosapi/publishers", "/j") == []
