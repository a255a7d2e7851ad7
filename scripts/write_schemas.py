#!/usr/bin/env python3
"""Write the JSON Schemas of the files that we read: schemas/*.schema.json, for scenarios, sensors and their noise.

    python scripts/write_schemas.py

They are generated from the models that read the files; a test fails if one is out of date.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.scenarios.scenario_model import scenario_schema  # noqa: E402
from rosbridge_sim.simulator.sensors.sensor_noise import noise_schema  # noqa: E402
from rosbridge_sim.simulator.sensors.sensor_presets import rig_schema  # noqa: E402


def schema_files() -> dict[Path, str]:
    """Return the generated schemas.

    Returns:
        Path -> text.
    """
    schemas = {"scenario": scenario_schema(), "sensor_noise": noise_schema(), "sensors": rig_schema()}
    return {
        ROOT / "schemas" / f"{name}.schema.json": json.dumps(schema, indent=2) + "\n"
        for name, schema in schemas.items()
    }


if __name__ == "__main__":
    for path, text in schema_files().items():
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))
