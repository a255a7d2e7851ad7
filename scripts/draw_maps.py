#!/usr/bin/env python3
"""Draw the built-in maps and the scenarios on them: `track` with `demo`, `town` and `loop` with their namesakes.

    python scripts/draw_maps.py               writes rosbridge_sim/data/{maps,scenarios}/...
    python scripts/draw_maps.py --svg FOLDER  also draws pictures of what the readers make of the files

The files are MORAI's formats (MGeo, scenario JSON) with numbers of our own. Tests compare the files with what this
script draws: change the script, not the files.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.morai.mgeo import read_map  # noqa: E402
from rosbridge_sim.morai.scenario import place_on_roads, read_scenario  # noqa: E402
from scripts.drawing.loop import loop_files, loop_scenario  # noqa: E402
from scripts.drawing.picture import picture  # noqa: E402
from scripts.drawing.town import town_files, town_scenario  # noqa: E402
from scripts.drawing.track import demo_scenario, track_files  # noqa: E402

__all__ = ["demo_scenario", "drawn", "track_files"]

DATA = ROOT / "rosbridge_sim" / "data"

MAPS = {"track": track_files, "town": town_files, "loop": loop_files}
SCENARIOS = {"demo": ("track", demo_scenario), "town": ("town", town_scenario), "loop": ("loop", loop_scenario)}


def drawn() -> dict[Path, bytes]:
    """All files, by where they belong."""
    files = {DATA / "maps" / name / file: text for name, draw in MAPS.items() for file, text in draw().items()}
    return files | {DATA / "scenarios" / f"{name}.json": draw() for name, (_, draw) in SCENARIOS.items()}


def main() -> None:
    """Write the files, and the pictures if they are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--svg", type=Path, metavar="FOLDER", help="also draw a picture of each scenario")
    parser.add_argument("--scale", type=float, default=1.0, help="draw cars and people larger than life")
    arguments = parser.parse_args()
    for path, text in drawn().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text)
        print(f"{path.relative_to(ROOT)}: {len(text):,} bytes")
    for name, (map_name, draw) in SCENARIOS.items() if arguments.svg else ():
        road_map = read_map(MAPS[map_name](), map_name)
        scenario = place_on_roads(read_scenario(draw(), f"{name}.json"), road_map.roads)
        path = arguments.svg / f"{name}.svg"
        path.write_text(picture(road_map, scenario, arguments.scale), encoding="utf-8")
        print(path)


if __name__ == "__main__":
    main()
