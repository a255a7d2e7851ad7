"""The component of `/sim/sensors`: it lists the sensors of an ego, and adds, removes and moves them."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import msgspec

from rosbridge_sim.documents.document_reading import MistakeNotReadyError
from rosbridge_sim.errors import DocumentError, FieldError, PeerError
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.publisher_kinds import FRAME_RATE
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.reading import answering, read_while_held
from rosbridge_sim.simulator.sensor_rigs.ego_rig import MEASURED_FRAMES, EgoRig
from rosbridge_sim.simulator.sensor_rigs.mounted_sensors import MountedSensors
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import (
    document_of,
    learn_rig_mistakes,
    parse_object,
    read_rig,
    read_rig_text,
)
from rosbridge_sim.simulator.sensors.sensor_specs import SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import check_rig
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

MAX_CHANGES: Final = 64
"""Sensors in each list of one call: more than an ego has. Each that moves takes 0.1 ms."""

_log = logging.getLogger("rosbridge_sim.morai")


class SensorService(Component):
    """The component of the service. It holds no state: that is `MountedSensors`'."""

    def __init__(self, context: SimulatorContext, mounted: MountedSensors) -> None:
        """Offer nothing yet."""
        self._context = context
        self._mounted = mounted
        self._make_info = context.maker(
            "rosbridge_sim_msgs/SensorInfo",
            "number kind frame_id topics rate measured skipped x y z roll pitch yaw settings",
        )

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service."""
        bindings.provide("sim/sensors", "rosbridge_sim_msgs/Sensors", self._serve)

    def _serve(self, call: Call, now: float) -> None:
        try:
            self._answer(call, now, is_quick=True)
        except MistakeNotReadyError:  # nothing has changed
            hold = partial(self._context.sync_driver.hold, call.caller)
            again = partial(self._answer, call, is_quick=False)
            then = answering(call.refuse, lambda _, now: again(now))
            read_while_held(self._context.reader, learn_rig_mistakes, then, hold, now)

    def _answer(self, call: Call, now: float, *, is_quick: bool) -> None:
        request: Any = call.request
        ego = self._context.egos.find(request.ego)
        if ego is None:
            numbers = ", ".join(str(one.index) for one in self._context.egos)
            message = f"ego: expected the number of an ego, one of {numbers}; got {request.ego}"
            call.respond(result=False, message=message)
            return
        rig, message = self._mounted.rig_of(ego), ""
        try:
            if request.remove or request.add or request.move:
                self._change(rig, call, now, is_quick=is_quick)
        except MistakeNotReadyError:
            raise
        except (PeerError, DocumentError) as error:
            message = str(error)
        call.respond(result=not message, message=message, sensors=self._list(rig))

    def _change(self, rig: EgoRig, call: Call, now: float, *, is_quick: bool) -> None:
        """Remove, add and move sensors; `is_quick` as for `read_rig`.

        Raises:
            DocumentError: a text is no sensor, or no place.
            PeerError: an ego cannot have these sensors together, there is no such sensor, or the client may not have
                them publish there. Nothing has changed.
        """
        request: Any = call.request
        ego = rig.ego
        specs = list(rig.specs)
        for field in ("remove", "move"):
            num = len(getattr(request, field))
            if num > MAX_CHANGES:
                raise FieldError(f"{field}: expected at most {MAX_CHANGES} in one call, got {num:,}")
        for name in request.remove:
            _check_removal(rig, name)
            specs = [spec for spec in specs if spec.frame_id != name]
        added = read_rig_text(request.add, "add", is_quick=is_quick) if request.add else ()
        for spec in added:
            if spec.is_on_each_ego:
                raise FieldError(f"add: {spec.kind}: each ego has one; move {spec.frame_id} instead")
        specs += added
        check_rig(specs)
        self._mounted.check_topics(ego.index, added, call.caller)
        why = self._mounted.why_no_worker(added)
        if why:
            raise FieldError(f"add: {why}")
        moved = self._read_moves(request.move, {spec.frame_id: spec for spec in specs}, ego, is_quick=is_quick)
        rig.mount(tuple(specs), now)
        ego.mountings |= moved
        self._context.static_tf.announce(now)
        _log.info("ego %d: %d cameras, lidars and radars", ego.index, len(rig.behind))
        if any(spec.has_turns for spec in added) and (why := self._mounted.why_slow):
            call.caller.notify("warning", why)

    def _read_moves(
        self, texts: Sequence[str], specs: dict[str, SensorSpec], ego: Ego, *, is_quick: bool
    ) -> dict[str, Mounting]:
        """Return new places by frame.

        Raises:
            DocumentError: one of them is none, or names no sensor.
        """
        moved: dict[str, Mounting] = {}
        for i, text in enumerate(texts):
            where = f"move[{i}]"
            values = parse_object(text, where)
            name = values.pop("frame_id", None)
            spec = specs.get(name) if isinstance(name, str) else None
            if spec is None:
                known = ", ".join(specs) or "no sensors"
                raise DocumentError(f"{where}.frame_id: expected one of {known}, got {str(name)[:80]!r}")
            keys = ("x", "y", "z", "roll", "pitch", "yaw")
            unknown = [key for key in values if key not in keys]
            if unknown:
                raise DocumentError(
                    f"{where}.{unknown[0][:40]}: expected one of {', '.join(keys)}{hint(unknown[0], keys)}"
                )
            here = ego.mountings.get(spec.frame_id, spec.mounting)
            table = _place_of(here) | values
            (checked,) = read_rig(document_of(spec, **table), where, is_quick=is_quick)
            moved[spec.frame_id] = checked.mounting
        return moved

    def _list(self, rig: EgoRig) -> list[Struct]:
        frame, infos = self._context.world.frame, []
        for i, mounted in enumerate(rig.sensors):
            spec = mounted.spec
            place = _place_of(rig.ego.mountings[spec.frame_id])
            num = sum(one > frame - MEASURED_FRAMES for one in mounted.frames)
            measured = num * FRAME_RATE / min(MEASURED_FRAMES, max(frame, 1))
            topics = [one.topic.name for one in mounted.publishers if one.topic is not None]
            settings = json.dumps(msgspec.to_builtins(spec) | place)
            rates = rig.rate_of(mounted), measured, mounted.num_skipped
            infos.append(self._make_info(i, spec.kind, spec.frame_id, topics, *rates, *place.values(), settings))
        return infos


def _check_removal(rig: EgoRig, name: str) -> None:
    """Check that an ego may lose a sensor.

    Raises:
        FieldError: there is none of this name, or each ego has it.
    """
    known = [mounted.spec.frame_id for mounted in rig.behind]
    if name in {spec.frame_id for spec in rig.specs} - set(known):
        raise FieldError(f"remove: {name}: each ego has one; expected one of {', '.join(known) or 'no sensors'}")
    if name not in known:
        raise FieldError(
            f"remove: expected one of {', '.join(known) or 'no sensors'}, got {name[:80]!r}{hint(name, known)}"
        )


def _place_of(mounting: Mounting) -> dict[str, float]:
    """Return a place as specifications have it, with angles in degrees."""
    angles = {name: round(math.degrees(getattr(mounting, name)), 9) for name in ("roll", "pitch", "yaw")}
    return {"x": mounting.x, "y": mounting.y, "z": mounting.z, **angles}
