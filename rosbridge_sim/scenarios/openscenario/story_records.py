"""Records of a story: its items, and the texts that it is made of.

A server without stories imports no more of them than this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from rosbridge_sim.records import Record, field

MAX_STORY_BYTES: Final = 1 << 21
"""Largest file, of a scenario or of catalogues: 2 MiB. The largest of 288 public ones has 0.1 MB."""

BLOCKS: Final = b"{"
"""Beginning of the text of a story that is made of blocks `rosbridge_sim`."""


class StoryItem(Record, eq=False):
    """An element of a story.

    Attributes:
        kind: its tag in OpenSCENARIO.
        values: of the attributes that are there, by name.
        parts: items within it, in order.
        where: file and line.
    """

    kind: str
    values: Mapping[str, Any]  # float, int, bool or str, as the grammar says
    parts: tuple[StoryItem, ...]
    where: str

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - the grammar has the type
        """Return the value of an attribute that must be there."""
        return self.values[name]

    def get(self, name: str, default: Any = None) -> Any:  # noqa: ANN401 - the same
        """Return the value of an attribute, or a default."""
        return self.values.get(name, default)

    def part(self, *kinds: str) -> StoryItem:
        """Return the first part of one of these kinds, or of any kind; the grammar says that there is one."""
        found = self.find(*kinds)
        assert found is not None, (self.kind, kinds)
        return found

    def find(self, *kinds: str) -> StoryItem | None:
        """Return the first part of one of these kinds, or of any kind; None if there is none."""
        for part in self.parts:  # a step of a story looks for thousands
            if not kinds or part.kind in kinds:
                return part
        return None

    def within(self, kind: str) -> tuple[StoryItem, ...]:
        """Return the parts of the first part of a kind; none if there is none."""
        found = self.find(kind)
        return () if found is None else found.parts

    def all(self, kind: str) -> tuple[StoryItem, ...]:
        """Return all parts of a kind."""
        return tuple([part for part in self.parts if part.kind == kind])


class Findings(Record, eq=False):
    """Mistakes and remarks about a file: one text each, with file and line.

    Attributes:
        mistakes: what is wrong.
        refused: what is right and not supported.
        idle: what is kept without effect.
        notes: what is read in another way than it is written.
    """

    mistakes: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    idle: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class StoryText(Record):
    """The texts that a story is made of, and how they are read.

    Attributes:
        source: name of the file, for errors.
        text: its bytes.
        catalogues: names and bytes of the files of catalogues, in order.
        parameters: values that count in place of those of the file.
        ego: name of the entity that is the ego; empty for the rule of `choose_ego`.
        is_lenient: leave out what is refused.
        drives_ego: the story moves the ego, not the user's program.
    """

    source: str
    text: bytes
    catalogues: tuple[tuple[str, bytes], ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    ego: str = ""
    is_lenient: bool = False
    drives_ego: bool = False


class Story(Record, eq=False):
    """A story.

    Attributes:
        text: what it is made of.
        entities: `ScenarioObject` items by name, in order.
        ego: name of the entity that is the ego; empty if there is none.
        init: `Actions` of `Init`.
        storyboard: acts, events, conditions.
        holds: of pedestrians by name, MORAI's `activeDistance` and `moveDistance`: how near an ego is when one begins
            to move, and its longest way; 0 for none [m].
        controllers: `TrafficSignalController` items by name.
        evaluation: MORAI's groups of conditions; None for none.
        parameters, variables: values at the start, by name.
        map_file: path of the map as the file spells it; empty for none.
        map_name: name of the map in MORAI's addition; empty for none.
        findings: what is told about the file.
    """

    text: StoryText
    entities: Mapping[str, StoryItem]
    ego: str
    init: StoryItem
    storyboard: StoryItem
    holds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    controllers: Mapping[str, StoryItem] = field(default_factory=dict)
    evaluation: StoryItem | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    variables: Mapping[str, str] = field(default_factory=dict)
    map_file: str = ""
    map_name: str = ""
    findings: Findings = field(default_factory=Findings)

    @property
    def is_of_blocks(self) -> bool:
        """True for a story of MORAI's JSON: its entities are items of the scenario, by their places in the document."""
        return self.text.text.startswith(BLOCKS)
