"""`/rosapi/*`: services that list what is on the bus.

Each service is a row of one table: its name, its type, and a method that makes the response fields from the request.
Clients of both ROS generations find the names they know. Lists are sorted by name, and parallel lists match where
rosapi says so.
A name that the policy does not allow is not listed, and a request for it gets the answer that it does not exist. A
request for a parameter that is not allowed is refused.
Parameters live in memory as long as the process, see `graph/parameters.py`; values are JSON texts on the wire.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import orjson

from rosbridge_sim.errors import GraphError, TypeNameError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.parameters import MAX_PARAMETERS, MAX_VALUE_PARTS
from rosbridge_sim.graph.participant import NodeRole, Participant, resolve
from rosbridge_sim.graph.policy import OPEN, Policy, Rule
from rosbridge_sim.graph.topics_services import Call, Service, Topic
from rosbridge_sim.protocol.body_limits import BodyLimits
from rosbridge_sim.records import asdict
from rosbridge_sim.schema.definitions.names import DefinitionKind
from rosbridge_sim.schema.definitions.typedefs import full_text, typedefs
from rosbridge_sim.schema.message_type import MessageType

ROSAPI_NAME = "/rosapi"

_BAD_VALUE = (
    "Due to the type flexibility of the ROS parameter server, the value argument to set_param must be a"
    " JSON-formatted string."
)

MAX_RAW_CHARS = 8 * 2**20
"""Largest size of the definitions in one answer: enough for a thousand topics of the longest types. An answer is held
as values, as text and as a frame, and a client may ask for several at once."""

_SET_LIMITS = BodyLimits(num_bytes=4 * 2**20, containers=MAX_VALUE_PARTS, texts=MAX_VALUE_PARTS, values=MAX_VALUE_PARTS)
"""Of a request to set a parameter, whose value is JSON text. A value of 4 MB takes 20 ms."""

_OMITTED = (
    f"# omitted: the definitions of all topics have more than {MAX_RAW_CHARS} characters; see rosapi/MessageDetails"
)

_ACTIONLIB = ("cancel", "feedback", "result", "status")
"""Topics of a ROS 1 action server in addition to `goal`."""

_SERVICE_PARTS = ("request", "response")
_PARTS = ("message", *_SERVICE_PARTS, "goal", "result", "feedback")
"""A message itself, and the parts of the types of services and actions; each is a message."""

_SERVICES = (
    *("topics", "topics_for_type", "topic_type", "publishers", "subscribers", "topics_and_raw_types", "interfaces"),
    *("services", "services_for_type", "service_type", "service_providers", "service_node", "service_host"),
    *("nodes", "node_details", "action_servers", "action_type", "get_ros_version", "get_time"),
    *("get_param", "has_param", "delete_param", "search_param", "get_param_names"),
)
"""Services that a method of the same name answers; `topic_type` has the type `rosapi/TopicType`, and so on."""

_DETAILS = ("message", "service_request", "service_response", "action_goal", "action_result", "action_feedback")
"""Services for the fields of types, without `_details` at the end."""

_OTHER_TYPES = {"action_servers": "GetActionServers", "get_ros_version": "GetROSVersion"}

_DISTROS = {1: "noetic", 2: "jazzy"}
"""The distributions that the built-in standard definitions come from."""

_ROSCORE = {"/rosdistro": f"{_DISTROS[1]}\n", "/rosversion": "1.16.0\n"}
"""Parameters that the roscore of that distribution sets, with these line ends; clients read them."""

_UNSET = {1: "null", 2: '""'}
"""Value of a parameter that is not set and has no default, as rosapi of each generation answers."""

_Request: TypeAlias = Any
"""A struct made from a definition at run time, so a type checker cannot know its fields."""

_Fields: TypeAlias = dict[str, Any]
"""The fields of a response; each has its own type."""


class Rosapi(Participant):
    """The owner of the rosapi services."""

    name = ROSAPI_NAME

    def __init__(self, bus: Bus, policy: Policy = OPEN, run_id: str = "") -> None:
        """Offer all services, and set the parameters that a roscore sets.

        Args:
            policy: the rights of clients; only what it allows is listed.
            run_id: value of the parameter `/run_id`, another one in each run; empty to set no parameters.
        """
        self._bus = bus
        self._spelled = bus.store.spelled
        self._policy = policy
        self._params = bus.parameters
        self._may_use_all = policy.parameter == Rule()
        self._verdicts: dict[str, bool] = {}
        answers = {f"{one}_details": self._details(one.rpartition("_")[2]) for one in _DETAILS}
        answers |= {name: getattr(self, f"_{name}") for name in _SERVICES}
        for name, respond in answers.items():
            type_name = _OTHER_TYPES.get(name) or "".join(map(str.capitalize, name.split("_")))
            bus.provide(self, f"/rosapi/{name}", f"rosapi/{type_name}", _handler(respond), is_exclusive=True)
        bus.provide(
            self,
            "/rosapi/definition",
            "rosbridge_sim_msgs/Definition",  # the rosapi of ROS has no such service
            _handler(self._definition),
            is_exclusive=True,
        )
        bus.provide(
            self, *("/rosapi/set_param", "rosapi/SetParam", self._set_param), is_exclusive=True, limits=_SET_LIMITS
        )
        if run_id and bus.store.ros == 1:
            for name, text in {**_ROSCORE, "/run_id": run_id}.items():
                self._params.put(name, _to_text(text), self)
        bus.on_leave.append(self._on_leave)

    # Topics

    def _sorted_topics(self) -> list[Topic]:
        may_see = self._policy.may_see
        hides = self._bus.store.ros == 2  # noqa: PLR2004 - ROS 2 hides names with /_
        topics = (
            t for n, t in sorted(self._bus.topics.items()) if may_see(n, t.type.name) and not (hides and "/_" in n)
        )
        return [topic for topic in topics if topic.publishers or topic.all_subscriptions]

    def _find_topic(self, name: str) -> Topic | None:
        topic = self._bus.find_topic(name)
        return topic if topic is not None and self._policy.may_see(topic.name, topic.type.name) else None

    def _topics(self, _request: _Request) -> _Fields:
        topics = self._sorted_topics()
        return {"topics": [t.name for t in topics], "types": [self._spelled(t.type.name, "msg") for t in topics]}

    def _topics_for_type(self, request: _Request) -> _Fields:
        wanted = self._bus.store.canonical(request.type)
        return {"topics": [t.name for t in self._sorted_topics() if t.type.name == wanted]}

    def _topic_type(self, request: _Request) -> _Fields:
        topic = self._find_topic(request.topic)
        return {"type": self._spelled(topic.type.name, "msg") if topic else ""}

    def _publishers(self, request: _Request) -> _Fields:
        topic = self._find_topic(request.topic)
        return {"publishers": _node_names(topic.publishers if topic else (), "publisher", request.topic)}

    def _subscribers(self, request: _Request) -> _Fields:
        topic = self._find_topic(request.topic)
        return {
            "subscribers": _node_names(
                {s.owner: None for s in (topic.all_subscriptions if topic else ())}, "subscriber", request.topic
            )
        }

    # Services

    def _sorted_services(self) -> list[Service]:
        may_call = self._policy.may_call
        hidden = "/_" if self._bus.store.ros == 2 else "/_action/"  # noqa: PLR2004 - see above; ROS 1 has no such services
        return [s for n, s in sorted(self._bus.services.items()) if may_call(n) and hidden not in n]

    def _find_service(self, name: str) -> Service | None:
        service = self._bus.services.get(resolve(name))
        return service if service is not None and self._policy.may_call(service.name) else None

    def _services(self, _request: _Request) -> _Fields:
        return {"services": [service.name for service in self._sorted_services()]}

    def _services_for_type(self, request: _Request) -> _Fields:
        wanted = self._bus.store.canonical(request.type)
        return {"services": [s.name for s in self._sorted_services() if s.type.name == wanted]}

    def _service_type(self, request: _Request) -> _Fields:
        service = self._find_service(request.service)
        return {"type": self._spelled(service.type.name, "srv") if service else ""}

    def _service_providers(self, request: _Request) -> _Fields:
        """Return the providers of a *type*, though the field is called `service`.

        The name of a service is accepted, too.
        """
        named = self._find_service(request.service)
        if named is not None:
            return {"providers": [_provider(named)]}
        wanted = self._bus.store.canonical(request.service)
        return {"providers": sorted({_provider(s) for s in self._sorted_services() if s.type.name == wanted})}

    def _service_node(self, request: _Request) -> _Fields:
        service = self._find_service(request.service)
        return {"node": _provider(service) if service else ""}

    def _service_host(self, request: _Request) -> _Fields:
        return {"host": "localhost" if self._find_service(request.service) else ""}

    # Nodes

    def _nodes(self, _request: _Request) -> _Fields:
        return {"nodes": _node_names(self._bus.owners())}

    def _node_details(self, request: _Request) -> _Fields:
        node = resolve(request.node)
        topics = self._sorted_topics()
        return {
            "subscribing": [
                t.name for t in topics if any(node in s.owner.nodes("subscriber", t.name) for s in t.all_subscriptions)
            ],
            "publishing": [t.name for t in topics if any(node in o.nodes("publisher", t.name) for o in t.publishers)],
            "services": [s.name for s in self._sorted_services() if _provider(s) == node],
        }

    # Types

    def _topics_and_raw_types(self, _request: _Request) -> _Fields:
        """Return the definitions of all topics, for Lichtblick's readers; for an unknown type, a comment."""
        topics = self._sorted_topics()
        # Of each type once: there may be thousands of topics.
        names = {topic.type.name for topic in topics}
        types = {name: (self._spelled(name, "msg"), self._full_text(name)) for name in names}
        texts: list[str] = []
        num_chars = 0
        for topic in topics:
            text = types[topic.type.name][1]
            num_chars += len(text)
            texts.append(text if num_chars <= MAX_RAW_CHARS else _OMITTED)
        return {
            "topics": [t.name for t in topics],
            "types": [types[t.type.name][0] for t in topics],
            "typedefs_full_text": texts,
        }

    def _full_text(self, name: str) -> str:
        try:
            return self._bus.store.full_text(name)
        except TypeNameError as error:
            return f"# failed to get full definition text for {name}: {error}"

    def _details(self, part: str) -> Callable[[_Request], _Fields]:
        """Return what answers a question for the fields of a message, or of a part of a service or an action."""

        def describe(request: _Request) -> _Fields:
            make = self._bus.store.message("rosapi/TypeDef").struct_type
            return {"typedefs": [make(**asdict(one)) for one in typedefs(self._part_of(request.type, part).spec)]}

        return describe

    def _part_of(self, name: str, part: str) -> MessageType:
        """Return a message, or a part of a service or an action."""
        store = self._bus.store
        if part == "message":
            return store.message(name)
        found: MessageType = getattr(store.service(name) if part in _SERVICE_PARTS else store.action(name), part)
        return found

    def _definition(self, request: _Request) -> _Fields:
        """Return the text of any type, for forms that show comments and units."""
        part = request.part or "message"
        if part not in _PARTS:
            raise GraphError(f"part: expected one of {', '.join(_PARTS)}; got {part[:40]}")
        if part == "message":
            return {"text": self._bus.store.full_text(request.type)}
        return {"text": full_text(self._part_of(request.type, part).spec)}

    def _interfaces(self, _request: _Request) -> _Fields:
        store, spelled = self._bus.store, self._spelled
        kinds: tuple[DefinitionKind, ...] = ("msg", "srv", "action")
        return {"interfaces": sorted({spelled(name, kind) for kind in kinds for name in store.names(kind)})}

    def _get_ros_version(self, _request: _Request) -> _Fields:
        return {"version": self._bus.store.ros, "distro": _DISTROS[self._bus.store.ros]}

    # Actions

    def _action_servers(self, _request: _Request) -> _Fields:
        """Return servers of both kinds: actions of the bus, and groups of five actionlib topics."""
        names = {topic.name for topic in self._sorted_topics()}
        by_topics = {
            name.removesuffix("/goal")
            for name in names
            if name.endswith("/goal") and all(name.removesuffix("goal") + part in names for part in _ACTIONLIB)
        }
        own = {name for name in self._bus.actions.by_name if self._policy.may_send_goal(name)}
        return {"action_servers": sorted(by_topics | own)}

    def _action_type(self, request: _Request) -> _Fields:
        name = resolve(request.action)
        action = self._bus.actions.by_name.get(name) if self._policy.may_send_goal(name) else None
        return {"type": self._spelled(action.type.name, "action") if action else ""}

    # Time and parameters

    def _get_time(self, _request: _Request) -> _Fields:
        return {"time": self._bus.store.time_value(self._bus.stamp_ns)}

    def _parameter_name(self, given: str) -> str:
        """Return the absolute name of a parameter that clients may use."""
        self._policy.check_parameter(given)
        return resolve(given)

    def _may_use(self, name: str) -> bool:
        """Return True if clients may use a parameter. The result is stored, because patterns are slow."""
        if self._may_use_all:
            return True
        verdict = self._verdicts.get(name)
        if verdict is None:
            if len(self._verdicts) > 2 * MAX_PARAMETERS:
                self._verdicts.clear()
            verdict = self._verdicts[name] = self._policy.parameter.admits(name)
        return verdict

    def _usable(self, names: list[str]) -> list[str]:
        """Return the names that clients may use."""
        return names if self._may_use_all else list(filter(self._may_use, names))

    def _is_set(self, name: str) -> bool:
        return name in self._params or self._params.has_below(_prefix(name), self._may_use)

    def _set_param(self, call: Call, _now: float) -> None:
        request: _Request = call.request
        try:
            self._params.put(self._parameter_name(request.name), request.value, call.caller)
        except orjson.JSONDecodeError:
            raise GraphError(_BAD_VALUE) from None
        call.respond()

    def _get_param(self, request: _Request) -> _Fields:
        name = self._parameter_name(request.name)
        if name in self._params:
            return {"value": self._params.text(name)}
        below = self._usable(self._params.below(_prefix(name)))
        if below:
            return {"value": self._params.tree(name, below)}
        if request.default:
            return {"value": as_json_text(request.default)}
        # clients parse the value before they check for success, so it must be JSON text
        return {"value": _UNSET[self._bus.store.ros], "successful": False, "reason": f"Parameter {name} is not set"}

    def _has_param(self, request: _Request) -> _Fields:
        return {"exists": self._is_set(self._parameter_name(request.name))}

    def _delete_param(self, request: _Request) -> _Fields:
        name = self._parameter_name(request.name)
        gone = [name] if name in self._params else []
        gone += self._usable(self._params.below(name + "/"))
        if not gone:
            raise GraphError(f"Parameter {name} is not set")
        self._params.remove(gone)
        return {}

    def _search_param(self, request: _Request) -> _Fields:
        """Return the parameter that a node would find from its namespace.

        Clients have no namespace, so the root is searched.
        """
        name = self._parameter_name(request.name)
        return {"global_name": name if self._is_set(name) else ""}

    def _get_param_names(self, _request: _Request) -> _Fields:
        return {"names": self._usable(list(self._params))}

    def _on_leave(self, owner: Participant, _now: float) -> None:
        self._params.disown(owner)


