#!/usr/bin/env python3
"""Draw the built-in maps and the scenarios on them: `track` with `demo`, the others with their namesakes.

    python scripts/draw_maps.py    writes rosbridge_sim/data/{maps,scenarios}/...

The files have MORAI's formats (MGeo, scenario JSON) with our own numbers. Tests compare the files with the output of
this script, so change the script, not the files. `rosbridge-sim scenario check NAME --picture FILE.png` shows the
result.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from scripts.drawing.hills import hills_files, hills_scenario  # noqa: E402
from scripts.drawing.loop import loop_files, loop_scenario  # noqa: E402
from scripts.drawing.motorway import motorway_files, motorway_scenario, rush_hour_scenario  # noqa: E402
from scripts.drawing.parking import parking_files, parking_scenario  # noqa: E402
from scripts.drawing.roundabout import roundabout_files, roundabout_scenario  # noqa: E402
from scripts.drawing.town import town_files, town_scenario  # noqa: E402
from scripts.drawing.track import demo_scenario, track_files  # noqa: E402

DATA = ROOT / "rosbridge_sim" / "data"

MAPS = {
    "track": track_files,
    "town": town_files,
    "loop": loop_files,
    "hills": hills_files,
    "motorway": motorway_files,
    "roundabout": roundabout_files,
    "parking": parking_files,
}
SCENARIOS = {
    "demo": demo_scenario,
    "town": town_scenario,
    "loop": loop_scenario,
    "hills": hills_scenario,
    "motorway": motorway_scenario,
    "rush_hour": rush_hour_scenario,
    "roundabout": roundabout_scenario,
    "parking": parking_scenario,
}


def drawn() -> dict[Path, bytes]:
    """Return all files.

    Returns:
        Path -> content.
    """
    files = {DATA / "maps" / name / file: text for name, draw in MAPS.items() for file, text in draw().items()}
    return files | {DATA / "scenarios" / f"{name}.json": draw() for name, draw in SCENARIOS.items()}


def main() -> None:
    """Write the files."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for path, text in drawn().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text)
        print(f"{path.relative_to(ROOT)}: {len(text):,} bytes")


if __name__ == "__main__":
    main()
