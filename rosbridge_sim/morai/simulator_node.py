"""The simulator as one ROS node: its topics and services on the bus, bound to synchronous mode and to the world.

`SimulatorNode` is the middle: `sync` decides, `scene` holds who is there, `outputs` publish, and its `Component`s,
which it is given, answer and listen. It has the two ways in which the world moves:

- `advance(now)`: real time. The shell calls it whenever `next_due` says so; it computes the frames that are owed.
- `ask_tick`: synchronous mode. A service call moves the frames of one time step within the call, and everything that
  those frames publish is in the listeners' hands before the answer is given. Only a tick whose frames need a scenario
  that is still being read waits; its caller is held meanwhile, and `take_turns` carries it out.

Both end in `_compute`: commands that waited for the frame, one step, the stamp, the topics. Nothing else moves the
world, and nothing in here looks at a clock: `now` only says how much is owed. So a drive over ticks alone gives the
same bytes on every run.

Stamps are simulated time, or the time of day if `use_wall_time` was called: then the shell's clock is read once for
each frame, all that the frame publishes has that one stamp, and everything but stamps is the same on every run.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from rosbridge_sim.errors import FieldError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant, hold
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.morai.catalogue import BUILT_IN, Catalogue
from rosbridge_sim.morai.command_parsing import EgoSetting
from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.convert import Converter, maker
from rosbridge_sim.morai.ego import CtrlMode, Ego
from rosbridge_sim.morai.interfaces.network_settings import DEFAULTS, NetworkSettings
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.registry import InterfaceRegistry
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices
from rosbridge_sim.morai.missing_sensors import advise
from rosbridge_sim.morai.real_time_pacer import RealTimePacer
from rosbridge_sim.morai.releases import MANUAL, Profile, SpeedLimits
from rosbridge_sim.morai.scenarios.reader import Scenario
from rosbridge_sim.morai.scene import FIRST_EGO, MAX_EGOS, MAX_ENTITIES, Library, Load, Scene
from rosbridge_sim.morai.sync import Sync, SyncEffect, SyncOutcome, SyncState
from rosbridge_sim.morai.tf_publisher import TF, Mount, TfPublisher
from rosbridge_sim.schema.store import Message
from rosbridge_sim.world.state import STEP_NS, Gear, World
from rosbridge_sim.world.step import step

__all__ = ["SIMULATOR_NAME", "NodeSettings", "SceneCommand", "SimulatorNode", "TickResult"]

SIMULATOR_NAME: Final = "/morai_sim"

MAX_FRAMES_AT_ONCE: Final = 5
"""Frames that one `advance` computes at most, so that catching up does not keep everybody else waiting."""

LAST_RESERVED: Final = 1
"""MORAI's egos are 0, 2, 3, ...: nobody has seen a 1."""

MAX_GONE: Final = 1_000
"""Services of egos that have left which are remembered: a client may bring egos under ever new numbers."""

_MEANWHILE: Final = "while the tick waited for a scenario that is being read"
_PAUSED: Final = f"the simulation was paused {_MEANWHILE}"
_ENDED: Final = f"synchronous mode has ended, or its master was lost, {_MEANWHILE}"
_RESET: Final = f"the simulation was reset {_MEANWHILE}"

SceneCommand = Callable[[float], None]
"""What waits for its frame in synchronous mode; called with `now`."""

_log = logging.getLogger("rosbridge_sim.morai")


@dataclass(frozen=True, slots=True)
class NodeSettings:
    """What can be chosen about the simulator; the fields are named after the program's flags.

    Attributes:
        profile: units and orders where documents and clients disagree.
        start: run in real time, or stand at frame 0 until the first master comes.
        start_mode: external control in D, or keyboard control in P as MORAI starts.
        speed_limits: of the egos' speed mode; None for those of their models.
        network: names, switches and rates of all that the simulator has on the bus.
        sync_frames: whether a tick must name the frame that it will end on.
        sync_lease: silence after which a master is lost [s]; None counts departures only.
        sync_on_loss: what becomes of the world when the master is lost.
        anyone_may_stop: let others than the master stop synchronous mode.
        catalogue: the models that clients name.
        replay_info: publish ReplayInfo of any drive for everybody, and not only for who listens to it in particular.
        on_world_failure: raise an exception of a step to the caller of `advance`, or stand still and refuse everything.
    """

    profile: Profile = MANUAL
    start: Literal["run", "sync"] = "run"
    start_mode: Literal["external", "keyboard"] = "external"
    speed_limits: SpeedLimits | None = None
    network: NetworkSettings = DEFAULTS
    sync_frames: Literal["lenient", "strict"] = "lenient"
    sync_lease: float | None = None
    sync_on_loss: Literal["run", "pause", "wait"] = "run"
    anyone_may_stop: bool = False
    catalogue: Catalogue = BUILT_IN
    replay_info: bool = False
    on_world_failure: Literal["exit", "serve"] = "exit"


