"""Free memory is given back to the system some time after large frames and large falls of held bytes."""

from __future__ import annotations

import sys
import threading

import pytest

from rosbridge_sim.shell.websocket import freed_memory
from rosbridge_sim.shell.websocket.freed_memory import DELAY, FALL, MemoryReturn, resident_bytes, trim_memory

MB = 2**20
PERIOD = 0.5


class Process:
    """The memory of a process as a test says; giving back leaves what is in use."""

    def __init__(self) -> None:
        self.in_use = self.resident = 50 * MB
        self.given_back_at: list[float] = []
        self.memory = MemoryReturn(self._give_back, lambda: self.resident)
        self.now = 0.0

    def _give_back(self) -> None:
        self.given_back_at.append(self.now)
        self.resident = self.in_use

    def pass_time(self, seconds: float, held: int, *, num_frames: int = 0) -> None:
        """Let time pass; in each period so many large frames come."""
        for _ in range(int(seconds / PERIOD)):
            self.now += PERIOD
            for _ in range(num_frames):
                self.memory.note_large_frame(self.now)
            self.memory.look(held, self.now)


def test_memory_is_given_back_after_a_large_fall_of_held_bytes_without_a_large_frame() -> None:
    process = Process()
    process.pass_time(60.0, 0)
    process.pass_time(60.0, 10 * MB)
    process.pass_time(60.0, 0)
    assert process.given_back_at == []
    process.pass_time(10.0, FALL)
    process.pass_time(60.0, 0)
    assert process.given_back_at == [190.0 + PERIOD + DELAY]


def test_memory_is_given_back_after_a_rise_and_fall_between_two_looks() -> None:
    process = Process()
    process.pass_time(5.0, 0)
    process.resident += 2 * FALL
    process.pass_time(60.0, 0)
    assert process.given_back_at == [5.0 + PERIOD + DELAY]
    process.in_use += 10 * FALL
    process.resident = process.in_use
    process.pass_time(60.0, 0)
    assert len(process.given_back_at) == 2, "memory in use is not given back again and again"


def test_steady_stream_of_large_frames_delays_its_own_return_and_no_other() -> None:
    process = Process()
    process.pass_time(60.0, 16 * MB, num_frames=5)
    assert process.given_back_at == []
    process.pass_time(5.0, 16 * MB + FALL, num_frames=5)
    process.pass_time(10.0, 16 * MB, num_frames=5)
    assert process.given_back_at == [65.0 + PERIOD + DELAY]
    process.pass_time(10.0, 16 * MB)
    assert process.given_back_at[1:] == [75.0 + DELAY]


@pytest.mark.skipif(freed_memory._function("malloc_trim") is None, reason="the C library has no malloc_trim")
def test_freed_memory_leaves_the_process() -> None:
    parts = [bytes(100_000) for _ in range(1_500)]  # a third fits into the holes of a process of many tests
    ends = [bytes(1_000)]
    most = resident_bytes()
    del parts
    trim_memory()
    for thread in threading.enumerate():
        if thread.name == "malloc_trim":
            thread.join()
    assert resident_bytes() < most - 30 * MB
    assert ends


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is Linux's")
def test_resident_memory_is_that_of_this_process() -> None:
    assert 10 * MB < resident_bytes() < 10_000 * MB
