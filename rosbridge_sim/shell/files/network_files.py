"""Network settings of scenarios on the disk: `Network/NAME.toml` in the folder of `--data-dir`."""

from __future__ import annotations

from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.interfaces.network_settings import NetworkSettings
from rosbridge_sim.shell.config.settings_file import read_network
from rosbridge_sim.shell.files.names import safe_parts

__all__ = ["DiskNetworks"]

NETWORK_FOLDER = "Network"
"""Folder for network settings within the data folder, with MORAI's name."""


class DiskNetworks:
    """Network settings by the name of their scenario, read when they are needed."""

    def __init__(self, root: str | Path) -> None:
        """Set the folder: `Network` in `root`; neither has to exist.

        Args:
            root: the data folder.
        """
        self._folder = Path(root) / NETWORK_FOLDER

    def network(self, scenario: str) -> NetworkSettings | None:
        """Return the settings of a scenario; None if there is no such file.

        Args:
            scenario: NAME, NAME.json or MAP/NAME.

        Raises:
            DocumentError: the name is not valid or leads out of the folder, or the file cannot be used.
        """
        path = self._folder / (safe_parts(scenario)[-1].removesuffix(".json") + ".toml")
        if not path.is_file():
            return None
        if not path.resolve().is_relative_to(self._folder.resolve()):
            raise DocumentError(f"{path.name!r} leads out of {self._folder}")
        return read_network(path)
