"""Loading scenarios over and over leaves nothing behind: the short sibling of `scripts/soak/loads.py`."""

from __future__ import annotations

import gc
import json
import logging
import random
import sys
from abc import ABCMeta
from collections import Counter

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.scene.load import WHOLE
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.state.world import World
from scripts.soak.scenes import BAD, GOOD, MISSING
from tests.simulator.sim_harness import ALL, Client, make_store
from tests.simulator.small_maps import KOREAN, ROADRUNNER, read

MAPS = {"track": KOREAN, "town": ROADRUNNER}


class SoakLibrary:
    """The scenes of the soak on two small maps, read anew each time."""

    def scenario(self, name: str) -> Scenario:
        if name in GOOD:
            return read_scenario(json.dumps(GOOD[name]).encode(), f"{name}.json")
        if name not in BAD:
            raise DocumentError(f"no scenario {name[:80]!r}")
        return read_scenario(BAD[name], f"{name}.json")

    def map(self, name: str) -> RoadMap:
        if name not in MAPS:
            raise DocumentError(f"no map {name!r}")
        return read(MAPS[name])


class Run:
    """A simulator with a listener and a client that loads."""

    def __init__(self) -> None:
        self.bus = Bus(make_store())
        self.world = World(seed=0)
        shelf = SoakLibrary()
        self.node = make_node(self.bus, self.world, shelf, shelf.scenario("things"), NodeSettings())
        self.client, self.listener = Client(self.bus, "/loader"), Client(self.bus, "/listener")
        self.listener.listen("/Ego_topic", "/Object_topic", "/CollisionData", "/IntscnTL_topic", "/SyncModeInfo")
        self.random = random.Random(0)  # noqa: S311
        self.is_sync = False

    def load(self, name: str) -> bool:
        """One load with options by chance, and a step after it."""
        chance = self.random.random
        options = {key: chance() < 0.7 for key in ALL}
        if chance() < 0.1:
            self.is_sync = not self.is_sync
            (self.client.start if self.is_sync else self.client.stop)()
        service = "/SyncModeScenarioLoad" if self.is_sync else "/Service_MoraiSL"
        frame = {"frame": self.world.frame + 1} if self.is_sync else {}
        result: bool = self.client.ask(service, file_name=name, **options, **frame)["result"]
        if self.is_sync:
            self.client.tick()
        else:
            self.node.advance(self.world.frame * 0.02)
        return result

    def census(self) -> Counter[str]:
        """How many objects of each type there are with a bare stage, and with nothing that anybody has heard."""
        if self.is_sync:
            self.client.stop()
            self.is_sync = False
        self.client.ask("/Service_MoraiSL", file_name="parked", **ALL)
        for one in (self.client, self.listener):
            one.heard.clear()
            one.raw.clear()
            one.told.clear()
        gc.unfreeze()  # some that are replaced were made when the tests were collected
        gc.collect()
        for one in gc.get_objects():
            if issubclass(type(one), ABCMeta):
                one._abc_caches_clear()  # answers of isinstance, which come and go with what other tests do
        counts = Counter(type(one).__qualname__ for one in gc.get_objects())
        gc.freeze()
        return counts


def fingerprint(run: Run) -> tuple[str, RoadMap]:
    return run.world.digest(), run.node.scene.road_map


@pytest.mark.slow
def test_hundreds_of_loads_leave_nothing_behind(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL, "rosbridge_sim")  # what is logged is kept for the report of a failed test
    run = Run()
    names = [*GOOD, *BAD, *MISSING]

    def some(num: int) -> None:
        for _ in range(num):
            name = run.random.choice(names)
            assert run.load(name) is (name in GOOD), name

    some(80)  # what is made once is made now
    topics, services = list(run.bus.topics), list(run.bus.services)
    before, blocks = run.census(), sys.getallocatedblocks()
    some(400)
    after = run.census()
    assert sys.getallocatedblocks() - blocks < 400, "less than one for each load, of any kind"
    assert (list(run.bus.topics), list(run.bus.services)) == (topics, services)
    # A few that are made at the first load of some kind; what a kind of load left behind would be ten times as many.
    grown = {name: after[name] - before[name] for name in after if after[name] > before[name] + 20}
    assert grown == {}


@pytest.fixture(scope="module")
def busy() -> Run:
    """A simulator for loads that change nothing."""
    run = Run()
    assert run.client.ask("/Service_MoraiSL", file_name="busy", **ALL)["result"]
    return run


@pytest.mark.parametrize("name", [*BAD, *MISSING])
def test_bad_load_changes_nothing_and_gives_the_reason(busy: Run, name: str) -> None:
    run = busy
    before = fingerprint(run)
    run.client.told.clear()
    assert run.client.ask("/Service_MoraiSL", file_name=name, **ALL) == {"result": False}
    assert fingerprint(run) == before
    ((level, text),) = run.client.told
    assert level == "error"
    assert text.startswith("/Service_MoraiSL: ")
    assert len(text) < 500
    run.client.start()
    assert run.client.ask("/SyncModeScenarioLoad", file_name=name, frame=1, **ALL)["result"] is False
    assert fingerprint(run) == before
    run.client.stop()


@pytest.mark.parametrize("name", ["busy", "junction"])
def test_agent_refused_by_the_world_undoes_the_whole_load(name: str) -> None:
    run = Run()
    before, roads, plan = fingerprint(run), run.world.roads, run.world.signals.plan
    load = run.node.scene.prepare(run.node.context.library.scenario(name), WHOLE)
    spawns = "others" if load.others else "egos"
    *placed, last = getattr(load, spawns)
    object.__setattr__(load, spawns, (*placed, replace(last, x=np.inf)))
    with pytest.raises(DocumentError, match=f"{name}: "):
        run.node.scene.carry_out(load)
    assert fingerprint(run) == before
    assert run.world.roads is roads, "though the scenario has another map"
    assert run.world.signals.plan is plan
