"""Imports follow the layers, and nothing below the shell uses clocks, sockets, disk, tasks or random numbers.

The sources are read, not run: each import, wherever in a file it stands (at its top, within a function, for type checks
alone), and each use of a name that reaches outside. A small bad tree shows that the reading finds what it is for.

Below the shell no two modules need each other, by whichever way, and no object's private attributes are read or written
by another one: the linter finds those (SLF001), and here nothing may silence it.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

PACKAGE = "rosbridge_sim"
ROOT = Path(__file__).parent.parent / PACKAGE

_BASE = {"errors", "loose_types", "printable", "suggestions"}
_SCENE = {"morai", "morai.interfaces", "morai.maps", "morai.replays", "morai.scenarios", "morai.sim_services"}
_BELOW_SHELL = {*_BASE, *_SCENE, "graph", "graph.attach", "graph.tf", "protocol", "schema", "world"}
_SHELL = {"shell", "shell.bags", "shell.config", "shell.files", "shell.monitoring", "shell.websocket"}

ARROWS: dict[str, set[str]] = {
    "errors": set(),
    "printable": set(),
    "suggestions": {"printable"},
    "loose_types": set(),
    "weight": set(),
    "version": set(),
    "schema": {*_BASE, "weight"},
    "protocol": {*_BASE, "weight"},
    "world": {"errors"},
    "graph": {*_BASE, "protocol", "schema"},
    "graph.tf": {*_BASE, "protocol", "schema", "graph"},
    "graph.attach": {*_BASE, "protocol", "schema", "graph"},
    "morai": {*_BASE, *_SCENE, "graph", "protocol", "schema", "world"},
    "morai.interfaces": {*_BASE, "graph", "protocol", "schema", "world"},
    "morai.maps": {*_BASE, "morai", "world"},
    "morai.replays": {*_BASE, "graph", "morai", "morai.interfaces", "protocol", "schema", "world"},
    "morai.sim_services": {*_BASE, *_SCENE, "graph", "protocol", "schema", "world"},
    "morai.scenarios": {*_BASE, "morai", "morai.maps", "world"},
    "shell": {*_BELOW_SHELL, *_SHELL, "version"},
    "shell.monitoring": {*_BASE, "graph", "morai", "protocol", "schema", "shell", "shell.websocket", "version"},
    "shell.websocket": {*_BASE, "graph", "protocol", "schema", "shell", "shell.monitoring", "version"},
    "shell.config": {*_BASE, "morai", "morai.interfaces", "shell.monitoring", "shell.websocket"},
    "shell.files": {*_BASE, *_SCENE, "schema", "shell.config", "world"},
    "shell.bags": {*_BASE, "graph", "morai.replays", "schema", "shell.files"},
    "cli": {"errors", "cli.tools", "cli.watch", "shell.config", "shell.websocket"},
    "cli.tools": {*_BELOW_SHELL, *_SHELL, "client"},
    "cli.watch": {"cli.tools", "client", "errors", "morai", "shell", "shell.websocket", "world"},
    "client": {*_BASE, "protocol", "shell", "shell.monitoring", "shell.websocket"},
    "pytest_plugin": {"", "client", "shell"},
    "__main__": {
        *("", "cli", "errors", "suggestions", "version"),
        *("shell", "shell.config", "shell.monitoring", "shell.websocket"),
    },
    "": {"errors", "shell", "shell.config", "version"},
}
"""Room -> rooms that it may import, beside itself. The empty name is the package's own `__init__`. A folder within a
room is a room of its own; the files beside it are the room's."""

OUTSIDE = frozenset({"shell", "cli", "client", "pytest_plugin", "__main__", ""})
"""The rooms that may reach outside, with all that is within them."""

PURE_LIBRARIES: dict[str, set[str]] = {
    "schema": {"cbor2", "msgspec", "numpy", "orjson", "pybase64", "rosbags"},
    "protocol": {"cbor2", "msgspec", "numpy", "orjson", "PIL", "pybase64"},
    "graph": {"msgspec", "orjson"},
    "world": {"numpy"},
    "morai": {"msgspec", "numpy", "orjson", "pydantic", "pydantic_core", "pyproj"},
    "errors": set(),
    "loose_types": set(),
    "printable": set(),
    "suggestions": set(),
    "weight": {"numpy"},
    "version": set(),
}
"""Third-party libraries of each room below the shell; none of them does I/O by itself."""

