"""Every type by its name: texts in, compiled types out, each made once and at its first use.

A store is given definition texts (what lies in `schemas/` and in the user's folders); the standard packages beyond them
come from rosbags, which is imported when the first type is asked for that the texts lack. Both `pkg/Type` and
`pkg/msg/Type` are understood everywhere; the former goes out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, Literal

import msgspec

from rosbridge_sim.errors import DefinitionError, TypeNameError, UnknownPackageError
from rosbridge_sim.schema.check import ROS1, Leniency, printable
from rosbridge_sim.schema.compile import ActionType, Encoders, MessageType, OpaqueType, ServiceType, compile_message
from rosbridge_sim.schema.parse import Definition, Field, parse_action, parse_message, parse_service, qualified_text

__all__ = ["Leniency", "Message", "Store"]

_Fielddefs = tuple[list[Any], list[Any]]
"""What rosbags holds of a message: constants and fields."""

_FieldDesc = tuple[Any, Any]
"""What rosbags holds of a field's type: the kind of node, and what that kind needs."""

_TYPE_NAME = re.compile(r"([A-Za-z]\w*)/(?:(?:msg|srv|action)/)?([A-Za-z]\w*)", re.ASCII)

_RENAMED_PACKAGES = {
    "rosapi_msgs": "rosapi",
    "tf2_web_republisher_interfaces": "tf2_web_republisher",
    "tf2_web_republisher_msgs": "tf2_web_republisher",
}
"""Packages that the ROS 2 generation renamed: the types of the one serve for the other."""

_RENAMED_FIELDS = {"rosapi/GetParamRequest": {"default_value": "default"}}
"""Fields that the ROS 2 generation renamed."""


class Message:
    """One value of a type, encoded at most once however many listeners it has.

    Attributes:
        type: its type.
        value: a struct of it, or the bare object of an unknown type; not changed any more.
    """

    __slots__ = ("_cbor", "_framed", "_head", "_json", "_raw", "type", "value")

    def __init__(self, message_type: MessageType | OpaqueType, value: Any) -> None:  # noqa: ANN401 - a generated struct
        self.type = message_type
        self.value = value
        self._json: bytes | None = None
        self._cbor: bytes | None = None
        self._raw: bytes | None = None
        self._head = b""
        self._framed = b""

    @property
    def json(self) -> bytes:
        """The JSON text of the value."""
        if self._json is None:
            self._json = self.type.encode_json(self.value)
        return self._json

    @property
    def cbor(self) -> bytes:
        """The value as a CBOR map."""
        if self._cbor is None:
            self._cbor = self.type.encode_cbor(self.value)
        return self._cbor

    @property
    def raw(self) -> bytes:
        """The value as ROS itself sends it: ROS 1 bytes, or CDR.

        Raises:
            FieldError: the type is unknown here, so its bytes are too.
        """
        if self._raw is None:
            self._raw = self.type.encode_raw(self.value)
        return self._raw

    def framed(self, head: bytes) -> bytes:
        """`head`, the JSON text, and a closing brace; kept for the next listener, who mostly wants the same."""
        if head != self._head:
            self._framed = head + self.json + b"}"
            self._head = head
        return self._framed


