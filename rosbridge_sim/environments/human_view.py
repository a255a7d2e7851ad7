"""A server on a free port of this machine that shows the world of an environment, and its page."""

from __future__ import annotations

import time
from typing import Final

from rosbridge_sim.records import replace
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.simulator.snapshots.node_state import NodeState
from rosbridge_sim.worlds.worlds import Worlds

LATEST: Final = 0.5
"""If a picture is later than this, those behind it are shown in real time from then on [s]."""


class HumanView:
    """Shows one world on the page of a server; the world of the server itself stands.

    Args:
        worlds: the worlds; the first one is shown.
    """

    def __init__(self, worlds: Worlds, scenario: str) -> None:
        self._worlds = worlds
        self._simulator = Simulator(host="127.0.0.1", port=0, scenario=scenario, start="sync", open=True).open()
        self._due = time.monotonic()
        self._frame = 0

    @property
    def page_url(self) -> str:
        """URL of the page."""
        return self._simulator.page_url

    @property
    def url(self) -> str:
        """URL for clients."""
        return self._simulator.url

    def show(self) -> None:
        """Show the world as it is now, and wait until real time has come so far."""
        [saved] = self._worlds.save([i == 0 for i in range(self._worlds.num_worlds)])
        node = self._simulator.node
        assert node is not None

        def put() -> None:
            now, state = time.monotonic(), NodeState(node.context, node.components)
            shown = replace(
                state.save(), world=saved.world, found=saved.found, loaded=saved.loaded, next_uid=saved.next_uid
            )
            state.restore(shown, now, before_undo=lambda: None)
            node.context.publishers.show_every(saved.world.frame, now)

        self._simulator.run_inside(put)
        passed, self._frame = saved.world.frame - self._frame, saved.world.frame
        self._due = max(self._due + max(passed, 0) * self._worlds.dt, time.monotonic() - LATEST)
        time.sleep(max(self._due - time.monotonic(), 0.0))

    def close(self) -> None:
        """Stop the server."""
        self._simulator.close()
