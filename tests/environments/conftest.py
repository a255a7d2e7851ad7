"""Environments of the tests: each map is read once for all of them, and not by each environment."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim import Worlds
from rosbridge_sim.shell.files.library import DiskLibrary

LIBRARY = DiskLibrary()


class WorldsOfOneLibrary(Worlds):
    def __init__(self, *args: Any, **options: Any) -> None:  # noqa: ANN401 - those of Worlds
        super().__init__(*args, **{**options, "library": LIBRARY})


@pytest.fixture(autouse=True)
def one_library(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")
    monkeypatch.setattr("rosbridge_sim.environments.driving_vector_env.Worlds", WorldsOfOneLibrary)
