"""The account of one client: bounded in bytes, and empty at the end."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.protocol.client_memory import Account, HeldMessages


def held(limit: int, total: Account | None = None) -> tuple[Account, HeldMessages[bytes]]:
    account = Account(limit, total)
    return account, HeldMessages(account, len)


def test_message_beyond_the_account_is_not_accepted() -> None:
    total = Account()
    account = Account(100, total)
    assert account.take(60)
    assert account.has_room(40)
    assert not account.has_room(41)
    assert not account.take(41)
    assert (account.num_bytes, total.num_bytes) == (60, 60)
    account.give(60)
    assert (account.num_bytes, total.num_bytes) == (0, 0)


def test_oldest_messages_are_dropped_for_the_newest() -> None:
    account, messages = held(10)
    assert [messages.put(message, 5) for message in (b"aaa", b"bbb", b"ccc")] == [0, 0, 0]
    assert messages.put(b"dddd", 5) == 1
    assert messages.messages() == [b"bbb", b"ccc", b"dddd"]
    assert account.num_bytes == 10
    assert messages.put(b"e", 2) == 2
    assert messages.messages() == [b"dddd", b"e"]


def test_message_larger_than_the_account_drops_all_others_and_itself() -> None:
    account, messages = held(10)
    messages.put(b"a", 5)
    assert messages.put(b"x" * 11, 5) == 2
    assert (len(messages), account.num_bytes) == (0, 0)


def test_two_queues_of_one_client_share_its_account() -> None:
    account = Account(10)
    first, second = HeldMessages(account, len), HeldMessages(account, len)
    first.put(b"x" * 8, 5)
    assert second.put(b"y" * 5, 5) == 1
    assert second.put(b"y" * 2, 5) == 0


@given(st.lists(st.tuples(st.binary(max_size=20), st.integers(0, 4), st.sampled_from(["put", "pop", "shorten"]))))
def test_account_is_empty_after_any_order_of_events(events: list[tuple[bytes, int, str]]) -> None:
    total = Account()
    queues = [held(30, total) for _ in range(2)]
    for i, (message, length, what) in enumerate(events):
        account, messages = queues[i % 2]
        if what == "put":
            messages.put(message, length)
        elif what == "pop" and len(messages):
            messages.pop()
        elif what == "shorten":
            messages.shorten(length)
        assert account.num_bytes == sum(map(len, messages.messages())) <= 30
    assert total.num_bytes == sum(account.num_bytes for account, _ in queues)
