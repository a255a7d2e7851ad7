"""A mock's file compiled for the message types of a server: what is sent when, and all mistakes with their lines."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, Final, TypeVar

from rosbridge_sim.documents.document_model import Mistake, Place
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.documents.yaml_reading import YamlDocument
from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.mock.message_maker import MessageMaker, fits
from rosbridge_sim.mock.mock_model import MOCK, MockDocument, MockRecording, MockTransform
from rosbridge_sim.mock.recorded_topics import RecordedFile
from rosbridge_sim.mock.value_patterns import SECOND_NS, ConstantPart, MessageTime, Part
from rosbridge_sim.records import Record
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from rosbridge_sim.world.geometry.planar import quaternion

T = TypeVar("T")

MAX_MESSAGES: Final = 100_000.0
"""Most messages of all topics together [Hz]: several times what one core can make."""


class TopicPlan(Record):
    """A topic of a mock.

    Attributes:
        period_ns: time between two messages [ns]; None for a single one.
        reads: topics whose last messages its expressions read.
    """

    name: str
    type: MessageType
    period_ns: int | None
    is_latching: bool
    make: Part
    reads: frozenset[str] = frozenset()


class AnswerPlan(Record):
    """An answer of a service.

    Attributes:
        make: makes the response; None to fail with `fail`.
    """

    fits: Callable[[Any], bool]
    make: Part | None
    delay_ns: int
    fail: str


class GoalPlan(Record):
    """The course of a goal; `feedback` is None without feedback."""

    fits: Callable[[Any], bool]
    duration_ns: int
    feedback: Part | None
    feedback_ns: int
    outcome: str
    result: Part


class MockPlan(Record):
    """All that a mock does.

    Attributes:
        latest: topic -> its last message, for expressions; changes while the mock runs.
        services, actions: type name, and answers or courses, by absolute name.
    """

    document: MockDocument
    topics: tuple[TopicPlan, ...]
    recordings: tuple[RecordedFile, ...]
    subscribers: Mapping[str, str]
    services: Mapping[str, tuple[str, tuple[AnswerPlan, ...]]]
    actions: Mapping[str, tuple[str, tuple[GoalPlan, ...]]]
    latest: dict[str, Struct]


class MockFiles:
    """Reads the files that a mock's file names; this one has none."""

    def read(self, path: str) -> bytes:
        """Return the content of a file.

        Raises:
            DocumentError: it cannot be read.
        """
        raise DocumentError(f"{path}: expected no files here")

    def record(self, recording: MockRecording, others: Collection[str]) -> RecordedFile:
        """Return the messages of a bag.

        Args:
            others: topics that are left out.

        Raises:
            DocumentError: it cannot be read, or has none of the topics.
        """
        raise DocumentError(f"{recording.file}: expected no files here, and none without {len(others)} topics")


def plan_mock(
    document: YamlDocument, store: Store, files: MockFiles, tell: Callable[[str], None], *, seed: int = 0
) -> tuple[MockPlan | None, list[Mistake]]:
    """Return the plan of a mock's file, or None and its mistakes.

    Args:
        store: the message types of the server.
        tell: gets each mistake that an expression makes while the mock runs, once.
        seed: in addition to that of the file.
    """
    checked = check_values(MOCK, document.value, document.where)
    mock, mistakes = checked
    if mock is None:
        return None, mistakes
    maker = MessageMaker(document.where, files.read, tell, mock.seed + (seed << 32))
    plan = _Planner(mock, store, files, maker).plan()
    mistakes = sorted(maker.mistakes, key=lambda mistake: document.line(mistake.place))
    return (None, mistakes) if mistakes else (plan, [])


def absolute(name: str) -> str:
    """Return a name with its slash."""
    return name if name.startswith("/") else f"/{name}"


SERVER_TYPES: Final = {
    "/client_count": dict.fromkeys((1, 2), "std_msgs/Int32"),
    "/connected_clients": dict.fromkeys((1, 2), "rosbridge_msgs/ConnectedClients"),
    "/rosout": {1: "rosgraph_msgs/Log", 2: "rcl_interfaces/Log"},
    "/sim/clients": dict.fromkeys((1, 2), "rosbridge_sim_msgs/Clients"),
    "/sim/refusals": dict.fromkeys((1, 2), "rosbridge_sim_msgs/Refusals"),
    "/sim/topics": dict.fromkeys((1, 2), "rosbridge_sim_msgs/Topics"),
    "/tf": dict.fromkeys((1, 2), "tf2_msgs/TFMessage"),
    "/tf_static": dict.fromkeys((1, 2), "tf2_msgs/TFMessage"),
}
"""The type that the server itself gives to a topic, in each ROS generation."""


