"""Read a thousand spoilt copies of OpenDRIVE files: each gives a map or one sentence.

    scripts/judges/opendrive_fuzz.py FILE.xodr... [--num 1000] [--seed 0]

Prints how many were read and refused, the longest time of one, and the seeds of any that ended otherwise: with another
error, with a text of several lines, or without the file's name. Exit code 1 if there is any.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from tests.maps.opendrive.spoilt_files import spoil

MAX_TEXT = 600
"""Longest sentence [characters]."""


def main() -> int:
    """Run the judge on files."""
    parser = argparse.ArgumentParser()
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--num", type=int, default=1_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    contents = [(path.name, path.read_bytes()) for path in options.files]
    read = refused = bad = 0
    slowest = (0.0, -1)
    for seed in range(options.seed, options.seed + options.num):
        name, content = contents[seed % len(contents)]
        begun = time.process_time()
        try:
            read_opendrive([spoil(content, seed)], name).roads.derived(LaneConflicts)
            read += 1
        except DocumentError as error:
            refused += 1
            text = str(error)
            if "\n" in text or not text.startswith(name) or len(text) > MAX_TEXT:
                bad += 1
                print(f"seed {seed} of {name}: {text[:MAX_TEXT]!r}")
        except Exception:  # noqa: BLE001 - that is what is looked for
            bad += 1
            print(f"seed {seed} of {name}:\n{traceback.format_exc(limit=-3)}")
        slowest = max(slowest, (time.process_time() - begun, seed))
    slow = f"the slowest took {slowest[0]:.1f} s of CPU time (seed {slowest[1]})"
    print(f"{read} read, {refused} refused, {bad} bad; {slow}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
