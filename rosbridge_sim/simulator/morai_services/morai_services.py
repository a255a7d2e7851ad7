"""Services of the simulator, and the topics of synchronous mode.

Each handler reads a request, lets `sync` or `scene` decide, and answers. There are two kinds of refusal:

- The request is wrong (no such gear, no such model). A topic's sender gets a status. A service's caller gets a refused
  call or, if the response has a `result`, false and a status with the reason.
- The request is correct but not possible now (mode off, paused, world full). The response is false, and the reason is
  sent as a warning, which a client gets if it asked for that level.

Commands of synchronous mode are checked when they come and wait as data (`scene_commands`); `command_executor` carries
them out.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from rosbridge_sim.errors import DocumentError, FieldError, GraphError, PeerError, Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.command_parsing import AUTO_MODE, lamps_of
from rosbridge_sim.morai.messages.control import GEARS, gear_of
from rosbridge_sim.morai.messages.convert import time_text
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import CtrlMode, Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.tick_calls import TickResult
from rosbridge_sim.simulator.morai_services.control_units import warn_of_units
from rosbridge_sim.simulator.morai_services.morai_answers import request_of
from rosbridge_sim.simulator.scene.scene_commands import (
    AddObject,
    ControlEgo,
    LoadScenario,
    RemoveObject,
    SceneCommand,
    ShiftEgo,
)
from rosbridge_sim.simulator.sync.sync_table import SyncOutcome
from rosbridge_sim.world.state.world import MAX_COORDINATE, Gear

# EventInfo.option. The message's own comment writes the bits as 0x1, 0x10, 0x100, 0x1000, but means binary digits. Read
# literally, 0x10 fits into the field too and has no other meaning, so it is accepted for the gear.
_MODE_BIT, _GEAR_BITS, _LAMP_BIT, _PAUSE_BIT = 1, 2 | 16, 4, 8
_ALL_BITS: Final = _MODE_BIT | _GEAR_BITS | _LAMP_BIT | _PAUSE_BIT

MAX_IDS_LISTED: Final = 20
"""Largest number of ids in one status."""

_ReadObject = Callable[[Struct, Participant, str], SceneCommand]
"""Returns the command of a message about an object, from a sender, at a topic or service."""

_log = logging.getLogger("rosbridge_sim.morai")


class Services(Component):
    """Component of the services, and of the topics of synchronous mode. It holds no state of its own."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._make_cmd = context.maker("morai_msgs/SyncModeCmdResponse", "user_id frame result time_step")
        self._make_tick = context.maker(
            "morai_msgs/WaitForTickResponse", "tick_status pause_status frame vehicle_status time"
        )
        self._make_event = context.maker("morai_msgs/EventInfo", "option ctrl_mode gear lamps set_pause")
        self._make_lamps = context.maker("morai_msgs/Lamps", "header turnSignal emergencySignal")
        self._make_result = context.maker("morai_msgs/SyncModeResultResponse", "result")

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services, and subscribe to the topics, that exist once for all egos."""
        bindings.provide("Service_MoraiVehicleSpec", "MoraiVehicleSpecSrv", self._vehicle_spec)
        bindings.provide("Service_MoraiMapSpec", "MoraiMapSpecSrv", self._map_spec)
        bindings.provide("sim/reset", "rosbridge_sim_msgs/Reset", self._reset)
        # A release has either the topics or the services of these.
        for topic, service, read in (
            ("SyncModeAddObj", "SyncModeAddObject", self._read_add),
            ("SyncModeRemoveObj", "SyncModeRemoveObject", self._read_remove),
        ):
            hear = partial(self._hear_object, partial(bindings.topic, topic), read)
            bindings.listen(topic, topic, hear, is_everywhere=False)
            bindings.provide(service, f"Morai{service}Srv", partial(self._change_object, read), is_everywhere=False)

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Offer the services of one ego. There is one synchronous mode, so a tick through any ego moves the world."""
        bindings.provide("SyncModeCmd", "MoraiSyncModeCmdSrv", self._sync_cmd)
        bindings.provide("SyncModeWaitForTick", "MoraiWaitForTickSrv", partial(self._wait_for_tick, ego))
        bindings.provide("SyncModeCtrlCmd", "MoraiSyncModeCtrlCmdSrv", partial(self._sync_ctrl_cmd, ego))
        bindings.provide("SyncModeSetGear", "MoraiSyncModeSetGearSrv", partial(self._sync_set_gear, ego))
        bindings.provide("Service_MoraiEventCmd", "MoraiEventCmdSrv", partial(self._event_cmd, ego))

    # Synchronous mode

    def _sync_cmd(self, call: Call, now: float) -> None:
        request = request_of(call)
        context, sync, driver = self._context, self._context.sync, self._context.sync_driver
        if request.start_sync_mode:
            result = driver.start(request.user_id, request.time_step, call.caller, now)
            user_id = request.user_id if result.is_accepted and context.barrier.is_on else sync.master_id
        else:
            result = driver.stop(request.user_id, now)
            user_id = request.user_id if result.is_accepted else sync.master_id
        if result.is_accepted:
            what = f"on, master {user_id!r}, {sync.step_ms} ms a tick" if sync.is_on else "off"
            _log.info("synchronous mode %s, frame %d", what, context.world.frame)
        else:
            call.explain(result.why, result.reason, "warning")
        call.respond(self._make_cmd(user_id, context.world.frame, result.is_accepted, sync.step_ms))

    def _wait_for_tick(self, ego: Ego, call: Call, now: float) -> None:
        wrapped: Any = call.request
        request, context = wrapped.request, self._context
        if context.stepper.is_moving:  # a subscriber asks for the next tick when it gets a message of this one
            raise GraphError(f"{call.service.name}: a tick is in progress", reason=Reason.NOT_NOW)

        def answer(result: TickResult) -> None:
            if call.is_done:  # withdrawn, or the caller has left; the ego may have been removed too
                return
            if context.failure.why is not None:
                call.refuse(context.failure.why)
                return
            if not result.is_accepted:
                call.explain(result.why, result.reason, "warning")
            frame = context.world.frame
            is_paused, status = result.is_paused, ego.status()
            response = self._make_tick(result.is_accepted, is_paused, frame, status, time_text(frame))
            call.answer(call.service.type.response.struct_type(response))

        context.sync_driver.ask_tick(request.user_id, request.frame, call.caller, answer, now)

    def _sync_ctrl_cmd(self, ego: Ego, call: Call, now: float) -> None:
        request = request_of(call)
        name = call.service.name

        def read() -> SceneCommand:
            control = self._context.convert.control(request.command)
            warn_of_units(control, self._context.convert.steering, name, call.caller, self._context.warnings)
            action = ControlEgo(ego.index, ego.uid, control, has_capture=request.sensor_capture)
            return SceneCommand(action, name, call.caller.notify)

        if self._queue(call, read, request.frame, now):
            ego.commander = call.caller
        if ego.moved_by:
            why = f"{call.service.name} moves nothing while a {ego.moved_by} moves ego {ego.index}"
            self._context.warnings.warn(call.caller, why)

    def _sync_set_gear(self, ego: Ego, call: Call, now: float) -> None:
        request = request_of(call)
        notify = call.caller.notifier()

        def read() -> SceneCommand:
            gear = gear_of(request.gear)
            if request.gear == 0:
                raise FieldError(f"gear: expected {GEARS} or -1 to leave it, got 0")
            why = ego.refuse_gear(gear) if gear is not None and self._is_known_now(request.frame) else None
            if why is not None:
                raise GraphError(why, reason=Reason.NOT_NOW)
            return SceneCommand(ShiftEgo(ego.index, ego.uid, gear), call.service.name, notify)

        self._queue(call, read, request.frame, now)

    def _is_known_now(self, frame: int) -> bool:
        """Return whether an ego moves now as it will when a command for a frame is carried out.

        It does so for the next frame, unless a scenario is to be loaded before.
        """
        sync, stepper = self._context.sync, self._context.stepper
        loads = (command.action is None or isinstance(command.action, LoadScenario) for _, command in sync.waiting())
        return frame <= self._context.world.frame + 1 and not stepper.is_moving and not any(loads)

    def _queue(self, call: Call, read: Callable[[], SceneCommand], frame: int, now: float) -> bool:
        """Submit a command that waits for its frame, and answer. The command is read only if the mode is on.

        Returns:
            True if it was accepted.
        """
        result = False
        try:
            outcome = self._submit(read, frame, call.caller, now)
        except (PeerError, DocumentError) as error:
            reason = error.reason if isinstance(error, PeerError) else Reason.REFUSED
            level = "warning" if reason is Reason.NOT_NOW else "error"
            call.explain(error, reason, level)
        else:
            result = outcome.is_accepted
            if not result:
                call.explain(outcome.why, outcome.reason, "warning")
        call.respond(self._make_result(result))
        return result

    def _submit(self, read: Callable[[], SceneCommand], frame: int, caller: Participant, now: float) -> SyncOutcome:
        sync = self._context.sync
        command = read() if sync.is_on else SceneCommand(None, "", caller.notify)  # it will be refused
        return sync.submit(command, frame, self._context.world.frame, caller, now)

    def _change_object(self, read: _ReadObject, call: Call, now: float) -> None:
        request = request_of(call)
        self._queue(call, lambda: read(request, call.caller, call.service.name), request.frame, now)

    def _hear_object(
        self, name_of: Callable[[], str], read: _ReadObject, request: Struct, sender: Participant, now: float
    ) -> None:
        """Submit a command from a topic, which has no answer.

        Raises:
            FieldError: a mistake in the message.
            GraphError: the command cannot wait.
        """
        topic = name_of()
        try:
            command = read(request, sender, topic)
        except FieldError as error:
            raise FieldError(f"{topic}: {error}") from None
        outcome = self._submit(lambda: command, request.frame, sender, now)
        if not outcome.is_accepted:
            raise GraphError(f"{topic}: {outcome.why}", reason=outcome.reason)

    def _read_add(self, request: Struct, sender: Participant, where: str) -> SceneCommand:
        catalogue = self._context.scene.catalogue
        model = catalogue.find(request.name)
        if model is None:
            raise FieldError(f"the catalogue has no model {request.name[:80]!r}{catalogue.suggest(request.name)}")
        place, heading_deg = (request.position.x, request.position.y, request.position.z), request.heading
        if not all(-MAX_COORDINATE <= figure <= MAX_COORDINATE for figure in place):
            raise FieldError(f"position: expected numbers within +-{MAX_COORDINATE:g}, got {place}")
        if not -MAX_COORDINATE <= heading_deg <= MAX_COORDINATE:
            raise FieldError(f"heading: expected a number within +-{MAX_COORDINATE:g}, got {heading_deg}")
        x, y, z = place
        return SceneCommand(AddObject(model, x, y, z, math.radians(heading_deg)), where, sender.notifier())

    def _read_remove(self, request: Struct, sender: Participant, where: str) -> SceneCommand:
        return SceneCommand(RemoveObject(request.unique_id), where, sender.notifier())

    # Real time

    def _event_cmd(self, ego: Ego, call: Call, now: float) -> None:
        request = request_of(call)
        option = request.option
        # Read everything before changing anything, so a wrong request has no effect.
        if option & ~_ALL_BITS:
            raise FieldError(f"option: expected a sum of 1 (mode), 2 (gear), 4 (lamps) and 8 (pause), got {option}")
        ctrl_mode = _ctrl_mode(request.ctrl_mode) if option & _MODE_BIT else None
        gear: Gear | None = gear_of(request.gear) if option & _GEAR_BITS else None
        lamps = lamps_of(request.lamps) if option & _LAMP_BIT else None
        if not option & _MODE_BIT and request.ctrl_mode == AUTO_MODE:  # other modes may be those of an answer
            text = f"ctrl_mode {AUTO_MODE} is ignored; option 1 sets a mode, and 3 is external here"
            self._context.warnings.warn(call.caller, f"{call.service.name}: {text}", about="ctrl_mode without its bit")
        if option & _GEAR_BITS and request.gear == 0:  # programs leave it so while they set a mode
            text = f"gear 0 leaves the gear as it is; expected {GEARS}, or -1 to leave it"
            self._context.warnings.warn(call.caller, f"{call.service.name}: {text}")
        refusals = [ego.set_ctrl_mode(ctrl_mode) if ctrl_mode is not None else None]
        if gear is not None:
            refusals.append(ego.shift(gear))
        for why in refusals:
            if why is not None:
                call.caller.notify("warning", f"{call.service.name}: {why}")
        if lamps is not None:
            ego.turn_signal, ego.emergency_signal = lamps
        if option & _PAUSE_BIT:
            driver = self._context.sync_driver
            (driver.pause if request.set_pause else driver.resume)(now)
        shown = self._make_lamps(self._context.convert.header(self._context.world.frame), *ego.lamps)
        is_paused = self._context.sync.is_paused
        call.respond(self._make_event(option, ego.ctrl_mode.value, ego.gear.value, shown, is_paused))

    # Ours

    def _reset(self, call: Call, now: float) -> None:
        request: Any = call.request
        context = self._context
        context.scene_changes.reset(None if request.seed < 0 else request.seed, now)
        _log.info("reset by %s, seed %d", call.caller.name, context.world.seed)
        call.respond(context.world.frame, context.world.seed)

    # Figures

    def _vehicle_spec(self, call: Call, _now: float) -> None:
        request = request_of(call)
        ego = self._context.egos.find(request.unique_id)
        unique_id = request.unique_id if ego is None else ego.uid
        body = self._context.scene.vehicle(unique_id)
        if body is None:
            ids = [*(one.index for one in self._context.egos), *self._context.scene.vehicle_ids()]
            listed = ", ".join(map(str, ids[:MAX_IDS_LISTED]))
            more = f", ... and {len(ids) - MAX_IDS_LISTED:,} more" if len(ids) > MAX_IDS_LISTED else ""
            text = f"unique_id: expected a vehicle's, one of {listed}{more}; got {request.unique_id}"
            call.caller.explain("error", f"{call.service.name}: {text}; all figures are 0", Reason.WRONG_VALUE)
        call.respond(self._context.convert.vehicle_spec(body))

    def _map_spec(self, call: Call, _now: float) -> None:
        call.respond(self._context.convert.map_spec(self._context.scene.road_map))


def _ctrl_mode(number: int) -> CtrlMode | None:
    """Return the mode of a number; None for 0, which leaves the mode as it is.

    Raises:
        FieldError: there is no such mode.
    """
    if number == 0:
        return None
    try:
        return CtrlMode(number)
    except ValueError:
        expected = ", ".join(f"{mode.value} ({mode.name.lower()})" for mode in CtrlMode)
        meant = "; 16 is the number of external in a MultiEgoSetting, here it is 3" if number == AUTO_MODE else ""
        raise FieldError(f"ctrl_mode: expected {expected} or 0 to leave it, got {number}{meant}") from None
