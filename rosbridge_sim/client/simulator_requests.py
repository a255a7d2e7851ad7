"""Requests to the simulator: synchronous mode, steps, snapshots, objects, roads and scores.

`SimulatorRequests` needs a client that calls services, and `AsyncClient` is one. So the connection and the services of
the simulator are two subjects in two files.
"""

from __future__ import annotations

import asyncio
import base64
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Unpack

import orjson

from rosbridge_sim.client.frames import Frame
from rosbridge_sim.client.objects import (
    ObjectChange,
    ObjectOptions,
    RoadPoint,
    change_request,
    place_request,
    spawn_request,
)
from rosbridge_sim.client.results import RealTimeFactor, Snapshot, Steps, Tick
from rosbridge_sim.errors import ClientError, ServiceRefusedError

DEFAULT_USER_ID = "rosbridge_sim.client"
"""Default name of the client as master of synchronous mode."""

FRAME_MS = 20
"""Simulated time of one frame [ms]; a tick is a multiple of it."""

Command = Mapping[str, object]
"""The fields of a `morai_msgs/CtrlCmd` by name; those that are left out are 0."""

StopCondition = Literal["collision", "red_light", "off_road"]
"""An event of an ego that ends a call of `step`."""
_STOP_FIELDS: Final[Mapping[StopCondition, str]] = {
    "collision": "stop_on_collision",
    "red_light": "stop_on_red_light",
    "off_road": "stop_off_road",
}


@dataclass(slots=True)
class _SyncMode:
    """Settings of synchronous mode while this client is its master."""

    user_id: str
    step_ms: int
    frame: int
    is_member: bool = False  # of a barrier, in place of the master


