"""The long runs of `scripts/soak/`, in short: the same code with small numbers."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import pytest

from rosbridge_sim.records import replace
from scripts.soak import hostile, ros1_nodes, snapshots
from scripts.soak.faults import CASES, SHORT, Case, run_case
from scripts.soak.harness import Programs
from scripts.soak.mixed import soak
from tests import fork_server
from tests.fork_server import CHANNEL, ForkedProgram

pytestmark = pytest.mark.slow

LONG = {"has_param after 100,000 set_param"}
"""Rows of hostile frames that take 10 s and more; `tests/graph/test_parameters.py` has the limits of parameters."""


def fork(name: str, channel: int, words: Sequence[str], stderr: IO[bytes]) -> ForkedProgram:
    """Start a script of the soaks as a fork of a process that has imported everything."""
    return fork_server.start(f"scripts.soak.{name}", [str(CHANNEL), *words], os.environ, stderr, channel)


def run_fork(words: Sequence[str], stdout: int) -> subprocess.CompletedProcess[str]:
    """Run a command as such a fork, unless its output goes elsewhere."""
    return fork_server.run(["-m", "rosbridge_sim", *words]) if stdout == subprocess.PIPE else RUN(words, stdout)


RUN = Programs.run


@pytest.fixture(autouse=True)
def forked_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start programs without a second of imports."""
    monkeypatch.setattr(Programs, "start_script", staticmethod(fork))
    monkeypatch.setattr(Programs, "run", staticmethod(run_fork))


async def test_eight_kinds_of_clients_leave_no_memory_behind(tmp_path: Path) -> None:
    acts = ("messages heard", "messages in CBOR", "commands", "ticks", "calls answered", "goals", "load")
    report = await soak(2.5, 1, tmp_path, num_lines=1, longest_life=1.5, max_stall=None, acts=acts)
    assert report.faults == []
    kinds = {name.removeprefix("lives of ") for name in report.num if name.startswith("lives of ")}
    assert len(kinds) == 10, "services and actions have two sides"
    for what in acts:
        assert report.num[what], f"no {what} in the whole run"


@pytest.mark.skipif(sys.platform != "linux", reason="limits of another process and /dev/full are Linux's")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
async def test_fault_of_network_disk_or_machine_is_logged_and_passes(tmp_path: Path, case: Case) -> None:
    assert (await run_case(case, tmp_path, SHORT)).faults == []


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of another process's memory is Linux's")
@pytest.mark.parametrize(
    "row",
    [pytest.param(row, id=row.name, marks=[pytest.mark.long] if row.name in LONG else []) for row in hostile.ROWS],
)
async def test_hostile_frame_costs_bounded_memory_and_disconnects_no_other_client(
    tmp_path: Path, row: hostile.Row
) -> None:
    row = replace(row, flags=(*row.flags, "--no-dressing"))  # trees beside the road; the script has them
    seen = await hostile.play(row, tmp_path, repeats=0, settling=0.0, idle=0.1)
    assert [fault for fault in seen.faults if "rose" in fault or "traceback" in fault] == []


@pytest.mark.skipif(sys.platform != "linux", reason="figures of another process are Linux's")
async def test_resets_and_restores_leave_nothing_in_the_server(tmp_path: Path) -> None:
    report = await snapshots.soak(360, 1, tmp_path, num_parts=3)  # caches are full after some 100 turns
    assert [*report.faults, *snapshots.judge(report)] == []
    assert report.num["resets"] == 360
    assert min(report.num[what] for what in ("restores by name", "restores by bytes", "load", "step", "barrier")) > 0


@pytest.mark.skipif(sys.platform != "linux", reason="figures of another process are Linux's")
async def test_nodes_of_ros1_that_come_and_go_leave_nothing_in_the_server(tmp_path: Path) -> None:
    kinds = ("read", "stall", "publish", "provide", "call", "lead", "send rubbish")
    acts = [f"lives that {kind}" for kind in kinds]
    acts += ["messages to nodes", "calls of nodes", "ticks", "bytes of rubbish"]
    report = await ros1_nodes.soak(2.0, 1, tmp_path, num_parts=2, acts=acts)
    assert [*report.faults, *ros1_nodes.judge(report)] == []
    assert min(report.num[act] for act in acts) > 0
