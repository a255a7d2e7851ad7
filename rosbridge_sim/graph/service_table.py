"""Services by name, and the calls in flight, with their providers, callers and time-outs.

The last owner to offer a name gets it. A call ends exactly once: it is answered, refused or given up. If a provider
leaves, its waiting calls fail at once. If a caller leaves, the answers to its calls are discarded.
"""

from __future__ import annotations

import heapq
from itertools import count

from rosbridge_sim.errors import EncodingError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.participant import Participant, resolve, size_of_body, take_over
from rosbridge_sim.graph.topics_services import Answer, Call, Handle, OnAnswer, Service
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.protocol.body_limits import BodyLimits
from rosbridge_sim.protocol.ops import OpBody

MAX_CALLS = 1_000
"""Default limit of calls, and of goals, that one caller may have in flight: ten times the number of the busiest known
client."""

MAX_STALE = 100
"""Ended calls that may stay in the list of deadlines. More are removed when they are half of the list, because a
deadline may be years away and a call holds its request."""


class ServiceTable:
    """The services of one bus.

    Attributes:
        by_name: all services, by absolute name.
        max_calls: calls that one caller may have in flight.
    """

    def __init__(self, state: BusState, types: TypeResolver, *, timeout: float | None, max_calls: int) -> None:
        """Create an empty table.

        Args:
            state: shared with the other parts of the bus.
            timeout: default time-out of a call [s]; None waits for ever.
            max_calls: calls that one caller may have in flight.
        """
        self.by_name: dict[str, Service] = {}
        self.max_calls = max_calls
        self._state = state
        self._types = types
        self._timeout = timeout
        self._deadlines: list[tuple[float, int, Call]] = []
        self._num_stale = 0  # ended calls in the list of deadlines
        self._ticket = count()

    def provide(
        self,
        owner: Participant,
        name: str,
        type_name: str,
        handle: Handle,
        *,
        is_exclusive: bool = False,
        limits: BodyLimits | None = None,
    ) -> Service:
        """Offer a service. The last owner to offer a name gets it; callers of the previous one are told at once.

        Args:
            name: name of the service; may be relative.
            handle: gets each call; a PeerError that it raises refuses the call.
            is_exclusive: no client may take the name, neither now nor later.
            limits: of a request; None for the usual ones if it is exclusive, otherwise for none.

        Raises:
            GraphError: the service belongs to the simulator.
            TypeNameError: the type does not exist.
        """
        name = resolve(name)
        service_type = self._types.service(type_name)
        old = self.by_name.get(name)
        if old is not None:
            if old.is_exclusive and old.owner is not owner and not old.owner.gives_way(owner):
                raise GraphError(f"Service {name} is provided by {old.owner.name} alone", reason=Reason.NAME_TAKEN)
            if old.owner is not owner:
                owner.notify("warning", f"Duplicate service advertised. Overwriting {name}.")
                self._state.guard.attempt("the loss of a service", take_over, old.owner, "service", name, owner)
            self._drop_service(old, f"Service {name} was unadvertised")
        if limits is None and is_exclusive:
            limits = BodyLimits()
        service = Service(name, service_type, owner, handle, is_exclusive, limits)
        self.by_name[name] = service
        self._state.held_by(owner).services[service] = None
        self._state.report_holdings(owner)
        return service

    def withdraw(self, owner: Participant, name: str, *, answers_calls: bool = False) -> None:
        """Stop offering a service.

        Args:
            name: name of the service; may be relative.
            answers_calls: the owner will still answer the calls in flight; otherwise they are refused now.

        Raises:
            GraphError: `owner` does not offer it.
        """
        service = self.by_name.get(resolve(name))
        if service is None or service.owner is not owner:
            text = f"Service {name} has not been advertised via rosbridge, can't unadvertise."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        self._drop_service(service, None if answers_calls else f"Service {service.name} was unadvertised")

    def call(
        self,
        caller: Participant,
        name: str,
        args: OpBody,
        on_answer: OnAnswer,
        *,
        now: float,
        timeout: float | None = None,
    ) -> None:
        """Call a service.

        `on_answer` is called exactly once, perhaps before this returns, unless the caller leaves first.

        Args:
            caller: owner of the call, which ends when the owner leaves.
            name: name of the service; may be relative.
            args: fields by name (an object), by position (a list), or none.
            on_answer: gets the answer. Every failure is an answer, too.
            timeout: time-out [s]; None means the default of all services, 0 or less means no limit.
        """
        state = self._state
        try:
            service = self.by_name.get(name) or self.by_name.get(resolve(name))
            if service is None:
                raise GraphError(f"Service {name} does not exist", reason=Reason.NO_SUCH_SERVICE)
            request = service.decode_request(args, state.stamp_ns, caller)
            held = (state.held.get(caller) or state.held_by(caller)).calls
            if len(held) >= self.max_calls:
                raise GraphError(f"Too many calls in flight: at most {self.max_calls}", reason=Reason.TOO_MUCH)
            # The simulator's own services need no limit: they answer at once, or hold their caller.
            size = 0 if service.is_exclusive else size_of_body(request, args)
            if size and not state.account_of(caller).take(size):
                text = "Too much in flight: this client makes the server hold too much"
                raise GraphError(text, reason=Reason.TOO_MUCH)
        except PeerError as error:
            on_answer(Answer(is_ok=False, values=str(error), reason=error.reason))
            return
        call = Call(service, caller, request, on_answer, self, num_bytes=size)
        service.calls[call] = None
        held[call] = None
        if timeout is None:
            timeout = self._timeout if self._timeout is not None else service.patience
        try:
            service.handle(call, now)
        except PeerError as error:
            if isinstance(error, EncodingError):
                state.guard.note_encoding(service.name, error)
            call.refuse(str(error), error.reason)
        except Exception as error:  # noqa: BLE001 - an internal error in the provider's own state
            call.refuse("The provider failed; the server's log says why")
            state.guard.blame(service.owner, error)
        if timeout is not None and timeout > 0 and not call.is_done:
            call.deadline = now + timeout
            heapq.heappush(self._deadlines, (call.deadline, next(self._ticket), call))
            state.agenda.announce(call.deadline)

    def forget_call(self, call: Call) -> None:
        """Remove an ended call from its caller's list (for `Call` alone)."""
        if call.num_bytes:
            self._state.account_of(call.caller).give(call.num_bytes)
        held = self._state.held.get(call.caller)
        if held is not None:
            held.calls.pop(call, None)
        if call.deadline is not None:
            self._num_stale += 1
            if self._num_stale > MAX_STALE and 2 * self._num_stale > len(self._deadlines):
                self._deadlines = [each for each in self._deadlines if not each[2].is_done]
                heapq.heapify(self._deadlines)
                self._num_stale = 0

    def hand_over(self, call: Call, answer: Answer) -> None:
        """Give the answer of a call to its caller (for `Call` alone). If it cannot be encoded, the call is refused."""
        try:
            call.on_answer(answer)
        except Exception as error:  # noqa: BLE001 - an internal error
            if isinstance(error, EncodingError) and answer.is_ok:
                name, owner = call.service.name, call.service.owner
                self._state.guard.note_encoding(name, error)
                self._state.guard.attempt("a remark to a provider", owner.notify, "error", f"{name}: {error}")
                self.hand_over(call, Answer(is_ok=False, values=str(error)))
            else:  # the error is in the caller's own state
                self._state.guard.contain(call.caller, error)

    # Time and departure

    def next_deadline(self) -> float | None:
        """Return when `expire` has something to do next [s]; None if never."""
        while self._deadlines and self._deadlines[0][2].is_done:
            self._pop_deadline()
        return self._deadlines[0][0] if self._deadlines else None

    def expire(self, now: float) -> None:
        """Give up the calls whose time is over."""
        while self._deadlines and (self._deadlines[0][0] <= now or self._deadlines[0][2].is_done):
            refuse = self._pop_deadline().refuse
            self._state.guard.attempt("a time-out", refuse, "Timeout exceeded while waiting for service response")

    def abandon_calls(self, owner: Participant) -> None:
        """End the calls that an owner waits for; their answers are discarded.

        Args:
            owner: the caller that leaves.
        """
        for call in list(self._state.holdings(owner).calls):
            self._state.guard.attempt("the end of a call", call.abandon)

    def leave(self, owner: Participant) -> None:
        """End the services of an owner, and refuse the calls that wait for them."""
        for service in list(self._state.holdings(owner).services):
            why = f"Service {service.name} was unadvertised: its provider disconnected"
            self._state.guard.attempt("the end of a service", self._drop_service, service, why)

    # Bookkeeping

    def _pop_deadline(self) -> Call:
        """Remove and return the call with the earliest deadline."""
        call = heapq.heappop(self._deadlines)[2]
        self._num_stale -= call.is_done
        call.deadline = None
        return call

    def _drop_service(self, service: Service, why: str | None) -> None:
        """Remove a service; refuse its waiting calls, unless `why` is None."""
        if self.by_name.get(service.name) is service:
            del self.by_name[service.name]
        self._state.held_by(service.owner).services.pop(service, None)
        if why is not None:
            for call in list(service.calls):
                call.refuse(why)
        self._state.report_holdings(service.owner)