class Store:
    """All types that this process knows.

    Args:
        texts: definition texts by (package, `msg` or `srv` or `action`, name).
        leniency: other names and shapes to accept.
        ros: the personality.
    """

    def __init__(
        self, texts: Mapping[tuple[str, str, str], str], *, leniency: Leniency | None = None, ros: Literal[1] = 1
    ) -> None:
        leniency = leniency or Leniency()
        self._dialect = {1: ROS1}[ros]
        self._encoders = Encoders(ros)
        self.ros: Literal[1, 2] = ros
        self._texts = dict(texts)
        self._leniency = Leniency(
            types=leniency.types,
            fields={**_RENAMED_FIELDS, **leniency.fields},
            scalars=leniency.scalars,
            numerals=leniency.numerals,
        )
        self._packages = {package for package, _, _ in self._texts}
        self._definitions: dict[str, Definition] = {}
        self._messages: dict[str, MessageType] = {}
        self._services: dict[str, ServiceType] = {}
        self._actions: dict[str, ActionType] = {}
        self._spellings: dict[str, str] = {}
        self._open: list[str] = []

    # Names

    def canonical(self, name: str) -> str:
        """The one spelling of a type name: `pkg/Type`, after aliases. It may still be unknown.

        Raises:
            TypeNameError: the name is malformed.
        """
        known = self._spellings.get(name)
        if known is not None:
            return known
        match = _TYPE_NAME.fullmatch(name)
        if match is None:
            raise TypeNameError(f"{printable(name)} is not a valid type string")
        package, short = match.groups()
        if package not in self._packages:
            package = _RENAMED_PACKAGES.get(package, package)
        full = f"{package}/{short}"
        # A type that is really there is no other's misspelt name.
        is_there = (package, "msg", short) in self._texts or (package, "srv", short) in self._texts
        return full if is_there else self._leniency.types.get(full, full)

    def packages(self) -> list[str]:
        """The names of all packages with a known type, in order."""
        return sorted(self._packages | set(_standard()))

    def names(self, kind: Literal["msg", "srv", "action"]) -> list[str]:
        """The names of all known messages, services or actions, in order."""
        own = {f"{package}/{name}" for package, k, name in self._texts if k == kind}
        if kind == "msg":
            own |= {f"{package}/{name}" for package, names in _standard().items() for name in names}
        return sorted(own)

    # Types

    def message(self, name: str) -> MessageType:
        """The compiled type of a message.

        Args:
            name: `pkg/Type` or `pkg/msg/Type`.

        Raises:
            TypeNameError: the name is malformed, its package has no such message, or its definition is broken.
            UnknownPackageError: nothing is known of its package.
        """
        known = self._messages.get(name)
        if known is not None:
            return known
        canonical = self.canonical(name)
        try:
            compiled = self._message(canonical)
        except DefinitionError as error:
            raise TypeNameError(f"Unable to resolve type {canonical}: {error}") from None
        self._remember(name, canonical)
        return compiled

    def service(self, name: str) -> ServiceType:
        """The compiled type of a service.

        Args:
            name: `pkg/Type` or `pkg/srv/Type`.

        Raises:
            TypeNameError: the name is malformed, its package has no such service, or its definition is broken.
            UnknownPackageError: nothing is known of its package.
        """
        known = self._services.get(name)
        if known is not None:
            return known
        canonical = self.canonical(name)
        try:
            compiled = self._service(canonical)
        except DefinitionError as error:
            raise TypeNameError(f"Unable to resolve type {canonical}: {error}") from None
        self._remember(name, canonical)
        return compiled

    def action(self, name: str) -> ActionType:
        """The compiled type of an action.

        Args:
            name: `pkg/Type` or `pkg/action/Type`.

        Raises:
            TypeNameError: the name is malformed, its package has no such action, or its definition is broken.
            UnknownPackageError: nothing is known of its package.
        """
        canonical = self.canonical(name)
        compiled = self._actions.get(canonical)
        if compiled is None:
            package, _, short = canonical.partition("/")
            text = self._texts.get((package, "action", short))
            if text is None:
                raise self._unknown(package, canonical, "action", "action")
            try:
                parts = parse_action(canonical, text, f"{package}/action/{short}.action")
                goal, result, feedback = map(self._compile, parts)
            except DefinitionError as error:
                raise TypeNameError(f"Unable to resolve type {canonical}: {error}") from None
            compiled = self._actions[canonical] = ActionType(canonical, goal, result, feedback)
        return compiled

    def verify(self, packages: Iterable[str] | None = None) -> None:
        """Compile every text of some packages (all when None), so that a user's mistake is found at start.

        Raises:
            DefinitionError: a text is broken, or names a type that nobody knows.
        """
        wanted = None if packages is None else set(packages)
        for package, kind, name in self._texts:
            if wanted is not None and package not in wanted:
                continue
            if kind == "msg":
                self._message(f"{package}/{name}")
            elif kind == "srv":
                self._service(f"{package}/{name}")

    def full_text(self, name: str) -> str:
        """A message's text with those of all types in it, as rosapi gives it.

        The root's text, then for each distinct nested type, depth first: 80 equal signs, `MSG: pkg/Type`, its text.
        Nested names are written in full.

        Raises:
            TypeNameError: as for `message`.
        """
        root = self.message(name).definition
        border = "=" * 80
        nested = [f"{border}\nMSG: {d.name}\n{qualified_text(d).strip()}" for d in self._nested(root, {root.name})]
        return "\n".join([qualified_text(root).strip(), *nested])

    def time_value(self, stamp_ns: int) -> msgspec.Struct:
        """The value of a `time` field at that time [ns]."""
        return self._dialect.time(stamp_ns)

    # How a type is found

    def _remember(self, spelling: str, canonical: str) -> None:
        """Keep a spelling that led to a type: there are at most a few for each, so this is bounded."""
        self._spellings[spelling] = canonical
        if canonical in self._messages:
            self._messages.setdefault(spelling, self._messages[canonical])
        if canonical in self._services:
            self._services.setdefault(spelling, self._services[canonical])

    def _message(self, name: str) -> MessageType:
        compiled = self._messages.get(name)
        if compiled is None:
            compiled = self._messages[name] = self._compile(self._definition(name))
        return compiled

    def _service(self, name: str) -> ServiceType:
        compiled = self._services.get(name)
        if compiled is None:
            package, _, short = name.partition("/")
            text = self._texts.get((package, "srv", short))
            if text is None:
                raise self._unknown(package, name, "srv", "service")
            request, response = parse_service(name, text, f"{package}/srv/{short}.srv")
            compiled = self._services[name] = ServiceType(name, self._compile(request), self._compile(response))
        return compiled

    def _compile(self, definition: Definition) -> MessageType:
        def nested(f: Field) -> MessageType:
            if f.type in self._open:
                circle = " > ".join([*self._open[self._open.index(f.type) :], f.type])
                raise DefinitionError(definition.source, f.line, 1, f"a message cannot contain itself: {circle}")
            try:
                return self._message(f.type)
            except TypeNameError as error:
                raise DefinitionError(definition.source, f.line, 1, f"unknown type {f.type}: {error}") from None

        self._open.append(definition.name)
        try:
            return compile_message(definition, nested, self._dialect, self._leniency, self._encoders)
        finally:
            self._open.pop()

    def _definition(self, name: str) -> Definition:
        known = self._definitions.get(name)
        if known is not None:
            return known
        package, _, short = name.partition("/")
        text = self._texts.get((package, "msg", short))
        if text is None:
            text = _standard_text(package, short)
        if text is None:
            raise self._unknown(package, name, "msg", "message")
        definition = self._definitions[name] = parse_message(name, text, f"{package}/msg/{short}.msg")
        return definition

    def _unknown(self, package: str, name: str, kind: str, what: str) -> TypeNameError:
        if package in self._packages or package in _standard():
            return TypeNameError(f"Unable to resolve type {name}: package {package} has no such {what}")
        return UnknownPackageError(
            f"Unable to import {package}.{kind} from package {package}. Caused by: no folder of definitions has it"
        )

    def _nested(self, definition: Definition, seen: set[str]) -> Iterator[Definition]:
        for f in definition.fields:
            if "/" in f.type and f.type not in seen:
                seen.add(f.type)
                inner = self._definition(f.type)
                yield inner
                yield from self._nested(inner, seen)


