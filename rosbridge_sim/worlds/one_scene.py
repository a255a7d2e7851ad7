"""One of many worlds with its scene and its traffic, as a server would have them."""

from __future__ import annotations

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.messages.command_parsing import GhostPose
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.scene.load import FoundMap, Library, Load
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, MAX_EGOS
from rosbridge_sim.simulator.sim_services.traffic_demand import Traffic
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.state.world import Gear, Snapshot

TRAFFIC_INTERVAL = 10
"""Frames from one look of traffic to the next, see `traffic_demand`."""


class SavedScene(Record):
    """A copy of a world with its scene; opaque.

    Attributes:
        world, loaded, found, next_uid, traffic: what `OneScene` restores.
    """

    world: Snapshot
    loaded: Load
    found: FoundMap
    next_uid: int
    traffic: PlainData


class OneScene:
    """A world, its scene and its traffic.

    Attributes:
        world: moved by a `WorldSet`.
        scene: its population.
        hooks: the moments at which the traffic acts; a caller calls those of `after_frame`.
        has_traffic: vehicles come and go.

    Args:
        world: empty.
        traffic: vehicles besides those of the scenario, at most.
        model: of the egos; None for that of the scenario.
        num_egos: number of egos. Further ones begin where the first one does.

    Raises:
        DocumentError: the scenario does not fit its map.
        ValueError: there would be too many egos, or none.
    """

    def __init__(
        self,
        world: OneOfMany,
        library: Library,
        scenario: Scenario,
        traffic: int,
        model: Model | None,
        *,
        num_egos: int = 1,
    ) -> None:
        self.world, self.hooks = world, Hooks()
        if not 1 <= num_egos <= MAX_EGOS:
            raise ValueError(f"egos: expected 1..{MAX_EGOS}, got {num_egos!r}")
        if scenario.story is not None:
            raise DocumentError(
                f"{scenario.name}: stories of OpenSCENARIO, and events of rosbridge_sim blocks, are told by a server or"
                " a campaign, not by Worlds and environments; use rosbridge-sim --scenario"
            )
        if model is not None:
            scenario = replace(scenario, egos=tuple(replace(ego, model=model) for ego in scenario.egos))
        self.scene = Scene(world, library, scenario, ego_gear=Gear.DRIVE)
        self._num_more = num_egos - 1
        self._add_egos()
        self.traffic = Traffic(self.scene, self.hooks, lambda: None, traffic)

    def after_frame(self) -> None:
        """Let vehicles come and go; nothing on most frames."""
        for act in self.hooks.after_frame.awake:
            act(0.0)

    def reset(self, seed: int | None) -> None:
        """Begin the opening scene again at frame 0; the seed None keeps the present one."""
        is_scoring = self.world.is_scoring
        self.scene.reset(seed)
        self._add_egos()
        for forget in self.hooks.on_reset:
            forget()
        for follow in self.hooks.on_new_scene:
            follow(0.0)
        if is_scoring:
            self.world.start_scoring()

    def _add_egos(self) -> None:
        """Add the egos beyond the first one."""
        world = self.world
        for _ in range(self._num_more):
            row = world.row(FIRST_EGO)
            pose = GhostPose(*(float(getattr(world, name)[row]) for name in ("x", "y", "z", "roll", "pitch", "yaw")))
            self.scene.add_ego(FIRST_EGO, pose, Gear.DRIVE)

    def save(self) -> SavedScene:
        """Return a copy of all that decides what will happen."""
        scene = self.scene
        return SavedScene(
            self.world.snapshot(), scene.loaded, scene.found_map, scene.next_uid, self.traffic.save_state()
        )

    def load(self, saved: SavedScene) -> None:
        """Become what was saved, in this world or in another one of the same set."""
        self.scene.restore(saved.world, loaded=saved.loaded, found=saved.found, next_uid=saved.next_uid)
        self.traffic.load_state(saved.traffic, 0.0)
