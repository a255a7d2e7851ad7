"""Limits of the log: lines per source, line length, and summaries of omitted lines."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Iterator
from typing import cast

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.shell.monitoring.log_limits import (
    CLIENT_BURST,
    CLIENT_RATE,
    LOGGERS,
    MAX_LINE,
    MAX_SOURCES,
    MAX_TRACEBACK,
    PLACE_BURST,
    PLACE_RATE,
    TRACEBACK_COST,
    LineLimiter,
)
from tests.conftest import Connect, Serve
from tests.support import ROOT

log = logging.getLogger("rosbridge_sim.graph")


class Loop:
    """As much of an event loop as the limiter uses, with a clock that the test moves."""

    def __init__(self) -> None:
        self.now = 1_000.0

    def time(self) -> float:
        return self.now

    def call_later(self, _delay: float, _call: object) -> Loop:
        return self

    def cancel(self) -> None:
        """Never ring."""


@pytest.fixture
def loop() -> Loop:
    return Loop()


@pytest.fixture
def limiter(loop: Loop, caplog: pytest.LogCaptureFixture) -> Iterator[LineLimiter]:
    """A limiter at work."""
    limiter = LineLimiter(cast("asyncio.AbstractEventLoop", loop))
    limiter.start()
    with caplog.at_level(logging.DEBUG, "rosbridge_sim"):
        yield limiter
    limiter.stop()


def say(client: str, num: int = 1, text: str = "hello") -> None:
    for _ in range(num):
        log.info("%s says: %s", client, text, extra={"client": client})


def test_log_lines_of_a_client_have_a_burst_and_a_rate(
    limiter: LineLimiter, loop: Loop, caplog: pytest.LogCaptureFixture
) -> None:
    say("a:1", 1_000)
    assert len(caplog.messages) == CLIENT_BURST
    loop.now += 5.0
    say("a:1", 1_000)
    assert len(caplog.messages) == CLIENT_BURST + 5 * CLIENT_RATE
    caplog.clear()
    limiter.flush()
    assert caplog.messages == ["... 1,945 more lines of a:1 were left out"]
    assert caplog.records[0].levelno == logging.INFO
    limiter.flush()
    assert len(caplog.messages) == 1


def test_client_does_not_use_up_log_lines_of_another(limiter: LineLimiter, caplog: pytest.LogCaptureFixture) -> None:
    say("a:1", 1_000)
    say("b:2", 3)
    assert [line for line in caplog.messages if line.startswith("b:2")] == ["b:2 says: hello"] * 3
    say("b:2", 1_000)
    caplog.clear()
    limiter.flush()
    assert caplog.messages == ["... 1,903 more lines of b:2 and 1 other were left out"]


def test_reconnecting_client_gets_no_extra_log_lines(
    limiter: LineLimiter, loop: Loop, caplog: pytest.LogCaptureFixture
) -> None:
    for port in range(2_000):
        say(f"a:{port}")
    assert len(caplog.messages) == PLACE_BURST
    loop.now += 1.0
    for port in range(2_000):
        say(f"a:{port}")
    assert len(caplog.messages) == PLACE_BURST + PLACE_RATE
    assert len(limiter._sources) <= MAX_SOURCES
    caplog.clear()
    limiter.flush()
    (message,) = caplog.messages
    assert re.fullmatch(r"\.\.\. 3,795 more lines of test_log_limits\.py:\d+ were left out", message)


def test_each_log_source_has_its_own_limit_and_the_summary_has_the_highest_level(
    limiter: LineLimiter, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(1_000):
        log.debug("one")
        log.warning("other")
    assert caplog.messages.count("one") == caplog.messages.count("other") == PLACE_BURST
    limiter.flush()
    assert caplog.records[-1].levelno == logging.WARNING


def test_fatal_errors_are_always_logged(limiter: LineLimiter, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(1_000):
        log.critical("the world has failed")
    assert len(caplog.messages) == 1_000
    limiter.flush()
    assert len(caplog.messages) == 1_000


def test_long_log_line_is_cut(limiter: LineLimiter, caplog: pytest.LogCaptureFixture) -> None:
    assert limiter
    log.info("%s%s", "x" * (MAX_LINE - 1), "y")
    log.info("%s%s", "x" * MAX_LINE, "y" * 12_345)
    assert caplog.messages == ["x" * (MAX_LINE - 1) + "y", "x" * MAX_LINE + "... (12,345 more characters)"]


def test_traceback_counts_as_several_log_lines_and_is_cut(
    limiter: LineLimiter, caplog: pytest.LogCaptureFixture
) -> None:
    assert limiter
    names: dict[str, str] = {}
    for _ in range(100):
        try:
            _ = names["z" * 100_000 + "end"]
        except KeyError:
            log.exception("a frame could not be handled")
    assert len(caplog.messages) == PLACE_BURST // TRACEBACK_COST
    for record in caplog.records:
        assert record.exc_text is not None
        assert MAX_TRACEBACK < len(record.exc_text) < MAX_TRACEBACK + 100
        assert record.exc_text.startswith("Traceback (most recent call last):")
        assert record.exc_text.endswith("zzend'")


def test_log_limits_hold_only_between_start_and_stop(loop: Loop, caplog: pytest.LogCaptureFixture) -> None:
    limiter = LineLimiter(cast("asyncio.AbstractEventLoop", loop))
    for _ in range(300):
        log.warning("before")
    limiter.start()
    limiter.stop()
    limiter.stop()
    for _ in range(300):
        log.warning("after")
    assert len(caplog.messages) == 600


def test_log_limits_apply_to_every_logger_of_the_package() -> None:
    names: set[str] = set()
    for path in (ROOT / "rosbridge_sim").rglob("*.py"):
        names.update(re.findall(r'getLogger\("(.+?)"\)', path.read_text()))
    assert names - {"rosbridge_sim.log"} == set(LOGGERS)


async def test_status_ops_fill_neither_the_log_nor_rosout(connect: Connect, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "rosbridge_sim")
    async with Simulator(port=0, world=False) as sim:
        client, other = await connect(sim.url), await connect(sim.url)
        await other.send("subscribe", topic="/rosout", type="rosgraph_msgs/Log")
        await other.settle()
        for _ in range(300):
            await client.send("status", level="info", msg="x" * 10_000)
        await client.settle()
        frames = await other.settle()
    said = [line for line in caplog.messages if " says: " in line]
    assert CLIENT_BURST <= len(said) < CLIENT_BURST + 10
    assert max(map(len, said)) < MAX_LINE + 50
    heard = [frame["msg"]["msg"] for frame in frames if frame["op"] == "publish"]
    assert [text for text in heard if " says: " in text] == said
    assert re.search(r"\.\.\. 2\d\d more lines of 127\.0\.0\.1:\d+ were left out", caplog.text)


@pytest.mark.slow
async def test_debug_log_of_any_client_input_is_bounded(serve: Serve, connect: Connect) -> None:
    server = serve("--log-level", "debug")
    client = await connect(server.url)
    for i in range(300):  # without a bound the texts alone would take 3 MB
        await client.send("status", level="error", msg="\U000e0001" * 1_000)
        await client.send("advertise", topic=f"/odd_{i}", type=f"nobody_{i}_msgs/Knows")
        await client.send("publish", topic="/InsnControl", type="morai_msgs/IntersectionControl", msg={})
    await client.settle()
    assert len(server.log) < 500_000


def test_log_line_with_wrong_arguments_does_not_raise(
    limiter: LineLimiter,
) -> None:
    record = log.makeRecord(log.name, logging.WARNING, __file__, 1, "%d %d", ("x",), None)
    assert limiter.filter(record)
