#!/usr/bin/env python3
"""Write the generated pages and pictures of the documentation.

    python scripts/write_docs.py           writes docs/reference/*.md, docs/images/*.svg, the walks in architecture.md,
                                           and the arguments of Simulator in options.pyi
    python scripts/write_docs.py --check   writes nothing; lists outdated files and ends with code 1

Run it after a change of a setting, a definition, a topic, a service, the table of synchronous mode, an import
between rooms, or a function that each message or each tick passes. A test compares the files with the output of this
script, so change the sources, not the files.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from scripts.docs_pages.barrier import draw_barrier, write_barrier  # noqa: E402
from scripts.docs_pages.campaigns import write_campaigns  # noqa: E402
from scripts.docs_pages.environments import write_environments  # noqa: E402
from scripts.docs_pages.fields import write_fields  # noqa: E402
from scripts.docs_pages.flags import write_flags  # noqa: E402
from scripts.docs_pages.learning_curve import draw_learning_curve  # noqa: E402
from scripts.docs_pages.mock import write_mock  # noqa: E402
from scripts.docs_pages.options import write_options  # noqa: E402
from scripts.docs_pages.rooms import PACKAGE_ROOMS, SHELL_ROOMS, SIMULATOR_ROOMS, WORLD_ROOMS, draw_rooms  # noqa: E402
from scripts.docs_pages.sync_mode import draw_states, write_table  # noqa: E402
from scripts.walks import write_walks  # noqa: E402

DOCS: Final = ROOT / "docs"

GENERATED: Final[dict[str, Callable[[], str]]] = {
    "architecture.md": write_walks,
    "reference/flags.md": write_flags,
    "../rosbridge_sim/shell/config/options.pyi": write_options,
    "reference/campaigns.md": write_campaigns,
    "reference/mock.md": write_mock,
    "reference/environments.md": write_environments,
    "reference/fields_22.md": lambda: write_fields("22.R2"),
    "reference/fields_26.md": lambda: write_fields("26.R1"),
    "reference/sync_table.md": write_table,
    "reference/barrier_table.md": write_barrier,
    "images/sync_mode.svg": draw_states,
    "images/barrier.svg": draw_barrier,
    "images/learning_curve.svg": draw_learning_curve,
    "images/rooms.svg": lambda: draw_rooms(ROOT / "rosbridge_sim", PACKAGE_ROOMS),
    "images/rooms_shell.svg": lambda: draw_rooms(ROOT / "rosbridge_sim", SHELL_ROOMS),
    "images/rooms_simulator.svg": lambda: draw_rooms(ROOT / "rosbridge_sim", SIMULATOR_ROOMS),
    "images/rooms_world.svg": lambda: draw_rooms(ROOT / "rosbridge_sim", WORLD_ROOMS),
}
"""File in `docs/` -> function that returns its text."""


def find_outdated() -> list[str]:
    """Return the generated files that are missing or out of date.

    Returns:
        Their names within `docs/`.
    """
    return [name for name, write in GENERATED.items() if _text_of(DOCS / name) != write()]


def _text_of(path: Path) -> str | None:
    return path.read_text("utf-8") if path.is_file() else None


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="write nothing; code 1 if a file is out of date")
    if parser.parse_args().check:
        outdated = find_outdated()
        for name in outdated:
            print(f"docs/{name} is out of date: run python scripts/write_docs.py", file=sys.stderr)
        return 1 if outdated else 0
    for name, write in GENERATED.items():
        path = DOCS / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(write(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
