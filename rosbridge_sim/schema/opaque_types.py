"""Types of packages that are unknown here: any JSON object passes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import msgspec
import numpy as np
import orjson

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.cbor import encode_plain
from rosbridge_sim.schema.json_text import parse_json

_MAX_ORJSON_DEPTH = 250
"""Brackets of a text that is certainly not nested too deeply: orjson writes 254 levels, but reads 1,024."""


class OpaqueType:
    """A type of an unknown package: any JSON object passes, nothing is checked or filled.

    Attributes:
        name: `pkg/Type`.
        struct_type: makes a value from fields by keyword, like `MessageType.struct_type`.
    """

    __slots__ = ("name",)

    struct_type: ClassVar[Callable[..., dict[str, Any]]] = dict

    def __init__(self, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return f"OpaqueType({self.name})"

    def decode_json(self, body: bytes | msgspec.Raw, stamp_ns: int) -> dict[str, Any]:
        """Return the object that a JSON text holds.

        Args:
            body: the text of one JSON object.
            stamp_ns: not used; as in `MessageType.decode_json`.

        Raises:
            FieldError: it is no JSON object, or nested too deeply to be sent on.
        """
        view = memoryview(body)
        try:
            value = orjson.loads(view)
        except orjson.JSONDecodeError as refusal:
            value = parse_json(self.name, body, refusal)
        else:
            if isinstance(value, dict) and _is_shallow(bytes(view)):
                return value
        return self.check(value, stamp_ns)

    def check(self, value: object, stamp_ns: int, root: str | None = None) -> dict[str, Any]:  # noqa: ARG002 - as MessageType
        """Return the object itself.

        Raises:
            FieldError: it is no object, or JSON cannot hold it.
        """
        if not isinstance(value, dict):
            raise FieldError(f"Expected a JSON object for type {root or self.name} but received a {type(value)}")
        try:
            orjson.dumps(value, default=_no_array)  # arrays can always be written, and need not be for this
        except orjson.JSONEncodeError as error:
            raise FieldError(f"{root or self.name}: {error}") from None
        return value

    def encode_json(self, value: Mapping[str, Any]) -> bytes:
        """Return the JSON text of an object that was accepted."""
        return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)

    def encode_json_parts(self, value: Mapping[str, Any], long_field: object = None) -> tuple[bytes, ...]:  # noqa: ARG002 - as MessageType
        """Return the same as the only part; see `MessageType`."""
        return (self.encode_json(value),)

    def encode_with_words(self, value: Mapping[str, Any], text: bytes) -> bytes:  # noqa: ARG002 - as MessageType
        """Return the JSON text as it is: which of its nulls are numbers is unknown."""
        return text

    def encode_cbor(self, value: Mapping[str, Any]) -> bytes:
        """Return the CBOR map of an object that was accepted. The types of arrays are unknown, so none is typed."""
        return encode_plain(value)

    def encode_raw(self, value: Mapping[str, Any]) -> bytes:  # noqa: ARG002 - as MessageType
        """Refuse: the bytes of an unknown type are unknown.

        Raises:
            FieldError: always.
        """
        raise FieldError(f"{self.name} is not known here, so it cannot be sent as cbor-raw")

    def default(self) -> dict[str, Any]:
        """Return the empty object, because no field is known."""
        return {}


class OpaqueServiceType:
    """A service type of an unknown package: requests and responses are any JSON objects.

    Attributes:
        name: `pkg/Type`.
        request, response: see `ServiceType`.
    """

    __slots__ = ("name", "request", "response")

    def __init__(self, name: str) -> None:
        self.name = name
        self.request = OpaqueType(f"{name}Request")
        self.response = OpaqueType(f"{name}Response")


class OpaqueActionType:
    """An action type of an unknown package: goals, results and feedback are any JSON objects.

    Attributes:
        name: `pkg/Type`.
        goal, result, feedback: see `ActionType`.
    """

    __slots__ = ("feedback", "goal", "name", "result")

    def __init__(self, name: str) -> None:
        self.name = name
        self.goal = OpaqueType(f"{name}Goal")
        self.result = OpaqueType(f"{name}Result")
        self.feedback = OpaqueType(f"{name}Feedback")


def _is_shallow(body: bytes) -> bool:
    """Tell whether a text is certainly not nested too deeply for orjson; brackets in strings count too."""
    return body.count(b"{") + body.count(b"[") <= _MAX_ORJSON_DEPTH


def _no_array(value: object) -> None:
    """Accept a typed array, as a hook of orjson.

    Raises:
        TypeError: it is something else.
    """
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value)} is no JSON")
