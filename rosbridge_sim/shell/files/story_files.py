"""Files of OpenSCENARIO on the disk: a scenario, its catalogues, and the path of its map.

The paths in a file are relative to its folder. Those in a file that a client names must stay within the folders of
`--scenario-path`, links included.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record, field
from rosbridge_sim.scenarios.openscenario.story_records import MAX_STORY_BYTES, StoryText
from rosbridge_sim.shell.files.bounded_read import read_bounded
from rosbridge_sim.shell.files.other_formats import find_other_format

SUFFIX: Final = ".xosc"

MAX_CATALOGUES: Final = 64
"""Most files of catalogues of a scenario; those of the public repositories have up to 12."""

MAX_NAMES: Final = 1_000
"""Most files of a folder that are looked at."""


class StoryOptions(Record):
    """Options for reading stories, see `StoryText`.

    Attributes:
        parameters: of the scenario that the server is started with; of others those that they declare.
    """

    parameters: Mapping[str, str] = field(default_factory=dict)
    ego: str = ""
    is_lenient: bool = False
    drives_ego: bool = False


def read_parameters(texts: Sequence[str]) -> dict[str, str]:
    """Return `NAME=VALUE` texts as values by name.

    Raises:
        DocumentError: one has no `=`.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise DocumentError(f"--param: expected NAME=VALUE, got {printable(text, 60)!r}")
        found[name.strip()] = value.strip()
    return found


def is_story(name: str, text: bytes) -> bool:
    """Return whether a file is one of OpenSCENARIO, by its content; by its name where it is no XML at all."""
    form = find_other_format(name, text)
    return form == "OpenSCENARIO" or (form in {"", "XML"} and name.lower().endswith(SUFFIX) and text[:1] != b"{")


def declared_of(text: bytes, source: str, parameters: Mapping[str, str]) -> dict[str, str]:
    """Return those of the parameters that a scenario declares itself.

    Raises:
        DocumentError: it is no OpenSCENARIO.
    """
    if not parameters:
        return {}
    from rosbridge_sim.scenarios.openscenario.story import declared_parameters  # noqa: PLC0415 - few servers read a story

    declared = declared_parameters(text, source)
    return {name: value for name, value in parameters.items() if name in declared}


def collect_story(path: Path, text: bytes, options: StoryOptions, within: Sequence[Path] | None) -> StoryText:
    """Return the texts of a scenario and its catalogues.

    Args:
        path: of the scenario.
        text: its bytes.
        within: folders that all files must be in; None for any.

    Raises:
        DocumentError: a file cannot be read, or is elsewhere.
    """
    from rosbridge_sim.scenarios.openscenario.story import catalogue_folders  # noqa: PLC0415 - few servers read a story

    catalogues: list[tuple[str, bytes]] = []
    for folder in catalogue_folders(text, path.name, options.parameters):
        at = resolve_within(path.parent / folder, folder, within)
        if not at.is_dir():
            continue  # many files name folders that they do not use
        for file in sorted(islice(at.iterdir(), MAX_NAMES)):
            if file.suffix.lower() != SUFFIX:
                continue
            if len(catalogues) >= MAX_CATALOGUES:
                raise DocumentError(f"{path.name}: expected at most {MAX_CATALOGUES} files of catalogues")
            file = resolve_within(file, file.name, within)  # noqa: PLW2901 - where a link leads
            catalogues.append((file.name, read_bounded(file, MAX_STORY_BYTES)))
    return StoryText(
        path.name,
        text,
        tuple(catalogues),
        options.parameters,
        options.ego,
        is_lenient=options.is_lenient,
        drives_ego=options.drives_ego,
    )


def resolve_within(path: Path, shown: str, within: Sequence[Path] | None) -> Path:
    """Return a path without links and `..`.

    Raises:
        DocumentError: it leads out of all folders.
    """
    try:
        found = path.resolve()
    except (OSError, RuntimeError, ValueError):  # a loop of links, or a name that no disk can have
        raise DocumentError(f"{printable(shown, 80)!r}: there is no such path") from None
    if within is not None and not any(found.is_relative_to(folder.resolve()) for folder in within):
        raise DocumentError(f"{printable(shown, 80)!r} leads out of --scenario-path")
    return found
