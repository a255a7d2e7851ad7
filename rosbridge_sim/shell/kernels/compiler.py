"""Compile the loops of `world.kernels` with a C compiler, keep the library in the user's cache folder, and load it.

The library's name has a digest of the source, which has all constants and rules in it, of the version, the compiler
and the kind of processor: another one is another file. No option lets the compiler change results.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import platform
import re
import shlex
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from hashlib import blake2b
from importlib.resources import files
from pathlib import Path
from threading import Lock
from typing import Any, Final

from rosbridge_sim.errors import RosbridgeSimError
from rosbridge_sim.version import __version__
from rosbridge_sim.world.contacts.collisions import PAIR_LOOPS
from rosbridge_sim.world.followers.lane_following import LANE_LOOPS
from rosbridge_sim.world.kernels.c_source import FILES, write_source
from rosbridge_sim.world.kernels.car_kernel import CarKernel
from rosbridge_sim.world.kernels.car_source import write_cars
from rosbridge_sim.world.kernels.lane_kernel import LaneKernel
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops, LoopName
from rosbridge_sim.world.kernels.pair_kernel import PairKernel
from rosbridge_sim.world.kernels.people_kernel import PeopleKernel
from rosbridge_sim.world.kernels.score_kernel import ScoreKernel, measures_alike
from rosbridge_sim.world.people.people import PEOPLE_LOOPS
from rosbridge_sim.world.scoring import SCORE_LOOPS
from rosbridge_sim.world.vehicle.dynamics import CAR_LOOPS

_OPTIONS: Final = ("-O2", "-ffp-contract=off", "-fPIC", "-shared", "-std=c11")
"""No fused multiply-add: it rounds once, where numpy rounds twice."""

MAX_SECONDS: Final = 300.0
"""A compiler that takes longer is stopped [s]."""

_EXPORTED: Final = re.compile(r"^EXPORT (\w+) (\w+)\(K \*k(?:, (\w) \w+)?\)", re.MULTILINE)
"""A function of the library: the type of its result, its name, and the type of what it takes besides the structure."""

_TYPES: Final[Mapping[str, Any]] = {"void": None, "I": ctypes.c_int64, "D": ctypes.c_double}


class NoKernelsError(RosbridgeSimError):
    """The loops cannot be compiled or loaded; the text says why, and the arrays go on."""


def cache_folder(environment: Mapping[str, str]) -> Path:
    """Return the folder for libraries in the user's cache folder.

    Raises:
        NoKernelsError: nobody knows the user's home.
    """
    try:
        home = Path.home()
    except RuntimeError as error:
        raise NoKernelsError(f"no folder for compiled loops: {error}") from error
    if sys.platform == "win32":
        base = environment.get("LOCALAPPDATA") or str(home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(home / "Library" / "Caches")
    else:
        given = environment.get("XDG_CACHE_HOME", "")
        base = given if Path(given).is_absolute() else str(home / ".cache")  # XDG ignores a relative one
    return Path(base) / "rosbridge_sim"


@cache
def read_source() -> str:
    """Return the source of the loops."""
    folder = files("rosbridge_sim.world.kernels")
    return write_source([folder.joinpath(name).read_text(encoding="utf-8") for name in FILES] + [write_cars()])


def library_path(source: str, compiler: Sequence[str], folder: Path) -> Path:
    """Return where the library of a source is, if it was compiled."""
    parts = (source, __version__, *compiler, *_OPTIONS, sys.platform, platform.machine())
    digest = blake2b("\0".join(parts).encode(errors="surrogateescape"), digest_size=16).hexdigest()
    return folder / f"kernels-{digest}{'.dll' if sys.platform == 'win32' else '.so'}"


def is_whole(path: Path) -> bool:
    """Return whether a library is there as the compiler made it: one that was cut off would end the process."""
    try:
        return _sum_path(path).read_bytes() == _sum(path)
    except OSError:
        return False


def _sum_path(path: Path) -> Path:
    return path.with_suffix(".sum")


def _sum(path: Path) -> bytes:
    return blake2b(path.read_bytes(), digest_size=16).digest()


def compile_library(source: str, compiler: Sequence[str], path: Path) -> None:
    """Compile a source. Others that do the same at the same time do not matter: the file comes into its place whole.

    Raises:
        NoKernelsError: the compiler is missing, fails or takes too long, or the folder cannot be written.
    """
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            text, built = Path(folder) / "kernels.c", Path(folder) / path.name
            text.write_text(source, encoding="utf-8")
            command = [*compiler, *_OPTIONS, str(text), "-o", str(built)]
            if sys.platform != "win32":
                command.append("-lm")
            status, said = _run(command)
            if status:
                raise NoKernelsError(f"{shlex.join(compiler)} failed with status {status}: {said}")
            built.chmod(0o700)  # whatever rights the user's new files have: see `load_library`
            sums = _sum_path(built)
            sums.write_bytes(_sum(built))
            sums.replace(_sum_path(path))
            built.replace(path)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoKernelsError(f"cannot compile with {shlex.join(compiler)} into {path.parent}: {error}") from error


def _run(command: Sequence[str]) -> tuple[int, str]:
    """Run a compiler, which ends with this process, as do its own children; return its status and what it said."""
    starts, started = Lock(), list[subprocess.Popen[bytes]]()

    def leave() -> None:
        starts.acquire()  # for ever: one that starts just now is waited for, and none starts any more
        for compiling in started:
            _end(compiling)

    atexit.register(leave)
    try:
        with starts:
            compiling = subprocess.Popen(  # noqa: S603 - the user's own
                command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
            )
            started.append(compiling)
        with compiling:
            try:
                _, said = compiling.communicate(timeout=MAX_SECONDS)
            finally:
                _end(compiling)
    finally:
        atexit.unregister(leave)
    return compiling.returncode, said.decode(errors="replace").strip()[:500]


def _end(compiling: subprocess.Popen[bytes]) -> None:
    """End a compiler that runs, and where there are groups of processes, those that it has started."""
    if compiling.poll() is not None:
        return
    if sys.platform == "win32":
        compiling.kill()
        return
    with suppress(ProcessLookupError):
        os.killpg(compiling.pid, signal.SIGKILL)


def load_library(path: Path) -> CompiledLoops:
    """Load a compiled library.

    Raises:
        NoKernelsError: it is no library of ours, or others than the user may write it.
    """
    try:
        if sys.platform != "win32":
            for each in (path.parent, path):
                info = each.stat()
                if info.st_uid != os.getuid() or info.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                    raise NoKernelsError(f"{each}: expected to be yours and that nobody else may write it; remove it")
        library = ctypes.PyDLL(str(path))  # short calls: they keep the interpreter's lock
        loops: dict[LoopName, Any] = {}
        for result, name, argument in _EXPORTED.findall(read_source()):
            function = loops[name] = getattr(library, name)
            function.restype = _TYPES[result]
            function.argtypes = [ctypes.c_void_p, *([_TYPES[argument]] if argument else [])]
    except (OSError, AttributeError) as error:
        raise NoKernelsError(f"{path}: cannot load it ({error}); remove it, and it is compiled again") from error
    return loops


def take_library(path: Path) -> None:
    """Load a compiled library, and have all worlds take its loops; see `load_library`."""
    library = load_library(path)
    LANE_LOOPS.make = partial(LaneKernel, library)
    CAR_LOOPS.make = partial(CarKernel, library)
    PAIR_LOOPS.make = partial(PairKernel, library)
    PEOPLE_LOOPS.make = partial(PeopleKernel, library)
    if measures_alike(library):
        SCORE_LOOPS.make = partial(ScoreKernel, library)
