"""The loop of `watch`: keys, pictures, and an end that leaves the terminal as it was."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from rosbridge_sim.cli.tools.text import put
from rosbridge_sim.cli.watch.picture import View, draw, pan, show_whole_map, zoom
from rosbridge_sim.cli.watch.source import SceneSource
from rosbridge_sim.cli.watch.terminal import Screen, count_colours, has_unicode, read_keys
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.stop_signals import on_stop_signals
from rosbridge_sim.link.urls import full_url, shown_url

__all__ = ["watch"]

PAN = 16.0
"""Dots by which an arrow key moves the picture: a tenth of a usual terminal."""

POLL = 0.05
"""Time between two looks at the scene for a single picture [s]."""


async def watch(url: str, token: str | None, patience: float, *, rate: float, is_once: bool, has_colour: bool) -> int:
    """Show the scene until a key or a signal ends it, or show it once.

    Args:
        token: its token; None for none.
        patience: longest wait for a connection, an answer or the first message [s].
        rate: pictures a second.
        is_once: print one picture and end; without a terminal that can move its cursor, this is done in any case.
        has_colour: use colours if the terminal has them.

    Raises:
        DocumentError: there is no connection.
        RefusedError: no message came in time, for a single picture.
    """
    is_terminal = sys.stdout.isatty()
    num_colours = count_colours(os.environ, is_terminal=is_terminal) if has_colour else 0
    view = View(num_colours=num_colours, has_unicode=has_unicode(sys.stdout.encoding))
    source = SceneSource(url, token, patience)
    title = shown_url(full_url(url))
    following = asyncio.create_task(source.run())
    try:
        if is_once or not is_terminal or os.environ.get("TERM") == "dumb":
            return await _show_once(source, following, view, title, patience)
        return await _show_many(source, following, view, title, rate)
    finally:
        following.cancel()
        await asyncio.wait({following})
        if not following.cancelled():
            following.exception()  # it was raised to the caller


async def _show_once(
    source: SceneSource, following: asyncio.Task[None], view: View, title: str, patience: float
) -> int:
    """Print a picture when the ego and the map are known."""
    loop = asyncio.get_running_loop()
    give_up_at = loop.time() + patience
    while source.scene.ego is None or not source.is_complete:
        if following.done():
            await following
        if loop.time() >= give_up_at:
            if source.scene.ego is not None:
                break
            raise RefusedError(f"{title}: no message on /Ego_topic within {patience:g} s; --timeout waits longer")
        await asyncio.sleep(POLL)
    await asyncio.sleep(POLL)  # the other topics follow within the same frame
    width, height = Screen.size()
    for row in draw(source.scene, view, (width, height - 1), now=loop.time(), title=title, has_keys=False):
        put(row)
    return 0


async def _show_many(source: SceneSource, following: asyncio.Task[None], view: View, title: str, rate: float) -> int:
    """Show pictures until a key or a signal ends it."""
    loop = asyncio.get_running_loop()
    connecting = asyncio.ensure_future(source.connected.wait())
    await asyncio.wait({connecting, following}, return_when=asyncio.FIRST_COMPLETED)
    connecting.cancel()
    if following.done():  # the error of the first connection belongs on the usual screen
        await following
    keys = _Keys(source, view)
    with Screen() as screen, on_stop_signals(keys.quit, screen.leave), _suspending(screen), keys.listening():
        while not keys.is_ended:
            if following.done():
                await following
            screen.show(draw(source.scene, view, screen.size(), now=loop.time(), title=title))
            await keys.wait(1.0 / rate)
    return 0


class _Keys:
    """The keys, and what they change.

    Attributes:
        is_ended: a key or a signal has asked for the end.
    """

    def __init__(self, source: SceneSource, view: View) -> None:
        self.is_ended = False
        self._source = source
        self._view = view
        self._pressed = asyncio.Event()

    def quit(self, _signal: object = None) -> None:
        """Ask for the end."""
        self.is_ended = True
        self._pressed.set()

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Listen to the keyboard, if there is one, within this context."""
        if sys.platform == "win32" or not sys.stdin.isatty():
            yield
            return
        loop = asyncio.get_running_loop()
        loop.add_reader(sys.stdin.fileno(), self._read)
        try:
            yield
        finally:
            loop.remove_reader(sys.stdin.fileno())

    async def wait(self, seconds: float) -> None:
        """Wait so long, or until a key is pressed."""
        self._pressed.clear()
        if not self.is_ended:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._pressed.wait(), seconds)
        if sys.platform == "win32":
            self._read()

    def _read(self) -> None:
        for key in read_keys():
            self._press(key)
        self._pressed.set()

    def _press(self, key: str) -> None:
        view = self._view
        if key in ("q", "Q", "\x04"):  # Ctrl-D, too
            self.quit()
        elif key in ("+", "="):
            zoom(view, 1)
        elif key in ("-", "_"):
            zoom(view, -1)
        elif key == "f":
            view.is_following = True
        elif key == "h":
            view.is_heading_up = not view.is_heading_up
        elif key in ("m", "0"):
            show_whole_map(view, self._source.scene, *Screen.size())
        elif key in _PANS:
            pan(view, self._source.scene, *_PANS[key])


_PANS = {"left": (-PAN, 0.0), "right": (PAN, 0.0), "up": (0.0, PAN), "down": (0.0, -PAN)}


@contextmanager
def _suspending(screen: Screen) -> Iterator[None]:
    """Restore the terminal while Ctrl-Z suspends the program."""
    if sys.platform == "win32":
        yield
        return

    def suspend() -> None:
        screen.leave()
        os.kill(os.getpid(), signal.SIGSTOP)
        screen.enter()  # when it goes on

    loop = asyncio.get_running_loop()
    try:
        loop.add_signal_handler(signal.SIGTSTP, suspend)
    except (RuntimeError, ValueError):  # not the main thread
        yield
        return
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGTSTP)
