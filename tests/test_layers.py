"""Imports follow the layers, and nothing below the shell uses clocks, sockets, disk, tasks or random numbers.

The sources are read, not run: each import, wherever in a file it stands (at its top, within a function, for type checks
alone), and each use of a name that reaches outside. A small bad tree shows that the reading finds what it is for.

No two modules need each other, by whichever way. Below the shell no object's private attributes are read or written by
another one: the linter finds those (SLF001), and here nothing may silence it.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from scripts.docs_pages.rooms import parse_imports

PACKAGE = "rosbridge_sim"
ROOT = Path(__file__).parent.parent / PACKAGE

_BASE = {"errors", "loose_types", "printable", "records", "suggestions"}

_TABLE = """
# pure, and used by all
errors:
printable:
records:
suggestions: printable
expressions: errors printable records suggestions
loose_types:
long_text: records
weight: records
units:
version:
packaged:
junit: records
# the wire
schema.definitions: * packaged
schema: * long_text schema.definitions weight
protocol: * long_text weight
graph: * protocol schema
graph.peers: * graph long_text protocol schema
graph.tf: * graph schema
graph.rosapi_services: * graph protocol schema schema.definitions
graph.attach: * graph protocol schema schema.definitions
graph.gateway: * graph schema
graph.ros1: * graph graph.gateway protocol schema schema.definitions
graph.ros2: * graph graph.gateway schema schema.definitions
# the world
world.geometry: records
world.roads: records world.geometry
world.state: records world.geometry world.roads
world.vehicle: records world.geometry world.roads world.state
world.contacts: records world.geometry world.roads world.state
world.people: records world.geometry world.roads world.state
world.drivers: records world.geometry world.roads world.state
world.lane_changes: records world.drivers world.geometry world.roads world.state
world.followers: records world.drivers world.geometry world.lane_changes world.people world.roads world.state
world.kernels: records world world.contacts world.drivers world.followers world.geometry world.lane_changes world.people
    world.roads world.state world.vehicle
world: records world.contacts world.drivers world.followers world.geometry world.lane_changes world.people world.roads
    world.state world.vehicle
world.many_worlds: world world.contacts world.drivers world.geometry world.roads world.state
# files of the user
documents: *
maps: * documents units world.geometry world.roads world.state
scenarios: * documents expressions maps units world.drivers world.geometry world.roads world.state
# what sensors see
scenery: records world.followers world.geometry world.roads world.state
scenery.static: maps scenery world.geometry world.roads
scenery.moving: records scenery scenery.static world.followers world.geometry world.state
# MORAI's names
morai: records schema.definitions
morai.messages: * maps morai scenarios schema units world.followers world.geometry world.roads world.state
    world.vehicle
# the simulator
simulator.plain: * world.state
simulator.sync: *
simulator.bus: * documents graph schema world.state
simulator.scene: * graph maps morai morai.messages scenarios simulator.bus simulator.plain world world.drivers
    world.geometry world.roads world.state
simulator.egos: * graph morai.messages schema simulator.bus simulator.scene world.drivers world.followers world.geometry
    world.roads world.state world.vehicle
simulator.kernel: * graph morai.messages schema simulator.bus simulator.egos simulator.plain simulator.scene
    simulator.sync world.state
simulator.sensor_data: * morai.messages scenery schema world.geometry world.state world.vehicle
simulator.sensors: * documents maps morai.messages scenery schema simulator.bus simulator.egos simulator.kernel
    simulator.sensor_data world.geometry world.state world.vehicle
simulator.sensor_rigs: * documents graph scenery simulator.bus simulator.egos simulator.kernel simulator.plain
    simulator.sensor_data simulator.sensors
simulator.sensor_services: * documents graph simulator.bus simulator.egos simulator.kernel simulator.plain
    simulator.sensor_data simulator.sensor_rigs simulator.sensors world.vehicle
simulator.morai_services: * graph maps morai.messages scenarios schema simulator.bus simulator.egos simulator.kernel
    simulator.plain simulator.scene simulator.sensor_services simulator.sync world.contacts world.roads world.state
simulator.markers: * graph maps morai.messages schema simulator.bus simulator.egos simulator.kernel units
    world.geometry world.roads world.state
simulator.sim_services: * graph maps morai.messages scenarios scenery scenery.moving scenery.static schema
    simulator.bus simulator.egos simulator.kernel simulator.markers simulator.plain simulator.scene simulator.sync
    units world world.contacts world.drivers world.followers world.geometry world.lane_changes world.roads world.state
