"""Lists of the scenarios and recordings that can be loaded from the disk, and pictures of scenarios.

All of it is done in threads of the reader. Pictures are kept until their files change.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.scenario_reader import place_on_roads
from rosbridge_sim.shell.bags.recordings import list_recordings
from rosbridge_sim.shell.files.document_cache import DocumentCache
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.scene.scene import DEFAULT_MAP
from rosbridge_sim.simulator.sim_services.scenario_services import ListedRecording, ListedScenario, Listing

MAX_PICTURES: Final = 64
"""Pictures that are kept: a page of a list, and some more; 20 kB each as a rule."""

MAX_FILES: Final = 256 * 2**20
"""Size of the files of all pictures that are kept [bytes]. The files are not kept, so the bound may be high."""


class DiskShelf:
    """Lists and pictures of a library."""

    def __init__(self, library: DiskLibrary, data_dir: str | Path) -> None:
        """Read nothing yet.

        Args:
            data_dir: folder with recordings; it need not exist.
        """
        self._library = library
        self._data_dir = Path(data_dir)
        self._pictures = DocumentCache(MAX_PICTURES, MAX_FILES)

    def list(self, first: int, count: int) -> Listing:
        """See `ScenarioShelf`."""
        names = self._library.all_scenario_names()
        recordings = list_recordings(self._data_dir)
        return Listing(
            [self._describe(name) for name in names[first : first + count]],
            len(names),
            [_measure(name, path) for name, path in recordings[first : first + count]],
            len(recordings),
        )

    def picture(self, name: str, width: int, height: int) -> bytes:
        """See `ScenarioShelf`."""
        scenario = self._library.scenario(name)
        map_name = scenario.map_name or DEFAULT_MAP
        files = [self._library.scenario_path(name), *self._library.map_files(map_name)]

        def draw() -> bytes:
            # Imported here: Pillow takes a tenth of a second, and most servers draw nothing.
            from rosbridge_sim.shell.drawing.map_picture import draw_thumbnail  # noqa: PLC0415

            road_map = self._library.map(map_name)
            placed = place_on_roads(scenario, road_map.roads)
            agents = (*placed.egos, *placed.vehicles, *placed.pedestrians, *placed.obstacles)
            return draw_thumbnail(road_map, width, height, agents)

        return self._pictures.get(f"{width}x{height}", files[0], files, draw)

    def _describe(self, name: str) -> ListedScenario:
        try:
            scenario = self._library.scenario(name)
        except DocumentError as error:
            return ListedScenario(name, "", 0, 0, 0, 0, str(error))
        problem = ""
        if scenario.map_name is not None:
            try:
                self._library.map_path(scenario.map_name)
            except DocumentError as error:
                problem = str(error)
        return ListedScenario(
            name,
            scenario.map_name or "",
            num_egos=len(scenario.egos),
            num_vehicles=len(scenario.vehicles),
            num_pedestrians=len(scenario.pedestrians),
            num_obstacles=len(scenario.obstacles),
            problem=problem,
        )


def _measure(name: str, path: Path) -> ListedRecording:
    """Return a recording with its size and age; zeros where the disk does not tell."""
    size = modified_ns = 0
    with suppress(OSError):
        for file in path.iterdir() if path.is_dir() else (path,):
            stat = file.stat()
            size, modified_ns = size + stat.st_size, max(modified_ns, stat.st_mtime_ns)
    return ListedRecording(name, size, modified_ns)
