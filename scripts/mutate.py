#!/usr/bin/env python3
"""Mutation test of the central files: find small faults that the tests do not notice.

    .venv/bin/python scripts/mutate.py                        every file of the table, at most 45 minutes
    .venv/bin/python scripts/mutate.py protocol/outbox.py     one file
    .venv/bin/python scripts/mutate.py --minutes 10 --seed 1  another random sample, if time is too short for all
    .venv/bin/python scripts/mutate.py --sample 3 --minutes 5 three files, chosen by the seed
    .venv/bin/python scripts/mutate.py --again LOG            the survivors that an earlier run printed, with new tests

A mutant is the file with one change: a comparison, an operator, a number, a condition, or a call left out.
Mutants are tried in random order, so a run that ends early still gives a fair score. Each one runs in a fork of this
process, which has imported the slow modules. So no file is written, and one core is used. A mutant that no test notices
is printed as `file:line: old -> new`. Some of them are equivalent to the original, so the score never reaches 100 %.

The script has its own operators, because mutmut and cosmic-ray write the mutants to disk and start Python for each of
them, which takes three times as long; and mutmut's trampolines do not work with `__slots__`.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib
import importlib.machinery
import importlib.util
import os
import random
import resource
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType

import hypothesis
import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "rosbridge_sim"

TESTS = {
    "protocol/outbox.py": ("protocol/test_outbox.py", "protocol"),
    "protocol/session.py": ("protocol/test_session.py graph/test_vectors.py", "protocol graph"),
    "protocol/subscription.py": ("protocol/test_subscription.py", "protocol graph/test_peer.py"),
    "simulator/sync/sync.py": (
        "simulator/sync/test_sync.py",
        "simulator/test_simulator_node.py simulator/kernel/test_egos.py simulator/bus/test_publishers.py",
    ),
    "simulator/kernel/sync_driver.py": (
        "simulator/test_simulator_node.py",
        "simulator/kernel/test_egos.py simulator/morai_services/test_loads.py simulator/bus/test_publishers.py",
    ),
    "simulator/kernel/frame_stepper.py": (
        "simulator/test_simulator_node.py simulator/kernel/test_component.py",
        "simulator/kernel/test_egos.py",
    ),
    "world/step.py": (
        "world/test_step.py world/followers/test_waiting.py world/contacts/test_collisions.py",
        "world/vehicle/test_dynamics.py world/state world/followers/test_lane_following.py",
    ),
    "graph/topic_table.py": (
        "graph/test_topic_table.py graph/test_bus.py graph/test_unpublished.py graph/test_topic_types.py",
        "graph",
    ),
    "graph/delivery.py": ("graph/test_delivery.py graph/test_guard.py", "graph"),
    "graph/service_table.py": ("graph/test_service_table.py graph/test_bus.py graph/test_peer.py", "graph"),
    "simulator/sync/barrier.py": ("simulator/sync/test_barrier.py", "simulator/sim_services/test_barrier_services.py"),
    "simulator/snapshots/saved_loads.py": (
        "simulator/sim_services/test_forged_snapshots.py simulator/sim_services/test_traffic_demand.py",
        "simulator/snapshots",
    ),
    "world/people/people.py": ("world/people",),
    "world/people/crossings.py": ("world/people",),
    "world/vehicle/single_track.py": ("world/vehicle/test_single_track.py", "world/vehicle/test_dynamics.py"),
    "world/vehicle/dynamics.py": ("world/vehicle/test_dynamics.py", "world/vehicle/test_single_track.py"),
    "world/drivers/driver_model.py": ("world/drivers/test_driver_model.py", "world/followers/test_lane_following.py"),
    "world/drivers/driver_perception.py": (
        "world/drivers/test_right_of_way.py world/followers/test_lane_following.py",
        "world/people",
    ),
    "world/drivers/right_of_way.py": (
        "world/drivers/test_right_of_way.py",
        "world/followers/test_lane_following.py world/drivers/test_zip_merge.py",
    ),
    "world/drivers/lane_position.py": ("world/drivers/test_lane_position.py", "world/drivers world/lane_changes"),
    "world/drivers/zip_merge.py": ("world/drivers/test_zip_merge.py", "world/lane_changes"),
    "world/followers/lane_following.py": ("world/followers/test_lane_following.py", "world/drivers world/lane_changes"),
    "world/lane_changes/lane_changes.py": ("world/lane_changes",),
    "world/lane_changes/lane_change_look.py": ("world/lane_changes",),
    "world/lane_changes/lane_change_clearance.py": ("world/lane_changes",),
    "world/lane_changes/lane_change_motion.py": (
        "world/lane_changes/test_lane_change_motion.py world/drivers/test_lane_wander.py",
        "world/lane_changes",
    ),
    "world/lane_changes/lane_change_model.py": ("world/lane_changes",),
}
"""The central files; for each one, quick tests that notice most mutants, and tests that should notice the rest."""

SLOW_IMPORTS = (
    "numpy.random",
    "orjson",
    "msgspec",
    "cbor2",
    "PIL.Image",
    "pydantic",
    "rosbags.typesys",
    "hypothesis.stateful",
)
MAX_MEMORY = 4 * 2**30
"""Memory limit of a mutant [bytes], for mutants that build without end; the tests take a tenth of it."""

OPPOSITES: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
    ast.Pow: ast.Mult,
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "popleft": "pop", "appendleft": "append"}


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes:
        index: of the changed node, in the order of `_nodes`.
        variant: number of the change of that node.
        line: line of the node.
        change: old and new text.
    """

    index: int
    variant: int
    line: int
    change: str


