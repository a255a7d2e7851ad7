"""The compiled loops, for tests: made once for each source, as for a server, and kept in the user's cache."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from typing import Any

import pytest

from rosbridge_sim.shell.kernels.backend import find_compiler
from rosbridge_sim.shell.kernels.compiler import (
    cache_folder,
    compile_library,
    is_whole,
    library_path,
    load_library,
    read_source,
)
from rosbridge_sim.world.contacts.collisions import PAIR_LOOPS
from rosbridge_sim.world.followers.lane_following import LANE_LOOPS, LaneFollowers
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.kernels.car_kernel import CarKernel
from rosbridge_sim.world.kernels.lane_kernel import LaneKernel
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops
from rosbridge_sim.world.kernels.pair_kernel import PairKernel
from rosbridge_sim.world.kernels.people_kernel import PeopleKernel
from rosbridge_sim.world.kernels.score_kernel import ScoreKernel
from rosbridge_sim.world.people.people import PEOPLE_LOOPS, People
from rosbridge_sim.world.scoring import SCORE_LOOPS
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.vehicle.dynamics import CAR_LOOPS


def compiler() -> tuple[str, ...]:
    """The compiler of this machine, else that of the extra."""
    found = shutil.which("cc")
    return (found,) if found else find_compiler({})


needs_compiler = pytest.mark.skipif(
    not compiler() and os.environ.get("CI") != "true", reason="needs a C compiler: `cc`, or the extra [fast]"
)
"""Where everything is tested, a missing compiler is a failure."""


@cache
def library() -> CompiledLoops:
    source = read_source()
    path = library_path(source, compiler(), cache_folder(os.environ))
    if not is_whole(path):
        compile_library(source, compiler(), path)
    return load_library(path)


@cache
def make_kernel() -> Callable[[LaneFollowers], LaneKernel]:
    return partial(LaneKernel, library())


@cache
def make_car_kernel() -> Callable[[WorldRows, IntArray], CarKernel]:
    return partial(CarKernel, library())


@cache
def make_pair_kernel() -> Callable[..., PairKernel]:
    return partial(PairKernel, library())


@cache
def make_people_kernel() -> Callable[[People], PeopleKernel]:
    return partial(PeopleKernel, library())


@cache
def make_score_kernel() -> Callable[[WorldRows], ScoreKernel]:
    return partial(ScoreKernel, library())


MAKERS: tuple[tuple[LoopMaker[Any], Callable[[], Any]], ...] = (
    (CAR_LOOPS, make_car_kernel),
    (LANE_LOOPS, make_kernel),
    (PAIR_LOOPS, make_pair_kernel),
    (PEOPLE_LOOPS, make_people_kernel),
    (SCORE_LOOPS, make_score_kernel),
)
"""Where worlds find the makers of their loops, and what those are."""


@contextmanager
def with_loops(*, are_there: bool = True) -> Iterator[None]:
    """All worlds are driven, their pairs watched and their egos moved and judged by loops; else by arrays."""
    before = [place.make for place, _ in MAKERS]
    for place, maker in MAKERS:
        place.make = maker() if are_there else None
    try:
        yield
    finally:
        for (place, _), make in zip(MAKERS, before, strict=True):
            place.make = make
