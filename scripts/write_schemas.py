#!/usr/bin/env python3
"""Write the JSON Schemas of the files that we read, and the bodies of entities that the web page draws.

    python scripts/write_schemas.py

schemas/*.schema.json (files that users write) come from the models that read the files,
page/bodies.json from the shapes that cameras see. A test fails if one is out of date.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.campaigns.campaign_model import campaign_schema  # noqa: E402
from rosbridge_sim.contracts.contract import CONTRACT  # noqa: E402
from rosbridge_sim.documents.document_reading import document_schema  # noqa: E402
from rosbridge_sim.maps.signal_plan_file import plan_schema  # noqa: E402
from rosbridge_sim.mock.mock_model import MOCK  # noqa: E402
from rosbridge_sim.scenarios.scenario_model import scenario_schema  # noqa: E402
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import rig_schema  # noqa: E402
from rosbridge_sim.simulator.sensors.sensor_noise import noise_schema  # noqa: E402
from scripts.drawing.body_forms import body_forms  # noqa: E402


def schema_files() -> dict[Path, str]:
    """Return the generated files.

    Returns:
        Path -> text.
    """
    schemas = {
        "campaign": campaign_schema(),
        "contract": document_schema(CONTRACT),
        "mock": document_schema(MOCK),
        "scenario": scenario_schema(),
        "sensor_noise": noise_schema(),
        "sensors": rig_schema(),
        "signal_plan": plan_schema(),
    }
    files = {
        ROOT / "schemas" / f"{name}.schema.json": json.dumps(schema, indent=2) + "\n"
        for name, schema in schemas.items()
    }
    bodies = ",\n".join(f'"{name}":{json.dumps(form, separators=(",", ":"))}' for name, form in body_forms().items())
    files[ROOT / "rosbridge_sim" / "page" / "bodies.json"] = f"{{{bodies}}}\n"
    return files


if __name__ == "__main__":
    for path, text in schema_files().items():
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))
