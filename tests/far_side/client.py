"""One client of the far bridge: handles frames like the protocol object of rosbridge_suite, with its quirks.

Each quirk is the docstring of the method that has it. The rule above all: what a client does wrong is a line in the far
side's log, and the client hears nothing; there are no status frames.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Callable, Coroutine, Hashable
from typing import TYPE_CHECKING, Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from tests.far_side.graph import Service, Settings, Subscription
from tests.far_side.messages import Json, RosError

if TYPE_CHECKING:
    from tests.far_side.server import FarSide

__all__ = ["Client"]

_FIELDS: dict[str, dict[str, tuple[bool, Any]]] = {
    "advertise": {"topic": (True, str), "type": (True, str), "latch": (False, bool), "queue_size": (False, int)},
    "unadvertise": {"topic": (True, str)},
    "publish": {"topic": (True, str)},
    "subscribe": {
        "topic": (True, str),
        "type": (False, str),
        "throttle_rate": (False, int),
        "fragment_size": (False, int),
        "queue_length": (False, int),
        "compression": (False, str),
    },
    "unsubscribe": {"topic": (True, str)},
    "call_service": {"service": (True, str), "fragment_size": (False, (int, type(None)))},
    "advertise_service": {"service": (True, str), "type": (True, str)},
    "unadvertise_service": {"service": (True, str)},
    "service_response": {"service": (True, str), "id": (False, str), "result": (True, bool)},
    "fragment": {},
}
"""Op -> field -> whether it must be there, and of what Python type."""


class Client:
    """A connection and the thread that works for it.

    What comes is read as fast as it comes into a queue *without a bound*, and handled from there one by one, in order:
    nothing holds a sender back, and WebSocket pings are answered however long the queue is.

    Attributes:
        waiting: what was read and not handled yet.
    """

    def __init__(self, far_side: FarSide, socket: ServerConnection, number: int) -> None:
        self.waiting: deque[str | bytes] = deque()
        self._far_side = far_side
        self._graph = far_side.graph
        self._socket = socket
        self._number = number
        self._buffer = ""
        self._fragment_size: int | None = far_side.max_message_size
        self._has_arrived = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self._ops: dict[str, Callable[[Json], None]] = {op: getattr(self, f"_{op}") for op in _FIELDS}

    async def run(self) -> None:
        """Read until the connection ends; what was not handled by then never is."""
        worker = asyncio.get_running_loop().create_task(self._work())
        try:
            async for data in self._socket:
                self.waiting.append(data)
                self._far_side.note_waiting(len(self.waiting))
                self._has_arrived.set()
        except ConnectionClosed:
            pass
        finally:
            worker.cancel()
            self._leave()

    def start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Do something beside the client's own thread: a call, a queue of a subscription."""
        task = self._far_side.start(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def send(self, message: Json) -> None:
        """Send a message, in pieces if it is longer than this client's fragment size, *asked for or not*.

        A piece's `id` is the message's, or else a number that is 0 each time; `total` is a float, 3.4 for 3 pieces.
        """
        text = json.dumps(message)
        size = self._fragment_size
        pieces = [text]
        if size is not None and 0 < size < len(text):
            mark, total = message.get("id", 0), (len(text) - 1) / size + 1
            cuts = [text[i : i + size] for i in range(0, len(text), size)]
            pieces = [
                json.dumps({"op": "fragment", "id": mark, "data": cut, "num": num, "total": total})
                for num, cut in enumerate(cuts)
            ]
        try:
            for piece in pieces:
                await self._socket.send(piece)
        except ConnectionClosed:
            self._log("WebSocketClosedError: Tried to write to a closed websocket")

    # The thread

    async def _work(self) -> None:
        while True:
            await self._has_arrived.wait()
            await self._far_side.may_work.wait()
            if self._far_side.work:
                await asyncio.sleep(self._far_side.work)
            data = self.waiting.popleft()
            self._far_side.num_handled += 1
            self._receive(str(data) if isinstance(data, bytes) else data)
            if not self.waiting:
                self._has_arrived.clear()
            await asyncio.sleep(0)  # the others' threads run too

    def _receive(self, text: str) -> None:
        """Handle what can be made of the text so far.

        What is no JSON stays in a buffer, is put before the next frame, and is searched for an object with an `op`;
        nothing is said about it. A binary frame is Python's own spelling of bytes by now, and goes that way too.
        """
        self._buffer += text
        try:
            message = json.loads(self._buffer)
        except ValueError:
            message = None
            starts = [i for i, character in enumerate(self._buffer) if character == "{"]
            for start in starts:
                try:
                    message, end = json.JSONDecoder().raw_decode(self._buffer, start)
                except ValueError:
                    continue
                if isinstance(message, dict) and "op" in message:
                    rest = self._buffer[end:]
                    self._buffer = ""
                    self._handle(message)
                    if rest:
                        self._receive(rest)
                    return
            return
        self._buffer = ""
        self._handle(message)

    def _handle(self, message: object) -> None:
        """Do one op; every mistake is a line in the log, and the connection stays open."""
        if not isinstance(message, dict):
            self._log(f"Exception in deserialization of {type(message)}")
            return
        op, mark = message.get("op"), message.get("id")
        if op is None:
            self._log(f"Received a message without an op. Original message was: {message}", mark)
        elif (
            not isinstance(op, str) or op not in self._ops
        ):  # `status`, `set_level` and the actions of ROS 2 among them
            self._log(f"Unknown operation: {op}. Allowed operations: {sorted(self._ops)}", mark)
        else:
            if isinstance(message.get("fragment_size"), int):
                self._fragment_size = message["fragment_size"]
            try:
                _check(op, message)
                self._ops[op](message)
            except RosError as error:
                self._log(f"{op}: {error}", mark)
            except Exception as error:  # noqa: BLE001 - as there: whatever a handler raises is a line
                self._log(f"{op}: {error!r}", mark)

    def _leave(self) -> None:
        """Clean up after the socket is gone: topics only.

        Its services stay listed, calls of them are made and wait for ever, and so do those on their way.
        """
        self.waiting.clear()
        for task in list(self._tasks):
            task.cancel()
        for topic in list(self._graph.topics.values()):
            self._graph.unadvertise(topic, self)
            for client, spelling in list(topic.subscriptions):
                if client is self:
                    self._forget(topic.name, spelling)

    def _log(self, text: str, mark: object = None) -> None:
        where = f"[Client {self._number}]" + ("" if mark is None else f" [id: {mark}]")
        self._far_side.say(f"{where} {text}")

    # Topics

    def _advertise(self, message: Json) -> None:
        """Advertise; of a type that is not known there nothing comes about, and the client is not told."""
        topic = self._graph.topic(resolved(message["topic"]), message["type"])
        self._graph.advertise(topic, self, message.get("id"), is_latched=message.get("latch", False))

    def _unadvertise(self, message: Json) -> None:
        topic = self._graph.topics.get(resolved(message["topic"]))
        if topic is not None:
            self._graph.unadvertise(topic, self, message.get("id"))

    def _publish(self, message: Json) -> None:
        """Publish; without an advertisement it registers by itself, if the topic has a type already."""
        topic = self._graph.topic(resolved(message["topic"]), None)
        if self not in topic.publishers:
            self._graph.advertise(topic, self, message.get("id"), is_latched=message.get("latch", False))
        topic.publish(message.get("msg", {}))
        self._far_side.num_published[topic.name] += 1

    def _subscribe(self, message: Json) -> None:
        """Subscribe; a compression that it does not know is none. (png and the CBORs are left out here.)"""
        spelling = message["topic"]
        topic = self._graph.topic(resolved(spelling), message.get("type"))
        key = (self, spelling)
        if key not in topic.subscriptions:
            topic.subscriptions[key] = Subscription(self, spelling)
        subscription = topic.subscriptions[key]
        settings = Settings(message.get("throttle_rate", 0), message.get("queue_length", 0))
        subscription.ids[message.get("id")] = settings
        topic.greet(subscription)

    def _unsubscribe(self, message: Json) -> None:
        spelling = message["topic"]
        topic = self._graph.topics.get(resolved(spelling))
        if topic is not None and (self, spelling) in topic.subscriptions:
            self._forget(topic.name, spelling, message.get("id"))

    def _forget(self, name: str, spelling: str, mark: Hashable = None) -> None:
        """End one id of a subscription, or all of it."""
        topic = self._graph.topics[name]
        subscription = topic.subscriptions[self, spelling]
        if mark is None:
            subscription.ids.clear()
        subscription.ids.pop(mark, None)
        if not subscription.ids:
            subscription.close()
            del topic.subscriptions[self, spelling]
            if not topic.is_known:
                self._graph.forget(topic)

    # Services

    def _call_service(self, message: Json) -> None:
        """Call in a thread of its own: what the client sends next does not wait for the answer."""
        self.start(self._call(message))

    async def _call(self, message: Json) -> None:
        answer: Json = {"op": "service_response", "service": message["service"]}
        if "id" in message:
            answer["id"] = message["id"]
        try:
            answer |= {"values": await self._values(message), "result": True}
        except RosError as error:
            answer |= {"values": str(error), "result": False}
        await self.send(answer)

    async def _values(self, message: Json) -> Json:
        service = self._graph.services.get(resolved(message["service"]))
        if service is None:
            raise RosError(f"Service {message['service']} does not exist")
        args = self._arguments(service, message.get("args", []))
        if service.handler is not None:
            if service.name.startswith("/rosapi/"):
                await asyncio.sleep(self._far_side.rosapi_delay)
            values = self._graph.types.fill(service.response, service.handler(args))
        else:
            values = await service.ask(args)
        return self._graph.types.show(service.response, values)

    def _arguments(self, service: Service, args: object) -> Json:
        """The request: by names, by a list in the order of the fields; anything else is none."""
        if isinstance(args, list):
            args = {field.name: value for field, value in zip(service.request.fields, args, strict=False)}
        types = self._graph.types
        return types.show(service.request, types.fill(service.request, args if isinstance(args, dict) else {}))

    def _advertise_service(self, message: Json) -> None:
        """Serve; the last one wins, whoever it is, and the one before is not told. There is no reply."""
        name = resolved(message["service"])
        old = self._graph.services.get(name)
        if old is not None and old.provider is not None:
            self._log(f"Duplicate service advertised. Overwriting {name}.", message.get("id"))
            old.tear_down()
            del self._graph.services[name]
        request, response = self._graph.types.service(message["type"])
        self._graph.services[name] = Service(name, message["type"], request, response, self)

    def _unadvertise_service(self, message: Json) -> None:
        """Serve no longer; any client may say so."""
        name = resolved(message["service"])
        if name not in self._graph.services or self._graph.services[name].provider is None:
            raise RosError(f"Service {name} has not been advertised via rosbridge, can't unadvertise.")
        self._graph.services.pop(name).tear_down()

    def _service_response(self, message: Json) -> None:
        """Bring an answer to whoever called.

        `result` is looked at by nobody: false is a success with these values. Without `values`, or with values that do
        not fit (a text that says why not), the error is the far side's own, and *the caller waits for ever*.
        """
        name = resolved(message["service"])
        service = self._graph.services.get(name)
        if service is None or service.provider is None:
            raise RosError(f"Service {name} has not been advertised via rosbridge.")
        values = self._graph.types.fill(service.response, message["values"])
        waiting = service.waiting.pop(message["id"], None)
        if waiting is None:
            raise RosError(f"no such request: {message['id']}")
        if not waiting.done():
            waiting.set_result(values)

    # Fragments

    def _fragment(self, message: Json) -> None:
        """Keep a piece, in a store *of all clients* by its id alone; joined in the order in which they came."""
        mark, num, total, data = (message.get(key) for key in ("id", "num", "total", "data"))
        if None in (mark, num, total, data):
            raise RosError("received invalid fragment!")
        pieces = self._far_side.pieces.setdefault(mark, {})
        pieces.setdefault(num, str(data))
        if len(pieces) == total:
            del self._far_side.pieces[mark]
            self._receive("".join(pieces.values()))


def resolved(name: str) -> str:
    """A name with its slash: the far side's node lives in the root namespace."""
    return name if name.startswith("/") else f"/{name}"


def _check(op: str, message: Json) -> None:
    """Raise rosbridge_library's words for a field that is missing or of a wrong type; null is one, and extras are not.

    Raises:
        RosError: there is one.
    """
    for name, (is_required, kind) in _FIELDS[op].items():
        if name not in message:
            if is_required:
                raise RosError(f"Expected a {name} field but none was found.")
        elif not isinstance(message[name], kind):
            raise RosError(f"Expected field {name} to be one of {kind}. Invalid value: {message[name]}")
