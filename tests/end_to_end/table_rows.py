"""Parts of a row of the table of topics and services: a scene on a live server, and a client that acts in it.

Each row begins at frame 0 of the same scene, in synchronous mode with the row's own client as its master, so what it
sees depends on what it does alone.
"""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from tests.support import Client

__all__ = ["Message", "Row", "SceneClient", "Table", "write_scenes"]

Message = dict[str, Any]
"""A message as the client reads it."""

ME: Final = "reader"
"""The master's id."""


def _at(x: float, y: float, yaw: float = 0.0) -> Message:
    return {"initPositionMode": "Absolute", "pos": {"x": x, "y": y, "z": 0.0}, "rot": {"yaw": yaw}}


_ON_LANE = {"initPositionMode": "Link", "initLink": "R1222L2", "initLinkRatio": 0.7}

SCENES: Final[dict[str, Message]] = {
    # The town's avenue, the ego 70 m before the stop line of TL22W; on a meadow two vehicles that look at nobody.
    "page": {
        "mapInfo": {"mapName": "town"},
        "egoVehicle": {"initPosition": _at(-86.0, -5.25), "gear": 4},
        "vehicleList": [
            {"UNIQUEID": 7, "modelName": "2015_Kia_K5", "initPosition": _at(0.0, 500.0), "constantVelocity": 36},
            {"UNIQUEID": 8, "modelName": "Bus", "initPosition": _at(40.0, 500.0)},
            {"UNIQUEID": 9, "initPosition": _ON_LANE, "velocityType": 1, "isWaypointMode": False},
        ],
        "pedestrianList": [{"UNIQUEID": 12, "pos": {"x": 50.0, "y": 300.0}, "rot": {"yaw": 90}, "speed": 5.4}],
        "objectList": [{"UNIQUEID": 15, "modelName": "Road_Barrier", "pos": {"x": 300.0, "y": 300.0}}],
        "tlList": [{"index": f"IntTL{i}", "state": 0, "deltaTime": 0.0} for i in range(21)],
    },
    "elsewhere": {
        "mapInfo": {"mapName": "town"},
        "egoVehicle": {"modelName": "Hyundai_Ioniq_5", "initPosition": _at(-5.25, 60.0, -90.0), "gear": 1},
        "vehicleList": [{"initPosition": _at(100.0, 500.0)}],
        "pedestrianList": [{"pos": {"x": 60.0, "y": 300.0}}, {"pos": {"x": 70.0, "y": 300.0}}],
        "objectList": [{"pos": {"x": 80.0, "y": 300.0}}],
    },
    "motorway": {"mapInfo": {"mapName": "loop"}, "egoVehicle": {"initPosition": _at(0.0, 0.0)}},
}


def write_scenes(folder: Path) -> None:
    """Write the scenario files that rows load by name."""
    for name, scene in SCENES.items():
        (folder / f"{name}.json").write_text(json.dumps(scene))


@dataclass(frozen=True, slots=True)
class Row:
    """One topic or service.

    Attributes:
        name: as the manual has it.
        done: what is done to the world.
        seen: what is seen of it.
        act: does it, and asserts that it is so.
        releases: those that have it.
    """

    name: str
    done: str
    seen: str
    act: Callable[[SceneClient], Awaitable[None]]
    releases: tuple[str, ...]


BOTH: Final = ("22.R2", "26.R1")

Act = Callable[["SceneClient"], Awaitable[None]]


class Table(list[Row]):
    """Rows, each written above what it does."""

    def row(self, name: str, *, done: str, seen: str, releases: tuple[str, ...] = BOTH) -> Callable[[Act], Act]:
        """Make what follows a row."""

        def add(act: Act) -> Act:
            self.append(Row(name, done, seen, act, releases))
            return act

        return add


