"""Assignments of each run: keys of the scenario, settings and the vehicle, by expressions over the parameters.

A target is `scenario.PATH`, a path in the scenario's document such as `vehicleList[0].initPosition.pos.x`;
`setting.KEY`, a setting of the server such as `setting.traffic`; or `vehicle`, the model of the ego. A parameter with
the name of such a target is not needed: `set` gives each target an expression, and most are a single name.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.campaigns.campaign_model import ParameterValue
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Expression, Value, parse_expression
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record

_PART: Final = re.compile(r"([A-Za-z_]\w*)((?:\[\d{1,5}\])*)")
_TARGET: Final = re.compile(r"(scenario|setting)\.(.+)|vehicle")

MAX_PATH: Final = 200
"""Longest path [characters]."""

Change = tuple[tuple[str | int, ...], Value]
"""Path in a document, and the new value there."""


class Assignment(Record):
    """One target and its value.

    Attributes:
        room: `scenario`, `setting` or `vehicle`.
        path: in the scenario's document; for a setting its key; empty for the vehicle.
        value: a constant, or an expression over the parameters and `seed`.
    """

    room: str
    path: tuple[str | int, ...]
    value: Value | Expression

    def value_in(self, names: Mapping[str, Value]) -> Value:
        """Return the value of a run.

        Args:
            names: its parameters, and `seed`.

        Raises:
            DocumentError: the expression has no value there.
        """
        return self.value(names) if isinstance(self.value, Expression) else self.value


def read_assignments(
    table: Mapping[str, ParameterValue], parameters: Sequence[str], source: str
) -> tuple[Assignment, ...]:
    """Read the table `set`.

    Args:
        table: target -> number, or text of an expression.
        source: name of the file, for errors.

    Raises:
        DocumentError: a target or an expression cannot be read.
    """
    known = frozenset({*parameters, "seed"})
    return tuple(
        _read(target, value, known, f"{source}: set.'{printable(target, 80)}'") for target, value in table.items()
    )


def _read(target: str, value: ParameterValue, known: frozenset[str], where: str) -> Assignment:
    found = _TARGET.fullmatch(target)
    if found is None:
        raise DocumentError(f"{where}: expected scenario.PATH, setting.KEY or vehicle")
    worth = parse_expression(value, where, known) if isinstance(value, str) else value
    if found[1] == "setting":
        return Assignment("setting", (found[2].replace("-", "_"),), worth)
    if found[1] == "scenario":
        return Assignment("scenario", _path_of(found[2], where), worth)
    if not isinstance(value, str):
        raise DocumentError(f"{where}: expected the name of a model in quotes within the text, got {value!r}")
    return Assignment("vehicle", (), worth)


def _path_of(text: str, where: str) -> tuple[str | int, ...]:
    path: list[str | int] = []
    if len(text) > MAX_PATH:
        raise DocumentError(f"{where}: expected a path of at most {MAX_PATH} characters, got {len(text):,}")
    for part in text.split("."):
        found = _PART.fullmatch(part)
        if found is None:
            raise DocumentError(f"{where}: expected a path such as vehicleList[0].initPosition.pos.x")
        path.append(found[1])
        path += [int(number) for number in re.findall(r"\d+", found[2])]
    return tuple(path)


def change_document(document: Any, changes: Sequence[Change], source: str) -> Any:  # noqa: ANN401 - any JSON
    """Return a copy of a JSON document with other values; parts that are not changed are shared.

    Args:
        changes: a key that is missing is added; an entry of a list, or a table on the way, must be there.
        source: name of the scenario, for errors.

    Raises:
        DocumentError: there is no such place.
    """
    for path, value in changes:
        document = _changed(document, path, 0, value, source)
    return document


def _changed(node: Any, path: Sequence[str | int], at: int, value: Value, source: str) -> Any:  # noqa: ANN401 - any JSON
    if at == len(path):
        return value
    key = path[at]
    if isinstance(key, int):
        if not isinstance(node, list) or key >= len(node):
            has = f"a list of {len(node)}" if isinstance(node, list) else "no list"
            raise DocumentError(f"{source}: {path_text(path[: at + 1])}: expected an entry of a list; there is {has}")
        return [*node[:key], _changed(node[key], path, at + 1, value, source), *node[key + 1 :]]
    if not isinstance(node, dict):
        raise DocumentError(f"{source}: {path_text(path[: at + 1])}: expected a table around it; there is none")
    inner = node.get(key, {} if at + 1 < len(path) and isinstance(path[at + 1], str) else None)
    return {**node, key: _changed(inner, path, at + 1, value, source)}


def path_text(path: Sequence[str | int]) -> str:
    """Return a path as it is written in a campaign."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).removeprefix(".")
