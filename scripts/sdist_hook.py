"""Build hook of the sdist: leaves `.gitignore` out.

hatchling selects the files by `.gitignore` and adds that file to every sdist, even if it is excluded. It is useless
without a repository, and a packager's own repository would obey it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class SdistHook(BuildHookInterface[Any]):  # Any: the configuration of a builder, which is not used
    """The hook; hatchling finds it because it is the only hook in the file that `pyproject.toml` names."""

    def initialize(self, _version: str, build_data: dict[str, Any]) -> None:  # Any: the interface says so
        """Remove `.gitignore` from the files that are added to the selected ones."""
        build_data["force_include"].pop(str(Path(self.root, ".gitignore")), None)