def _prefix(namespace: str) -> str:
    """Return the prefix of all names in a namespace."""
    return namespace.rstrip("/") + "/"


def _handler(respond: Callable[[_Request], _Fields]) -> Callable[[Call, float], None]:
    def handle(call: Call, _now: float) -> None:
        call.respond(**respond(call.request))

    return handle


def _node_names(owners: Iterable[Participant], role: NodeRole = "any", name: str = "") -> list[str]:
    """Return each node name once, sorted; all clients are one node."""
    name = resolve(name) if name else ""
    return sorted({node for owner in owners for node in owner.nodes(role, name)})


def _provider(service: Service) -> str:
    """Return the name of the node that provides a service."""
    return next(iter(service.owner.nodes("provider", service.name)), service.owner.name)


def _to_text(value: object) -> str:
    """Return a parameter's value as JSON text.

    Raises:
        GraphError: its nesting can be read but not written again.
    """
    try:
        return orjson.dumps(value).decode()
    except orjson.JSONEncodeError:
        raise GraphError("The value is nested too deeply") from None


def as_json_text(text: str) -> str:
    """Return a text that may be JSON as JSON text; any other text becomes a string, as in rosbridge_suite."""
    try:
        return _to_text(orjson.loads(text))
    except orjson.JSONDecodeError:
        return _to_text(text)
