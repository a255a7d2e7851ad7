"""The connection of `watch`: it keeps a `WatchedScene` up to date, and connects again after each loss.

The ego, the objects and the light ahead come from MORAI's own topics, so any rosbridge behind which a MORAI SIM or this
simulator runs will do. A server that has `/sim/map` is this simulator: it is asked for the map, gear and mode as well.
"""

from __future__ import annotations

import asyncio
import math
from typing import Final

from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, open_bridge
from rosbridge_sim.cli.watch.watched_scene import MapLines, WatchedScene
from rosbridge_sim.errors import ClientError, DocumentError
from rosbridge_sim.link.bridge_errors import RefusedError

__all__ = ["SceneSource"]

EGO: Final = "/Ego_topic"
OBJECTS: Final = "/Object_topic"
LIGHT: Final = "/GetTrafficLightStatus"
SYNC: Final = "/SyncModeInfo"
MARKERS: Final = "/sim/scene/objects"

FAST_MS: Final = 50
SLOW_MS: Final = 200
"""Shortest time between two messages of a topic [ms]: of those that show motion, and of the others."""

ASK_AGAIN: Final = 3.0
"""Time after which a topic without messages is subscribed to again [s]: it may have come meanwhile."""

STATE_PERIOD: Final = 1.0
"""Time between two questions for gear and mode [s]."""

MAP_PERIOD: Final = 30.0
MIN_MAP_PERIOD: Final = 2.0
"""Time between two questions for the map [s]: as a rule, and after a jump of the ego."""

MAX_PAGES: Final = 2_000
"""Pages of a map that are read: ten million points."""

FIRST_WAIT: Final = 0.5
MAX_WAIT: Final = 5.0
"""Wait between two attempts to connect again [s]; it doubles from the first to the second."""

MAX_FRAMES: Final = 500
"""Frames that are handled before the picture is drawn again: a few milliseconds."""


class SceneSource:
    """The source of a scene.

    Attributes:
        scene: what is known.
        connected: set by the first connection.
        is_complete: the map was read, or there is none; for a single picture.
    """

    def __init__(self, url: str, token: str | None, patience: float) -> None:
        """Prepare; `run` connects.

        Args:
            token: its token; None for none.
            patience: longest wait for a connection or an answer [s].
        """
        self.scene = WatchedScene()
        self.connected = asyncio.Event()
        self.is_complete = False
        self._url, self._token, self._patience = url, token, patience
        self._heard: set[str] = set()

    async def run(self) -> None:
        """Follow the server for ever.

        Raises:
            DocumentError: the first connection cannot be made; the text says why.
        """
        wait = FIRST_WAIT
        while True:
            try:
                async with open_bridge(self._url, self._token, self._patience) as bridge:
                    wait = FIRST_WAIT
                    self.connected.set()
                    self.scene.problem = ""
                    await self._follow(bridge)
            except (DocumentError, RefusedError, ClientError) as error:
                if not self.connected.is_set():
                    raise
                self.scene.forget(f" connecting again: {error}")
            await asyncio.sleep(wait)
            wait = min(2.0 * wait, MAX_WAIT)

    async def _follow(self, bridge: Bridge) -> None:
        """Take messages, and ask questions, until the connection ends."""
        self._heard = set()
        asking = asyncio.create_task(self._ask(bridge))
        try:
            subscribe_at = -math.inf
            while True:
                if bridge.now() >= subscribe_at:
                    subscribe_at = bridge.now() + ASK_AGAIN
                    await self._subscribe(bridge)
                frame = await bridge.receive(subscribe_at)
                for one in [frame, *bridge.take_inbox()][:MAX_FRAMES]:
                    if one is not None:
                        self._take(one, bridge.now())
        finally:
            asking.cancel()
            await asyncio.wait({asking})
            if not asking.cancelled():
                asking.exception()  # the same loss of the connection

    async def _subscribe(self, bridge: Bridge) -> None:
        """Subscribe to all topics that have sent nothing yet; without a type, for any generation of ROS."""
        for topic in (EGO, OBJECTS, LIGHT, SYNC, MARKERS):
            if topic not in self._heard:
                period = FAST_MS if topic in (EGO, OBJECTS) else SLOW_MS
                await bridge.send("subscribe", topic=topic, throttle_rate=period, queue_length=1)

    def _take(self, frame: Frame, now: float) -> None:
        message = frame.get("msg")
        if frame.get("op") != "publish" or not isinstance(message, dict):
            return
        topic, scene = absolute(str(frame.get("topic"))), self.scene
        self._heard.add(topic)
        if topic == EGO:
            scene.take_ego(message, now)
        elif topic == OBJECTS:
            scene.take_objects(message)
        elif topic == LIGHT:
            scene.take_light(message, now)
        elif topic == SYNC:
            scene.sync = message
        elif topic == MARKERS:
            scene.take_markers(message)

    # Questions

    async def _ask(self, bridge: Bridge) -> None:
        """Ask for the map, gear and mode, again and again; a server without a map is asked nothing more."""
        map_at = -math.inf
        while True:
            due = MIN_MAP_PERIOD if self.scene.has_jumped else MAP_PERIOD
            if bridge.now() - map_at >= due:
                map_at, self.scene.has_jumped = bridge.now(), False
                has_map = await self._ask_map(bridge)
                self.is_complete = True
                if not has_map:
                    self.scene.map = self.scene.event = None
                    return
            await self._ask_state(bridge)
            await asyncio.sleep(STATE_PERIOD)

    async def _ask_map(self, bridge: Bridge) -> bool:
        """Read the map, unless it is the one that is known; return if the server has one."""
        pages: list[Frame] = []
        num = 1
        while len(pages) < num:
            answer = await bridge.call("/sim/map", {"page": len(pages)}, self._patience)
            page = None if answer is None or not answer.is_ok else answer.values
            if not isinstance(page, dict) or page.get("result") is not True:
                return bool(pages)  # the map was replaced meanwhile; the next question gets the new one
            known = self.scene.map
            if known is not None and known.digest and page.get("digest") == known.digest:
                return True
            pages.append(page)
            count = page.get("num_pages")
            num = min(count, MAX_PAGES) if isinstance(count, int) else 1
        self.scene.map = await asyncio.to_thread(MapLines.read, pages)  # seconds for a city
        return True

    async def _ask_state(self, bridge: Bridge) -> None:
        """Ask for gear and mode; option 0 changes nothing."""
        answer = await bridge.call("/Service_MoraiEventCmd", {"request": {"option": 0}}, self._patience)
        values = answer.values if answer is not None and answer.is_ok else None
        response = values.get("response") if isinstance(values, dict) else None
        self.scene.event = response if isinstance(response, dict) else None
