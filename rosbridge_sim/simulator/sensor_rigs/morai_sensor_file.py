"""MORAI's own presets of sensors: `SaveFile/Sensor/<release>/<name>.json`.

Places and angles are texts there, in metres and degrees from the middle of the rear axle. Angles are 0 to 360: a pitch
of 355 looks 5 deg up. `cameraFOV` is the horizontal field of view: in saved files `focalLengthpixel` is
width / (2 tan(cameraFOV / 2)). The size of the picture is twice the principal point, which is its exact middle.

What this simulator does not serve becomes a remark, and the rest of the file is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta

from rosbridge_sim.documents.document_model import Document, DocumentType
from rosbridge_sim.documents.document_reading import read_values
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import read_rig
from rosbridge_sim.simulator.sensors.morai_items import Item, Reading
from rosbridge_sim.simulator.sensors.sensor_specs import Rig, SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import KINDS, MAX_SENSORS

_ULTRASONIC: Final = "UltrasonicList"
_LISTS: Final = [*(name for kind in KINDS for name in kind.morai_lists), _ULTRASONIC]
_Items = Annotated[tuple[Item, ...], Meta(max_length=4 * MAX_SENSORS)]
_File = msgspec.defstruct(
    "_File", [(name, _Items, ()) for name in _LISTS], bases=(Document,), frozen=True, kw_only=True
)
_DOCUMENT: Final = DocumentType[Any](_File)


def is_morai_file(document: object) -> bool:
    """Return whether a JSON document is a preset of MORAI: it has one of its lists."""
    return isinstance(document, dict) and any(name in document for name in _LISTS)


def read_morai_sensors(document: object, source: str) -> tuple[Rig, list[str]]:
    """Read a preset of MORAI.

    Args:
        source: its name, for errors.

    Returns:
        The rig, and a remark for each thing that is not as the file has it, one line each.

    Raises:
        DocumentError: one line with the place and the mistake.
    """
    file = read_values(_DOCUMENT, document, source)
    reading, table = Reading(), dict[str, Any]()

    def items_of(kind: type[SensorSpec]) -> Iterator[Item]:
        return reading.of_ego(kind.morai_noun, [item for name in kind.morai_lists for item in getattr(file, name)])

    for kind in KINDS:
        if not kind.is_on_each_ego:
            table[kind.kind] = [kind().of_morai(item, reading) for item in items_of(kind)]
    if num := len(getattr(file, _ULTRASONIC)):
        reading.remarks.append(f"ultrasonic sensors are not simulated: {num} left out")
    for kind in KINDS:
        if kind.is_on_each_ego and (found := list(items_of(kind))):
            if len(found) > 1:
                reading.remarks.append(f"an ego has one {kind.morai_noun}: {len(found) - 1} left out")
            table[kind.kind] = kind().of_morai(found[0], reading)
    if not any(table.values()):
        raise DocumentError(f"{source}: expected sensors, got none")
    return read_rig(table, source), reading.remarks
