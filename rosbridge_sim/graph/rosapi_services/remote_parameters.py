"""Parameters of other nodes of ROS 2, by the services that each of these nodes has.

rosapi of ROS 2 calls the parameter `x` of a node `/NODE:x`. So a request for such a name becomes a call of
`/NODE/get_parameters` or one of its like, which nodes of the graph offer on the bus.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, TypeAlias

import orjson

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant, resolve
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi_services.node_parameters import SAME_AS, fields_of, text_of
from rosbridge_sim.graph.rosapi_services.rosapi import as_json_text
from rosbridge_sim.graph.topics_services import Answer, Call, Handle, Service
from rosbridge_sim.graph.ways import Use, Way

PATIENCE: Final = 5.0
"""Longest wait for the answer of a node [s], as in rosapi of ROS 2."""

MAX_NODES: Final = 500
"""Most nodes that one request asks for the names of their parameters."""

_Struct: TypeAlias = Any
"""A struct made from a definition at run time, so a type checker cannot know its fields."""

_OPS: Final = ("get_param", "set_param", "has_param", "delete_param", "get_param_names")


class RemoteParameters(Participant):
    """The parameters of nodes, for the services of rosapi.

    Attributes:
        name: of a node in rosapi's lists.
    """

    name = "/rosapi"

    def __init__(self, bus: Bus, policy: Policy, is_remote: Callable[[Service], bool]) -> None:
        """Stand before the services of rosapi from now on.

        Args:
            bus: the bus with rosapi.
            policy: rights of all clients.
            is_remote: returns whether a service is that of another node.
        """
        self._bus = bus
        self._policy = policy
        self._is_remote = is_remote
        self._ops = {one: getattr(self, f"_{one}") for one in _OPS}
        for one in _OPS:
            service = bus.services[f"/rosapi/{one}"]
            service.handle = partial(self._handle, one, service.handle)
        policy.ways.add(lambda: (), self._ways)

    def notify(self, level: str, text: str) -> None:
        """Do nothing: mistakes in its calls are answers to those who asked."""

    def check_request(self, name: str, call: Call) -> None:
        """Hold the patterns for parameters against a client that calls the service of a node itself.

        Args:
            name: name of the service.
            call: the call.

        Raises:
            GraphError: the client must not use one of the parameters.
        """
        node, _, last = name.rpartition("/")
        if call.caller is self or last not in SAME_AS or self._policy.parameter == Rule():
            return
        if last == "list_parameters":
            raise GraphError(f"Not allowed to call {name}; use /rosapi/get_param_names", reason=Reason.NOT_ALLOWED)
        request: _Struct = call.request
        for one in getattr(request, "names", None) or [each.name for each in getattr(request, "parameters", ())]:
            self._policy.check_parameter(f"{node}:{one}")

    def _ways(self, way: Way) -> list[Way]:
        """Return the other name of a service of a node, whose patterns hold for it, too."""
        last = way.name.rpartition("/")[2]
        is_remote = way.use is Use.SERVICE and last in SAME_AS and self._find(way.name) is not None
        return [Way(Use.SERVICE, f"/rosapi/{SAME_AS[last]}")] if is_remote else []

    def _find(self, name: str) -> Service | None:
        service = self._bus.services.get(name)
        return service if service is not None and self._is_remote(service) else None

    def _handle(self, op: str, local: Handle, call: Call, now: float) -> None:
        """Answer a request of rosapi, or leave it to rosapi if it is for no parameter of a node."""
        if op == "get_param_names":
            self._get_param_names(local, call, now)
            return
        request: _Struct = call.request
        node, colon, parameter = resolve(request.name).partition(":")
        if not colon or self._find(f"{node}/get_parameters") is None:
            local(call, now)
            return
        self._policy.check_parameter(request.name)
        self._ops[op](call, node, parameter, now)

    def _ask(self, call: Call, name: str, args: dict[str, object], then: Callable[[_Struct], None], now: float) -> None:
        """Call a service of a node. If it fails, so does the request."""

        def on_answer(answer: Answer) -> None:
            if not answer.is_ok:
                call.refuse(str(answer.values))
                return
            try:
                then(_response(answer))
            except PeerError as error:
                call.refuse(str(error), error.reason)

        self._bus.call(self, name, args, on_answer, now=now, timeout=PATIENCE)

    def _get(self, call: Call, node: str, parameter: str, then: Callable[[_Struct], None], now: float) -> None:
        """Ask for one value."""

        def take(response: _Struct) -> None:
            if not response.values:  # a node without `allow_undeclared_parameters`, asked for one that is not declared
                value = self._bus.store.message("rcl_interfaces/ParameterValue").default()
            else:
                value = response.values[0]
            then(value)

        self._ask(call, f"{node}/get_parameters", {"names": [parameter]}, take, now)

    def _get_param(self, call: Call, node: str, parameter: str, now: float) -> None:
        def take(value: _Struct) -> None:
            text = text_of(value)
            request: _Struct = call.request
            if text is not None:
                _answer(call, value=text)
            elif request.default:
                _answer(call, value=as_json_text(request.default))
            else:
                _answer(call, value='""', successful=False, reason=f"Parameter {node}:{parameter} is not set")

        self._get(call, node, parameter, take, now)

    def _has_param(self, call: Call, node: str, parameter: str, now: float) -> None:
        self._get(call, node, parameter, lambda value: _answer(call, exists=value.type != 0), now)

    def _set_param(self, call: Call, node: str, parameter: str, now: float) -> None:
        request: _Struct = call.request
        text = request.value

        def put(value: _Struct) -> None:
            try:
                fields = fields_of(text, value.type)
            except orjson.JSONDecodeError:
                fields = fields_of(as_json_text(text), value.type)
            self._put(call, node, parameter, fields, now)

        self._get(call, node, parameter, put, now)

    def _delete_param(self, call: Call, node: str, parameter: str, now: float) -> None:
        self._put(call, node, parameter, {"type": 0}, now)

    def _put(self, call: Call, node: str, parameter: str, fields: dict[str, object], now: float) -> None:
        def take(response: _Struct) -> None:
            result = response.results[0] if response.results else None
            if result is None or not result.successful:
                why = getattr(result, "reason", "")
                raise GraphError(why or f"{node} has refused a new value of {parameter}", reason=Reason.REFUSED)
            _answer(call)

        args: dict[str, object] = {"parameters": [{"name": parameter, "value": fields}]}
        self._ask(call, f"{node}/set_parameters", args, take, now)

    def _get_param_names(self, local: Handle, call: Call, now: float) -> None:
        """Add the names of all nodes to those of the bus, when each has answered or has not in time."""
        lists = [one.name for one in self._bus.services.values() if one.name.endswith(_LIST) and self._is_remote(one)]
        names: list[str] = []
        num_waiting = len(lists[:MAX_NODES])
        if not num_waiting:
            local(call, now)
            return

        def take(node: str, answer: Answer) -> None:
            nonlocal num_waiting
            num_waiting -= 1
            if answer.is_ok:
                found = _response(answer).result.names
                names.extend(full for one in found if self._policy.parameter.admits(full := f"{node}:{one}"))
            if not num_waiting:
                own = [one for one in self._bus.parameters if self._policy.parameter.admits(one)]
                _answer(call, names=[*own, *sorted(names)])

        for name in lists[:MAX_NODES]:
            node = name.removesuffix(_LIST)
            self._bus.call(self, name, {}, partial(take, node), now=now, timeout=PATIENCE)


_LIST: Final = "/list_parameters"


def _response(answer: Answer) -> _Struct:
    """Return the response in an answer that is one."""
    message: _Struct = answer.values
    return message.value


def _answer(call: Call, **fields: object) -> None:
    call.answer(call.service.type.response.struct_type(**fields))
