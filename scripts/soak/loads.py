#!/usr/bin/env python3
"""Load scenarios ten thousand times over a real socket, and check that the server does not grow.

    python scripts/soak/loads.py [--loads 10000] [--seed 0]

Loads of all kinds follow in random order: good and bad files, with and without `delete_all`, single parts, other maps,
other network settings, by service and by topic, with and without synchronous mode, with a pause. Meanwhile a client is
subscribed, other clients come and go, and objects and egos are added. After each load the published objects must be
the right ones; after a bad load they must be the same as before. At the end memory, and the numbers of topics, services
and clients, must be as after the first tenth.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from websockets.sync.client import connect

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.shell.files.library import DiskLibrary  # noqa: E402
from scripts.bench.program import SERVER, machine, running  # noqa: E402
from scripts.soak.scenes import BAD, BAD_NETWORK, BUILT_IN, GOOD, MISSING, write_networks, write_scenes  # noqa: E402

PATIENCE = 30.0
"""Longest silence of a server before a message counts as lost [s]."""

MAX_GROWTH = 8.0
"""Largest growth of memory from the first tenth to the end [MB]: the allocator keeps unused blocks."""

PARTS = ("load_surrounding_vehicle_data", "load_pedestrian_data", "load_obstacle_data")

LISTS = ("npc_list", "pedestrian_list", "obstacle_list")

EGO_TYPE = -1
"""Type of a further ego in the list of vehicles: it does not belong to a scenario."""

Frame = dict[str, Any]


class SoakError(Exception):
    """The server did something wrong."""


class Listener:
    """A client that subscribes to all objects, and makes calls.

    Attributes:
        ids: the last list of objects: unique_ids of vehicles, pedestrians, obstacles.
        num_told: status frames by level.
    """

    def __init__(self, url: str) -> None:
        self._open = ExitStack()
        self._socket = self._open.enter_context(
            connect(url, max_size=None, compression=None, ping_interval=None, proxy=None)
        )
        self._num = 0
        self.ids: list[list[int]] = [[], [], []]
        self.num_told: Counter[str] = Counter()

    def send(self, op: str, **fields: object) -> None:
        """Send an op.

        Args:
            op: its name.
            fields: of the op.
        """
        self._socket.send(json.dumps({"op": op, **fields}))

    def ask(self, service: str, **args: object) -> Frame:
        """Call a service.

        Args:
            args: of the call.

        Returns:
            The values of the answer.

        Raises:
            SoakError: it was refused.
        """
        self._num += 1
        mark = f"call:{self._num}"
        self.send("call_service", service=service, args=args, id=mark)
        while True:
            frame = self._read()
            if frame["op"] == "service_response" and frame["id"] == mark:
                if not frame["result"]:
                    raise SoakError(f"{service} was refused: {frame['values']}")
                values: Frame = frame["values"]
                return values

    def request(self, service: str, **request: object) -> Frame:
        """Call a service of the simulator.

        Args:
            request: fields of the request.

        Returns:
            Fields of the response.
        """
        response: Frame = self.ask(service, request=request)["response"]
        return response

    def next_objects(self) -> list[list[int]]:
        """Wait for the next message about objects.

        Returns:
            The unique_ids of vehicles, pedestrians and obstacles.
        """
        while self._read().get("topic") != "/Object_topic":
            pass
        return self.ids

    def close(self) -> None:
        """Close the connection."""
        self._open.close()

    def _read(self) -> Frame:
        data = self._socket.recv(PATIENCE)
        frame: Frame = json.loads(data) if isinstance(data, str) else {"op": "cbor"}
        if frame.get("topic") == "/Object_topic":
            self.ids = [
                [entry["unique_id"] for entry in frame["msg"][name] if entry["type"] != EGO_TYPE] for name in LISTS
            ]
        elif frame["op"] == "status":
            self.num_told[frame["level"]] += 1
        return frame


class Soak:
    """One long run; its seed decides all random choices."""

    def __init__(self, url: str, folder: Path, seed: int) -> None:
        self._url = url
        self._random = random.Random(seed)  # noqa: S311 - it is not a secret
        library = DiskLibrary([folder])
        scenes = {name: library.scenario(name) for name in (*GOOD, *BUILT_IN)}
        self._counts = {
            name: tuple(map(len, (scene.vehicles, scene.pedestrians, scene.obstacles)))
            for name, scene in scenes.items()
        }
        self._listener = Listener(url)
        self._listener.send("subscribe", topic="/Object_topic")
        self._listener.send("subscribe", topic="/Ego_topic")
        self._listener.send("subscribe", topic="/CollisionData", compression="cbor-raw", throttle_rate=10**9)
        self._listener.send("advertise", topic="/ego_setting", type="morai_msgs/MultiEgoSetting")
        self._listener.send("advertise", topic="/SyncModeAddObj", type="morai_msgs/SyncModeAddObj")
        self._listener.send("advertise", topic="/ScenarioLoad", type="morai_msgs/ScenarioLoad")
        self._frame: int | None = None
        self.num = Counter[str]()
        self._look()

    def census(self) -> dict[str, int]:
        """Return the numbers of topics, services and clients.

        Returns:
            Kind -> number.
        """
        ask = self._listener.ask
        return {
            "topics": len(ask("/rosapi/topics")["topics"]),
            "services": len(ask("/rosapi/services")["services"]),
            "nodes": len(ask("/rosapi/nodes")["nodes"]),
        }

    def settle(self) -> None:
        """Load the opening scene and its network settings, outside synchronous mode."""
        self._leave_sync()
        self._listener.request("/Service_MoraiSL", file_name="demo", load_network_connection_data=True)
        self._listener.ask("/sim/reset", seed=-1)
        self._look()  # a load at the last frame may have left a pause

    def turn(self) -> None:
        """Load once, and sometimes do something else before."""
        chance = self._random.random
        if chance() < 0.05:
            self._switch_mode()
        if chance() < 0.05:
            self._visit()
        if chance() < 0.03:
            self._add_somebody()
        if chance() < 0.01:
            self._listener.ask("/sim/reset", seed=-1)
            self._frame = None if self._frame is None else 0
            self._look()
        if chance() < 0.35:
            self._load(self._random.choice([*BAD, *MISSING]), is_good=False)
        else:
            self._load(self._random.choice([*GOOD, *BUILT_IN]), is_good=True)

    def _load(self, name: str, *, is_good: bool) -> None:
        chance = self._random.random
        is_clearing, is_pausing = chance() < 0.6, chance() < 0.05
        parts = [chance() < 0.8 for _ in PARTS]
        request = {
            **dict(zip(PARTS, parts, strict=True)),
            "file_name": name,
            "delete_all": is_clearing,
            "load_ego_vehicle_data": chance() < 0.8,
            "load_network_connection_data": chance() < 0.2,
            "set_pause": is_pausing,
        }
        is_good = is_good and not (name == BAD_NETWORK and request["load_network_connection_data"])
        before = self._listener.ids
        if self._frame is not None and chance() < 0.8:
            service, request["frame"] = "/SyncModeScenarioLoad", self._frame + 1
        else:
            service = "/Service_MoraiSL"
        if self._frame is None and chance() < 0.2:
            service = "/ScenarioLoad"
            self._listener.send("publish", topic=service, msg=request)
        else:
            result = self._listener.request(service, **request)["result"]
            if result is not is_good:
                raise SoakError(f"{service} of {name!r} answered {result}")
        after = self._look()
        if is_good:
            wanted = [
                (0 if is_clearing else len(ids)) + (count if is_loaded else 0)
                for ids, count, is_loaded in zip(before, self._counts[name], parts, strict=True)
            ]
            if list(map(len, after)) != wanted:
                raise SoakError(f"{name!r}: expected {wanted} objects, got {list(map(len, after))}")
        elif after != before:
            raise SoakError(f"{name!r}: a refused load has changed the objects")
        self.num["good" if is_good else "bad"] += 1
        self.num[f"by {service}"] += 1
        self.num["in synchronous mode" if self._frame is not None else "in real time"] += 1

    def _look(self) -> list[list[int]]:
        """Return the present objects; this ends a pause."""
        self._listener.request("/Service_MoraiEventCmd", option=8, set_pause=False)
        if self._frame is None:
            return self._listener.next_objects()
        answer = self._listener.request("/SyncModeWaitForTick", user_id="soak", frame=self._frame + 1)
        if not answer["tick_status"]:
            raise SoakError("a tick was refused")
        self._frame = answer["frame"]
        return self._listener.ids

    def _switch_mode(self) -> None:
        if self._frame is not None:
            self._leave_sync()
        else:
            answer = self._listener.request("/SyncModeCmd", user_id="soak", start_sync_mode=True, time_step=20)
            self._frame = answer["frame"]
        self._look()

    def _leave_sync(self) -> None:
        if self._frame is not None:
            self._listener.request("/SyncModeCmd", user_id="soak", start_sync_mode=False, time_step=20)
            self._frame = None

    def _visit(self) -> None:
        """Let a client connect, subscribe to a few topics and leave, in order or not."""
        visitor = Listener(self._url)
        for topic in ("/Object_topic", "/Ego-2/Ego_topic", "/tf", "/IntscnTL_topic"):
            visitor.send("subscribe", topic=topic, throttle_rate=self._random.choice((0, 100)))
        visitor.send("advertise", topic=f"/own_{self._random.randrange(10**9)}", type="std_msgs/String")
        visitor.ask("/rosapi/get_time")
        visitor.close()
        self.num["visitors"] += 1

    def _add_somebody(self) -> None:
        """Add a further ego and a box; the next load with `delete_all` removes both."""
        numbers = ("global_position_x", "global_position_y", "global_position_z")
        lists = (*numbers, "global_roll", "global_pitch", "global_yaw", "velocity")
        setting: Frame = {"number_of_ego_vehicle": 1, "ego_index": [2], "gear": [4], "ctrl_mode": [16]}
        self._listener.send("publish", topic="/ego_setting", msg={**setting, **{name: [30.0] for name in lists}})
        if self._frame is not None:
            box = {"frame": self._frame + 1, "name": "Box", "position": {"x": 9.0, "y": 9.0, "z": 0.0}}
            self._listener.send("publish", topic="/SyncModeAddObj", msg=box)
        self._look()
        self._look()
        self.num["egos"] += 1


def main() -> int:
    """Run it, with a line of progress for each tenth."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--loads", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_scenes(folder)
        write_networks(folder / "data")
        flags = (f"--scenario-path={folder}", f"--data-dir={folder / 'data'}")
        with (folder / "log").open("wb") as log, running([*SERVER, *flags], log) as server:
            soak = Soak(f"ws://127.0.0.1:{server.port}", folder, options.seed)
            print(f"before: {server.memory():.1f} MB, {soak.census()}")
            begun, tenth = time.perf_counter(), max(1, options.loads // 10)
            figures = []
            for i in range(1, options.loads + 1):
                soak.turn()
                if i % tenth == 0:
                    soak.settle()
                    figures.append((server.memory(), soak.census()))
                    print(
                        f"{i:7,} loads: {time.perf_counter() - begun:6.0f} s, server {server.cpu():6.0f} s of CPU, "
                        f"{figures[-1][0]:.1f} MB, {figures[-1][1]}",
                        flush=True,
                    )
        print(", ".join(f"{count:,} {what}" for what, count in sorted(soak.num.items())))
        is_clean = b"Traceback" not in (folder / "log").read_bytes()
    growth = figures[-1][0] - figures[0][0]
    is_level = growth <= MAX_GROWTH and figures[-1][1] == figures[0][1]
    print(f"memory grew by {growth:+.1f} MB since the first tenth; {'good' if is_level and is_clean else 'NOT GOOD'}")
    return 0 if is_level and is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
