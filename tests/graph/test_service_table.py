"""A service has one provider, and a call one end."""

from __future__ import annotations

import pytest

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.service_table import MAX_CALLS, MAX_STALE
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.protocol.client_memory import Account
from tests.graph.bus_fixture import make_bus, make_store
from tests.graph.participants import ADD, Somebody


def test_an_exclusive_service_cannot_be_taken_over() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    service = bus.provide(node, "/s", ADD, node.keep, is_exclusive=True)
    with pytest.raises(GraphError, match="provided by /morai_sim alone"):
        bus.provide(other, "/s", ADD, other.keep)
    with pytest.raises(GraphError, match="can't unadvertise"):
        bus.withdraw(other, "/s")
    assert bus.services["/s"] is service


def test_withdrawn_service_lets_pending_calls_finish_or_refuses_them() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    for answers_calls in (True, False):
        bus.provide(provider, "/add", ADD, provider.keep)
        bus.call(caller, "/add", {}, caller.answers.append, now=0.0)
        bus.withdraw(provider, "/add", answers_calls=answers_calls)
        provider.calls[-1].refuse("later")
    assert [answer.values for answer in caller.answers] == ["later", "Service /add was unadvertised"]


def test_ended_calls_do_not_wait_for_a_deadline_that_is_far_away() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.keep)
    bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=5.0)
    for _ in range(10 * MAX_STALE):
        bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=1e9)
        provider.calls.pop().refuse("no")
    assert len(bus._service_table._deadlines) <= 2 * MAX_STALE
    bus.expire(5.0)
    assert caller.answers[-1].values == "Timeout exceeded while waiting for service response"
    assert provider.calls[0].request is None
    assert bus.next_deadline() is None


def test_call_in_flight_counts_on_its_callers_account_until_it_ends() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    account = bus.accounts[caller] = Account(10_000)
    bus.provide(provider, "/add", ADD, provider.keep)
    bus.provide(provider, "/own", ADD, provider.keep, is_exclusive=True)
    bus.call(caller, "/own", {}, caller.answers.append, now=0.0)
    assert account.num_bytes == 0  # the simulator's own services answer at once
    for end in ("answer", "refuse", "expire", "leave"):
        bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=1.0)
        assert account.num_bytes > 0
        if end == "answer":
            provider.calls[-1].answer(bus.store.service(ADD).response.default())
        elif end == "refuse":
            provider.calls[-1].refuse("no")
        elif end == "expire":
            bus.expire(1.0)
        else:
            bus.withdraw(provider, "/add")
        assert account.num_bytes == 0


def test_call_beyond_the_account_is_refused() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.accounts[caller] = Account(1)
    bus.provide(provider, "/add", ADD, provider.keep)
    bus.call(caller, "/add", {}, caller.answers.append, now=0.0)
    (answer,) = caller.answers
    assert (answer.is_ok, answer.reason, provider.calls) == (False, Reason.TOO_MUCH, [])
    assert str(answer.values).startswith("Too much in flight: ")


def test_readvertised_service_is_silent_for_its_owner_and_a_warning_for_others() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    for is_exclusive in (True, False):
        service = bus.provide(node, "s", ADD, node.keep, is_exclusive=is_exclusive)
        assert bus.services == {"/s": service}
    assert node.told == []
    bus.provide(other, "/s", ADD, other.keep)
    assert other.told == [("warning", "Duplicate service advertised. Overwriting /s.")]


def test_call_ends_at_its_deadline() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.keep)
    bus.call(caller, "/add", {"a": 1}, caller.answers.append, now=0.0, timeout=2.0)
    bus.call(caller, "/add", {"a": 2}, caller.answers.append, now=0.0, timeout=0.0)
    bus.call(caller, "/add", {"a": 3}, caller.answers.append, now=0.0)
    assert bus.next_deadline() == 2.0
    bus.expire(1.9)
    assert caller.answers == []
    bus.expire(2.0)
    assert [a.values for a in caller.answers] == ["Timeout exceeded while waiting for service response"]
    assert bus.next_deadline() is None
    provider.calls[0].answer(bus.store.service(ADD).response.default())
    assert len(caller.answers) == 1


def test_a_provider_hears_of_the_end_of_a_call_once_however_it_ends() -> None:
    bus, provider, caller, leaving = make_bus(), Somebody(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.keep)
    for one, timeout in ((caller, 2.0), (caller, 9.0), (leaving, 9.0), (caller, 9.0)):
        bus.call(one, "/add", {}, one.answers.append, now=0.0, timeout=timeout)
    ends: list[int] = []
    for i, call in enumerate(provider.calls):
        call.on_end = lambda i=i: ends.append(i)
    bus.expire(2.0)
    provider.calls[1].refuse("no")
    provider.calls[1].refuse("no, again")
    bus.leave(leaving, 3.0)
    assert ends == [0, 1, 2], "given up, refused, and the caller has left"
    bus.withdraw(provider, "/add")
    assert ends == [0, 1, 2, 3]


def test_default_time_out_holds_for_a_call_without_one() -> None:
    bus = Bus(make_store(), service_timeout=5.0)
    provider, caller = Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.keep)
    bus.call(caller, "/add", None, caller.answers.append, now=1.0)
    assert bus.next_deadline() == 6.0
    provider.calls[0].refuse("no")
    assert bus.next_deadline() is None


def test_internal_failure_of_a_provider_still_answers_the_call() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()

    def fail(_call: Call, _now: float) -> None:
        raise ZeroDivisionError

    bus.provide(provider, "/add", ADD, fail)
    with pytest.raises(ZeroDivisionError):
        bus.call(caller, "/add", None, caller.answers.append, now=0.0)
    assert [a.is_ok for a in caller.answers] == [False]


def test_calls_in_flight_are_bounded() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.keep)
    for _ in range(MAX_CALLS + 1):
        bus.call(caller, "/add", None, caller.answers.append, now=0.0)
    assert len(provider.calls) == MAX_CALLS
    assert [a.is_ok for a in caller.answers] == [False]
    provider.calls[0].refuse("no")
    bus.call(caller, "/add", None, caller.answers.append, now=0.0)
    assert len(provider.calls) == MAX_CALLS + 1
