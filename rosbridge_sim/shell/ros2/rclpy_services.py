"""Services by rclpy: those of nodes for the bus, and those of the bus for nodes; and what actions have in common."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, Generic, TypeVar

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.far_graph import FarServiceType, OnReply
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros2.cdr_types import CdrActionType
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.shell.ros2.rclpy_node import READY_PERIOD, RclpyNode
from rosbridge_sim.shell.ros2.rclpy_types import RclpyObject, rclpy_errors, rclpy_quality, read_cdr, write_cdr

OFFERS_PER_TURN: Final = 10
"""Services or actions that one turn of the loop offers to nodes: one takes about a millisecond."""

Offer = TypeVar("Offer", FarServiceType, CdrActionType)


class RclpyOffers(ABC, Generic[Offer]):
    """Services or actions of our node, by their names on the bus."""

    kind: str

    def __init__(self, node: RclpyNode) -> None:
        self._node = node
        self._loop = node.loop
        self._offered: dict[str, tuple[Offer, RclpyObject]] = {}
        self._clients: dict[str, RclpyObject] = {}
        self._log = OnceLog(ROS2_GRAPH.logger)

    def keep_clients(self, names: set[str]) -> None:
        """End the clients of those that nodes provide no more."""
        for name in self._clients.keys() - names:
            self._node.run(partial(self._destroy, self._clients.pop(name)))

    def offer(self, wanted: Mapping[str, Offer]) -> bool:
        """Offer to nodes what is wanted, a few in one turn, and end others.

        Returns:
            True if there is more to do.
        """
        for name in [name for name, (one, _) in self._offered.items() if wanted.get(name) != one]:
            self._node.run(partial(self._destroy, self._offered.pop(name)[1]))
        failed: dict[str, tuple[GraphError, list[str]]] = {}  # by the package of the type
        num_made = 0
        for name, one in wanted.items():
            if name in self._offered:
                continue
            try:
                found = self._node.types.find(one.name)
                num_made += 1
                if num_made > OFFERS_PER_TURN:
                    return True
                self._offered[name] = one, self._provide(name, found)
            except GraphError as error:
                failed.setdefault(one.name.partition("/")[0], (error, []))[1].append(name)
        for why, names in failed.values():
            more = f" and {len(names) - 1} more of its package" if len(names) > 1 else ""
            self._log.tell(f"{self.kind} {names[0]}{more} cannot be offered to nodes: {why}", logging.INFO)
        return False

    @abstractmethod
    def _provide(self, name: str, found: RclpyObject) -> RclpyObject:
        """Offer one to nodes.

        Args:
            found: the class of its type.

        Raises:
            GraphError: the library refuses it.
        """

    @abstractmethod
    def _destroy(self, one: RclpyObject) -> None:
        """End one that was offered, or a client (in the thread that spins)."""


MAX_SENT: Final = 10
"""Requests to one service that wait for an answer: a provider keeps 10 that it has not taken yet, and loses others."""

ANSWERS_PER_PERIOD: Final = 5
ANSWER_PERIOD: Final = 0.005
"""Most answers of one service in a period [s]."""

QUEUE_PATIENCE: Final = 1.0
"""Longest wait of a request for that [s], since a provider may also take many and answer late."""

CALLS: Final = Quality(depth=1_000)
"""Of requests and answers: ROS 2's own depth of 10 loses some of 20 calls at once."""


