"""Keyword arguments of `Simulator`: the same names as the settings, with types that take at least theirs."""

from __future__ import annotations

import importlib.util
import sys
import types
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice
from rosbridge_sim.simulator.simulator_node import NodeSettings
from tests.cpu_time import run
from tests.support import ROOT, miss

STUB = ROOT / "rosbridge_sim" / "shell" / "config" / "options.pyi"
"""What type checkers read in place of `options.py`."""


def hints_of_stub() -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(STUB.read_text(), str(STUB), "exec", dont_inherit=True), names)  # noqa: S102 - a file of ours
    return get_type_hints(names["SimulatorOptions"])


OPTIONS = hints_of_stub()

SETTINGS = get_type_hints(Settings, localns={"InterfaceChoice": InterfaceChoice})


def parts_of(hint: object) -> set[object]:
    """The types that a hint allows, words of a Literal each by itself; of tables and lists, the kind alone."""
    origin = get_origin(hint)
    if origin in {Union, types.UnionType}:
        return {part for one in get_args(hint) for part in parts_of(one)}
    if origin is Literal:
        return {("word", word) for word in get_args(hint)}
    return {{tuple: Sequence, Sequence: Sequence, Mapping: Mapping}.get(origin, hint)} if origin else {hint}


@pytest.mark.parametrize("name", [field.name for field in fields(Settings)])
def test_option_takes_each_value_of_its_setting(name: str) -> None:
    assert parts_of(OPTIONS[name]) >= parts_of(SETTINGS[name])


def test_the_type_at_run_time_has_the_keys_of_the_stub() -> None:
    assert SimulatorOptions.__annotations__.keys() == OPTIONS.keys()


def refused_by_type_checkers() -> None:
    """Mistakes that mypy finds: without one it would call the comment unused, and nobody calls this function."""
    Simulator(port=0, scenario="town", publishers={"/Ego_topic": {"rate": 10}}, max_frame_size="1MiB")
    Simulator(prot=0)  # type: ignore[call-arg]
    Simulator(port="zero")  # type: ignore[arg-type]
    Simulator(start="later")  # type: ignore[arg-type]


@pytest.mark.long  # lint does the same for `refused_by_type_checkers`
def test_type_checker_refuses_what_the_run_refuses(tmp_path: Path) -> None:
    if importlib.util.find_spec("mypy") is None:
        miss("needs mypy: pip install -e '.[lint]'")
    program = tmp_path / "program.py"
    program.write_text(
        "from rosbridge_sim import Simulator\n"
        "Simulator(port=0, scenario='town', publishers={'/Ego_topic': {'rate': 10}}, max_frame_size='1MiB')\n"
        "Simulator(prot=0)\n"
        "Simulator(port='zero')\n"
        "Simulator(start='later')\n"
    )
    done = run(
        [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--cache-dir", str(tmp_path), program],
        cwd=ROOT,
    )
    wrong = [line.split(":")[1] for line in done.stdout.splitlines() if ": error: " in line]
    assert wrong == ["3", "4", "5"], done.stdout


def test_settings_that_the_simulator_takes_as_they_are_have_its_types() -> None:
    own = get_type_hints(NodeSettings)
    made = {"profile", "catalogue", "sensor_noise", "sensors", "weather"}  # from words, by `make_simulator_node`
    same = (own.keys() & SETTINGS.keys()) - made
    assert len(same) > 12
    assert {name: own[name] for name in same} == {name: SETTINGS[name] for name in same}