class _Planner:
    """Compiles one file."""

    def __init__(self, mock: MockDocument, store: Store, files: MockFiles, maker: MessageMaker) -> None:
        self._mock, self._store, self._files, self._maker = mock, store, files, maker

    def plan(self) -> MockPlan:
        """Return the plan; it is of no use if there are mistakes."""
        mock = self._mock
        self._check_names()
        subscribers = {absolute(name): type_name for name, type_name in mock.subscribers.items()}
        for name, type_name in mock.subscribers.items():
            self._know(name, type_name, ("subscribers", name))
        for name, topic in mock.topics.items():
            self._know(name, topic.type, ("topics", name, "type"))
        recordings = self._recordings()
        self._check_rates()
        return MockPlan(
            mock,
            (*self._topics(), *self._transforms()),
            recordings,
            subscribers,
            {absolute(name): (each.type, self._answers(name)) for name, each in mock.services.items()},
            {absolute(name): (each.type, self._goals(name)) for name, each in mock.actions.items()},
            self._maker.latest,
        )

    def _check_names(self) -> None:
        """Note names that differ by a slash alone, and names that the mock needs itself."""
        mock = self._mock
        for key, things in (("topics", mock.topics), ("services", mock.services), ("actions", mock.actions)):
            own_names = ("/mock/", "/rosapi/") if key == "services" else ("/mock/",)
            seen: set[str] = set()
            for name in things:
                own = next((each for each in own_names if absolute(name).startswith(each)), None)
                if absolute(name) in seen or own is not None:
                    why = "it is there twice" if own is None else f"the mock's own names begin with {own}"
                    self._maker.note((key, name), f"expected another name: {why}")
                seen.add(absolute(name))

    def _check_rates(self) -> None:
        total = sum(topic.rate or 0.0 for topic in self._mock.topics.values())
        if total > MAX_MESSAGES:
            self._maker.note(("topics",), f"expected at most {MAX_MESSAGES:,.0f} messages a second, got {total:,.0f}")

    def _know(self, name: str, type_name: str, place: Place) -> None:
        found = self._type(self._store.message, type_name, place)
        if found is None:
            return
        self._maker.types[absolute(name)] = found
        fixed = SERVER_TYPES.get(absolute(name), {}).get(self._store.ros, found.name)
        if found.name != fixed:
            self._maker.note(place, f"expected {fixed}, the type of {absolute(name)} in each server, got {found.name}")

    def _type(self, find: Callable[[str], T], name: str, place: Place) -> T | None:
        """Return a type, or note why there is none."""
        try:
            return find(name)
        except PeerError as error:
            self._maker.note(place, str(error))
            return None

    # Topics

    def _topics(self) -> list[TopicPlan]:
        plans = []
        for name, topic in self._mock.topics.items():
            message_type = self._maker.types.get(absolute(name))
            if message_type is None:
                continue
            make = self._maker.message(message_type, topic.value, ("topics", name, "value"))
            period_ns = None if topic.rate is None else round(SECOND_NS / topic.rate)
            is_latching = topic.latch or period_ns is None
            reads = frozenset(self._maker.reads)
            plans.append(TopicPlan(absolute(name), message_type, period_ns, is_latching, make, reads))
        return plans

    def _transforms(self) -> list[TopicPlan]:
        """Return a topic for each rate, /tf_static for those without one."""
        transforms = self._mock.transforms
        if not transforms:
            return []
        message_type = self._store.message("tf2_msgs/TFMessage")
        one = self._store.message("geometry_msgs/TransformStamped")
        plans = []
        for rate in dict.fromkeys(each.rate for each in transforms):
            parts: list[Part] = []
            reads: set[str] = set()
            for i, each in enumerate(transforms):
                if each.rate == rate:
                    parts.append(self._transform(one, each, ("transforms", i)))
                    reads |= self._maker.reads
            name, period_ns = ("/tf_static", None) if rate is None else ("/tf", round(SECOND_NS / rate))
            make = _message_of(message_type, parts)
            plans.append(TopicPlan(name, message_type, period_ns, period_ns is None, make, frozenset(reads)))
        return plans

    def _transform(self, message_type: MessageType, each: MockTransform, place: Place) -> Part:
        """Return a transform, whose rotation comes from angles."""
        angles = self._store.message("geometry_msgs/Vector3")
        rotation = {"x": each.roll, "y": each.pitch, "z": each.yaw}
        turn = self._maker.message(angles, rotation, place)
        reads = set(self._maker.reads)
        tree = {
            "header": {"frame_id": each.parent},
            "child_frame_id": each.child,
            "transform": {"translation": {"x": each.x, "y": each.y, "z": each.z}},
        }
        make = self._maker.message(message_type, tree, place)
        self._maker.reads |= reads
        quaternion_type = self._store.message("geometry_msgs/Quaternion").struct_type

        def transform(moment: MessageTime) -> Struct:
            value, angle = make(moment), turn(moment)
            inner = value.transform.__copy__()
            inner.rotation = quaternion_type(*quaternion(angle.x, angle.y, angle.z))
            value.transform = inner
            return value

        return transform

    def _recordings(self) -> tuple[RecordedFile, ...]:
        found = []
        for i, recording in enumerate(self._mock.recordings):
            try:
                chosen = self._files.record(recording, self._maker.types.keys())
            except DocumentError as error:
                self._maker.note(("recordings", i), str(error))
                continue
            for track in chosen.tracks:
                self._know(track.name, track.type_name, ("recordings", i))
            found.append(chosen)
        return tuple(found)

    # Services and actions

    def _answers(self, name: str) -> tuple[AnswerPlan, ...]:
        service = self._mock.services[name]
        found = self._type(self._store.service, service.type, ("services", name, "type"))
        if found is None:
            return ()
        plans = []
        for i, answer in enumerate(service.answers):
            place = ("services", name, "answers", i)
            make = None
            if answer.fail is None:
                make = self._maker.message(found.response, answer.value, (*place, "value"), found.request)
            elif answer.value is not None:
                self._maker.note(place, "expected value or fail, got both")
            test = self._fits(found.request, answer.when, (*place, "when"))
            plans.append(AnswerPlan(test, make, round(answer.delay * SECOND_NS), answer.fail or ""))
        return tuple(plans) or (AnswerPlan(_always, self._maker.message(found.response, None, ()), 0, ""),)

    def _goals(self, name: str) -> tuple[GoalPlan, ...]:
        action = self._mock.actions[name]
        found = self._type(self._store.action, action.type, ("actions", name, "type"))
        if found is None:
            return ()
        plans = []
        for i, goal in enumerate(action.goals):
            place = ("actions", name, "goals", i)
            feedback = None
            if goal.feedback is not None:
                feedback = self._maker.message(found.feedback, goal.feedback, (*place, "feedback"), found.goal)
            plans.append(
                GoalPlan(
                    self._fits(found.goal, goal.when, (*place, "when")),
                    round(goal.duration * SECOND_NS),
                    feedback,
                    round(SECOND_NS / goal.feedback_rate),
                    goal.outcome,
                    self._maker.message(found.result, goal.result, (*place, "result"), found.goal),
                )
            )
        usual = GoalPlan(_always, SECOND_NS, None, SECOND_NS, "succeeded", self._maker.message(found.result, None, ()))
        return tuple(plans) or (usual,)

    def _fits(self, request: MessageType, when: object, place: Place) -> Callable[[Any], bool]:
        """Return a function that tells whether an answer is for a request."""
        if when is None:
            return _always
        if isinstance(when, str):
            return self._maker.condition(when, request, place)
        num = len(self._maker.mistakes)
        made = self._maker.message(request, when, place)
        if len(self._maker.mistakes) > num or not isinstance(when, dict):
            return _always
        if not isinstance(made, ConstantPart) and "$" in repr(when):
            self._maker.note(place, "expected constants, or an expression such as 'a > 3'")
            return _always
        return fits(request.spec, when)


def _always(_request: object) -> bool:
    return True


def _message_of(message_type: MessageType, parts: list[Part]) -> Part:
    return lambda moment: message_type.struct_type(transforms=[part(moment) for part in parts])
