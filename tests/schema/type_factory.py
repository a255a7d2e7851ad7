"""Factory of small types, and helpers to decode a body with them."""

from __future__ import annotations

import json
from collections.abc import Iterable

import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from tests.schema.strategies import STAMP_NS

__all__ = ["compile_all", "decode", "make", "refusal"]


def make(text: str, ros: Generation = 1, **other: str) -> MessageType:
    """The type `p/T` of that text, in a package where `other` types may be too."""
    texts = {("p", "msg", name): body for name, body in {"T": text, **other}.items()}
    texts["std_msgs", "msg", "Header"] = "uint32 seq\ntime stamp\nstring frame_id"
    return Store(texts, ros=ros).message("p/T")


def compile_all(store: Store, names: Iterable[tuple[str, str, str]]) -> None:
    """Compile the types of definition texts, given by (package, `msg` or `srv` or `action`, name)."""
    compilers = {"msg": store.message, "srv": store.service, "action": store.action}
    for package, kind, name in names:
        compilers[kind](f"{package}/{name}")


def decode(message_type: MessageType, body: object) -> Struct:
    """What a body stands for, through the text that a client would send."""
    return message_type.decode_json(json.dumps(body).encode(), STAMP_NS)


def refusal(message_type: MessageType, body: object) -> str:
    """The words in which a body (or its text) is refused."""
    text = body if isinstance(body, bytes) else json.dumps(body).encode()
    with pytest.raises(FieldError) as caught:
        message_type.decode_json(text, STAMP_NS)
    return str(caught.value)
