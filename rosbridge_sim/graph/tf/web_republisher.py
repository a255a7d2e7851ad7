"""`/tf2_web_republisher`: transforms for clients that cannot store a tree of frames themselves, as a node of the bus.

It subscribes to `/tf` and `/tf_static`. A client names some frames and a target frame, and gets the poses of these
frames in the target frame. Client libraries ask in one of three ways:
    /republish_tfs            a service; its answer names a new topic of the client            (roslibpy, roslib)
    /tf2_web_republisher/...  the five topics of a ROS 1 action, see `actionlib`               (roslib's TFClient)
    /tf2_web_republisher      a ROS 2 action                                                   (roslib's ROS2TFClient)

Rates are in simulated time, whatever the stamps are: at R Hz, each second has R slots. Changes are checked once in each
slot, at its first transform. So in synchronous mode the result depends only on the frames, and the subscriber gets it
before the answer to the tick. Transforms that come later in a slot are checked in the next slot. A timer does this if
no further transform comes; it also finds topics without subscribers.
With no active requests the subscription is idle: it does not start on-demand publishers. When the next request comes,
earlier transforms of on-demand publishers are outdated and are removed.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import msgspec

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.actionlib import STATUS_PERIOD, Actionlib
from rosbridge_sim.graph.actions import Goal, GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.bus_state import earliest
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.tf.buffer import MAX_TF_FRAMES, Placed, Transform, TransformBuffer, frame_name, turn
from rosbridge_sim.graph.topics_services import BodyLimits, Call, Subscription, Topic
from rosbridge_sim.graph.ways import REPUBLISH_SERVICE, REPUBLISHER_NAME
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message import Message

DEFAULT_TIMEOUT = 10.0
"""Time for which a topic waits for subscribers if the request does not set it [s]."""

MAX_STREAMS = 1_000
MAX_FRAME_PAIRS = 5_000
"""Largest number of active requests, and of frames in all of them; looking up a frame takes about 5 us."""

OWN_STREAMS = 100
OWN_PAIRS = 500
"""The same limits for one client."""

_LIMITS = BodyLimits(
    num_bytes=2**20, containers=6 * MAX_TF_FRAMES + 100, texts=25 * MAX_TF_FRAMES, values=25 * MAX_TF_FRAMES
)
"""Of a message with as many transforms as are kept: each has 0.5 kB, 6 objects, 21 names and texts, 17 values."""

_LONGEST_WAIT = 3_600.0
"""A longer timer is not set [s]."""

_log = logging.getLogger("rosbridge_sim.graph")

_Transforms: TypeAlias = list[Any]
"""A list of geometry_msgs/TransformStamped structs."""


@dataclass(eq=False, slots=True)
class _Stream:
    """One active request.

    Attributes:
        owner: the client.
        sources, target: frame names without a leading slash.
        angle, distance: a source must turn or move by this much to be sent again [rad, m].
        rate: highest rate of checks [Hz]; 0 checks at each transform.
        send: takes the transforms to send.
        told: the pose of each source that was sent last.
        slot: slot of the last check.
        version: version of the frames at the last check.
        is_due_whole: the next check sends all sources, moved or not.
        is_whole: the last message had all sources.
    """

    owner: Participant
    sources: tuple[str, ...]
    target: str
    angle: float
    distance: float
    rate: float
    send: Callable[[_Transforms, float], None]
    told: dict[str, Transform] = field(default_factory=dict)
    slot: int | None = None
    version: int = -1
    is_due_whole: bool = False
    is_whole: bool = False


@dataclass(eq=False, slots=True)
class _StreamTopic:
    """A topic that was made for a request.

    Attributes:
        timeout: longest time without a subscriber [s].
        unheard_since: when the last subscriber left [s]; None while there is one.
        listeners: subscribers at the last check.
    """

    stream: _Stream
    topic: Topic
    timeout: float
    unheard_since: float | None
    listeners: tuple[Subscription, ...] = ()

    def note_listeners(self) -> None:
        """Send everything again if a new subscriber has missed it.

        A message without subscribers contains all sources and is latched for the first subscriber. That subscriber then
        needs only changes, not the same message again.
        """
        before, self.listeners = self.listeners, self.topic.subscriptions
        if not self.listeners:
            self.stream.is_due_whole = True
        elif any(one not in before for one in self.listeners):
            self.stream.is_due_whole = bool(before) or not self.stream.is_whole


class WebRepublisher(Participant):
    """The node that serves the three ways. It announces in the bus's agenda when it is due."""

    name = REPUBLISHER_NAME

    def __init__(self, bus: Bus) -> None:
        """Subscribe to transforms, and offer the service and the actions, for the whole run."""
        self._bus = bus
        self._frames = TransformBuffer()
        self._streams: dict[Goal | Topic, _Stream] = {}
        self._stream_topics: dict[Topic, _StreamTopic] = {}
        self._num_stream_topics = 0
        self._alarm: float | None = None
        self._alarm_set_ns = 0
        self._sweep_due = 0.0
        self._has_ended = False
        self._array_type = bus.store.message("tf2_web_republisher/TFArray")
        self._listening = self._listen("/tf", is_static=False)
        self._listen("/tf_static", is_static=True)
        bus.provide(self, REPUBLISH_SERVICE, "tf2_web_republisher/RepublishTFs", self._serve, is_exclusive=True)
        action = bus.actions.provide(
            *(self, REPUBLISHER_NAME, "tf2_web_republisher/TFSubscription", self._take_goal, self._cancel_goal),
            is_exclusive=True,
        )
        self._feedback_struct = action.type.feedback.struct_type
        self._actionlib = Actionlib(bus, action)
        bus.on_leave.append(self._on_leave)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus to the republisher."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)

    def end(self, error: Exception) -> None:
        """End for ever, because its own timers have failed; the waiting clients are told.

        A request or message that fails is no reason to end: it serves all clients, and only the sender is told then.
        """
        if self._has_ended:
            return
        _log.error("the transform republisher has failed; it is off until the server is restarted", exc_info=error)
        self._has_ended = True
        self._bus.leave(self, 0.0)

    # Time

    def next_due(self, _now: float) -> float | None:
        """Return when `advance` has something to do next [s]; None without active requests."""
        if self._has_ended:
            return None
        due = earliest(self._alarm, self._actionlib.next_due())
        return earliest(due, self._sweep_due) if self._stream_topics else due

    def advance(self, now: float) -> None:
        """Check transforms that came late in their slot, publish the status of goals, remove unused topics."""
        if self._has_ended:
            return
        if self._alarm is not None and now >= self._alarm:
            self._alarm = None
            if self._bus.time_ns != self._alarm_set_ns:  # while simulated time stands still, no new slot comes
                self._update_all(now)
        self._actionlib.advance(now)
        if now >= self._sweep_due:
            self._sweep_due = now + STATUS_PERIOD
            for offer in list(self._stream_topics.values()):
                if offer.topic.has_listener:
                    offer.unheard_since = None
                elif offer.unheard_since is None:
                    offer.unheard_since = now
                elif now - offer.unheard_since >= offer.timeout:
                    self._withdraw(offer, now)

    # Incoming transforms

    def _listen(self, name: str, *, is_static: bool) -> Subscription:
        def hear(_topic: Topic, message: Message, sender: Participant, now: float) -> None:
            problem = self._put(message, sender, is_static=is_static)
            if self._streams:
                self._update_all(now)
            if problem is not None:
                raise problem

        subscription = self._bus.subscribe(
            self, name, hear, type_name="tf2_msgs/TFMessage", is_idle=True, limits=_LIMITS
        )
        for sender, messages in subscription.topic.kept.items():
            for message in messages.messages():
                self._put(message, sender, is_static=is_static)
        return subscription

    def _put(self, message: Message, sender: Participant, *, is_static: bool) -> GraphError | None:
        """Store the valid transforms of a message; return the first error."""
        problem = None
        if len(message.value.transforms) > MAX_TF_FRAMES:
            return GraphError(f"{message.type.name}: expected at most {MAX_TF_FRAMES} transforms, as many as are kept")
        for stamped in message.value.transforms:
            try:
                self._frames.put(stamped, sender, is_static=is_static)
            except GraphError as error:
                problem = problem or error
        return problem

    # Requests

    def _serve(self, call: Call, now: float) -> None:
        """Answer `/republish_tfs` with a new topic."""
        timeout = _seconds(call.request)
        self._num_stream_topics += 1
        name = f"{REPUBLISHER_NAME}/tf_repub_{self._num_stream_topics}"

        def send(transforms: _Transforms, now: float) -> None:
            message = Message(topic.type, self._array_type.struct_type(transforms=transforms))
            self._bus.announce(self, topic, message, now)

        stream = self._open(call.caller, call.request, send)
        topic = self._bus.advertise(self, name, "tf2_web_republisher/TFArray", depth=1, is_exclusive=True)
        self._stream_topics[topic] = _StreamTopic(stream, topic, timeout or DEFAULT_TIMEOUT, unheard_since=now)
        self._bus.agenda.announce(self._sweep_due)
        self._start(topic, stream, now)
        call.respond(topic_name=name)

    def _take_goal(self, goal: Goal) -> None:
        """Start a goal, from the ROS 2 action or from the topics of ROS 1."""

        def send(transforms: _Transforms, now: float) -> None:
            goal.report(self._feedback_struct(transforms=transforms), now)

        self._start(goal, self._open(goal.caller, goal.request, send), 0.0)

    def _cancel_goal(self, goal: Goal) -> None:
        """End a goal that its client has cancelled."""
        self._stop(goal)
        goal.end(GoalStatus.CANCELED, goal.action.type.result.default())

    def _on_leave(self, owner: Participant, now: float) -> None:
        """Remove the topics of an owner that has left, unless other clients use them."""
        for offer in list(self._stream_topics.values()):
            if offer.stream.owner is owner and not offer.topic.has_listener:
                self._withdraw(offer, now)

    def _open(self, owner: Participant, request: Struct, send: Callable[[_Transforms, float], None]) -> _Stream:
        """Return a stream for a request, which is a struct of the service or of the action.

        Raises:
            GraphError: the request is not valid, or there are too many.
        """
        if len(request.source_frames) > MAX_FRAME_PAIRS:
            raise GraphError(f"source_frames: expected at most {MAX_FRAME_PAIRS}, got {len(request.source_frames)}")
        sources = tuple(dict.fromkeys(map(frame_name, request.source_frames)))
        own = [stream for stream in self._streams.values() if stream.owner is owner]
        _check_room(own, len(sources), OWN_STREAMS, OWN_PAIRS, "of yours")
        _check_room(self._streams.values(), len(sources), MAX_STREAMS, MAX_FRAME_PAIRS, "in all")
        return _Stream(
            owner=owner,
            sources=sources,
            target=frame_name(request.target_frame),
            angle=_amount(request.angular_thres, "angular_thres"),
            distance=_amount(request.trans_thres, "trans_thres"),
            rate=_amount(request.rate, "rate"),
            send=send,
        )

    def _start(self, key: Goal | Topic, stream: _Stream, now: float) -> None:
        self._streams[key] = stream
        if self._listening.is_idle:
            self._frames.forget(self._listening.topic.on_demand.__contains__)
            self._listening.is_idle = False
        self._update(stream, now)

    def _stop(self, key: Goal | Topic) -> None:
        self._streams.pop(key, None)
        if not self._streams:
            self._listening.is_idle = True
            self._alarm = None

    def _withdraw(self, offer: _StreamTopic, now: float) -> None:
        del self._stream_topics[offer.topic]
        self._stop(offer.topic)
        self._bus.unadvertise(self, offer.topic.name, now)

    # Outgoing transforms

    def _update_all(self, now: float) -> None:
        """Send all changes; set the alarm for streams that wait for their next slot."""
        version = self._frames.version
        for offer in self._stream_topics.values():
            offer.note_listeners()
        waits = [self._update(stream, now) for stream in list(self._streams.values()) if stream.version != version]
        wait = min((wait for wait in waits if wait is not None), default=None)
        self._alarm = None if wait is None else now + min(wait, _LONGEST_WAIT)
        self._bus.agenda.announce(self._alarm)
        self._alarm_set_ns = self._bus.time_ns

    def _update(self, stream: _Stream, now: float) -> float | None:
        """Send the changes of one stream; if it waits for its next slot, return how long [s]."""
        slot = None
        if stream.rate:
            place = self._bus.time_ns * stream.rate / 1e9
            slot = math.floor(place)
            if slot == stream.slot:
                return (slot + 1 - place) / stream.rate
        stream.version = self._frames.version
        if stream.is_due_whole:
            stream.told.clear()
            stream.is_due_whole = False
        changed, num_placed = [], 0
        for source in stream.sources:
            placed = self._frames.look_up(stream.target, source)
            if placed is None:
                continue
            stream.slot = slot
            num_placed += 1
            if _has_moved(stream, stream.told.get(source), placed.pose):
                stream.told[source] = placed.pose
                changed.append(self._make_transform(stream.target, source, placed))
        if changed:
            stream.is_whole = len(changed) == num_placed
            stream.send(changed, now)
        return None

    @cached_property
    def _make_transform(self) -> Callable[[str, str, Placed], msgspec.Struct]:
        return _transform_maker(self._bus)


