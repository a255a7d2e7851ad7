"""Memory of a worker in which a driver in Python runs: a bound during a drive, and how much is used behind it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from rosbridge_sim.campaigns.campaign_model import DriverItem

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]


def data_size() -> int:
    """Return the private memory of this process, as its bound counts it [bytes]; 0 where that cannot be told."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    except (OSError, ValueError, IndexError, AttributeError):
        return 0


@contextlib.contextmanager
def limited_memory(driver: DriverItem) -> Iterator[None]:
    """Bound the memory of this process to a driver's `memory_mb` meanwhile. Programs have a bound of their own.

    Args:
        driver: of the runs.
    """
    if resource is None or driver.is_program:
        yield
        return
    before, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = driver.memory_mb * 2**20
    resource.setrlimit(resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (before, hard))
