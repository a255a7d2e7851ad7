"""The tabs "Graph" and "Log" of the page in a browser, with a real server and other clients."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Locator, Page, WebSocketRoute, expect

from tests.conftest import Connect, Serve
from tests.far_side.server import FarSide
from tests.page.conftest import OpenPage, page_url
from tests.page.test_page import LOOKS, faults_of
from tests.support import PATIENCE, Client, Frame, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

HTML = "<img src=x onerror=document.title='broken'>"
"""A text that would run a script if it became HTML."""

PNG = "iVBORw0KGgoAAAANSUhEUgAAAAMAAAACCAIAAAASFvFNAAAAEklEQVR4nGP8z8DAwMDAxAADAA4MAQPfZ0JUAAAAAElFTkSuQmCC"
"""A picture of 3 x 2 pixels, as base64."""

MAX_ROWS = 400
"""Rows that a tree has at most, see `MAX_TREE_ROWS` of tree_rows.js."""

MAX_LINES = 200
"""Lines that the log shows at most, see `SHOWN_LINES` of log.js."""


LASTING = """
const later = window.setTimeout;
window.setTimeout = (act, ms = 0, ...rest) => (ms >= 5000 ? 0 : later(act, ms, ...rest));
"""
"""A page that takes nothing away after some seconds, and waits longer for answers: a busy machine needs the time."""


async def open_graph(open_page: OpenPage, server: ServerProcess, **options: Any) -> Page:  # noqa: ANN401 - of open_page
    page = await open_page(server, **options)
    await page.get_by_role("tab", name="Graph").click()
    return page


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def graph(server: ServerProcess, open_shared_page: OpenPage) -> Page:
    """A page with this tab, for tests that choose topics of their own."""
    return await open_graph(open_shared_page, server)


async def choose_topic(page: Page, name: str) -> Locator:
    """Choose a topic in the table, and return its view."""
    await page.get_by_role("searchbox", name="Search topics").fill(name)
    await page.locator(".table-choice").filter(has=page.get_by_text(name, exact=True)).click()
    view = page.get_by_role("region", name="Chosen topic")
    await expect(view.get_by_role("heading", name=name)).to_be_visible()
    return view


async def choose_service(page: Page, name: str) -> Locator:
    """Choose a service in the table, and return its view."""
    await page.get_by_role("tab", name="Services").click()
    await page.get_by_role("searchbox", name="Search services").fill(name)
    await page.get_by_role("button", name=name, exact=True).click()
    return page.get_by_role("region", name="Chosen service")


async def advertise(client: Client, topic: str, kind: str) -> None:
    await client.send("advertise", topic=topic, type=kind)
    await client.settle()


# Topics


async def test_table_has_the_traffic_of_topics_and_is_searched_and_sorted(serve: Serve, open_page: OpenPage) -> None:
    page = await open_graph(open_page, serve())
    table = page.get_by_role("table", name="Topics")
    row = table.get_by_role("row").filter(has=page.get_by_text("/Ego_topic", exact=True))
    await expect(row.get_by_role("cell").nth(0)).to_have_text(re.compile(r"^[1-9]"))  # the ego's panel takes it
    await expect(row.get_by_role("cell").nth(1)).to_have_text(re.compile(r"^\d+ B$"))
    await table.get_by_role("button", name="Hz").click()
    await expect(table.get_by_role("columnheader", name="Hz")).to_have_attribute("aria-sort", "descending")
    await page.get_by_role("searchbox", name="Search topics").fill("EGOVEHICLE")
    await expect(table.locator("tbody tr")).to_have_count(1)
    await page.get_by_role("searchbox", name="Search topics").fill("nothing like it")
    await expect(page.get_by_text("No topic matches.")).to_be_visible()


async def test_messages_are_a_tree_that_moves_on_and_can_be_held(
    server: ServerProcess, graph: Page, connect: Connect
) -> None:
    client = await connect(server.url)
    await advertise(client, "/number", "std_msgs/Int32MultiArray")
    view = await choose_topic(graph, "/number")

    async def publish(number: int) -> None:
        await client.send("publish", topic="/number", msg={"data": [number, 1, 2]})
        await client.settle()

    item = view.get_by_role("treeitem").filter(has_text=re.compile(r"^\[0\]"))
    await watched(graph, connect, server, "/number")
    await publish(7)
    await expect(item).to_have_text("[0]7")
    await publish(8)
    await expect(item).to_have_text("[0]8")
    await view.get_by_role("button", name="Hold").click()
    await watched(graph, connect, server, "/number", count=0)
    await publish(9)
    await expect(item).to_have_text("[0]8")
    await view.get_by_role("button", name="Go on").click()
    await watched(graph, connect, server, "/number")
    await publish(10)
    await expect(item).to_have_text("[0]10")


async def test_tree_follows_the_keys_of_its_pattern_and_makes_charts(serve: Serve, open_page: OpenPage) -> None:
    page = await open_graph(open_page, serve())
    view = await choose_topic(page, "/Ego_topic")
    header = view.get_by_role("treeitem").first
    await expect(header).to_have_text(re.compile("^.header"))
    await expect(header).to_have_attribute("aria-expanded", "true")
    await header.focus()
    await page.keyboard.press("ArrowLeft")
    await expect(header).to_have_attribute("aria-expanded", "false")
    await page.keyboard.press("ArrowRight")
    await page.keyboard.press("ArrowDown")
    seq = view.get_by_role("treeitem").nth(1)
    await expect(seq).to_be_focused()
    await page.keyboard.press("Enter")
    chart = view.get_by_role("slider", name="Chart of header.seq")
    await expect(chart).to_be_visible()
    await expect(seq).to_be_focused()
    await page.keyboard.press("ArrowLeft")
    await expect(header).to_be_focused()
    await view.get_by_role("button", name="Remove the chart of header.seq").click()
    await expect(chart).to_have_count(0)


async def test_tree_shows_the_last_of_two_messages_that_follow_fast(
    serve: Serve, open_page: OpenPage, connect: Connect
) -> None:
    server = serve("--start", "sync")
    client = await connect(server.url)
    await advertise(client, "/number", "std_msgs/Int32")
    page = await open_graph(open_page, server)
    view = await choose_topic(page, "/number")
    await watched(page, connect, server, "/number")
    item = view.get_by_role("treeitem").filter(has_text=re.compile("^data"))
    await client.send("publish", topic="/number", msg={"data": 1})
    await item.click()  # a chart takes messages faster than the tree is drawn
    await expect(view.get_by_role("slider", name="Chart of data")).to_be_visible()
    await watched(page, connect, server, "/number")
    for number in (2, 3):
        await client.send("publish", topic="/number", msg={"data": number})
    await expect(item).to_have_text("data3")


@pytest.mark.parametrize("is_raw", [False, True])
async def test_image_topics_are_seen_as_images(
    serve: Serve, open_page: OpenPage, connect: Connect, *, is_raw: bool
) -> None:
    server = serve("--start", "sync")
    client = await connect(server.url)
    pixels = base64.b64encode(bytes(range(18))).decode()
    raw = {"width": 3, "height": 2, "step": 9, "encoding": "rgb8", "data": pixels}
    await advertise(client, "/camera", "sensor_msgs/" + ("Image" if is_raw else "CompressedImage"))
    page = await open_graph(open_page, server)
    view = await choose_topic(page, "/camera")
    await watched(page, connect, server, "/camera")
    await client.send("publish", topic="/camera", msg=raw if is_raw else {"format": "png", "data": PNG})
    await expect(view.get_by_text(re.compile("3 . 2 pixels"))).to_be_visible()
    await expect(view.get_by_role("img", name="Image of the topic")).to_be_visible()
    if is_raw:
        script = "node => [...node.getContext('2d').getImageData(2, 1, 1, 1).data]"
        assert await view.locator("canvas.topic-image").evaluate(script) == [15, 16, 17, 255]


async def test_flood_of_large_messages_ends_with_the_last_one(
    serve: Serve, open_page: OpenPage, connect: Connect
) -> None:
    server = serve("--start", "sync")
    client = await connect(server.url)
    await advertise(client, "/flood", "std_msgs/Float64MultiArray")
    page = await open_graph(open_page, server)
    view = await choose_topic(page, "/flood")
    await watched(page, connect, server, "/flood")
    data = [0.5] * 120_000  # 1 MB in binary frames
    body = json.dumps(data)
    for number in range(12):
        await client.send_raw(
            f'{{"op":"publish","topic":"/flood","msg":{{"layout":{{"data_offset":{number}}},"data":{body}}}}}'
        )
    await client.settle()
    offset = view.get_by_role("treeitem").filter(has_text=re.compile("^data_offset"))
    await expect(offset).to_have_text("data_offset11")
    for text in ("data(", "[0 … 9999]", "[0 … 99]"):
        await view.get_by_role("treeitem").filter(has_text=text).first.click()
    await expect(view.get_by_role("treeitem").filter(has_text=re.compile(r"^\[99\]0.5"))).to_have_count(1)
    assert await view.get_by_role("treeitem").count() <= MAX_ROWS


async def watched(page: Page, connect: Connect, server: ServerProcess, topic: str, *, count: int = 1) -> None:
    """Come back when a topic has so many subscribers, as another client sees them."""
    client = await connect(server.url)
    await client.subscribe("/sim/topics")

    def has_count(msg: Frame) -> bool:
        return [len(info["subscribers"]) for info in msg["topics"] if info["name"] == topic] == [count]

    await client.message_where("/sim/topics", has_count)
    await client.close()
    assert not page.is_closed()


async def test_clients_tab_tells_how_old_messages_are_at_a_remote_bridge(serve: Serve, open_page: OpenPage) -> None:
    async with FarSide() as far_side:
        page = await open_graph(open_page, serve("--attach", far_side.url))
        await page.get_by_role("tab", name="Clients").click()
        bridge = page.get_by_role("list", name="Remote bridges").get_by_role("listitem")
        text = rf"^Attached to {re.escape(far_side.url)}/?: messages are \d+\.\d\d s old when it handles them$"
        await expect(bridge).to_have_text(re.compile(text))


async def test_page_subscribes_only_to_what_is_seen(serve: Serve, open_page: OpenPage, connect: Connect) -> None:
    server = serve("--start", "sync")
    page = await open_graph(open_page, server)
    await choose_topic(page, "/gps")
    await watched(page, connect, server, "/gps")
    await page.get_by_role("tab", name="Clients").click()
    await watched(page, connect, server, "/gps", count=0)
    await watched(page, connect, server, "/sim/clients")
    await page.get_by_role("tab", name="Log").click()
    await watched(page, connect, server, "/sim/clients", count=0)
    await watched(page, connect, server, "/rosout")
    await page.get_by_role("tab", name="Ego").click()
    await watched(page, connect, server, "/rosout", count=0)


# Forms


async def test_form_publishes_what_another_client_receives(
    server: ServerProcess, graph: Page, connect: Connect
) -> None:
    client = await connect(server.url)
    await client.subscribe("/ctrl_cmd")
    view = await choose_topic(graph, "/ctrl_cmd")
    await view.get_by_text("Publish a message").click()
    await expect(view.get_by_text("angle of the front wheels, left is positive")).to_be_visible()
    await view.get_by_label("steering [rad]").fill("0.25")
    await view.get_by_label("longlCmdType").fill("many")
    publish = view.get_by_role("button", name="Publish", exact=True)
    await publish.click()
    await expect(view.get_by_role("alert")).to_contain_text("longlCmdType: expected int32")
    await view.get_by_label("longlCmdType").fill("2")
    await publish.click()
    await expect(view.get_by_text("Published.")).to_be_visible()
    message = await client.message("/ctrl_cmd")
    assert (message["longlCmdType"], message["steering"]) == (2, 0.25)
    await view.get_by_role("button", name="Write as JSON").click()
    area = view.get_by_label("Message as JSON")
    assert json.loads(await area.input_value())["steering"] == 0.25
    await area.fill('{"velocity": 5}')
    await publish.click()
    assert (await client.message("/ctrl_cmd"))["velocity"] == 5
    await graph.get_by_role("tab", name="Code").click()
    await expect(graph.get_by_label("Program", exact=True)).to_contain_text("velocity")
    await graph.get_by_role("tab", name="Graph").click()


async def test_reason_of_a_refused_message_is_beside_the_form(serve: Serve, open_page: OpenPage) -> None:
    page = await open_graph(open_page, serve("--start", "sync"))
    view = await choose_topic(page, "/clock")
    await view.get_by_text("Publish a message").click()
    await view.get_by_role("button", name="Publish", exact=True).click()
    await expect(view.locator(".notice[data-kind=bad]").filter(has_text="/clock")).to_be_visible()


async def test_call_shows_its_answer_and_the_reason_of_a_refusal(serve: Serve, open_page: OpenPage) -> None:
    page = await open_graph(open_page, serve("--start", "sync"))
    view = await choose_service(page, "/sim/nearest_lane")
    await view.get_by_role("button", name="Call").click()
    await expect(view.get_by_role("tree", name="Answer").get_by_role("treeitem").first).to_be_visible()
    view = await choose_service(page, "/sim/spawn")
    await view.get_by_role("button", name="Add: objects").click()
    await expect(view.get_by_text("start_within [m]")).to_be_visible()
    await view.get_by_role("button", name="Call").click()
    await expect(view.locator(".notice[role=status]")).to_contain_text("objects[0].model: expected a name")
    await view.get_by_role("button", name="Write as JSON").click()
    await view.get_by_label("Message as JSON").fill("[1]")
    await view.get_by_role("button", name="Call").click()
    await expect(view.get_by_role("alert")).to_contain_text("Expected a JSON object")


async def test_button_comes_with_the_form_that_it_sends(serve: Serve, open_page: OpenPage) -> None:
    server = serve("--start", "sync")
    page = await open_page("about:blank", state=None)
    held: list[str] = []
    is_holding = True

    def hold_back(frame: Frame) -> None:
        if is_holding and frame.get("service") == "/rosapi/definition":
            held.append(json.dumps(frame))
            frame["op"] = "later"  # which the page ignores

    route = await spoil_frames(page, server, hold_back)
    await page.add_init_script(LASTING)
    await page.goto(page_url(server))
    await page.get_by_role("tab", name="Graph").click()
    topic = await choose_topic(page, "/clock")
    await topic.get_by_text("Publish a message").click()
    await expect(topic.get_by_role("button", name="Publish", exact=True)).to_be_hidden()
    service = await choose_service(page, "/sim/nearest_lane")
    await expect(service.get_by_text("rosbridge_sim_msgs/NearestLane")).to_be_visible()
    await expect(service.get_by_role("button", name="Call")).to_be_hidden()
    is_holding = False
    for answer in held:
        route[0].send(answer)
    await expect(service.get_by_role("button", name="Call")).to_be_visible()


# Texts from the wire


async def test_names_and_texts_of_the_wire_never_become_html(
    serve: Serve, open_page: OpenPage, connect: Connect
) -> None:
    server = serve("--start", "sync")
    page = await open_page("about:blank", state=None)

    def spoil(frame: Frame) -> None:
        msg = frame.get("msg", {})
        if frame.get("topic") == "/sim/topics":
            msg["topics"].append(
                msg["topics"][0] | {"name": f"/{HTML}", "type": HTML, "publishers": [HTML], "subscribers": [HTML]}
            )
        elif frame.get("topic") == "/sim/clients":
            msg["clients"][0] |= {"address": HTML, "dropped_topics": [HTML], "dropped_counts": [1]}
        elif frame.get("topic") == "/sim/refusals":
            line = {"header": {"stamp": {"secs": 1, "nsecs": 0}}, "level": 8, "name": HTML, "msg": HTML}
            route[0].send(json.dumps({"op": "publish", "topic": "/rosout", "msg": line}))

    route = await spoil_frames(page, server, spoil)
    await page.goto(page_url(server))
    await page.get_by_role("tab", name="Graph").click()
    await page.get_by_role("searchbox", name="Search topics").fill("onerror")
    await page.locator(".table-choice").filter(has=page.get_by_text(f"/{HTML}", exact=True)).click()
    view = page.get_by_role("region", name="Chosen topic")
    await expect(view.get_by_role("heading", name=f"/{HTML}")).to_be_visible()
    await view.get_by_text("Publish a message").click()
    await expect(view.get_by_role("alert")).to_contain_text(HTML)
    client = await connect(server.url)
    await advertise(client, "/text", "std_msgs/String")
    view = await choose_topic(page, "/text")
    await watched(page, connect, server, "/text")
    await client.send("publish", topic="/text", msg={"data": HTML})
    await expect(view.get_by_role("treeitem").filter(has_text=HTML)).to_be_visible()
    await page.get_by_role("tab", name="Clients").click()
    await expect(page.get_by_role("table", name="Clients")).to_contain_text(f"lost 1 of {HTML}")
    await page.get_by_role("tab", name="Log").click()
    await watched(page, connect, server, "/rosout")
    await client.send("advertise", topic="/bad", type=HTML)
    await expect(page.locator(".log-line[data-level=error]").filter(has_text=HTML)).to_be_visible()
    await expect(page.locator(".log-line[data-level=warning]").filter(has_text=HTML).first).to_be_visible()
    assert await page.locator("img[src=x], [onerror]").count() == 0
    assert await page.title() == "rosbridge-sim"


@pytest.mark.parametrize("num_lines", [600, pytest.param(10_000, marks=pytest.mark.long)])
async def test_flood_of_log_lines_leaves_the_latest_ones(
    serve: Serve, open_page: OpenPage, connect: Connect, num_lines: int
) -> None:
    server = serve("--start", "sync")
    page = await open_page("about:blank", state=None)
    route = await spoil_frames(page, server, lambda _: None)
    await page.goto(page_url(server))
    await page.get_by_role("tab", name="Log").click()
    await watched(page, connect, server, "/rosout")  # before, the page would not look at the lines
    for number in range(num_lines):
        line = {"header": {}, "level": 2, "name": "node", "msg": f"line {number} " + "x" * 2000}
        route[0].send(json.dumps({"op": "publish", "topic": "/rosout", "msg": line}))
    lines = page.locator(".log-line")
    # Each line goes through Playwright, too: on a busy machine many of them take minutes.
    latest = lines.filter(has_text="xxx").first  # the server has lines of its own, as of a client that has left
    await expect(latest).to_contain_text(f"line {num_lines - 1} ", timeout=max(PATIENCE, num_lines / 50) * 1e3)
    assert await lines.count() == MAX_LINES
    assert len(await latest.inner_text()) < 1200


async def spoil_frames(page: Page, server: ServerProcess, spoil: Callable[[Frame], None]) -> list[WebSocketRoute]:
    """Change JSON frames on their way to the page; return a list that will hold its socket."""
    sockets: list[WebSocketRoute] = []

    def connect_through(socket: WebSocketRoute) -> None:
        sockets.append(socket)
        far = socket.connect_to_server()

        def pass_on(data: str | bytes) -> None:
            if isinstance(data, str):
                frame = json.loads(data)
                spoil(frame)
                socket.send(json.dumps(frame))
            else:
                socket.send(data)

        far.on_message(pass_on)

    await page.route_web_socket(re.compile(rf"127\.0\.0\.1:{server.port}"), connect_through)
    return sockets


# The log, and assistive technology


async def test_log_has_refused_requests_by_level_and_words(serve: Serve, open_page: OpenPage, connect: Connect) -> None:
    server = serve("--start", "sync")
    client = await connect(server.url)
    await client.call("/no/such/service")
    page = await open_page(server)
    await page.get_by_role("tab", name="Log").click()
    line = page.locator(".log-line").filter(has_text="/no/such/service")
    await expect(line).to_have_count(1)
    await expect(line).to_contain_text("Warning")
    await page.get_by_label("Level").select_option("Error")
    await expect(line).to_have_count(0)
    await page.get_by_label("Level").select_option("Debug")
    await expect(line).to_have_count(1)
    await page.get_by_role("searchbox", name="Search").fill("something else")
    await expect(line).to_have_count(0)


@pytest.mark.parametrize(("scheme", "width"), LOOKS)
async def test_graph_and_log_have_no_serious_fault_of_accessibility(
    serve: Serve, open_page: OpenPage, scheme: str, width: int
) -> None:
    page = await open_graph(
        open_page, serve("--start", "sync"), color_scheme=scheme, viewport={"width": width, "height": 720}
    )
    view = await choose_topic(page, "/ctrl_cmd")
    await view.get_by_text("Publish a message").click()
    await expect(view.get_by_label("steering [rad]")).to_be_visible()
    assert await faults_of(page) == []
    assert await page.evaluate("document.documentElement.scrollWidth") <= width
    view = await choose_service(page, "/sim/spawn")
    await view.get_by_role("button", name="Add: objects").click()
    assert await faults_of(page) == []
    for tab in ("Clients", "Log"):
        await page.get_by_role("tab", name=tab).click()
        assert await faults_of(page) == []


async def test_mistake_of_another_client_is_told_once_over_the_map_and_counted_at_the_log(
    serve: Serve, open_page: OpenPage, connect: Connect
) -> None:
    server = serve("--start", "sync")
    client = await connect(server.url)
    await client.send("publish", topic="/early", msg={})
    await client.settle()
    page = await open_page("about:blank", state=None)
    await page.add_init_script(LASTING)
    await page.goto(page_url(server))
    badge = page.get_by_role("tab", name="Log").locator(".badge")
    await expect(badge).to_have_text("1")
    await expect(page.locator(".toast")).to_have_count(0)
    for _ in range(3):
        await client.send("publish", topic="/late", msg={})
    await expect(page.locator(".toast")).to_have_count(1)
    await expect(page.locator(".toast")).to_contain_text("127.0.0.1:")
    await expect(page.locator(".toast")).to_contain_text("publish /late: ")
    await expect(badge).to_have_text("2")
    await page.locator(".toast").click()
    await expect(page.locator(".log-lines")).to_contain_text("/early")
    await expect(badge).to_have_count(0)


async def test_faults_of_a_mock_are_shown_and_switched_by_a_click(
    open_page: OpenPage, serve: Serve, tmp_path: Path
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("topics: {/x: {type: std_msgs/Bool}}\nfaults: {lost: {kind: drop, topics: [/x], on: false}}")
    page = await open_graph(open_page, serve("--mock", str(file), "--no-world"))
    table = page.get_by_role("table", name="Faults of the mock")
    row = table.get_by_role("row").filter(has_text="lost")
    await expect(row).to_contain_text("drop")
    await expect(row).to_contain_text("off")
    await row.locator(".table-choice").click()
    await expect(row).to_contain_text("on", timeout=PATIENCE * 1000)
    assert await faults_of(page) == []


async def test_server_without_a_mock_shows_no_faults(open_page: OpenPage, server: ServerProcess) -> None:
    page = await open_graph(open_page, server)
    await expect(page.get_by_text("/Ego_topic", exact=True)).to_be_visible()
    await expect(page.get_by_text("Faults of the mock")).to_be_hidden()
