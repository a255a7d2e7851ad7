"""Component that loads scenarios: `/ScenarioLoad`, `/Service_MoraiSL` and `/SyncModeScenarioLoad`.

The `Reader` reads the documents, which may take seconds, and rehearses the first frames. The effects of a load happen
later, in one piece:

- A load *now* takes effect when its documents have been read. Its client is held until then, so everything that this
  client sends afterwards meets the new scene. Other clients go on, and in real time so does the world. The load takes
  effect even if its client has left, because a program may publish `/ScenarioLoad` and end. After a reset it fails.
- A load *at a frame* takes its place among the commands of that frame when it arrives, and the world waits for it
  before that frame (see `sync.py`). Its client is held until the documents have been read, because the answer tells
  whether they can be used.

A scenario without a map name uses the map in use: for a load now, the map at the time of its effect; for a load at a
frame, the map at the time of its arrival. So the result does not depend on the duration of the reading.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rosbridge_sim.errors import DocumentError, GraphError, PeerError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.simulator.bus.network_settings import Networks, NetworkSettings
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.morai_services.morai_answers import request_of
from rosbridge_sim.simulator.plain.reading import Then, answering, read_while_held
from rosbridge_sim.simulator.scene.load import FoundMap, Library, Load, LoadOptions, find_map
from rosbridge_sim.simulator.scene.rehearsal import Rehearsal
from rosbridge_sim.simulator.scene.scene_commands import LoadScenario, SceneCommand

_WAS_RESET = "the simulation was reset or restored before the scenario was read; load it again"
_FAILED = "the server failed to load the scenario; see the server's log"


class _Documents(Record, eq=False):
    """All documents of a load.

    Attributes:
        scenario: the scenario to load.
        own_map: the map that it names; None if it names none.
        network: its network settings; None if they are not wanted, or there are none.
    """

    scenario: Scenario
    own_map: FoundMap | None
    network: NetworkSettings | None


class Loads(Component):
    """Component that loads scenarios."""

    def __init__(self, context: SimulatorContext, networks: Networks | None, *, has_traffic: bool = False) -> None:
        """Read nothing yet.

        Args:
            networks: reads network settings of scenarios; None if there are none.
            has_traffic: each new scene is filled with traffic.
        """
        self._context = context
        self._networks = networks
        self._rehearsal = Rehearsal(context.world.dynamics, has_traffic=has_traffic)
        self._opening_network = context.interfaces.settings
        self._epoch = 0  # number of resets and restores
        context.hooks.on_reset.append(self._drop_reading)
        context.hooks.on_restore.append(self._drop_reading)
        self._make_result = context.maker("morai_msgs/SyncModeResultResponse", "result")
        self._make_load_result = context.maker("morai_msgs/MoraiSrvResponse", "result")

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services and subscribe to the topic that load scenarios."""
        bindings.provide("SyncModeScenarioLoad", "MoraiSyncModeSLSrv", self._load_at_frame)
        bindings.provide("Service_MoraiSL", "MoraiScenarioLoadSrv", self._load_now)
        bindings.listen("ScenarioLoad", "ScenarioLoad", partial(self._hear_load, bindings))

    def _drop_reading(self) -> None:
        """Make earlier loads fail, because they must not change the world after a reset or a restore."""
        self._epoch += 1

    # At a frame

    def _load_at_frame(self, call: Call, now: float) -> None:
        request, context = request_of(call), self._context
        sync, base = context.sync, context.scene.found_map
        notify = call.caller.notifier()
        command = SceneCommand(None, call.service.name, notify)
        outcome = sync.submit(command, request.frame, context.world.frame, call.caller, now, is_ready=False)
        if not outcome.is_accepted:
            call.explain(outcome.why, outcome.reason, "warning")
            call.respond(self._make_result(False))  # noqa: FBT003 - the message's one field
            return

        def finish(documents: _Documents | DocumentError, now: float) -> None:
            is_usable = False
            try:
                load, network = self._prepare(request, documents, call.caller, base)
                command.action = LoadScenario(load, network, is_pausing=request.set_pause)
                is_usable = True
            except (PeerError, DocumentError) as error:
                notify("error", f"{call.service.name}: {error}")
            finally:
                (sync.ready if is_usable else sync.withdraw)(command)
                call.respond(self._make_result(is_usable))
                context.sync_driver.take_turns(now)

        self._read(request, call.caller, base, answering(call.refuse, finish), now)

    # Now

    def _load_now(self, call: Call, now: float) -> None:
        notify = call.caller.notifier()

        def end(error: PeerError | DocumentError | None) -> None:
            if error is not None:
                notify("error", f"{call.service.name}: {error}")
            call.respond(self._make_load_result(error is None))

        self._start(request_of(call), call.caller, end, now)

    def _hear_load(self, bindings: SubscribersServices, request: Struct, sender: Participant, now: float) -> None:
        """Load a scenario now, by topic. As with the service, synchronous mode does not prevent it."""
        topic, notify = bindings.topic("ScenarioLoad"), sender.notifier()
        is_here = True
        refusal: GraphError | None = None

        def end(error: PeerError | DocumentError | None) -> None:
            nonlocal refusal
            if error is None:
                return
            refusal = GraphError(f"{topic}: {error}")
            if not is_here:
                notify("error", str(refusal))

        self._start(request, sender, end, now)
        is_here = False
        if refusal is not None:
            raise refusal

    def _start(
        self, request: Struct, caller: Participant, end: Callable[[PeerError | DocumentError | None], None], now: float
    ) -> None:
        """Load a scenario as soon as its documents have been read."""
        epoch = self._epoch

        def finish(documents: _Documents | DocumentError, now: float) -> None:
            problem: PeerError | DocumentError | None = GraphError(_FAILED)
            try:
                if self._epoch != epoch:
                    raise GraphError(_WAS_RESET)
                load, network = self._prepare(request, documents, caller, self._context.scene.found_map)
                self._context.scene_changes.carry_out(load, is_pausing=request.set_pause, now=now, network=network)
                problem = None
            except (PeerError, DocumentError) as error:
                problem = error
            finally:
                end(problem)

        self._read(request, caller, self._context.scene.found_map, finish, now)

    # Both

    def _read(self, request: Struct, caller: Participant, base: FoundMap, finish: Then[_Documents], now: float) -> None:
        """Read the documents that a request names, and hold its client meanwhile."""
        if not any((request.delete_all, *_parts(request), request.load_network_connection_data)):
            caller.notify("warning", "nothing to load: delete_all and all load_... are false")
        context, name = self._context, request.file_name
        networks = self._networks if request.load_network_connection_data else None
        work = partial(_read_documents, context.library, networks, name, base, self._rehearsal)
        read_while_held(self._context.reader, work, finish, partial(context.sync_driver.hold, caller), now)

    def _prepare(
        self, request: Struct, documents: _Documents | DocumentError, caller: Participant, base: FoundMap
    ) -> tuple[Load, NetworkSettings | None]:
        """Return the load of a request and, if they are wanted, the network settings of its scenario.

        These settings are laid over those of the server's start, so earlier loads have no influence. Most scenarios
        have none:
        then the caller is warned, and the current settings stay.

        Raises:
            DocumentError: the scenario does not exist, or a document cannot be used.
            GraphError: the world has failed.
        """
        if self._context.failure.why is not None:  # it failed while the scenario was read
            raise GraphError(self._context.failure.why)
        if isinstance(documents, DocumentError):
            raise documents
        options = LoadOptions(request.delete_all, *_parts(request))
        load = self._context.scene.prepare(documents.scenario, options, own_map=documents.own_map, base=base)
        network = None
        if documents.network is not None:
            network = documents.network.over(self._opening_network)
            self._context.interfaces.check(network)
        elif request.load_network_connection_data:
            caller.notify("warning", f"{request.file_name[:80]!r} has no network settings: those in force stay")
        return load, network


def _parts(request: Struct) -> tuple[bool, bool, bool, bool]:
    """Return whether to load the ego, the vehicles, the pedestrians and the obstacles."""
    return (
        request.load_ego_vehicle_data,
        request.load_surrounding_vehicle_data,
        request.load_pedestrian_data,
        request.load_obstacle_data,
    )


def _read_documents(
    library: Library, networks: Networks | None, name: str, base: FoundMap, rehearsal: Rehearsal
) -> _Documents:
    """Read a scenario and the documents that belong to it; usually called in a thread.

    Args:
        networks: has its network settings; None if they are not wanted.
        name: of the scenario, as the client gives it.
        base: the map in use, which is not read again.
        rehearsal: has the first frames computed what they need of the roads.

    Raises:
        DocumentError: one of the documents cannot be used.
    """
    scenario = library.scenario(name)
    own_map = None
    if scenario.map_name is not None:
        own_map = base if scenario.map_name == base.name else find_map(library, scenario.map_name)
    rehearsal.rehearse(scenario, (own_map or base).road_map)
    return _Documents(scenario, own_map, networks.network(name) if networks is not None else None)