PURE_MODULES = frozenset(
    [
        "__future__",
        "abc",
        "array",
        "ast",
        "base64",
        "binascii",
        "bisect",
        "codecs",
        "collections",
        "contextlib",
        "copy",
        "dataclasses",
        "decimal",
        "difflib",
        "enum",
        "fnmatch",
        "fractions",
        "functools",
        "hashlib",
        "heapq",
        "html",
        "inspect",
        "io",
        "itertools",
        "json",
        "keyword",
        "logging",
        "math",
        "numbers",
        "operator",
        "re",
        "statistics",
        "string",
        "struct",
        "textwrap",
        "types",
        "typing",
        "unicodedata",
        "uuid",
        "weakref",
        "zlib",
    ]
)
"""Standard modules that give the same values for the same calls. `logging` speaks to whoever listens."""

IMPURE_NAMES = frozenset({"open", "input", "print", "breakpoint", "__import__"})
"""Built-in functions that reach outside."""

IMPURE_MEMBERS = {
    "io": {"open", "open_code", "FileIO", "OpenWrapper"},
    "uuid": {"uuid1", "uuid4", "getnode"},
    "logging": {"basicConfig", "FileHandler", "StreamHandler", "handlers"},
    "numpy": {"load", "loadtxt", "genfromtxt", "fromfile", "save", "savez", "savetxt", "memmap"},
}
"""Members of pure modules that reach outside."""

GENERATOR_MAKERS = frozenset({"default_rng", "Generator", "SeedSequence", "PCG64", "Philox", "SFC64", "BitGenerator"})
"""What of `numpy.random` is no global state, as long as it is given a seed."""


def find_faults(root: Path) -> Iterator[str]:
    """A line for each thing in a package's sources that the design forbids."""
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        room = "" if parts == ("__init__",) else _room_of(parts)
        if room not in ARROWS:
            yield f"{path.relative_to(root)}: there is no room {room!r} in the design"
            continue
        source = path.read_text()
        tree = ast.parse(source)
        faults = {
            *_import_faults(tree, room, parts),
            *_call_faults(tree, room),
            *_hidden_faults(tree, source, room, parts),
        }
        for line, fault in sorted(faults):
            yield f"{path.relative_to(root)}:{line}: {fault}"


def find_circles(root: Path) -> Iterator[str]:
    """A line for each circle of modules below the shell: each needs the next one, and the last one the first."""
    paths = {_name_of(path.relative_to(root)): path for path in sorted(root.rglob("*.py"))}
    arrows: dict[str, set[str]] = {}
    for name, path in paths.items():
        if _room_of(name.split(".")).partition(".")[0] not in OUTSIDE:
            tree, parts = ast.parse(path.read_text()), path.relative_to(root).with_suffix("").parts
            found = {_module_of(imported, paths) for _, imported in _imports(tree, parts)}
            arrows[name] = {target for target in found if target is not None} - {name}
    while True:
        while ready := {name for name, targets in arrows.items() if not targets & arrows.keys()}:
            arrows = {name: targets for name, targets in arrows.items() if name not in ready}
        if not arrows:
            return
        way = [min(arrows)]
        while way[-1] not in way[:-1]:
            way.append(min(arrows[way[-1]] & arrows.keys()))
        circle = way[way.index(way[-1]) :]
        yield " -> ".join(circle)
        arrows[circle[0]].discard(circle[1])  # else it would be found again


def _name_of(path: Path) -> str:
    """The dotted name of a module within the package; empty for the package's own `__init__`."""
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _module_of(imported: str, modules: Mapping[str, Path]) -> str | None:
    """The module of the package that an import needs; None if it is none of the package's."""
    first, _, name = imported.partition(".")
    if first != PACKAGE:
        return None
    while name and name not in modules:
        name = name.rpartition(".")[0]
    return name if name in modules else None


def _room_of(parts: Sequence[str]) -> str:
    """The innermost room that a dotted name is in, or its first part where there is none."""
    inner = ".".join(parts[:2])
    return inner if inner in ARROWS else parts[0]


