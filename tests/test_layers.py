"""The arrows of the design hold, and nothing below the shell knows clocks, sockets, disk, tasks or chance.

The sources are read, not run: each import, wherever in a file it stands, and each use of a name that reaches
outside. A small bad tree shows that the reading finds what it is for.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

PACKAGE = "rosbridge_sim"
ROOT = Path(__file__).parent.parent / PACKAGE

_BASE = {"errors", "loose_types", "suggestions"}
_SCENE = {"morai", "morai.interfaces", "morai.maps", "morai.replays", "morai.scenarios"}
_BELOW_SHELL = {*_BASE, *_SCENE, "graph", "graph.attach", "graph.tf", "protocol", "schema", "world"}
_SHELL = {"shell", "shell.bags", "shell.config", "shell.files", "shell.websocket"}

ARROWS: dict[str, set[str]] = {
    "errors": set(),
    "suggestions": set(),
    "loose_types": set(),
    "weight": set(),
    "version": set(),
    "schema": {*_BASE, "weight"},
    "protocol": {*_BASE, "weight"},
    "world": {"errors"},
    "graph": {*_BASE, "protocol", "schema", "graph.tf"},
    "graph.tf": {*_BASE, "protocol", "schema", "graph"},
    "graph.attach": {*_BASE, "protocol", "schema", "graph"},
    "morai": {*_BASE, *_SCENE, "graph", "protocol", "schema", "world"},
    "morai.interfaces": {*_BASE, "graph", "protocol", "schema", "world"},
    "morai.maps": {*_BASE, "morai", "world"},
    "morai.replays": {*_BASE, "graph", "morai", "morai.interfaces", "protocol", "schema", "world"},
    "morai.scenarios": {*_BASE, "morai", "morai.maps", "world"},
    "shell": {*_BELOW_SHELL, *_SHELL, "version"},
    "shell.websocket": {*_BASE, "graph", "protocol", "schema", "shell", "version"},
    "shell.config": {*_BASE, "morai", "morai.interfaces", "shell", "shell.websocket"},
    "shell.files": {*_BASE, *_SCENE, "schema", "shell.config", "world"},
    "shell.bags": {*_BASE, "graph", "morai.replays", "schema", "shell.files"},
    "cli": {"errors", "cli.tools", "shell.config", "shell.websocket"},
    "cli.tools": {*_BELOW_SHELL, *_SHELL, "client"},
    "client": {*_BASE, "protocol", "shell", "shell.websocket"},
    "pytest_plugin": {"", "client", "shell"},
    "__main__": {"", "cli", "errors", "shell", "shell.config", "shell.websocket", "version"},
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
        tree = ast.parse(path.read_text())
        for line, fault in sorted({*_import_faults(tree, room, parts), *_call_faults(tree, room)}):
            yield f"{path.relative_to(root)}:{line}: {fault}"


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


def _dotted(node: ast.AST, aliases: dict[str, str]) -> str:
    """`np.random.rand` as `numpy.random.rand`; empty where it is no plain name."""
    if isinstance(node, ast.Name):
        return aliases.get(node.id, node.id)
    if isinstance(node, ast.Attribute):
        base = _dotted(node.value, aliases)
        return f"{base}.{node.attr}" if base else ""
    return ""


# The house


def test_sources_hold_to_the_design() -> None:
    assert list(find_faults(ROOT)) == []


def test_arrows_make_no_circle() -> None:
    outer: dict[str, set[str]] = {}  # a room with all that is within it
    for room, targets in ARROWS.items():
        whole = room.partition(".")[0]
        outer.setdefault(whole, set()).update({target.partition(".")[0] for target in targets} - {whole})
    placed: set[str] = set()
    while placed != outer.keys():
        ready = {room for room, targets in outer.items() if targets <= placed} - placed
        assert ready, f"a circle among {sorted(outer.keys() - placed)}"
        placed |= ready


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
    ],
)
def test_fault_is_found(tmp_path: Path, file: str, source: str, fault: str) -> None:
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
    ],
)
def test_what_the_design_allows_is_no_fault(tmp_path: Path, file: str, source: str) -> None:
    assert faults_of(tmp_path, file, source) == []