def _has_moved(stream: _Stream, told: Transform | None, pose: Transform) -> bool:
    """Return whether a pose differs from the one sent last by more than the thresholds of the request."""
    if told is None:
        return True
    if told == pose:
        return False
    return math.dist(told[:3], pose[:3]) > stream.distance or turn(told, pose) > stream.angle


def _check_room(streams: Iterable[_Stream], num_more: int, max_streams: int, max_pairs: int, whose: str) -> None:
    """Raise GraphError if there is no room for another request with so many frames."""
    sizes = [len(stream.sources) for stream in streams]
    if len(sizes) >= max_streams or sum(sizes) + num_more > max_pairs:
        raise GraphError(f"At most {max_streams} requests for transforms, of {max_pairs} frames, {whose} are served")


def _amount(value: float, name: str) -> float:
    """Return a number of a request; 0 if it is missing.

    Raises:
        GraphError: it is negative or not a number.
    """
    if not 0.0 <= value < math.inf:
        raise GraphError(f"{name}: expected 0 or more, got {value!r}")
    return value


def _seconds(request: Struct) -> float:
    """Return the timeout of a request [s]; 0 or less means the default."""
    whole, nanoseconds = msgspec.structs.astuple(request.timeout)
    return max(0.0, float(whole + nanoseconds / 1e9))


def _transform_maker(bus: Bus) -> Callable[[str, str, Placed], msgspec.Struct]:
    """Return a function that makes a TransformStamped with the pose of a source in a target."""
    store = bus.store
    names = ("std_msgs/Header", "geometry_msgs/TransformStamped", "geometry_msgs/Transform")
    header, stamped, transform = (store.message(name).struct_type for name in names)
    vector, quaternion = (store.message(f"geometry_msgs/{name}").struct_type for name in ("Vector3", "Quaternion"))

    def make(target: str, source: str, placed: Placed) -> msgspec.Struct:
        x, y, z, qx, qy, qz, qw = placed.pose
        stamp = placed.stamp or store.time_value(bus.stamp_ns)
        return stamped(
            header=header(stamp=stamp, frame_id=target),
            child_frame_id=source,
            transform=transform(translation=vector(x=x, y=y, z=z), rotation=quaternion(x=qx, y=qy, z=qz, w=qw)),
        )

    return make