def mutants_of(source: str) -> list[Mutant]:
    """Return all mutants of a file.

    Args:
        source: the file's text.

    Returns:
        The mutants, in the file's order.
    """
    found = []
    for index, node in enumerate(_nodes(ast.parse(source))):
        for variant, (old, new) in enumerate(_variants(node)):
            change = f"{_text(old)}  ->  {_text(new)}"
            found.append(Mutant(index, variant, getattr(node, "lineno", 0), change))
    return found


def mutate(source: str, mutant: Mutant) -> ast.Module:
    """Return the tree of a file with one change.

    Args:
        source: the file's text.
        mutant: the change.

    Returns:
        The tree, ready to compile.
    """
    tree = ast.parse(source)
    node = list(_nodes(tree))[mutant.index]
    old, new = list(_variants(node))[mutant.variant]
    _Exchange(old, new).visit(tree)
    return ast.fix_missing_locations(tree)


class _Exchange(ast.NodeTransformer):
    """Transformer that replaces one node by another."""

    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, ast.copy_location(new, old)

    def visit(self, node: ast.AST) -> ast.AST:
        """Visit a node; see the base class."""
        return self._new if node is self._old else self.generic_visit(node)


def _nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes of all function bodies and of the constant numbers of a module.

    Annotations, defaults, decorators, assertions and error texts are left out.
    """
    waiting: list[tuple[ast.AST, bool]] = [(tree, False)]
    while waiting:
        node, is_inside = waiting.pop()
        if isinstance(node, ast.Assert):
            continue
        if is_inside:
            yield node
        if isinstance(node, ast.Raise):
            continue
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            waiting += [(child, True) for child in reversed(node.body)]
        elif isinstance(node, ast.Module):
            waiting += [_constant_of(child) or (child, False) for child in reversed(node.body)]
        elif isinstance(node, ast.AnnAssign):
            waiting += [(child, is_inside) for child in (node.value,) if child is not None]
        else:
            waiting += [(child, is_inside) for child in reversed(list(ast.iter_child_nodes(node)))]


def _constant_of(statement: ast.stmt) -> tuple[ast.AST, bool] | None:
    """Return the value of a module's constant that is made of numbers, as a node to look into; None for the rest."""
    value = statement.value if isinstance(statement, (ast.Assign, ast.AnnAssign)) else None
    if value is None:
        return None
    parts = [part for part in ast.walk(value) if isinstance(part, ast.expr)]
    is_tuned = all(isinstance(part, (ast.Constant, ast.UnaryOp, ast.BinOp, ast.Tuple)) for part in parts)
    return (value, True) if is_tuned else None


