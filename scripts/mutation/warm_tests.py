"""Tests that are imported once, and run in a fork of this process for each mutant.

Importing the tests takes longer than to run the few that notice a mutant. So one process imports them all, measures for
each test how long it takes and which lines of the package it runs, and then forks for each mutant. The fork gives the
living functions the code of the mutant, runs the tests that reach the changed line, those first that have noticed most
in the least time, and ends at the first failure.

A fixture of a module or of all tests, and what a cached function of the tests has made, count for every test that uses
them: in a fork that test may be the first of all.

What the fork cannot change: values that modules have computed from a changed function while they were imported, and
parameters of tests that were computed from a changed number. No file is written, and one core is used.
"""

from __future__ import annotations

import ast
import gc
import os
import pickle
import resource
import select
import signal
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field
from functools import _lru_cache_wrapper
from importlib import import_module
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import Any, TypeGuard

import hypothesis
import numpy as np
import pytest

from scripts.mutation.mutants import Mutant, mutants_of, mutate

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGE = "rosbridge_sim"
MAX_MEMORY = 4 * 2**30
"""Memory limit of a mutant [bytes], for mutants that build without end; the tests take a tenth of it."""

Trace = Callable[[FrameType, str, Any], Any]


@dataclass
class Target:
    """One file of the package with its mutants.

    Attributes:
        file: path within the package.
    """

    file: str
    source: str = field(init=False)
    mutants: list[Mutant] = field(init=False)

    def __post_init__(self) -> None:
        self.source = self.path.read_text()
        self.mutants = mutants_of(self.source)
        self._reach_of_line: dict[int, tuple[range, set[str]]] = {}

    @property
    def path(self) -> Path:
        """The file."""
        return ROOT / PACKAGE / self.file

    @property
    def module(self) -> str:
        """Name by which it is imported."""
        return f"{PACKAGE}.{self.file.removesuffix('.py').replace('/', '.')}"

    def line_of(self, mutant: Mutant) -> str:
        """Return the text of the line of a mutant, without the blanks around it."""
        return self.source.splitlines()[mutant.line - 1].strip()

    def reach(self, mutant: Mutant) -> tuple[range, set[str]]:
        """Return where a change can be noticed.

        Args:
            mutant: the change.

        Returns:
            Lines of the statement that holds the changed node, and the names of the module's constants that it changes.
        """
        if mutant.line not in self._reach_of_line:
            self._reach_of_line[mutant.line] = self._find_reach(mutant.line)
        return self._reach_of_line[mutant.line]

    def _find_reach(self, line: int) -> tuple[range, set[str]]:
        tree = ast.parse(self.source)
        lines, is_constant = range(0), True
        waiting: list[tuple[ast.AST, bool]] = [(tree, True)]
        while waiting:
            node, is_module = waiting.pop()
            if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno):
                body = getattr(node, "body", None)
                end = body[0].lineno - 1 if body else node.end_lineno or node.lineno
                if node.lineno <= line <= end:
                    lines, is_constant = range(node.lineno, max(end, node.lineno) + 1), is_module
            inside = is_module and not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef))
            waiting += [(child, inside) for child in ast.iter_child_nodes(node)]
        if not is_constant:
            return lines, set()
        return lines, _constants_that_depend_on(tree, lines)


def _constants_that_depend_on(tree: ast.Module, lines: range) -> set[str]:
    names: set[str] = set()
    for statement in tree.body:
        found = [part for part in ast.walk(statement) if isinstance(part, ast.Name)]
        targets = [name.id for name in found if isinstance(name.ctx, ast.Store)]
        used = {name.id for name in found}
        is_changed = statement.lineno in lines or bool(used & names)
        if is_changed and isinstance(statement, (ast.Assign, ast.AnnAssign)):
            names.update(targets)
    return names


