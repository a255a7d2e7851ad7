"""Work that is done once for many programs: message types, the scenes that most tests open with, and the page's files.

The library rosbags parses the definition of each type, makes code for it, and compiles that, anew for each bag; here,
once for equal texts.

None of it ever changes while a program runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType, ModuleType
from typing import Any, Literal

import rosbags.highlevel.anyreader
import rosbags.serde.utils
import rosbags.typesys.store
from PIL import Image
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys.msg import get_types_from_msg

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.maps.map_formats import read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.scenarios.catalogue import BUILT_IN, Catalogue
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell import app
from rosbridge_sim.shell.assembly import make_simulator_node
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files import library
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.shell.files.message_types import MessageTypes
from rosbridge_sim.shell.page.web_page import page_files
from rosbridge_sim.simulator.simulator_node import SimulatorNode

__all__ = ["keep_work", "share_work"]

SCENES = ("demo", "town")
"""The first is the one without a flag."""

OTHER_TYPES: tuple[tuple[Literal["22.R2", "26.R1"], Literal[1, 2]], ...] = (("26.R1", 1), ("22.R2", 2))
"""Releases and ROS generations of further message types; servers without such flags have others."""


def share_work() -> _BuiltIn:
    """Have the simulators of this process take types, and their opening scene, from those before them."""
    for module in (rosbags.serde.utils, rosbags.typesys.store):
        vars(module)["exec"] = _run
    for module in (rosbags.typesys, rosbags.highlevel.anyreader):
        _replace(module, get_types_from_msg=_types_in)
    built_in = _BuiltIn()
    _replace(app, read_types=built_in.types.read, make_simulator_node=built_in.make_simulator_node)
    return built_in


def keep_work() -> None:
    """Do the work in this process; simulators of its forks find it done, and keep nothing more."""
    built_in = share_work()
    for name in SCENES:
        bus = built_in.open(Settings(scenario=name, start="sync"))
    _record(bus)
    for release, ros in OTHER_TYPES:
        built_in.open(Settings(release=release, ros=ros, start="sync"))
    built_in.is_full = True
    _replace(app, make_simulator_node=make_simulator_node)
    _replace(library, read_map=built_in.read_map, read_scenario=built_in.read_scenario)
    page_files()
    Image.preinit()  # imports the formats of pictures of maps


class _BuiltIn:
    """Message types; and the package's maps, with what was computed of their roads, and its scenarios.

    Attributes:
        types: of messages.
        is_full: keep no further map and no further scenario.
    """

    def __init__(self) -> None:
        self.types = MessageTypes()
        self.is_full = False
        self._maps: dict[object, RoadMap] = {}
        self._scenarios: dict[object, Scenario] = {}

    def read_map(self, files: Mapping[str, bytes], source: str) -> RoadMap:
        """As that of the package."""
        key = source, *sorted(files.items())
        road_map = self._maps.get(key) or read_map(files, source)
        if self._is_wanted(source):
            self._maps[key] = road_map
        return road_map

    def read_scenario(self, text: bytes, source: str, *, catalogue: Catalogue) -> Scenario:
        """As that of the package."""
        if catalogue is not BUILT_IN:
            return read_scenario(text, source, catalogue=catalogue)
        scenario = self._scenarios.get((text, source)) or read_scenario(text, source)
        if self._is_wanted(source):
            self._scenarios[text, source] = scenario
        return scenario

    def _is_wanted(self, source: str) -> bool:
        return not self.is_full and Path(source).is_relative_to(library.DATA)

    def make_simulator_node(self, *args: Any, **options: Any) -> SimulatorNode:  # noqa: ANN401 - those of the package's
        """As that of the package."""
        _replace(library, read_map=self.read_map, read_scenario=self.read_scenario)
        try:
            return make_simulator_node(*args, **options)
        finally:
            _replace(library, read_map=read_map, read_scenario=read_scenario)

    def open(self, settings: Settings) -> Bus:
        """Open a scene, which needs most of the types and computes what a map needs of its roads."""
        _, store = self.types.read(settings)
        bus = Bus(store)
        Rosapi(bus)
        WebRepublisher(bus)
        self.make_simulator_node(bus, settings, None, None)
        return bus


def _record(bus: Bus) -> None:
    """Have what bags need of the types of all topics parsed."""
    texts = read_definitions("22.R2")
    with TemporaryDirectory() as folder:
        for bag in (open_bag(Path(folder) / "a.bag"), open_bag(Path(folder) / "a.mcap")):
            store = bus.store if bag.ros == bus.store.ros else Store(texts, leniency=LENIENCY, ros=bag.ros)
            writer = BagMessageWriter(bag, store, bus.store)
            for name, topic in bus.topics.items():
                writer.add(name, topic.type.name)
            writer.close()


@lru_cache(maxsize=4096)
def _types_in(text: str, name: str) -> Typesdict:
    """As `get_types_from_msg`; nobody changes what it returns."""
    return get_types_from_msg(text, name)


@lru_cache(maxsize=4096)
def _compiled(source: str) -> CodeType:
    return compile(source, "<string>", "exec")


def _run(source: str, names: dict[str, object]) -> None:
    """As `exec`."""
    exec(_compiled(source), names)  # noqa: S102 - the library's own code


def _replace(module: ModuleType, **functions: object) -> None:
    """Have a module use other functions than those that it imports."""
    assert vars(module).keys() >= functions.keys(), f"{module.__name__} uses other names"
    vars(module).update(functions)
