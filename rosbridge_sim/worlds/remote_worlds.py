"""The world of a server as `SteppedWorlds`: the server moves it, and each step brings its whole state here.

The state is a snapshot, so all that is derived from it (lanes, other entities, scores) is what a world in this process
with the same seed and commands has, to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.client import Client
from rosbridge_sim.errors import ClientError, DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.plain.plain_bytes import decode
from rosbridge_sim.simulator.plain.snapshot_bytes import unpack
from rosbridge_sim.simulator.plain.typed_plain import read_as
from rosbridge_sim.simulator.scene.load import FoundMap
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.saved_world import from_plain
from rosbridge_sim.worlds.argument_checks import check_number
from rosbridge_sim.worlds.drivable_worlds import Commands
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

NAME: Final = "remote environment"
"""Name of the snapshot on the server: each step replaces it."""

TIMEOUT: Final = 60.0
"""Longest wait for an answer [s]: the first reset of a large scene takes some seconds on a busy machine."""

_KINDS: Final = {"throttle": 1, "speed": 2, "accel": 3}
"""`longlCmdType` by the argument that it goes with."""


class RemoteWorlds(SteppedWorlds):
    """The world of a server that this program alone moves, as its master of synchronous mode.

    Args:
        token: of the server; None for none.
        library: has the maps; None for the built-in ones.

    Raises:
        ConnectError: there is no server.
        ServiceRefusedError: another client is the master.
        DocumentError: the server has another map than this program under the same name, or another version.
        ClientError: it is no server of this project.
    """

    def __init__(self, url: str, *, token: str | None = None, library: DiskLibrary | None = None) -> None:
        super().__init__([OneOfMany()])
        self._library = DiskLibrary() if library is None else library
        self._maps: dict[tuple[str, bytes], tuple[RoadMap, SignalPlan]] = {}
        self._found: FoundMap | None = None
        self._client = Client(url, token=token, timeout=TIMEOUT).open()
        try:
            self._client.start_sync()
            self._steering = self._find_steering()
            self._pull()
        except BaseException:
            self._client.close()
            raise

    def __reduce_ex__(self, protocol: Any) -> Any:  # noqa: ANN401 - Python's own form
        """Refuse to be copied or pickled.

        Raises:
            TypeError: always.
        """
        raise TypeError("the world of a server cannot be copied or pickled: save it there, with Client.snapshot")

    def close(self) -> None:
        """End synchronous mode and the connection."""
        if self._client.is_connected:
            self._client.stop_sync()
        self._client.close()

    def step(self, commands: Commands | None = None, n: int = 1) -> None:
        """Command the ego and have the server move; see `Worlds.step`.

        Raises:
            ValueError: as for `Worlds.step`; or a gear is commanded. Nothing has moved.
            ServiceRefusedError: the server refuses it, or another client has interrupted it.
            ConnectionLostError: the server has gone.
        """
        check_number("n", n)
        wishes = {} if commands is None else {0: self._as_message(commands)}
        self._client.step(n, commands=wishes)
        self._pull()

    def reset(self, mask: npt.ArrayLike | None = None, seeds: Sequence[int | None] | None = None) -> None:
        """Begin the scenario again; see `Worlds.reset`."""
        if mask is not None and not np.asarray(mask).all():
            return
        seed = None if seeds is None else seeds[0]
        self._client.call("/sim/reset", {"seed": self._worlds[0].seed if seed is None else seed})
        self._client.score()  # scores are kept from here on
        self._pull()

    def place(self, world: int, **_: Any) -> None:  # noqa: ANN401 - of `Worlds.place`
        """Refuse: the ego begins where the server's scenario has it.

        Raises:
            ValueError: always.
        """
        del world
        raise ValueError("start_lane: expected none, because an ego of a server begins where its scenario has it")

    def remove(self, world: int, uid: int) -> None:
        """Refuse, as `place` does.

        Raises:
            ValueError: always.
        """
        self.place(world, uid=uid)

    def map_of(self, number: int) -> FoundMap:
        """Return the map, with its name.

        Raises:
            ValueError: there is no such world.
        """
        self.world(number)
        assert self._found is not None
        return self._found

    def _as_message(self, commands: Commands) -> dict[str, object]:
        """Return commands of the first ego as a CtrlCmd."""
        if "gear" in commands:
            raise ValueError("gear: expected none, because the ego of a server keeps its gear")
        self.command(commands)  # checks them, and what they do here is overwritten
        first = {name: float(self._broadcast(name, values)[0, 0]) for name, values in commands.items()}
        kind = next(number for name, number in _KINDS.items() if name in first)
        return {
            "longlCmdType": kind,
            self._steering: first["steering"],
            "accel": first.get("throttle", 0.0),
            "brake": first.get("brake", 0.0),
            "velocity": first.get("speed", 0.0) * MPS_TO_KMH,
            "acceleration": first.get("accel", 0.0),
        }

    def _find_steering(self) -> str:
        """Return the name of the field of CtrlCmd with the angle of the wheels, which depends on the release."""
        answer = self._client.call("/rosapi/message_details", {"type": "morai_msgs/CtrlCmd"})
        names = [name for each in answer["typedefs"] for name in each["fieldnames"]]
        found = [name for name in ("steering", "front_steer") if name in names]
        if not found:
            raise ClientError(f"{self._client.url}: expected a server of rosbridge-sim, got one without CtrlCmd")
        return found[0]

    def _pull(self) -> None:
        """Take the state of the server's world."""
        head, packed = unpack(self._client.snapshot(NAME, with_data=True).data)
        state = read_as(dict[str, Any], decode(packed), "state")
        name, digest = read_as(tuple[str, bytes], state.get("map"), "map")
        if (name, digest) not in self._maps:
            road_map = self._library.map(name)
            if road_map.digest != digest:
                raise DocumentError(f"map {name[:80]!r}: the server has another one than this program")
            self._maps[name, digest] = road_map, road_map.plan
        road_map, plan = self._maps[name, digest]
        self._found = FoundMap(name, road_map)
        try:
            self._worlds[0].restore(from_plain(state.get("world"), road_map.roads, plan))
        except (ValueError, TypeError) as error:
            raise DocumentError(f"state of frame {head.frame}: {error!s:.200}") from None