class RclpyServices(RclpyOffers[FarServiceType]):
    """Services of our node; see `FarCall`.

    Attributes:
        services: gets what comes; set before the first turn of the loop.
    """

    kind = "service"

    services: NodeServices

    def __init__(self, node: RclpyNode) -> None:
        super().__init__(node)
        self._num_sent: Counter[RclpyObject] = Counter()  # requests without an answer yet, by client of rclpy

    # Services of nodes; see `FarCall`

    def call(self, name: str, service: FarServiceType, request: bytes, call: Call, on_reply: OnReply) -> None:
        """See `FarCall`."""
        found = self._node.types.find(service.name)
        with rclpy_errors():
            client = self._client(name, found)
            message = read_cdr(request, found.Request)
        self._send(client, message, call, on_reply, self._loop.time() + QUEUE_PATIENCE)

    def _client(self, name: str, found: RclpyObject) -> RclpyObject:
        if name not in self._clients:
            self._clients[name] = self._node.library.create_client(
                found, self._node.far(name), qos_profile=rclpy_quality(CALLS)
            )
        return self._clients[name]

    def _send(self, client: RclpyObject, message: RclpyObject, call: Call, on_reply: OnReply, hurry_at: float) -> None:
        """Send a request as soon as the provider is found and has room: it would be lost before.

        Args:
            hurry_at: when it is sent though others wait for their answers [s].
        """
        if call.is_done or self._node.is_stopped:
            return
        try:
            has_room = self._num_sent[client] < MAX_SENT or self._loop.time() >= hurry_at
            if not (has_room and client.service_is_ready()):
                self._loop.call_later(READY_PERIOD, self._send, client, message, call, on_reply, hurry_at)
                return
            future = client.call_async(message)
        except Exception as error:  # noqa: BLE001 - of the library; its client has gone with the service, for example
            on_reply(False, f"the service cannot be called: {error!r:.200}".encode())  # noqa: FBT003 - see `OnReply`
            return
        self._num_sent[client] += 1
        call.on_end = partial(self._forget, client, future)
        future.add_done_callback(partial(self._hand_reply, on_reply))

    def _hand_reply(self, on_reply: OnReply, future: RclpyObject) -> None:
        """Hand an answer to the loop (in the thread that spins)."""
        if future.cancelled():
            return
        error = future.exception()
        body = f"{error!r:.300}".encode() if error is not None else write_cdr(future.result())
        self._node.inbox.put(lambda: on_reply(error is None, body), len(body))

    def _forget(self, client: RclpyObject, future: RclpyObject) -> None:
        """Forget a call that has ended, perhaps without an answer of its provider, such as by a time-out."""
        self._num_sent[client] -= 1
        if not self._num_sent[client]:
            del self._num_sent[client]
        if not future.done():
            client.remove_pending_request(future)

    # Services of the bus

    def _destroy(self, one: RclpyObject) -> None:
        library = self._node.library
        _ = library.destroy_client(one) or library.destroy_service(one)

    def _provide(self, name: str, found: RclpyObject) -> RclpyObject:
        """Offer a service. Its answer comes later, from the loop, so the header of each request is kept until then."""
        request: list[RclpyObject] = []

        def take(given: RclpyObject, response: RclpyObject) -> RclpyObject:
            request[:] = [given]
            return response

        with rclpy_errors():
            service = self._node.library.create_service(
                found, self._node.far(name), take, qos_profile=rclpy_quality(CALLS)
            )
        send, pacer = service.send_response, Pacer(self._loop.call_later)

        def answer(response: RclpyObject, header: RclpyObject) -> None:
            pacer.do(lambda: name in self._offered and send(response, header))

        service.send_response = lambda _response, header: self._hand_request(name, found, request.pop(), header, answer)
        return service

    def _hand_request(
        self,
        name: str,
        found: RclpyObject,
        request: RclpyObject,
        header: RclpyObject,
        answer: Callable[[RclpyObject, RclpyObject], None],
    ) -> None:
        """Hand a request to the loop (in the thread that spins)."""

        def on_reply(is_ok: bool, body: bytes) -> None:  # noqa: FBT001 - see `OnReply`
            if is_ok:
                answer(read_cdr(body, found.Response), header)
                return
            refusal = refusal_of(found.Response(), why := body.decode(errors="replace"))
            if refusal is not None:
                answer(refusal, header)
            else:
                self._log.tell(f"service {name}: a node that called it gets no answer, because the call failed: {why}")

        def run() -> None:
            if name in self._offered:
                self.services.call("", name, raw, on_reply, self._loop.time())

        raw = write_cdr(request)
        self._node.inbox.put(run, len(raw))


class Pacer:
    """Work that is done at once, but only a few pieces in each period.

    A node keeps 10 answers that it has not taken yet, and loses the others; then it waits for ever.
    """

    def __init__(self, call_later: Callable[[float, Callable[[], None]], object]) -> None:
        self._call_later = call_later
        self._waiting: deque[Callable[[], object]] = deque()
        self._num_done: int | None = None  # in this period; None if there is none

    def do(self, work: Callable[[], object]) -> None:
        """Do something now, or when there is room for it."""
        self._waiting.append(work)
        if self._num_done is None:
            self._begin()
        else:
            self._go_on()

    def _begin(self) -> None:
        self._num_done = 0 if self._waiting else None
        if self._num_done is not None:
            self._call_later(ANSWER_PERIOD, self._begin)
            self._go_on()

    def _go_on(self) -> None:
        while self._waiting and self._num_done is not None and self._num_done < ANSWERS_PER_PERIOD:
            self._num_done += 1
            self._waiting.popleft()()


def refusal_of(response: RclpyObject, why: str) -> RclpyObject | None:
    """Return the response for a call that failed: `success` is false, and `message` says why; None if it lacks these.

    ROS 2 has no way to fail a call.

    Args:
        response: a response with default values.
    """
    if getattr(response, "success", None) is not False:
        return None
    for name in ("message", "status_message", "reason", "error_message"):
        if getattr(response, name, None) == "":
            setattr(response, name, why)
            break
    return response
