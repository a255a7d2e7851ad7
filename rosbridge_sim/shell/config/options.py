"""The keyword arguments of `Simulator`. Type checkers read `options.pyi`, which has the types of all keys."""

from __future__ import annotations

from typing import Any, TypedDict

from rosbridge_sim.shell.config.flag_table import FLAGS

SimulatorOptions = TypedDict(  # type: ignore[misc] # its keys are those of a table, which a type checker cannot read
    "SimulatorOptions", {key.replace("-", "_"): Any for key in FLAGS}, total=False
)
