"""Turns of clients: order and fairness."""

from __future__ import annotations

import asyncio

import pytest

from rosbridge_sim.shell.websocket import turns
from rosbridge_sim.shell.websocket.turns import ROUND_BYTES, ROUND_TIME, TURN_TIME, Turns


class Clock:
    """The time of `perf_counter`, which moves when somebody works."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(turns, "perf_counter", clock)
    return clock


class Client:
    """Has some work left, in ops of a given cost [s]."""

    def __init__(self, name: str, clock: Clock, log: list[str], num_ops: int, cost: float) -> None:
        self.name = name
        self.num_ops = num_ops
        self._clock = clock
        self._log = log
        self._cost = cost

    def work(self, until: float) -> bool:
        self._log.append(self.name)
        while self.num_ops:
            self.num_ops -= 1
            self._clock.now += self._cost
            if self._clock.now >= until:
                break
        return self.num_ops > 0


async def rounds(num: int) -> None:
    for _ in range(num):
        await asyncio.sleep(0)


async def test_turn_of_one_client_and_round_of_all_are_bounded(clock: Clock) -> None:
    ended: list[float] = []
    these = Turns(asyncio.get_running_loop(), lambda: ended.append(clock.now))
    assert these.begin() == clock.now + TURN_TIME
    clock.now += TURN_TIME
    assert these.begin() == clock.now + TURN_TIME
    clock.now = 100.0 + ROUND_TIME + TURN_TIME / 2
    assert these.begin() < clock.now  # the round is over
    await rounds(1)
    assert ended == [clock.now]
    assert these.begin() == clock.now + TURN_TIME


async def test_what_waits_for_a_socket_is_sent_at_the_end_of_the_round(clock: Clock) -> None:
    def move_world() -> None:
        log.append("world")
        these.flush_later(lambda: log.append("what the world says"))

    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), move_world)
    these.begin()
    these.flush_later(lambda: log.append("answer"))
    these.wait(Client("left", clock, log, 1, TURN_TIME), had_turn=True)
    await rounds(1)
    assert log == ["world", "answer", "what the world says", "left"]
    await rounds(3)
    assert log.count("answer") == 1
    assert log.count("world") == log.count("what the world says")


async def test_what_waits_for_a_socket_outside_a_round_is_sent_in_the_next_pass() -> None:
    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), lambda: log.append("world"))
    these.flush_later(lambda: log.append("a"))
    assert log == []
    await rounds(1)
    assert log == ["a"]


async def test_a_small_request_waits_for_one_turn_of_a_large_one(clock: Clock) -> None:
    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), lambda: None)
    large = Client("large", clock, log, 1_000, TURN_TIME / 10)
    these.wait(large, had_turn=True)
    await rounds(3)
    these.wait(Client("small", clock, log, 1, TURN_TIME / 10), had_turn=False)
    before = len(log)
    await rounds(2)
    assert log[before:][0] == "small"
    await rounds(1_000)
    assert large.num_ops == 0


async def test_large_requests_take_turns_without_starving_one(clock: Clock) -> None:
    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), lambda: None)
    for name in "abc":
        these.wait(Client(name, clock, log, 100, TURN_TIME / 10), had_turn=True)
    await rounds(100)
    assert log == list("abc") * 10


async def test_waiting_client_has_its_turn_in_each_round_despite_new_ones(clock: Clock) -> None:
    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), lambda: None)
    these.wait(Client("old", clock, log, 20, TURN_TIME), had_turn=True)
    for i in range(10):
        for _ in range(10):
            these.wait(Client(f"new {i}", clock, log, 1, TURN_TIME), had_turn=False)
        await rounds(1)
    assert log.count("old") >= 9


async def test_bytes_of_a_round_are_bounded_but_one_client_may_always_send(clock: Clock) -> None:
    class Sender:
        num_left = 3

        def __init__(self, name: str) -> None:
            self._name = name

        def work(self, _until: float) -> bool:
            if these.num_bytes_left > 0:
                log.append(self._name)
                these.num_bytes_left -= ROUND_BYTES
                self.num_left -= 1
            return self.num_left > 0

    def send_elsewhere() -> None:
        these.num_bytes_left -= ROUND_BYTES

    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), lambda: these.flush_later(send_elsewhere))
    for name in "ab":
        these.wait(Sender(name), had_turn=True)
    for num in range(1, 7):
        await rounds(1)
        assert len(log) == num
    assert log == list("ab") * 3
    assert clock.now == 100.0


async def test_client_that_left_is_not_called_again(clock: Clock) -> None:
    log: list[str] = []
    these = Turns(asyncio.get_running_loop(), lambda: None)
    gone = Client("gone", clock, log, 5, TURN_TIME)
    these.wait(gone, had_turn=False)
    these.leave(gone)
    these.leave(gone)
    await rounds(5)
    assert log == []


async def test_idle_server_runs_no_rounds(clock: Clock) -> None:
    num_rounds = 0

    def count() -> None:
        nonlocal num_rounds
        num_rounds += 1

    these = Turns(asyncio.get_running_loop(), count)
    these.begin()
    these.begin()
    await rounds(10)
    assert num_rounds == 1
    assert clock.now == 100.0
