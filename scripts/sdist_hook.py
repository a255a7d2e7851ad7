"""A step of the sdist's build: leave `.gitignore` out.

hatchling chooses the files by `.gitignore` and adds that file to every sdist, whatever is excluded. It is of no use
where there is no repository, and there a packager's own repository would follow it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class SdistHook(BuildHookInterface[Any]):  # Any: the configuration of a builder, which is not used
    """The hook; hatchling finds it because it is the only one in the file that `pyproject.toml` names."""

    def initialize(self, _version: str, build_data: dict[str, Any]) -> None:  # Any: the interface says so
        """Take `.gitignore` out of what is added to the files that were chosen."""
        build_data["force_include"].pop(str(Path(self.root, ".gitignore")), None)
