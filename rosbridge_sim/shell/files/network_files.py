"""Network settings of scenarios on the disk: `Network/NAME.toml` in the folder of `--data-dir`.

Without it, MORAI's own file is read: `Network/NAME_MN.json`, or `Network/NAME.json`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.config.settings_file import read_network
from rosbridge_sim.shell.files.file_names import safe_parts
from rosbridge_sim.simulator.bus.network_settings import NetworkSettings

NETWORK_FOLDER = "Network"
"""Folder for network settings within the data folder, with MORAI's name."""


ENDINGS: Final = (".toml", "_MN.json", ".json")
"""Ends of the names of the files, the preferred one first."""


class DiskNetworks:
    """Network settings by the name of their scenario, read when they are needed."""

    def __init__(self, root: str | Path) -> None:
        """Set the folder: `Network` in `root`; neither has to exist."""
        self._folder = Path(root) / NETWORK_FOLDER

    def network(self, scenario: str) -> NetworkSettings | None:
        """Return the settings of a scenario; None if there is no such file.

        Args:
            scenario: NAME, NAME.json or MAP/NAME.

        Raises:
            DocumentError: the name is not valid or leads out of the folder, or the file cannot be used.
        """
        name = safe_parts(scenario)[-1].removesuffix(".json")
        candidates = (self._folder / (name + ending) for ending in ENDINGS)
        path = next((one for one in candidates if one.is_file()), None)
        if path is None:
            return None
        if not path.resolve().is_relative_to(self._folder.resolve()):
            raise DocumentError(f"{path.name!r} leads out of {self._folder}")
        return read_network(path)
