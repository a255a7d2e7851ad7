"""The cameras, lidars and radars that the user chooses: by a name, or in a file of ours or of MORAI."""

from __future__ import annotations

import logging
from pathlib import Path

from rosbridge_sim.documents.document_reading import parse_json
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.config.toml_text import read_toml
from rosbridge_sim.shell.files.bounded_read import read_bounded
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import MAX_SENSORS_BYTES, PRESETS, read_rig
from rosbridge_sim.simulator.sensors.sensor_specs import Rig
from rosbridge_sim.suggestions import hint

_log = logging.getLogger("rosbridge_sim.app")


def read_sensors(choice: str) -> Rig:
    """Return the sensors of each ego; what a file of MORAI has and this simulator has not is logged.

    Args:
        choice: the name of a preset, or the path of a *.toml or *.json file.

    Raises:
        DocumentError: the file cannot be read or used.
    """
    rig = PRESETS.get(choice)
    if rig is not None:
        return rig
    path = Path(choice)
    if not path.suffix and not path.exists():
        names = ", ".join(PRESETS)
        raise DocumentError(f"--sensors: expected {names} or a file, got {choice[:80]!r}{hint(choice, PRESETS)}")
    if path.suffix.lower() == ".toml":
        return read_rig(read_toml(path)[1], str(path))
    from rosbridge_sim.simulator.sensor_rigs.morai_sensor_file import (  # noqa: PLC0415 - most servers have no file
        is_morai_file,
        read_morai_sensors,
    )

    text = read_bounded(path, MAX_SENSORS_BYTES)
    document = parse_json(text, str(path), MAX_SENSORS_BYTES)
    if not is_morai_file(document):
        return read_rig(document, str(path))
    rig, remarks = read_morai_sensors(document, str(path))
    for remark in remarks:
        _log.info("%s: %s", path, remark)
    return rig
