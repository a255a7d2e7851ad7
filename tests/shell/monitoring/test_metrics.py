"""The page `/metrics`: what Prometheus reads from a running simulator."""

from __future__ import annotations

import asyncio
import re
from dataclasses import dataclass

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_openmetrics
from prometheus_client.parser import text_string_to_metric_families as parse_text

from rosbridge_sim import Simulator
from rosbridge_sim.errors import Reason
from rosbridge_sim.shell.monitoring.metrics import FRAME_BOUNDS, FrameHistogram
from tests.conftest import Connect
from tests.support import PATIENCE, ROOT

BASE_UNITS = ("_seconds", "_bytes")


@dataclass
class Page:
    """An answer."""

    status: int
    head: str
    body: str

    @property
    def values(self) -> dict[str, float]:
        """Value of each sample, by its name and labels as the page writes them."""
        lines = [line for line in self.body.splitlines() if line and not line.startswith("#")]
        return {line.rpartition(" ")[0]: float(line.rpartition(" ")[2]) for line in lines}


async def scrape(sim: Simulator, *headers: str) -> Page:
    async with asyncio.timeout(PATIENCE):
        reader, writer = await asyncio.open_connection("127.0.0.1", sim.port)
        writer.write("\r\n".join(["GET /metrics HTTP/1.1", "Host: localhost", *headers, "", ""]).encode())
        head, _, body = (await reader.read()).decode().partition("\r\n\r\n")
        writer.close()
        await writer.wait_closed()
    return Page(int(head.split()[1]), head, body)


async def test_a_scrape_is_read_by_prometheus_and_names_follow_its_rules() -> None:
    async with Simulator(port=0) as sim:
        page = await scrape(sim)
        openmetrics = await scrape(sim, "Accept: application/openmetrics-text; version=1.0.0")
    assert page.status == 200
    assert "Content-Type: text/plain; version=" in page.head
    assert "Content-Type: application/openmetrics-text; version=1.0.0" in openmetrics.head
    families = [family for family in parse_text(page.body) if family.name.startswith("rosbridge_sim_")]
    assert list(parse_openmetrics(openmetrics.body))  # type: ignore[no-untyped-call] # it has no types
    assert len(families) > 20
    for family in families:
        assert family.documentation.endswith((".", ")"))
        assert re.fullmatch(r"[a-z_]+", family.name)
        if re.search(r"second|byte", family.name):
            assert family.name.removesuffix("_total").endswith(BASE_UNITS), family.name
        assert family.type != "unknown"


async def test_world_and_clients_are_counted(connect: Connect) -> None:
    async with Simulator(port=0, start="sync") as sim:
        before = (await scrape(sim)).values
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=40)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=0)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=0)
        await client.call("/SyncModeWaitForTick", {"request": {"user_id": "other", "frame": 9}})
        await client.subscribe("/Ego_topic")
        after = (await scrape(sim)).values
        await client.close()
    name = "rosbridge_sim_"
    assert before[f"{name}frames_total"] == before[f"{name}clients"] == 0.0
    wanted = {
        "frame": 4.0,
        "frames_total": 4.0,
        "ticks_total": 2.0,
        "synchronous_mode": 1.0,
        "paused": 0.0,
        "real_time_lag_seconds": 0.0,
        "real_time_stalls_total": 0.0,
        "world_failed": 0.0,
        "clients": 1.0,
        "clients_connected_total": 1.0,
        "strangers": 0.0,
        "dropped_messages_total": 0.0,
        "faults_total": 0.0,
        'refusals_total{reason="not_master"}': 1.0,
        "frame_cpu_seconds_count": 4.0,
        'frame_cpu_seconds_bucket{le="+Inf"}': 4.0,
    }
    assert {key: after[name + key] for key in wanted} == wanted
    assert after[f"{name}frame_cpu_seconds_sum"] > 0.0
    for key in ("received_bytes_total", "sent_bytes_total", "received_frames_total"):
        assert after[name + key] > before[name + key]


@pytest.mark.parametrize("accept", ["", "*/*", "text/plain; version=x", ";;;,,=", "application/json", "é" * 4_000])
async def test_accept_header_that_asks_for_something_else_gets_text(accept: str) -> None:
    async with Simulator(port=0, world=False) as sim:
        page = await scrape(sim, f"Accept: {accept}")
        assert (page.status, sim.num_bugs) == (200, 0)
        assert "Content-Type: text/plain; version=0.0.4; charset=utf-8" in page.head


async def test_version_that_is_no_number_is_no_fault_of_the_server() -> None:
    async with Simulator(port=0, world=False) as sim:
        page = await scrape(sim, "Accept: Application/OpenMetrics-Text; version=new")
        assert (page.status, sim.num_bugs) == (200, 0)
        assert page.body.endswith("# EOF\n")


