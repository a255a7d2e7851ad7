"""The component of `/sim/scene/mesh`: what stands still of the scene as triangles, for programs that draw it.

It is made in a thread when it is first asked for, and kept as long as map and seed are the same.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Final

from rosbridge_sim.errors import DocumentError, FieldError, GraphError, Reason
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenery.mesh_pages import MeshPages, mesh_pages
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.reading import answering
from rosbridge_sim.simulator.sim_services.late_answers import answer_or_fail
from rosbridge_sim.simulator.sim_services.road_services import RoadServices

MAX_LANES: Final = 10_000
"""Lanes of a map that is drawn: the 284 lanes of `town` take 4 s of a thread and 0.5 MB, those of a city minutes."""

MAX_WAITING: Final = 64
"""Calls that may wait for the thread: as many pages as usual tabs ask for at once."""


class SceneMesh(Component):
    """The component of the mesh. It holds no state but what any program would make anew from map and seed."""

    def __init__(self, context: SimulatorContext, road_services: RoadServices, *, is_dressed: bool) -> None:
        """Offer nothing yet.

        Args:
            road_services: has the digest of the map.
            is_dressed: with buildings, trees and posts beside the roads.
        """
        self._context = context
        self._road_services = road_services
        self._is_dressed = is_dressed
        self._key: tuple[RoadMap, int] | None = None
        self._made: MeshPages | None = None
        self._waiting: list[Call] = []

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service that exists once, not for each ego."""
        bindings.provide("sim/scene/mesh", "rosbridge_sim_msgs/SceneMesh", self._tell)

    def _tell(self, call: Call, now: float) -> None:
        scene = self._context.scene
        key = (scene.road_map, self._context.world.seed)
        is_same = self._key is not None and self._key[0] is key[0] and self._key[1] == key[1]
        if is_same and self._made is not None:
            self._answer(call, self._made)
        elif len(self._context.world.roads) > MAX_LANES:
            call.fail(GraphError(f"the map has more than {MAX_LANES:,} lanes", reason=Reason.TOO_MUCH))
        elif len(self._waiting) >= MAX_WAITING:
            text = f"{MAX_WAITING} calls wait for the mesh; ask again after one of the answers"
            call.fail(GraphError(text, reason=Reason.TOO_FAST))
        else:
            self._waiting.append(call)
            if not is_same:
                self._key, self._made = key, None
                self._make(key, scene.found_map.name, now)

    def _make(self, key: tuple[RoadMap, int], name: str, now: float) -> None:
        road_map, seed = key

        def work() -> MeshPages:
            from rosbridge_sim.scenery.static.static_mesh import static_mesh  # noqa: PLC0415 - twelve modules, for who draws

            return mesh_pages(static_mesh(road_map, name, seed, is_dressed=self._is_dressed))

        def then(outcome: MeshPages | DocumentError, now: float) -> None:
            if self._key is not key:
                return  # the map has changed meanwhile: the calls wait for the mesh of the new one
            waiting, self._waiting = self._waiting, []
            if isinstance(outcome, DocumentError):
                self._key = None
            else:
                self._made = outcome
            for call in waiting:
                end = answering(call.refuse, partial(self._end, call))
                self._context.bus.guard.attempt("an answer with the mesh", end, outcome, now)

        self._context.reader.read(work, then, now)

    def _end(self, call: Call, outcome: MeshPages | DocumentError, _now: float) -> None:
        answer_or_fail(call, outcome, partial(self._answer, call))

    def _answer(self, call: Call, mesh: MeshPages) -> None:
        request: Any = call.request
        if request.page >= len(mesh.pages):
            text = f"page: expected 0..{len(mesh.pages) - 1}, got {request.page}" if mesh.pages else "no roads"
            call.fail(FieldError(text))
            return
        page = mesh.pages[request.page]
        places = dict(zip("xyz", page.middle, strict=True))
        scales = dict(zip(("scale_x", "scale_y", "scale_z"), page.scale, strict=True))
        call.respond(
            result=True,
            digest=mesh.digest,
            map_digest=self._road_services.drawing.digest,
            page=request.page,
            num_pages=len(mesh.pages),
            **places,
            **scales,
            num_vertices=page.num_vertices,
            num_triangles=page.num_triangles,
            palette=page.palette,
            data=page.data,
        )
