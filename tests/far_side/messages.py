"""Types of the far bridge: which exist, and how JSON changes on its way through a ROS 1 message.

A message is here a plain dict with every field of its type. `Types.fill` is the way in and `Types.show` the way out, as
in rosbridge_library's message conversion: the way in is strict (unknown fields, wrong types, null), the way out is not
JSON's own (NaN is null, bytes are base64, a float32 is the double that it widens to).
"""

from __future__ import annotations

import base64
import binascii
import math
import re
import struct
import time
from collections.abc import Collection, Iterator
from typing import Any

from rosbridge_sim.errors import DefinitionError
from rosbridge_sim.schema.definitions.parse import INT_RANGES, Definition, Field, parse_message, parse_service
from rosbridge_sim.schema.definitions.standard import standard_text
from rosbridge_sim.shell.files.definitions import read_definitions

__all__ = ["UNFIT", "Json", "RosError", "Types", "now"]

UNFIT = re.compile(r"message requires a|does not have a field|Expected a JSON object|out of range for|for packing")
"""Part of each log line about a message or an answer that does not fit its type."""

Json = dict[str, Any]
"""An object of the wire, or a message with all of its fields: values are whatever was sent."""

_RANGES = {**INT_RANGES, "byte": (-128, 127), "char": (0, 255)}
_CODES = {"int8": "b", "byte": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i"}
_CODES |= {"uint32": "I", "int64": "q", "uint64": "Q"}
_DEFAULTS: dict[str, object] = {"bool": False, "string": "", "float32": 0.0, "float64": 0.0}


class RosError(Exception):
    """Something that the far side does not do, with the text that it has for it."""


def now() -> Json:
    """The time of day as a ROS 1 time."""
    stamp_ns = time.time_ns()
    return {"secs": stamp_ns // 10**9, "nsecs": stamp_ns % 10**9}


class Types:
    """The packages that are built on the far side's machine."""

    def __init__(self, release: str, without: Collection[str] = ()) -> None:
        """Read the definitions.

        Args:
            release: of `morai_msgs`.
            without: packages that are not built there.
        """
        texts = read_definitions(release)
        self._texts = {key: text for key, text in texts.items() if key[0] not in without}
        self._without = frozenset(without)
        self._known: dict[tuple[str, str], tuple[Definition, ...]] = {}

    def message(self, name: str) -> Definition:
        """A message's definition.

        Raises:
            RosError: there is none; with rosbridge_library's text.
        """
        return self._find(name, "msg")[0]

    def service(self, name: str) -> tuple[Definition, Definition]:
        """A service's request and response.

        Raises:
            RosError: there is none.
        """
        request, response = self._find(name, "srv")
        return request, response

    def _find(self, name: str, kind: str) -> tuple[Definition, ...]:
        if (name, kind) not in self._known:
            parts = [part for part in name.split("/") if part]
            if len(parts) != 2:  # `pkg/msg/Type` is ROS 2's
                raise RosError(f"{name} is not a valid type string")
            self._known[name, kind] = self._parse(parts[0], parts[1], kind)
        return self._known[name, kind]

    def _parse(self, package: str, short: str, kind: str) -> tuple[Definition, ...]:
        text = self._texts.get((package, kind, short))
        if text is None and kind == "msg" and package not in self._without:
            text = standard_text(1, package, short)
        name = f"{package}/{short}"
        if text is not None:
            try:
                return parse_service(name, text) if kind == "srv" else (parse_message(name, text),)
            except DefinitionError as error:
                raise RosError(
                    f"Unable to import {package}.{kind} from package {package}. Caused by: {error}"
                ) from None
        if any(key[0] == package for key in self._texts):
            cause = f"'module' object has no attribute '{short}'"
            raise RosError(f"Unable to import {kind} class {short} from package {package}. Caused by {cause}")
        cause = f"No module named {package}.{kind}"
        raise RosError(f"Unable to import {package}.{kind} from package {package}. Caused by: {cause}")

    # The way in

    def fill(self, definition: Definition, value: object) -> Json:
        """A message out of JSON; what is missing takes its default.

        A `header` that is given as an object has the present time in it, unless it says its own.

        Raises:
            RosError: a field that does not exist, or a value that does not fit.
        """
        if not isinstance(value, dict):
            raise RosError(f"Expected a JSON object for type {definition.name} but received a {type(value)}")
        return self._fill(definition, value, definition.name, ())

    def _fill(self, definition: Definition, value: Json, root: str, stack: tuple[str, ...]) -> Json:
        fields = {field.name: field for field in definition.fields}
        for name in value:
            if name not in fields:
                raise RosError(f"Message type {root} does not have a field {'.'.join((*stack, name))}")
        filled = {}
        for name, field in fields.items():
            given = value.get(name, _ABSENT)
            if given is _ABSENT:
                filled[name] = self._default(field)
                continue
            if field.type == "std_msgs/Header" and isinstance(given, dict):
                given = {"stamp": now(), **given}
            filled[name] = self._value(field, given, root, (*stack, name))
        return filled

    def _value(self, field: Field, given: object, root: str, stack: tuple[str, ...]) -> object:
        if field.array is None:
            return self._element(field, given, root, stack)
        if field.is_bytes:
            return _bytes(field, given, root, stack)
        if not isinstance(given, list):
            raise _mismatch(field.full_type, given, root, stack)
        if field.array and len(given) != field.array:  # ROS 1 finds it when it packs the message
            raise RosError(f"field {'.'.join(stack)}: pack expected {field.array} items for packing (got {len(given)})")
        return [self._element(field, item, root, stack) for item in given]

    def _element(self, field: Field, given: object, root: str, stack: tuple[str, ...]) -> object:
        kind = field.type
        if kind in {"time", "duration"}:
            return _time(field, given, root, stack)
        if "/" in kind:
            if not isinstance(given, dict):
                raise _mismatch(kind, given, root, stack)
            return self._fill(self.message(kind), given, root, stack)
        fits = {"bool": type(given) is bool, "string": isinstance(given, str)}
        is_int = type(given) is int
        if not fits.get(kind, is_int or (kind.startswith("float") and isinstance(given, float))):
            raise _mismatch(kind, given, root, stack)
        if kind in _RANGES:
            lowest, highest = _RANGES[kind]
            assert isinstance(given, int)
            if not lowest <= given <= highest:
                raise RosError(f"field {'.'.join(stack)}: integer out of range for '{_CODES[kind]}' format code")
        return float(given) if kind.startswith("float") and isinstance(given, int) else given

    def _default(self, field: Field) -> object:
        if field.array is not None:
            return b"\0" * field.array if field.is_bytes else [self._blank(field) for _ in range(field.array)]
        return self._blank(field)

    def _blank(self, field: Field) -> object:
        if field.type in {"time", "duration"}:
            return {"secs": 0, "nsecs": 0}
        if "/" in field.type:
            return {part.name: self._default(part) for part in self.message(field.type).fields}
        return _DEFAULTS.get(field.type, 0)

    # The way out

    def show(self, definition: Definition, value: Json) -> Json:
        """What a message is on the wire."""
        return {field.name: self._shown(field, value[field.name]) for field in definition.fields}

    def _shown(self, field: Field, value: Any) -> object:  # noqa: ANN401 - any field's value
        if isinstance(value, bytes):
            return base64.b64encode(value).decode()
        if isinstance(value, list):
            return [self._shown(field, item) for item in value]
        if "/" in field.type:
            return self.show(self.message(field.type), value)
        if isinstance(value, float):
            if field.type == "float32" and math.isfinite(value):
                value = _widened(value)
            return value if math.isfinite(value) else None
        return value

    def tree(self, definition: Definition) -> Iterator[Definition]:
        """A definition, and each one within it once, depth first."""
        seen: set[str] = set()

        def walk(one: Definition) -> Iterator[Definition]:
            if one.name not in seen:
                seen.add(one.name)
                yield one
                for field in one.fields:
                    if "/" in field.type:
                        yield from walk(self.message(field.type))

        return walk(definition)


_ABSENT = object()


def _bytes(field: Field, given: object, root: str, stack: tuple[str, ...]) -> bytes:
    try:
        if isinstance(given, str):
            return base64.b64decode(given, validate=True)
        if isinstance(given, list):
            return bytes(given)
    except (ValueError, TypeError, binascii.Error):
        pass
    raise _mismatch(field.full_type, given, root, stack)


def _time(field: Field, given: object, root: str, stack: tuple[str, ...]) -> Json:
    """A time by `secs` and `nsecs`; ROS 2's names mean nothing, and what is missing is 0."""
    if given == "now" and field.type == "time":
        return now()
    if not isinstance(given, dict):
        raise _mismatch(field.type, given, root, stack)
    return {name: given.get(name, 0) for name in ("secs", "nsecs")}


def _mismatch(wanted: str, given: object, root: str, stack: tuple[str, ...]) -> RosError:
    return RosError(f"{root} message requires a {wanted} for field {'.'.join(stack)}, but got a {type(given)}")


def _widened(value: float) -> float:
    """The double that a float32 widens to: 0.1 is 0.10000000149011612."""
    try:
        (widened,) = struct.unpack("<f", struct.pack("<f", value))
    except OverflowError:
        return math.copysign(math.inf, value)
    assert isinstance(widened, float)
    return widened