def _variants(node: ast.AST) -> Iterator[tuple[ast.AST, ast.AST]]:  # noqa: C901, PLR0912 - one case for each sort of node
    """Yield each part of a node that may change, with its replacement."""

    def changed(**fields: object) -> tuple[ast.AST, ast.AST]:
        new = copy.copy(node)
        for name, value in fields.items():
            setattr(new, name, value)
        return node, new

    match node:
        case ast.Compare(ops=ops):
            for i, op in enumerate(ops):
                yield changed(ops=[*ops[:i], OPPOSITES[type(op)](), *ops[i + 1 :]])
        case ast.BoolOp(op=op, values=values):
            yield changed(op=OPPOSITES[type(op)]())
            for i in range(len(values)):
                left = [*values[:i], *values[i + 1 :]]
                yield node, left[0] if len(left) == 1 else ast.BoolOp(op, left)
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in OPPOSITES:
            yield changed(op=OPPOSITES[type(op)]())
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield node, operand
        case ast.Constant(value=bool(value)):
            yield changed(value=not value)
        case ast.Constant(value=int(value) | float(value)) if abs(value) <= 2:
            yield changed(value=value + 1)
        case ast.Constant(value=int(value) | float(value)):
            yield changed(value=value * 2)
        case ast.Name(id=name) if name in NAMES:
            yield changed(id=NAMES[name])
        case ast.Attribute(attr=name) if name in NAMES:
            yield changed(attr=NAMES[name])
        case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
            yield test, ast.UnaryOp(ast.Not(), test)
            yield test, ast.Constant(value=False)
        case ast.Break():
            yield node, ast.Continue()
        case ast.Continue():
            yield node, ast.Break()
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield changed(value=ast.Constant(value=None))
    if isinstance(node, (ast.Assign, ast.AugAssign, ast.Delete, ast.Raise)) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        yield node, ast.Pass()


def _text(node: ast.AST) -> str:
    return " ".join(ast.unparse(node).split())[:100]


class _Mutated(importlib.machinery.SourceFileLoader):
    """Loader that gives one module other code than its file holds."""

    def __init__(self, name: str, path: Path, code: CodeType) -> None:
        super().__init__(name, str(path))
        self._code = code

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """See the base class."""
        del path, target
        return (
            importlib.util.spec_from_file_location(fullname, self.path, loader=self) if fullname == self.name else None
        )

    def get_code(self, fullname: str) -> CodeType:
        """See the base class."""
        del fullname
        return self._code


class _Quick:
    """A pytest plugin: hypothesis neither shrinks nor stores examples, because any failure is enough."""

    def pytest_sessionstart(self) -> None:
        """Change the settings, after `tests/conftest.py` and before the test files have read them."""
        phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        hypothesis.settings.register_profile(
            "mutate", hypothesis.settings.get_profile("ours"), database=None, phases=phases, derandomize=True
        )
        hypothesis.settings.load_profile("mutate")


class Target:
    """One central file with its mutants and tests."""

    def __init__(self, file: str) -> None:
        self.file = file
        self._path = ROOT / PACKAGE / file
        self._name = f"{PACKAGE}.{file.removesuffix('.py').replace('/', '.')}"
        self._source = self._path.read_text()
        self._sets = [[str(ROOT / "tests" / test) for test in tests.split()] for tests in TESTS[file]]
        self._patience = [600.0 for _ in self._sets]
        self.mutants = mutants_of(self._source)

    def measure(self) -> float:
        """Run the tests without any change, and set the time limits of mutants.

        Returns:
            Their duration [s].

        Raises:
            ValueError: the tests fail without a change, or do not run the changed code at all.
        """
        if not self._fails_with(compile("raise ImportError", str(self._path), "exec"), 0, is_silent=True):
            raise ValueError(
                f"{self.file}: its tests pass without it, so they would notice no mutant: {TESTS[self.file][0]}"
            )
        times = []
        for i in range(len(self._sets)):
            began = time.monotonic()
            if self._fails(None, i):
                raise ValueError(f"{self.file}: its tests fail without any change: {TESTS[self.file][i]}")
            times.append(time.monotonic() - began)
        self._patience = [5.0 * took + 5.0 for took in times]  # on shared cores a slow second is not an endless loop
        return sum(times)

    def is_noticed(self, mutant: Mutant) -> bool:
        """Return whether a test fails, or does not end, with a change.

        Args:
            mutant: the change.

        Returns:
            True if the tests notice it.
        """
        return any(self._fails(mutant, i) for i in range(len(self._sets)))

    def _fails(self, mutant: Mutant | None, which: int) -> bool:
        tree = mutate(self._source, mutant) if mutant else ast.parse(self._source)
        return self._fails_with(compile(tree, str(self._path), "exec"), which, is_silent=mutant is not None)

    def _fails_with(self, code: CodeType, which: int, *, is_silent: bool) -> bool:
        """Return whether a set of tests fails, or does not end, with that code in place of the file's."""
        child = os.fork()
        if child == 0:
            self._run(code, self._sets[which], is_silent=is_silent)
        give_up_at = time.monotonic() + self._patience[which]
        while True:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status != 0
            if time.monotonic() > give_up_at:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return True
            time.sleep(0.01)

    def _run(self, code: CodeType, tests: list[str], *, is_silent: bool) -> None:
        """Run the tests on that code, and end this process, which is a fork."""
        if is_silent:
            silence = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silence, 1)
            os.dup2(silence, 2)
        status = 1
        try:
            resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
            sys.meta_path.insert(0, _Mutated(self._name, self._path, code))
            # pytest rewrites modules of packages with plugins, ours too: it would read the file and not the mutant
            options = ["--assert=plain", "-x", "-q", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist"]
            options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # hypothesis is imported already
            status = int(pytest.main([*options, *tests], plugins=[_Quick()]))
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)