async def test_every_reason_of_a_refusal_is_there_from_the_start() -> None:
    async with Simulator(port=0) as sim:
        values = (await scrape(sim)).values
    for reason in Reason:
        assert values[f'rosbridge_sim_refusals_total{{reason="{reason.value}"}}'] == 0.0


async def test_age_of_data_at_each_bridge_is_a_metric() -> None:
    async with (
        Simulator(port=0, world=False) as bridge,
        Simulator(port=0, start="sync", attach=[bridge.url]) as sim,
    ):
        await asyncio.wait_for(sim.attachments[0].attached, PATIENCE)
        name = f'rosbridge_sim_bridge_age_seconds{{bridge="{bridge.url}"}}'
        assert (await scrape(sim)).values[name] >= 0.0
        assert "rosbridge_sim_bridge_age_seconds" not in "".join((await scrape(bridge)).values)


async def test_a_gateway_has_no_metrics_of_a_world() -> None:
    async with Simulator(port=0, world=False) as sim:
        values = (await scrape(sim)).values
    assert "rosbridge_sim_clients" in values
    assert not [name for name in values if "frame_cpu" in name or "world" in name]


async def test_messages_that_a_client_does_not_read_are_seen_in_queue_and_drops(connect: Connect) -> None:
    async with Simulator(port=0, world=False, outbox_burst=1, outbox_size=1024) as sim:
        reader, writer = await connect(sim.url), await connect(sim.url)
        await reader.send("subscribe", topic="/t", type="std_msgs/String")
        await reader.settle()
        reader.socket.transport.pause_reading()
        text = "x" * 100_000
        values = (await scrape(sim)).values
        async with asyncio.timeout(PATIENCE):
            while not values["rosbridge_sim_dropped_messages_total"]:
                for _ in range(50):
                    await writer.send("publish", topic="/t", type="std_msgs/String", msg={"data": text})
                await writer.settle()
                values = (await scrape(sim)).values
        assert values["rosbridge_sim_queue_bytes"] == values["rosbridge_sim_queue_largest_bytes"] > len(text)
        assert values["rosbridge_sim_held_bytes"] >= values["rosbridge_sim_queue_bytes"]
        reader.socket.transport.abort()


async def test_two_simulators_have_registries_of_their_own() -> None:
    async with Simulator(port=0, start="sync") as one, Simulator(port=0) as two:
        assert two.node is not None
        async with asyncio.timeout(PATIENCE):
            while not two.node.context.stepper.num_frames:  # noqa: ASYNC110 - it has no event for that
                await asyncio.sleep(0)
        first, second = (await scrape(one)).values, (await scrape(two)).values
    assert first["rosbridge_sim_frames_total"] == 0.0
    assert second["rosbridge_sim_frames_total"] > 0.0


async def test_nothing_measures_frames_before_the_first_scrape() -> None:
    async with Simulator(port=0) as sim:
        assert sim.node is not None
        assert sim.node.context.stepper.meter is None
        await scrape(sim)
        assert sim.node.context.stepper.meter is not None


@pytest.mark.slow
async def test_metrics_want_the_token_where_one_is_set() -> None:
    async with Simulator(port=0, token="sesame") as sim:  # noqa: S106 - no secret
        assert (await scrape(sim, "Authorization: Bearer sesame")).status == 200
        refused = await scrape(sim)
        assert (refused.status, refused.body) == (401, "The token is missing or wrong\n")
        assert "WWW-Authenticate: Bearer" in refused.head
        assert (await scrape(sim, "Authorization: Bearer wrong")).status == 401


async def test_scrapes_at_once_are_all_answered() -> None:
    async with Simulator(port=0) as sim:
        pages = await asyncio.gather(*(scrape(sim) for _ in range(10)))
    assert [page.status for page in pages] == [200] * 10


def test_histogram_counts_a_frame_in_the_first_bucket_that_holds_it() -> None:
    now = 0.0
    histogram = FrameHistogram(lambda: now)
    for spent in (0.0, FRAME_BOUNDS[0], 0.003, 7.0):
        histogram.begin()
        now += spent
        histogram.end()
    assert histogram.total == pytest.approx(7.0031)
    assert sum(histogram.counts) == 4
    assert (histogram.counts[0], histogram.counts[FRAME_BOUNDS.index(0.005)], histogram.counts[-1]) == (2, 1, 1)


async def test_page_on_operation_lists_every_metric() -> None:
    async with Simulator(port=0) as sim:
        names = set(re.findall(r"^# TYPE (rosbridge_sim_\w+) ", (await scrape(sim)).body, re.MULTILINE))
    page = (ROOT / "docs" / "operation.md").read_text("utf-8")
    assert set(re.findall(r"`(rosbridge_sim_\w+)`", page)) == names
