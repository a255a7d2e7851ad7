"""The reference loop: how fast a machine is, beside every figure that it gives.

Figures of two machines, or of two hours on one that others use, can be compared as multiples of it. It does a little of
what the server and a frame of the world do, and no commit changes it.
"""

from __future__ import annotations

from time import process_time

import numpy as np

ROUNDS = 10_000
"""Of the loop."""


def reference_loop() -> float:
    """Run the loop.

    Returns:
        Its CPU time, the least of five measurements [s].
    """
    return min(_run() for _ in range(5))


def _run() -> float:
    table, numbers, ones = {f"key {i}": float(i) for i in range(20)}, np.zeros(20), np.ones(20)
    start = process_time()
    for i in range(ROUNDS):
        total = 0.0
        for value in table.values():
            total += 0.5 * value
        table[f"key {i % 20}"] = total % 20.0
        np.add(numbers, ones, numbers)
        numbers[numbers > 5.0] = 0.0
    return process_time() - start


def reference_line() -> str:
    """Return a text about the loop, for the figures that follow."""
    return f"reference loop (scripts/bench/reference.py): {1e3 * reference_loop():.1f} ms of CPU"