class TickResult(NamedTuple):
    """How a tick ended.

    Attributes:
        is_accepted: its frames have been computed.
        is_paused: the simulation was paused when that was decided.
        why: for a refusal, a text for the peer; empty otherwise.
        reason: the kind of refusal that `why` puts into words.
    """

    is_accepted: bool
    is_paused: bool
    why: str = ""
    reason: Reason = Reason.NOT_NOW


OnTick = Callable[[TickResult], None]


class SimulatorNode:
    """The simulator. An `Participant` on the bus; its names there are its alone.

    Attributes:
        name: as rosapi shows it.
        bus, world, convert, stage, sync: its parts.
        items: all that it has on the bus.
        egos: in order; the first one has the bare names, ego 2 those under `/Ego-2/`.
        camera_index: the ego that a client wants to be looked at, whether there is one or not.
        is_moving: frames are being computed right now.
        num_ticks: ticks carried out.
        failure: why the world stands still for good; None while it does not.
        afterwards: what is to be done once the frame in hand has gone out; commands put it there, frame by frame.
    """

    name = SIMULATOR_NAME

    def __init__(
        self,
        bus: Bus,
        world: World,
        library: Library,
        scenario: Scenario,
        *,
        settings: NodeSettings,
        make_parts: Callable[[SimulatorNode], Sequence[Component]],
    ) -> None:
        """The simulator with its opening scene, on the bus.

        Args:
            bus: where its topics and services are; its stamp follows the world's frames from now on.
            world: empty; moved by this node alone.
            library: where scenarios and maps come from.
            scenario: the opening scene.
            settings: what can be chosen.
            make_parts: makes its parts, once all else of it is there; their topics go out in this order.

        Raises:
            DocumentError: the scenario does not fit its map, or the network settings do not fit.
        """
        is_external = settings.start_mode == "external"
        self.bus = bus
        self.world = world
        self.library = library
        self.convert = Converter(bus.store, settings.profile)
        ego_gear = Gear.DRIVE if is_external else Gear.PARK
        self.scene = Scene(
            world,
            library,
            scenario,
            ego_gear=ego_gear,
            speed_limits=settings.speed_limits,
            catalogue=settings.catalogue,
        )
        self.camera_index = FIRST_EGO
        self._ctrl_mode = CtrlMode.EXTERNAL if is_external else CtrlMode.KEYBOARD
        self.egos: list[Ego] = [self._make_ego(FIRST_EGO, FIRST_EGO)]
        self.sync: Sync[SceneCommand] = Sync(
            is_on=settings.start == "sync",
            on_loss=settings.sync_on_loss,
            lease=settings.sync_lease,
            is_strict=settings.sync_frames == "strict",
            may_anyone_stop=settings.anyone_may_stop,
        )
        self.is_moving = False
        self.num_ticks = 0
        self.failure: str | None = None
        self._failed_by: Exception | None = None
        self._is_serving_on = settings.on_world_failure == "serve"
        self.afterwards: list[SceneCommand] = []
        # Those that wait, each with what releases its caller.
        self._ticks: deque[tuple[OnTick, Callable[[float], None]]] = deque()
        self._pace = RealTimePacer()
        self._told: dict[Participant, set[str]] = {}
        self._departed: list[Participant] = []  # while frames were computed
        self.items = InterfaceRegistry(self, bus, settings.network)
        self._outputs = Publishers(self, bus, self.items)
        self._outputs.add("/clock", "rosgraph_msgs/Clock", lambda: self.convert.clock(world.frame))
        self._transforms = TfPublisher(bus.store, world, self.convert)
        self._outputs.add("/tf", TF, lambda: self._transforms.moving(self.egos), is_exclusive=False)
        self._info = self._outputs.keep("/SyncModeInfo", "morai_msgs/SyncModeInfo")
        self._static = self._outputs.keep("/tf_static", TF, is_exclusive=False)
        self._mounts: tuple[Mount, ...] | None = None
        self._make_info = maker(bus.store, "morai_msgs/SyncModeInfo", "master_id", "status", "frame", "can_send_tick")
        self._parts = make_parts(self)
        # Asked at every frame: only those that have something to do.
        self._placing = [part.place for part in self._parts if type(part).place is not Component.place]
        self._settling = [part.settle for part in self._parts if type(part).settle is not Component.settle]
        self._bindings: dict[int, SubscribersServices] = {}  # of the further egos, by their number
        self._gone: dict[str, int] = {}  # services of egos that have left, and the egos' numbers
        bindings = SubscribersServices(self.items)
        for part in self._parts:
            part.show_ego(self.egos[0], bindings.prefix, self._outputs)
            part.show(self._outputs)
            part.bind(bindings)
            part.bind_ego(self.egos[0], bindings)
        self.items.open()
        bus.watchers.append(self._see_off)
        bus.unpublished.advise = advise
        self._read_wall_ns: Callable[[], int] | None = None
        self._set_time()
        self._announce(0.0)
        self.announce_mounts(0.0)

    # Time

    def advance(self, now: float) -> None:
        """Compute what real time owes by now, a few frames at most; end a lease that has run out.

        Args:
            now: monotonic time [s].

        Call it again at `next_due`.

        Raises:
            Exception: a step has failed, here or in a tick since the last call. With `on_world_failure` "serve" nothing
                is raised: the simulator stands still and refuses everything from then on.
        """
        if self._failed_by is not None:
            self._give_up_unless_serving(self._failed_by)
            return
        try:
            self._advance(now)
        except Exception as error:  # noqa: BLE001 - our own bug, whatever it is
            self._fail(error)
            self._give_up_unless_serving(error)

    def _advance(self, now: float) -> None:
        lost = self.sync.expire(now)
        if lost is not None:
            self._lose(lost, now)
        self._outputs.show_in_pause(now)
        if not self.sync.is_free:
            return
        pace = self._pace
        if not pace.is_started:
            pace.start(now)
        given_up = pace.forgive(now)
        if given_up:
            self._outputs.forget_repeats()
            level = logging.WARNING if pace.num_stalls == 1 else logging.DEBUG
            _log.log(level, "stalled for %.2f s: the simulated clock stood meanwhile", given_up)
        self.is_moving = True
        try:
            for _ in range(MAX_FRAMES_AT_ONCE):
                if now < pace.due_at or not self.sync.is_free:
                    break
                self._outputs.repeat(pace.due_at)
                self._compute(now, is_tick=False, is_last=True)
        finally:
            self.is_moving = False
        self._see_off_departed(now)
        self._outputs.repeat(now)

    def next_due(self, now: float) -> float | None:
        """When `advance` has something to do next [s]; None while only a call can move the world."""
        if self.failure is not None:
            return None if self._is_serving_on else now
        dues = [self.sync.lease_due, self._outputs.pause_due(now)]
        if self.sync.is_free:
            dues += [self._pace.due_at if self._pace.is_started else now, self._outputs.repeat_due]
        return min((due for due in dues if due is not None), default=None)

    @property
    def num_stalls(self) -> int:
        """How often real time was lost for good."""
        return self._pace.num_stalls

    def ask_tick(self, user_id: str, named: int, caller: Participant, on_end: OnTick, now: float) -> None:
        """Move the world by one time step, and publish every frame of it, if the mode allows that.

        Args:
            user_id: the master that the caller takes itself for.
            named: the frame that it asks for.
            caller: held for as long as its tick waits.
            on_end: called once, perhaps before this returns.
            now: monotonic time [s].
        """
        outcome = self.sync.tick(user_id, named, self.world.frame, caller, now)
        if SyncEffect.WAIT in outcome.effects:
            self._ticks.append((on_end, self.hold(caller)))
            return
        is_paused = self.sync.is_paused
        if SyncEffect.MOVE in outcome.effects:
            self._tick(self.sync.num_frames, now)
        on_end(TickResult(outcome.is_accepted, is_paused, self.sync.why(outcome), outcome.reason))

    def take_turns(self, now: float) -> None:
        """Carry out the ticks that wait, as far as what they wait for has been read."""
        while not self.is_moving and (num_frames := self.sync.take_turn(self.world.frame)):
            on_end, release = self._ticks.popleft()
            try:
                self._tick(num_frames, now)
            except GraphError as error:
                self._ticks.appendleft((on_end, release))
                self._refuse_ticks(str(error), now)
                return
            try:
                on_end(TickResult(is_accepted=True, is_paused=False))
            finally:
                release(now)

    def _refuse_ticks(self, why: str, now: float) -> None:
        """Answer the ticks that wait: they will not be carried out."""
        ticks, self._ticks = self._ticks, deque()
        for on_end, release in ticks:
            on_end(TickResult(is_accepted=False, is_paused=self.sync.is_paused, why=why))
            release(now)

    def hold(self, owner: Participant) -> Callable[[float], None]:
        """Hold a peer's input while something takes its time; a master does not lose its lease by that.

        Returns:
            Releases it; takes monotonic time [s] and must be called once.
        """
        release = hold(owner)
        self.sync.mute(owner)

        def let_go(now: float) -> None:
            self.sync.unmute(owner, now)
            release()

        return let_go

    def _tick(self, num_frames: int, now: float) -> None:
        """Compute the frames of a tick.

        Raises:
            GraphError: a step has failed, now or before: the world stands still for good.
        """
        if self.failure is not None:
            raise GraphError(self.failure)
        self.is_moving = True
        try:
            for left in range(num_frames - 1, -1, -1):
                self._compute(now, is_tick=True, is_last=left == 0)
        except Exception as error:
            self._fail(error)
            assert self.failure is not None
            raise GraphError(self.failure) from error
        finally:
            self.is_moving = False
        self.num_ticks += 1
        if self._departed:
            self._see_off_departed(now)

    def _compute(self, now: float, *, is_tick: bool, is_last: bool) -> None:
        """Move the world by one frame and show it."""
        world = self.world
        for command in self.sync.due(world.frame + 1):
            command(now)
        step(world, self._place)
        self.refresh()
        self._set_time()
        if is_tick:
            self._outputs.show_every(world.frame, now)
        else:
            self._pace.count()
            self._outputs.show_due(world.frame, self._pace.shown_at, now)
        self._announce(now, may_tick=is_last)
        while self.afterwards:
            self.afterwards.pop(0)(now)
        self._settle(now)

    def use_wall_time(self, read_ns: Callable[[], int], now: float) -> None:
        """Stamp with the time of day from now on: headers, /clock and tf alike. What is latched is published anew.

        Args:
            read_ns: the time of day, which never goes back [ns]; called once for each frame.
            now: monotonic time [s].
        """
        self._read_wall_ns = read_ns
        self._set_time()
        self.refresh()
        self._outputs.show_latched(now)
        self._mounts = None
        self.announce_mounts(now)

    def _set_time(self) -> None:
        """Take the time of the frame that the world is at, for all that is stamped until the next one."""
        if self._read_wall_ns is not None:
            self.convert.wall_ns = self._read_wall_ns()
        frame = self.world.frame
        self.bus.time_ns = frame * STEP_NS
        self.bus.stamp_ns = self.convert.stamp_ns(frame)

    def _fail(self, error: Exception) -> None:
        """Stand still for good: half a step cannot be taken back. Refuse what waits for an answer and what comes."""
        self._failed_by = error
        self.failure = self.items.why_closed = f"the world has failed: {error!r:.200}"
        if self._is_serving_on:
            _log.critical(
                "the world has failed and stands still; this is a bug of ours. Everything else goes on, as"
                " --on-world-failure serve says; restart to have the world again",
                exc_info=error,
            )
            for service in list(self.bus.holdings(self).services):
                for call in list(service.calls):
                    call.refuse(self.failure)

    def _give_up_unless_serving(self, error: Exception) -> None:
        if not self._is_serving_on:
            raise error

    def _place(self) -> None:
        """Within a step: the parts put whom they move where they are to stand."""
        for place in self._placing:
            place()

    def _settle(self, now: float) -> None:
        for settle in self._settling:
            settle(now)

    # Synchronous mode

    def follow(self, outcome: SyncOutcome, now: float) -> None:
        """Carry out what follows from an event, but for the ticks' MOVE and WAIT."""
        for effect in outcome.effects:
            if effect is SyncEffect.FLOW:
                self._pace.start(now)
            elif effect is SyncEffect.REFUSE:
                self._refuse_ticks(_PAUSED if self.sync.master_id else _ENDED, now)
            elif effect is SyncEffect.ANNOUNCE:
                self._announce(now)
        if not self.sync.is_free:
            self._outputs.forget_repeats()
        self._outputs.set_paused(is_paused=self.sync.state is SyncState.FREE_PAUSED, now=now)
        self._settle(now)

    def _announce(self, now: float, *, may_tick: bool = True) -> None:
        """Publish /SyncModeInfo; latched, so it is kept up to date whoever listens."""
        sync = self.sync
        info = self._make_info(sync.master_id, sync.is_on, self.world.frame, sync.can_send_tick and may_tick)
        self._outputs.update(self._info, info, now)

    def _see_off(self, owner: Participant, now: float) -> None:
        """A peer has left the bus; perhaps within a frame, on a message of which its connection has failed."""
        self._told.pop(owner, None)
        if self.failure is not None:
            return
        if self.is_moving:
            self._departed.append(owner)
            return
        for part in self._parts:  # whatever one of them fails at, a master that is gone must not keep the world waiting
            self.bus.guard.attempt("what follows an owner's end", part.on_leave, owner, now)
        lost = self.sync.leave(owner)
        if lost is not None:
            self._lose(lost, now)

    def _see_off_departed(self, now: float) -> None:
        """Do what follows from departures while frames were computed: within a frame nobody comes or goes."""
        departed, self._departed = self._departed, []
        for owner in departed:
            self._see_off(owner, now)

    def _lose(self, outcome: SyncOutcome, now: float) -> None:
        _log.warning("the master of synchronous mode is lost; %s", outcome.state.name)
        self.follow(outcome, now)

    # Egos

    @property
    def followed(self) -> Ego:
        """The ego that a page looks at."""
        return self.find_ego(self.camera_index) or self.egos[0]

    def find_ego(self, unique_id: int) -> Ego | None:
        """The ego that a client calls by this number (-1 is the first one too), or None."""
        wanted = FIRST_EGO if unique_id == -1 else unique_id
        return next((ego for ego in self.egos if ego.index == wanted), None)

    def add_egos(self, settings: Sequence[EgoSetting], now: float) -> None:
        """Bring further egos into the world, each with topics and services of its own; all of them or none.

        Raises:
            FieldError: a number that no ego can have, or too many of them.
            GraphError: a client has given one of the topics another type.
        """
        for setting in settings:
            if setting.index <= LAST_RESERVED:
                raise FieldError(f"ego_index: expected {FIRST_EGO}, {LAST_RESERVED + 1} or more, got {setting.index}")
        if len(self.egos) + len(settings) > MAX_EGOS:
            raise FieldError(f"ego_index: there are {MAX_EGOS} egos at most")
        if len(self.world) + len(settings) > MAX_ENTITIES:
            raise FieldError(f"ego_index: the world holds {MAX_ENTITIES:,} at most")
        added: list[Ego] = []
        try:
            for setting in settings:
                uid = self.scene.add_ego(self.egos[0].uid, setting.pose, setting.gear or self.egos[0].gear)
                ego = self._make_ego(setting.index, uid)
                added.append(ego)
                self._bind_ego(ego)
        except PeerError:
            for ego in added:
                self._drop_ego(ego, now)
                self.world.remove(ego.uid)
            raise
        self.egos += added
        self.announce_mounts(now)

    def _make_ego(self, index: int, uid: int) -> Ego:
        return Ego(self.world, self.convert, uid, self._ctrl_mode, index=index, roads=lambda: self.scene.road_map.roads)

    def _bind_ego(self, ego: Ego) -> None:
        """Give a further ego its names."""
        bindings = self._bindings[ego.index] = SubscribersServices(self.items, f"/Ego-{ego.index}/")
        for part in self._parts:
            part.show_ego(ego, bindings.prefix, self._outputs)
            part.bind_ego(ego, bindings)
        # only now: until all its services are back, none of them is to be taken for gone for good
        self._gone = {name: index for name, index in self._gone.items() if index != ego.index}
        _log.info("ego %d has come: %s...", ego.index, bindings.prefix)

    def why_gone(self, service: str) -> str:
        """Return why a service of an ego that may come back is not there; an empty text for any other name."""
        index = self._gone.get(service)
        return "" if index is None else f"ego {index} has left"

    def _drop_ego(self, ego: Ego, now: float) -> None:
        """Take a further ego's names away."""
        bindings = self._bindings.pop(ego.index)
        for name in bindings.services:
            self._gone.pop(name, None)
            self._gone[name] = ego.index
        while len(self._gone) > MAX_GONE:
            del self._gone[next(iter(self._gone))]
        bindings.release(now)
        self._outputs.remove(bindings.prefix, now)
        _log.info("ego %d is gone: %s...", ego.index, bindings.prefix)

    # For the parts

    def announce_mounts(self, now: float) -> None:
        """Publish /tf_static if what it says has changed; latched."""
        mounts = self._transforms.mounts(self.egos)
        if mounts != self._mounts:
            self._mounts = mounts
            self._outputs.update(self._static, self._transforms.static(mounts), now)

    def refresh(self) -> None:
        """The world has changed: what was made from it is made again."""
        for ego in self.egos:
            ego.forget_status()

    def carry_out(self, load: Load, *, is_pausing: bool, now: float, network: NetworkSettings | None = None) -> None:
        """Have a prepared scenario take the stage, wholly or not at all.

        Args:
            load: from `scene.prepare`.
            is_pausing: time stands still from then on.
            now: monotonic time [s].
            network: other network settings from then on; None for those in force.

        Raises:
            DocumentError: the world is too full, and nothing has changed but that a replay has ended; or a name of the
                network cannot be had, and nothing has changed at all.
        """
        if network is not None:
            self.items.check(network)
        for part in self._parts:
            part.on_scene_change(now)
        self.scene.carry_out(load)
        if load.egos:
            self.egos[0].renew()
        for ego in self.egos:
            if not ego.is_there:
                self._drop_ego(ego, now)
        self.egos = [ego for ego in self.egos if ego.is_there]
        for ego in self.egos:
            ego.resume()
        if network is not None:
            self.items.change(network, now)
        self.refresh()
        self.announce_mounts(now)
        if is_pausing:
            self.follow(self.sync.pause(), now)

    def reset(self, seed: int | None, now: float) -> None:
        """Begin anew: the same calls from here on give the same bytes as after the start. The mode stays as it is.

        Args:
            seed: of all chance; None for the one in use.
            now: monotonic time [s].

        Raises:
            GraphError: frames are being computed; somebody who hears of one asks from within.
        """
        if self.is_moving:
            raise GraphError("the world is moving")
        for part in self._parts:
            part.on_scene_change(now)
        for ego in self.egos[1:]:
            self._drop_ego(ego, now)
        self.egos = self.egos[:1]
        self.scene.reset(seed)
        self.egos[0].ctrl_mode = self._ctrl_mode
        self.egos[0].renew()
        self.camera_index = FIRST_EGO
        outcome = self.sync.forget()
        for part in self._parts:
            part.forget()
        self._outputs.forget_repeats()
        self._set_time()
        self.refresh()
        self._announce(now)
        self._mounts = None  # what waits for those who come late is of frame 0 again
        self.announce_mounts(now)
        if SyncEffect.REFUSE in outcome.effects:
            self._refuse_ticks(_RESET, now)

    def current_messages(self) -> list[tuple[Topic, Message]]:
        """Return what each topic of the simulator's would say now, whether anybody listens or not."""
        return list(self._outputs.current())

    def unique_id(self, row: int) -> int:
        """What clients call whoever is in this row."""
        uid: int = self.world.uid.item(row)
        return next((ego.index for ego in self.egos if ego.uid == uid), uid)

    def tell_once(self, owner: Participant, text: str) -> None:
        """Warn a peer of something that it may do many times."""
        told = self._told.setdefault(owner, set())
        if text not in told:
            told.add(text)
            owner.notify("warning", text)

    def notify(self, level: str, text: str) -> None:
        """What the bus has to say to the simulator goes into the log."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)
