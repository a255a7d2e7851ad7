"""Choice of numpy or compiled loops for the vehicles on lanes in this process.

Without a compiler, numpy drives them. With one, a library in the cache is taken at once; if there is none, a thread
waits for the compiler. Worlds take the loops over between two frames: both give the same bits.
"""

from __future__ import annotations

import importlib.util
import logging
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock, Thread
from typing import Final

VARIABLE: Final = "ROSBRIDGE_SIM_CC"
"""Environment variable with the command of a C compiler, as `cc`; `none` for no compiled loops."""

_EXTRA: Final = "ziglang"
_BASELINE: Final = "-mcpu=baseline"
"""For that compiler, which else writes code for this processor alone."""

_MOST_TOLD: Final = 1000
"""Characters of a warning: the command may be of any length."""

_log = logging.getLogger(__name__)
_once = Lock()


class _Backend:
    name = "numpy"
    is_started = False


def backend() -> str:
    """Return what drives vehicles on lanes from the next decision on: `numpy` or `compiled`."""
    return _Backend.name


def find_compiler(environment: Mapping[str, str]) -> tuple[str, ...]:
    """Return the command of the C compiler: that of `VARIABLE`, else that of the extra `[fast]`; empty for none."""
    given = environment.get(VARIABLE, "").strip()
    if given == "none":
        return ()
    if given:
        try:
            return tuple(shlex.split(given))
        except ValueError:  # a quote without its end: no such program, which the log will tell
            return (given,)
    return (sys.executable, "-m", _EXTRA, "cc", _BASELINE) if importlib.util.find_spec(_EXTRA) else ()


def start_kernels() -> Thread | None:
    """Have all worlds of this process driven by compiled loops as soon as these are there; the first call counts.

    Returns:
        The thread that waits for the compiler; None if there is nothing to wait for.
    """
    with _once:
        if _Backend.is_started:
            return None
        _Backend.is_started = True
    compiler = find_compiler(os.environ)
    if not compiler:
        return None
    from rosbridge_sim.shell.kernels import compiler as building  # noqa: PLC0415 - see above

    source = building.read_source()
    try:
        path = building.library_path(source, compiler, building.cache_folder(os.environ))
    except building.NoKernelsError as error:
        _warn(error)
        return None
    if building.is_whole(path):
        _take(source, (), path)
        return None
    thread = Thread(target=_take, args=(source, compiler, path), name="kernels", daemon=True)
    thread.start()
    return thread


def _warn(error: Exception) -> None:
    _log.warning("vehicles on lanes are driven by numpy, which is slower: %s", str(error)[:_MOST_TOLD])


def _take(source: str, compiler: Sequence[str], path: Path) -> None:
    """Take a library, which the compiler makes first unless it is empty."""
    from rosbridge_sim.shell.kernels import compiler as building  # noqa: PLC0415 - as above

    try:
        if compiler:
            building.compile_library(source, compiler, path)
        building.take_library(path)
    except building.NoKernelsError as error:
        _warn(error)
        return
    _Backend.name = "compiled"
    _log.info("vehicles on lanes are driven by compiled loops")