# The standard packages


@cache
def _standard() -> Mapping[str, Mapping[str, _Fielddefs]]:
    """The standard definitions of ROS 1 that rosbags knows: package -> name -> fields."""
    # 50 to 100 ms, and a session that sticks to the types in schemas/ never needs it.
    from rosbags.typesys.stores import ros1_noetic  # noqa: PLC0415

    packages: dict[str, dict[str, _Fielddefs]] = {}
    for full, definition in ros1_noetic.FIELDDEFS.items():
        package, _, name = full.split("/")
        if package != "builtin_interfaces":  # `time` and `duration` of ROS 1, in the clothes of ROS 2
            packages.setdefault(package, {})[name] = definition
    return packages


def _standard_text(package: str, name: str) -> str | None:
    """The definition text of a standard message; None when there is no such message."""
    definition = _standard().get(package, {}).get(name)
    if definition is None:
        return None
    constants, fields = definition
    lines = [f"{kind} {constant}={value}" for constant, kind, value in constants]
    # rosbags fills empty messages with a byte, as DDS does; ROS 1 does not.
    lines += [f"{_standard_type(desc)} {f}" for f, desc in fields if f != "structure_needs_at_least_one_member"]
    return "".join(f"{line}\n" for line in lines)


def _standard_type(desc: _FieldDesc) -> str:
    """A field's type as a definition writes it; rosbags has (node type, ...) tuples."""
    kind, detail = desc
    if kind in {_ARRAY, _SEQUENCE}:
        element, count = detail
        return f"{_standard_type(element)}[{count or ''}]"
    if kind == _NAME:
        package, _, name = detail.split("/")
        return name.lower() if package == "builtin_interfaces" else f"{package}/{name}"
    return str(detail[0])


_NAME, _ARRAY, _SEQUENCE = 2, 3, 4
"""`rosbags.interfaces.Nodetype`, whose import is what we put off."""
