#!/usr/bin/env python3
"""Write schemas/scenario.schema.json, the JSON Schema of the scenario files that we read.

    python scripts/write_schemas.py

It is generated from the models that read the files; a test fails if it is out of date.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.morai.scenarios.model import scenario_schema  # noqa: E402


def schema_files() -> dict[Path, str]:
    """Return the generated schemas.

    Returns:
        Path -> text.
    """
    return {ROOT / "schemas" / "scenario.schema.json": json.dumps(scenario_schema(), indent=2) + "\n"}


if __name__ == "__main__":
    for path, text in schema_files().items():
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))
