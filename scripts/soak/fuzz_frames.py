"""Frames for the fuzzer: ops of every kind, right and wrong, in every encoding, whole and damaged.

One random generator makes everything, so a seed gives the same acts again. Values are made from the definitions of the
server's types, so a new topic or service needs no change here.
"""

from __future__ import annotations

import base64
import json
import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, Final, Literal

import cbor2
import numpy as np
from PIL import Image

from rosbridge_sim.errors import PeerError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.store import Store
from scripts.soak.fuzz_raw import part_of_frame, raw_bytes
from scripts.soak.fuzz_values import (
    ENCODINGS,
    ODD,
    ODD_NAMES,
    ODD_TEXTS,
    ODD_TYPES,
    OWN_ACTIONS,
    OWN_SERVICES,
    OWN_TOPICS,
    PLAUSIBLE,
)

Op = dict[str, Any]
"""An op as a JSON object: any JSON values."""

Form = Literal["text", "binary", "pieces", "part", "wait", "deaf", "raw"]


@dataclass(frozen=True, slots=True)
class Act:
    """One act of a client.

    Attributes:
        form: a `text` or `binary` frame; a text frame in several WebSocket `pieces`; a `part` of a frame, after which
            the
            socket is closed; a `wait` before the next act; a time without reading (`deaf`); or `raw` bytes for the port
            instead of a WebSocket.
        data: the payload; for `wait` and `deaf`, the milliseconds as text.
    """

    form: Form
    data: bytes


@dataclass(slots=True)
class Interface:
    """Topics and services of the server, with the types to make values of.

    Attributes:
        store: the server's definitions.
        topics, services: name -> type.
    """

    store: Store
    topics: dict[str, str] = field(default_factory=dict)
    services: dict[str, str] = field(default_factory=dict)


_TAGS: Final = {"u1": 64, "<u2": 69, "<u4": 70, ">f4": 81, "<f4": 85, "<f8": 86, "<i4": 78, "<i8": 79}
"""Tags of typed arrays (RFC 8746) by numpy's name of their numbers."""