simulator.replays: * graph morai.messages scenarios schema simulator.bus simulator.egos simulator.kernel
    simulator.plain simulator.scene units world world.geometry world.state
simulator.story: * graph morai.messages scenarios simulator.bus simulator.kernel simulator.plain
    simulator.scene world.contacts world.drivers world.geometry world.lane_changes world.state
simulator.snapshots: * graph maps protocol scenarios schema simulator.bus simulator.egos simulator.kernel
    simulator.plain simulator.replays simulator.scene simulator.sync world world.drivers world.state
simulator: * graph morai morai.messages scenarios scenery scenery.moving simulator.bus simulator.egos
    simulator.kernel simulator.markers simulator.morai_services simulator.plain simulator.replays simulator.scene
    simulator.sensor_data simulator.sensor_rigs simulator.sensor_services simulator.sensors simulator.sim_services
    simulator.snapshots simulator.story simulator.sync world world.state world.vehicle
# campaigns, without processes and files
campaigns: * documents expressions world.geometry world.state
# mocks of robots, without sockets and files
mock: * contracts documents expressions graph schema schema.definitions world.geometry
# the checks of a rosbridge, and of what an app relies on, without sockets
doctor: * junit
contracts: * documents schema.definitions
# outside
link: * protocol
client: * link protocol
shell.config: * graph.gateway graph.ros2 link simulator.bus
shell.clocks: * graph
shell.files: * documents maps morai scenarios schema schema.definitions shell.config simulator.bus
    simulator.sensor_rigs simulator.sensors world.state
shell.bags: * graph schema schema.definitions shell.files simulator.replays
shell.mocking: * documents graph graph.peers mock protocol schema shell.bags shell.clocks shell.config shell.files
    shell.websocket
shell.rendering: packaged records scenery scenery.moving world.geometry
shell.drawing: * maps scenarios scenery scenery.static shell.rendering simulator.sensors world.geometry world.roads
    world.state
shell.kernels: errors version world world.contacts world.followers world.kernels world.people world.vehicle
shell.page: * schema simulator.markers simulator.plain simulator.sim_services version
shell.transport: * link long_text protocol
shell.websocket: * graph graph.peers link protocol shell.kernels shell.page shell.transport version
shell.monitoring: * graph graph.peers protocol schema shell.websocket simulator version
shell.ros1: * graph graph.gateway graph.ros1 morai protocol schema shell.clocks shell.config shell.files
    shell.websocket
shell.ros2: * graph graph.gateway graph.ros2 graph.rosapi_services morai schema shell.clocks shell.config shell.files
shell: * graph graph.attach graph.rosapi_services graph.tf link maps morai protocol scenarios scenery schema
    shell.bags shell.clocks shell.config shell.drawing shell.files shell.kernels shell.mocking shell.monitoring
    shell.page shell.rendering shell.ros1 shell.ros2 shell.websocket simulator simulator.bus simulator.plain
    simulator.replays simulator.scene simulator.sensor_data simulator.sensor_rigs simulator.sensors
    simulator.sim_services world.geometry world.roads world.state
worlds: * client maps morai.messages scenarios shell.files shell.kernels simulator.kernel simulator.plain
    simulator.scene simulator.sim_services units world world.drivers world.followers world.geometry world.many_worlds
    world.roads world.state world.vehicle
environments: records scenery scenery.static shell shell.rendering simulator.snapshots suggestions world.geometry
    world.state worlds
campaign_runs: * campaigns environments expressions graph scenarios schema shell shell.config shell.files
    simulator version world.followers world.geometry world.many_worlds world.roads world.state worlds
cli: * cli.files cli.tools link
cli.simulator: * cli.tools link packaged
cli.doctor: * cli.tools doctor link
cli.contracts: * cli.tools contracts documents junit link
cli.tools: * client documents graph graph.gateway graph.ros1 graph.ros2 link morai schema schema.definitions
    shell.bags shell.config shell.files shell.page shell.ros1 shell.ros2
cli.files: * cli.tools link maps scenarios shell shell.bags shell.config shell.drawing shell.files simulator.scene units
    world.geometry world.roads world.state
