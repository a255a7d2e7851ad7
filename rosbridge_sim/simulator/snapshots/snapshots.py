"""The component of snapshots: `/sim/snapshot`, `/sim/restore`, `/sim/snapshots` and `/sim/state_hash`.

Snapshots are kept as bytes, the same ones that a client may take away. They are bounded in number and in bytes, and
none is dropped for another one: a client that branches relies on each of them.

In synchronous mode the master alone may restore, because it moves time. A restore happens between two frames, and at
once if the snapshot is one that is kept. Its bytes stand for it: they are known by a digest. Other bytes are decoded
and checked by the `Reader`, because they may be large and hold anything. A map that is not at hand is read by it, too,
and a recording by the recordings. It also makes hash and bytes of a large state, from a copy that is taken at once.
The client is held meanwhile, and all others go on.

The bytes of a snapshot tell what all topics do, so a client gets them only if it may subscribe to each of them.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import blake2b
from typing import Any, Final, TypeVar

from rosbridge_sim.errors import DocumentError, PeerError, Reason
from rosbridge_sim.graph.topics_services import BodyLimits, Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData, decode
from rosbridge_sim.simulator.plain.reading import Then, answering, read_while_held
from rosbridge_sim.simulator.plain.snapshot_bytes import OwnBytes, OwnKey, SnapshotHead, pack, unpack
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Recordings
from rosbridge_sim.simulator.replays.replay import RecordingKey, Replay
from rosbridge_sim.simulator.replays.replayed_plans import without_denied_plans
from rosbridge_sim.simulator.scene.load import Library, MapKey
from rosbridge_sim.simulator.snapshots.kept_snapshots import MAX_BYTES, MAX_ID, Kept, KeptSnapshots
from rosbridge_sim.simulator.snapshots.node_state import NodeState, SavedState
from rosbridge_sim.simulator.snapshots.snapshot_checks import (
    Refusal,
    check_head,
    check_may_read,
    check_may_restore,
    check_may_save,
)
from rosbridge_sim.world.saved_world import LAYOUT

LARGE: Final = 2**20
"""Size of a state from which on a thread makes hash and bytes [bytes]: half as many take a millisecond or two."""

HASHED_TYPES: Final = ("CtrlCmd", "EgoVehicleStatus", "ObjectStatus", "EventInfo")
"""Messages that stand for a release: each release has changed one of them."""

_LIMITS: Final = BodyLimits(num_bytes=2**30)
"""Of a request with the bytes of a snapshot: one text, which may be as long as a frame."""

_log = logging.getLogger("rosbridge_sim.morai")

T = TypeVar("T")


class _Taken(Record):
    """A snapshot that has been made.

    Attributes:
        kept: to keep.
        own: what `OwnBytes` notes of its bytes; None for a client that did not want them.
        answer: the response to the client, encoded already.
    """

    kept: Kept
    own: OwnKey | None
    answer: Message


class Snapshots(Component):
    """The component of snapshots. What it keeps is no part of a snapshot."""

    def __init__(
        self, context: SimulatorContext, components: Sequence[Component], replay: Replay, recordings: Recordings | None
    ) -> None:
        """Keep nothing yet.

        Args:
            components: all of the simulator, this one perhaps among them.
            replay: has the recording that moves the world.
            recordings: where recordings come from; None for nowhere.
        """
        self._context = context
        self._state = NodeState(context, components)
        self._replay = replay
        self._recordings = recordings
        self._kept = KeptSnapshots(context.bus.account_of(context.participant))
        self._own = OwnBytes()
        self._is_reading = False
        self._is_after_frame = False
        publish_hash, after_frame = self._publish_hash, context.hooks.after_frame
        after_frame.append(publish_hash)
        context.bus.on_topic.append(lambda _topic: after_frame.wake(publish_hash))
        store = context.bus.store
        self._make_info = context.maker("rosbridge_sim_msgs/SnapshotInfo", "id frame size state_hash")
        self._make_hash = context.maker("rosbridge_sim_msgs/StateHash", "header frame hash")
        types = [store.definition(f"morai_msgs/{name}") for name in HASHED_TYPES]
        fields = [[(field.type, field.name) for field in one.fields] for one in types]
        self._definitions = blake2b(repr(fields).encode(), digest_size=8).digest()

    def publish(self, publishers: Publishers) -> None:
        """Publish what the world has once."""
        self._publishers = publishers
        self._topic = publishers.add("/sim/state_hash", "rosbridge_sim_msgs/StateHash", self._hash_message)

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/snapshot", "rosbridge_sim_msgs/Snapshot", self._snapshot)
        bindings.provide("sim/restore", "rosbridge_sim_msgs/Restore", self._restore, limits=_LIMITS)
        bindings.provide("sim/snapshots", "rosbridge_sim_msgs/Snapshots", self._list)
        bindings.provide("sim/state_hash", "rosbridge_sim_msgs/StateHash", self._tell_hash)

    # Hash

    def _tell_hash(self, call: Call, now: float) -> None:
        frame = self._context.world.frame
        if self._context.stepper.is_moving or self._context.sync.has_unready:  # there is no state to save
            call.respond(frame, self._state.hash())
            return
        state = self._state.save()

        def finish(outcome: str | DocumentError, now: float) -> None:
            del now
            if isinstance(outcome, DocumentError):
                call.refuse(str(outcome))
            else:
                call.respond(frame, outcome)

        size = state.size
        self._work(size, self._hash_maker(state, size), finish, call, now)

    def _hash_message(self) -> Struct:
        """Return the hash; None within a frame, because it goes out behind all that a frame does."""
        context = self._context
        if context.stepper.is_moving and not self._is_after_frame:
            return None
        frame = context.world.frame
        return self._make_hash(context.convert.header(frame), frame, self._state.hash())

    def _publish_hash(self, now: float) -> None:
        """Publish the hash behind a frame, for those that listen to it by its name: it is not free of cost."""
        topic = self._topic.topic
        if topic is None or not topic.subscriptions:
            self._context.hooks.after_frame.rest(self._publish_hash)
            return
        if any(not one.is_idle and not one.is_general for one in topic.subscriptions):
            self._is_after_frame = True
            try:
                self._publishers.show_now(self._topic, now)
            finally:
                self._is_after_frame = False

    # Snapshot

    def _snapshot(self, call: Call, now: float) -> None:
        """Take a snapshot: copy the state at once, and have hash and bytes of a large one made in a thread."""
        request: Any = call.request
        struct_type = call.service.type.response.struct_type
        try:
            if request.with_data:
                check_may_read(call.caller, self._publishers)
            name = self._kept.choose_name(request.id)
            check_may_save(self._context)
            self._kept.check_number(name)
            state = self._state.save()
            size = state.size
            self._kept.expect(name, size)
        except Refusal as refusal:
            self._explain(call, refusal)
            call.respond(False, str(refusal), "", self._context.world.frame, "", 0, b"")  # noqa: FBT003 - `result`
            return
        make_head, with_data = self._make_head(state), bool(request.with_data)
        make_hash = self._hash_maker(state, size)

        def make() -> _Taken:
            head = make_head(make_hash())
            data = pack(head, state.to_plain()) if with_data else b""
            values = struct_type(True, "", name, head.frame, head.state_hash, size, data)  # noqa: FBT003 - as above
            answer = Message(call.service.type.response, values)
            if with_data:
                answer.json  # noqa: B018 - it is kept
            return _Taken(Kept(state, head, size), OwnKey.of(data) if with_data else None, answer)

        def finish(taken: _Taken | DocumentError, now: float) -> None:
            del now
            if isinstance(taken, DocumentError):
                self._kept.give_up(name, size)
                call.refuse(str(taken))
                return
            self._kept.keep(name, taken.kept)
            if taken.own is not None:
                self._own.note(taken.own, name, taken.kept.head)
            call.answer_with(taken.answer)

        self._work(size, make, finish, call, now)

    def _work(self, size: int, make: Callable[[], T], finish: Then[T], call: Call, now: float) -> None:
        """Make something of a state of this size [bytes], in a thread if it is large; the caller is held meanwhile."""
        if size < LARGE:
            finish(make(), now)
            return
        hold = partial(self._context.sync_driver.hold, call.caller)
        read_while_held(self._context.reader, make, answering(call.refuse, finish), hold, now)

    def _hash_maker(self, state: SavedState, size: int) -> Callable[[], str]:
        """Return a function that `_work` may call with this size, and that makes the hash of the state of now.

        For a small one the world itself is hashed, because to restore the copy would cost more than all the rest.
        """
        return self._state.hash if size < LARGE else partial(self._state.hash_of, state)

    def _make_head(self, state: SavedState) -> Callable[[str], SnapshotHead]:
        """Return a function that makes the head of a snapshot from the hash of its state."""
        context, recording = self._context, self._replay.recording_key
        return partial(
            SnapshotHead,
            LAYOUT,
            self._definitions,
            repr(context.convert.profile),
            self._dynamics,
            tuple([(key.name, key.digest) for key in state.maps]),
            None if recording is None else (recording.name, recording.digest),
            context.world.frame,
        )

    def _list(self, call: Call, _now: float) -> None:
        request: Any = call.request
        by_name = self._kept.by_name
        strange = [name for name in request.remove if name not in by_name]
        message = ""
        if strange:
            message = self._no_such(strange[0])
            self._explain(call, Refusal(message, Reason.WRONG_VALUE))
        else:
            for name in request.remove:
                self._kept.drop(name)
        infos = [
            self._make_info(name, kept.head.frame, kept.size, kept.head.state_hash) for name, kept in by_name.items()
        ]
        call.respond(not strange, message, infos, MAX_BYTES - self._kept.num_bytes)

    def _no_such(self, name: str) -> str:
        known = ", ".join(list(self._kept.by_name)[-5:]) or "none"
        return f"id: no snapshot {name[:MAX_ID]!r}; known are {known}"

    # Restore

    def _restore(self, call: Call, now: float) -> None:
        request: Any = call.request
        try:
            check_may_restore(self._context, request.user_id)
            if bool(request.id) == bool(request.data):
                raise Refusal("expected either id or data", Reason.WRONG_VALUE)  # noqa: TRY301 - as the others
            restoration = _Restoration(call, request.user_id)
            if request.id:
                kept = self._kept.by_name.get(request.id)
                if kept is None:
                    raise Refusal(self._no_such(request.id), Reason.WRONG_VALUE)  # noqa: TRY301 - as the others
                restoration.head, restoration.state = kept.head, kept.state
            else:
                self._find(restoration, bytes(request.data))
            self._gather(restoration, now)
        except (Refusal, PeerError, DocumentError) as error:
            self._refuse(call, error)

    def _find(self, restoration: _Restoration, data: bytes) -> None:
        """Find out whether bytes are those of a snapshot of this process, which perhaps is kept."""
        own = self._own.find(data)
        kept = None if own is None else self._kept.by_name.get(own[0])
        if own is not None and kept is not None and kept.head is own[1]:
            restoration.head, restoration.state = kept.head, kept.state
        else:
            restoration.data, restoration.is_foreign = data, own is None
            restoration.maps = self._state.save().maps

    @property
    def _dynamics(self) -> str:
        """The settings of the models, as on the command line."""
        world = self._context.world
        name = world.dynamics.name.lower().replace("_", "-")
        impacts = " --on-collision impact" if world.has_impacts else ""
        stability = "" if world.has_stability_control else " --no-stability-control"
        return f"--dynamics {name}{' --creep' if world.is_creeping else ''}{stability}{impacts}"

    def _gather(self, restoration: _Restoration, now: float) -> None:
        """Restore, at once or when all that is missing has been read.

        Raises:
            Refusal: the client may not restore, a recording cannot be had, or another restore waits.
            DocumentError: the snapshot is not a good one.
            GraphError: a client has a topic that an ego of it needs.
        """
        if restoration.head is None:
            self._read(restoration, partial(_decode, restoration.data), restoration.take_decoded, now)
            return
        check_head(restoration.head, self._definitions, repr(self._context.convert.profile), self._dynamics)
        missing = restoration.missing_maps
        key = restoration.recording_key
        if key is not None and restoration.recording is None:
            restoration.recording = self._replay.find_recording(key)
        if missing:
            self._read(restoration, partial(_read_maps, self._context.library, missing), restoration.take_maps, now)
        elif key is not None and restoration.recording is None:
            if self._recordings is None:
                raise Refusal("recording: no recordings are kept here", Reason.WRONG_VALUE)
            self._begin_reading(restoration)
            reading = RecordingBuilder(key.name, self._context.convert)
            then = partial(self._go_on, restoration, partial(restoration.take_recording, key))
            self._recordings.read(key.name, reading, answering(restoration.call.refuse, then))
        elif restoration.state is None:
            self._read(restoration, partial(_parse, self._state, restoration), restoration.take_state, now)
        else:
            self._carry_out(restoration, restoration.state, now)

    def _begin_reading(self, restoration: _Restoration) -> None:
        """Hold the client while something is read for it.

        Raises:
            Refusal: another restore waits; each one may need much memory.
        """
        if self._is_reading:
            raise Refusal("another restore waits for what is being read; try again", Reason.NOT_NOW)
        self._is_reading = True
        if restoration.release is None:
            restoration.release = self._context.sync_driver.hold(restoration.call.caller)

    def _read(self, restoration: _Restoration, work: Callable[[], T], take: Callable[[T], None], now: float) -> None:
        """Have the `Reader` do something, and go on with its result.

        Raises:
            Refusal: another restore waits.
        """
        self._begin_reading(restoration)
        then = partial(self._go_on, restoration, take)
        self._context.reader.read(work, answering(restoration.call.refuse, then), now)

    def _go_on(
        self, restoration: _Restoration, take: Callable[[T], None], outcome: T | DocumentError, now: float
    ) -> None:
        """Go on with a restore when a part of what is missing has been read."""
        self._is_reading = False
        try:
            if isinstance(outcome, DocumentError):
                raise outcome
            take(outcome)
            if not restoration.call.is_done:  # given up, or the client has left: nobody wants it any longer
                check_may_restore(self._context, restoration.user_id)
                self._gather(restoration, now)
        except (Refusal, PeerError, DocumentError) as error:
            self._refuse(restoration.call, error)
        finally:
            if restoration.release is not None and (restoration.call.is_done or not self._is_reading):
                release, restoration.release = restoration.release, None
                release(now)

    def _carry_out(self, restoration: _Restoration, state: SavedState, now: float) -> None:
        head, call = restoration.head, restoration.call
        assert head is not None
        self._state.check_allowed(state, call.caller)
        replay, recording = self._replay, self._replay.recording
        if restoration.recording is not None:
            replay.hand_over(restoration.recording)
        self._state.restore(
            state,
            now,
            expected_hash=head.state_hash if restoration.is_foreign else "",
            before_undo=lambda: replay.hand_over(recording),
        )
        self._context.barrier.restored(now)
        frame = self._context.world.frame
        _log.info("restored by %s, frame %d", call.caller.name, frame)
        call.respond(True, "", frame, head.state_hash)  # noqa: FBT003 - `result`

    def _refuse(self, call: Call, error: Refusal | PeerError | DocumentError) -> None:
        if call.is_done:
            return
        self._explain(call, error)
        call.respond(False, str(error), self._context.world.frame, "")  # noqa: FBT003 - `result`

    def _explain(self, call: Call, error: Refusal | PeerError | DocumentError) -> None:
        reason = Reason.WRONG_VALUE if isinstance(error, DocumentError) else error.reason
        call.explain(error, reason, "warning")


class _Restoration:
    """A restore that is being carried out.

    Attributes:
        call: answered in the end.
        user_id: that the client has named.
        data: of a snapshot that came as bytes and is not kept here; empty when it has been decoded.
        is_foreign: these bytes were not made by this process.
        plain: the state in them, when they have been decoded.
        head: of the snapshot; None until then.
        state: of a snapshot that is kept here, or that has been read and checked.
        maps, recording: what is at hand of the things that it needs.
        release: lets go of the client that is held; None while it is not.
    """

    def __init__(self, call: Call, user_id: str) -> None:
        self.call = call
        self.user_id = user_id
        self.head: SnapshotHead | None = None
        self.state: SavedState | None = None
        self.data = b""
        self.is_foreign = False
        self.plain: PlainData = None
        self.maps: dict[MapKey, RoadMap] = {}
        self.recording: Recording | None = None
        self.release: Callable[[float], None] | None = None

    def take_decoded(self, decoded: tuple[SnapshotHead, PlainData]) -> None:
        """Take what `_decode` has made of the bytes."""
        self.head, self.plain = decoded
        self.data = b""

    def take_maps(self, maps: dict[MapKey, RoadMap]) -> None:
        """Take maps that were not at hand."""
        self.maps |= maps

    def take_recording(self, key: RecordingKey, recording: Recording) -> None:
        """Take the recording that the snapshot needs.

        Raises:
            DocumentError: it is another one.
        """
        if recording.digest != key.digest:
            raise DocumentError(f"recording: {key.name} is another one than that of the snapshot")
        self.recording = without_denied_plans(recording, self.call.caller)

    def take_state(self, state: SavedState) -> None:
        """Take the state that has been checked."""
        self.state, self.plain = state, None

    @property
    def missing_maps(self) -> list[MapKey]:
        """Return the maps that are not at hand; a state that is kept here has its own."""
        if self.head is None or self.state is not None:
            return []
        return [key for key in map(MapKey._make, self.head.maps) if key not in self.maps]

    @property
    def recording_key(self) -> RecordingKey | None:
        """Return the recording that the snapshot needs; None for none."""
        return None if self.head is None or self.head.recording is None else RecordingKey(*self.head.recording)

    def find_map(self, key: MapKey) -> RoadMap:
        """Return a map that is at hand.

        Raises:
            DocumentError: it is not, because the head of the snapshot does not name it.
        """
        if key not in self.maps:
            raise DocumentError(f"map {key.name[:80]!r}: it is not among those that the snapshot names")
        return self.maps[key]


def _decode(data: bytes) -> tuple[SnapshotHead, PlainData]:
    """Return the head of a snapshot, and its state as plain data; in a thread of its own, as a rule.

    Raises:
        DocumentError: they are no snapshot, or a damaged one.
    """
    head, packed = unpack(data)
    return head, decode(packed)


def _parse(node_state: NodeState, restoration: _Restoration) -> SavedState:
    """Return the state of a snapshot, checked; in a thread of its own, as a rule.

    Raises:
        DocumentError: it is no state of a simulator like this one.
    """
    try:
        state = node_state.parse(restoration.plain, restoration.find_map)
    except PeerError as error:
        raise DocumentError(str(error)) from None
    if restoration.is_foreign:
        node_state.try_out(state)
    return state


def _read_maps(library: Library, keys: Sequence[MapKey]) -> dict[MapKey, RoadMap]:
    """Read maps; in a thread of its own, as a rule.

    Raises:
        DocumentError: one cannot be had, or is another one than that of the snapshot.
    """
    found = {}
    for key in keys:
        road_map = library.map(key.name)
        if road_map.digest != key.digest:
            raise DocumentError(f"map {key.name[:80]!r}: it is another one than that of the snapshot")
        found[key] = road_map
    return found