class FrameMaker:
    """Maker of the acts of clients."""

    def __init__(self, seed: str, interface: Interface) -> None:
        self.chance = random.Random(seed)  # noqa: S311 - to be repeated, not to be secret
        self._interface = interface
        self._topics = sorted(interface.topics)
        self._services = sorted(interface.services)
        self._types = interface.store.names("msg")
        self._makers: list[tuple[int, Callable[[], Op]]] = [
            *((30, self._publish), (30, self._call), (10, self._subscribe), (4, self._unsubscribe)),
            *((5, self._advertise), (3, self._unadvertise), (3, self._offer), (2, self._withdraw), (4, self._respond)),
            *((2, self._offer_action), (1, self._withdraw_action), (3, self._goal), (2, self._cancel)),
            *((3, self._report), (3, self._end), (2, self._level), (1, self._status), (1, self._auth)),
            *((2, self._fragment), (1, self._png), (2, self._other)),
        ]  # fmt: skip
        self._weights = [weight for weight, _ in self._makers]

    def acts(self, num: int) -> Iterator[Act]:
        """Yield the acts of one client; the last one may be a part of a frame, or the only one raw bytes.

        Args:
            num: number of acts.

        Yields:
            Each act.
        """
        if self.chance.random() < 0.03:
            yield Act("raw", raw_bytes(self.chance, _text(self.op())))
            return
        for _ in range(num):
            if self.chance.random() < 0.005:
                yield Act("deaf", str(self.chance.choice((50, 500, 2_000))).encode())
            if self.chance.random() < 0.03:
                yield Act("wait", str(self.chance.choice((1, 20, 60))).encode())
            yield from self._frames(self.op())
        if self.chance.random() < 0.2:
            yield Act("part", part_of_frame(self.chance, _text(self.op())))

    def answer(self, frame: Op) -> Act | None:
        """Return an answer to a call or goal from the server.

        Args:
            frame: from the server.

        Returns:
            The act; None for no answer.
        """
        if self.chance.random() < 0.3:
            return None
        if frame.get("op") == "call_service":
            op: Op = {"op": "service_response", "service": frame.get("service"), "id": frame.get("id")}
            op["result"] = self.chance.random() < 0.8
            op["values"] = self.chance.choice(({}, {"sum": 3}, {"success": True}, *ODD))
        else:
            end = self.chance.random() < 0.6
            op = {"op": "action_result" if end else "action_feedback", "action": frame.get("action")}
            op |= {"id": frame.get("id"), "values": self.chance.choice(({}, {"sequence": [1]}, *ODD))}
            if end:
                op |= {"result": self.chance.random() < 0.8, "status": self.chance.choice((4, 5, 6, 0, 99))}
        if self.chance.random() < 0.2:
            op = self._spoilt(op)
        return Act("text", _text(op))

    def spoil(self, data: str | bytes) -> list[str | bytes]:
        """Return frames that replace one: none, two copies, another one, or an added one.

        Args:
            data: the frame.

        Returns:
            The frames to send.
        """
        how = self.chance.randrange(6)
        if how == 0:
            return []
        if how == 1:
            return [data, data]
        if how in {2, 3} and isinstance(data, str):
            return [_text(self._spoilt(json.loads(data))).decode()]
        if how == 4:
            text = data if isinstance(data, bytes) else data.encode()
            return [_plainly(self._damaged(text))] if text else []
        return [data, *(_plainly(act) for act in self._frames(self.op()))]

    def op(self) -> Op:
        """Return any op, correct or with a mistake.

        Returns:
            The op.
        """
        (_, make) = self.chance.choices(self._makers, self._weights)[0]
        op = make()
        for _ in range(self.chance.choice((0, 0, 0, 0, 1, 1, 3))):
            op = self._spoilt(op)
        return op

    # Ops

    def _pick(self, *groups: tuple[float, tuple[Any, ...] | list[Any]]) -> JsonValue:
        filled = [(weight, group) for weight, group in groups if group]
        return self.chance.choice(self.chance.choices([g for _, g in filled], [w for w, _ in filled])[0])

    def _topic(self) -> str:
        name: str = self._pick((6, self._topics), (6, OWN_TOPICS), (1, ODD_NAMES))
        return name.removeprefix("/") if self.chance.random() < 0.05 else name

    def _service(self) -> str:
        name: str = self._pick((8, self._services), (4, OWN_SERVICES), (1, ODD_NAMES))
        return name

    def _type(self) -> str:
        name: str = self._pick((6, self._types), (2, ODD_TYPES), (2, ["std_msgs/String", "nav_msgs/Odometry"]))
        return name.replace("/", "/msg/") if self.chance.random() < 0.2 else name

    def _id(self) -> Op:
        return {} if self.chance.random() < 0.5 else {"id": self._pick((9, ["a", "b", 1, 2, "x:1"]), (1, ODD))}

    def _qos(self) -> Op:
        if self.chance.random() < 0.9:
            return {}
        return {
            "qos": {
                "depth": self._pick((5, [0, 1, 10]), (1, ODD)),
                "history": self._pick((5, ["keep_last", "keep_all"]), (1, ODD)),
                "durability": self._pick((5, ["volatile", "transient_local"]), (1, ODD)),
                "reliability": self._pick((5, ["reliable", "best_effort"]), (1, ODD)),
            }
        }

    def _publish(self) -> Op:
        topic = self._topic()
        type_name = self._interface.topics.get(topic) or self._type()
        op = {"op": "publish", "topic": topic, "msg": self._message(type_name), **self._id(), **self._qos()}
        if self.chance.random() < 0.5:
            op["type"] = type_name
        if self.chance.random() < 0.1:
            op["latch"] = self.chance.random() < 0.5
        return op

    def _call(self) -> Op:
        service = self._service()
        op = {"op": "call_service", "service": service, "args": self._args(service), **self._id()}
        if self.chance.random() < 0.2:
            op["timeout"] = self._pick((6, [0, 0.01, 0.1, -1]), (1, ODD))
        if self.chance.random() < 0.1:
            op["fragment_size"] = self._pick((6, [1, 10, 100, 5000]), (1, ODD))
        return op

    def _args(self, service: str) -> object:
        type_name = self._interface.services.get(service)
        if type_name is None:
            return self._pick((3, [{"a": 1, "b": 2}, [1, 2], {"data": True}, {}]), (1, ODD))
        try:
            args = self._body(self._interface.store.service(type_name).request.spec, self._care())
        except PeerError:
            return {}
        return list(args.values()) if self.chance.random() < 0.05 else args

    def _subscribe(self) -> Op:
        topic = self._topic()
        op: Op = {"op": "subscribe", "topic": topic, **self._id(), **self._qos()}
        if self.chance.random() < 0.5:
            op["type"] = self._pick((8, [self._interface.topics.get(topic, "std_msgs/String")]), (1, [self._type()]))
        if self.chance.random() < 0.4:
            op["compression"] = self.chance.choice(ENCODINGS)
        for name, usual in (("throttle_rate", [0, 1, 10, 20, 50, 1000]), ("queue_length", [0, 1, 2, 5, 100])):
            if self.chance.random() < 0.4:
                op[name] = self._pick((9, usual), (1, ODD))
        if self.chance.random() < 0.2:
            op["fragment_size"] = self._pick((6, [10, 100, 500, 5000]), (1, ODD))
        return op

    def _unsubscribe(self) -> Op:
        return {"op": "unsubscribe", "topic": self._topic(), **self._id()}

    def _advertise(self) -> Op:
        topic = self._topic()
        type_name = self._pick((5, [self._interface.topics.get(topic, "std_msgs/String")]), (2, [self._type()]))
        latch = {} if self.chance.random() < 0.7 else {"latch": True, "queue_size": self._pick((5, [1, 5]), (1, ODD))}
        return {"op": "advertise", "topic": topic, "type": type_name, **latch, **self._id(), **self._qos()}

    def _unadvertise(self) -> Op:
        return {"op": "unadvertise", "topic": self._topic(), **self._id()}

    def _offer(self) -> Op:
        service = self._pick((8, OWN_SERVICES), (1, self._services), (1, ODD_NAMES))
        types = ["example_interfaces/AddTwoInts", "std_srvs/SetBool", "std_srvs/Trigger", "my_package/Own"]
        return {"op": "advertise_service", "service": service, "type": self._pick((8, types), (1, ODD_TYPES))}

    def _withdraw(self) -> Op:
        return {"op": "unadvertise_service", "service": self._service()}

    def _respond(self) -> Op:
        service = self._service()
        mark = f"service_request:{service}:{self.chance.randrange(1, 6)}"
        op = {
            "op": "service_response",
            "service": service,
            "id": mark,
            "values": self._pick((2, [{"sum": 1}]), (1, ODD)),
        }
        return op | {"result": self.chance.random() < 0.7}

    def _action(self) -> str:
        name: str = self._pick((9, OWN_ACTIONS), (1, ODD_NAMES))
        return name

    def _action_type(self) -> str:
        types = ("example_interfaces/Fibonacci", "example_interfaces/action/Fibonacci", "actionlib_tutorials/Averaging")
        name: str = self._pick((9, types), (1, ODD_TYPES))
        return name

    def _offer_action(self) -> Op:
        return {"op": "advertise_action", "action": self._action(), "type": self._action_type()}

    def _withdraw_action(self) -> Op:
        return {"op": "unadvertise_action", "action": self._action()}

    def _goal(self) -> Op:
        op = {"op": "send_action_goal", "action": self._action(), "action_type": self._action_type(), **self._id()}
        return op | {"args": self._pick((4, [{"order": 5}]), (1, ODD)), "feedback": self.chance.random() < 0.5}

    def _cancel(self) -> Op:
        return {"op": "cancel_action_goal", "action": self._action(), **self._id()}

    def _report(self) -> Op:
        action = self._action()
        mark = f"action_goal:{action}:{self.chance.randrange(1, 4)}"
        return {"op": "action_feedback", "action": action, "id": mark, "values": self._pick((2, [{}]), (1, ODD))}

    def _end(self) -> Op:
        return {
            **self._report(),
            "op": "action_result",
            "result": self._pick((5, [True, False]), (1, ODD)),
            "status": 4,
        }

    def _level(self) -> Op:
        return {"op": "set_level", "level": self._pick((9, ["none", "error", "warning", "info"]), (1, ODD))}

    def _status(self) -> Op:
        return {"op": "status", "level": "error", "msg": self._pick((1, ["a remark"]), (1, ODD))}

    def _auth(self) -> Op:
        return {"op": "auth", "mac": "", "client": "", "t": 0, "token": self._pick((1, ["x"]), (1, ODD))}

    def _fragment(self) -> Op:
        total = self._pick((6, [1, 2, 3]), (1, ODD))
        num = self._pick((6, [0, 1, 2]), (1, ODD))
        data = self._pick((4, ['{"op":', '"set_level","level":"none"}', ""]), (1, ODD))
        return {"op": "fragment", "id": self._pick((6, ["f", "g"]), (1, ODD)), "num": num, "total": total, "data": data}

    def _png(self) -> Op:
        raw = bytearray(_picture(_text(self._level()), self.chance.choice(("RGB", "RGB", "RGBA", "L", "P", "1"))))
        for _ in range(self.chance.randrange(4)):
            raw[self.chance.randrange(len(raw))] = self.chance.randrange(256)
        del raw[self.chance.choice((len(raw), self.chance.randrange(len(raw)))) :]
        return {"op": "png", "data": base64.b64encode(raw).decode()}

    def _other(self) -> Op:
        return {
            "op": self._pick((1, ["get_time", "Publish", "unknown"]), (1, ODD)),
            "topic": self._topic(),
            **self._id(),
        }

    # Messages

    def _care(self) -> float:
        """Return the chance that a value in a message is plausible."""
        return self.chance.choice((1.0, 1.0, 0.95, 0.8, 0.0))

    def _message(self, type_name: str) -> object:
        try:
            spec = self._interface.store.message(type_name).spec
        except PeerError:
            return self._pick((1, [{"any": ["thing", 1, None]}]), (1, ODD))
        return self._body(spec, self._care())

    def _body(self, spec: MessageSpec, care: float, depth: int = 0) -> Op:
        length = self.chance.choice((0, 1, 1, 2, 3)) if care else self.chance.choice((0, 1, 40))
        keep = self.chance.choice((1.0, 1.0, 0.7))
        return {
            name: self._field(name, field_spec, care, length, depth)
            for name, field_spec in spec.fields.items()
            if self.chance.random() < keep
        }

    def _field(self, name: str, field_spec: FieldSpec, care: float, length: int, depth: int) -> object:
        bounds = field_spec.definition
        if bounds.array is None:
            return self._element(name, field_spec, care, depth)
        if bounds.array:
            length = self.chance.randint(0, bounds.array) if bounds.is_bounded else bounds.array
            if self.chance.random() > care:
                length += self.chance.choice((-1, 1, 5))
        if depth > 3 or (field_spec.nested is not None and depth):
            length = min(length, 2)
        if bounds.is_bytes and self.chance.random() < 0.7:
            return base64.b64encode(self.chance.randbytes(max(0, length))).decode()
        return [self._element(name, field_spec, care, depth) for _ in range(max(0, length))]

    def _element(self, name: str, field_spec: FieldSpec, care: float, depth: int) -> object:  # noqa: PLR0911 - one for each kind
        if field_spec.nested is not None:
            return self._body(field_spec.nested, care, depth + 1)
        is_careful = self.chance.random() < care
        if not is_careful:
            return self.chance.choice(ODD)
        if name in PLAUSIBLE and self.chance.random() < 0.9:
            return self.chance.choice(PLAUSIBLE[name])
        kind = field_spec.definition.type
        if kind in {"time", "duration"}:
            return self.chance.choice(({"secs": 1, "nsecs": 5}, {"sec": 0, "nanosec": 0}, {}, "now"))
        if kind in {"string", "wstring"}:
            return self.chance.choice(("", "a", "map", "\u00fcber", "/x", "0"))
        if kind.startswith("float"):
            return self.chance.choice((0.0, 1.0, -3.5, 90.0, 270.0, self.chance.uniform(-200.0, 200.0), 1e5))
        if kind == "bool":
            return self.chance.random() < 0.5
        return self.chance.choice((0, 1, 2, 3, 4, 5, 10, 100))

    # Damage

    def _spoilt(self, value: JsonValue) -> JsonValue:
        """Return the value with one change in it, at a random place."""
        if isinstance(value, dict) and value and self.chance.random() < 0.9:
            key = self.chance.choice(list(value))
            how = self.chance.randrange(5)
            if how == 0:
                return {k: v for k, v in value.items() if k != key}
            if how == 1:
                return {
                    **value,
                    self.chance.choice(("extra", "", "id", "msg", "args", "\ud800")): self.chance.choice(ODD),
                }
            return {**value, key: self._spoilt(value[key])}
        if isinstance(value, list) and value and self.chance.random() < 0.8:
            i = self.chance.randrange(len(value))
            if self.chance.random() < 0.2:
                return value + value[i:]
            return [*value[:i], self._spoilt(value[i]), *value[i + 1 :]]
        return self.chance.choice(ODD)

    def _frames(self, op: Op) -> Iterator[Act]:
        """Yield the frames of an op: mostly one frame of JSON text."""
        text = _text(op, ensure_ascii=self.chance.random() < 0.8)
        how = self.chance.random()
        if how < 0.60:
            yield _whole(text)
        elif how < 0.66:
            yield Act("binary", text)
        elif how < 0.71:
            glue = self.chance.choice((b"", b" ", b"\n", b",", b"\0"))
            yield _whole(glue.join([text, *(_text(self.op()) for _ in range(self.chance.choice((1, 2, 30))))]))
        elif how < 0.78:
            yield Act("binary", self._cbor(op))
        elif how < 0.81:
            yield _whole(_text({"op": "png", "data": base64.b64encode(_picture(text)).decode()}))
        elif how < 0.87:
            yield from self._in_fragments(text)
        elif how < 0.90:
            yield Act("pieces", text)
        elif how < 0.92:
            yield _whole(self.chance.choice(ODD_TEXTS).encode())
        elif how < 0.95:
            yield from self._long(op, text)
        else:
            yield self._damaged(text)

    def _long(self, op: Op, text: bytes) -> Iterator[Act]:
        """Yield the op in a frame with so much other data that the server decodes it in slices."""
        op = op if isinstance(op, dict) else {"op": op}  # it may have been spoilt as a whole
        num = self.chance.choice((1_000, 40_000, 70_000))
        pads: tuple[Any, ...] = ("x" * num, [1] * num, [0.5] * num, ["a"] * num, [[]] * (num // 4), [{}] * (num // 4))
        pad = self.chance.choice((*pads, {f"k{i}": i for i in range(num // 10)}))
        how = self.chance.randrange(6)
        if how == 0:
            yield _whole(_text({"pad": pad, **op}))
        elif how == 1:
            body = self.chance.choice(("msg", "args", "values", "id", "topic", "data"))
            yield _whole(_text({**op, body: pad if self.chance.random() < 0.5 else {"data": pad}}))
        elif how == 2:
            glued = text + self.chance.choice((b" " * num, b"\n", b"")) + _text(self.op())
            yield _whole(glued * self.chance.choice((1, 200)))
        elif how == 3:
            yield Act("binary", self._cbor({**op, self.chance.choice(("pad", "msg")): {"data": pad}}))
        elif how == 4:
            yield from self._in_fragments(_text({**op, "pad": pad}))
        else:
            whole = _text({**op, "pad": pad})
            yield self._damaged(whole) if self.chance.random() < 0.5 else Act("pieces", whole)

    def _damaged(self, text: bytes) -> Act:
        data = bytearray(text)
        how = self.chance.randrange(4)
        if how == 0:
            del data[self.chance.randrange(len(data)) :]
        elif how == 1:
            data = bytearray(self.chance.randbytes(self.chance.randrange(200)))
        elif how == 2:
            i = self.chance.randrange(len(data))
            data[i:i] = data[self.chance.randrange(len(data)) :][:50]
        else:
            for _ in range(self.chance.randrange(1, 8)):
                data[self.chance.randrange(len(data))] = self.chance.randrange(256)
        return _whole(bytes(data))

    def _cbor(self, op: Op) -> bytes:
        try:
            data = bytearray(cbor2.dumps(self._for_cbor(op)))
        except (ValueError, cbor2.CBOREncodeError):  # half of a surrogate pair
            data = bytearray(b"\xa0")
        if self.chance.random() < 0.3:
            for _ in range(self.chance.randrange(1, 4)):
                data[self.chance.randrange(len(data))] = self.chance.randrange(256)
        return bytes(data)

    def _for_cbor(self, value: JsonValue) -> JsonValue:
        """Return the value with some lists of numbers as typed arrays, and some texts as bytes."""
        if isinstance(value, dict):
            return {key: self._for_cbor(inner) for key, inner in value.items()}
        if isinstance(value, list):
            if value and all(isinstance(one, (int, float)) and abs(one) < 100 for one in value):
                kind = self.chance.choice(list(_TAGS))
                numbers = np.abs(np.array(value, dtype=float)).astype(kind).tobytes()
                return cbor2.CBORTag(_TAGS[kind], numbers[: self.chance.choice((len(numbers), len(numbers) - 1))])
            return [self._for_cbor(one) for one in value]
        if isinstance(value, str) and self.chance.random() < 0.02:
            return value.encode("utf-8", "replace")
        return value

    def _in_fragments(self, text: bytes) -> Iterator[Act]:
        """Yield fragments in any order; one of them may be lost or doubled."""
        whole = text.decode()
        total = self.chance.choice((1, 2, 3, 10))
        size = len(whole) // total + 1
        mark = self.chance.choice(("p", "q", 5, self.chance.random()))
        pieces: list[Op] = [
            {"op": "fragment", "id": mark, "num": i, "total": total, "data": whole[i * size : (i + 1) * size]}
            for i in range(total)
        ]
        self.chance.shuffle(pieces)
        if self.chance.random() < 0.2:
            pieces.pop()
        if pieces and self.chance.random() < 0.1:
            pieces.append(self.chance.choice(pieces))
        for piece in pieces:
            yield Act("text", _text(self._spoilt(piece) if self.chance.random() < 0.05 else piece))


def _picture(frame: bytes, mode: str = "RGB") -> bytes:
    """Return a PNG that holds a frame in rosbridge_suite's form; in another mode its content is wrong."""
    width = max(1, math.isqrt(len(frame) // 3))
    height = max(1, math.ceil(len(frame) / 3 / width))
    image = Image.frombytes("RGB", (width, height), frame.ljust(width * height * 3, b"\n"))
    file = BytesIO()
    image.convert(mode).save(file, "PNG")
    return file.getvalue()


def _text(op: Op, *, ensure_ascii: bool = True) -> bytes:
    return json.dumps(op, ensure_ascii=ensure_ascii).encode("utf-8", "replace")


def _plainly(act: Act) -> str | bytes:
    """Return an act as one frame."""
    return act.data if act.form == "binary" else act.data.decode()


def _whole(data: bytes) -> Act:
    """Return a text frame, or a binary one for bytes that are not UTF-8: a text frame with them ends the WebSocket."""
    try:
        data.decode()
    except UnicodeDecodeError:
        return Act("binary", data)
    return Act("text", data)
