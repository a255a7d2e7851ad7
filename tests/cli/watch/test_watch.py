"""`rosbridge-sim watch` in a pseudo-terminal: what a person sees, keys, and a terminal that is as before at the end."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import subprocess
import sys

import pytest

from rosbridge_sim.client import AsyncClient
from rosbridge_sim.shell.app import Simulator
from tests.cli.tool_fixture import in_the_background, run
from tests.support import PATIENCE, ROOT

if sys.platform == "win32":
    pytest.skip("Windows has no pseudo-terminals of this kind", allow_module_level=True)

from tests.cli.watch.pty_screen import PtyScreen

FIRST_PICTURE = "external control"
"""The server has answered the last question before the first whole picture."""


def free_port() -> int:
    import socket  # noqa: PLC0415 - for this alone

    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    assert isinstance(port, int)
    return port


@pytest.mark.slow
async def test_terminal_shows_map_ego_lights_and_time() -> None:
    async with Simulator(port=0, scenario="town") as sim:
        with PtyScreen("watch", sim.url, columns=100, lines=30) as terminal:
            await asyncio.to_thread(terminal.until_text, FIRST_PICTURE)
            await asyncio.to_thread(terminal.until_text, "●")
            await asyncio.to_thread(terminal.until_text, "x real time")
            lines = terminal.text.splitlines()
            terminal.press("q")
            assert await asyncio.to_thread(terminal.end) == 0
            assert terminal.is_restored
    assert lines[0].startswith(f" rosbridge-sim watch  {sim.url}")
    assert lines[0].endswith("town")
    assert re.search(r"N ↑ +10 m ├─+┤", lines[1])
    assert lines[-4].startswith(" ego 0     0.0 km/h")
    assert re.search(r"frame [\d,]+ .* objects", lines[-2])
    assert lines[-1].startswith(" q quit")
    assert sum(0x2800 < ord(char) < 0x2900 for line in lines for char in line) > 200
    colours = {char.fg for row in terminal.screen.buffer.values() for char in row.values()}
    assert len(colours) > 4, "roads, cars, the ego and lights have colours of their own"


@pytest.mark.slow
async def test_keys_zoom_move_and_show_the_whole_map() -> None:
    async with Simulator(port=0, scenario="town") as sim:
        with PtyScreen("watch", sim.url, environ={"TERM": "xterm"}) as terminal:
            await asyncio.to_thread(terminal.until_text, FIRST_PICTURE)
            terminal.press("+++")
            await asyncio.to_thread(terminal.until_text, " 5 m ├")
            terminal.press("---")
            await asyncio.to_thread(terminal.until_text, " 10 m ├")
            before = terminal.text.splitlines()[2:18]
            terminal.press("\x1b[A\x1b[C\x1bOA")
            await asyncio.to_thread(terminal.until, lambda: terminal.text.splitlines()[2:18] != before)
            terminal.press("h")
            await asyncio.to_thread(terminal.until, lambda: "N ↑" not in terminal.text)
            terminal.press("m")
            await asyncio.to_thread(terminal.until_text, "N ↑  100 m ├")
            terminal.press("\x1b[5~\x1bq")  # keys without a meaning, and q
            terminal.press("Q")
            assert await asyncio.to_thread(terminal.end) == 0


@pytest.mark.slow
async def test_resized_terminal_gets_a_picture_of_its_size() -> None:
    async with Simulator(port=0, scenario="loop") as sim:
        with PtyScreen("watch", sim.url) as terminal:
            await asyncio.to_thread(terminal.until_text, FIRST_PICTURE)
            for columns, lines in ((40, 12), (120, 40)):
                terminal.resize(columns, lines)
                terminal.screen.reset()  # nothing of the former picture counts

                def is_there(last: int = lines - 1) -> bool:
                    return terminal.screen.display[last].startswith(" q quit")

                await asyncio.to_thread(terminal.until, is_there)
                assert terminal.screen.display[0].startswith(" rosbridge-sim watch")
            terminal.resize(12, 3)
            await asyncio.to_thread(terminal.until, lambda: terminal.screen.display[0].startswith(" ego 0"))
            terminal.press("q")
            assert await asyncio.to_thread(terminal.end) == 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT], ids=lambda number: number.name)
async def test_signal_ends_it_and_restores_the_terminal(number: signal.Signals) -> None:
    async with Simulator(port=0, scenario="loop") as sim:
        with PtyScreen("watch", sim.url) as terminal:
            await asyncio.to_thread(terminal.until_text, FIRST_PICTURE)
            assert not terminal.is_restored
            terminal.send(number)
            assert await asyncio.to_thread(terminal.end) == 0
            assert terminal.is_restored


@pytest.mark.slow
async def test_suspended_program_restores_the_terminal_until_it_goes_on() -> None:
    async with Simulator(port=0, scenario="loop") as sim:
        with PtyScreen("watch", sim.url) as terminal:
            await asyncio.to_thread(terminal.until_text, FIRST_PICTURE)
            terminal.send(signal.SIGTSTP)
            await asyncio.to_thread(terminal.until, lambda: terminal.is_stopped)
            await asyncio.to_thread(terminal.until, lambda: terminal.is_restored)
            terminal.send(signal.SIGCONT)
            await asyncio.to_thread(terminal.until, lambda: not terminal.is_restored)
            terminal.press("q")
            assert await asyncio.to_thread(terminal.end) == 0
            assert terminal.is_restored


@pytest.mark.slow
def test_failure_of_the_program_restores_the_terminal() -> None:
    program = "from rosbridge_sim.cli.watch.terminal import Screen\nwith Screen() as screen:\n    screen.show(None)"
    with PtyScreen("-c", program, is_module=False) as terminal:
        assert terminal.end() == 1
        assert terminal.is_restored
        assert "TypeError" in terminal.text


@pytest.mark.slow
async def test_lost_connection_is_told_and_made_again() -> None:
    port = free_port()
    async with Simulator(port=port, scenario="loop") as sim:
        terminal = PtyScreen("watch", sim.url)
        await asyncio.to_thread(terminal.until_text, FIRST_PICTURE)
    with terminal:
        await asyncio.to_thread(terminal.until_text, "connecting again")
        assert terminal.screen.display[0].endswith("loop "), "the last picture stays"
        async with Simulator(port=port, scenario="town"):
            await asyncio.to_thread(terminal.until, lambda: "connecting again" not in terminal.text)
            await asyncio.to_thread(terminal.until, lambda: terminal.screen.display[0].endswith("town "))
            terminal.press("\x04")
            assert await asyncio.to_thread(terminal.end) == 0


@pytest.mark.slow
async def test_any_rosbridge_with_an_ego_is_drawn_on_a_grid() -> None:
    ego = {"position": {"x": 1000.0, "y": 2000.0, "z": 0.0}, "velocity": {"x": 5.0}, "heading": 90.0, "unique_id": 4}
    async with Simulator(port=0, world=False) as sim, AsyncClient(sim.url) as client:
        await client.publish("/Ego_topic", ego, "morai_msgs/EgoVehicleStatus")

        async def publish() -> None:
            while True:
                await client.publish("/Ego_topic", ego)
                await asyncio.sleep(0)

        publishing = asyncio.create_task(publish())
        done = await in_the_background("watch", "--once", url=sim.url)
        publishing.cancel()
    assert (done.code, done.err) == (0, "")
    assert done.lines[0].split() == ["rosbridge-sim", "watch", sim.url]
    assert "ego 4    18.0 km/h" in done.out
    assert "at 1000.0, 2000.0  heading 90" in done.out
    assert done.out.count(".") > 20, "the grid"


async def test_output_that_is_no_terminal_gets_one_picture_without_control_sequences() -> None:
    async with Simulator(port=0, scenario="loop") as sim:
        done = await in_the_background("watch", url=sim.url)
    assert (done.code, done.err) == (0, "")
    assert len(done.lines) == 23
    assert done.lines[0].endswith("loop ")
    assert "\x1b" not in done.out
    assert "q quit" not in done.out
    assert done.out.isascii(), "the encoding of this output is not known"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "environ"), [((), {}), (("--no-colour",), {}), ((), {"NO_COLOR": "1"}), ((), {"TERM": "dumb"})]
)
async def test_single_picture_in_a_terminal_has_colours_unless_they_are_off(
    words: tuple[str, ...], environ: dict[str, str]
) -> None:
    async with Simulator(port=0, scenario="loop") as sim:
        with PtyScreen("watch", sim.url, "--once", *words, environ=environ) as terminal:
            assert await asyncio.to_thread(terminal.end) == 0
            assert (b"\x1b[" in terminal.written) is not (bool(words) or bool(environ))
            assert b"\x1b[?1049h" not in terminal.written
            assert "ego 0" in terminal.text


@pytest.mark.slow
def test_without_a_server_the_terminal_stays_as_it_is() -> None:
    with PtyScreen("watch", f"127.0.0.1:{free_port()}") as terminal:
        assert terminal.end() == 2
        assert b"\x1b" not in terminal.written
        assert "nothing listens there" in terminal.text


async def test_server_without_an_ego_is_named_after_the_time_out() -> None:
    async with Simulator(port=0, world=False) as sim:
        done = await in_the_background("watch", "--once", "--timeout", "0.5", url=sim.url)
    assert done.code == 1
    assert done.complaint == f"{sim.url}: no message on /Ego_topic within 0.5 s; --timeout waits longer"


@pytest.mark.parametrize("rate", ["0", "1e9", "nan", "fast"])
def test_impossible_rate_is_a_mistake(rate: str) -> None:
    done = run("watch", "--rate", rate)
    assert done.code == 2
    assert "pictures a second" in done.complaint


@pytest.mark.slow
async def test_closed_pipe_is_no_error() -> None:
    async with Simulator(port=0, scenario="loop") as sim:
        read, write = os.pipe()
        os.close(read)
        words = [sys.executable, "-m", "rosbridge_sim", "watch", sim.url]
        done = await asyncio.to_thread(
            subprocess.run, words, stdout=write, stderr=subprocess.PIPE, cwd=ROOT, timeout=PATIENCE, check=False
        )
        os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")