class SceneClient:
    """A client on the stage.

    Attributes:
        client: its socket.
        release: of the simulator.
        is_attached: a bridge stands between: it knows nothing of the simulator's time, and tells nobody's mistakes.
        data: the folder that the server writes to.
        frame: the world's after the last tick.
        step: of a tick [s].
    """

    def __init__(self, client: Client, release: str, data: Path, *, is_attached: bool = False) -> None:
        self.client = client
        self.release = release
        self.is_attached = is_attached
        self.data = data
        self.frame = 0
        self.step = 0.02

    async def begin(self) -> None:
        """Be the master of the opening scene at frame 0."""
        await self.lead()
        await self.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
        await self.client.values("/sim/reset", {"seed": 0})
        self.frame = 0
        self.client.inbox.clear()

    async def lead(self, step_ms: int = 20) -> None:
        """Turn synchronous mode on, or choose another step."""
        answer = await self.ask("/SyncModeCmd", user_id=ME, start_sync_mode=True, time_step=step_ms)
        assert answer["result"] is True
        self.frame, self.step = answer["frame"], step_ms / 1000.0

    async def let_go(self) -> None:
        """Turn it off: real time."""
        assert (await self.ask("/SyncModeCmd", user_id=ME, start_sync_mode=False, time_step=20))["result"] is True

    async def ask(self, service: str, **request: object) -> Message:
        """Call a service of the simulator."""
        return await self.client.ask(service, **request)

    async def send(self, topic: str, **message: object) -> None:
        """Publish, and come back once it was heard; a mistake would be told by a status."""
        await self.client.send("publish", topic=topic, msg=message)
        told = [frame for frame in await self._settle() if frame["op"] == "status"]
        assert not told, told

    async def send_badly(self, topic: str, expected: str, **message: object) -> None:
        """Publish something that is refused, with a text that has the expected one in it, if it is told at all."""
        await self.client.send("publish", topic=topic, msg=message)
        told = [frame["msg"] for frame in await self._settle() if frame["op"] == "status"]
        assert [expected in text for text in told] == ([] if self.is_attached else [True]), told

    async def _settle(self) -> list[Message]:
        """What came until all that was sent has been heard; topics' messages stay in the inbox."""
        if self.is_attached:  # it is not the bridge that must have heard it
            await self.ask("/Service_MoraiVehicleSpec", unique_id=0)
        frames = await self.client.settle()
        self.client.inbox.extend(frame for frame in frames if frame["op"] == "publish")
        return frames

    # Time

    async def tick(self, seconds: float = 0.02) -> Message:
        """Let so much simulated time pass, a step at least; the ego's status after it.

        What topics have said before is forgotten.
        """
        self.client.inbox.clear()
        answer: Message = {}
        for _ in range(max(1, round(seconds / self.step))):
            answer = await self.ask("/SyncModeWaitForTick", user_id=ME, frame=self.frame + 1)
            assert answer["tick_status"] is True
            self.frame = answer["frame"]
        status: Message = answer["vehicle_status"]
        return status

    async def control(self, **command: float) -> None:
        """Drive like this from the next frame on; `steering` by the name that the release has for it."""
        named = {self.steering if key == "steering" else key: value for key, value in command.items()}
        assert (await self.ask("/SyncModeCtrlCmd", frame=self.frame + 1, command=named))["result"] is True

    @property
    def steering(self) -> str:
        """What CtrlCmd calls the front wheels."""
        return "steering" if self.release == "22.R2" else "front_steer"

    # Topics

    async def listen(self, *topics: str) -> None:
        """Subscribe."""
        for topic in topics:
            await self.client.subscribe(topic)

    def heard(self, topic: str) -> list[Message]:
        """What a topic has said during the last `tick`, the oldest first."""
        return [frame["msg"] for frame in self.client.inbox if frame["op"] == "publish" and frame["topic"] == topic]

    def last(self, topic: str) -> Message:
        """What it said last."""
        return self.heard(topic)[-1]

    # What many rows do

    async def put(self, x: float, y: float, yaw_deg: float = 0.0, *, velocity_kmh: float = 0.0, ego: int = 0) -> None:
        """Have an ego stand somewhere, in D."""
        await self.send(
            "/ego_setting",
            number_of_ego_vehicle=1,
            camera_index=ego,
            ego_index=[ego],
            global_position_x=[x],
            global_position_y=[y],
            global_position_z=[0.0],
            global_roll=[0.0],
            global_pitch=[0.0],
            global_yaw=[yaw_deg],
            velocity=[velocity_kmh],
            gear=[4],
            ctrl_mode=[16],
        )

    async def light(self, index: str) -> int:
        """What a traffic light shows."""
        status: int = (await self.ask("/Morai_TLSrv", idx=index))["status"]
        return status

    async def objects(self) -> dict[int, Message]:
        """Everybody but the egos, by their ids, one frame on. Of /Object_topic, which must have been subscribed."""
        await self.tick()
        said = self.last("/Object_topic")
        return {one["unique_id"]: one for one in said["npc_list"] + said["pedestrian_list"] + said["obstacle_list"]}