def _imports(tree: ast.AST, parts: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Line and full dotted name of all that is imported, by whichever statement."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = (PACKAGE, *parts)[: -node.level]
                base = ".".join([*above, base]).strip(".")
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def _import_faults(tree: ast.AST, room: str, parts: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    outer = room.partition(".")[0]
    for line, name in _imports(tree, parts):
        first, *rest = name.split(".")
        if first == PACKAGE:
            target = _room_of(rest) if rest else ""
            target = target if target in ARROWS else ""  # what is no room is the package's own
            if target != room and target not in ARROWS[room]:
                yield line, f"{room or PACKAGE} must not import {target or PACKAGE}"
        elif outer in OUTSIDE:
            continue
        elif first in sys.stdlib_module_names:
            if first not in PURE_MODULES or (rest and rest[0] in IMPURE_MEMBERS.get(first, ())):
                yield line, f"{room} must not know {name}"
        elif first not in PURE_LIBRARIES[outer]:
            yield line, f"{room} must not import the library {first}"
        elif (
            name.startswith("numpy.random") and name.count(".") > 1 and name.rpartition(".")[2] not in GENERATOR_MAKERS
        ):
            yield line, f"{name}: chance must come from a generator that is passed in"
        elif rest and rest[0] in IMPURE_MEMBERS.get(first, ()):
            yield line, f"{room} must not know {name}"


def _call_faults(tree: ast.AST, room: str) -> Iterator[tuple[int, str]]:
    if room.partition(".")[0] in OUTSIDE:
        return
    aliases = {
        alias.asname or alias.name: alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in IMPURE_NAMES:
            yield node.lineno, f"{room} must not use {node.id}()"
        elif isinstance(node, ast.Attribute):
            name = _dotted(node, aliases)
            first, _, member = name.partition(".")
            if member.split(".")[0] in IMPURE_MEMBERS.get(first, ()):
                yield node.lineno, f"{room} must not use {name}"
            if name.startswith("numpy.random.") and name.split(".")[2] not in GENERATOR_MAKERS:
                yield node.lineno, f"{name}: chance must come from a generator that is passed in"
        elif isinstance(node, ast.Call) and not (node.args or node.keywords):
            name = _dotted(node.func, aliases)
            if name.rpartition(".")[2] in GENERATOR_MAKERS - {"Generator"}:
                yield node.lineno, f"{name}() without a seed"


def _hidden_faults(tree: ast.AST, source: str, room: str, parts: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Arrows that the program does not follow when it runs, and private attributes of others."""
    if room.partition(".")[0] in OUTSIDE:
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in {
            getattr(node.test, "id", ""),
            getattr(node.test, "attr", ""),
        }:
            for child in node.body:
                for line, name in _imports(child, parts):
                    if name.partition(".")[0] == PACKAGE:
                        yield line, f"{room} must not hide the import of {name} from the program"
    for line, text in enumerate(source.splitlines(), 1):
        if "noqa" in text and "SLF001" in text:
            yield line, f"{room} must not use an object's private attributes from outside"


def _dotted(node: ast.AST, aliases: dict[str, str]) -> str:
    """`np.random.rand` as `numpy.random.rand`; empty where it is no plain name."""
    if isinstance(node, ast.Name):
        return aliases.get(node.id, node.id)
    if isinstance(node, ast.Attribute):
        base = _dotted(node.value, aliases)
        return f"{base}.{node.attr}" if base else ""
    return ""


# The house


def test_sources_follow_the_layers() -> None:
    assert list(find_faults(ROOT)) == []


def test_layers_have_no_cycle() -> None:
    outer: dict[str, set[str]] = {}  # a room with all that is within it
    for room, targets in ARROWS.items():
        whole = room.partition(".")[0]
        outer.setdefault(whole, set()).update({target.partition(".")[0] for target in targets} - {whole})
    placed: set[str] = set()
    while placed != outer.keys():
        ready = {room for room, targets in outer.items() if targets <= placed} - placed
        assert ready, f"a circle among {sorted(outer.keys() - placed)}"
        placed |= ready


def test_modules_below_the_shell_make_no_circle() -> None:
    assert list(find_circles(ROOT)) == []


# The reading itself


def faults_of(tmp_path: Path, file: str, source: str) -> list[str]:
    path = tmp_path / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(source)
    return list(find_faults(tmp_path))


@pytest.mark.parametrize(
    ("file", "source", "fault"),
    [
        ("world/a.py", "import rosbridge_sim.schema.store", "a.py:1: world must not import schema"),
        ("world/a.py", "from rosbridge_sim.morai import node", "world must not import morai"),
        ("world/a.py", "from rosbridge_sim import morai", "world must not import morai"),
        ("world/a.py", "from ..morai import node", "world must not import morai"),
        ("world/a.py", "from .. import graph", "world must not import graph"),
        (
            "world/a.py",
            "def f():\n    from rosbridge_sim.shell.app import Simulator",
            "a.py:2: world must not import shell",
        ),
        ("schema/a.py", "from rosbridge_sim.protocol.ops import Op", "schema must not import protocol"),
        ("protocol/a.py", "from rosbridge_sim.schema.store import Store", "protocol must not import schema"),
        ("graph/a.py", "from rosbridge_sim.morai.sync import Sync", "graph must not import morai"),
        ("graph/a.py", "from rosbridge_sim.world.state import World", "graph must not import world"),
        ("morai/a.py", "from rosbridge_sim.shell.app import Simulator", "morai must not import shell"),
        ("errors.py", "from rosbridge_sim.graph.bus import Bus", "errors must not import graph"),
        ("shell/a.py", "from rosbridge_sim.cli.command_line import run_command", "shell must not import cli"),
        ("shell/websocket/a.py", "import rosbridge_sim.shell.bags.bag", "shell.websocket must not import shell.bags"),
        ("graph/a.py", "from rosbridge_sim.graph.attach.mirror import Mirror", "graph must not import graph.attach"),
        ("morai/maps/a.py", "import time", "morai.maps must not know time"),
        ("__main__.py", "from rosbridge_sim.graph.bus import Bus", "__main__ must not import graph"),
        ("attic/a.py", "", "there is no room 'attic' in the design"),
        ("graph/a.py", "import asyncio", "graph must not know asyncio"),
        ("graph/a.py", "from time import monotonic", "graph must not know time.monotonic"),
        ("graph/a.py", "import socket", "graph must not know socket"),
        ("graph/a.py", "import threading as t", "graph must not know threading"),
        ("world/a.py", "import random", "world must not know random"),
        ("morai/a.py", "import os.path", "morai must not know os.path"),
        ("morai/a.py", "from pathlib import Path", "morai must not know pathlib.Path"),
        ("morai/a.py", "from datetime import datetime", "morai must not know datetime.datetime"),
        ("morai/a.py", "from uuid import uuid4", "morai must not know uuid.uuid4"),
        ("morai/a.py", "import uuid\nuuid.uuid4()", "a.py:2: morai must not use uuid.uuid4"),
        ("morai/a.py", "with open('x') as f: pass", "morai must not use open()"),
        ("morai/a.py", "reader = open", "morai must not use open()"),
        ("morai/a.py", "__import__('time')", "morai must not use __import__()"),
        ("world/a.py", "import numpy as np\nnp.random.rand(3)", "numpy.random.rand: chance must come"),
        ("world/a.py", "import numpy.random as r\nr.seed(3)", "numpy.random.seed: chance must come"),
        ("world/a.py", "from numpy.random import rand", "numpy.random.rand: chance must come"),
        ("world/a.py", "import numpy as np\ng = np.random.default_rng()", "numpy.random.default_rng() without a seed"),
        ("world/a.py", "from numpy.random import default_rng\ng = default_rng()", "default_rng() without a seed"),
        ("world/a.py", "import numpy as np\nnp.load('x')", "world must not use numpy.load"),
        ("world/a.py", "import orjson", "world must not import the library orjson"),
        ("graph/a.py", "import requests", "graph must not import the library requests"),
        (
            "morai/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from rosbridge_sim.morai.b import B",
            "a.py:3: morai must not hide the import of rosbridge_sim.morai.b.B",
        ),
        (
            "graph/tf/a.py",
            "import typing\nif typing.TYPE_CHECKING:\n    import rosbridge_sim.graph.bus",
            "graph.tf must not hide the import of rosbridge_sim.graph.bus",
        ),
        ("world/a.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .b import B", "must not hide"),
        (
            "world/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from rosbridge_sim.schema.store import Store",
            "a.py:3: world must not import schema",
        ),
        ("morai/a.py", "x = node._parts  # noqa: SLF001 - a friend", "a.py:1: morai must not use an object's private"),
    ],
)
def test_forbidden_import_is_found(tmp_path: Path, file: str, source: str, fault: str) -> None:
    assert any(fault in line for line in faults_of(tmp_path, file, source))


@pytest.mark.parametrize(
    ("file", "source"),
    [
        (
            "shell/a.py",
            "import asyncio, os, time, random\nfrom rosbridge_sim.morai.simulator_node import Node\nopen('x')",
        ),
        ("morai/a.py", "from rosbridge_sim.world.state import World\nfrom rosbridge_sim.errors import DocumentError"),
        ("world/a.py", "import numpy as np\ng = np.random.default_rng(3)\nx: np.random.Generator = g\ng.normal()"),
        ("world/a.py", "from .state import World\nfrom rosbridge_sim.world import step"),
        ("graph/a.py", "import logging\nlogging.getLogger('x')\nself.open(3)"),
        ("__init__.py", "from rosbridge_sim.shell.app import Simulator"),
        ("morai/a.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pyproj import Transformer"),
        (
            "shell/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from rosbridge_sim.morai.sync import Sync",
        ),
    ],
)
def test_allowed_import_is_not_reported(tmp_path: Path, file: str, source: str) -> None:
    assert faults_of(tmp_path, file, source) == []


def circles_of(tmp_path: Path, files: Mapping[str, str]) -> list[str]:
    for file, source in files.items():
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
    return list(find_circles(tmp_path))


@pytest.mark.parametrize(
    "back",
    [
        "from rosbridge_sim.morai.a import A",
        "from rosbridge_sim.morai import a",
        "import rosbridge_sim.morai.a",
        "from .a import A",
        "from . import a",
        "def f():\n    from rosbridge_sim.morai.a import A",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from rosbridge_sim.morai.a import A",
    ],
)
def test_circle_of_two_modules_is_found(tmp_path: Path, back: str) -> None:
    files = {"morai/a.py": "from rosbridge_sim.morai.b import B", "morai/b.py": back}
    assert circles_of(tmp_path, files) == ["morai.a -> morai.b -> morai.a"]


def test_each_circle_is_named_and_what_only_leads_to_one_is_not(tmp_path: Path) -> None:
    files = {
        "graph/a.py": "from rosbridge_sim.graph import b",
        "graph/b.py": "from rosbridge_sim.graph.tf import c",
        "graph/tf/c.py": "from rosbridge_sim.graph import a",
        "graph/on_the_way.py": "from rosbridge_sim.graph import a, leaf",
        "graph/leaf.py": "import json",
        "world/x.py": "from rosbridge_sim.world import y",
        "world/y.py": "from rosbridge_sim.world import x",
    }
    assert circles_of(tmp_path, files) == [
        "graph.a -> graph.b -> graph.tf.c -> graph.a",
        "world.x -> world.y -> world.x",
    ]


def test_circle_through_the_file_of_a_package_is_found(tmp_path: Path) -> None:
    files = {"graph/__init__.py": "from rosbridge_sim.graph.a import A", "graph/a.py": "import rosbridge_sim.graph"}
    assert circles_of(tmp_path, files) == ["graph -> graph.a -> graph"]


def test_modules_that_need_one_another_one_way_make_no_circle(tmp_path: Path) -> None:
    files = {
        "world/__init__.py": "",
        "world/a.py": "from rosbridge_sim.world.b import a",
        "world/b.py": "from rosbridge_sim.errors import FieldError\nimport numpy as a",
        "errors.py": "",
        "shell/a.py": "from rosbridge_sim.shell import b",
        "shell/b.py": "from rosbridge_sim.shell import a",
    }
    assert circles_of(tmp_path, files) == []
