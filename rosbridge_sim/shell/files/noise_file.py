"""The errors of sensors that the user chooses: by a word, or in a file."""

from __future__ import annotations

from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.bounded_read import read_bounded
from rosbridge_sim.simulator.sensors.sensor_noise import MAX_NOISE_BYTES, TYPICAL, SensorNoise, read_noise


def read_sensor_noise(choice: str) -> SensorNoise | None:
    """Return the errors of the sensors; None for none.

    Args:
        choice: `none`, `typical`, or the path of a file.

    Raises:
        DocumentError: the file cannot be read or used.
    """
    if choice == "none":
        return None
    if choice == "typical":
        return TYPICAL
    path = Path(choice)
    if not path.suffix and not path.exists():
        raise DocumentError(f"--sensor-noise: expected none, typical or a file, got {choice[:80]!r}")
    return read_noise(read_bounded(path, MAX_NOISE_BYTES), str(path))
