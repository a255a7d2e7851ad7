#!/usr/bin/env python3
"""Write the JSON Schemas of the files that we read, and the bodies of entities that the web page draws.

    python scripts/write_schemas.py

schemas/*.schema.json (files that users write) come from the models that read the files,
page/bodies.json from the shapes that cameras see. A test fails if one is out of date.
"""

from __future__ import annotations

import inspect
import json
import sys
from pathlib import Path
from typing import Any, Final

import msgspec

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.campaigns.campaign_model import CAMPAIGN  # noqa: E402
from rosbridge_sim.contracts.contract import CONTRACT  # noqa: E402
from rosbridge_sim.documents.document_model import SPELLED, DocumentType  # noqa: E402
from rosbridge_sim.loose_types import JsonValue  # noqa: E402
from rosbridge_sim.maps.signal_plan_file import PLAN_FILE  # noqa: E402
from rosbridge_sim.mock.mock_model import MOCK  # noqa: E402
from rosbridge_sim.scenarios.scenario_model import SCENARIO  # noqa: E402
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import SENSOR_FILE  # noqa: E402
from rosbridge_sim.simulator.sensors.sensor_noise import NOISE  # noqa: E402
from scripts.drawing.body_forms import body_forms  # noqa: E402


def document_schema(kind: DocumentType[Any]) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a document."""
    (top,), parts = msgspec.json.schema_components([kind.form], ref_template="#/$defs/{name}")
    whole: dict[str, Any] = _plain(parts.pop(top["$ref"].rpartition("/")[2]))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **whole, "$defs": _plain(parts)}


_NUMBER_TEXT: Final = r"^\s*[+-]?\d*(,\d{3})*\.?\d*([eE][+-]?\d{1,3})?\s*$"
"""Pattern of texts that may be numbers."""


def _plain(schema: JsonValue) -> JsonValue:
    """Return a schema without null as a default, with one `type` for "this or null", and with texts for numbers."""
    if isinstance(schema, list):
        return [_plain(item) for item in schema]
    if not isinstance(schema, dict):
        return inspect.cleandoc(schema) if isinstance(schema, str) else schema
    plain = {key: _plain(value) for key, value in schema.items() if not (key == "default" and value is None)}
    if plain.pop(SPELLED, False):
        plain |= {"type": [plain["type"], "string"], "pattern": _NUMBER_TEXT}
    if "enum" in plain:
        plain["type"] = "string"
    match plain.get("anyOf"):
        case [{"type": str() | list() as kind, **rest}, {"type": "null"}] if "enum" not in rest:
            del plain["anyOf"]
            kinds = [kind] if isinstance(kind, str) else kind
            return {"type": [*kinds, "null"], **rest, **plain}
    return plain


def schema_files() -> dict[Path, str]:
    """Return the generated files.

    Returns:
        Path -> text.
    """
    schemas = {
        "campaign": document_schema(CAMPAIGN),
        "contract": document_schema(CONTRACT),
        "mock": document_schema(MOCK),
        "scenario": {**document_schema(SCENARIO), "title": "Scenario"},
        "sensor_noise": document_schema(NOISE),
        "sensors": document_schema(SENSOR_FILE),
        "signal_plan": {**document_schema(PLAN_FILE), "title": "Signal plan"},
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