cli.mock: * cli.contracts cli.tools contracts documents link mock schema shell.bags shell.files shell.mocking
cli.campaigns: * campaign_runs campaigns cli.tools
pytest_plugin: package client shell
serving: * package link shell shell.config shell.monitoring shell.websocket
__main__: * cli serving
package: * shell shell.clocks shell.config version worlds
"""
"""A line for each room: the rooms that it may import, beside itself. `*` means the rooms of `_BASE`, `package` is the
package's own `__init__`. A folder within a room is a room of its own; the files beside it are the room's."""


def _read_arrows(table: str) -> dict[str, set[str]]:
    """The table as room -> rooms; the package's own `__init__` has the empty name."""
    arrows: dict[str, set[str]] = {}
    for line in table.replace("\n    ", " ").splitlines():
        if line and not line.startswith("#"):
            room, _, targets = line.partition(":")
            names = {*targets.split()}
            names = names - {"*"} | _BASE if "*" in names else names
            arrows[_name_of_room(room)] = {_name_of_room(name) for name in names} - {room}
    return arrows


def _name_of_room(word: str) -> str:
    return "" if word == "package" else word


ARROWS = _read_arrows(_TABLE)

OUTSIDE = frozenset(
    {
        *("shell", "cli", "client", "link", "serving", "pytest_plugin", "worlds", "environments", "campaign_runs"),
        *("__main__", "", "packaged"),
    }
)
"""The rooms that may reach outside, with all that is within them. `packaged` reads files of the package alone."""