class SimulatorRequests(ABC):
    """The services of a simulator, for a client that can call services."""

    def __init__(self) -> None:
        self._sync: _SyncMode | None = None
        self._ticking = asyncio.Lock()

    @abstractmethod
    async def call(self, service: str, args: object = None, *, timeout: float | None = None) -> Frame:
        """Call a service and return its response; see `AsyncClient.call`."""

    @abstractmethod
    async def _ask_sync(
        self, key: str, service: str, request: Mapping[str, object], timeout: float | None = None
    ) -> Frame:
        """Call a service of synchronous mode and return its response; one of its fields says if the request was done.

        Raises:
            ServiceRefusedError: the request was not done. The reason comes from the server's status message, because
                the response has none.
        """

    # Objects and roads

    async def spawn(self, model: str = "", *, timeout: float | None = None, **options: Unpack[ObjectOptions]) -> int:
        """Place one object into the world, between two frames; return its number.

        Args:
            model: name, as `catalogue` has it; empty for an ego like the first one, or with `data_id`.
            timeout: longest wait [s].
            options: place (`x`, `y`, `heading_deg`, or `link`, `distance`), `speed`, `behaviour`, `route`, `path`,
                `is_ego` and the other fields of `rosbridge_sim_msgs/SpawnObject`. Points of a path are `(x, y)` or
                `(x, y, z)` [m].

        Raises:
            TypeError: an argument that there is not, or no place.
            ServiceRefusedError: it cannot be placed; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        (unique_id,) = await self.spawn_all([spawn_request(model, **options)], timeout=timeout)
        return unique_id

    async def spawn_all(self, objects: Sequence[Mapping[str, object]], *, timeout: float | None = None) -> list[int]:
        """Place several objects, all or none; return their numbers. Errors as for `spawn`.

        Args:
            objects: the fields of a `rosbridge_sim_msgs/SpawnObject` each.
            timeout: longest wait [s].
        """
        values = await self._call_sim("/sim/spawn", {"objects": list(objects)}, timeout)
        return [int(number) for number in values["unique_ids"]]

    async def remove(self, *unique_ids: int, timeout: float | None = None) -> None:
        """Take objects or further egos out of the world, all or none, between two frames. Errors as for `spawn`."""
        await self._call_sim("/sim/remove", {"unique_ids": list(unique_ids)}, timeout)

    async def set_object(
        self, unique_id: int, *, timeout: float | None = None, **options: Unpack[ObjectChange]
    ) -> None:
        """Change one object or ego, between two frames. What is not given stays. Errors as for `spawn`.

        Args:
            unique_id: its number; 0 is the first ego.
            timeout: longest wait [s].
            options: place, `speed`, `behaviour`, `route`, `path`, and of an ego `gear`, `ctrl_mode`, `turn_signal`,
                `emergency_signal`: the fields of `rosbridge_sim_msgs/ObjectState`, without its flags.
        """
        await self.set_objects([change_request(unique_id, **options)], timeout=timeout)

    async def set_objects(self, objects: Sequence[Mapping[str, object]], *, timeout: float | None = None) -> None:
        """Change several objects, all or none. Errors as for `spawn`.

        Args:
            objects: the fields of a `rosbridge_sim_msgs/ObjectState` each, with its flags.
            timeout: longest wait [s].
        """
        await self._call_sim("/sim/set", {"objects": list(objects)}, timeout)

    async def catalogue(self, *, timeout: float | None = None) -> list[Frame]:
        """Return the models that can be placed, a `rosbridge_sim_msgs/ModelInfo` each. Errors as for `call`."""
        models = (await self.call("/sim/catalogue", timeout=timeout)).get("models")
        return list(models) if isinstance(models, list) else []

    async def describe(self, number: int, *, timeout: float | None = None) -> Frame:
        """Return what an entity is and does: the fields of a response of `/sim/describe`. Errors as for `spawn`.

        Args:
            number: of an ego or of an object, as in `/sim/scene/state`.
            timeout: longest wait [s].
        """
        return await self._call_sim("/sim/describe", {"id": number}, timeout)

    async def scenarios(self, *, timeout: float | None = None) -> list[Frame]:
        """Return the scenarios that can be loaded, a `rosbridge_sim_msgs/ScenarioInfo` each. Errors as for `spawn`.

        Args:
            timeout: longest wait for each page [s].
        """
        found: list[Frame] = []
        while True:
            page = await self._call_sim("/sim/scenarios", {"first": len(found)}, timeout)
            found += page["scenarios"]
            if not page["scenarios"] or len(found) >= int(page["num_scenarios"]):
                return found

    async def scenario_picture(
        self, name: str, *, width: int = 0, height: int = 0, timeout: float | None = None
    ) -> bytes:
        """Return the picture of a scenario on its map, as a PNG file. Errors as for `spawn`.

        Args:
            width: 64 to 1024; 0 for 320 [px].
            height: 64 to 1024; 0 for 200 [px].
            timeout: longest wait [s].
        """
        request = {"name": name, "width": width, "height": height}
        return base64.b64decode((await self._call_sim("/sim/scenario_picture", request, timeout))["data"])

    async def map(self, *, timeout: float | None = None) -> Frame:
        """Return all that a drawing of the map needs: what `/map.json` has. Errors as for `spawn`.

        Args:
            timeout: longest wait for each page [s].
        """
        whole = await self._call_sim("/sim/map", {"page": 0}, timeout)
        missing = [key for key in ("page", "num_pages", "digest") if key not in whole]
        if missing:
            why = f"expected a page of a map with {', '.join(missing)}; is this server a rosbridge-sim of this version?"
            raise ServiceRefusedError("/sim/map", why, whole)
        while (number := int(whole["page"]) + 1) < int(whole["num_pages"]):
            page = await self._call_sim("/sim/map", {"page": number}, timeout)
            if page["digest"] != whole["digest"]:
                raise ServiceRefusedError("/sim/map", "the map has changed while it was read; ask again", page)
            whole = {key: value + page[key] if isinstance(value, list) else page[key] for key, value in whole.items()}
        return {**whole, "page": 0, "num_pages": 1}

    async def route(self, start: RoadPoint, goal: RoadPoint, *, timeout: float | None = None) -> Frame:
        """Return the shortest way along the links: `links`, `points` and `length_m`. Errors as for `spawn`.

        Args:
            start: a link, `(link, distance)`, `(x, y)` or `(x, y, heading_deg)` [m, deg].
            timeout: longest wait [s].
        """
        return await self._call_sim("/sim/route", {"start": place_request(start), "goal": place_request(goal)}, timeout)

    async def nearest_lane(
        self, x: float, y: float, heading_deg: float | None = None, *, timeout: float | None = None
    ) -> Frame:
        """Return the lane nearest to a point: `link`, `distance`, `lateral`, `is_on_road` and more. Errors as above.

        Args:
            x: in the map's frame, east [m].
            y: in the map's frame, north [m].
            heading_deg: lanes of another direction count as farther away [deg]; None compares distances alone.
            timeout: longest wait [s].
        """
        request: Frame = {"x": x, "y": y}
        if heading_deg is not None:
            request |= {"use_heading": True, "heading_deg": heading_deg}
        return await self._call_sim("/sim/nearest_lane", request, timeout)

    # Synchronous mode

    async def start_sync(self, *, user_id: str = DEFAULT_USER_ID, step_ms: int = FRAME_MS) -> int:
        """Start synchronous mode with this client as its master; return the current frame number.

        Args:
            step_ms: simulated time of a tick: a multiple of 20 [ms].

        Returns:
            Number of the frame at which the world has stopped.

        Raises:
            ServiceRefusedError: there is another master, or the mode cannot be started; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        response = await self._ask_sync("result", "/SyncModeCmd", _sync_command(user_id, step_ms, is_on=True))
        self._sync = _SyncMode(user_id, step_ms, int(response.get("frame", 0)))
        return self._sync.frame

    async def stop_sync(self) -> None:
        """End synchronous mode: the world goes on in real time. Do nothing if this client has not started it.

        Raises:
            ServiceRefusedError: the simulator refuses; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if self._sync is not None:
            await self._ask_sync("result", "/SyncModeCmd", _sync_command(self._sync.user_id, self._sync.step_ms))
            self._sync = None

    async def tick(self, n: int = 1, *, timeout: float | None = None) -> Tick:
        """Move the world by `n` ticks. Ticks of several tasks do not overlap.

        Args:
            n: number of ticks, at least 1.
            timeout: longest wait for each tick [s].

        Returns:
            The simulation after the last tick.

        Raises:
            ValueError: `n` is less than 1.
            ClientError: synchronous mode was not started.
            ServiceRefusedError: the tick is refused; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if n < 1:
            raise ValueError(f"tick: expected a number from 1 on; got {n}")
        async with self._ticking:
            sync = self._sync
            if sync is None:
                raise ClientError("tick: expected synchronous mode; call start_sync() first, or join_barrier()")
            for _ in range(n):
                request = {"user_id": sync.user_id, "frame": sync.frame + sync.step_ms // FRAME_MS}
                response = await self._ask_sync("tick_status", "/SyncModeWaitForTick", request, timeout)
                sync.frame = int(response.get("frame", 0))
        return Tick(sync.frame, float(response.get("time") or "nan"), response.get("vehicle_status", {}))

    async def step(
        self,
        n: int = 1,
        *,
        commands: Mapping[int, Command | Sequence[Command]] | None = None,
        topics: Sequence[str] = (),
        stop_on: Sequence[StopCondition] = (),
        stop_after_m: float = 0.0,
        stop_at: tuple[float, float, float] | None = None,
        timeout: float | None = None,
    ) -> Steps:
        """Move the world by several ticks in one call of `/sim/step`, which a server of this project has.

        Args:
            n: number of ticks, 1 to 1,000.
            commands: number of an ego -> its command for all ticks, or a list with one for each tick.
            topics: topics of the simulator whose last message is wanted.
            stop_on: events that end the call.
            stop_after_m: end the call when an ego has driven so far in it [m]; 0 for no limit.
            stop_at: (x, y, radius), map frame [m]: end the call when an ego is within the radius; None for no place.
            timeout: longest wait [s].

        Raises:
            ClientError: synchronous mode was not started.
            ServiceRefusedError: the call is refused, or was interrupted by another client; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        x, y, radius = stop_at or (0.0, 0.0, 0.0)
        request: Frame = {
            "n": n,
            "commands": [
                {"ego": ego, "commands": [given] if isinstance(given, Mapping) else list(given)}
                for ego, given in (commands or {}).items()
            ],
            "topics": list(topics),
            **{_STOP_FIELDS[condition]: True for condition in stop_on},
            "stop_after_m": stop_after_m,
            "stop_at_x": x,
            "stop_at_y": y,
            "stop_within_m": radius,
        }
        async with self._ticking:
            sync = self._sync
            if sync is None:
                raise ClientError("step: expected synchronous mode; call start_sync() first")
            values = await self.call("/sim/step", {"user_id": sync.user_id, **request}, timeout=timeout)
            sync.frame = int(values.get("frame", sync.frame))
        if values.get("result") is not True:
            raise ServiceRefusedError("/sim/step", str(values.get("message", "")), values)
        samples = {sample["topic"]: sample["message"] for sample in values["topics"]}
        return Steps(
            values["frame"],
            values["steps"],
            values["stopped_by"],
            values["egos"],
            {topic: orjson.loads(text) if text else None for topic, text in samples.items()},
        )

    async def real_time_factor(self, factor: float | None = None, *, timeout: float | None = None) -> RealTimeFactor:
        """Set how fast the world runs while real time moves it, or ask for it.

        Args:
            factor: simulated seconds in a second, 0.1 to 20; 0 for as fast as possible; None only asks.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: the factor cannot be had; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        request = {"factor": -1.0 if factor is None else factor}
        values = await self._call_sim("/sim/real_time_factor", request, timeout)
        return RealTimeFactor(values["factor"], values["measured"])

    # Snapshots

    async def snapshot(self, name: str = "", *, with_data: bool = False, timeout: float | None = None) -> Snapshot:
        """Save the state of the whole simulator; return what was saved.

        Args:
            name: of the snapshot; a name that is taken gets the new one; empty lets the server choose.
            with_data: return its bytes, too, which another process can restore.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: there is no room, or it cannot be saved now; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        answer = await self._call_sim("/sim/snapshot", {"id": name, "with_data": with_data}, timeout)
        return _snapshot_of(answer, base64.b64decode(str(answer.get("data", ""))))

    async def restore(self, saved: str | bytes | Snapshot, *, timeout: float | None = None) -> int:
        """Return the simulator to a snapshot; return the frame that the world stands at.

        In synchronous mode only its master may do so: the client that has called `start_sync`.

        Args:
            saved: what `snapshot` returned, or its name or bytes. A snapshot with bytes is sent as these.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: there is no such snapshot, or it cannot be restored; the error has the reason, and
                nothing has changed.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if isinstance(saved, Snapshot):
            saved = saved.data or saved.name
        sync = self._sync
        request: dict[str, object] = {"user_id": DEFAULT_USER_ID if sync is None else sync.user_id}
        if isinstance(saved, bytes):
            request["data"] = base64.b64encode(saved).decode()
        else:
            request["id"] = saved
        frame = int((await self._call_sim("/sim/restore", request, timeout)).get("frame", 0))
        if sync is not None:
            sync.frame = frame
        return frame

    async def snapshots(self, *, remove: Sequence[str] = (), timeout: float | None = None) -> list[Snapshot]:
        """Return the snapshots that the server keeps, oldest first, without their bytes.

        Args:
            remove: names of snapshots that it shall keep no longer.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: one of these names is not there; none was removed.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        answer = await self._call_sim("/sim/snapshots", {"remove": list(remove)}, timeout)
        return [_snapshot_of(one) for one in answer.get("snapshots", ())]

    async def state_hash(self, *, timeout: float | None = None) -> str:
        """Return a hash of all that decides what the simulator will do: equal states have equal hashes.

        Args:
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: there is no such service.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        return str((await self.call("/sim/state_hash", timeout=timeout)).get("hash", ""))

    @property
    def next_frame(self) -> int:
        """Number of the frame that the next tick leads to, for requests that name a frame; 0 without `start_sync`."""
        return 0 if self._sync is None else self._sync.frame + self._sync.step_ms // FRAME_MS

    # Barrier and scores

    async def join_barrier(
        self, *, user_id: str = "", step_ms: int = 0, deadline: float = 0.0, timeout: float | None = None
    ) -> int:
        """Tick together with other clients; return the frame that the world stands at.

        The world moves when all members have called `tick`, or when the deadline has passed. The first member starts
        synchronous mode, and its `step_ms` and `deadline` hold for all.

        Args:
            user_id: name of the member; the server makes one if it is empty.
            step_ms: how far a tick of all moves the world, a multiple of 20; 0: that of the first member, or 20 [ms].
            deadline: longest wait for the others, from 0.01 to 60; 0 takes that of the first member, or 1 [s].
            timeout: longest wait for the answer [s].

        Raises:
            ServiceRefusedError: there is a master, or the first member has chosen otherwise; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        request = {"user_id": user_id, "time_step": step_ms, "deadline_s": deadline}
        values = await self._call_sim("/sim/barrier/join", request, timeout)
        self._sync = _SyncMode(str(values["user_id"]), int(values["time_step"]), int(values["frame"]), is_member=True)
        return self._sync.frame

    async def leave_barrier(self, *, timeout: float | None = None) -> None:
        """Leave the barrier; the last member ends synchronous mode. Nothing if this client is no member.

        Args:
            timeout: longest wait for the answer [s].

        Raises:
            ServiceRefusedError: the simulator says no; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if self._sync is not None and self._sync.is_member:
            await self._call_sim("/sim/barrier/leave", {"user_id": self._sync.user_id}, timeout)
            self._sync = None

    async def score(self, *, reset: bool = False, timeout: float | None = None) -> list[Frame]:
        """Return the scores of all egos, each a `rosbridge_sim_msgs/EgoScore`; the first call begins to keep them.

        Args:
            reset: all counts begin anew now; what is returned was counted until now.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: the simulator says no; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        values = await self.call("/sim/score", {"reset": reset}, timeout=timeout)
        return list(values.get("scores", ()))

    async def _call_sim(self, service: str, args: Mapping[str, object], timeout: float | None) -> Frame:
        """Return the response of a service of ours, which begins with `result` and `message`.

        Raises:
            ServiceRefusedError: its result is false.
        """
        values = await self.call(service, args, timeout=timeout)
        if values.get("result") is not True:
            raise ServiceRefusedError(service, str(values.get("message", "")), values)
        return values


def _snapshot_of(values: Frame, data: bytes = b"") -> Snapshot:
    return Snapshot(
        str(values.get("id", "")),
        int(values.get("frame", 0)),
        int(values.get("size", 0)),
        str(values.get("state_hash", "")),
        data,
    )


def _sync_command(user_id: str, step_ms: int, *, is_on: bool = False) -> Frame:
    return {"user_id": user_id, "start_sync_mode": is_on, "time_step": step_ms}