class Tests:
    """All tests of a run, warm.

    Attributes:
        took: CPU time of each test [s], measured while its lines were recorded.
    """

    def __init__(self, session: pytest.Session, targets: Sequence[Target]) -> None:
        self._items = session.items
        self._targets = targets
        for target in targets:  # some are imported only when they are used, and then without a mutant
            import_module(target.module)
        gc.unfreeze()  # the collector does not list what is frozen, as by `conftest.py`
        self._functions = _functions_of({str(target.path) for target in targets})
        for target in targets:
            if not self._functions[str(target.path)]:
                raise RuntimeError(
                    f"{target.file}: expected its functions among all objects, so that mutants can be put in"
                )
        self._caches = [thing for thing in gc.get_objects() if _is_cache_of_ours(thing)]
        self._readers = _Readers(targets)
        self.took: list[float] = []
        self._longest: list[float] = []
        self._lines: list[dict[str, frozenset[int]]] = []
        self._kills_of: dict[str, dict[int, int]] = defaultdict(lambda: defaultdict(int))

    def measure(self) -> list[str]:
        """Run every test once without a change, and record times and lines.

        Returns:
            Names of the tests that fail. They are not used.
        """
        told = self._fork(self._record, 3_600.0)
        if told is None:
            raise RuntimeError("the tests ended their own process, or took longer than an hour")
        self.took, self._longest, self._lines, failed = told
        for i in failed:
            self._lines[i] = {}
        return [self._items[i].nodeid for i in failed]

    def killer(self, target: Target, mutant: Mutant, budget: float) -> tuple[str | None, int]:
        """Run the tests that reach a mutant until one fails or the time is over.

        Args:
            target: the file.
            mutant: its change.
            budget: most CPU time of tests [s].

        Returns:
            Name of the test that failed, or None; and the number of tests that reach the mutant.
        """
        lines, names = target.reach(mutant)
        reaching = self._reaching(target, lines, names)
        kills = self._kills_of
        place = f"{target.file}:{lines.start // 20}"

        def worth(i: int) -> float:
            known = 0.1 + 8 * kills[place][i] + 2 * kills[target.file][i] + 0.2 * kills[""][i]
            return known / (self.took[i] + 0.02)

        chosen, spent = [], 0.0
        for i in sorted(reaching, key=worth, reverse=True):
            if spent + self.took[i] <= budget:
                chosen.append(i)
                spent += self.took[i]
        if not chosen:
            return None, len(reaching)
        ending = self._fork(lambda send: self._run(target, mutant, chosen, send), 20.0 * spent + 60.0)
        if ending == "ends well":
            return None, len(reaching)
        i = ending if isinstance(ending, int) else chosen[0]
        for key in (place, target.file, ""):
            kills[key][i] += 1
        return self._items[i].nodeid, len(reaching)

    def _reaching(self, target: Target, lines: range, names: set[str]) -> list[int]:
        wanted = self._readers.lines(target, names) if names else {str(target.path): frozenset(lines)}
        return [i for i, ran in enumerate(self._lines) if any(wanted[path] & ran[path] for path in wanted.keys() & ran)]

    def _record(self, send: Callable[[object], None]) -> None:
        took: list[float] = []
        longest: list[float] = []
        lines: list[dict[str, frozenset[int]]] = []
        failed: list[int] = []
        ran: dict[str, set[int]] = {}
        shared = _SharedFixtures(ran)
        paths = self._readers.paths

        def trace(frame: FrameType, event: str, argument: object) -> Trace | None:  # noqa: ARG001 - Python's signature
            path = frame.f_code.co_filename
            if path not in paths:
                return None

            def trace_line(frame: FrameType, event: str, argument: object) -> Trace:  # noqa: ARG001 - as above
                ran.setdefault(path, set()).add(frame.f_lineno)
                return trace_line

            return trace_line

        for i, item in enumerate(self._items):
            ran.clear()
            for cache in self._caches:  # else only the first test of all would run what is remembered
                cache.cache_clear()
            began = time.process_time()
            threading.settrace(trace)
            sys.settrace(trace)
            try:
                is_right = _is_right(item, self._items[i + 1] if i + 1 < len(self._items) else None, shared)
            finally:
                sys.settrace(None)
                threading.settrace(None)
            took.append(time.process_time() - began)
            longest.append(took[-1] + shared.took)
            lines.append({path: frozenset(numbers) for path, numbers in ran.items()})
            if not is_right:
                failed.append(i)
        send((took, longest, lines, failed))

    def _run(self, target: Target, mutant: Mutant, chosen: Sequence[int], send: Callable[[object], None]) -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
        for cache in self._caches:
            cache.cache_clear()
        try:
            self._put_in(target, mutant)
        except Exception:  # noqa: BLE001 - the file cannot be imported with this change: any test notices that
            send(chosen[0])
            return
        for place, i in enumerate(chosen):
            # A loop without end takes CPU time, and the default action of this timer's signal ends the process.
            signal.setitimer(signal.ITIMER_PROF, 5.0 * self._longest[i] + 3.0)
            following = self._items[chosen[place + 1]] if place + 1 < len(chosen) else None
            if not _is_right(self._items[i], following):
                send(i)
                return
        send("ends well")

    def _put_in(self, target: Target, mutant: Mutant) -> None:
        """Give the living functions and constants of a module the code and values of a mutant."""
        code = compile(mutate(target.source, mutant), str(target.path), "exec", dont_inherit=True)
        codes = {(part.co_qualname, part.co_firstlineno): part for part in _parts(code)}
        for function in self._functions[str(target.path)]:
            old = function.__code__
            new = codes.get((old.co_qualname, old.co_firstlineno))
            if new is not None and new != old:
                function.__code__ = new
        if not target.reach(mutant)[1]:
            return
        module = sys.modules[target.module]
        changed = ModuleType(target.module)
        changed.__dict__.update({name: module.__dict__[name] for name in ("__file__", "__package__", "__spec__")})
        exec(code, changed.__dict__)  # noqa: S102 - our own file
        for name, value in list(changed.__dict__.items()):
            before = module.__dict__.get(name)
            if isinstance(value, FunctionType) and isinstance(before, FunctionType):
                before.__defaults__, before.__kwdefaults__ = value.__defaults__, value.__kwdefaults__
            elif _is_value(value) and _is_value(before) and not np.array_equal(np.asarray(value), np.asarray(before)):
                for names in [getattr(other, "__dict__", {}) for other in list(sys.modules.values())]:
                    if names.get(name) is before:
                        names[name] = value

    def _fork(self, act: Callable[[Callable[[object], None]], None], patience: float) -> Any:  # noqa: ANN401 - what `act` sends
        """Return what a fork of this process sends; None if it dies or sends nothing in that time [s]."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            silence = os.open(os.devnull, os.O_RDWR)
            for descriptor in (0, 1, 2):
                os.dup2(silence, descriptor)

            def send(value: object) -> None:
                with os.fdopen(os.dup(writing), "wb") as pipe:
                    pickle.dump(value, pipe)

            try:
                os.setpgid(0, 0)
                act(send)
            finally:
                os._exit(0)
        os.close(writing)
        data, give_up_at = b"", time.monotonic() + patience
        while select.select([reading], [], [], max(0.0, give_up_at - time.monotonic()))[0]:
            part = os.read(reading, 1 << 20)
            if not part:
                break
            data += part
        os.close(reading)
        for kill in (os.killpg, os.kill):
            try:
                kill(child, signal.SIGKILL)
            except (ProcessLookupError, PermissionError):
                continue
        os.waitpid(child, 0)
        return pickle.loads(data) if data else None  # noqa: S301 - our own fork


class _Readers:
    """Lines that read the constants of the targets, in all files of the package."""

    def __init__(self, targets: Sequence[Target]) -> None:
        constants = {
            name
            for target in targets
            for statement in ast.parse(target.source).body
            if isinstance(statement, (ast.Assign, ast.AnnAssign))
            for name in _constants_that_depend_on(
                ast.parse(target.source), range(statement.lineno, statement.lineno + 1)
            )
        }
        self._lines: dict[str, dict[str, set[int]]] = {}
        self._texts: dict[str, str] = {}
        for path in sorted((ROOT / PACKAGE).rglob("*.py")):
            found: dict[str, set[int]] = defaultdict(set)
            text = path.read_text()
            for node in ast.walk(ast.parse(text)):
                name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else None
                if name in constants and isinstance(node, ast.expr):
                    found[name].add(node.lineno)
            if found:
                self._lines[str(path)], self._texts[str(path)] = found, text
        self.paths = {*self._lines, *(str(target.path) for target in targets)}

    def lines(self, target: Target, names: set[str]) -> dict[str, frozenset[int]]:
        """Return the lines of each file that reads one of those constants of a target."""
        found = {
            path: frozenset(line for name in names for line in lines.get(name, ()))
            for path, lines in self._lines.items()
            if path == str(target.path) or target.module.rpartition(".")[2] in self._texts[path]
        }
        return {path: lines for path, lines in found.items() if lines}


def _functions_of(paths: set[str]) -> dict[str, list[FunctionType]]:
    found: dict[str, list[FunctionType]] = defaultdict(list)
    for thing in gc.get_objects():
        if isinstance(thing, FunctionType) and thing.__code__.co_filename in paths:
            found[thing.__code__.co_filename].append(thing)
    return found


def _is_cache_of_ours(thing: object) -> TypeGuard[_lru_cache_wrapper[object]]:
    if not isinstance(thing, _lru_cache_wrapper):
        return False
    module, name = thing.__wrapped__.__module__, thing.__wrapped__.__name__
    # What the tests open, such as a context of the graphics library, is open once for all of them.
    return module.startswith(f"{PACKAGE}.") or (module.startswith("tests.") and not name.startswith("open_"))


def _parts(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _parts(constant)


def _is_value(thing: object) -> bool:
    if isinstance(thing, tuple):
        return all(_is_value(part) for part in thing)
    return isinstance(thing, (bool, int, float, np.ndarray))


def _is_right(item: pytest.Item, following: pytest.Item | None, *plugins: object) -> bool:
    """Run one test, with some plugins; return whether no part of it fails."""
    reports = _Reports()
    for plugin in (reports, *plugins):
        item.config.pluginmanager.register(plugin)
    try:
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
    finally:
        for plugin in (reports, *plugins):
            item.config.pluginmanager.unregister(plugin)
    return reports.is_right


class _Reports:
    def __init__(self) -> None:
        self.is_right = True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.is_right &= not report.failed


class _SharedFixtures:
    """The pytest plugin that counts the lines of a fixture for each test that uses it, not for the first one alone.

    Attributes:
        took: CPU time of all fixtures of the last test [s], whether or not that test was the first to use them.
    """

    def __init__(self, ran: dict[str, set[int]]) -> None:
        self._ran = ran
        self._lines: dict[pytest.FixtureDef[Any], dict[str, set[int]]] = {}
        self._took: dict[pytest.FixtureDef[Any], float] = {}
        self.took = 0.0

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Generator[None, object, object]:
        """Record the lines that a fixture runs."""
        before = dict(self._ran)
        self._ran.clear()
        began = time.process_time()
        try:
            return (yield)
        finally:
            self._took[fixturedef] = time.process_time() - began
            self._lines[fixturedef] = {path: set(lines) for path, lines in self._ran.items()}
            self._add(before)

    def pytest_runtest_teardown(self, item: pytest.Item) -> None:
        """Count the lines of all fixtures of a test."""
        used = item._request._fixture_defs.values()  # type: ignore[attr-defined]  # noqa: SLF001 - no other way to those by `getfixturevalue`
        self.took = sum(self._took.get(fixture, 0.0) for fixture in used)
        for fixture in used:
            self._add(self._lines.get(fixture, {}))

    def _add(self, lines: dict[str, set[int]]) -> None:
        for path, numbers in lines.items():
            self._ran[path] = self._ran.get(path, set()) | numbers


class _Plugin:
    """The pytest plugin that takes the place of pytest's own loop over the tests."""

    def __init__(self, targets: Sequence[Target], work: Callable[[Tests], None]) -> None:
        self._targets, self._work = targets, work

    def pytest_sessionstart(self) -> None:
        """Have hypothesis neither shrink nor store examples, because any failure is enough."""
        phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        slow = list(hypothesis.HealthCheck)  # tests are slow while their lines are recorded
        profile = hypothesis.settings.get_profile("ours")
        hypothesis.settings.register_profile(
            "mutate", profile, database=None, phases=phases, derandomize=True, suppress_health_check=slow
        )
        hypothesis.settings.load_profile("mutate")

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Hand the tests over, warm."""
        tests = Tests(session, self._targets)
        gc.collect()
        gc.freeze()  # a fork then copies no page only because the collector has counted on it
        self._work(tests)
        return True


def run_warm(
    targets: Sequence[Target], folders: Sequence[str], work: Callable[[Tests], None], *, is_quick: bool = False
) -> int:
    """Import tests and hand them over.

    Args:
        targets: the files whose mutants will be tried.
        folders: tests, as paths within `tests/`.
        work: what to do with them.
        is_quick: leave out the tests that are marked `slow`.

    Returns:
        pytest's exit code, 0 if all could be imported.
    """
    # pytest rewrites assertions of modules of packages with plugins, ours too, and the mutants have none of that.
    options = ["--assert=plain", "-q", "--no-header", "--no-summary", "-s", "-p", "no:cacheprovider", "-p", "no:xdist"]
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # hypothesis is imported already
    options += ["--arrays"]  # a mutant of what arrays do would not be seen where compiled loops drive
    options += ["-m", "not slow"] if is_quick else []
    paths = [str(ROOT / "tests" / folder) for folder in folders]
    return int(pytest.main([*options, *paths], plugins=[_Plugin(targets, work)]))
