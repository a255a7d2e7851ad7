"""The component of `/sim/spawn`, `/sim/remove`, `/sim/set` and `/sim/catalogue`.

Each call is wholly done or not at all, at once: between two frames, in synchronous mode and in real time. So a program
that ticks knows at which frame it acts, and the same calls between the same ticks give the same bytes. A call that
comes within a frame is refused, since a listener of the frame's topics could make it. So is one that comes while a tick
waits for a scenario that is being read, between the frames of a `/sim/step`, or during a replay. The component holds no
state.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final, TypeVar

from rosbridge_sim.errors import FieldError, GraphError, PeerError, Reason
from rosbridge_sim.graph.topics_services import BodyLimits, Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.command_parsing import EgoSetting, GhostPose
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.scenario import Spawn
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import CtrlMode, Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.scene.scene_commands import moves
from rosbridge_sim.simulator.scene.scene_limits import MAX_ENTITIES
from rosbridge_sim.simulator.sim_services.object_parsing import (
    Behaviour,
    Change,
    NewObject,
    ObjectMotion,
    Spot,
    can_be_ego,
    check_size,
    read_change,
    read_new_object,
    take_lane,
)
from rosbridge_sim.simulator.sync.sync_table import SyncState
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.state import placement
from rosbridge_sim.world.state.commands import speed_in_gear
from rosbridge_sim.world.state.world import Gear, Kind

T = TypeVar("T")

MAX_REMOVED: Final = 500
"""Objects that one call removes: they take at most 5 ms."""

MAX_PATH_SEGMENTS: Final = 200_000
"""Segments of all paths in the world after a call: 18 MB, and a snapshot of them takes some 10 ms."""

_LIMITS: Final = BodyLimits(num_bytes=512 * 1024, containers=5_000, texts=15_000, values=15_000)
"""Of a request with as many objects, points and links as `object_parsing` permits: 0.3 MB, 3,000 objects and lists."""

MAX_ROUTE_LINKS: Final = 200_000
"""Links of all routes in the world after a call: 1.6 MB, and putting them together some 1 ms."""

_log = logging.getLogger("rosbridge_sim.morai")


_Act = Callable[[Call, float], dict[str, Any]]
"""Does what a call asks for; returns the fields of the response beside `result` and `message`."""


class Population(Component):
    """The component of objects: what comes, goes and is changed by services."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._make_model = context.maker(
            "rosbridge_sim_msgs/ModelInfo",
            "name kind is_own can_be_ego data_ids length width height wheelbase front_overhang rear_overhang "
            "max_steer_deg max_accel max_decel mass",
        )

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/spawn", "rosbridge_sim_msgs/Spawn", partial(self._answer, self._spawn), limits=_LIMITS)
        bindings.provide("sim/remove", "rosbridge_sim_msgs/Remove", partial(self._answer, self._remove))
        bindings.provide("sim/set", "rosbridge_sim_msgs/Set", partial(self._answer, self._set), limits=_LIMITS)
        bindings.provide("sim/catalogue", "rosbridge_sim_msgs/Catalogue", self._list_models)

    def _answer(self, act: _Act, call: Call, now: float) -> None:
        """Do what a call asks for and answer it, or say why not; if a tick has begun, behind that tick.

        Args:
            act: does it.
        """

        def do(_now: float) -> None:
            why = self._context.failure.why
            if call.is_done:  # the caller has left meanwhile
                return
            if why is not None:
                call.refuse(why)
            else:
                self._answer_now(act, call, now)

        def do_later(now: float) -> None:
            self._context.bus.guard.attempt("a call that waited for a tick", do, now)

        if not self._context.sync_driver.wait_for_tick(call.caller, do_later):
            self._answer_now(act, call, now)

    def _answer_now(self, act: _Act, call: Call, now: float) -> None:
        fields: dict[str, Any] = {}
        why = ""
        try:
            self._check_now()
            fields = act(call, now)
        except PeerError as error:
            why = str(error)
            level = "warning" if error.reason is Reason.NOT_NOW else "error"
            call.explain(why, error.reason, level)
        call.respond(result=not why, message=why, **fields)

    def _check_now(self) -> None:
        """Check that the world may be changed now.

        Raises:
            GraphError: it may not.
        """
        context = self._context
        if context.stepper.is_moving:
            raise GraphError("a frame is being computed; call between two ticks", reason=Reason.NOT_NOW)
        if context.sync.state is SyncState.WAITING:
            text = "a tick or a /sim/step is under way; call after its answer"
            raise GraphError(text, reason=Reason.NOT_NOW)
        if context.scene.is_replaying:
            raise GraphError("a recording is replayed; stop it by /Morai_SimProc first", reason=Reason.NOT_NOW)

    def _check_room(self) -> None:
        """Check that paths and routes of the world are within bounds.

        Raises:
            FieldError: they are not.
        """
        world = self._context.world
        if world.paths.num_live > MAX_PATH_SEGMENTS:
            raise FieldError(
                f"objects: the paths in the world have {MAX_PATH_SEGMENTS:,} segments at most; remove some"
            )
        if sum(map(len, world.routes.values())) > MAX_ROUTE_LINKS:
            raise FieldError(f"objects: the routes in the world have {MAX_ROUTE_LINKS:,} links at most; remove some")

    # Spawn

    def _spawn(self, call: Call, now: float) -> dict[str, Any]:
        """Place all objects, or raise PeerError and leave the world as it was."""
        request: Any = call.request
        context, messages = self._context, request.objects
        scene, roads = context.scene, context.world.roads
        check_size(messages)
        if len(context.world) + len(messages) > MAX_ENTITIES:
            raise FieldError(f"objects: the world holds {MAX_ENTITIES:,} at most; {len(context.world):,} are there")
        objects = [
            read_new_object(message, f"objects[{i}]", roads, scene.catalogue) for i, message in enumerate(messages)
        ]
        # What may be refused for lack of a lane is refused before any ego has come, with its topics.
        lanes = [
            take_lane(roads, each.spot, each.motion.route, each.where)
            if each.motion.behaviour is Behaviour.LANE
            else None
            for each in objects
        ]
        ids = [0] * len(objects)
        added: list[Ego] = []
        with scene.all_or_none():
            try:
                with context.world.room_for(len(objects)):
                    for i, each in enumerate(objects):
                        if not each.is_ego:
                            ids[i] = self._add_agent(each)
                self._keep_lanes(
                    (context.world.row(ids[i]), each.motion, lane)
                    for i, (each, lane) in enumerate(zip(objects, lanes, strict=True))
                    if lane is not None and not each.is_ego
                )
                self._check_room()
                new_egos = [i for i, each in enumerate(objects) if each.is_ego]
                for i in new_egos:
                    ego = self._add_ego(objects[i], now, is_last=i == new_egos[-1])
                    added.append(ego)
                    ids[i] = ego.index
                    self._try(objects[i].where, partial(self._settle_ego, ego, objects[i]))
                self._check_room()
            except BaseException:
                if added:
                    context.scene_changes.drop_egos(added, now)
                raise
        context.egos.forget_statuses()
        _log.info("%d objects were spawned by %s", len(ids), call.caller.name)
        return {"unique_ids": ids}

    def _add_agent(self, new: NewObject) -> int:
        """Put an object that is no ego into the world; return its number. A driver gets its lane later."""
        assert new.model is not None, "only an ego has none"
        motion, spot = new.motion, new.spot
        spawn = Spawn(
            *(new.model.kind, new.model, new.model.name, None, spot.x, spot.y, spot.z, spot.yaw, new.speed),
            path=motion.path,
            is_loop=motion.path is not None and motion.is_loop,
            start_within=new.start_within,
        )
        return self._try(new.where, lambda: self._context.scene.add_agent(spawn))

    def _add_ego(self, new: NewObject, now: float, *, is_last: bool) -> Ego:
        """Bring a further ego, with its topics and services.

        Raises:
            FieldError: its number is taken, or there are too many egos.
            GraphError: a client has given one of its topics another type.
        """
        context = self._context
        scene, egos = context.scene, context.egos
        index = new.ego_index
        if index == 0:
            index = scene.choose_ego_index([ego.index for ego in egos])
        elif egos.find(index) is not None:
            raise FieldError(f"{new.where}.ego_index: ego {index} is there already; expected another number, or 0")
        elif index in context.world:
            raise FieldError(f"{new.where}.ego_index: {index} is an object's number; expected another one, or 0")
        scene.keep_free(index)
        setting = EgoSetting(index, _pose_of(new.spot, new.speed), None, CtrlMode.EXTERNAL, model=new.model)
        try:
            context.scene_changes.add_egos([setting], now, is_last=is_last)
        except PeerError as error:
            raise type(error)(f"{new.where}: {error}", reason=error.reason) from None
        ego = egos.find(index)
        assert ego is not None, "it has come"
        return ego

    def _settle_ego(self, ego: Ego, new: NewObject) -> None:
        """Give a new ego its speed, and have it drive itself if it is to.

        Raises:
            ValueError, FieldError: it cannot be so.
        """
        is_driving = new.motion.behaviour is Behaviour.LANE
        gear = Gear.DRIVE if is_driving else ego.gear
        ego.teleport(_pose_of(new.spot, speed_in_gear(new.speed, gear)), gear)
        if is_driving:
            self._drive_itself(ego, new.motion, new.where)

    # Remove

    def _remove(self, call: Call, now: float) -> dict[str, Any]:
        """Remove all objects, or raise FieldError and leave the world as it was."""
        request: Any = call.request
        context, unique_ids = self._context, list(request.unique_ids)
        if len(unique_ids) > MAX_REMOVED:
            raise FieldError(f"unique_ids: expected at most {MAX_REMOVED} in one call, got {len(unique_ids):,}")
        found = [self._find(number, f"unique_ids[{i}]") for i, number in enumerate(unique_ids)]
        egos = [each for each in found if isinstance(each, Ego)]
        if context.egos.first in egos:
            i = found.index(context.egos.first)
            raise FieldError(f"unique_ids[{i}]: the first ego cannot be removed")
        if len(set(found)) < len(found):
            raise FieldError("unique_ids: an object is named twice")
        if egos:
            context.scene_changes.drop_egos(egos, now)
        for each in found:
            if not isinstance(each, Ego):
                context.world.remove(each)
        context.egos.forget_statuses()
        _log.info("%d objects were removed by %s", len(found), call.caller.name)
        return {}

    def _find(self, unique_id: int, where: str) -> Ego | int:
        """Return the ego that a number means, else the id of the object in the world. A number of both is the ego's.

        Raises:
            FieldError: it is nothing's.
        """
        context = self._context
        ego = context.egos.find(unique_id)
        if ego is not None:
            return ego
        world = context.world
        if unique_id not in world or world.kind[world.row(unique_id)] == Kind.EGO:  # an ego has another number here
            raise FieldError(f"{where}: there is no object {unique_id}")
        return unique_id

    # Set

    def _set(self, call: Call, _now: float) -> dict[str, Any]:
        """Change all objects, or raise PeerError and leave all as it was."""
        request: Any = call.request
        context, messages = self._context, request.objects
        world, roads = context.world, context.world.roads
        check_size(messages)
        found: list[Ego | int] = []
        changes: list[Change] = []
        for i, message in enumerate(messages):
            each = self._find(message.unique_id, f"objects[{i}].unique_id")
            row = each.row if isinstance(each, Ego) else world.row(each)
            found.append(each)
            changes.append(read_change(message, f"objects[{i}]", roads, Kind(world.kind.item(row))))
        if len(set(found)) < len(found):
            raise FieldError("objects: an object is named twice")
        before = [(ego, ego.ctrl_mode, ego.lamps) for ego in found if isinstance(ego, Ego)]
        with context.scene.all_or_none():
            try:
                drivers = []
                for each, change in zip(found, changes, strict=True):
                    if isinstance(each, Ego):
                        self._try(change.where, partial(self._change_ego, each, change))
                        continue
                    row = world.row(each)
                    lane = self._try(change.where, partial(self._change_object, row, change))
                    if change.motion is not None and lane is not None:
                        drivers.append((row, change.motion, lane))
                self._keep_lanes(drivers)
                self._check_room()
            except BaseException:
                for ego, ctrl_mode, lamps in before:
                    ego.ctrl_mode = ctrl_mode
                    ego.turn_signal, ego.emergency_signal = lamps
                raise
            finally:
                context.egos.forget_statuses()
        for each, change in zip(found, changes, strict=True):
            if isinstance(each, Ego) and change.spot is not None:  # as /ego_setting does
                context.sync.drop(partial(moves, uid=each.uid))
        _log.debug("%d objects were changed by %s", len(found), call.caller.name)
        return {}

    def _change_object(self, row: int, change: Change) -> tuple[int, float] | None:
        """Change an object that is no ego; return the place on a lane that it is still to get, if it is a driver.

        Raises:
            ValueError, FieldError: it cannot be so. It is changed by half.
        """
        world, spot, motion = self._context.world, change.spot, change.motion
        lane: tuple[int, float] | None = None
        if motion is not None and motion.behaviour is Behaviour.LANE:
            lane = self._lane_of(row, spot, motion, change.where)
        is_leaving = spot is not None or (
            motion is not None and motion.behaviour in {Behaviour.STAND, Behaviour.STRAIGHT}
        )
        if motion is not None and motion.behaviour is Behaviour.STAND:
            change = replace(change, speed=0.0)
        if is_leaving:
            here = spot or self._spot_of(row)
            roll, pitch = (0.0, 0.0) if spot else (world.roll.item(row), world.pitch.item(row))
            speed = world.speed.item(row) if change.speed is None else change.speed
            placement.teleport(
                world, row, x=here.x, y=here.y, z=here.z, yaw=here.yaw, speed=speed, roll=roll, pitch=pitch
            )
        elif change.speed is not None:
            placement.set_speed(world, row, change.speed)
        if motion is not None and motion.behaviour in {Behaviour.PATH, Behaviour.LANE}:
            placement.set_speed(world, row, world.speed.item(row))  # it is no ghost, and waits for no ego
        if motion is not None and motion.path is not None:
            world.follow_path(row, motion.path, is_loop=motion.is_loop)
        return lane

    def _lane_of(self, row: int, spot: Spot | None, motion: ObjectMotion, where: str) -> tuple[int, float]:
        """Return the lane that a driver is to keep to; without a new place, that on which it drives already."""
        world = self._context.world
        if spot is None and world.has_lane[row] and motion.route[:1] in {(), (world.lane.item(row),)}:
            return world.lane.item(row), world.arc.item(row)
        return take_lane(world.roads, spot or self._spot_of(row), motion.route, where)

    def _change_ego(self, ego: Ego, change: Change) -> None:
        """Change an ego: place and gear, then speed, then who drives it, then its lamps.

        Raises:
            ValueError, FieldError: it cannot be so. It is changed by half.
        """
        world, motion = self._context.world, change.motion
        if change.spot is not None:
            speed = world.speed.item(ego.row) if change.speed is None else change.speed
            if change.speed is not None or change.gear is not None:
                speed = speed_in_gear(speed, change.gear or ego.gear)
            ego.teleport(_pose_of(change.spot, speed), change.gear)
        else:
            if change.speed is not None:
                placement.set_speed(world, ego.row, speed_in_gear(change.speed, change.gear or ego.gear))
            if change.gear is not None:
                _insist(ego.shift(change.gear), f"{change.where}.gear")
        if motion is not None:
            self._drive_itself(ego, motion, change.where)
        elif change.ctrl_mode is not None:
            _insist(ego.set_ctrl_mode(change.ctrl_mode), f"{change.where}.ctrl_mode")
        if change.lamps is not None:
            ego.turn_signal, ego.emergency_signal = change.lamps

    # Both

    def _keep_lanes(self, drivers: Iterable[tuple[int, ObjectMotion, tuple[int, float]]]) -> None:
        """Have vehicles follow lanes: the row of each, its motion, and its place on its lane."""
        starts = [
            LaneStart(row, *lane, desired_speed=motion.desired_speed, route=motion.route, is_loop=motion.is_loop)
            for row, motion, lane in drivers
        ]
        keep_lanes(self._context.world, starts)

    def _drive_itself(self, ego: Ego, motion: ObjectMotion, where: str) -> None:
        """Have an ego drive itself along the lanes.

        Raises:
            FieldError: it stands on no lane, or cannot be in D.
        """
        take_lane(self._context.world.roads, self._spot_of(ego.row), motion.route, where)
        why = ego.drive_itself(route=motion.route, is_loop=motion.is_loop, desired_speed=motion.desired_speed)
        _insist(why, f"{where}.behaviour")

    def _spot_of(self, row: int) -> Spot:
        """Return where an entity stands now."""
        world = self._context.world
        return Spot(world.x.item(row), world.y.item(row), world.z.item(row), world.yaw.item(row))

    def _try(self, where: str, act: Callable[[], T]) -> T:
        """Do something to one object; what the world refuses is the client's mistake.

        Raises:
            FieldError: names the object, and what is wrong with it.
        """
        try:
            return act()
        except ValueError as error:
            raise FieldError(f"{where}: {error}") from None

    # Catalogue

    def _list_models(self, call: Call, _now: float) -> None:
        catalogue = self._context.scene.catalogue
        own = set(map(id, catalogue.own))
        models = [self._model_info(model, is_own=id(model) in own) for model in catalogue.models]
        call.respond(models)

    def _model_info(self, model: Model, *, is_own: bool) -> Struct:
        body = model.body
        return self._make_model(
            *(model.name, model.kind.name.lower(), is_own, can_be_ego(model), list(model.data_ids)),
            *(body.length, body.width, body.height, body.wheelbase, body.front_overhang, body.rear_overhang),
            *(math.degrees(body.max_steer), body.max_accel, body.max_decel, model.mass or 0.0),
        )


def _pose_of(spot: Spot, speed: float) -> GhostPose:
    return GhostPose(spot.x, spot.y, spot.z, 0.0, 0.0, spot.yaw, speed)


def _insist(why_not: str | None, where: str) -> None:
    """Raise FieldError with a reason, if there is one."""
    if why_not is not None:
        raise FieldError(f"{where}: {why_not}")
