"""The component of `/sim/scenarios` and `/sim/scenario_picture`: what can be loaded, and what it looks like.

Both read files, so the `Reader` does the work, in a thread as a rule, and only the asking client waits. Loading is by
MORAI's own services.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Protocol

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.records import Record, asdict
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.sim_services.late_answers import LateAnswers, failing

MAX_LISTED: Final = 50
"""Scenarios of one answer: each is a file of 10 to 100 kB that is read, some 2 ms."""

MAX_WAITING: Final = 8
"""Lists and pictures that may wait for the thread; loads of scenarios wait behind them, some 0.1 s for each."""

MIN_SIDE: Final = 64
MAX_SIDE: Final = 1024
"""Bounds of a picture's sides [px]: a larger one would take the thread longer than a second on a city."""

USUAL_SIDES: Final = (320, 200)
"""Width and height of a picture, if a request leaves them open [px]: a tile of a list."""

MAX_NAME: Final = 400
"""Longest name of a scenario, with its folders [characters]."""


class ListedScenario(Record):
    """A scenario; the fields are those of a ScenarioInfo."""

    name: str
    map_name: str
    num_egos: int
    num_vehicles: int
    num_pedestrians: int
    num_obstacles: int
    problem: str


class ListedRecording(Record):
    """A recording.

    Attributes:
        name: for a replay.
        size: of its files [bytes].
        modified_ns: when it was written, time of day [ns].
    """

    name: str
    size: int
    modified_ns: int


class Listing(Record):
    """A page of scenarios and recordings, and how many there are in all."""

    scenarios: Sequence[ListedScenario]
    num_scenarios: int
    recordings: Sequence[ListedRecording]
    num_recordings: int


class ScenarioShelf(Protocol):
    """Source of the list and of pictures; the shell reads the disk. Its methods may be called from any thread."""

    def list(self, first: int, count: int) -> Listing:
        """Return a page of what can be loaded.

        Args:
            first: index of the first scenario and of the first recording.
            count: how many of each at most.

        Raises:
            DocumentError: a folder cannot be read.
        """

    def picture(self, name: str, width: int, height: int) -> bytes:
        """Return the picture of a scenario, as a PNG file.

        Args:
            width: [px].
            height: [px].

        Raises:
            DocumentError: there is no such scenario, or it cannot be drawn.
        """


class Scenarios(Component):
    """The component of what can be loaded. It holds no state but the number of those that wait."""

    def __init__(self, context: SimulatorContext, shelf: ScenarioShelf | None) -> None:
        """Offer nothing yet.

        Args:
            shelf: the source; None where there is none.
        """
        self._context = context
        self._shelf = shelf
        self._late = LateAnswers(context)
        self._make_scenario = context.maker(
            "rosbridge_sim_msgs/ScenarioInfo",
            "name map num_egos num_vehicles num_pedestrians num_obstacles is_loaded problem",
        )
        self._make_recording = context.maker("rosbridge_sim_msgs/RecordingInfo", "name size modified")

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/scenarios", "rosbridge_sim_msgs/Scenarios", failing(self._tell_list))
        bindings.provide("sim/scenario_picture", "rosbridge_sim_msgs/ScenarioPicture", failing(self._tell_picture))

    def _tell_list(self, call: Call, now: float) -> None:
        request: Any = call.request
        first, count = request.first, min(request.count or MAX_LISTED, MAX_LISTED)

        def answer(found: Listing) -> None:
            loaded = self._context.scene.loaded.name
            time_value = self._context.bus.store.time_value
            scenarios = []
            for each in found.scenarios:
                *fields, problem = asdict(each).values()  # in the order of the message
                scenarios.append(self._make_scenario(*fields, each.name.rpartition("/")[2] == loaded, problem))
            recordings = [
                self._make_recording(each.name, each.size, time_value(max(each.modified_ns, 0)))
                for each in found.recordings
            ]
            call.respond(
                result=True,
                scenarios=scenarios,
                num_scenarios=found.num_scenarios,
                recordings=recordings,
                num_recordings=found.num_recordings,
            )

        shelf = self._open_shelf()
        self._late.find(call, lambda: shelf.list(first, count), answer, now, Reason.REFUSED)

    def _tell_picture(self, call: Call, now: float) -> None:
        request: Any = call.request
        name, shelf = request.name, self._open_shelf()
        width, height = request.width or USUAL_SIDES[0], request.height or USUAL_SIDES[1]
        for field, side in (("width", width), ("height", height)):
            if not MIN_SIDE <= side <= MAX_SIDE:
                raise FieldError(f"{field}: expected {MIN_SIDE}..{MAX_SIDE} pixels, or 0; got {side}")
        if len(name) > MAX_NAME:
            raise FieldError(f"name: expected at most {MAX_NAME} characters, got {len(name):,}")

        def answer(data: bytes) -> None:
            call.respond(result=True, format="png", data=data)

        self._late.find(call, lambda: shelf.picture(name, width, height), answer, now, Reason.REFUSED)

    def _open_shelf(self) -> ScenarioShelf:
        """Return the shelf.

        Raises:
            GraphError: there is none, or too many calls wait for it.
        """
        if self._shelf is None:
            raise GraphError("this simulator has no folder with scenarios", reason=Reason.REFUSED)
        if self._late.num_waiting >= MAX_WAITING:
            text = f"{MAX_WAITING} lists and pictures are being made; ask again after one of the answers"
            raise GraphError(text, reason=Reason.TOO_FAST)
        return self._shelf
