"""`rosbridge-sim serve` and `attach`: a simulator from its flags to its end.

The first line on stdout has the URL on which the server listens, or the bridge to which it is attached. All other
output goes to stderr. An internal error gives a traceback and exit code 1, a mistake of the
settings, or a recording without its end, 2. A requested end gives 0.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING

from rosbridge_sim import __version__
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.stop_signals import on_stop_signals, stop_signals
from rosbridge_sim.shell.config.command_flags import ServerCommand
from rosbridge_sim.shell.config.loading import read_settings, strange_variables
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.monitoring.log_format import formatter_of
from rosbridge_sim.shell.websocket.freed_memory import keep_memory, trim_memory

if TYPE_CHECKING:
    from rosbridge_sim.shell.app import Simulator

__all__ = ["ServerCommand", "serve"]

_log = logging.getLogger("rosbridge_sim")


def serve(argv: Sequence[str], command: ServerCommand = "serve") -> int:
    """Run a server until it is stopped; return the exit code.

    Args:
        command: see `read_flags`.

    Raises:
        DocumentError: a flag, a file or a map cannot be used; a line for each mistake.
    """
    if "--version" in argv:
        print(f"rosbridge-sim {__version__}")  # noqa: T201 - what was asked for
        return 0
    words = [word for word in argv if word != "--print-config"]
    settings = read_settings(words, os.environ, command=command, find_more=_find_more)
    if "--print-config" in argv:
        from rosbridge_sim.shell.assembly import list_items  # noqa: PLC0415 - as below
        from rosbridge_sim.shell.config.toml_output import format_config  # noqa: PLC0415 - as below

        print(format_config(settings, list_items(settings)), end="")  # noqa: T201 - what was asked for
        return 0
    _start_log(settings)
    for line in strange_variables(os.environ):
        _log.warning("%s", line)
    early: list[signal.Signals] = []

    def leave(number: int, _frame: FrameType | None) -> None:
        early.append(signal.Signals(number))
        sys.exit(0)

    for one in stop_signals():
        signal.signal(one, leave)  # until the simulator is built
    keep_memory()
    from rosbridge_sim.shell.app import Simulator  # noqa: PLC0415 - not needed for --help or after a mistake

    with asyncio.Runner(loop_factory=_loop_factory()) as runner:
        try:
            return runner.run(_run(Simulator(settings), early))
        except DocumentError as error:
            if settings.log_format == "text":
                raise  # `main` prints it
            for line in str(error).splitlines():
                _log.critical("%s", line)
            return 2


YOUNG_OBJECTS = 5_000
"""New objects after which garbage is looked for; Python has 700. A client that connects makes 150 that stay, so 200 of
them would cost 40 searches, an eighth of all their time. What waits for the search takes a megabyte at most."""


def _find_more(settings: Settings) -> Sequence[str]:
    """Return the mistakes that only a simulator finds."""
    from rosbridge_sim.shell.assembly import mistakes_of_items  # noqa: PLC0415 - as above

    return mistakes_of_items(settings)


async def _run(simulator: Simulator, early: Sequence[signal.Signals] = ()) -> int:
    """Run a simulator until a signal or its own failure ends it; return the exit code.

    Args:
        early: signals that came before. They should have ended the program, but the interpreter drops what a handler
            raises within a callback of a weak reference.
    """
    await simulator.start()
    assert simulator.descriptors is not None
    asyncio.get_running_loop().set_exception_handler(simulator.descriptors.take)
    stopped: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def stop(number: signal.Signals) -> None:
        _log.info("%s: stopping", number.name)
        stopped.set_result(None)

    with on_stop_signals(stop, simulator.close_recording):
        if early:
            stop(early[0])
        try:
            failed = await _serve_until(stopped, simulator)
        finally:
            await simulator.stop()
        if failed is not None:
            _log.critical("stopped: %s", failed)
            return 2 if isinstance(failed, DocumentError) else 1
    return 2 if simulator.has_lost_recording else 0


async def _serve_until(stopped: asyncio.Future[None], simulator: Simulator) -> BaseException | None:
    """Serve until `stopped` is done or the world fails; return the failure, if any."""
    if simulator.settings.listen:
        await simulator.prepare_page()  # a reader of the next line may open it at once
        print(f"rosbridge-sim listening on {simulator.url}", flush=True)  # noqa: T201 - the one line on stdout
        _tell_page(simulator)
    else:
        for attachment in simulator.attachments:
            attachment.attached.add_done_callback(partial(_tell_attached, attachment.url))
    gc.freeze()  # without these objects a full collection takes almost no time; with them, 12 ms
    gc.set_threshold(YOUNG_OBJECTS, *gc.get_threshold()[1:])
    gc.enable()
    trim_memory()  # the start has freed 3 MB
    failed = asyncio.ensure_future(simulator.wait())
    await asyncio.wait({stopped, failed}, return_when=asyncio.FIRST_COMPLETED)
    if failed.done():
        return failed.exception()
    failed.cancel()
    return None


def _tell_page(simulator: Simulator) -> None:
    """Log the address of the web page."""
    here, *elsewhere = simulator.page_urls or ("",)
    if elsewhere:
        _log.info("the page is at %s, and for other machines at %s", here, elsewhere[0])
    elif here:
        _log.info("the page is at %s", here)


def _tell_attached(url: str, attached: asyncio.Future[None]) -> None:
    if not attached.cancelled():
        print(f"rosbridge-sim attached to {url}", flush=True)  # noqa: T201 - a line on stdout for each bridge


def _loop_factory() -> Callable[[], asyncio.AbstractEventLoop] | None:
    """Return uvloop's loop factory if it is installed; else None for the standard loop."""
    try:
        import uvloop  # noqa: PLC0415 - not installed on every system
    except ImportError:
        return None
    return uvloop.new_event_loop


def _start_log(settings: Settings) -> None:
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter_of(settings.log_format))
    logging.basicConfig(level=settings.log_level.upper(), handlers=[handler])