PURE_LIBRARIES: dict[str, set[str]] = {
    "schema": {"cbor2", "msgspec", "numpy", "orjson", "pybase64", "rosbags"},
    "protocol": {"cbor2", "msgspec", "numpy", "orjson", "PIL", "pybase64"},
    "graph": {"msgspec", "orjson"},
    "graph.ros2": {"numpy", "rosbags"},
    "world": {"numpy"},
    "maps": {"msgspec", "numpy", "orjson", "pyproj"},
    "scenarios": {"msgspec", "numpy"},
    "scenery": {"numpy"},
    "morai": {"msgspec", "numpy", "orjson"},
    "simulator": {"msgspec", "numpy", "orjson"},
    "documents": {"msgspec", "pydantic", "pydantic_core", "ruamel"},
    "errors": set(),
    "loose_types": set(),
    "printable": set(),
    "records": {"msgspec"},
    "suggestions": set(),
    "expressions": set(),
    "doctor": {"cbor2", "PIL"},
    "mock": {"msgspec", "numpy", "orjson"},
    "contracts": {"msgspec"},
    "junit": set(),
    "campaigns": {"msgspec", "numpy"},
    "units": set(),
    "long_text": {"pybase64"},
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
        "csv",
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
        "mmap",
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
        "xml",
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
    "xml": {"dom", "etree", "sax"},  # their parsers open files by name; `xml.parsers` is fed
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
        for line, fault in _reading_of(path, root).faults:
            yield f"{path.relative_to(root)}:{line}: {fault}"


def find_circles(root: Path) -> Iterator[str]:
    """A line for each circle of modules: each needs the next one, and the last one the first."""
    paths = {_name_of(path.relative_to(root)): path for path in sorted(root.rglob("*.py"))}
    arrows: dict[str, set[str]] = {}
    for name, path in paths.items():
        found = {_module_of(imported, paths) for imported in _reading_of(path, root).imports}
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


class _Reading(NamedTuple):
    """What is in a file: the lines and texts of its faults, and the full dotted names that it imports."""

    faults: tuple[tuple[int, str], ...]
    imports: tuple[str, ...]


@cache  # several tests ask for it, and reading all sources takes seconds
def _reading_of(path: Path, root: Path) -> _Reading:
    """Read a file below a package's root; of one in no room only its imports."""
    parts = path.relative_to(root).with_suffix("").parts
    room = "" if parts == ("__init__",) else _room_of(parts)
    source = path.read_text()
    reads_all = room in ARROWS and room.partition(".")[0] not in OUTSIDE
    tree = ast.parse(source) if reads_all else parse_imports(source)
    nodes = _nodes_of(tree)
    imports = list(_imports(nodes, parts))
    names = tuple(name for _, name in imports)
    if room not in ARROWS:
        return _Reading((), names)
    faults = {
        *_import_faults(imports, room),
        *_call_faults(nodes, room),
        *_hidden_faults(nodes, imports, source, room, parts),
        *_state_faults(tree, room),
    }
    return _Reading(tuple(sorted(faults)), names)


def _nodes_of(tree: ast.AST) -> list[ast.AST]:
    """As `ast.walk` in half of its time, without the nodes that say whether a name is read or written."""
    nodes = [tree]
    for node in nodes:  # which grows
        for value in vars(node).values():
            kind = type(value)
            if kind is list:
                nodes += [each for each in value if type(each) not in _NO_NODES]
            elif kind not in _NO_NODES:
                nodes.append(value)
    return nodes


_NO_NODES = frozenset({int, str, bool, float, complex, bytes, type(None), type(...), ast.Load, ast.Store, ast.Del})
"""Types of what is in a node beside other nodes."""


def _imports(nodes: Iterable[ast.AST], parts: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Line and full dotted name of all that is imported, by whichever statement."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = (PACKAGE, *parts)[: -node.level]
                base = ".".join([*above, base]).strip(".")
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def _import_faults(imports: Iterable[tuple[int, str]], room: str) -> Iterator[tuple[int, str]]:
    outer = room.partition(".")[0]
    for line, name in imports:
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
        elif first not in PURE_LIBRARIES.get(room, PURE_LIBRARIES[outer]):
            yield line, f"{room} must not import the library {first}"
        elif (
            name.startswith("numpy.random") and name.count(".") > 1 and name.rpartition(".")[2] not in GENERATOR_MAKERS
        ):
            yield line, f"{name}: chance must come from a generator that is passed in"
        elif rest and rest[0] in IMPURE_MEMBERS.get(first, ()):
            yield line, f"{room} must not know {name}"


def _call_faults(nodes: Sequence[ast.AST], room: str) -> Iterator[tuple[int, str]]:
    if room.partition(".")[0] in OUTSIDE:
        return
    aliases = {
        alias.asname or alias.name: alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names
    }
    for node in nodes:
        if isinstance(node, ast.Name) and node.id in IMPURE_NAMES:
            yield node.lineno, f"{room} must not use {node.id}()"
        elif isinstance(node, ast.Attribute):
            name = _dotted(node, aliases)
            first, _, member = name.partition(".")
            if member.split(".")[0] in IMPURE_MEMBERS.get(first, ()):
                yield node.lineno, f"{room} must not use {name}"
            if name.startswith("numpy.random.") and name.split(".")[2] not in GENERATOR_MAKERS:
                yield node.lineno, f"{name}: chance must come from a generator that is passed in"
        elif isinstance(node, ast.Call):
            name = _dotted(node.func, aliases)
            if name == "mmap.mmap" and ast.unparse(node.args[0]) != "-1":
                yield node.lineno, f"{room} must not map a file"
            if not (node.args or node.keywords) and name.rpartition(".")[2] in GENERATOR_MAKERS - {"Generator"}:
                yield node.lineno, f"{name}() without a seed"


def _hidden_faults(
    nodes: Sequence[ast.AST], imports: Iterable[tuple[int, str]], source: str, room: str, parts: tuple[str, ...]
) -> Iterator[tuple[int, str]]:
    """Arrows that the program does not follow when it runs, in no function either, and private attributes of others."""
    if room.partition(".")[0] in OUTSIDE:
        return
    hidden: list[tuple[int, str]] = []
    for node in nodes:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in {
            getattr(node.test, "id", ""),
            getattr(node.test, "attr", ""),
        }:
            hidden += [each for child in node.body for each in _imports(ast.walk(child), parts)]
    followed = {name.rpartition(".")[0] for line, name in imports if (line, name) not in hidden}
    for line, name in hidden:
        if name.partition(".")[0] == PACKAGE and name.rpartition(".")[0] not in followed:
            yield line, f"{room} must not hide the import of {name} from the program"
    for line, text in enumerate(source.splitlines(), 1):
        if "noqa" in text and "SLF001" in text:
            yield line, f"{room} must not use an object's private attributes from outside"


def _state_faults(tree: ast.Module, room: str) -> Iterator[tuple[int, str]]:
    """Empty collections of a module: whoever fills them shares them among all simulators of the process."""
    if room.partition(".")[0] in OUTSIDE:
        return
    for node in tree.body:
        value = node.value if isinstance(node, (ast.Assign, ast.AnnAssign)) else None
        is_empty = (
            (isinstance(value, ast.Dict) and not value.keys)
            or (isinstance(value, (ast.List, ast.Set)) and not value.elts)
            or (isinstance(value, ast.Call) and not value.args and getattr(value.func, "id", "") in _COLLECTIONS)
        )
        if is_empty:
            yield node.lineno, f"{room} must not hold state in a module"


_COLLECTIONS = frozenset({"dict", "list", "set", "deque", "defaultdict", "Counter", "OrderedDict", "WeakKeyDictionary"})


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


def test_no_two_files_of_the_package_have_one_name() -> None:
    names = Counter(path.name for path in ROOT.rglob("*.py") if path.name != "__init__.py")
    assert [name for name, num in names.items() if num > 1] == []


def test_no_two_classes_of_the_server_have_one_name() -> None:
    """The client has the words of its users. The component of drivers keeps its name, because snapshots have it."""
    files = [path for path in ROOT.rglob("*.py") if path.relative_to(ROOT).parts[0] != "client"]
    names = Counter(name for path in files for name in re.findall(r"(?m)^class ([^\W_]\w*)", path.read_text()))
    assert [name for name, num in names.items() if num > 1] == ["Drivers"]


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


def test_rooms_make_no_circle() -> None:
    left = dict(ARROWS)
    while left:
        ready = {room for room, targets in left.items() if not targets & left.keys()}
        assert ready, f"a circle among {sorted(left)}"
        left = {room: targets for room, targets in left.items() if room not in ready}


def test_every_permitted_arrow_is_used() -> None:
    used: dict[str, set[str]] = {}
    for path in ROOT.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        room = "" if parts == ("__init__",) else _room_of(parts)
        for name in _reading_of(path, ROOT).imports:
            if name.partition(".")[0] == PACKAGE:
                target = _room_of(name.split(".")[1:])
                used.setdefault(room, set()).add(target if target in ARROWS else "")
    unused = {room: targets - used.get(room, set()) - _BASE for room, targets in ARROWS.items()}
    assert {room: targets for room, targets in unused.items() if targets} == {}


def test_modules_make_no_circle() -> None:
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
        ("graph/a.py", "from rosbridge_sim.simulator.sync.sync import Sync", "graph must not import simulator.sync"),
        ("graph/a.py", "from rosbridge_sim.world.state.world import World", "graph must not import world"),
        ("morai/a.py", "from rosbridge_sim.shell.app import Simulator", "morai must not import shell"),
        ("errors.py", "from rosbridge_sim.graph.bus import Bus", "errors must not import graph"),
        ("shell/a.py", "from rosbridge_sim.cli.command_line import run_command", "shell must not import cli"),
        ("shell/websocket/a.py", "import rosbridge_sim.shell.bags.bag", "shell.websocket must not import shell.bags"),
        ("graph/a.py", "from rosbridge_sim.graph.attach.mirror import Mirror", "graph must not import graph.attach"),
        ("morai/messages/a.py", "import time", "morai.messages must not know time"),
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
        ("world/a.py", "import mmap\nm = mmap.mmap(file, 3)", "world must not map a file"),
        ("world/a.py", "import orjson", "world must not import the library orjson"),
        ("graph/a.py", "import requests", "graph must not import the library requests"),
        ("world/a.py", "_seen: dict[str, int] = {}", "a.py:1: world must not hold state in a module"),
        (
            "graph/a.py",
            "from collections import deque\n_last = deque()",
            "a.py:2: graph must not hold state in a module",
        ),
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
            "import asyncio, os, time, random\nfrom rosbridge_sim.simulator.node_factory import make_node\nopen('x')",
        ),
        (
            "morai/messages/a.py",
            "from rosbridge_sim.world.state.world import World\nfrom rosbridge_sim.errors import DocumentError",
        ),
        ("world/a.py", "import numpy as np\ng = np.random.default_rng(3)\nx: np.random.Generator = g\ng.normal()"),
        ("world/a.py", "from .state import World\nfrom rosbridge_sim.world import step"),
        ("graph/a.py", "import logging\nlogging.getLogger('x')\nself.open(3)"),
        ("__init__.py", "from rosbridge_sim.shell.app import Simulator"),
        ("maps/a.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pyproj import Transformer"),
        (
            "world/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .b import B\ndef f():\n    from .b import C",
        ),
        (
            "shell/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from rosbridge_sim.simulator.scene import scene",
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
        "shell/a.py": "from rosbridge_sim.shell import b",
        "shell/b.py": "from rosbridge_sim.shell import a",
    }
    assert circles_of(tmp_path, files) == [
        "graph.a -> graph.b -> graph.tf.c -> graph.a",
        "shell.a -> shell.b -> shell.a",
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
    }
    assert circles_of(tmp_path, files) == []