def _told(target: Target, mutant: Mutant) -> str:
    return f"{target.file}:{mutant.line}: {mutant.change}"


def main() -> int:
    """Try mutants until all are tried or the time is over.

    Returns:
        The exit code.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILE", default=list(TESTS), help=f"within {PACKAGE}/; all if none")
    parser.add_argument("--minutes", type=float, default=45.0, help="longest run (default: 45)")
    parser.add_argument("--seed", type=int, default=0, help="of the order in which mutants are tried (default: 0)")
    parser.add_argument("--sample", type=int, default=len(TESTS), metavar="N", help="only so many files, by the seed")
    parser.add_argument("--again", type=Path, metavar="LOG", help="only the survivors that an earlier run has printed")
    arguments = parser.parse_args()
    if unknown := [file for file in arguments.files if file not in TESTS]:
        parser.error(f"{unknown[0]}: expected one of {', '.join(TESTS)}")
    num = min(arguments.sample, len(arguments.files))
    arguments.files = random.Random(arguments.seed).sample(arguments.files, num)  # noqa: S311 - no secret
    end = time.monotonic() + 60.0 * arguments.minutes
    sys.path.insert(0, str(ROOT))
    os.chdir(ROOT)
    for module in SLOW_IMPORTS:
        importlib.import_module(module)
    targets = [Target(file) for file in arguments.files]
    for target in targets:
        try:
            took = target.measure()
        except ValueError as error:
            print(error, file=sys.stderr)
            return 1
        print(f"{target.file}: {len(target.mutants)} mutants, {took:.1f} s for one that survives", flush=True)
    queue = [(target, mutant) for target in targets for mutant in target.mutants]
    if arguments.again:
        wanted = set(arguments.again.read_text().splitlines())
        queue = [(target, mutant) for target, mutant in queue if _told(target, mutant) in wanted]
    random.Random(arguments.seed).shuffle(queue)  # noqa: S311 - no secret
    tried, noticed = dict.fromkeys(arguments.files, 0), dict.fromkeys(arguments.files, 0)
    with suppress(KeyboardInterrupt):  # print the score so far
        for target, mutant in queue:
            if time.monotonic() > end:
                break
            is_noticed = target.is_noticed(mutant)
            tried[target.file] += 1
            noticed[target.file] += is_noticed
            if not is_noticed:
                print(_told(target, mutant), flush=True)
    for target in targets:
        num = tried[target.file]
        share = f"{noticed[target.file] / num:.1%}" if num else "-"
        print(f"{target.file}: noticed {noticed[target.file]} of {num} tried ({share}); {len(target.mutants)} in all")
    total = sum(tried.values())
    print(f"score: {sum(noticed.values()) / max(total, 1):.1%} of {total} tried, of {len(queue)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
