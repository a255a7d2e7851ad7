"""The parameter services that each node of ROS 2 has: `/NODE/get_parameters`, `/NODE/list_parameters` and four others.

The parameter `x` of a node is the one that rosapi of ROS 2 calls `/NODE:x`: both ways read and write the same values,
and the patterns for parameters hold for that name. The only one that the server sets is `use_sim_time`, which says
which time its stamps have; these services cannot change it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, TypeAlias

import orjson

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.graph.ways import Use, Way

MAX_LISTED: Final = 5_000
"""Names of a node that one request may look at: each takes 5 us."""

MAX_NAMES: Final = 1_000
"""Names, parameters or prefixes in one request: each takes some microseconds."""

MAX_TEXT: Final = 2**20
"""Text of all values in one answer [bytes]: it is decoded at once, which takes some milliseconds."""

MAX_VALUES: Final = 20_000
"""Commas in the values of one answer that are no plain strings: each element takes 2 us."""

_READ_ONLY: Final = "use_sim_time"

_BOOL, _INTEGER, _DOUBLE, _STRING, _BYTES, _BOOLS, _INTEGERS, _DOUBLES, _STRINGS = range(1, 10)
"""Types of rcl_interfaces/ParameterType; 0 is a parameter that is not set."""

_FIELDS: Final = {
    _BOOL: "bool_value",
    _INTEGER: "integer_value",
    _DOUBLE: "double_value",
    _STRING: "string_value",
    _BYTES: "byte_array_value",
    _BOOLS: "bool_array_value",
    _INTEGERS: "integer_array_value",
    _DOUBLES: "double_array_value",
    _STRINGS: "string_array_value",
}
"""Field of rcl_interfaces/ParameterValue that has the value of each type."""

SAME_AS: Final = {
    "describe_parameters": "get_param",
    "get_parameter_types": "get_param",
    "get_parameters": "get_param",
    "list_parameters": "get_param_names",
    "set_parameters": "set_param",
    "set_parameters_atomically": "set_param",
}
"""Service of a node -> the service of rosapi that does the same; patterns for that one hold for it."""

_ARRAYS: Final = frozenset({_BYTES, _BOOLS, _INTEGERS, _DOUBLES, _STRINGS})

_MAX_INTEGER: Final = 2**63
_BYTE: Final = 256

_Struct: TypeAlias = Any
"""A struct made from a definition at run time, so a type checker cannot know its fields."""


def provide_node_parameters(bus: Bus, policy: Policy, *, is_simulated: bool) -> None:
    """Offer the services of each node that is on the bus now, if that speaks as ROS 2.

    Args:
        policy: the rights of clients; it learns the other names of these services.
    """
    if bus.store.ros == 1:
        return
    nodes = sorted({owner.name for owner in bus.owners()})
    same = {f"{node}/{name}": Way(Use.SERVICE, f"/rosapi/{other}") for node in nodes for name, other in SAME_AS.items()}
    policy.ways.add(lambda: (), lambda way: [same[way.name]] if way.use is Use.SERVICE and way.name in same else [])
    for node in nodes:
        _NodeParameters(bus, policy, node).provide(is_simulated=is_simulated)


class _NodeParameters(Participant):
    """The services of one node; `name` is that of the node."""

    def __init__(self, bus: Bus, policy: Policy, name: str) -> None:
        self.name = name
        self._bus = bus
        self._policy = policy
        self._params = bus.parameters
        self._value = bus.store.message("rcl_interfaces/ParameterValue").struct_type
        self._descriptor = bus.store.message("rcl_interfaces/ParameterDescriptor").struct_type
        self._result = bus.store.message("rcl_interfaces/SetParametersResult").struct_type
        self._listed = bus.store.message("rcl_interfaces/ListParametersResult").struct_type

    def provide(self, *, is_simulated: bool) -> None:
        """Offer all services, and set `use_sim_time`."""
        self._params.put(f"{self.name}:{_READ_ONLY}", "true" if is_simulated else "false", self)
        for name in SAME_AS:
            self._provide(name, name.title().replace("_", ""), getattr(self, f"_{name}"))

    def _provide(self, name: str, type_name: str, respond: Callable[[_Struct, Participant], object]) -> None:
        def handle(call: Call, _now: float) -> None:
            call.respond(respond(call.request, call.caller))

        self._bus.provide(self, f"{self.name}/{name}", f"rcl_interfaces/{type_name}", handle, is_exclusive=True)

    # Reading

    def _get_parameters(self, request: _Struct, _caller: Participant) -> list[_Struct]:
        return self._values(request.names)

    def _get_parameter_types(self, request: _Struct, _caller: Participant) -> list[int]:
        return [value.type for value in self._values(request.names)]

    def _describe_parameters(self, request: _Struct, _caller: Participant) -> list[_Struct]:
        values = self._values(request.names)
        return [
            self._descriptor(name=name, type=value.type, read_only=name == _READ_ONLY)
            for name, value in zip(request.names, values, strict=True)
        ]

    def _list_parameters(self, request: _Struct, _caller: Participant) -> _Struct:
        """Return the names with one of the prefixes, and with fewer dots behind it than the depth if that is not 0."""
        _check_number(request.prefixes)
        start = f"{self.name}:"
        num = 0
        found: set[str] = set()
        for prefix in dict.fromkeys(request.prefixes or [""]):
            inner = f"{start}{prefix}." if prefix else start
            names = self._params.below(inner)
            num += len(names)
            if num > MAX_LISTED:
                text = f"The prefixes have more than {MAX_LISTED} parameters: list fewer"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            found.update(name[len(start) :] for name in names if not 0 < request.depth <= name.count(".", len(inner)))
            if prefix and start + prefix in self._params:
                found.add(prefix)
        usable = [name for name in sorted(found) if self._policy.parameter.admits(start + name)]
        return self._listed(names=usable, prefixes=sorted({name.rpartition(".")[0] for name in usable} - {""}))

    def _values(self, names: list[str]) -> list[_Struct]:
        """Return the values of parameters; type 0 for those that are not set.

        Raises:
            GraphError: a name is not allowed, or there is too much.
        """
        _check_number(names)
        values, size, num = [], 0, 0
        for name in names:
            full = self._full_name(name)
            text = self._params.text(full) if full in self._params else None
            size += len(text or "")
            if size > MAX_TEXT:
                raise GraphError(f"The values have more than {MAX_TEXT} bytes: read fewer", reason=Reason.TOO_MUCH)
            if text is not None and not text.startswith('"'):
                num += text.count(",")
            if num > MAX_VALUES:
                raise GraphError(f"The values have more than {MAX_VALUES} commas: read fewer", reason=Reason.TOO_MUCH)
            values.append(self._value() if text is None else self._value(**fields_of(text)))
        return values

    # Writing

    def _set_parameters(self, request: _Struct, caller: Participant) -> list[_Struct]:
        _check_number(request.parameters)
        return [self._put([parameter], caller) for parameter in request.parameters]

    def _set_parameters_atomically(self, request: _Struct, caller: Participant) -> _Struct:
        _check_number(request.parameters)
        return self._put(request.parameters, caller)

    def _put(self, parameters: list[_Struct], caller: Participant) -> _Struct:
        """Set all of some parameters, or none, and return the result."""
        try:
            self._params.change([self._change_of(parameter) for parameter in parameters], caller)
        except GraphError as error:
            return self._result(successful=False, reason=str(error))
        return self._result(successful=True)

    def _change_of(self, parameter: _Struct) -> tuple[str, str | None]:
        """Return the full name of a parameter and its new JSON text; None removes it."""
        name = self._full_name(parameter.name)
        if parameter.name == _READ_ONLY:
            raise GraphError(f"parameter '{_READ_ONLY}' cannot be set because it is read-only")
        return name, text_of(parameter.value)

    def _full_name(self, name: str) -> str:
        if not name or any(character.isspace() for character in name):
            raise GraphError(f"{name[:80]!r} is not a valid parameter name", reason=Reason.BAD_NAME)
        full = f"{self.name}:{name}"
        self._policy.check_parameter(full)
        return full


def _check_number(given: list[Any]) -> None:
    if len(given) > MAX_NAMES:
        text = f"expected {MAX_NAMES} names at most, got {len(given)}"
        raise GraphError(text, reason=Reason.TOO_MUCH)


def fields_of(text: str, like: int = 0) -> dict[str, object]:
    """Return the fields of a rcl_interfaces/ParameterValue for a JSON text.

    Args:
        text: what no type can hold, such as an object, becomes a string with this text.
        like: type that the parameter has, since JSON may write 2.0 as 2.

    Raises:
        orjson.JSONDecodeError: it is no JSON.
    """
    value = orjson.loads(text)
    kind = _kind_of(value)
    if kind is None:
        kind, value = _STRING, text
    if kind == _INTEGER and like == _DOUBLE:
        kind, value = _DOUBLE, float(value)
    elif kind == _DOUBLES or (kind == _INTEGERS and like == _DOUBLES):
        kind, value = _DOUBLES, [float(each) for each in value]
    elif value == [] or (kind == _INTEGERS and like == _BYTES and all(0 <= each < _BYTE for each in value)):
        kind = like if like in _ARRAYS else kind
    return {"type": kind, _FIELDS[kind]: value}


def _kind_of(value: object) -> int | None:
    """Return the type of a parameter with this value; None if there is none."""
    if isinstance(value, list):
        kinds = {_kind_of(each) for each in value}
        if kinds == {_INTEGER, _DOUBLE}:
            return _DOUBLES
        kind = kinds.pop() if len(kinds) == 1 else _STRING if not kinds else None
        return {_BOOL: _BOOLS, _INTEGER: _INTEGERS, _DOUBLE: _DOUBLES, _STRING: _STRINGS}.get(kind or 0)
    if isinstance(value, bool):
        return _BOOL
    if isinstance(value, int):
        return _INTEGER if -_MAX_INTEGER <= value < _MAX_INTEGER else None
    return _DOUBLE if isinstance(value, float) else _STRING if isinstance(value, str) else None


def text_of(value: _Struct) -> str | None:
    """Return the JSON text of a parameter's value; None for type 0, which removes it.

    Raises:
        GraphError: no such type, or JSON has no such number.
    """
    if value.type == 0:
        return None
    field = _FIELDS.get(value.type)
    if field is None:
        raise GraphError(f"{value.type} is no type of rcl_interfaces/ParameterType", reason=Reason.WRONG_VALUE)
    given = getattr(value, field)
    numbers = given if value.type == _DOUBLES else [given] if value.type == _DOUBLE else []
    if not all(map(math.isfinite, numbers)):
        raise GraphError("NaN and infinity cannot be kept as a parameter", reason=Reason.WRONG_VALUE)
    return orjson.dumps(list(given) if isinstance(given, bytes) else given, option=orjson.OPT_SERIALIZE_NUMPY).decode()
