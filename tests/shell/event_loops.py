"""The event loops that a server may run on."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

__all__ = ["EACH_LOOP", "MakeLoop"]

MakeLoop = Callable[[], asyncio.AbstractEventLoop]

_LOOPS: dict[str, MakeLoop] = {"asyncio": asyncio.new_event_loop}
try:
    import uvloop
except ImportError:  # on Windows
    pass
else:
    _LOOPS["uvloop"] = uvloop.new_event_loop

EACH_LOOP = pytest.mark.parametrize("make_loop", _LOOPS.values(), ids=_LOOPS)
"""Run a test once for each of them: `make_loop` makes one."""
